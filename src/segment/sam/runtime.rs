//! ONNX Runtime in this process: loaded once, from an explicit path, without messages on stderr. Its code runs [confined]:
//! without the network, and without writing files.

use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

pub use ort::environment::Environment as Runtime;
use ort::logging::LogLevel;
use ort::session::builder::SessionBuilder;
use ort::session::{SessionInputs, SessionOutputs};

use super::super::error::SegmentError;
use crate::setup::confined;

/// Adding and normalising in one step, which takes ONNX Runtime longer than two separate steps (measured in 1.31.1: 4.4
/// milliseconds against 0.9 for `[4096,256]`, in total a fifth of a prompt's time).
const SLOW_FUSION: &str = "SkipLayerNormFusion";

/// The environment and the path of its library. It lives as long as the process: `ort` allows only one.
static LOADED: Mutex<Option<(PathBuf, Runtime)>> = Mutex::new(None);

/// Loads ONNX Runtime from `path`, or returns what is already loaded from there.
pub fn load(path: &Path) -> Result<Runtime, SegmentError> {
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
    let environment = confined(|| {
        let loaded = ort::init_from(&absolute).map_err(|error| failed(error.to_string()))?;
        let environment = loaded.with_name("gprop").with_telemetry(false).with_logger(Arc::new(log)).build();
        environment.map_err(|error| failed(error.to_string()))
    })?;
    *loaded = Some((path.to_owned(), environment.clone()));
    Ok(environment)
}

/// A loaded network.
pub struct Session(Option<ort::session::Session>);

impl Session {
    /// Runs the network.
    pub fn run<'s, 'i, 'v: 'i, const N: usize>(
        &'s mut self,
        inputs: impl Into<SessionInputs<'i, 'v, N>> + Send,
    ) -> ort::Result<SessionOutputs<'s>> {
        let session = self.0.as_mut().expect(THERE);
        confined(move || session.run(inputs))
    }
}

/// Its inputs and outputs.
impl Deref for Session {
    type Target = ort::session::Session;

    fn deref(&self) -> &Self::Target {
        self.0.as_ref().expect(THERE)
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let session = self.0.take();
        confined(move || drop(session));
    }
}

const THERE: &str = "a session is there until it is dropped";

/// A session of the model in `model` that computes on the calling thread only: gprop runs pictures and prompts in
/// parallel, and a sum that is split among threads could round differently from run to run.
pub fn session(runtime: &Runtime, model: &[u8]) -> ort::Result<Session> {
    open(runtime, |mut builder| builder.commit_from_memory(model))
}

/// As [`session`], for a model in a file.
pub fn session_of_file(runtime: &Runtime, path: &Path) -> ort::Result<Session> {
    open(runtime, |mut builder| builder.commit_from_file(path))
}

fn open(
    runtime: &Runtime,
    commit: impl FnOnce(SessionBuilder) -> ort::Result<ort::session::Session> + Send,
) -> ort::Result<Session> {
    confined(|| {
        let builder = ort::session::Session::builder(runtime)?.with_intra_threads(1)?.with_inter_threads(1)?;
        // Memory planned ahead as one block is never shared between steps: the encoder would need 430 MB, not 240.
        let builder = builder.with_memory_pattern(false)?.with_disabled_optimizers(SLOW_FUSION)?;
        Ok(Session(Some(commit(builder)?)))
    })
}

fn log(level: LogLevel, category: &str, _id: &str, _location: &str, message: &str) {
    match level {
        LogLevel::Fatal | LogLevel::Error => tracing::warn!("ONNX Runtime, {category}: {message}"),
        LogLevel::Warning => tracing::debug!("ONNX Runtime, {category}: {message}"),
        _ => tracing::trace!("ONNX Runtime, {category}: {message}"),
    }
}
