//! A file that a scene refers to, and whether it may be read.

use std::path::Path;

use super::error::{Outside, SceneError};
use crate::files::read_scope::ReadScope;

/// A file that a scene names or that was found in it.
#[derive(Debug, Clone, Copy)]
pub struct Reference<'a> {
    /// Its kind, for messages.
    pub what: &'static str,
    pub path: &'a Path,
    /// The file that names it, if one does.
    pub named_in: Option<&'a Path>,
    /// A flag by which the user may name it, with its value.
    pub flag: Option<(&'static str, &'a Path)>,
}

impl Reference<'_> {
    /// Refuses a file that is outside of the scene and of what the user allowed.
    ///
    /// # Errors
    /// [`SceneError::Outside`], which says where the path leads and how to allow it.
    pub fn check(&self, scope: &ReadScope) -> Result<(), SceneError> {
        let Some(leads_to) = scope.leads_out(self.path) else { return Ok(()) };
        let holding = if leads_to.is_dir() { None } else { leads_to.parent() };
        Err(SceneError::Outside(Box::new(Outside {
            allow: holding.unwrap_or(&leads_to).to_owned(),
            what: self.what,
            path: self.path.to_owned(),
            named_in: self.named_in.map(Path::to_owned),
            leads_to,
            flag: self.flag.map(|(flag, path)| (flag, path.to_owned())),
        })))
    }
}
