//! Sources of bytes: a file that several threads read at once, or memory.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Bytes with random access.
pub(super) trait Bytes: Sync {
    fn size(&self) -> u64;

    /// Fills `buffer` with the bytes starting at `offset`.
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()>;

    /// A sequential reader of the bytes starting at `offset`.
    fn reader_from(&self, offset: u64) -> BufReader<Sequential<'_, Self>> {
        const CAPACITY: usize = 1 << 16;
        BufReader::with_capacity(CAPACITY, Sequential { bytes: self, offset })
    }
}

/// A file with its size at the time it was opened.
pub(super) struct FileBytes {
    file: File,
    size: u64,
}

impl FileBytes {
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = crate::files::open(path)?;
        let size = file.metadata()?.len();
        Ok(Self { file, size })
    }
}

impl Bytes for FileBytes {
    fn size(&self) -> u64 {
        self.size
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        self.file.read_exact_at(buffer, offset)
    }
}

impl Bytes for &[u8] {
    fn size(&self) -> u64 {
        self.len() as u64
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        let rest = usize::try_from(offset).ok().and_then(|offset| self.get(offset..));
        rest.ok_or(io::ErrorKind::UnexpectedEof)?.read_exact(buffer)
    }
}

/// A reader over [`Bytes`].
pub(super) struct Sequential<'a, B: ?Sized> {
    bytes: &'a B,
    offset: u64,
}

impl<B: Bytes + ?Sized> Read for Sequential<'_, B> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.bytes.size().saturating_sub(self.offset);
        let length = buffer.len().min(usize::try_from(left).unwrap_or(usize::MAX));
        self.bytes.read_at(self.offset, &mut buffer[..length])?;
        self.offset += length as u64;
        Ok(length)
    }
}
