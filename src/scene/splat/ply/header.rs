//! The header. ply-rs-bw parses it; this file rejects beforehand what ply-rs-bw would silently merge (duplicates), and
//! headers without an end.

use std::collections::HashSet;
use std::io::{BufRead, Cursor, Read};

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding};

use super::Problem;
use super::row::Row;
use super::source::Bytes;

/// Far larger than any header seen (a few kilobytes), and small compared with any splat.
const HEADER_LIMIT: u64 = 1 << 20;

/// A PLY header.
pub(super) struct Header {
    pub encoding: Encoding,
    /// In file order.
    pub elements: Vec<ElementDef>,
    /// The text of its comments.
    pub comments: Vec<String>,
    /// Number of lines in the header.
    pub lines: u64,
    /// Offset of the first byte after the header.
    pub data_at: u64,
}

pub(super) fn read(bytes: &impl Bytes) -> Result<Header, Problem> {
    let (text, data_at) = checked_text(bytes)?;
    let header = Parser::<Row>::new().read_header(&mut Reader::new(Cursor::new(&text))).map_err(|error| match error
        .line()
        .and_then(|line| Some((line, text.lines().nth(line - 1)?)))
    {
        Some((line, text)) => Problem::HeaderLine { line, text: one_line(text) },
        None => Problem::Header(one_line(&error.to_string()).trim_end_matches('.').to_owned()),
    })?;
    Ok(Header {
        encoding: header.encoding,
        elements: header.elements.into_iter().map(|(_, element)| element).collect(),
        comments: text.lines().filter_map(|line| line.strip_prefix("comment ")).map(str::to_owned).collect(),
        lines: text.lines().count() as u64,
        data_at,
    })
}

/// The header's text up to and including `end_header`, without duplicates, and the offset of what follows.
fn checked_text(bytes: &impl Bytes) -> Result<(String, u64), Problem> {
    let mut reader = bytes.reader_from(0).take(HEADER_LIMIT);
    let mut checker = LineChecker::default();
    let mut text = String::new();
    let mut raw = Vec::new();
    let mut data_at = 0;
    for line in 1.. {
        raw.clear();
        data_at += reader.read_until(b'\n', &mut raw)? as u64;
        let decoded = String::from_utf8_lossy(&raw);
        if line == 1 && decoded.trim_end() != "ply" {
            return Err(Problem::NotPly);
        }
        if !raw.ends_with(b"\n") {
            return Err(Problem::HeaderEnd { limit: data_at });
        }
        checker.check(line, &decoded)?;
        text.push_str(&decoded);
        if decoded.trim_end() == "end_header" {
            break;
        }
    }
    Ok((text, data_at))
}

/// Remembers the names of the header so far.
#[derive(Default)]
struct LineChecker {
    elements: HashSet<String>,
    properties_of_element: HashSet<String>,
}

impl LineChecker {
    fn check(&mut self, line: usize, text: &str) -> Result<(), Problem> {
        let mut words = text.split_ascii_whitespace();
        let duplicate = |kind, name: &str| Err(Problem::Duplicate { kind, name: name.to_owned(), line });
        match words.next() {
            Some("element") => {
                self.properties_of_element.clear();
                let name = words.next().unwrap_or_default();
                if !self.elements.insert(name.to_owned()) {
                    return duplicate("element", name);
                }
            }
            Some("property") => {
                let name = words.next_back().unwrap_or_default();
                if !self.properties_of_element.insert(name.to_owned()) {
                    return duplicate("property", name);
                }
            }
            _ => {}
        }
        if Parser::<Row>::new().read_header_line(text).is_err() {
            return Err(Problem::HeaderLine { line, text: one_line(text) });
        }
        Ok(())
    }
}

/// At most 100 characters on one line, for a message.
fn one_line(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let line = words.join(" ");
    match line.char_indices().nth(100) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}
