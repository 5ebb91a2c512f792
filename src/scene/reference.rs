//! A file that a scene refers to, and whether it may be read.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::files::read_scope::ReadScope;
use crate::words::shell;

/// A file that a scene refers to but that is not in its folder.
#[derive(Debug, Error)]
#[error(
    "{what} `{}`{} lies outside the scene folder, at `{}`, and gprop reads nothing outside it that you did not name. If you trust it, \
     add {}`--allow-read {}`; or copy it into the scene folder",
    path.display(),
    named_in.as_deref().map(|file| format!(", which `{}` names,", file.display())).unwrap_or_default(),
    leads_to.display(),
    flag.as_ref().map(|(flag, path)| format!("`{flag} {}` or ", shell::path(path))).unwrap_or_default(),
    shell::path(allow)
)]
pub struct Outside {
    pub what: &'static str,
    pub path: PathBuf,
    /// The file that refers to it.
    pub named_in: Option<PathBuf>,
    pub leads_to: PathBuf,
    /// The folder that would have to be allowed: the path's target if that is a folder, else the folder that holds the
    /// target.
    pub allow: PathBuf,
    /// A flag by which it can be allowed, with its value.
    pub flag: Option<(&'static str, PathBuf)>,
}

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
    /// [`Outside`], which says where the path leads and how to allow it.
    pub fn check(&self, scope: &ReadScope) -> Result<(), Box<Outside>> {
        let Some(leads_to) = scope.leads_out(self.path) else { return Ok(()) };
        let holding = if leads_to.is_dir() { None } else { leads_to.parent() };
        Err(Box::new(Outside {
            allow: holding.unwrap_or(&leads_to).to_owned(),
            what: self.what,
            path: self.path.to_owned(),
            named_in: self.named_in.map(Path::to_owned),
            leads_to,
            flag: self.flag.map(|(flag, path)| (flag, path.to_owned())),
        }))
    }
}
