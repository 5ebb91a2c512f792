//! Faults of the machine during a run: no disk space, no permission, files that disappear, a clock that is set back,
//! links that lead elsewhere. Each run ends with a message that says what to do, leaves nothing half-written, and the
//! next run completes the work.

// Small files that unpack to gigabytes.
mod bombs;
// Files of a work folder that were changed.
pub mod changed;
// Commands that gprop suggests.
mod commands;
// Files whose work would grow with the square of their size.
mod effort;
mod growth;
// Kills, full disks and failing servers in any order.
mod chaos;
// Locks: who holds one, and that processes that have ended hold none.
pub mod locks;
// Meshes without triangles, with positions that are not numbers, with textures that unpack to gigabytes.
mod meshes;
// Named pipes and devices in place of files.
mod pipes;
// Read-only work folders.
mod read_only;
// Scenes that try to have gprop write elsewhere.
pub mod hostile;
// Scenes that try to have gprop read elsewhere, or send the key elsewhere.
mod outside;
// Splats whose Gaussians no trainer wrote.
mod splats;
// Text that would move a terminal's cursor.
mod terminal;

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, SystemTime};

use gprop::ErrorKind;
use gprop::pipeline::{Options, Pipeline, Plan, Stage};

use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::run::gprop;
use crate::support::skipped;

fn run(balls: &Balls, out: &Path) -> Output {
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).args(["--to", "parts", "-q", "--out"]).arg(out);
    command.args(balls.answers()).output().unwrap()
}

/// Expects exit code `code` and a single error message that contains these words.
#[track_caller]
fn assert_refused(output: &Output, code: i32, words: &[&str]) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert_eq!(message.matches("error:").count(), 1, "{message}");
    for word in words {
        assert!(message.contains(word), "no {word:?} in: {message}");
    }
}

/// Checks that every file is complete: the same as the file that an undisturbed run writes.
#[track_caller]
fn assert_nothing_half_written(disturbed: &Path, calm: &Path) {
    let calm = contents(calm);
    for (path, bytes) in contents(disturbed) {
        let whole = calm.iter().find(|(known, _)| *known == path);
        // A list of the views that are done grows from view to view.
        let grows = path.ends_with("segments.json");
        assert!(whole.is_some_and(|(_, whole)| *whole == bytes || grows), "{path:?} is half-written or too much");
    }
}

/// A file system in memory, unmounted when this is dropped.
struct Mounted {
    at: tempfile::TempDir,
}

impl Mounted {
    /// `None`, with a message, if mounting is not permitted.
    fn new(test: &str, options: &str) -> Option<Self> {
        let at = tempfile::tempdir().unwrap();
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", options, "tmpfs"]).arg(at.path()).output();
        match mount {
            Ok(output) if output.status.success() => Some(Self { at }),
            Ok(output) => {
                skipped(
                    test,
                    &format!("mounting is not permitted here: {}", String::from_utf8_lossy(&output.stderr).trim()),
                );
                None
            }
            Err(error) => {
                skipped(test, &format!("there is no mount: {error}"));
                None
            }
        }
    }

    fn remount(&self, options: &str) {
        let done = Command::new("mount").args(["-o", &format!("remount,{options}")]).arg(self.at.path()).status();
        assert!(done.unwrap().success());
    }

    fn folder(&self) -> PathBuf {
        self.at.path().join("work")
    }
}

impl Drop for Mounted {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.at.path()).status();
    }
}

#[test]
fn a_full_disk() {
    let Some(disk) = Mounted::new("a_full_disk", "size=4k") else { return };
    let balls = Balls::new(1);
    let calm = tempfile::tempdir().unwrap();
    assert!(run(&balls, calm.path()).status.success());
    let whole: u64 = contents(calm.path()).iter().map(|(_, bytes)| bytes.len() as u64).sum();
    // From hardly any space to nearly enough: the disk fills up in every stage.
    for share in [4, 15, 30, 50, 70, 90] {
        disk.remount(&format!("size={}k", (whole * share / 100 / 1024).max(4)));
        assert_refused(&run(&balls, &disk.folder()), 2, &["cannot write", "No space left", "make room", "--out"]);
        assert_nothing_half_written(&disk.folder(), calm.path());
    }
    disk.remount("size=64m");
    let last = run(&balls, &disk.folder());
    assert!(last.status.success(), "{}", String::from_utf8_lossy(&last.stderr));
    assert!(contents(&disk.folder()) == contents(calm.path()), "what the full disk left is mended");
}

