//! NumPy arrays, and archives of them (NPZ): a ZIP of arrays.

use std::io::{self, Cursor, Read, Write};

use npyz::{NpyFile, WriterBuilder};
use thiserror::Error;
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Most bytes of one array: a reference trajectory has some hundred megabytes. An array that unpacks to more was made
/// to exhaust the memory.
const MOST_BYTES: u64 = 1 << 30;

/// Why an array cannot be read.
#[derive(Debug, Error)]
pub enum NpzError {
    #[error("it is not a NumPy archive ({0})")]
    Archive(#[from] zip::result::ZipError),
    #[error("its array `{name}` cannot be read as {kind} ({source})")]
    Array { name: String, kind: &'static str, source: io::Error },
    #[error("it has no array `{0}`")]
    Missing(String),
    #[error("its array `{name}` has more than {MOST_BYTES} bytes, the most that gprop reads")]
    TooLarge { name: String },
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

    /// An array of f32, row-major as NumPy stores it.
    pub fn f32s(&mut self, name: &str) -> Result<Vec<f32>, NpzError> {
        self.read(name, "float32")
    }

    pub fn f64s(&mut self, name: &str) -> Result<Vec<f64>, NpzError> {
        self.read(name, "float64")
    }

    pub fn i64s(&mut self, name: &str) -> Result<Vec<i64>, NpzError> {
        self.read(name, "int64")
    }

    pub fn i32s(&mut self, name: &str) -> Result<Vec<i32>, NpzError> {
        self.read(name, "int32")
    }

    /// A string: an array with one element.
    pub fn text(&mut self, name: &str) -> Result<String, NpzError> {
        Ok(self.read::<String>(name, "a string")?.concat())
    }

    fn read<T: npyz::Deserialize>(&mut self, name: &str, kind: &'static str) -> Result<Vec<T>, NpzError> {
        if !self.has(name) {
            return Err(NpzError::Missing(name.to_owned()));
        }
        let fail = |source| NpzError::Array { name: name.to_owned(), kind, source };
        let mut bytes = Vec::new();
        let mut member = self.0.by_name(&format!("{name}.npy"))?.take(MOST_BYTES + 1);
        member.read_to_end(&mut bytes).map_err(fail)?;
        if bytes.len() as u64 > MOST_BYTES {
            return Err(NpzError::TooLarge { name: name.to_owned() });
        }
        let array = open_array(&bytes).map_err(fail)?;
        array.into_vec().map_err(fail)
    }
}

/// An array in memory whose header has been read.
///
/// # Errors
/// If it is not an array, its header has more brackets than that of an array of numbers, it contains Python objects, or
/// it is cut off.
pub fn open_array(bytes: &[u8]) -> io::Result<NpyFile<&[u8]>> {
    /// The header is a Python dictionary with a tuple in it. Its parser takes time that is exponential in the depth of
    /// brackets.
    const MOST_BRACKETS: usize = 8;
    let wrong = |problem: String| io::Error::new(io::ErrorKind::InvalidData, problem);
    if !bytes.starts_with(b"\x93NUMPY") {
        return Err(wrong("it does not begin as NumPy's files do".to_owned()));
    }
    // Magic, version, then the length of the header in two bytes or, from version 2 on, in four.
    let (header_at, length) = match *bytes {
        [_, _, _, _, _, _, 1, _, a, b, ..] => (10, usize::from(u16::from_le_bytes([a, b]))),
        [_, _, _, _, _, _, _, _, a, b, c, d, ..] => (12, u32::from_le_bytes([a, b, c, d]) as usize),
        _ => (bytes.len(), 1),
    };
    let header = bytes.get(header_at..header_at.saturating_add(length));
    let header = header.ok_or_else(|| wrong("it ends within its header; copy or save it again".to_owned()))?;
    if header.iter().filter(|byte| matches!(byte, b'{' | b'[' | b'(')).count() > MOST_BRACKETS {
        return Err(wrong("its header is not that of an array of numbers".to_owned()));
    }
    let array = NpyFile::new(bytes)?;
    let kind = array.dtype();
    if kind.uses_pickled_array() {
        return Err(wrong("it holds Python objects, not numbers; save numbers, with array.astype(...)".to_owned()));
    }
    // A header may claim more elements than follow it. An element of size zero takes no memory here, but a value for
    // each element would.
    let size = kind.num_bytes().unwrap_or(0).max(1) as u64;
    let expected = array.shape().iter().try_fold(size, |bytes, side| bytes.checked_mul(*side));
    let found = (bytes.len() - header_at - header.len()) as u64;
    if expected.is_none_or(|expected| expected > found) {
        let expected = expected.map_or_else(|| "more than 2^64".to_owned(), |bytes| bytes.to_string());
        return Err(wrong(format!(
            "it is cut off: an array {:?} of {} takes {expected} bytes, and {found} follow its header; copy or save it again",
            array.shape(),
            kind.descr()
        )));
    }
    Ok(array)
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
    /// If writing fails. There must be as many `values` as the `shape` has.
    pub fn array(&mut self, name: &str, shape: &[u64], values: impl Iterator<Item = f32>) -> io::Result<()> {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated).large_file(true);
        self.0.start_file(format!("{name}.npy"), options)?;
        let mut array = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut self.0).begin_nd()?;
        array.extend(values)?;
        array.finish()
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
        // Each bracket doubles the work of the header's parser, which takes hours for forty of them.
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
