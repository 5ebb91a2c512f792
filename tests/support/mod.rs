// A page in headless Chromium.
pub mod browser;
// An HTTP server that answers as a test tells it to.
pub mod server;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, OnceLock, PoisonError};

use gprop::setup::{self, ModelFiles, SetupError};
use gprop::words::progress::Progress;
use serde_json::Value;

/// What a command wrote to stderr.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What a command wrote, to stdout and then to stderr.
pub fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Reports on stderr, bypassing the harness's capture, that a test or a part of it did not run and why. With
/// `GPROP_NO_SKIP=1`, as in `.ci/run`, it fails instead. Every test that skips anything calls this.
#[track_caller]
pub fn skipped(test: &str, why: &str) {
    assert!(!is_set("GPROP_NO_SKIP"), "{test} cannot run, and GPROP_NO_SKIP is set: {why}");
    say_skipped(test, why);
}

fn say_skipped(test: &str, why: &str) {
    let _ = writeln!(std::io::stderr(), "skipped {test}: {why}");
}

fn is_set(variable: &str) -> bool {
    std::env::var_os(variable).is_some_and(|value| !value.is_empty() && value != "0")
}

/// A file or folder of the data of others that lies beside a development checkout because gprop may not distribute it; if
/// it is not there, the test is [`skipped`]. With `GPROP_NO_DATA=1`, that is no failure.
#[track_caller]
pub fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let found = shared_if_there(path);
    let why = format!("no ../shared/{path}");
    match found {
        Some(_) => {}
        None if is_set("GPROP_NO_DATA") => say_skipped(test, &why),
        None => skipped(test, &why),
    }
    found
}

/// As [`shared`], for tests that can do with something else.
pub fn shared_if_there(path: &str) -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    ["../shared", "../../shared"].map(|folder| root.join(folder).join(path)).into_iter().find(|path| path.exists())
}

/// ONNX Runtime and SAM as any user gets them; `None`, with a message, if they cannot be obtained (no network, offline,
/// another platform). Any other problem with them fails the test.
pub fn models(test: &str) -> Option<ModelFiles> {
    static MODELS: OnceLock<Result<ModelFiles, String>> = OnceLock::new();
    let obtained = MODELS.get_or_init(|| match setup::obtain(&setup::Options::default(), Progress::HIDDEN) {
        Ok(files) => Ok(files),
        Err(
            error @ (SetupError::NotCached { .. }
            | SetupError::Fetch { .. }
            | SetupError::Platform { .. }
            | SetupError::NoCache),
        ) => Err(error.to_string()),
        Err(error) => panic!("{error}"),
    });
    obtained.as_ref().map_err(|why| skipped(test, why)).ok().cloned()
}

/// Values that several tests read, made once for each folder by the first test that needs them.
pub struct Shared<T: 'static>(Mutex<BTreeMap<PathBuf, &'static OnceLock<T>>>);

impl<T> Shared<T> {
    pub const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    pub fn of(&self, folder: &Path, make: impl FnOnce() -> T) -> &'static T {
        let mut cells = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let cell: &'static OnceLock<T> =
            cells.entry(folder.to_owned()).or_insert_with(|| Box::leak(Box::new(OnceLock::new())));
        drop(cells);
        cell.get_or_init(make)
    }
}

/// An empty folder for what several tests read, below Cargo's folder for tests: a temporary one would stay behind, since
/// what is shared is never dropped. A later run of the tests empties it; a run beside this one has folders of its own.
pub fn shared_folder(name: &str) -> PathBuf {
    static OF_THIS_RUN: OnceLock<(PathBuf, File)> = OnceLock::new();
    let (all, _locked) = OF_THIS_RUN.get_or_init(|| {
        let numbered = (0..).map(|n| Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("run_{n}")));
        let mut locked = numbered.map(|all| {
            let lock = File::create(all.with_extension("lock")).unwrap();
            lock.try_lock().is_ok().then_some((all, lock))
        });
        locked.find_map(|found| found).unwrap()
    });
    let folder = all.join(name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// True if Python has a package; prints a message if not.
pub fn python_has(test: &str, package: &str, import: &str) -> bool {
    let found = Command::new("python3").args(["-c", &format!("import {import}")]).output();
    let found = found.is_ok_and(|output| output.status.success());
    if !found {
        skipped(test, &format!("python3 has no {package}; `python3 -m pip install {package}` brings it"));
    }
    found
}

/// A value with a change, for types that other crates cannot write as a literal.
pub fn changed<T>(mut value: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut value);
    value
}

/// The JSON that a Python script prints last.
pub fn python(script: &Path, arguments: &[&Path]) -> Value {
    parsed(Command::new("python3").arg(script).args(arguments).output().unwrap())
}

/// The JSON on a program's last line.
pub fn parsed(output: Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    serde_json::from_str(text.lines().last().unwrap_or_default()).unwrap_or_else(|_| panic!("{text}"))
}

#[test]
fn a_test_that_cannot_run_says_so_and_fails_if_nothing_may_be_skipped() {
    // Without a search path there is no splat-transform.
    let run = |no_skip: &str| {
        let mut tests = Command::new(std::env::current_exe().unwrap());
        tests.args(["--exact", "scene::peer::splat_transform_writes_what_gprop_reads"]);
        tests.env("PATH", "").env("GPROP_NO_SKIP", no_skip).output().unwrap()
    };
    let (skipped, failed) = (run("0"), run("1"));
    assert!(skipped.status.success(), "{skipped:?}");
    assert!(String::from_utf8_lossy(&skipped.stderr).contains("splat-transform"), "{skipped:?}");
    assert!(!failed.status.success(), "{failed:?}");
}