#[test]
fn a_folder_that_may_only_be_read() {
    let Some(disk) = Mounted::new("a_folder_that_may_only_be_read", "size=1m,ro") else { return };
    let balls = Balls::new(1);
    assert_refused(&run(&balls, &disk.folder()), 2, &["cannot write", "Read-only", "--out"]);
    let output = gprop().arg("batch").arg(balls.folder()).arg("--out").arg(disk.folder()).output().unwrap();
    assert_refused(&output, 2, &["shard-0-of-1.jsonl", "Read-only", "--out"]);
}

/// A run on the first ball up to the parts, whose answers are recorded.
fn open(balls: &Balls, to: Stage) -> Result<Pipeline, gprop::Error> {
    let mut options = Options::default();
    options.segment.segments = Some(balls.labels(0));
    Pipeline::builder(balls.scene(0)).options(options).plan(Plan::to(to)).open()
}

#[test]
fn a_file_goes_while_it_is_worked_on() {
    // The file disappears after loading and before the stage that reads it.
    for gone in ["images/001.png", "point_cloud.ply", "transforms.json"] {
        let balls = Balls::new(1);
        let mut pipeline = open(&balls, Stage::Segment).unwrap();
        fs::remove_file(balls.scene(0).join(gone)).unwrap();
        let error = pipeline.run().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Scene, "{error}");
        assert!(error.to_string().contains(gone), "{error}");
    }
    // Files that gprop wrote itself are made again.
    let balls = Balls::new(1);
    let calm = tempfile::tempdir().unwrap();
    assert!(run(&balls, calm.path()).status.success());
    let out = tempfile::tempdir().unwrap();
    let files =
        ["segments/001.png", "segments/segments.json", "answers.jsonl", "field.ply", "parts.json", "interior.bin"];
    for gone in files.into_iter().chain(["run.json"]) {
        assert!(run(&balls, out.path()).status.success());
        fs::remove_file(out.path().join(gone)).unwrap();
        assert!(run(&balls, out.path()).status.success(), "{gone}");
        assert!(contents(out.path()) == contents(calm.path()), "{gone}");
    }
}

#[test]
fn a_clock_that_goes_back() {
    let balls = Balls::new(1);
    let out = tempfile::tempdir().unwrap();
    assert!(run(&balls, out.path()).status.success());
    let before = contents(out.path());
    // As if everything had been written ten years in the future, or long ago: only contents count.
    let decade = Duration::from_secs(10 * 365 * 24 * 3600);
    for time in [SystemTime::now() + decade, SystemTime::UNIX_EPOCH + Duration::from_secs(1)] {
        for folder in [balls.scene(0), out.path().to_owned()] {
            for (path, _) in contents(&folder) {
                File::options().write(true).open(folder.join(path)).unwrap().set_modified(time).unwrap();
            }
        }
        assert!(run(&balls, out.path()).status.success());
        let record: serde_json::Value =
            serde_json::from_slice(&fs::read(out.path().join("run.json")).unwrap()).unwrap();
        let stages = record["stages"].as_array().unwrap();
        assert!(stages.len() == 8 && stages.iter().all(|stage| stage["reused"] == true), "{record}");
    }
    assert!(contents(out.path()) == before);
}

#[test]
fn a_lock_of_a_dead_process_is_taken_over() {
    let balls = Balls::new(1);
    let out = tempfile::tempdir().unwrap();
    fs::write(out.path().join(".lock"), "of a process that is no more").unwrap();
    fs::write(out.path().join(".tmp-left"), "half").unwrap();
    fs::create_dir(out.path().join("segments")).unwrap();
    fs::write(out.path().join("segments/.tmp-left"), "half").unwrap();
    assert!(run(&balls, out.path()).status.success());
    let left = contents(out.path());
    assert!(left.iter().all(|(path, _)| !path.to_string_lossy().contains(".tmp-")), "{left:?}");
}
