//! A lock on one question while it is being asked: another gprop process with the same question waits, and then finds
//! it answered.
//!
//! The lock is a hidden file beside the recordings, without the extension `.json`, so it is never taken for a
//! recording. It exists only while the question is being asked. The file of a gprop process that was killed does not
//! block anyone, and is removed by the next process that takes the lock.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::query::recorded::sha256::Sha256Hex;
use crate::workdir;

/// A question that only this process may ask until this value is dropped.
#[derive(Debug)]
pub struct QuestionLock {
    path: PathBuf,
    /// Held but never read: the lock ends with the process, however that ends.
    _file: File,
}

impl QuestionLock {
    /// Takes the lock on the question whose recording in `folder` would have `key`; `None` while another process has
    /// it.
    pub fn take(folder: &Path, key: &Sha256Hex) -> io::Result<Option<Self>> {
        let path = folder.join(format!(".asking-{key}.lock"));
        workdir::refuse_link(&path, "--recordings").map_err(io::Error::other)?;
        loop {
            let Some(file) = workdir::lock::exclusive(&path)? else { return Ok(None) };
            // The previous owner of the lock may have removed the file between our opening and locking it.
            if is_at(&file, &path)? {
                return Ok(Some(Self { path, _file: file }));
            }
        }
    }
}

impl Drop for QuestionLock {
    fn drop(&mut self) {
        // Removed while the lock is held. A file that cannot be removed does no harm.
        let _ = fs::remove_file(&self.path);
    }
}

/// True if `path` names this file and not a newer one.
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    let held = file.metadata()?;
    match fs::metadata(path) {
        Ok(named) => Ok((held.dev(), held.ino()) == (named.dev(), named.ino())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}
