//! NumPy's file format for an array (NPY), versions 1 to 3: a magic string, the version, the length of the header, the
//! header, and the elements one after the other. The header is a Python dictionary, as in
//! `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }`.
//!
//! Read here and not by a library, because a broken file must be an error: `npyz` 0.9 multiplies the sizes of a shape unchecked.

use std::io::{self, BufWriter, Write};

use thiserror::Error;

const MAGIC: &[u8] = b"\x93NUMPY";

/// The longest header that is read, in bytes; that of an array of numbers has about a hundred.
const MOST_HEADER_BYTES: usize = 64 << 10;

/// The header and what comes before it are padded to a multiple of this.
const ALIGNMENT: usize = 64;

/// Bytes that are collected before they are passed on.
const BUFFER_BYTES: usize = 64 << 10;

/// Why an array cannot be read.
#[derive(Debug, Error)]
pub enum NpyError {
    #[error("it does not begin like a NumPy file")]
    Magic,
    #[error("it has version {0}.{1} of NumPy's format, but gprop reads 1.0, 2.0 and 3.0; save it again")]
    Version(u8, u8),
    #[error("it ends within its header; copy or save it again")]
    HeaderEnd,
    #[error("its header is not that of an array of numbers")]
    Header,
    #[error("it holds Python objects, not numbers; save numbers, with array.astype(...)")]
    Objects,
    #[error(
        "it is cut off: an array of shape {shape:?} and type {kind} takes {expected} bytes, but {found} follow its header; copy or \
         save it again"
    )]
    CutOff { shape: Vec<u64>, kind: String, expected: String, found: usize },
    #[error("it is in Fortran order; save it with numpy.ascontiguousarray")]
    Fortran,
    #[error("its elements are of type {0}")]
    Type(String),
    #[error("its text is not valid Unicode")]
    Text,
}

/// An array in memory whose header has been read.
#[derive(Debug)]
pub struct NpyArray<'a> {
    pub shape: Vec<u64>,
    /// True if the elements are stored with the first index changing fastest.
    pub fortran_order: bool,
    kind: Kind,
    /// As many bytes as the elements take.
    content: &'a [u8],
}

/// The type of the elements.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Kind {
    /// As the header gives it: `<f4`.
    text: String,
    big_endian: bool,
    /// `f` for floats, `i` for integers, `U` and `S` for strings of code points and of bytes.
    letter: char,
    /// Bytes of an element.
    size: u64,
}

/// A type of number as which arrays are read and written.
pub trait Number: Copy {
    /// Its letter and its size, as in a header.
    const KIND: &'static str;
    fn write(self, out: &mut dyn Write) -> io::Result<()>;
    /// Decodes elements; a remainder shorter than an element is left out.
    fn decode(content: &[u8], big_endian: bool) -> Vec<Self>;
}

macro_rules! numbers {
    ($($number:ty: $kind:literal),*) => {$(
        impl Number for $number {
            const KIND: &'static str = $kind;

            fn write(self, out: &mut dyn Write) -> io::Result<()> {
                out.write_all(&self.to_le_bytes())
            }

            fn decode(content: &[u8], big_endian: bool) -> Vec<Self> {
                let of_bytes = if big_endian { Self::from_be_bytes } else { Self::from_le_bytes };
                content.as_chunks().0.iter().map(|bytes| of_bytes(*bytes)).collect()
            }
        }
    )*};
}

numbers!(f32: "f4", f64: "f8", i32: "i4", i64: "i8");

