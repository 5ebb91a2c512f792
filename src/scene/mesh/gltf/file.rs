//! The pieces of a glTF or GLB, and the file again with some of them changed.

use std::borrow::Cow;
use std::io::{self, Write};

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const BINARY: &[u8; 4] = b"BIN\0";

/// The text of a file, and what a GLB holds besides.
pub struct GltfFile<'a> {
    pub text: &'a str,
    /// The chunks of a GLB behind its JSON, each with its kind; `None` for a glTF.
    chunks: Option<Vec<([u8; 4], &'a [u8])>>,
}

impl<'a> GltfFile<'a> {
    /// The pieces of these bytes; `None` if they cannot be told apart.
    pub fn of(bytes: &'a [u8]) -> Option<Self> {
        if !bytes.starts_with(MAGIC) {
            return Some(Self { text: std::str::from_utf8(bytes).ok()?, chunks: None });
        }
        let mut rest = bytes.get(12..)?;
        let mut chunks: Vec<([u8; 4], &[u8])> = Vec::new();
        while let Some((head, behind)) = rest.split_first_chunk::<8>() {
            let length = u32::from_le_bytes(*head.first_chunk()?) as usize;
            let (content, next) = behind.split_at_checked(length)?;
            chunks.push((*head.last_chunk()?, content));
            rest = next;
        }
        let behind = chunks.split_off(1.min(chunks.len()));
        let (_, json) = chunks.first()?;
        Some(Self { text: std::str::from_utf8(json).ok()?, chunks: Some(behind) })
    }

    /// The bytes of the first buffer, if they stand in the GLB.
    pub fn own_chunk(&self) -> Option<&'a [u8]> {
        let (kind, bytes) = self.chunks.as_ref()?.first()?;
        (kind == BINARY).then_some(bytes)
    }

    /// Writes the file with another text, and with more bytes behind those of its own chunk.
    ///
    /// # Errors
    /// If it cannot be written, or a GLB would have more than 4 GB.
    pub fn write_with(&self, text: &str, added: &[u8], out: &mut dyn Write) -> io::Result<()> {
        let Some(chunks) = &self.chunks else { return out.write_all(text.as_bytes()) };
        let mut chunks: Vec<([u8; 4], Cow<'_, [u8]>)> =
            chunks.iter().map(|(kind, bytes)| (*kind, Cow::Borrowed(*bytes))).collect();
        if let (false, Some(_), Some((_, binary))) = (added.is_empty(), self.own_chunk(), chunks.first_mut()) {
            let binary = binary.to_mut();
            binary.resize(binary.len().next_multiple_of(4), 0);
            binary.extend(added);
        }
        write_glb(text.trim_end().as_bytes(), &chunks, out)
    }
}

/// Writes a GLB: its JSON, then other chunks of these kinds.
///
/// # Errors
/// If it cannot be written, or would have more than 4 GB.
pub fn write_glb(json: &[u8], others: &[([u8; 4], Cow<'_, [u8]>)], out: &mut dyn Write) -> io::Result<()> {
    let json = (*b"JSON", Cow::Borrowed(json));
    let chunks = || std::iter::once(&json).chain(others);
    let padded = |bytes: &[u8]| bytes.len().next_multiple_of(4);
    let length = |bytes: usize| u32::try_from(bytes).map_err(|_| io::Error::other("a GLB holds at most 4 GB"));
    out.write_all(MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&length(12 + chunks().map(|(_, bytes)| 8 + padded(bytes)).sum::<usize>())?.to_le_bytes())?;
    for (kind, bytes) in chunks() {
        out.write_all(&length(padded(bytes))?.to_le_bytes())?;
        out.write_all(kind)?;
        out.write_all(bytes)?;
        let filler = if kind == b"JSON" { b' ' } else { 0 };
        out.write_all(&vec![filler; padded(bytes) - bytes.len()])?;
    }
    Ok(())
}

/// The chunk of a GLB's own buffer.
pub fn binary_chunk(bytes: Vec<u8>) -> ([u8; 4], Cow<'static, [u8]>) {
    (*BINARY, bytes.into())
}
