//! A batch that is killed at random moments and started again ends with the same bytes as one that was not disturbed.
//!
//! The exceptions are `run.json` of each scene and the outcomes of the batch, which contain durations.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Instant;

use super::ball::Balls;
use super::{batch, contents, lines, outcomes};
use crate::vote::build::Noise;

const KILLS: usize = 20;
/// Seed of the moments, which are shares of an undisturbed run's duration: the same sequence on every machine.
const SEED: u64 = 11;
const SCENES: usize = 3;

#[test]
fn twenty_kills_leave_no_trace() {
    let balls = Balls::new(SCENES);
    let (calm, killed) = (balls.folder().with_file_name("calm"), balls.folder().with_file_name("killed"));
    let start = |out: &Path| batch(&balls, &["--jobs", "2", "--out", out.to_str().unwrap()]);
    let since = Instant::now();
    outcomes(&mut start(&calm), 0);
    // The machine's speed only affects when the kills happen; the test holds wherever they hit.
    let mut whole = since.elapsed();
    forget_answers(&balls);

    let mut noise = Noise(SEED);
    let (mut hits, mut wholes) = (0, 0);
    while hits < KILLS {
        assert!(wholes < 10 * KILLS, "only {hits} of {wholes} batches were still there to be killed");
        let since = Instant::now();
        let mut process = start(&killed).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(whole.mul_f32(noise.next()));
        if process.try_wait().unwrap().is_none() {
            process.kill().unwrap();
            process.wait().unwrap();
            hits += 1;
            continue;
        }
        // The batch finished in spite of the earlier kills: its result is checked and a new one begins, with kills no
        // later than this duration, in case the machine has become faster.
        whole = whole.min(since.elapsed());
        assert_same(&calm, &killed);
        fs::remove_dir_all(&killed).unwrap();
        forget_answers(&balls);
        wholes += 1;
    }
    // Without waiting: processes that the last kill left running must not interfere.
    outcomes(&mut start(&killed), 0);
    assert_same(&calm, &killed);
}

/// Removes the answers, so that they are asked for again and kills hit that too.
fn forget_answers(balls: &Balls) {
    (0..SCENES).for_each(|scene| fs::remove_dir_all(balls.scene(scene).join("recorded")).unwrap());
}

#[track_caller]
fn assert_same(calm: &Path, killed: &Path) {
    let paths = |found: &[(PathBuf, Vec<u8>)]| found.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
    for scene in ["ball-0", "ball-1", "ball-2"] {
        let (calm, killed) = (contents(&calm.join(scene)), contents(&killed.join(scene)));
        assert_eq!(paths(&calm), paths(&killed), "{scene}: also temporary files count");
        assert!(calm == killed, "{scene}");
    }
    let done = |out: &Path| {
        let kept = lines(&out.join("batch/shard-0-of-1.jsonl"));
        kept.iter()
            .map(|line| (line["scene"].clone(), line["state"].clone(), line["mass_kg"].clone()))
            .collect::<Vec<_>>()
    };
    assert_eq!(done(calm), done(killed));
    let left = contents(&killed.join("batch"));
    assert!(left.iter().all(|(path, _)| !path.to_string_lossy().contains(".tmp-")), "{left:?}");
}
