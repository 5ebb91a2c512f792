//! Rows in ASCII, one by one through ply-rs-bw into our own row type (its generic element is a map per row).

use std::io::BufRead;

use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::ElementDef;

use super::header::Header;
use super::layout::{self, Array, Layout};
use super::row::Row;
use super::source::Bytes;
use super::{Problem, Rows};

/// An error in a row of text.
#[derive(Debug, thiserror::Error)]
pub enum RowProblem {
    #[error("{expected} values were expected, but {found} were found")]
    Count { expected: usize, found: usize },
    #[error("`{0}` is not a number")]
    NotANumber(String),
    #[error("a value does not fit the type of its property")]
    Type,
}

pub(super) fn read(bytes: &impl Bytes, header: &Header, layout: &Layout) -> Result<Rows, Problem> {
    check_size(bytes, header, layout)?;
    let mut gaussians = layout.allocate(layout.count as usize);
    let mut arrays = layout::arrays(&mut gaussians);
    let mut lines = Lines::new(bytes.reader_from(header.data_at), header.lines);
    for _ in 0..layout.before {
        if !lines.next()? {
            return Err(Problem::TruncatedText { count: layout.count, found: 0 });
        }
    }
    let mut warning = None;
    for index in 0..layout.count {
        if !lines.next()? {
            return Err(Problem::TruncatedText { count: layout.count, found: index });
        }
        let row = parse_row(&lines.text, &layout.vertex).map_err(|reason| {
            let line = lines.number;
            Problem::Row { line, index, reason }
        })?;
        store(&row, layout, index as usize, &mut arrays);
    }
    if !layout.followed && lines.next()? {
        warning = Some("the lines after the last Gaussian are not declared in the header; they are ignored".to_owned());
    }
    let surely_usable = layout::surely_usable(&arrays);
    Ok(Rows { gaussians, surely_usable, warning })
}

/// Checks the file's size: a value takes at least a digit and a separator; only the last line may lack its line end.
fn check_size(bytes: &impl Bytes, header: &Header, layout: &Layout) -> Result<(), Problem> {
    let per_row = 2 * layout.vertex.properties.len() as u128;
    let available = u128::from(bytes.size() - header.data_at) + 1;
    if u128::from(layout.count) * per_row + layout.before > available {
        return Err(Problem::Truncated {
            count: layout.count,
            expected: u128::from(header.data_at) + u128::from(layout.count) * per_row + layout.before,
            found: bytes.size(),
        });
    }
    Ok(())
}

fn store(row: &Row, layout: &Layout, index: usize, arrays: &mut [Array<'_>]) {
    let mut values = row.values.iter();
    for column in &layout.columns {
        let array = &mut arrays[column.array];
        let start = index * array.width + column.lane;
        for (to, from) in array.values[start..start + column.length].iter_mut().zip(&mut values) {
            *to = *from;
        }
    }
}

/// Parses one row. ply-rs-bw does not accept `nan`, `inf`, `.5` or `5.`; a line that it refuses is parsed once
/// more with 0 in place of such words, and their values are filled in afterwards.
fn parse_row(text: &str, vertex: &ElementDef) -> Result<Row, RowProblem> {
    let parser = Parser::<Row>::new();
    let expected = vertex.properties.len();
    let found = text.split_ascii_whitespace().count();
    if found != expected {
        return Err(RowProblem::Count { expected, found });
    }
    if let Ok(row) = parser.read_ascii_element(text, vertex) {
        return Ok(row);
    }
    let mut put_back = Vec::new();
    let mut words: Vec<&str> = text.split_ascii_whitespace().collect();
    for (index, word) in words.iter_mut().enumerate() {
        if word.bytes().all(|b| b.is_ascii_digit() || b == b'-') {
            continue;
        }
        let value: f32 = word.parse().map_err(|_| RowProblem::NotANumber(shortened(word)))?;
        put_back.push((index, value));
        *word = "0";
    }
    let mut row = parser.read_ascii_element(&words.join(" "), vertex).map_err(|_| RowProblem::Type)?;
    for (index, value) in put_back {
        row.values[index] = value;
    }
    Ok(row)
}

fn shortened(word: &str) -> String {
    word.chars().take(40).collect()
}

/// Lines with their number in the file; blank ones are skipped.
struct Lines<R> {
    reader: R,
    text: String,
    number: u64,
}

impl<R: BufRead> Lines<R> {
    fn new(reader: R, number: u64) -> Self {
        Self { reader, text: String::new(), number }
    }

    /// Moves on to the next line; false at the end. Bytes that are not UTF-8 are replaced, so that the word that holds
    /// them is refused with its place.
    fn next(&mut self) -> std::io::Result<bool> {
        loop {
            self.text.clear();
            self.number += 1;
            let mut bytes = Vec::new();
            if self.reader.read_until(b'\n', &mut bytes)? == 0 {
                return Ok(false);
            }
            self.text.push_str(&String::from_utf8_lossy(&bytes));
            if !self.text.trim_ascii().is_empty() {
                return Ok(true);
            }
        }
    }
}
