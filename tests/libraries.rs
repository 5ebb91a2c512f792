//! Nothing leaves the machine unasked: a library that gprop loads opens no connection and no socket with which to resolve a name, and
//! writes nothing, whatever it is and wherever it comes from. One that tries all of that at every chance is made here; ONNX
//! Runtime, which sends telemetry by default, is watched at the system call.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use gprop::segment::sam::Sam;
use gprop::setup::ModelFiles;
use gprop::setup::catalog::{ONNXRUNTIME_NODE, ONNXRUNTIME_WHEEL, PinnedFile};
use tempfile::{NamedTempFile, TempDir};

use crate::query::offline::{assert_untouched, listener};
use crate::run::{gprop, hammer};
use crate::segment::models::tiny;
use crate::setup::build_library;
use crate::support::{models, skipped, stderr};

/// Passes every call on to ONNX Runtime, but first tries to connect, to open a socket, to write and to have a child write: when it is
/// loaded, when it is asked for its interface, when a model runs, when the process ends, and all the time on a thread of its own.
const PHONE: &str = r#"
use std::ffi::{CString, c_char, c_void};
use std::sync::OnceLock;
type Run = extern "C" fn(*mut c_void, *const c_void, *const c_void, *const c_void, usize, *const c_void, usize, *mut c_void) -> *mut c_void;
type GetApi = extern "C" fn(u32) -> *const usize;
#[repr(C)] pub struct Base { get_api: GetApi, version: usize }
/// More functions than gprop knows of, and fewer than there are; the tenth runs a model.
type Api = [usize; 300];
const RUN: usize = 9;
unsafe extern "C" {
    fn dlopen(path: *const c_char, flags: i32) -> *mut c_void;
    fn dlsym(library: *mut c_void, name: *const c_char) -> *mut c_void;
}
static REAL: OnceLock<GetApi> = OnceLock::new();
static REAL_RUN: OnceLock<Run> = OnceLock::new();
static BASE: OnceLock<Base> = OnceLock::new();
static API: OnceLock<Api> = OnceLock::new();

fn phone(when: &str) {
    let variable = |name: &str| std::env::var(name).unwrap();
    let (home, place) = (variable("PHONE_HOME"), variable("PHONE_PLACE"));
    let child = std::process::Command::new("touch").arg(format!("{place}/child")).stderr(std::process::Stdio::null()).status();
    let reached = [
        std::net::TcpStream::connect(&home).is_ok(),
        std::net::UdpSocket::bind("127.0.0.1:0").is_ok(),
        std::fs::write(format!("{place}/file"), when).is_ok(),
        std::fs::create_dir(format!("{place}/folder")).is_ok(),
        child.is_ok_and(|status| status.success()),
    ];
    eprintln!("phone {when} {}", if reached.contains(&true) { "reached" } else { "refused" });
}

extern "C" fn loaded() {
    phone("loaded");
    std::thread::spawn(|| loop {
        phone("aside");
        std::thread::sleep(std::time::Duration::from_millis(20));
    });
}
extern "C" fn ended() { phone("ended") }
#[used] #[unsafe(link_section = ".init_array")] static LOADED: extern "C" fn() = loaded;
#[used] #[unsafe(link_section = ".fini_array")] static ENDED: extern "C" fn() = ended;

extern "C" fn run(a: *mut c_void, b: *const c_void, c: *const c_void, d: *const c_void, e: usize, f: *const c_void, g: usize, h: *mut c_void) -> *mut c_void {
    phone("run");
    REAL_RUN.get().unwrap()(a, b, c, d, e, f, g, h)
}
extern "C" fn get_api(version: u32) -> *const usize {
    // SAFETY: the real library's table of functions is read, whose entry RUN has the type of REAL_RUN; it lives as long as the process.
    API.get_or_init(|| unsafe {
        let mut api: Api = *REAL.get().unwrap()(version).cast();
        REAL_RUN.get_or_init(|| std::mem::transmute(api[RUN]));
        api[RUN] = run as usize;
        api
    }).as_ptr()
}
#[unsafe(no_mangle)] pub extern "C" fn OrtGetApiBase() -> *const Base {
    phone("asked");
    // SAFETY: PHONE_ORT names ONNX Runtime, whose symbol has this type; the library is never closed.
    BASE.get_or_init(|| unsafe {
        let path = CString::new(std::env::var("PHONE_ORT").unwrap()).unwrap();
        let library = dlopen(path.as_ptr(), 2);
        let base: extern "C" fn() -> *const Base = std::mem::transmute(dlsym(library, c"OrtGetApiBase".as_ptr()));
        let base = &*base();
        REAL.get_or_init(|| base.get_api);
        Base { get_api, version: base.version }
    })
}
"#;

