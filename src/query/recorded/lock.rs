//! A lock on one question while it is out: another gprop that has the same question waits, and finds it answered.
//!
//! The lock is a file beside the recordings, hidden and without `.json`, that nothing takes for one. It is there only while
//! the question is out. That of a gprop which was killed holds nobody up, and goes with the next that takes it.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use crate::query::sha256::Sha256Hex;
use crate::workdir;

/// A question that only this process may ask now, until this is dropped.
#[derive(Debug)]
pub struct QuestionLock {
    path: PathBuf,
    /// Held, never read: the lock ends with the process, however that ends.
    _file: File,
}

impl QuestionLock {
    /// Takes the lock on the question whose recording in `folder` would have `key`; `None` while another has it.
    pub fn take(folder: &Path, key: &Sha256Hex) -> io::Result<Option<Self>> {
        let path = folder.join(format!(".asking-{key}.lock"));
        workdir::refuse_link(&path, "--recordings").map_err(io::Error::other)?;
        let Some(file) = workdir::lock::exclusive(&path)? else { return Ok(None) };
        // Whoever had the lock before may have removed the file between our opening and our locking it.
        Ok(is_at(&file, &path)?.then(|| Self { path, _file: file }))
    }
}

impl Drop for QuestionLock {
    fn drop(&mut self) {
        // While the lock is held. A file that stays is litter and holds nobody up.
        let _ = fs::remove_file(&self.path);
    }
}

/// Whether `path` names this file and not a newer one.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let held = file.metadata()?;
    match fs::metadata(path) {
        Ok(named) => Ok((held.dev(), held.ino()) == (named.dev(), named.ino())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

/// A file that is open cannot be removed by another here.
#[cfg(not(unix))]
fn is_at(_file: &File, _path: &Path) -> io::Result<bool> {
    Ok(true)
}