impl<'a> NpyArray<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// If it is not an array of numbers or strings, or is cut off.
    pub fn open(bytes: &'a [u8]) -> Result<Self, NpyError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(NpyError::Magic)?;
        let (length, rest) = match *rest {
            [1, 0, a, b, ref rest @ ..] => (usize::from(u16::from_le_bytes([a, b])), rest),
            [2 | 3, 0, a, b, c, d, ref rest @ ..] => (u32::from_le_bytes([a, b, c, d]) as usize, rest),
            [1, 0, ..] | [2 | 3, 0, ..] | [] | [_] => return Err(NpyError::HeaderEnd),
            [major, minor, ..] => return Err(NpyError::Version(major, minor)),
        };
        let (header, content) = rest.split_at_checked(length).ok_or(NpyError::HeaderEnd)?;
        if length > MOST_HEADER_BYTES {
            return Err(NpyError::Header);
        }
        let (kind, fortran_order, shape) = parse_header(header).ok_or(NpyError::Header)?;
        if kind.letter == 'O' {
            return Err(NpyError::Objects);
        }
        // A header may claim more elements than follow it. An element of size zero takes no bytes in the file, but counts
        // as one here, so that no header can claim any number of them.
        let expected = shape.iter().try_fold(kind.size.max(1), |bytes, side| bytes.checked_mul(*side));
        match expected {
            Some(expected) if expected <= content.len() as u64 => {
                let content = if kind.size == 0 { &[] } else { &content[..expected as usize] };
                Ok(Self { shape, fortran_order, kind, content })
            }
            _ => Err(NpyError::CutOff {
                shape,
                kind: kind.quoted(),
                expected: expected.map_or_else(|| "more than 2^64".to_owned(), |bytes| bytes.to_string()),
                found: content.len(),
            }),
        }
    }

    /// The type of the elements as in the header, with its quotes.
    pub fn kind(&self) -> String {
        self.kind.quoted()
    }

    /// The elements in the order in which they are stored; `None` if they are of another type.
    pub fn numbers<T: Number>(&self) -> Option<Vec<T>> {
        (self.kind.text.get(1..) == Some(T::KIND)).then(|| T::decode(self.content, self.kind.big_endian))
    }

    /// The strings of all elements, concatenated.
    ///
    /// # Errors
    /// If the elements are not strings, or not valid Unicode.
    pub fn text(&self) -> Result<String, NpyError> {
        let elements = self.content.chunks_exact(self.kind.size.max(1) as usize);
        match self.kind.letter {
            'S' => elements.map(|element| str_of(trimmed(element)).map(str::to_owned)).collect(),
            'U' => elements
                .flat_map(|element| {
                    let points: Vec<u32> =
                        i32::decode(element, self.kind.big_endian).into_iter().map(i32::cast_unsigned).collect();
                    trimmed(&points)
                        .iter()
                        .map(|point| char::from_u32(*point).ok_or(NpyError::Text))
                        .collect::<Vec<_>>()
                })
                .collect(),
            _ => Err(NpyError::Type(self.kind())),
        }
    }
}

fn str_of(bytes: &[u8]) -> Result<&str, NpyError> {
    std::str::from_utf8(bytes).map_err(|_| NpyError::Text)
}

/// A string without the zeros that fill its element.
fn trimmed<T: PartialEq + From<u8>>(string: &[T]) -> &[T] {
    let length = string.iter().rposition(|unit| *unit != T::from(0)).map_or(0, |last| last + 1);
    &string[..length]
}

/// Writes an array in C order, version 1 of the format.
///
/// # Errors
/// If writing fails, or there are not as many `values` as the `shape` has elements.
pub fn write_npy<T: Number>(out: &mut dyn Write, shape: &[u64], values: impl IntoIterator<Item = T>) -> io::Result<()> {
    // A compressing writer clears its buffer at every call.
    let mut out = BufWriter::with_capacity(BUFFER_BYTES, out);
    write_header(&mut out, T::KIND, shape)?;
    let mut count = 0_u64;
    for value in values {
        value.write(&mut out)?;
        count += 1;
    }
    finish(out, count, shape)
}

fn write_header(out: &mut dyn Write, kind: &str, shape: &[u64]) -> io::Result<()> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let mut header = format!("{{'descr': '<{kind}', 'fortran_order': False, 'shape': ({sides}), }}");
    let before = MAGIC.len() + 4;
    let length = (before + header.len() + 1).next_multiple_of(ALIGNMENT) - before;
    header.extend(std::iter::repeat_n(' ', length - 1 - header.len()));
    header.push('\n');
    out.write_all(MAGIC)?;
    out.write_all(&[1, 0])?;
    let length = u16::try_from(length).map_err(|_| io::Error::other("the shape has too many dimensions"))?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(header.as_bytes())
}

fn finish(mut out: impl Write, count: u64, shape: &[u64]) -> io::Result<()> {
    if count != shape.iter().product::<u64>() {
        return Err(io::Error::other(format!("{count} values were given for an array of shape {shape:?}")));
    }
    out.flush()
}

