//! File locks, which the system releases when the process that holds them ends, however it ends.
//!
//! A process that takes an exclusive lock writes its identity into the file, so that a process that is kept out can
//! report it. The files are opened with `O_CLOEXEC`, as the standard library opens all files: no child of a process
//! inherits its lock.

use std::fmt;
use std::fs::{File, TryLockError};
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use rustix::fs::OFlags;
use serde::{Deserialize, Serialize};

use crate::files::json;
use crate::files::{self, write};

/// How long a killed process may hold its lock while the system frees its memory: gigabytes take tenths of a second. If
/// the lock's holder is alive, a process that is kept out waits this long once before it gives up.
const PATIENCE: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(20);

/// Most bytes that are read from a lock's file to find its holder.
const MAX_SIGNATURE_BYTES: u64 = 4096;
/// The last second that an HTTP date can express, in the year 9999.
const LAST_SECOND: u64 = 253_402_300_799;

/// Takes the lock for this process alone; `None` if another process holds it. A process that has ended holds no lock,
/// however it ended.
///
/// # Errors
/// If the file cannot be created or written, or is a link: the lock's content would replace that of the link's target.
pub fn exclusive(path: &Path) -> io::Result<Option<File>> {
    if files::is_special(path) {
        files::require_regular(path)?;
    }
    let file = write::open_in_place(path, OFlags::CREATE)?;
    let taken = patiently(|| file.try_lock())?;
    if taken {
        // Only informs processes that are kept out: the lock holds without it.
        let _ = sign(&file);
    }
    Ok(taken.then_some(file))
}

/// Takes the lock together with other readers; `None` if a process holds it exclusively.
///
/// # Errors
/// If the file does not exist or cannot be read.
pub fn shared(path: &Path) -> io::Result<Option<File>> {
    let file = files::open(path)?;
    Ok(patiently(|| file.try_lock_shared())?.then_some(file))
}

fn patiently(try_lock: impl Fn() -> Result<(), TryLockError>) -> io::Result<bool> {
    let since = Instant::now();
    loop {
        match try_lock() {
            Ok(()) => return Ok(true),
            Err(TryLockError::WouldBlock) if since.elapsed() > PATIENCE => return Ok(false),
            Err(TryLockError::WouldBlock) => std::thread::sleep(POLL),
            Err(TryLockError::Error(error)) => return Err(error),
        }
    }
}

/// The content of a lock's file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Signature {
    process: u32,
    host: String,
    /// Seconds since 1970-01-01 UTC.
    since: u64,
}

fn sign(mut file: &File) -> io::Result<()> {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let host = sysinfo::System::host_name().unwrap_or_default();
    let signature = Signature { process: std::process::id(), host, since };
    file.set_len(0)?;
    file.write_all(json::compact(&signature)?.as_bytes())
}

/// The process that holds a lock.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Holder(Kind);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Kind {
    Reads,
    Works(Option<Signature>),
}

impl Holder {
    /// The holder of the lock of the file at `path`, as far as it is known.
    pub fn of(path: &Path) -> Self {
        let Ok(file) = files::open(path) else { return Self(Kind::Works(None)) };
        if file.try_lock_shared().is_ok() {
            return Self(Kind::Reads);
        }
        let mut words = Vec::new();
        let read = (&file).take(MAX_SIGNATURE_BYTES).read_to_end(&mut words);
        Self(Kind::Works(read.ok().and_then(|_| json::read(&words).ok())))
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Kind::Reads => f.write_str("is reading"),
            Kind::Works(None) => f.write_str("is working in"),
            Kind::Works(Some(Signature { process, host, since })) => {
                let since = UNIX_EPOCH + Duration::from_secs((*since).min(LAST_SECOND));
                let since = httpdate::fmt_http_date(since);
                write!(f, "(process {process} on {host:?}, since {since}) is working in")
            }
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_link_is_not_locked() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("precious"), folder.path().join(".lock"));
        for exists in [false, true] {
            if exists {
                fs::write(&target, "as it was").unwrap();
            }
            std::os::unix::fs::symlink(&target, &link).unwrap();
            let error = exclusive(&link).unwrap_err();
            assert!(error.to_string().contains("is a link"), "{error}");
            assert_eq!(fs::read_to_string(&target).ok(), exists.then(|| "as it was".to_owned()));
            fs::remove_file(&link).unwrap();
        }
        assert!(exclusive(&link).unwrap().is_some());
    }
}
