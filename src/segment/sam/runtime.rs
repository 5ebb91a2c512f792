//! ONNX Runtime in this process: loaded once, from an explicit path, quiet on stderr.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use ort::environment::Environment;
use ort::logging::LogLevel;
use ort::session::Session;

use super::super::error::SegmentError;

/// The environment and where its library came from. Lives as long as the process: `ort` allows one for all time.
static LOADED: Mutex<Option<(PathBuf, Environment)>> = Mutex::new(None);

/// Loads ONNX Runtime from `path`, or returns what is already loaded from there.
pub fn load(path: &Path) -> Result<Environment, SegmentError> {
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((from, environment)) = &*loaded {
        if from == path {
            return Ok(environment.clone());
        }
        return Err(SegmentError::OtherRuntime { loaded: from.clone(), path: path.to_owned() });
    }
    let failed = |reason: String| SegmentError::Runtime { path: path.to_owned(), reason };
    // `ort` resolves a relative path against the executable's folder.
    let absolute = std::path::absolute(path).map_err(|error| failed(error.to_string()))?;
    let environment = ort::init_from(&absolute)
        .map_err(|error| failed(error.to_string()))?
        .with_name("gprop")
        .with_telemetry(false)
        .with_logger(Arc::new(log))
        .build()
        .map_err(|error| failed(error.to_string()))?;
    *loaded = Some((path.to_owned(), environment.clone()));
    Ok(environment)
}

/// A session that computes on the calling thread alone: gprop runs pictures and prompts side by side, and a sum that is
/// split among threads could round differently from run to run.
pub fn session(environment: &Environment, model: &[u8]) -> Result<Session, String> {
    let build = || -> ort::Result<Session> {
        Session::builder(environment)?.with_intra_threads(1)?.with_inter_threads(1)?.commit_from_memory(model)
    };
    build().map_err(|error| error.to_string())
}

fn log(level: LogLevel, category: &str, _id: &str, _location: &str, message: &str) {
    match level {
        LogLevel::Fatal | LogLevel::Error => tracing::warn!("ONNX Runtime, {category}: {message}"),
        LogLevel::Warning => tracing::debug!("ONNX Runtime, {category}: {message}"),
        _ => tracing::trace!("ONNX Runtime, {category}: {message}"),
    }
}