/// The type of the elements, whether they are in Fortran's order, and the shape.
fn parse_header(header: &[u8]) -> Option<(Kind, bool, Vec<u64>)> {
    let mut parser = Parser { rest: std::str::from_utf8(header).ok()? };
    let (mut kind, mut fortran_order, mut shape) = (None, None, None);
    parser.symbol('{')?;
    while parser.symbol('}').is_none() {
        let key = parser.string()?;
        parser.symbol(':')?;
        let is_new = match key {
            "descr" => kind.replace(Kind::parse(parser.string()?)?).is_none(),
            "fortran_order" => fortran_order.replace(parser.boolean()?).is_none(),
            "shape" => shape.replace(parser.tuple()?).is_none(),
            _ => false,
        };
        if !is_new {
            return None;
        }
        if parser.symbol(',').is_none() {
            parser.symbol('}')?;
            break;
        }
    }
    parser.skip_space();
    parser.rest.is_empty().then_some((kind?, fortran_order?, shape?))
}

impl Kind {
    fn parse(text: &str) -> Option<Self> {
        let mut rest = text.chars();
        let (order, letter) = (rest.next()?, rest.next()?);
        // Times have a unit: `<M8[ns]`.
        let (digits, unit) = rest.as_str().split_once('[').unwrap_or((rest.as_str(), "]"));
        let is_known = matches!(order, '<' | '>' | '|')
            && letter.is_ascii_alphabetic()
            && digits.bytes().all(|b| b.is_ascii_digit())
            && unit.strip_suffix(']')?.bytes().all(|b| b.is_ascii_alphanumeric());
        let count: u64 = if letter == 'O' { 0 } else { digits.parse().ok()? };
        let size = count.checked_mul(if letter == 'U' { 4 } else { 1 })?;
        is_known.then(|| Self { text: text.to_owned(), big_endian: order == '>', letter, size })
    }

    fn quoted(&self) -> String {
        format!("'{}'", self.text)
    }
}

/// The header from the next token on.
struct Parser<'a> {
    rest: &'a str,
}

impl<'a> Parser<'a> {
    fn skip_space(&mut self) {
        self.rest = self.rest.trim_ascii_start();
    }

    /// Moves past this character, if it is next.
    fn symbol(&mut self, symbol: char) -> Option<()> {
        self.skip_space();
        self.rest = self.rest.strip_prefix(symbol)?;
        Some(())
    }

