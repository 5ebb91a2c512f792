//! Finds the files and checks that they are valid. Fetches nothing.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::catalog::{ONNXRUNTIME_NODE, ONNXRUNTIME_WHEEL, PinnedFile, SAM_DECODER, SAM_ENCODER};
use super::environment::Environment;
use super::error::SetupError;
use super::{Options, library};
use crate::files;
use crate::workdir::Checksum;

/// The order in which gprop looks for files, for display. [`onnxruntime`], [`encoder`] and [`decoder`] follow it.
pub const LOOKUP_ORDER: &str = "\
ONNX Runtime: --ort-lib, then ORT_DYLIB_PATH, then the Python environment of gprop's wheel, then the cache
SAM encoder:  --sam-encoder, then the cache
SAM decoder:  --sam-decoder, then the cache
cache:        $XDG_CACHE_HOME/gprop, by default ~/.cache/gprop";

/// The flag, variable or default that determines where a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Source {
    #[serde(rename = "--ort-lib")]
    OrtLib,
    #[serde(rename = "ORT_DYLIB_PATH")]
    OrtDylibPath,
    #[serde(rename = "--sam-encoder")]
    SamEncoder,
    #[serde(rename = "--sam-decoder")]
    SamDecoder,
    /// The Python environment in which this program is installed.
    #[serde(rename = "python environment")]
    PythonEnvironment,
    #[serde(rename = "cache")]
    Cache,
}

impl Source {
    /// Its name, as the user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::OrtLib => "--ort-lib",
            Self::OrtDylibPath => "ORT_DYLIB_PATH",
            Self::SamEncoder => "--sam-encoder",
            Self::SamDecoder => "--sam-decoder",
            Self::PythonEnvironment => "the Python environment",
            Self::Cache => "the cache",
        }
    }
}

/// A usable ONNX Runtime.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Runtime {
    pub path: PathBuf,
    pub version: String,
    pub source: Source,
}

/// ONNX Runtime: one that the user named is loaded to get its version; one in the program's Python environment or in the
/// cache is recognized by its hash.
pub fn onnxruntime(options: &Options, environment: &Environment) -> Result<Runtime, SetupError> {
    let flag = options.ort_lib.as_ref().map(|path| (Source::OrtLib, path));
    let named = flag.or_else(|| environment.ort_dylib_path.as_ref().map(|path| (Source::OrtDylibPath, path)));
    if let Some((source, path)) = named {
        check_user_file(source, path)?;
        let version = library::version(path, source.name())?;
        return Ok(Runtime { path: path.clone(), version, source });
    }
    if let Some(path) = in_python_environment(environment) {
        let version = ONNXRUNTIME_WHEEL.version.to_owned();
        return Ok(Runtime { path, version, source: Source::PythonEnvironment });
    }
    let in_cache = |package: &super::catalog::Package| {
        let path = cached(environment, &package.files[0], Source::OrtLib)?;
        Ok(Runtime { path, version: package.version.to_owned(), source: Source::Cache })
    };
    // If neither is there, the message is about the one that would be fetched first.
    in_cache(&ONNXRUNTIME_WHEEL).or_else(|missing| in_cache(&ONNXRUNTIME_NODE).map_err(|_| missing))
}

/// ONNX Runtime as the package on which gprop's wheel depends installs it: for the program `E/bin/gprop`, in
/// `E/lib/python3.N/site-packages` (in Debian's own Python, `dist-packages`). Neither the working folder, nor the scene,
/// nor the interpreter that happens to be first on the `PATH` has a say; and only the published file counts.
fn in_python_environment(environment: &Environment) -> Option<PathBuf> {
    let bin = environment.program.as_ref()?.parent()?;
    let file = &ONNXRUNTIME_WHEEL.files[0];
    let versions = fs::read_dir(bin.parent()?.join("lib")).ok()?;
    let mut versions: Vec<PathBuf> = versions.filter_map(|entry| Some(entry.ok()?.path())).collect();
    versions.retain(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("python3")));
    versions.sort();
    let packages = versions.iter().flat_map(|path| ["site-packages", "dist-packages"].map(|name| path.join(name)));
    let mut libraries = packages.map(|packages| packages.join(file.member));
    libraries.find(|path| Checksum::of_file(path).is_ok_and(|found| found.sha256 == file.sha256))
}

/// The SAM encoder.
pub fn encoder(options: &Options, environment: &Environment) -> Result<PathBuf, SetupError> {
    model(options.sam_encoder.as_deref(), Source::SamEncoder, &SAM_ENCODER, environment)
}

/// The SAM decoder.
pub fn decoder(options: &Options, environment: &Environment) -> Result<PathBuf, SetupError> {
    model(options.sam_decoder.as_deref(), Source::SamDecoder, &SAM_DECODER, environment)
}

fn model(
    named: Option<&Path>,
    flag: Source,
    pinned: &PinnedFile,
    environment: &Environment,
) -> Result<PathBuf, SetupError> {
    match named {
        Some(path) => check_user_file(flag, path).map(|()| path.to_owned()),
        None => cached(environment, pinned, flag),
    }
}

/// Checks that a file that the user named exists and can be read.
fn check_user_file(source: Source, path: &Path) -> Result<(), SetupError> {
    let Err(error) = files::open(path) else { return Ok(()) };
    let problem = match error.kind() {
        io::ErrorKind::NotFound => "does not exist".to_owned(),
        io::ErrorKind::IsADirectory | io::ErrorKind::InvalidInput => "is not a file".to_owned(),
        _ => format!("cannot be read ({error})"),
    };
    Err(SetupError::UserFile { given_by: source.name(), path: path.to_owned(), problem })
}

/// The pinned file in the cache, if its hash is correct. `flag` is the option to use another file, for the message.
fn cached(environment: &Environment, file: &PinnedFile, flag: Source) -> Result<PathBuf, SetupError> {
    let path = environment.cache.as_deref().ok_or(SetupError::NoCache)?.join(file.cached);
    let state = match Checksum::of_file(&path).map(|found| found.sha256) {
        Ok(found) if found == file.sha256 => return Ok(path),
        Ok(found) => format!("is damaged: its SHA-256 is {found}, expected {}", file.sha256),
        Err(error) if error.kind() == io::ErrorKind::NotFound => "does not exist".to_owned(),
        Err(source) => return Err(SetupError::Io { action: "read", path, source }),
    };
    Err(SetupError::NotCached { title: file.title, path, state, flag: flag.name() })
}
