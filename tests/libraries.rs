//! Nothing leaves the machine unasked: a library that gprop loads opens no connection and no socket with which to resolve a name, and
//! writes nothing, whatever it is and wherever it comes from. One that tries all of that at every chance is made here; ONNX
//! Runtime, which sends telemetry by default, is watched at the system call.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use gprop::segment::sam::Sam;
use gprop::setup::ModelFiles;
use gprop::setup::catalog::{ONNXRUNTIME_NODE, ONNXRUNTIME_WHEEL};
use tempfile::TempDir;

use crate::query::offline::{assert_untouched, listener};
use crate::run::{gprop, hammer};
use crate::segment::models::tiny;
use crate::setup::build_library;
use crate::support::{models, skipped};

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
    let of = |name: &str| std::env::var(name).unwrap();
    let (home, place) = (of("PHONE_HOME"), of("PHONE_PLACE"));
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
    API.get_or_init(|| unsafe {
        let mut api: Api = *REAL.get().unwrap()(version).cast();
        REAL_RUN.get_or_init(|| std::mem::transmute(api[RUN]));
        api[RUN] = run as usize;
        api
    }).as_ptr()
}
#[unsafe(no_mangle)] pub extern "C" fn OrtGetApiBase() -> *const Base {
    phone("asked");
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

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
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
        assert!(output.status.success(), "{arguments:?}: {}", said(&output));
        said(&output)
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

/// The system calls of a program by which something could leave the machine or be written, one a line.
struct Watched {
    calls: Vec<String>,
}

impl Watched {
    /// Runs `command`, which must succeed, under strace; `None`, with a message, if there is none.
    fn run(test: &str, command: &Command) -> Option<Self> {
        const CALLS: &str =
            "trace=%network,open,openat,creat,mkdir,mkdirat,rename,renameat,renameat2,link,linkat,symlink,symlinkat";
        if Command::new("strace").arg("--version").output().is_err() {
            skipped(test, "no strace; `apt-get install strace` brings it");
            return None;
        }
        let log = tempfile::NamedTempFile::new().unwrap();
        let mut strace = Command::new("strace");
        strace.args(["-f", "--seccomp-bpf", "-qq", "-s", "4096", "-e", CALLS, "-o"]).arg(log.path());
        strace.arg(command.get_program()).args(command.get_args());
        for (name, value) in command.get_envs() {
            match value {
                Some(value) => strace.env(name, value),
                None => strace.env_remove(name),
            };
        }
        let output = strace.output().unwrap();
        assert!(output.status.success(), "{command:?}: {}", said(&output));
        let calls = fs::read_to_string(log.path()).unwrap().lines().map(str::to_owned).collect();
        Some(Self { calls })
    }

    /// Calls that open sockets or use them.
    fn network(&self) -> Vec<&str> {
        let is_network = |call: &&str| {
            ["socket(", "connect(", "sendto(", "sendmsg(", "bind("].iter().any(|name| call.contains(name))
        };
        self.calls.iter().map(String::as_str).filter(is_network).collect()
    }

