//! JSON, read and written. What other programs or people wrote is read with an error that names the usual ways in which a
//! file only looks like JSON.
//!
//! All of it is written by one type of serializer, into memory, and read by one type of deserializer, because serde's code for
//! a type is compiled anew for each of them.

use std::{io, str};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Serializer;
use serde_json::ser::{CompactFormatter, Formatter, PrettyFormatter};
use thiserror::Error;

use super::BYTE_ORDER_MARK;

/// An error in a JSON text. Lines and columns are counted from 1, columns in bytes.
#[derive(Debug, Error)]
pub enum Problem {
    #[error("it is UTF-16 text, and JSON is UTF-8; save it as UTF-8")]
    Utf16,
    #[error(
        "line {line} column {column}: {word} is not JSON, which has only finite numbers; write a number, or leave the entry out"
    )]
    NotFinite { line: usize, column: usize, word: String },
    #[error("line {line} column {column}: `{word}` is not JSON; it may be {instead}")]
    Word { line: usize, column: usize, word: String, instead: &'static str },
    #[error("line {line} column {column}: a comment begins here (`{begin}`), and JSON has no comments; remove it")]
    Comment { line: usize, column: usize, begin: &'static str },
    #[error("line {line} column {column}: JSON has no comma before a closing bracket; remove it")]
    TrailingComma { line: usize, column: usize },
    #[error(transparent)]
    Other(#[from] serde_json::Error),
}

/// A value as JSON on one line.
///
/// # Errors
/// If its serialization fails, or a map has keys that are no strings.
pub fn compact(value: &(impl Serialize + ?Sized)) -> serde_json::Result<String> {
    write(value, Layout::Compact(CompactFormatter))
}

/// A value as indented JSON, without a newline at its end.
///
/// # Errors
/// As for [`compact`].
pub fn pretty(value: &(impl Serialize + ?Sized)) -> serde_json::Result<String> {
    write(value, Layout::Pretty(PrettyFormatter::new()))
}

fn write(value: &(impl Serialize + ?Sized), layout: Layout) -> serde_json::Result<String> {
    let mut bytes = Vec::with_capacity(128);
    value.serialize(&mut Serializer::with_formatter(&mut bytes, layout))?;
    Ok(String::from_utf8(bytes).expect("JSON is UTF-8"))
}

/// Both formatters of `serde_json` as one type.
enum Layout {
    Compact(CompactFormatter),
    Pretty(PrettyFormatter<'static>),
}

macro_rules! by_layout {
    ($($method:ident($($argument:ident: $type:ty)?)),*) => {$(
        fn $method<W: io::Write + ?Sized>(&mut self, out: &mut W $(, $argument: $type)?) -> io::Result<()> {
            match self {
                Self::Compact(formatter) => formatter.$method(out $(, $argument)?),
                Self::Pretty(formatter) => formatter.$method(out $(, $argument)?),
            }
        }
    )*};
}

/// The methods in which they differ.
impl Formatter for Layout {
    by_layout!(
        begin_array(), end_array(), begin_array_value(is_first: bool), end_array_value(), begin_object(), end_object(),
        begin_object_key(is_first: bool), begin_object_value(), end_object_value()
    );
}

/// Reads JSON that gprop or a server wrote.
///
/// # Errors
/// If it is not JSON, or not that of a `T`.
pub fn read<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> serde_json::Result<T> {
    #[expect(clippy::disallowed_methods, reason = "this is where it is called")]
    serde_json::from_slice(bytes)
}

/// Reads JSON, with or without the byte order mark with which some editors begin it.
///
/// # Errors
/// [`Problem`] if it is not JSON, or not that of a `T`.
pub fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    let text = bytes.strip_prefix(BYTE_ORDER_MARK.as_bytes()).unwrap_or(bytes);
    read(text).map_err(|error| {
        if is_utf16(bytes) {
            return Problem::Utf16;
        }
        let cause = if error.is_data() { None } else { str::from_utf8(text).ok().and_then(first_foreign) };
        cause.unwrap_or(Problem::Other(error))
    })
}

/// True for text that begins with the byte order mark of UTF-16, or with an ASCII character in it.
fn is_utf16(bytes: &[u8]) -> bool {
    matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [0, 1..=0x7f, ..] | [1..=0x7f, 0, ..])
}

/// The first thing outside of strings that other languages have and JSON has not.
fn first_foreign(text: &str) -> Option<Problem> {
    let bytes = text.as_bytes();
    let mut at = 0;
    let mut last_comma = None;
    while let Some(&byte) = bytes.get(at) {
        let (line, column) = place(text, at);
        match byte {
            b'"' => at = end_of_string(bytes, at),
            b'#' => return Some(Problem::Comment { line, column, begin: "#" }),
            b'/' if bytes.get(at + 1) == Some(&b'*') => return Some(Problem::Comment { line, column, begin: "/*" }),
            b'/' => return Some(Problem::Comment { line, column, begin: "//" }),
            b'}' | b']' => {
                if let Some(comma) = last_comma {
                    let (line, column) = place(text, comma);
                    return Some(Problem::TrailingComma { line, column });
                }
            }
            _ if byte.is_ascii_alphabetic() => {
                let length = bytes[at..].iter().take_while(|byte| byte.is_ascii_alphanumeric()).count();
                if let Some(problem) = foreign_word(text, at, length) {
                    return Some(problem);
                }
                at += length - 1;
            }
            // With its exponent, whose letter is no word.
            b'0'..=b'9' => {
                let is_of_number =
                    |byte: &&u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'e' | b'E' | b'+' | b'-');
                at += bytes[at..].iter().take_while(is_of_number).count() - 1;
            }
            _ => {}
        }
        if !byte.is_ascii_whitespace() {
            last_comma = (byte == b',').then_some(at);
        }
        at += 1;
    }
    None
}

