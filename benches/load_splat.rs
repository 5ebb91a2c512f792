//! Loads a splat and prints how long that takes, compared with reading its bytes, and how much memory it takes.
//! `benches/scene_plyfile.py` runs it for the comparison with plyfile.
//!
//! Prints `load_s`, `read_s` (seconds, best of five) and `peak_over_size` (memory that the first load adds at its peak, over
//! the file's size; Linux, NaN elsewhere); then the same of ply-rs-bw, which reads bodies into a map of properties for each
//! Gaussian, as `ply_rs_s` and `ply_rs_peak_over_size`.

#![allow(clippy::disallowed_methods, reason = "a benchmark is not gprop")]

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::Instant;

use gprop::scene::splat::ply;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::DefaultElement;

const RUNS: usize = 5;

fn main() -> anyhow::Result<()> {
    let path = std::env::args_os().nth(1).ok_or_else(|| anyhow::anyhow!("usage: load_splat FILE.ply"))?;
    let path = Path::new(&path);
    let size = path.metadata()?.len();
    let (first, peak) = with_peak(|| ply::read(path));
    drop(first?);
    println!("load_s {}", best(|| ply::read(path).map(|loaded| loaded.gaussians.len()))?);
    println!("read_s {}", best(|| std::fs::read(path).map(|bytes| bytes.len()))?);
    println!("peak_over_size {}", peak / size as f64);
    let with_ply_rs = || Parser::<DefaultElement>::new().read_ply(&mut BufReader::new(File::open(path)?));
    let (first, peak) = with_peak(with_ply_rs);
    drop(first?);
    println!("ply_rs_s {}", best(with_ply_rs)?);
    println!("ply_rs_peak_over_size {}", peak / size as f64);
    Ok(())
}

/// Seconds of the fastest run.
fn best<T, E>(mut action: impl FnMut() -> Result<T, E>) -> Result<f64, E> {
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Instant::now();
        std::hint::black_box(action()?);
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}

/// The result, and the bytes of resident memory that it added at its peak; NaN where `/proc` does not say.
fn with_peak<T>(action: impl FnOnce() -> T) -> (T, f64) {
    // Resets the peak.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let before = memory("VmRSS:");
    let made = action();
    let peak = memory("VmHWM:").zip(before).map_or(f64::NAN, |(peak, before)| peak - before);
    (made, peak)
}

/// A line of `/proc/self/status` in bytes; `None` if there is no such file.
fn memory(what: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with(what))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? * 1024.0)
}
