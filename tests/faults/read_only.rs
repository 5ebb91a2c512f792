//! A finished work folder on media that may only be read: every command that only reads it keeps working.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use super::{Mounted, assert_refused, run};
use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::run::gprop;
use crate::support::skipped;

fn output_of(command: &mut Command) -> Output {
    command.env_remove("OPENAI_API_KEY").output().unwrap()
}

#[track_caller]
fn assert_done(output: &Output) {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Runs, shows, exports and evaluates the work folder `work` of the first ball with the commands that `gprop` creates.
fn read_everything(balls: &Balls, work: &Path, gprop: &dyn Fn() -> Command, free: &Path) {
    let scene = balls.scene(0);
    let again = output_of(
        gprop().arg("run").arg(&scene).args(["--to", "parts", "--json", "--out"]).arg(work).args(balls.answers()),
    );
    assert_done(&again);
    let parts: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(parts["parts"].as_array().map(Vec::len), Some(2));
    let picture = free.join("shown.png");
    assert_done(&output_of(gprop().arg("show").arg(&scene).arg(&picture).arg("--out").arg(work).args(balls.answers())));
    assert!(picture.is_file());
    let model = free.join("model");
    let export = ["--format", "npz", "--out"];
    assert_done(&output_of(
        gprop().arg("export").arg(&scene).args(export).arg(&model).arg("--work").arg(work).args(balls.answers()),
    ));
    assert!(model.is_dir());
    assert_done(&output_of(gprop().args(["evaluate", "mass", "--out"]).arg(work).arg(&scene)));
    let truth = ["evaluate", "segmentation", "--truth", "ground_truth/maps", "--out"];
    assert_done(&output_of(gprop().args(truth).arg(work).arg(&scene)));
    assert_done(&output_of(
        gprop().arg("run").arg(&scene).args(["--to", "parts", "--dry-run", "--out"]).arg(work).args(balls.answers()),
    ));
    // A command that has to write fails with an error that says so.
    let other = output_of(gprop().arg("run").arg(&scene).args(["--to", "parts", "--views=2", "--out"]).arg(work));
    assert_refused(&other, 2, &["the scene stage has to be done", "cannot write", "--out"]);
}

#[test]
fn a_finished_work_folder_on_a_disk_that_may_only_be_read() {
    let test = "a_finished_work_folder_on_a_disk_that_may_only_be_read";
    let Some(disk) = Mounted::new(test, "size=64m") else { return };
    let (balls, free) = (Balls::new(1), tempfile::tempdir().unwrap());
    balls.write_truth(0);
    assert_done(&run(&balls, &disk.folder()));
    let before = contents(&disk.folder());
    disk.remount("ro");
    read_everything(&balls, &disk.folder(), &gprop, free.path());
    assert!(contents(&disk.folder()) == before);
    // Copied without its lock, as a plain `cp *` does.
    disk.remount("rw");
    fs::remove_file(disk.folder().join(".lock")).unwrap();
    disk.remount("ro");
    read_everything(&balls, &disk.folder(), &gprop, free.path());
}

#[test]
fn a_finished_work_folder_of_another_user() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    const NOBODY: &str = "65534";
    let (balls, home, free) = (Balls::new(1), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    balls.write_truth(0);
    let work = home.path().join("work");
    assert_done(&run(&balls, &work));
    if home.path().metadata().unwrap().uid() != 0 {
        return skipped("a_finished_work_folder_of_another_user", "only root can be somebody else");
    }
    let all_may = |path: &Path, mode: u32| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    all_may(home.path(), 0o755);
    all_may(free.path(), 0o777);
    all_may(balls.folder().parent().unwrap(), 0o755);
    // The program may be in a folder that other users cannot enter.
    let program = free.path().join("gprop");
    fs::copy(env!("CARGO_BIN_EXE_gprop"), &program).unwrap();
    let as_nobody = || {
        let mut command = Command::new("setpriv");
        command.args(["--reuid", NOBODY, "--regid", NOBODY, "--clear-groups"]).arg(&program).env("HOME", free.path());
        command
    };
    match as_nobody().arg("--version").output() {
        Ok(output) if output.status.success() => {}
        other => return skipped("a_finished_work_folder_of_another_user", &format!("no setpriv: {other:?}")),
    }
    let before = contents(&work);
    read_everything(&balls, &work, &as_nobody, free.path());
    assert!(contents(&work) == before);
}
