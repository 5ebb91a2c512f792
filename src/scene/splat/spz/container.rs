//! Unpacks the file into the bytes of each attribute, never decompressing more than the count in the header requires. A
//! file that is damaged, cut off or longer than it should be is refused: checksums and lengths are checked to the last
//! byte.

use std::io::{self, Read};

use flate2::bufread::GzDecoder;
use ruzstd::decoding::StreamingDecoder;

use super::{Header, Problem};

const MAGIC: [u8; 4] = *b"NGSP";
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];
const LEGACY_HEADER: usize = 16;
const HEADER: usize = 32;
/// Bytes per entry in version 4's list of streams: compressed and uncompressed size.
const STREAM_ENTRY: usize = 16;
const FLAG_ANTIALIASED: u8 = 1;
/// Flag: records of other programs follow the attributes; in version 4 they come before the list of streams.
const FLAG_EXTENDED: u8 = 2;

/// Trained splats compress to a third of their size at best; to a tenth if their harmonics are constant. A header that
/// promises more than this many bytes per byte of the file is rejected, unless it promises no more than
/// [`ALWAYS_ALLOWED`].
const MOST_BYTES_PER_BYTE: u64 = 64;
/// A header may always promise this many bytes: synthetic files of equal Gaussians compress without limit.
const ALWAYS_ALLOWED: u64 = 1 << 16;

type Attributes = [Vec<u8>; 6];

/// Returns the header and the bytes of each attribute, with exactly the lengths that [`Header::lengths`] gives.
pub(super) fn unpack(bytes: &[u8]) -> Result<(Header, Attributes), Problem> {
    if bytes.starts_with(&GZIP_MAGIC) {
        let mut stream = GzDecoder::new(bytes);
        let mut start = [0; LEGACY_HEADER];
        let broken = |reason: std::io::Error| Problem::Compression { attribute: "header", reason: reason.to_string() };
        stream.read_exact(&mut start).map_err(broken)?;
        if !start.starts_with(&MAGIC) {
            return Err(Problem::NotSpz);
        }
        let header = header(&start, bytes.len())?;
        if header.version > 3 {
            return Err(Problem::Version { version: header.version });
        }
        let attributes = one_after_the_other(&header, &mut stream)?;
        skip_extensions(&header, bytes.len(), &mut stream)?;
        nothing_after(stream.get_ref())?;
        return Ok((header, attributes));
    }
    if !bytes.starts_with(&MAGIC) {
        return Err(Problem::NotSpz);
    }
    let start = bytes.first_chunk().ok_or(Problem::Truncated { size: bytes.len() })?;
    let header = header(start, bytes.len())?;
    match header.version {
        // The form in which a viewer's cache keeps it: the legacy layout without gzip.
        1..=3 => {
            let mut stream = &bytes[LEGACY_HEADER..];
            let attributes = one_after_the_other(&header, &mut stream)?;
            skip_extensions(&header, bytes.len(), &mut stream)?;
            Ok((header, attributes))
        }
        _ => Ok((header, streams(&header, bytes)?)),
    }
}

fn header(start: &[u8; LEGACY_HEADER], size: usize) -> Result<Header, Problem> {
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| start[at + i]));
    let header = Header {
        version: word(4),
        count: word(8),
        sh_degree: start[12],
        fractional_bits: start[13],
        antialiased: start[14] & FLAG_ANTIALIASED != 0,
        extended: start[14] & FLAG_EXTENDED != 0,
    };
    if !(1..=4).contains(&header.version) {
        return Err(Problem::Version { version: header.version });
    }
    if header.sh_degree > 3 {
        return Err(Problem::ShDegree { degree: header.sh_degree });
    }
    if header.fractional_bits > 24 {
        return Err(Problem::FractionalBits { bits: header.fractional_bits });
    }
    if header.count == 0 {
        return Err(Problem::Empty);
    }
    let promised: u64 = header.lengths().iter().map(|(_, length)| length).sum();
    if promised > most_bytes(size) {
        return Err(Problem::Count { count: header.count, size });
    }
    Ok(header)
}

/// The largest number of uncompressed bytes accepted for a file of `size` bytes.
fn most_bytes(size: usize) -> u64 {
    ALWAYS_ALLOWED.max(MOST_BYTES_PER_BYTE * size as u64)
}

/// Versions 1 to 3: the attributes follow each other in one stream.
fn one_after_the_other(header: &Header, stream: &mut impl Read) -> Result<Attributes, Problem> {
    let mut attributes = Attributes::default();
    for (bytes, (attribute, length)) in attributes.iter_mut().zip(header.lengths()) {
        *bytes = exactly(header, attribute, length, stream)?;
    }
    Ok(attributes)
}

