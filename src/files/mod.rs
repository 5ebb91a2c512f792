//! Opens files that may come from anyone, such as those of a scene or of a work folder.
//!
//! Opening a named pipe blocks until something is written to it, and a device may never end. So a path is opened only
//! if it is a regular file (or a link to one), and everything else is refused at once.

pub mod jpeg;
pub mod json;
pub mod json_patch;
pub mod npy;
pub mod npz;
pub mod read_scope;
pub mod write;

use std::fs::{self, File, FileType};
use std::io::{self, BufRead, BufReader, Cursor, ErrorKind, Read, Seek};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use serde::de::DeserializeOwned;

use crate::words::output::{counted, thousands};

/// Opens a regular file.
///
/// # Errors
/// As for [`File::open`]; also, without waiting, if the path leads to a folder, a named pipe, a socket or a device.
pub fn open(path: &Path) -> io::Result<File> {
    require_regular(path)?;
    File::open(path)
}

/// Bytes to decode a picture from. One type for files and memory, so that every picture decoder is compiled once.
pub type PictureSource<'a> = Box<dyn BufReadSeek + 'a>;

/// A buffered reader that can go back.
pub trait BufReadSeek: BufRead + Seek {}

impl<T: BufRead + Seek> BufReadSeek for T {}

/// The picture in a regular file; errors as for [`open`].
pub fn picture(path: &Path) -> io::Result<PictureSource<'static>> {
    Ok(Box::new(BufReader::new(open(path)?)))
}

/// The picture in memory.
pub fn picture_of(bytes: &[u8]) -> PictureSource<'_> {
    Box::new(Cursor::new(bytes))
}

/// The most bytes of a file that is read as a whole: more than any camera file, table, picture or recording has.
const MOST_BYTES: u64 = 1 << 30;
/// The most bytes of a splat, a network or an artifact that is read as a whole.
const MOST_BYTES_OF_LARGE: u64 = 1 << 34;

/// The bytes of a regular file; errors as for [`open`], and if there are more than a GiB.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    read_up_to(path, MOST_BYTES)
}

/// The bytes of a regular file that may be large: a splat, a network, an artifact; errors as for [`open`], and if there are
/// more than 16 GiB.
pub fn read_large(path: &Path) -> io::Result<Vec<u8>> {
    read_up_to(path, MOST_BYTES_OF_LARGE)
}

fn read_up_to(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let too_large = |bytes: u64| {
        let problem =
            format!("it has {} bytes, and gprop reads up to {} of such a file", thousands(bytes), thousands(most));
        io::Error::new(ErrorKind::FileTooLarge, problem)
    };
    let size = file.metadata()?.len();
    if size > most {
        return Err(too_large(size));
    }
    let mut bytes = Vec::with_capacity(size as usize);
    // It may grow while it is read.
    let read = file.take(most + 1).read_to_end(&mut bytes)? as u64;
    if read > most { Err(too_large(read)) } else { Ok(bytes) }
}

/// Begins the text files of some editors; it is not part of the text.
pub(crate) const BYTE_ORDER_MARK: &str = "\u{feff}";

/// The text of a regular file, without a byte order mark; errors as for [`open`].
pub fn read_to_string(path: &Path) -> io::Result<String> {
    let mut text =
        String::from_utf8(read(path)?).map_err(|_| io::Error::new(ErrorKind::InvalidData, "it is not UTF-8"))?;
    if text.starts_with(BYTE_ORDER_MARK) {
        text.replace_range(..BYTE_ORDER_MARK.len(), "");
    }
    Ok(text)
}

/// Reads a table of comma-separated values: spaces around values and lines that begin with `#` do not count.
pub fn table(text: &[u8]) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text)
}

/// The line of the table `text` on which a record starts. Its position is where the reader began to look for it: before the
/// line feed that ends the previous line on Windows, empty lines and comments.
pub fn line_at(text: &[u8], position: &csv::Position) -> u64 {
    let rest = usize::try_from(position.byte()).ok().and_then(|byte| text.get(byte..)).unwrap_or_default();
    let is_skipped = |line: &&[u8]| line.starts_with(b"#") || line.iter().all(|byte| matches!(byte, b'\r' | b'\n'));
    position.line() + rest.split_inclusive(|byte| *byte == b'\n').take_while(is_skipped).count() as u64
}

/// The line of the table `text` that cannot be read, and what is wrong with it: without the line that the reader counts, which
/// may be [another one](line_at).
pub fn table_problem(text: &[u8], error: &csv::Error) -> (u64, String) {
    let problem = match error.kind() {
        csv::ErrorKind::Deserialize { err, .. } => err.to_string(),
        csv::ErrorKind::Utf8 { err, .. } => err.to_string(),
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("the header has {expected_len} columns, but this row has {}", counted(*len as usize, "cell"))
        }
        _ => error.to_string(),
    };
    (error.position().map_or(1, |position| line_at(text, position)), problem)
}

/// Why the rows of a table cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    #[error("{0}")]
    Unreadable(#[from] io::Error),
    #[error("line {line}: {problem}")]
    BadRow { line: u64, problem: String },
}

/// The rows of the [`table`] in a file.
pub fn rows<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, TableError> {
    let text = read(path)?;
    let bad_row = |error: csv::Error| {
        let (line, problem) = table_problem(&text, &error);
        TableError::BadRow { line, problem }
    };
    table(&text).deserialize().collect::<Result<_, _>>().map_err(bad_row)
}

/// True if there is something at `path` other than a folder, even if [`open`] will refuse it: if a file that is looked
/// for turns out to be a named pipe, this must be reported, not ignored.
pub fn is_there(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| !found.is_dir())
}

/// True if there is something at `path` that is neither a file nor a folder.
pub fn is_special(path: &Path) -> bool {
    is_there(path) && require_regular(path).is_err()
}

/// Fails unless there is a regular file at `path`.
pub fn require_regular(path: &Path) -> io::Result<()> {
    let found = fs::metadata(path)?;
    if found.is_file() {
        return Ok(());
    }
    let kind = if found.is_dir() { ErrorKind::IsADirectory } else { ErrorKind::InvalidInput };
    Err(io::Error::new(kind, format!("it is {}, not a regular file", name_of(found.file_type()))))
}

fn name_of(kind: FileType) -> &'static str {
    match kind {
        kind if kind.is_dir() => "a folder",
        kind if kind.is_fifo() => "a named pipe",
        kind if kind.is_socket() => "a socket",
        _ => "a device",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_a_limit() {
        let file = tempfile::NamedTempFile::new().unwrap();
        file.as_file().set_len(MOST_BYTES + 1).unwrap();
        let refused = read(file.path()).unwrap_err().to_string();
        assert_eq!(refused, "it has 1,073,741,825 bytes, and gprop reads up to 1,073,741,824 of such a file");
        assert!(read_to_string(file.path()).is_err());
        file.as_file().set_len(100).unwrap();
        assert_eq!(read_up_to(file.path(), 100).unwrap().len(), 100);
        assert!(read_up_to(file.path(), 99).unwrap_err().to_string().contains("up to 99 of"));
    }
}