    /// A string without escape sequences.
    fn string(&mut self) -> Option<&'a str> {
        self.skip_space();
        let quote = self.rest.chars().next().filter(|quote| matches!(quote, '\'' | '"'))?;
        let (string, rest) = self.rest[1..].split_once(quote)?;
        self.rest = rest;
        (!string.contains('\\')).then_some(string)
    }

    fn boolean(&mut self) -> Option<bool> {
        self.skip_space();
        let (value, rest) = match (self.rest.strip_prefix("True"), self.rest.strip_prefix("False")) {
            (Some(rest), _) => (true, rest),
            (None, Some(rest)) => (false, rest),
            (None, None) => return None,
        };
        self.rest = rest;
        Some(value)
    }

    fn number(&mut self) -> Option<u64> {
        self.skip_space();
        let end = self.rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.rest.len());
        let (digits, rest) = self.rest.split_at(end);
        self.rest = rest;
        digits.parse().ok()
    }

    /// A tuple of numbers: `()`, `(2,)`, `(2, 3)`.
    fn tuple(&mut self) -> Option<Vec<u64>> {
        let mut numbers = Vec::new();
        self.symbol('(')?;
        while self.symbol(')').is_none() {
            numbers.push(self.number()?);
            if self.symbol(',').is_none() {
                // One number in parentheses is not a tuple.
                return (numbers.len() > 1).then_some(numbers).filter(|_| self.symbol(')').is_some());
            }
        }
        Some(numbers)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn npy(version: u8, header: &str, content: &[u8]) -> Vec<u8> {
        let length = header.len() as u32;
        let length = if version == 1 { &length.to_le_bytes()[..2] } else { &length.to_le_bytes()[..] };
        [MAGIC, &[version, 0], length, header.as_bytes(), content].concat()
    }

    fn header(kind: &str, shape: &str) -> String {
        format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}      \n")
    }

    #[test]
    fn the_bytes_are_numpys() {
        let mut bytes = Vec::new();
        write_npy(&mut bytes, &[2, 1], [1.0_f32, -2.0]).unwrap();
        let text = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 1, ), }";
        assert_eq!(bytes.len(), 128 + 8);
        assert_eq!(&bytes[..10], b"\x93NUMPY\x01\x00\x76\x00");
        assert_eq!(std::str::from_utf8(&bytes[10..128]).unwrap(), format!("{text:117}\n"));
        assert_eq!(bytes[128..], [0, 0, 128, 63, 0, 0, 0, 192]);
        assert!(write_npy(&mut Vec::new(), &[3], [1_i32]).is_err());
    }

    #[test]
    fn all_versions_and_both_byte_orders_are_read() {
        for version in [1, 2, 3] {
            let bytes = npy(version, &header(">i4", "(2,)"), &[0, 0, 0, 1, 0, 0, 1, 0]);
            let array = NpyArray::open(&bytes).unwrap();
            assert_eq!((array.shape.as_slice(), array.numbers::<i32>()), (&[2][..], Some(vec![1, 256])));
            assert_eq!((array.numbers::<f32>(), array.numbers::<i64>()), (None, None));
        }
        let bytes = npy(4, &header("<i4", "(2,)"), &[0; 8]);
        assert!(matches!(NpyArray::open(&bytes), Err(NpyError::Version(4, 0))));
    }

    #[test]
    fn strings_are_read_without_their_filling() {
        let text = |kind: &str, shape: &str, content: &[u8]| {
            NpyArray::open(&npy(1, &header(kind, shape), content)).and_then(|array| array.text())
        };
        assert_eq!(text("|S4", "(2,)", b"ab\0\0c\0\0\0").unwrap(), "abc");
        assert_eq!(text("<U3", "()", &[0xe9, 0, 0, 0, b'!', 0, 0, 0, 0, 0, 0, 0]).unwrap(), "\u{e9}!");
        assert_eq!(text(">U1", "()", &[0, 0, 0, b'x']).unwrap(), "x");
        assert_eq!(text("<U0", "(1,)", &[0; 9]).unwrap(), "");
        assert!(matches!(text("<U1", "()", &[0, 0xd8, 0, 0]), Err(NpyError::Text)));
        assert!(matches!(text("|S1", "()", &[0xff]), Err(NpyError::Text)));
        assert!(matches!(text("<f4", "()", &[0; 4]), Err(NpyError::Type(_))));
    }

    #[test]
    fn headers_that_python_reads_otherwise_are_refused() {
        for header in [
            "",
            "{",
            "{}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (3)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (3,,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (-3,)}",
            "{'descr': '<f4', 'fortran_order': 0, 'shape': (3,)}",
            "{'descr': '<f4', 'fortran_order': False}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (3,)} more",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (3,), 'shape': (3,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (3,), 'other': 'x'}",
            "{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (3,)}",
            "{'descr': '<f4\u{e9}', 'fortran_order': False, 'shape': (3,)}",
            "{'descr': '\u{e9}f4', 'fortran_order': False, 'shape': (3,)}",
        ] {
            let bytes = npy(1, header, &[0; 12]);
            assert!(matches!(NpyArray::open(&bytes), Err(NpyError::Header)), "{header}");
        }
        let spaces = " ".repeat(MOST_HEADER_BYTES);
        let long = npy(2, &(header("<f4", "(3,)") + &spaces), &[0; 12]);
        assert!(matches!(NpyArray::open(&long), Err(NpyError::Header)));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(values in prop::collection::vec(any::<i64>(), 0..40), columns in 1_usize..4) {
            let rows = values.len() / columns;
            let (values, shape) = (&values[..rows * columns], [rows as u64, columns as u64]);
            let mut bytes = Vec::new();
            write_npy(&mut bytes, &shape, values.iter().copied()).unwrap();
            let array = NpyArray::open(&bytes).unwrap();
            prop_assert_eq!(array.numbers::<i64>().unwrap(), values);
            prop_assert_eq!(&array.shape[..], &shape[..]);
            prop_assert!(!array.fortran_order);
            prop_assert!(NpyArray::open(&bytes[..bytes.len() - 1]).is_err());
        }

        #[test]
        fn no_bytes_cause_a_panic(changes in prop::collection::vec((0_usize..160, any::<u8>()), 0..6), length in 0_usize..160) {
            let mut bytes = npy(1, &header("<U2", "(2, 3)"), &[0; 70]);
            for (at, byte) in changes {
                if let Some(changed) = bytes.get_mut(at) {
                    *changed = byte;
                }
            }
            bytes.truncate(length);
            if let Ok(array) = NpyArray::open(&bytes) {
                let _ = (array.numbers::<f32>(), array.numbers::<f64>(), array.text());
            }
        }
    }
}
