//! The user's options for the library.

use std::borrow::Cow;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{LibraryError, MaterialLibrary};
use crate::config::SceneKey;
use crate::config::option_values;

/// The keys that a scene may set: a library with the scene's own materials.
pub const SCENE_KEYS: &[SceneKey] = &[SceneKey::path("materials")];

/// The materials to choose from.
#[derive(Debug, Clone, Default, PartialEq, Eq, clap::Args, Serialize, Deserialize)]
#[serde(default)]
#[command(next_help_heading = "Materials")]
pub struct Options {
    /// CSV or folder of CSVs (columns: see materials/README.md) whose materials are added to the built-in library, or replace
    /// those of the same name
    #[arg(long, value_name = "FILE|DIR", value_parser = option_values::file_or_folder())]
    pub materials: Option<PathBuf>,
}

impl Options {
    /// The built-in library with the user's additions.
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
