//! The files that a mesh file names: they lie in its folder or where the user allowed, and their bytes are counted.

use std::io;
use std::path::{Path, PathBuf};

use super::Problem;
use crate::files;
use crate::files::read_scope::ReadScope;
use crate::scene::reference::Reference;

/// The most bytes of a mesh file and of all files that it names, textures included.
pub const MOST_BYTES: u64 = 4 << 30;

/// The files beside a mesh.
pub(super) struct Beside<'a> {
    /// The mesh's folder and what may be read; `None` for bytes that have no place.
    place: Option<(&'a Path, ReadScope)>,
    bytes_left: u64,
    files: Vec<PathBuf>,
}

impl<'a> Beside<'a> {
    /// For a mesh at `path`, which the user named: its folder may be read, and what `scope` allows.
    pub fn of(path: &'a Path, scope: &ReadScope) -> Self {
        let folder = path.parent().unwrap_or(Path::new(""));
        Self { place: Some((folder, scope.clone().and([folder]))), bytes_left: MOST_BYTES, files: Vec::new() }
    }

    /// For bytes that have no place: nothing is beside them.
    pub fn nothing() -> Self {
        Self { place: None, bytes_left: MOST_BYTES, files: Vec::new() }
    }

    /// The files that were read or found.
    pub fn into_files(self) -> Vec<PathBuf> {
        self.files
    }

    /// The bytes of the mesh file itself.
    pub fn own_bytes(&mut self, path: &Path) -> Result<Vec<u8>, Problem> {
        let bytes = files::read_large(path).map_err(Problem::Io)?;
        self.count(bytes.len() as u64)?;
        Ok(bytes)
    }

    /// The bytes of the file `name`, a path relative to the mesh's folder; `what` is its kind, for messages.
    pub fn read(&mut self, what: &'static str, name: &str) -> Result<Vec<u8>, Problem> {
        let path = self.path(what, name)?;
        let unreadable = |reason| Problem::Beside { what, name: name.to_owned(), reason };
        let size = files::open(&path).and_then(|file| file.metadata()).map_err(unreadable)?.len();
        self.count(size)?;
        let bytes = files::read_large(&path).map_err(unreadable)?;
        self.files.push(path);
        Ok(bytes)
    }

    /// The path of the texture `name`, if there is a file; its bytes are counted. `None` if there is none.
    pub fn find_picture(&mut self, name: &str) -> Result<Option<PathBuf>, Problem> {
        let path = self.path("texture", name)?;
        if self.place.is_none() || !files::is_there(&path) {
            return Ok(None);
        }
        let unreadable = |reason| Problem::Beside { what: "texture", name: name.to_owned(), reason };
        let size = files::open(&path).and_then(|file| file.metadata()).map_err(unreadable)?.len();
        self.count(size)?;
        if !self.files.contains(&path) {
            self.files.push(path.clone());
        }
        Ok(Some(path))
    }

    /// The path of a file that may be read.
    fn path(&self, what: &'static str, name: &str) -> Result<PathBuf, Problem> {
        if name.contains("://") {
            return Err(Problem::Remote { what, name: shortened(name) });
        }
        let Some((folder, scope)) = &self.place else {
            let reason = io::Error::from(io::ErrorKind::NotFound);
            return Err(Problem::Beside { what, name: shortened(name), reason });
        };
        let path = folder.join(name);
        Reference { what, path: &path, named_in: None, flag: None }.check(scope)?;
        Ok(path)
    }

    fn count(&mut self, bytes: u64) -> Result<(), Problem> {
        self.bytes_left = self.bytes_left.checked_sub(bytes).ok_or(Problem::TooManyBytes { most: MOST_BYTES })?;
        Ok(())
    }
}

/// The beginning of a name from a file, for a message.
pub(super) fn shortened(name: &str) -> String {
    const MOST_SHOWN: usize = 100;
    match name.char_indices().nth(MOST_SHOWN) {
        Some((end, _)) => format!("{}...", &name[..end]),
        None => name.to_owned(),
    }
}
