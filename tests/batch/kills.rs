//! A batch that is killed at random moments and started again comes to the bytes of one that was left alone.
//!
//! Excepted are `run.json` of each scene and the outcomes of the batch, which hold how long things took.

use std::process::Stdio;
use std::time::{Duration, Instant};

use super::ball::Balls;
use super::{batch, contents, lines, outcomes};
use crate::vote::build::Noise;

const KILLS: usize = 20;
/// Of the moments: the same kills on every machine, as shares of an undisturbed run's length.
const SEED: u64 = 11;

#[test]
fn twenty_kills_leave_no_trace() {
    let balls = Balls::new(3);
    let (calm, killed) = (balls.folder().with_file_name("calm"), balls.folder().with_file_name("killed"));
    let since = Instant::now();
    outcomes(&mut batch(&balls, &["--jobs", "2", "--out", calm.to_str().unwrap()]), 0);
    let whole = since.elapsed();

    let mut noise = Noise(SEED);
    let mut survived = 0;
    for kill in 0..KILLS {
        // Every third start does everything anew, or most kills would find nothing left to do.
        let mut command = batch(&balls, &["--jobs", "2", "--out", killed.to_str().unwrap()]);
        if kill % 3 == 0 {
            command.args(["--from", "scene"]);
        }
        let mut process = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(whole.mul_f32(noise.next()) + Duration::from_millis(5));
        survived += usize::from(process.try_wait().unwrap().is_some());
        process.kill().unwrap();
        process.wait().unwrap();
    }
    assert!(survived <= KILLS / 2, "{survived} of {KILLS} batches had ended before they were killed");
    // No waiting: what the last kill left running must not be in the way.
    outcomes(&mut batch(&balls, &["--jobs", "2", "--out", killed.to_str().unwrap()]), 0);

    for scene in ["ball-0", "ball-1", "ball-2"] {
        let (calm, killed) = (contents(&calm.join(scene)), contents(&killed.join(scene)));
        let paths =
            |found: &[(std::path::PathBuf, Vec<u8>)]| found.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
        assert_eq!(paths(&calm), paths(&killed), "{scene}: also temporary files count");
        assert!(calm == killed, "{scene}");
    }
    let done = |out: &std::path::Path| {
        let kept = lines(&out.join("batch/shard-0-of-1.jsonl"));
        kept.iter()
            .map(|line| (line["scene"].clone(), line["state"].clone(), line["mass_kg"].clone()))
            .collect::<Vec<_>>()
    };
    assert_eq!(done(&calm), done(&killed));
    let left = contents(&killed.join("batch"));
    assert!(left.iter().all(|(path, _)| !path.to_string_lossy().contains(".tmp-")), "{left:?}");
}
