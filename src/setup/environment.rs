//! What the process environment says to set-up, read in one place so that everything below is a function of values.

use std::ffi::OsString;
use std::path::PathBuf;

/// The environment variables that set-up heeds.
#[derive(Debug, Clone, Default)]
pub struct Environment {
    /// `$XDG_CACHE_HOME/gprop`, else `$HOME/.cache/gprop`; `None` where neither is set.
    pub cache: Option<PathBuf>,
    /// `ORT_DYLIB_PATH`.
    pub ort_dylib_path: Option<PathBuf>,
    /// `GPROP_OFFLINE` is set and neither empty nor `0`.
    pub offline: bool,
    /// `PATH`, where `python3` and `npm` are looked for.
    pub path: Option<OsString>,
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
    /// That of this process.
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
        }
    }

    /// Whether connections may be opened when `--offline` is given or not. Nothing else decides this.
    ///
    /// # Errors
    /// Connections are forbidden; by what.
    pub fn network(&self, offline_flag: bool) -> Result<(), Offline> {
        match (self.offline, offline_flag) {
            (true, _) => Err(Offline::Variable),
            (false, true) => Err(Offline::Flag),
            (false, false) => Ok(()),
        }
    }
}