/// The place of the closing quote, or of the last byte, of the string that begins at `start`.
fn end_of_string(bytes: &[u8], start: usize) -> usize {
    let mut at = start + 1;
    while at < bytes.len() && bytes[at] != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    at
}

/// The problem of the word at `at`; `None` if JSON has it.
fn foreign_word(text: &str, at: usize, length: usize) -> Option<Problem> {
    let word = &text[at..at + length];
    let (line, column) = place(text, at);
    let signed = if text[..at].ends_with('-') { format!("-{word}") } else { word.to_owned() };
    let instead = match word {
        "true" | "false" | "null" => return None,
        _ if ["nan", "inf", "infinity"].contains(&word.to_lowercase().as_str()) => {
            return Some(Problem::NotFinite { line, column, word: signed });
        }
        "True" | "False" | "None" => "Python's true, false or null; write it with json.dump",
        _ => "a name without quotes; put it in double quotes",
    };
    let word = word.chars().take(40).collect();
    Some(Problem::Word { line, column, word, instead })
}

/// Line and column of a byte.
fn place(text: &str, at: usize) -> (usize, usize) {
    let before = &text.as_bytes()[..at];
    let line_start = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |feed| feed + 1);
    (1 + before.iter().filter(|byte| **byte == b'\n').count(), 1 + at - line_start)
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    fn message(text: &str) -> String {
        parse::<Value>(text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn it_is_written_as_serde_json_writes_it() {
        let value = serde_json::json!({"a": [1, 2.5, []], "b": {}, "c": {"d": [{"e": "\u{e9}\n"}, null]}});
        assert_eq!(compact(&value).unwrap(), serde_json::to_string(&value).unwrap());
        assert_eq!(pretty(&value).unwrap(), serde_json::to_string_pretty(&value).unwrap());
    }

    #[test]
    fn what_only_looks_like_json_is_named_with_its_place() {
        let all = [
            ("{\"a\": 1,\n \"b\": NaN}", "line 2 column 7: NaN is not JSON"),
            ("[1, -Infinity]", "line 1 column 6: -Infinity is not JSON"),
            ("{\"a\": nan}", "line 1 column 7: nan is not JSON"),
            ("{\n  // left\n \"a\": 1}", "line 2 column 3: a comment begins here (`//`)"),
            ("{\"a\": \"// no \\\" comment\" /* but this */}", "column 26: a comment begins here (`/*`)"),
            ("# made by hand\n[]", "line 1 column 1: a comment begins here (`#`)"),
            ("[1e-3, None]", "column 8: `None` is not JSON; it may be Python's"),
            ("{a: 1}", "`a` is not JSON; it may be a name without quotes"),
            ("[1, 2 ,\n]", "line 1 column 7: JSON has no comma before a closing bracket"),
            ("[1, 2", "EOF while parsing a list at line 1 column 5"),
        ];
        for (text, words) in all {
            assert!(message(text).contains(words), "no {words:?} for {text:?}: {}", message(text));
        }
    }

    #[test]
    fn utf_16_is_named_and_a_byte_order_mark_of_utf_8_is_no_error() {
        let little: Vec<u8> = "\u{feff}{\"a\": 1}".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = "{\"a\": 1}".encode_utf16().flat_map(u16::to_be_bytes).collect();
        for bytes in [little, big] {
            assert!(matches!(parse::<Value>(&bytes), Err(Problem::Utf16)));
        }
        assert!(parse::<Value>("\u{feff}{\"a\": 1}".as_bytes()).is_ok());
    }

    #[test]
    fn the_wrong_kind_of_value_is_told_by_serde() {
        let error = parse::<Vec<f64>>(b"[1, \"NaN\"]").unwrap_err().to_string();
        assert!(error.contains("invalid type: string \"NaN\", expected f64 at line 1 column 9"), "{error}");
    }
}
