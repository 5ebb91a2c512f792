//! Loads a splat and prints how long that takes, compared with reading its bytes, and how much memory it takes.
//! `benches/scene_plyfile.py` runs it for the comparison with plyfile.
//!
//! Prints `load_s`, `read_s` (seconds, best of five) and `peak_over_size` (peak resident memory of the first load over the
//! file's size; Linux); then the same of ply-rs-bw, which reads bodies into a map of properties for each Gaussian, as
//! `ply_rs_s` and `ply_rs_peak_over_size`.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::Instant;

use gprop::scene::ply;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::DefaultElement;

const RUNS: usize = 5;

fn main() -> anyhow::Result<()> {
    let path = std::env::args_os().nth(1).ok_or_else(|| anyhow::anyhow!("usage: load_splat FILE.ply"))?;
    let path = Path::new(&path);
    let size = path.metadata()?.len();
    let before = resident_peak();
    let first = ply::read(path)?;
    let peak = resident_peak() - before;
    drop(first);
    println!("load_s {}", best(|| ply::read(path).map(|loaded| loaded.gaussians.len()))?);
    println!("read_s {}", best(|| std::fs::read(path).map(|bytes| bytes.len()))?);
    println!("peak_over_size {}", peak as f64 / size as f64);
    let with_ply_rs = || Parser::<DefaultElement>::new().read_ply(&mut BufReader::new(File::open(path)?));
    let before = resident_peak();
    drop(with_ply_rs()?);
    let peak = resident_peak() - before;
    println!("ply_rs_s {}", best(with_ply_rs)?);
    println!("ply_rs_peak_over_size {}", peak as f64 / size as f64);
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

/// Most memory that was ever resident, bytes.
fn resident_peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes: u64 = line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0);
    kilobytes * 1024
}
