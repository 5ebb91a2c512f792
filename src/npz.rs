//! NumPy archives: a ZIP of arrays.

use std::io::{self, Cursor, Read, Write};

use npyz::{NpyFile, WriterBuilder};
use thiserror::Error;
use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Why an array cannot be read.
#[derive(Debug, Error)]
pub enum NpzError {
    #[error("it is no NumPy archive ({0})")]
    Archive(#[from] zip::result::ZipError),
    #[error("its array `{name}` cannot be read as {kind} ({source})")]
    Array { name: String, kind: &'static str, source: io::Error },
    #[error("it has no array `{0}`")]
    Missing(String),
}

/// An archive in memory.
pub struct Npz(ZipArchive<Cursor<Vec<u8>>>);

impl Npz {
    /// # Errors
    /// The bytes are no ZIP archive.
    pub fn new(bytes: Vec<u8>) -> Result<Self, NpzError> {
        Ok(Self(ZipArchive::new(Cursor::new(bytes))?))
    }

    /// Whether it holds an array of this name.
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

    /// A string: an array of one.
    pub fn text(&mut self, name: &str) -> Result<String, NpzError> {
        Ok(self.read::<String>(name, "a string")?.concat())
    }

    fn read<T: npyz::Deserialize>(&mut self, name: &str, kind: &'static str) -> Result<Vec<T>, NpzError> {
        if !self.has(name) {
            return Err(NpzError::Missing(name.to_owned()));
        }
        let mut bytes = Vec::new();
        let fail = |source| NpzError::Array { name: name.to_owned(), kind, source };
        self.0.by_name(&format!("{name}.npy"))?.read_to_end(&mut bytes).map_err(fail)?;
        NpyFile::new(bytes.as_slice()).and_then(NpyFile::into_vec).map_err(fail)
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
    /// What the writer reports; as many `values` as the `shape` has are needed.
    pub fn array(&mut self, name: &str, shape: &[u64], values: impl Iterator<Item = f32>) -> io::Result<()> {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated).large_file(true);
        self.0.start_file(format!("{name}.npy"), options)?;
        let mut array = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut self.0).begin_nd()?;
        array.extend(values)?;
        array.finish()
    }

    /// # Errors
    /// What the writer reports.
    pub fn finish(self) -> io::Result<()> {
        self.0.finish()?;
        Ok(())
    }
}
