//! Errors of segmentation. All of them are about ONNX Runtime or a model; it is not an error if SAM finds nothing in a
//! picture.

use std::path::PathBuf;

use super::sam::mismatch::Mismatch;
use crate::config::option_values::OptionError;

/// A failure of a model or of ONNX Runtime.
#[derive(Debug, thiserror::Error)]
pub enum SegmentError {
    #[error("{0}")]
    Option(#[from] OptionError),
    #[error("cannot load ONNX Runtime from {path:?}: {reason}; `gprop doctor` shows where gprop looks for it")]
    Runtime { path: PathBuf, reason: String },
    #[error("ONNX Runtime is already loaded from {loaded:?}, and a process can load only one: {path:?} is not used")]
    OtherRuntime { loaded: PathBuf, path: PathBuf },
    #[error("cannot read {path:?}: {source}")]
    Read {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    #[error("cannot write {path:?}: {source}; make room, or run without --cache-embeddings")]
    Write {
        path: PathBuf,
        #[source]
        source: std::io::Error,
    },
    #[error("ONNX Runtime cannot load {path:?}: {source}; the file must be complete and contain {what}")]
    Model { path: PathBuf, what: &'static str, source: Mismatch },
    #[error("{path:?} is not {what}: {source}")]
    NotSam { path: PathBuf, what: &'static str, source: Mismatch },
    #[error(
        "--decoder native: gprop cannot run the decoder in {path:?} with its own code: {source}; without --decoder, or with \
         --decoder onnxruntime, ONNX Runtime runs it, which is slower"
    )]
    NoNativeDecoder { path: PathBuf, source: Mismatch },
    #[error("ONNX Runtime failed to run {what}: {source}")]
    Run { what: &'static str, source: Mismatch },
}