/// Arguments with which the tiny models take the place of SAM's.
fn tiny_models(files: &ModelFiles) -> Vec<PathBuf> {
    vec!["--sam-encoder".into(), files.encoder.clone(), "--sam-decoder".into(), files.decoder.clone()]
}

/// Arguments of every command that may load a library, without the library.
fn commands(files: &ModelFiles, scene: &Path, out: &Path) -> Vec<Vec<PathBuf>> {
    let paths = |words: &[&str]| words.iter().map(PathBuf::from).collect::<Vec<_>>();
    let few = paths(&["--points-per-side", "2", "--offline", "--out"]);
    let all = [
        [paths(&["segment"]), vec![scene.join("images/003.png")], few.clone(), vec![out.join("picture")]].concat(),
        [
            paths(&["run"]),
            vec![scene.into()],
            paths(&["--to", "segment", "--view-list", "003"]),
            few,
            vec![out.join("scene")],
        ]
        .concat(),
        paths(&["doctor", "--offline"]),
        paths(&["setup", "--offline"]),
    ];
    all.map(|command| [command, tiny_models(files)].concat()).into()
}

#[test]
fn a_library_that_phones_home_reaches_nobody() {
    let Some(files) = tiny("a_library_that_phones_home_reaches_nobody", "multi_mask") else { return };
    let (folder, scene) = (TempDir::new().unwrap(), hammer());
    let library = build_library(folder.path(), "phone", PHONE);
    let place = folder.path().join("place");
    fs::create_dir(&place).unwrap();
    let (home, url) = listener();
    let call = |arguments: &[PathBuf], variable: bool| {
        let mut command = gprop();
        command.args(arguments).env("PHONE_HOME", home.local_addr().unwrap().to_string()).env("PHONE_PLACE", &place);
        command.env("PHONE_ORT", &files.onnxruntime).env("http_proxy", &url).env("https_proxy", &url);
        let command =
            if variable { command.env("ORT_DYLIB_PATH", &library) } else { command.arg("--ort-lib").arg(&library) };
        let output = command.output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        stderr(&output)
    };
    for (arguments, variable) in
        commands(&files, scene.path(), folder.path()).iter().zip([false, true].into_iter().cycle())
    {
        let said = call(arguments, variable);
        let runs = arguments[0] == Path::new("segment") || arguments[0] == Path::new("run");
        for when in ["loaded", "asked", "aside", "ended"].into_iter().chain(runs.then_some("run")) {
            assert!(said.contains(&format!("phone {when} refused")), "{arguments:?}, {when}: {said}");
        }
        assert!(!said.contains("reached"), "{arguments:?}: {said}");
    }
    assert_untouched(&home);
    assert_eq!(fs::read_dir(&place).unwrap().count(), 0);
}

/// strace, to which a program, its arguments and its environment are to be added.
struct Strace {
    command: Command,
    log: NamedTempFile,
}

/// The system calls of a program by which something could leave the machine or be written.
struct Watched {
    calls: Vec<String>,
}

impl Strace {
    /// `None`, with a message, if it is not installed.
    fn new(test: &str) -> Option<Self> {
        const CALLS: &str =
            "trace=%network,open,openat,creat,mkdir,mkdirat,rename,renameat,renameat2,link,linkat,symlink,symlinkat";
        if Command::new("strace").arg("--version").output().is_err() {
            skipped(test, "no strace; `apt-get install strace` brings it");
            return None;
        }
        let (mut command, log) = (Command::new("strace"), NamedTempFile::new().unwrap());
        // With --seccomp-bpf, strace would not see what gprop's own filter refuses.
        command.args(["-f", "-qq", "-s", "4096", "-e", CALLS, "-o"]).arg(log.path());
        Some(Self { command, log })
    }

    /// Runs the program, which must succeed.
    fn watch(mut self) -> Watched {
        let output = self.command.output().unwrap();
        assert!(output.status.success(), "{:?}: {}", self.command, stderr(&output));
        Watched { calls: whole_calls(&fs::read_to_string(self.log.path()).unwrap()) }
    }
}

