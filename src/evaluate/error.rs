//! Why numbers could not be compared with their truth.

use std::path::PathBuf;

/// What is wrong with predictions or truth, where, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    #[error("cannot read {path:?}{remedy}")]
    Read { path: PathBuf, source: std::io::Error, remedy: &'static str },
    #[error("{path:?} does not hold {expected}")]
    Json { path: PathBuf, expected: &'static str, source: serde_json::Error },
    #[error("{path:?} line {line}: {message}")]
    Row { path: PathBuf, line: u64, message: String },
    #[error(
        "{id:?} is predicted but the truth has no {key:?}; an id is looked up by what comes before its first underscore"
    )]
    NoTruth { id: String, key: String },
    #[error("{what} of {id:?} is {value}: ratios and logarithms need numbers above 0")]
    NotPositive { what: &'static str, id: String, value: f64 },
    #[error("there is nothing to compare: {0}")]
    Nothing(&'static str),
}
