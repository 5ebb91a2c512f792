//! Runs that are killed, run out of disk space, or ask a server that fails, at random and one after the other. Whenever
//! one of them finishes with every segment answered, its files are the same bytes as those of an undisturbed run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

use super::Mounted;
use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::query::{a, completion, good_answer};
use crate::run::gprop;
use crate::support::server::{MockServer, Response};
use crate::vote::build::Noise;

/// Number of runs for which a test has time; the environment variable `GPROP_CHAOS_RUNS` sets another.
const RUNS: usize = 32;
/// Seed of the faults: the same sequence on every machine, although the point that a kill hits depends on its speed.
const SEED: u64 = 17;

/// A server that answers correctly or, for a given share of the requests, fails in one of many ways.
struct FailingServer {
    server: MockServer,
    failures_in_a_hundred: std::sync::Arc<AtomicU32>,
}

impl FailingServer {
    fn new() -> Self {
        let failures_in_a_hundred = std::sync::Arc::new(AtomicU32::new(0));
        let (share, count) = (failures_in_a_hundred.clone(), AtomicU32::new(0));
        let good = completion(&good_answer(a("wood")).to_string());
        let server = MockServer::new(move |_| {
            let number = count.fetch_add(1, Ordering::Relaxed);
            // 61 and 100 have no common factor: of every hundred requests exactly this share fails.
            if number.wrapping_mul(61) % 100 >= share.load(Ordering::Relaxed) {
                return Response::new(200).json(&good);
            }
            match number % 5 {
                0 => Response::new(500).text("overloaded"),
                1 => Response::new(429).header("retry-after", "86400"),
                2 => Response::new(200).text("{\"choices\": [{\"mess"),
                3 => Response::new(200).json(completion("it is made of cheese")),
                _ => Response::new(401).text("who are you?"),
            }
        });
        Self { server, failures_in_a_hundred }
    }

    fn fails(&self, in_a_hundred: u32) {
        self.failures_in_a_hundred.store(in_a_hundred, Ordering::Relaxed);
    }
}

/// Copies the scene's own files without the results of runs.
fn copy_scene(from: &Path, to: &Path) {
    for (file, bytes) in contents(from) {
        let target = to.join(file);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::write(target, bytes).unwrap();
    }
}

fn forget(scene: &Path) {
    for folder in ["gprop", "recorded"] {
        if let Err(error) = fs::remove_dir_all(scene.join(folder)) {
            assert_eq!(error.kind(), std::io::ErrorKind::NotFound, "{error}");
        }
    }
}

fn bytes_in(folder: &Path) -> u64 {
    contents(folder).iter().map(|(_, bytes)| bytes.len().next_multiple_of(4096) as u64).sum()
}

#[test]
fn whatever_disturbed_runs_leave_the_last_one_makes_the_same_bytes() {
    const NAME: &str = "whatever_disturbed_runs_leave_the_last_one_makes_the_same_bytes";
    let runs = std::env::var("GPROP_CHAOS_RUNS").map_or(RUNS, |runs| runs.parse().unwrap());
    let Some(disk) = Mounted::new(NAME, "size=64m") else { return };
    let balls = Balls::new(1);
    let scene = disk.at.path().join("scene");
    copy_scene(&balls.scene(0), &scene);
    let server = FailingServer::new();
    let start = || {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("run").arg(&scene).args(["--to", "parts", "-q", "--lmm-retries", "0"]);
        let url = format!("{}/v1", server.server.uri());
        command.args(["--lmm-url", &url, "--lmm-model", "test-model"]);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command
    };
    let result = || -> Vec<(PathBuf, Vec<u8>)> { contents(&scene.join("gprop")) };

    let since = Instant::now();
    let first = start().output().unwrap();
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let (whole, calm) = (since.elapsed(), result());
    let (own, size) = (bytes_in(&balls.scene(0)), bytes_in(&scene));
    forget(&scene);

    let mut noise = Noise(SEED);
    let (mut kills, mut full, mut refused, mut incomplete, mut whole_runs) = (0, 0, 0, 0, 0);
    for run in 0..runs {
        let kind = (noise.next() * 4.0) as u32;
        server.fails(if kind == 2 { (noise.next() * 100.0) as u32 } else { 0 });
        if kind == 1 {
            // From no more space than the last run used to more than a run needs.
            let share = f64::from(noise.next()) * 1.2;
            let limit = own + ((size - own) as f64 * share) as u64;
            disk.remount(&format!("size={}k", limit.max(bytes_in(&scene)) / 1024 + 16));
        }
        let mut process = start().spawn().unwrap();
        if kind == 0 {
            // Up to the time of an undisturbed run: what is checked holds wherever the kill hits.
            std::thread::sleep(whole.mul_f32(noise.next()));
            // Fails if the process has already ended by itself.
            let _ = process.kill();
        }
        let output = process.wait_with_output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        match output.status.code() {
            None => kills += 1,
            Some(0) if kind == 2 && result() != calm => incomplete += 1,
            Some(0) => {
                assert!(result() == calm, "run {run} of kind {kind} came to its end with other bytes\n{message}");
                whole_runs += 1;
                forget(&scene);
            }
            Some(2) if kind == 1 => full += 1,
            Some(5) if kind == 1 || kind == 2 => refused += 1,
            code => panic!("run {run} of kind {kind} ended with {code:?}\n{message}"),
        }
        disk.remount("size=64m");
    }
    println!(
        "{runs} runs: {kills} killed, {full} without space, {refused} without an answer, {incomplete} with some, {whole_runs} whole"
    );
    assert!(kills > 0 && full > 0 && refused + incomplete > 0 && whole_runs > 0, "each kind of fault has hit");
    server.fails(0);
    assert!(start().status().unwrap().success());
    assert!(result() == calm);
}