impl Watched {
    /// Calls that open sockets or use them.
    fn network(&self) -> Vec<&str> {
        let is_network = |call: &&str| {
            ["socket(", "connect(", "sendto(", "sendmsg(", "bind("].iter().any(|name| call.contains(name))
        };
        self.calls.iter().map(String::as_str).filter(is_network).collect()
    }

    /// Calls that change files outside these folders.
    fn writes_outside(&self, folders: &[&Path]) -> Vec<&str> {
        let changes = |call: &&str| {
            if call.contains("open") {
                ["O_WRONLY", "O_RDWR", "O_CREAT"].iter().any(|flag| call.contains(flag))
            } else {
                call.contains("(\"") || call.contains("(AT_FDCWD")
            }
        };
        let is_outside = |call: &&str| {
            let path = call.split('"').nth(1).unwrap_or_default();
            path.starts_with('/')
                && !path.starts_with("/dev/")
                && !folders.iter().any(|folder| Path::new(path).starts_with(folder))
        };
        self.calls.iter().map(String::as_str).filter(changes).filter(is_outside).collect()
    }
}

/// The calls in strace's output. One during which another thread makes a call is written in two pieces.
fn whole_calls(log: &str) -> Vec<String> {
    let (mut begun, mut calls) = (BTreeMap::new(), Vec::new());
    for line in log.lines() {
        let (thread, call) = line.split_once(' ').unwrap();
        if let Some(start) = call.strip_suffix("<unfinished ...>") {
            begun.insert(thread, start);
        } else if let Some((_, end)) = call.split_once("resumed>") {
            calls.push(format!("{}{end}", begun.remove(thread).unwrap_or_default()));
        } else {
            calls.push(call.to_owned());
        }
    }
    calls.extend(begun.into_values().map(str::to_owned));
    calls
}

/// A way of getting ONNX Runtime.
struct Way {
    name: &'static str,
    program: PathBuf,
    ort_lib: Option<PathBuf>,
    /// Empty if it is not set.
    ort_dylib_path: PathBuf,
    /// What `XDG_CACHE_HOME` names: a folder with nothing in it but gprop's cache.
    cache: PathBuf,
}

impl Way {
    fn new(name: &'static str, home: &Path) -> Self {
        let cache = home.join(name);
        fs::create_dir_all(cache.join("gprop")).unwrap();
        let program = env!("CARGO_BIN_EXE_gprop").into();
        Self { name, program, ort_lib: None, ort_dylib_path: PathBuf::new(), cache }
    }

    fn with_cached(self, file: &PinnedFile, library: &Path) -> Self {
        link(library, &self.cache.join("gprop").join(file.cached));
        self
    }

    /// The program in a Python environment, beside the library.
    fn installed_by_wheel(self, library: &Path, home: &Path) -> Self {
        let (file, program) = (&ONNXRUNTIME_WHEEL.files[0], home.join("venv/bin/gprop"));
        link(library, &home.join("venv/lib/python3.11/site-packages").join(file.member));
        fs::create_dir(program.parent().unwrap()).unwrap();
        fs::copy(&self.program, &program).unwrap();
        Self { program, ..self }
    }

    /// Runs a command under strace.
    fn watch(&self, arguments: &[PathBuf], proxy: &str, mut strace: Strace) -> Watched {
        let command = strace.command.arg(&self.program).args(arguments);
        if let Some(library) = &self.ort_lib {
            command.arg("--ort-lib").arg(library);
        }
        command.env("XDG_CACHE_HOME", &self.cache).env("XDG_CONFIG_HOME", &self.cache);
        command.env("ORT_DYLIB_PATH", &self.ort_dylib_path).env("http_proxy", proxy).env("https_proxy", proxy);
        strace.watch()
    }
}

/// A link to `file`, in a folder that is made for it.
fn link(file: &Path, link: &Path) {
    fs::create_dir_all(link.parent().unwrap()).unwrap();
    symlink(file, link).unwrap();
}

/// All ways, with their files in `home`.
fn ways(test: &str, files: &ModelFiles, home: &Path) -> Vec<Way> {
    let library = &files.onnxruntime;
    let mut all = vec![
        Way { ort_lib: Some(library.clone()), ..Way::new("--ort-lib", home) },
        Way { ort_dylib_path: library.clone(), ..Way::new("ORT_DYLIB_PATH", home) },
        Way::new("the cache, from pip", home).with_cached(&ONNXRUNTIME_WHEEL.files[0], library),
        Way::new("the wheel", home).installed_by_wheel(library, home),
    ];
    let of_npm = of_npm(test, files);
    all.extend(
        of_npm.map(|library| Way::new("the cache, from npm", home).with_cached(&ONNXRUNTIME_NODE.files[0], &library)),
    );
    all
}