    /// Calls that change files outside these folders.
    fn writes_outside(&self, folders: &[&Path]) -> Vec<&str> {
        let changes = |call: &&str| match call.contains("open") {
            true => ["O_WRONLY", "O_RDWR", "O_CREAT"].iter().any(|flag| call.contains(flag)),
            false => call.contains("(\"") || call.contains("(AT_FDCWD"),
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

/// A way of getting ONNX Runtime: a program with an environment in which it finds the library.
struct Way {
    name: &'static str,
    program: Command,
}

/// All ways, with files in `home`, whose cache is empty but for those.
fn ways(test: &str, files: &ModelFiles, home: &Path) -> Vec<Way> {
    let program = |name: &'static str| {
        let cache = home.join(name);
        fs::create_dir_all(&cache).unwrap();
        let mut program = gprop();
        program.env("XDG_CACHE_HOME", cache).env_remove("ORT_DYLIB_PATH");
        Way { name, program }
    };
    let with_cached = |way: Way, cached: &str, library: &Path| {
        let target = home.join(way.name).join("gprop").join(cached);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        symlink(library, target).unwrap();
        way
    };
    let mut named = program("--ort-lib");
    named.program.arg("--ort-lib").arg(&files.onnxruntime);
    let mut variable = program("ORT_DYLIB_PATH");
    variable.program.env("ORT_DYLIB_PATH", &files.onnxruntime);
    let mut all = vec![
        named,
        variable,
        with_cached(program("the cache, from pip"), ONNXRUNTIME_WHEEL.files[0].cached, &files.onnxruntime),
        installed_by_wheel(program("the wheel"), files, home),
    ];
    if let Some(library) = of_npm(test, files) {
        all.push(with_cached(program("the cache, from npm"), ONNXRUNTIME_NODE.files[0].cached, &library));
    }
    all
}

/// The program in a Python environment, beside the library.
fn installed_by_wheel(way: Way, files: &ModelFiles, home: &Path) -> Way {
    let environment = home.join("venv");
    let library = environment.join("lib/python3.11/site-packages").join(ONNXRUNTIME_WHEEL.files[0].member);
    for folder in [library.parent().unwrap(), &environment.join("bin")] {
        fs::create_dir_all(folder).unwrap();
    }
    symlink(&files.onnxruntime, library).unwrap();
    fs::copy(env!("CARGO_BIN_EXE_gprop"), environment.join("bin/gprop")).unwrap();
    let mut program = Command::new(environment.join("bin/gprop"));
    for (name, value) in way.program.get_envs() {
        program.env(name, value.unwrap_or_default());
    }
    Way { program, ..way }
}

/// The library from npm, which `gprop setup` fetches if there is no python3. It is kept for later runs of the tests.
fn of_npm(test: &str, files: &ModelFiles) -> Option<PathBuf> {
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join("onnxruntime-node");
    let library = cache.join("gprop").join(ONNXRUNTIME_NODE.files[0].cached);
    if !library.is_file() {
        let programs = TempDir::new().unwrap();
        for name in ["npm", "node", "sh", "env"] {
            let found = std::env::split_paths(&std::env::var_os("PATH")?)
                .map(|folder| folder.join(name))
                .find(|path| path.is_file());
            symlink(found.unwrap_or_default(), programs.path().join(name)).unwrap();
        }
        let mut setup = gprop();
        setup.arg("setup").args(tiny_models(files)).env("XDG_CACHE_HOME", &cache).env("PATH", programs.path());
        let output = setup.env_remove("ORT_DYLIB_PATH").output().unwrap();
        if !output.status.success() {
            skipped(test, &format!("onnxruntime-node cannot be fetched: {}", said(&output)));
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
    let (home, scene) = (TempDir::new().unwrap(), hammer());
    let (proxy, url) = listener();
    for mut way in ways(TEST, &files, home.path()) {
        way.program.env("http_proxy", &url).env("https_proxy", &url);
        let cache = home.path().join(way.name);
        for arguments in commands(&files, scene.path(), &home.path().join("out").join(way.name)) {
            let mut command = Command::new(way.program.get_program());
            command.args(arguments).args(way.program.get_args());
            for (name, value) in way.program.get_envs() {
                command.env(name, value.unwrap_or_default());
            }
            let Some(watched) = Watched::run(TEST, &command) else { return };
            assert_eq!(watched.network(), [] as [&str; 0], "{}: {command:?}", way.name);
            let own = [cache.join("gprop"), home.path().join("out"), scene.path().to_owned()];
            let outside = watched.writes_outside(&own.each_ref().map(PathBuf::as_path));
            assert_eq!(outside, [] as [&str; 0], "{}: {command:?}", way.name);
        }
        let left = fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().file_name());
        assert!(left.into_iter().all(|name| name == "gprop"), "{}", way.name);
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
    let mut caller = Command::new(std::env::current_exe().unwrap());
    caller.args(["--exact", "libraries::a_caller_of_the_library"]).env_remove("ORT_DISABLE_TELEMETRY");
    caller.env("XDG_CACHE_HOME", home.path()).env("ORT_DYLIB_PATH", files.onnxruntime).env("GPROP_OFFLINE", "1");
    // The cache with SAM's own files, which `models` wants to see.
    let cached = files.encoder.parent().unwrap().parent().unwrap();
    symlink(cached, home.path().join("gprop")).unwrap();
    let Some(watched) = Watched::run(TEST, &caller) else { return };
    let refused = |call: &&str| call.contains("EACCES");
    assert!(watched.network().iter().all(refused), "{:#?}", watched.network());
    assert!(watched.writes_outside(&[]).iter().all(refused), "{:#?}", watched.writes_outside(&[]));
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
}
