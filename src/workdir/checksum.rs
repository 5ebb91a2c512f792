//! Checksums of artifacts: SHA-256, because it is computed while a file is written and takes less time than the writing.

use std::io::{self, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::files;
use crate::words::readable::hexadecimal;

/// Length and SHA-256 of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Checksum {
    pub bytes: u64,
    /// In lower-case hexadecimal.
    pub sha256: String,
}

impl Checksum {
    /// The checksum of bytes in memory.
    pub fn of(bytes: &[u8]) -> Self {
        Self { bytes: bytes.len() as u64, sha256: hexadecimal(&Sha256::digest(bytes)) }
    }

    /// The checksum of a file on disk, read piece by piece.
    ///
    /// # Errors
    /// As for [`files::open`].
    pub fn of_file(path: &Path) -> io::Result<Self> {
        let (bytes, digest) = digest_of_file(path)?;
        Ok(Self { bytes, sha256: hexadecimal(&digest) })
    }
}

/// SHA-256 of a file on disk, read piece by piece.
///
/// # Errors
/// As for [`files::open`].
pub fn sha256_of_file(path: &Path) -> io::Result<[u8; 32]> {
    Ok(digest_of_file(path)?.1)
}

/// Length and SHA-256 of a file.
fn digest_of_file(path: &Path) -> io::Result<(u64, [u8; 32])> {
    let mut checksumming = Checksumming::new(io::sink());
    let bytes = io::copy(&mut files::open(path)?, &mut checksumming)?;
    Ok((bytes, checksumming.hasher.finalize().into()))
}

/// A writer that computes the checksum of everything written through it. Write large pieces.
pub struct Checksumming<W> {
    out: W,
    bytes: u64,
    hasher: Sha256,
}

impl<W: Write> Checksumming<W> {
    pub fn new(out: W) -> Self {
        Self { out, bytes: 0, hasher: Sha256::new() }
    }

    /// The checksum of everything that was written.
    pub fn finish(self) -> Checksum {
        Checksum { bytes: self.bytes, sha256: hexadecimal(&self.hasher.finalize()) }
    }
}

impl<W: Write> Write for Checksumming<W> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let written = self.out.write(buffer)?;
        self.hasher.update(&buffer[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
