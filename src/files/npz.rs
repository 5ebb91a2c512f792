//! NumPy's archives of arrays (NPZ): a ZIP archive with one NPY file for each array.

use std::io::{self, Cursor, Read, Write};

use thiserror::Error;
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use crate::files::npy::{NpyArray, NpyError, Number, write_npy};

/// The largest array that is read, in bytes: a reference trajectory has several hundred megabytes. An array that unpacks to
/// more was made to exhaust the memory.
const MOST_BYTES: u64 = 1 << 30;

/// Why an array cannot be read.
#[derive(Debug, Error)]
pub enum NpzError {
    #[error("it is not a NumPy archive ({0})")]
    Archive(Box<zip::result::ZipError>),
    #[error("its array `{name}` cannot be read as {kind} ({source})")]
    Array { name: String, kind: &'static str, source: NpyError },
    #[error("its array `{name}` cannot be unpacked ({source})")]
    Unpack { name: String, source: io::Error },
    #[error("it has no array `{0}`")]
    Missing(String),
    #[error("its array `{name}` has more than {MOST_BYTES} bytes, the most that gprop reads")]
    TooLarge { name: String },
}

impl From<zip::result::ZipError> for NpzError {
    fn from(error: zip::result::ZipError) -> Self {
        Self::Archive(Box::new(error))
    }
}

/// An archive in memory.
pub struct Npz(ZipArchive<Cursor<Vec<u8>>>);

impl Npz {
    /// # Errors
    /// If the bytes are not a ZIP archive.
    pub fn new(bytes: Vec<u8>) -> Result<Self, NpzError> {
        Ok(Self(ZipArchive::new(Cursor::new(bytes))?))
    }

    /// True if it contains an array of this name.
    pub fn has(&self, name: &str) -> bool {
        self.0.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// The numbers of an array of f32, row by row.
    ///
    /// # Errors
    /// If it is missing or too large, has another type, or is stored column by column.
    pub fn f32s(&mut self, name: &str) -> Result<Vec<f32>, NpzError> {
        self.numbers(name, "float32")
    }

    pub fn f64s(&mut self, name: &str) -> Result<Vec<f64>, NpzError> {
        self.numbers(name, "float64")
    }

    pub fn i64s(&mut self, name: &str) -> Result<Vec<i64>, NpzError> {
        self.numbers(name, "int64")
    }

    pub fn i32s(&mut self, name: &str) -> Result<Vec<i32>, NpzError> {
        self.numbers(name, "int32")
    }

    /// A string: an array with one element.
    pub fn text(&mut self, name: &str) -> Result<String, NpzError> {
        let bytes = self.unpack(name)?;
        let text = NpyArray::open(&bytes).and_then(|array| array.text());
        text.map_err(|source| NpzError::Array { name: name.to_owned(), kind: "a string", source })
    }

    fn numbers<T: Number>(&mut self, name: &str, kind: &'static str) -> Result<Vec<T>, NpzError> {
        let bytes = self.unpack(name)?;
        let array = NpyArray::open(&bytes);
        let numbers = array.and_then(|array| {
            if array.fortran_order && array.shape.len() > 1 {
                Err(NpyError::Fortran)
            } else {
                array.numbers().ok_or_else(|| NpyError::Type(array.kind()))
            }
        });
        numbers.map_err(|source| NpzError::Array { name: name.to_owned(), kind, source })
    }

    /// The bytes of an array.
    fn unpack(&mut self, name: &str) -> Result<Vec<u8>, NpzError> {
        if !self.has(name) {
            return Err(NpzError::Missing(name.to_owned()));
        }
        let mut bytes = Vec::new();
        let mut member = self.0.by_name(&format!("{name}.npy"))?.take(MOST_BYTES + 1);
        let unpacked = member.read_to_end(&mut bytes);
        unpacked.map_err(|source| NpzError::Unpack { name: name.to_owned(), source })?;
        if bytes.len() as u64 > MOST_BYTES {
            return Err(NpzError::TooLarge { name: name.to_owned() });
        }
        Ok(bytes)
    }
}

/// Writes an archive array by array. The same arrays give the same bytes.
pub struct NpzWriter<W: Write>(ZipWriter<StreamWriter<W>>);

impl<W: Write> NpzWriter<W> {
    pub fn new(out: W) -> Self {
        Self(ZipWriter::new_stream(out))
    }

    /// An array of f32, row-major.
    ///
    /// # Errors
    /// If writing fails, or there are not as many `values` as the `shape` has elements.
    pub fn array(&mut self, name: &str, shape: &[u64], values: impl Iterator<Item = f32>) -> io::Result<()> {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated).large_file(true);
        self.0.start_file(format!("{name}.npy"), options)?;
        write_npy(&mut self.0, shape, values)
    }

    /// # Errors
    /// If writing fails.
    pub fn finish(self) -> io::Result<()> {
        self.0.finish()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn archive(member: &[u8]) -> Npz {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        zip.start_file("a.npy", SimpleFileOptions::default().compression_method(CompressionMethod::Deflated)).unwrap();
        zip.write_all(member).unwrap();
        Npz::new(zip.finish().unwrap().into_inner()).unwrap()
    }

    /// An array whose header says f32 of `shape`, followed by `bytes`.
    fn array(shape: &str, bytes: usize) -> Vec<u8> {
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut npy = b"\x93NUMPY\x01\x00".to_vec();
        npy.extend((header.len() as u16).to_le_bytes());
        npy.extend(header.as_bytes());
        npy.resize(npy.len() + bytes, 0);
        npy
    }

    #[test]
    fn an_array_comes_back() {
        assert_eq!(archive(&array("(2,3)", 24)).f32s("a").unwrap(), [0.0; 6]);
    }

    #[test]
    fn a_header_that_claims_more_than_there_is_asks_for_no_memory() {
        for shape in ["(1000000000000,)", "(4294967296,4294967296,4294967296)", "(7,)"] {
            let read = archive(&array(shape, 24)).f32s("a");
            assert!(matches!(read, Err(NpzError::Array { .. })), "{shape}: {read:?}");
        }
    }

    #[test]
    fn a_header_of_nested_brackets_is_refused_at_once() {
        // Each bracket would double the work of a parser that tries several kinds of literal at each.
        for brackets in ["{", "[", "("] {
            let nested = array(&format!("(3, {})", brackets.repeat(43)), 24);
            let read = archive(&nested).f32s("a");
            assert!(matches!(read, Err(NpzError::Array { .. })), "{brackets}: {read:?}");
        }
    }

    #[test]
    fn what_unpacks_to_gigabytes_is_refused() {
        // A thousandth of it on disk, because zeros compress so well.
        let read = archive(&array("(268435456,)", 1 << 30)).f32s("a");
        assert!(matches!(read, Err(NpzError::TooLarge { .. })));
    }
}
