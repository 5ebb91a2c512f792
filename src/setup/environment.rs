//! The process environment as set-up needs it, read in one place so that everything below is a function of values.

use std::ffi::OsString;
use std::path::PathBuf;

/// The environment variables that set-up uses.
#[derive(Debug, Clone, Default)]
pub struct Environment {
    /// `$XDG_CACHE_HOME/gprop`, else `$HOME/.cache/gprop`; `None` if neither is set.
    pub cache: Option<PathBuf>,
    /// `ORT_DYLIB_PATH`.
    pub ort_dylib_path: Option<PathBuf>,
    /// True if `GPROP_OFFLINE` is set and neither empty nor `0`.
    pub offline: bool,
    /// `PATH`, in which `python3`, `npm` and `ffmpeg` are looked up.
    pub path: Option<OsString>,
    /// This program's file, without links. A wheel puts it into `bin` of a Python environment, whose packages lie
    /// beside it.
    pub program: Option<PathBuf>,
}

/// Why no connection may be opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Offline {
    #[error("GPROP_OFFLINE is set, so no connection is opened; unset it to go online")]
    Variable,
    #[error("--offline is given, so no connection is opened; leave it out to go online")]
    Flag,
}

impl Environment {
    /// The environment of this process.
    pub fn of_process() -> Self {
        let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        // The XDG base directory specification: a relative path is invalid and ignored.
        let xdg_cache = set("XDG_CACHE_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
        let home_cache = set("HOME").map(|home| PathBuf::from(home).join(".cache"));
        Self {
            cache: xdg_cache.or(home_cache).map(|base| base.join("gprop")),
            ort_dylib_path: set("ORT_DYLIB_PATH").map(PathBuf::from),
            offline: set("GPROP_OFFLINE").is_some_and(|value| value != "0"),
            path: set("PATH"),
            program: std::env::current_exe().and_then(|path| path.canonicalize()).ok(),
        }
    }

    /// Checks that connections may be opened, given whether `--offline` is set. Nothing else decides this.
    ///
    /// # Errors
    /// If connections are forbidden; the error says by what.
    pub fn network(&self, offline_flag: bool) -> Result<(), Offline> {
        match (self.offline, offline_flag) {
            (true, _) => Err(Offline::Variable),
            (false, true) => Err(Offline::Flag),
            (false, false) => Ok(()),
        }
    }
}
