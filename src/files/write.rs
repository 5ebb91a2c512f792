//! The one way in which gprop writes files.
//!
//! A file is written under a temporary name beside its place and renamed into it, so a reader (or a killed run) sees the old
//! file or the new one, never half of one. A link in the place of a file is replaced, not followed.
//!
//! Everything is written below a [`Folder`]: one that the user named, or a work folder. A link *below* it may come from
//! whoever made what is in it, so none is followed: each folder on the way is opened in the one above it. That holds even if
//! another program puts a link there in the meantime, and even if it puts one in the place of the folder itself.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::os::fd::OwnedFd;
use std::path::{Component, Path, PathBuf};

use rustix::fs::{AtFlags, CWD, FileType, Mode, OFlags};

/// Prefix of temporary file names.
pub const TEMPORARY: &str = ".tmp-";

/// Folders and files are readable and writable for whom the umask allows.
const FOLDER_MODE: Mode = Mode::from_bits_retain(0o777);
const FILE_MODE: Mode = Mode::from_bits_retain(0o666);

/// What writes the content of a file.
pub type Fill<'a> = Box<dyn FnOnce(&mut dyn Write) -> io::Result<()> + 'a>;

/// A folder to write into.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    opened: OwnedFd,
}

impl Folder {
    /// Opens a folder, creating it and those above it if they do not exist. Links that lead to it are followed: the user
    /// named it.
    pub fn open(path: &Path) -> io::Result<Self> {
        let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        #[expect(clippy::disallowed_methods, reason = "the folder that the user named")]
        fs::create_dir_all(path)?;
        let opened = rustix::fs::open(path, OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())?;
        Ok(Self { path: path.to_owned(), opened })
    }

    /// Where it was when it was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Opens a folder below this one, creating it if it does not exist.
    ///
    /// # Errors
    /// Also if `relative` leads out of this folder, or through a link.
    pub fn below(&self, relative: &Path) -> io::Result<Self> {
        self.walk(relative, true)
    }

    /// Writes a file below the folder.
    ///
    /// # Errors
    /// Also as for [`Self::below`].
    pub fn write(&self, relative: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
        self.fill(relative, Box::new(fill))
    }

    /// As [`Self::write`], for all closures at once.
    pub fn fill(&self, relative: &Path, fill: Fill<'_>) -> io::Result<()> {
        let mut draft = self.draft(relative, TEMPORARY)?;
        fill(&mut draft)?;
        draft.publish()
    }

