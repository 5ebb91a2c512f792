//! Processors without AVX, FMA and SSE4: gprop and ONNX Runtime choose their instructions at run time. QEMU emulates such a processor.

use std::io::ErrorKind;
use std::process::Command;

use crate::run::{gprop, hammer};
use crate::segment::models::tiny;
use crate::support::{skipped, stderr};

/// The first of all x86-64: SSE3 and nothing later.
const OLDEST: &str = "Opteron_G1";

#[test]
fn the_oldest_x86_64_runs_gprop_and_onnx_runtime() {
    const TEST: &str = "the_oldest_x86_64_runs_gprop_and_onnx_runtime";
    let Some(models) = tiny(TEST, "multi_mask") else { return };
    let scene = hammer();
    let mut emulated = Command::new("qemu-x86_64");
    emulated.args(["-cpu", OLDEST]).arg(gprop().get_program()).arg("run").arg(scene.path());
    emulated.args(["--to", "segment", "--view-list", "003", "--points-per-side", "2"]);
    emulated.arg("--ort-lib").arg(models.onnxruntime);
    emulated.arg("--sam-encoder").arg(models.encoder).arg("--sam-decoder").arg(models.decoder);
    match emulated.output() {
        Ok(output) => assert!(output.status.success(), "{}: {}", output.status, stderr(&output)),
        Err(error) if error.kind() == ErrorKind::NotFound => skipped(TEST, "qemu-x86_64 is not installed"),
        Err(error) => panic!("{error}"),
    }
    assert!(scene.path().join("gprop/segments/003.png").is_file());
}
