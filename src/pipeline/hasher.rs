//! The hash over everything that a result depends on.

use std::path::Path;

use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::files::json;
use crate::scene::SceneError;
use crate::words::readable::hexadecimal;
use crate::workdir::{FORMAT_VERSION, sha256_of_file};

/// gprop's version with the format of its artifacts.
pub fn version() -> String {
    format!("{}+format.{FORMAT_VERSION}", env!("CARGO_PKG_VERSION"))
}

/// SHA-256 over strings of bytes, each with its length, so that no two lists of them hash the same bytes.
#[derive(Clone)]
pub struct Hasher(Sha256);

impl Hasher {
    /// A hash that begins with gprop's version and format.
    pub fn new(what: &str) -> Self {
        Self(Sha256::new()).with(version().as_bytes()).with(what.as_bytes())
    }

    /// Adds bytes.
    pub fn with(mut self, bytes: &[u8]) -> Self {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// Adds a value as its JSON.
    pub fn with_json(self, value: &impl Serialize) -> Self {
        let json = json::compact(value).expect("options and results are plain data");
        self.with(json.as_bytes())
    }

    /// The hash in lower-case hexadecimal.
    pub fn hex(self) -> String {
        hexadecimal(&self.0.finalize())
    }
}

/// SHA-256 of the content of one of the user's files.
///
/// # Errors
/// [`SceneError::Io`], including if the file has disappeared since the scene was loaded.
pub fn file_digest(path: &Path) -> Result<[u8; 32], SceneError> {
    sha256_of_file(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })
}