    /// A file that takes its place below the folder when it is published. Until then its name begins with `prefix`.
    pub fn draft(&self, relative: &Path, prefix: &str) -> io::Result<Draft> {
        let (folder, name) = self.place_of(relative, true)?;
        let flags = OFlags::CREATE | OFlags::EXCL | OFlags::WRONLY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        loop {
            let temporary = format!("{prefix}{:016x}", fastrand::u64(..)).into();
            match rustix::fs::openat(&folder.opened, &temporary, flags, FILE_MODE) {
                Ok(file) => {
                    return Ok(Draft { folder, temporary, name, out: BufWriter::new(file.into()), published: false });
                }
                Err(rustix::io::Errno::EXIST) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Removes a file below the folder.
    ///
    /// # Errors
    /// Also if it does not exist.
    pub fn remove(&self, relative: &Path) -> io::Result<()> {
        let (folder, name) = self.place_of(relative, false)?;
        Ok(rustix::fs::unlinkat(&folder.opened, &name, AtFlags::empty())?)
    }

    /// The folder of a file below this one, and the file's name.
    fn place_of(&self, relative: &Path, create: bool) -> io::Result<(Self, OsString)> {
        let name = relative.file_name().ok_or_else(|| leads_out(relative))?;
        let folder = self.walk(relative.parent().unwrap_or(Path::new("")), create)?;
        Ok((folder, name.to_owned()))
    }

    fn walk(&self, relative: &Path, create: bool) -> io::Result<Self> {
        let mut folder = Self { path: self.path.clone(), opened: self.opened.try_clone()? };
        for component in relative.components() {
            let Component::Normal(name) = component else { return Err(leads_out(relative)) };
            folder.path.push(name);
            match rustix::fs::mkdirat(&folder.opened, name, FOLDER_MODE) {
                _ if !create => {}
                Ok(()) | Err(rustix::io::Errno::EXIST) => {}
                Err(error) => return Err(error.into()),
            }
            let flags = OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
            folder.opened = match rustix::fs::openat(&folder.opened, name, flags, Mode::empty()) {
                Ok(opened) => opened,
                Err(error) => {
                    let found = rustix::fs::statat(&folder.opened, name, AtFlags::SYMLINK_NOFOLLOW);
                    let is_link = found.is_ok_and(|found| FileType::from_raw_mode(found.st_mode).is_symlink());
                    return Err(if is_link { is_a_link(&folder.path) } else { error.into() });
                }
            };
        }
        Ok(folder)
    }
}

/// A file that is being written. If it is dropped before it is [published](Self::publish), it is removed.
#[derive(Debug)]
pub struct Draft {
    folder: Folder,
    temporary: OsString,
    name: OsString,
    out: BufWriter<File>,
    published: bool,
}

impl Draft {
    /// Waits until the content is on the disk.
    pub fn sync(&mut self) -> io::Result<()> {
        self.out.flush()?;
        self.out.get_ref().sync_all()
    }

    /// Gives the file its name, instead of the file or link that has it.
    pub fn publish(mut self) -> io::Result<()> {
        self.out.flush()?;
        let folder = &self.folder.opened;
        rustix::fs::renameat(folder, &self.temporary, folder, &self.name)?;
        self.published = true;
        Ok(())
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.published {
            // If it cannot be removed, the next run removes it.
            let _ = rustix::fs::unlinkat(&self.folder.opened, &self.temporary, AtFlags::empty());
        }
    }
}

/// Writes the file that the user named, in a folder that is created if it does not exist.
pub fn file(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let name = path.file_name().ok_or_else(|| io::Error::from(ErrorKind::IsADirectory))?;
    Folder::open(path.parent().unwrap_or(Path::new("")))?.fill(Path::new(name), Box::new(fill))
}

/// Opens a file to change it in place, unless it is a link: a lock, or a list to which lines are added. `more` are flags beside
/// those for writing.
///
/// # Errors
/// Also if it is a link.
pub fn open_in_place(path: &Path, more: OFlags) -> io::Result<File> {
    let flags = OFlags::WRONLY | OFlags::NOFOLLOW | OFlags::CLOEXEC | more;
    match rustix::fs::openat(CWD, path, flags, FILE_MODE) {
        Ok(file) => Ok(file.into()),
        Err(_) if path.is_symlink() => Err(is_a_link(path)),
        Err(error) => Err(error.into()),
    }
}

fn is_a_link(path: &Path) -> io::Error {
    let problem = format!("{path:?} is a link, and gprop writes only through links that you name; remove it");
    io::Error::new(ErrorKind::InvalidInput, problem)
}

fn leads_out(relative: &Path) -> io::Error {
    io::Error::new(ErrorKind::InvalidInput, format!("{relative:?} leads out of the folder"))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn write(folder: &Folder, relative: &str) -> io::Result<()> {
        folder.write(Path::new(relative), |out| out.write_all(b"written"))
    }

    #[test]
    fn nothing_is_written_through_a_link_below_the_folder() {
        let (home, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        fs::write(outside.path().join("precious"), "as it was").unwrap();
        symlink(outside.path(), home.path().join("link")).unwrap();
        symlink(outside.path().join("precious"), home.path().join("file")).unwrap();
        let folder = Folder::open(home.path()).unwrap();
        for through in ["link/new", "link/precious", "link/a/b", "../new", "/tmp/new", "a/../../new", "", ".."] {
            assert!(write(&folder, through).is_err(), "{through}");
        }
        assert!(write(&folder, "link/new").unwrap_err().to_string().contains("is a link"));
        assert!(folder.remove(Path::new("link/precious")).is_err());
        assert!(open_in_place(&home.path().join("file"), OFlags::CREATE).is_err());
        // A link in the place of a file is replaced.
        write(&folder, "file").unwrap();
        assert_eq!(fs::read(home.path().join("file")).unwrap(), b"written");
        assert_eq!(fs::read(outside.path().join("precious")).unwrap(), b"as it was");
        assert_eq!(fs::read_dir(outside.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_link_that_takes_the_folders_place_leads_nowhere() {
        let (home, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let named = home.path().join("named");
        let folder = Folder::open(&named).unwrap();
        let below = folder.below(Path::new("a")).unwrap();
        let mut draft = folder.draft(Path::new("a/begun"), TEMPORARY).unwrap();
        fs::rename(&named, home.path().join("moved")).unwrap();
        symlink(outside.path(), &named).unwrap();
        draft.write_all(b"written").unwrap();
        draft.publish().unwrap();
        write(&below, "later").unwrap();
        write(&folder, "b/new").unwrap();
        assert_eq!(fs::read_dir(outside.path()).unwrap().count(), 0);
        assert!(["a/begun", "a/later", "b/new"].iter().all(|file| home.path().join("moved").join(file).is_file()));
    }

    #[test]
    fn a_draft_that_fails_leaves_nothing() {
        let home = tempfile::tempdir().unwrap();
        let folder = Folder::open(home.path()).unwrap();
        write(&folder, "whole").unwrap();
        let failed = folder.write(Path::new("whole"), |out| {
            out.write_all(b"half")?;
            Err(io::Error::other("full"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(home.path().join("whole")).unwrap(), b"written");
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 1);
    }
}