/// The library from npm, which `gprop setup` fetches if there is no python3. It is kept for later runs of the tests.
fn of_npm(test: &str, files: &ModelFiles) -> Option<PathBuf> {
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join("onnxruntime-node");
    let library = cache.join("gprop").join(ONNXRUNTIME_NODE.files[0].cached);
    if !library.is_file() {
        let programs = TempDir::new().unwrap();
        let folders = std::env::var_os("PATH").unwrap_or_default();
        for name in ["npm", "node", "sh", "env"] {
            let found = std::env::split_paths(&folders).map(|folder| folder.join(name)).find(|path| path.is_file());
            found.into_iter().for_each(|program| symlink(program, programs.path().join(name)).unwrap());
        }
        let mut setup = gprop();
        setup.arg("setup").args(tiny_models(files)).env("XDG_CACHE_HOME", &cache).env("PATH", programs.path());
        let output = setup.env_remove("ORT_DYLIB_PATH").output().unwrap();
        if !output.status.success() {
            skipped(test, &format!("onnxruntime-node cannot be fetched: {}", stderr(&output)));
            return None;
        }
        let left: Vec<_> = fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left, ["gprop"], "npm leaves nothing outside gprop's cache");
    }
    Some(library)
}

#[test]
fn onnx_runtime_does_not_even_try_wherever_it_comes_from() {
    const TEST: &str = "onnx_runtime_does_not_even_try_wherever_it_comes_from";
    let Some(files) = tiny(TEST, "multi_mask") else { return };
    let (home, scene, (proxy, url)) = (TempDir::new().unwrap(), hammer(), listener());
    for (index, way) in ways(TEST, &files, home.path()).iter().enumerate() {
        let out = home.path().join("out").join(way.name);
        let own = [&way.cache.join("gprop"), out.as_path(), scene.path()];
        fs::create_dir_all(&out).unwrap();
        // Every command with the first way, one with each.
        for arguments in commands(&files, scene.path(), &out).iter().take(if index == 0 { 4 } else { 1 }) {
            let Some(strace) = Strace::new(TEST) else { return };
            let watched = way.watch(arguments, &url, strace);
            assert_eq!(watched.network(), [] as [&str; 0], "{}: {arguments:?}", way.name);
            assert_eq!(watched.writes_outside(&own), [] as [&str; 0], "{}: {arguments:?}", way.name);
        }
        let left: Vec<_> = fs::read_dir(&way.cache).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left, ["gprop"], "{}", way.name);
    }
    assert_untouched(&proxy);
}

/// What a caller of the library does; [`a_caller_of_the_library_is_kept_safe_too`] watches a process that does nothing else.
#[test]
fn a_caller_of_the_library() {
    let Some(files) = tiny("a_caller_of_the_library", "multi_mask") else { return };
    let sam = Sam::open(&files, None, 1).unwrap();
    sam.encode(&vec![0.0; 3 * 1024 * 1024]).unwrap();
}

/// gprop does not set the variable in its caller's environment, so ONNX Runtime tries, and is refused.
#[test]
fn a_caller_of_the_library_is_kept_safe_too() {
    const TEST: &str = "a_caller_of_the_library_is_kept_safe_too";
    let Some(files) = models(TEST) else { return };
    let home = TempDir::new().unwrap();
    // The cache with SAM's own files, which `models` wants to see.
    symlink(files.encoder.parent().unwrap().parent().unwrap(), home.path().join("gprop")).unwrap();
    let Some(mut strace) = Strace::new(TEST) else { return };
    let caller = strace.command.arg(std::env::current_exe().unwrap());
    caller.args(["--exact", "libraries::a_caller_of_the_library"]).env_remove("ORT_DISABLE_TELEMETRY");
    caller.env("XDG_CACHE_HOME", home.path()).env("ORT_DYLIB_PATH", files.onnxruntime).env("GPROP_OFFLINE", "1");
    let watched = strace.watch();
    let refused = |call: &&str| call.contains("EACCES");
    assert!(watched.network().iter().all(refused), "{:#?}", watched.network());
    assert!(watched.writes_outside(&[]).iter().all(refused), "{:#?}", watched.writes_outside(&[]));
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
}
