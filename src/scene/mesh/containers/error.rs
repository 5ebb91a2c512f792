//! Errors that the readers of containers report.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::scene::mesh::MeshError;

/// Why a container cannot be read.
#[derive(Debug, Error)]
pub enum ContainerError {
    #[error("cannot read {path:?}: {source}")]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{path:?}, {broken}")]
    Broken { path: PathBuf, broken: Broken },
    #[error(transparent)]
    Mesh(#[from] MeshError),
    #[error("{path:?} is none of URDF, MJCF, USD and glTF with physics: {found}")]
    NotAContainer { path: PathBuf, found: String },
}

/// What is wrong with a text, and where.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("line {line}: {problem}")]
pub struct Broken {
    /// Counted from 1.
    pub line: usize,
    pub problem: String,
}

impl Broken {
    pub fn new(line: usize, problem: impl Into<String>) -> Self {
        Self { line, problem: problem.into() }
    }

    /// The error of the file at `path`.
    pub fn of(self, path: impl Into<PathBuf>) -> ContainerError {
        ContainerError::Broken { path: path.into(), broken: self }
    }
}
