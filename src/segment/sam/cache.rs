//! Embeddings on disk: the output of one encoder for one picture, as little-endian float32 without a header.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::{EMBEDDING, Embedding, external};
use crate::files::write;
use crate::words::readable::hexadecimal;

/// A folder of embeddings from one encoder.
pub struct Cache {
    folder: PathBuf,
    /// SHA-256 of the encoder with its weights.
    encoder: [u8; 32],
}

impl Cache {
    /// Opens the cache in `folder` for the embeddings of the encoder at `encoder`.
    pub fn open(folder: &Path, encoder: &Path) -> io::Result<Self> {
        Ok(Self { folder: folder.to_owned(), encoder: external::digest(encoder)? })
    }

    /// The path of a preprocessed picture's embedding, whether or not it exists.
    pub fn path(&self, input: &[f32]) -> PathBuf {
        let mut hasher = Sha256::new().chain_update(self.encoder);
        for row in input.chunks(4096) {
            hasher.update(bytes(row));
        }
        self.folder.join(hexadecimal(&hasher.finalize()) + ".f32")
    }

    /// Reads the embedding at `path`; `None` if it is missing or incomplete.
    pub fn read(path: &Path) -> Option<Embedding> {
        let bytes = fs::read(path).ok()?;
        let values = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect::<Vec<_>>();
        let is_whole = bytes.len() as i64 == 4 * EMBEDDING.iter().product::<i64>();
        is_whole.then_some(Embedding(values))
    }

    pub fn write(path: &Path, embedding: &Embedding) -> io::Result<()> {
        write::file(path, |out| out.write_all(&bytes(&embedding.0)))
    }
}

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}
