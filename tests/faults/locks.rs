//! Locks: a process that is kept out learns which process holds the lock; a process that has ended keeps none out, and
//! neither do its children.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use gprop::workdir::WorkDir;

use super::{assert_refused, run};
use crate::batch::ball::Balls;
use crate::run::gprop;

/// How long the test waits for another process before it fails: a thousand times what it takes, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(1200);

/// Programs with the names of those that fetch models, which wait forever instead, and the id of the process that was
/// started: gprop then has a child.
pub struct Hanging {
    home: tempfile::TempDir,
}

impl Hanging {
    pub fn new() -> Self {
        use std::os::unix::fs::PermissionsExt;
        let home = tempfile::tempdir().unwrap();
        for name in ["python3", "npm"] {
            let program = home.path().join(name);
            let words = format!(
                "#!/bin/sh\necho $$ > {0}/new && mv {0}/new {0}/pid\nexec sleep 100000\n",
                home.path().display()
            );
            fs::write(&program, words).unwrap();
            fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        }
        Self { home }
    }

    /// Lets `command` find these programs and no models.
    pub fn instead_of_fetching(&self, command: &mut Command) {
        let path = std::env::var("PATH").unwrap();
        command.env("PATH", format!("{}:{path}", self.home.path().display()));
        command.env("XDG_CACHE_HOME", self.home.path().join("cache")).env_remove("ORT_DYLIB_PATH");
        command.env_remove("GPROP_OFFLINE");
    }

    /// The process that hangs, as soon as it has started.
    pub fn process(&self) -> PathBuf {
        let file = self.home.path().join("pid");
        wait_for("the program that hangs to start", || file.is_file());
        Path::new("/proc").join(fs::read_to_string(file).unwrap().trim())
    }
}

/// Waits until a condition holds: how long another process takes to reach it is unknown.
pub fn wait_for(what: &str, is_so: impl Fn() -> bool) {
    let since = Instant::now();
    while !is_so() {
        assert!(since.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// True if a process, given by its folder in `/proc`, has ended: it is gone, or a zombie.
pub fn has_ended(process: &Path) -> bool {
    let status = fs::read_to_string(process.join("status")).unwrap_or_default();
    status.lines().find(|line| line.starts_with("State:")).is_none_or(|line| line.contains("zombie"))
}

/// Kills a process by its folder in `/proc`.
fn kill(process: &Path) {
    let id = process.file_name().unwrap();
    assert!(Command::new("kill").arg("-KILL").arg(id).status().unwrap().success());
}

/// A gprop process that holds the lock of the first ball forever, because it waits for its models.
fn hanging_run(balls: &Balls, hanging: &Hanging) -> Child {
    balls.forget_labels(0);
    let mut command = gprop();
    hanging.instead_of_fetching(&mut command);
    command.arg("run").arg(balls.scene(0)).args(["--to", "parts", "-q"]);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

#[test]
fn who_is_kept_out_hears_by_whom() {
    let (balls, hanging) = (Balls::new(1), Hanging::new());
    let mut worker = hanging_run(&balls, &hanging);
    let child = hanging.process();
    let output = run(&balls, &balls.scene(0).join("gprop"));
    let process = format!("process {} on", worker.id());
    assert_refused(&output, 2, &["another gprop", &process, "since", "GMT", "wait for it to end", "--out"]);
    let reading = gprop().args(["evaluate", "mass"]).arg(balls.scene(0)).output().unwrap();
    assert_refused(&reading, 2, &["another gprop", &process]);
    worker.kill().unwrap();
    worker.wait().unwrap();
    kill(&child);
}

#[test]
fn whoever_only_reads_is_said_to_read() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let first = WorkDir::open_to_read(out.path()).unwrap();
    let second = WorkDir::open_to_read(out.path()).unwrap();
    assert_refused(&run(&balls, out.path()), 2, &["another gprop is reading"]);
    drop((first, second));
    assert!(run(&balls, out.path()).status.success());
}

#[test]
fn the_dead_hold_no_lock_and_their_children_neither() {
    let (balls, hanging) = (Balls::new(1), Hanging::new());
    let mut worker = hanging_run(&balls, &hanging);
    let child = hanging.process();
    worker.kill().unwrap();
    worker.wait().unwrap();
    assert!(!has_ended(&child), "the child of the dead one lives on");
    assert!(WorkDir::open(&balls.scene(0).join("gprop")).is_ok());
    kill(&child);
}
