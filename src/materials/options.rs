//! What the user may choose about the library.

use std::borrow::Cow;
use std::path::PathBuf;

use serde::Serialize;

use super::{LibraryError, MaterialLibrary};

/// Which materials there are.
#[derive(Debug, Clone, Default, PartialEq, Eq, clap::Args, Serialize)]
#[command(next_help_heading = "Materials")]
pub struct Options {
    /// A CSV or a folder of CSVs, columns as materials/README.md says, that adds to the built-in library or replaces
    /// materials of the same name
    #[arg(long, value_name = "FILE|DIR")]
    pub materials: Option<PathBuf>,
}

impl Options {
    /// The built-in library with what the user adds.
    ///
    /// # Errors
    /// [`LibraryError`] names the file, line and column.
    pub fn library(&self) -> Result<Cow<'static, MaterialLibrary>, LibraryError> {
        Ok(match &self.materials {
            None => Cow::Borrowed(MaterialLibrary::builtin()),
            Some(path) => Cow::Owned(MaterialLibrary::load(path)?),
        })
    }
}