/// Reads the stream to its end and so checks its checksum; only extensions may come before the end.
fn skip_extensions(header: &Header, size: usize, stream: &mut impl Read) -> Result<(), Problem> {
    const LAST: &str = "end";
    if header.extended {
        let skipped = io::copy(&mut stream.take(most_bytes(size)), &mut io::sink());
        skipped.map_err(|reason| Problem::Compression { attribute: LAST, reason: reason.to_string() })?;
    }
    ends(header, LAST, stream)
}

/// Checks that the stream ends here, with a valid checksum.
fn ends(header: &Header, attribute: &'static str, stream: &mut impl Read) -> Result<(), Problem> {
    match stream.read(&mut [0]) {
        Ok(0) => Ok(()),
        Ok(_) => Err(Problem::Longer { attribute, count: header.count }),
        Err(reason) => Err(Problem::Compression { attribute, reason: reason.to_string() }),
    }
}

fn nothing_after(rest: &[u8]) -> Result<(), Problem> {
    match rest.len() {
        0 => Ok(()),
        bytes => Err(Problem::Trailing { bytes }),
    }
}

/// Version 4: a list of streams, then the streams.
fn streams(header: &Header, bytes: &[u8]) -> Result<Attributes, Problem> {
    let truncated = || Problem::Truncated { size: bytes.len() };
    let start: &[u8; HEADER] = bytes.first_chunk().ok_or_else(truncated)?;
    let list_at = u32::from_le_bytes(std::array::from_fn(|i| start[16 + i])) as usize;
    let entries = list_at.checked_add(usize::from(start[15]) * STREAM_ENTRY).and_then(|end| bytes.get(list_at..end));
    let (entries, _) = entries.ok_or_else(truncated)?.as_chunks::<STREAM_ENTRY>();
    let mut at = list_at + entries.len() * STREAM_ENTRY;
    let mut entries = entries.iter();
    let mut attributes = Attributes::default();
    for (decoded, (attribute, length)) in attributes.iter_mut().zip(header.lengths()) {
        // A cloud without harmonics may omit their stream.
        let Some(entry) = entries.next() else {
            if length == 0 {
                continue;
            }
            return Err(Problem::Length { attribute, count: header.count, found: 0, expected: length });
        };
        let word = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| entry[at + i]));
        let (compressed, found) = (word(0), word(8));
        if found != length {
            return Err(Problem::Length { attribute, count: header.count, found, expected: length });
        }
        let end = usize::try_from(compressed).ok().and_then(|size| at.checked_add(size)).ok_or_else(truncated)?;
        let stream = bytes.get(at..end).ok_or_else(truncated)?;
        if length > 0 {
            *decoded = zstd(header, attribute, length, stream)?;
        }
        at = end;
    }
    // Streams of attributes that gprop does not know.
    for entry in entries {
        let compressed = u64::from_le_bytes(std::array::from_fn(|i| entry[i]));
        at = usize::try_from(compressed).ok().and_then(|size| at.checked_add(size)).ok_or_else(truncated)?;
    }
    nothing_after(bytes.get(at..).ok_or_else(truncated)?)?;
    Ok(attributes)
}

fn zstd(header: &Header, attribute: &'static str, length: u64, stream: &[u8]) -> Result<Vec<u8>, Problem> {
    /// Every decoder should support windows up to this size (RFC 8878, 3.1.1.1.2).
    const LEAST_WINDOW: u64 = 8 << 20;
    let window = length.next_power_of_two().max(LEAST_WINDOW);
    let broken = |reason: String| Problem::Compression { attribute, reason };
    let mut decoder =
        StreamingDecoder::new_with_max_window_size(stream, window).map_err(|reason| broken(reason.to_string()))?;
    let bytes = exactly(header, attribute, length, &mut decoder)?;
    ends(header, attribute, &mut decoder)?;
    nothing_after(decoder.get_ref())?;
    let (stated, found) = (decoder.decoder.get_checksum_from_data(), decoder.decoder.get_calculated_checksum());
    if stated.is_some() && stated != found {
        return Err(broken("its checksum does not match".to_owned()));
    }
    Ok(bytes)
}

/// Reads exactly `length` bytes.
fn exactly(header: &Header, attribute: &'static str, length: u64, stream: &mut impl Read) -> Result<Vec<u8>, Problem> {
    let mut bytes = Vec::new();
    let read = stream.take(length).read_to_end(&mut bytes);
    read.map_err(|reason| Problem::Compression { attribute, reason: reason.to_string() })?;
    if bytes.len() as u64 == length {
        Ok(bytes)
    } else {
        Err(Problem::Length { attribute, count: header.count, found: bytes.len() as u64, expected: length })
    }
}
