use std::io::Write;
use std::sync::OnceLock;

use gprop::progress::Progress;
use gprop::setup::{self, ModelFiles, SetupError};

/// Says on stderr, past the harness's capture, that a test did not run and why.
pub fn skipped(test: &str, why: &str) {
    let _ = writeln!(std::io::stderr(), "skipped {test}: {why}");
}

/// ONNX Runtime and SAM as any user gets them; `None`, said aloud, where they cannot be had here (no network, offline,
/// another platform). Anything else that is wrong with them fails the test.
pub fn models(test: &str) -> Option<ModelFiles> {
    static MODELS: OnceLock<Result<ModelFiles, String>> = OnceLock::new();
    let obtained = MODELS.get_or_init(|| match setup::obtain(&setup::Options::default(), Progress::Hidden) {
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
