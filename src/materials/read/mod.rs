//! Reads CSV cells: every error states the file, line, column and the remedy. [`tables`] defines the tables, [`law`]
//! the laws, [`word`] the names of variants.

mod law;
mod tables;
mod word;

use std::ops::RangeInclusive;
use std::path::PathBuf;

use csv::StringRecord;
use serde::Deserialize;
use thiserror::Error;

use super::bibliography::USER;
use super::{Label, Labels};
use crate::files;
use crate::units::{Range, ShoreScale};
use crate::words::output::{counted, is_not_shown};

pub use tables::{Placed, Tables, read_tables};
use word::Mismatch;

/// Errors in a library on disk.
#[derive(Debug, Error)]
pub enum LibraryError {
    #[error("cannot read the material library {path:?}: {source}; give a CSV file or a folder of them")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{path:?} holds no CSV file; a material library is one CSV, or a folder of them")]
    Empty { path: PathBuf },
    #[error("{file}: not a CSV table: {source}")]
    NotCsv { file: String, source: csv::Error },
    #[error(
        "{file} line {line}: the header has {columns} columns, but this row has {}; write a cell for every column, and \
         quote one that holds a comma",
        counted(*.cells as usize, "cell")
    )]
    Ragged { file: String, line: u64, cells: u64, columns: u64 },
    #[error("{file} line {line}: the column `{column}` is missing; materials/README.md lists the columns")]
    MissingColumn { file: String, line: u64, column: String },
    #[error("{file} line {line}, column {number} `{column}`: no such column; materials/README.md lists the columns")]
    UnknownColumn { file: String, line: u64, number: usize, column: String },
    #[error(
        "{file} line {line}, column {number} `{column}`: there is already a column of this name; remove one of them"
    )]
    RepeatedColumn { file: String, line: u64, number: usize, column: String },
    #[error("{file} line {line}, column {number} `{column}`: {found:?} {problem}")]
    BadCell { file: String, line: u64, number: usize, column: String, found: String, problem: String },
    #[error("{file} line {line}: a library may have at most {MOST_ROWS} rows; leave out some")]
    TooManyRows { file: String, line: u64 },
    #[error("{file} line {line}: the name or alias {name:?} already stands for {other:?}; names must be unique")]
    Duplicate { file: String, line: u64, name: String, other: String },
}

/// The most rows that a set of tables may have: more than three times as many as the built-in tables.
const MOST_ROWS: usize = 10_000;

/// The most characters of a name, which prompts list and pictures show: more than five times as many as any built-in
/// name has.
const LONGEST_NAME: usize = 200;

/// A file of the library.
#[derive(Debug, Clone, Copy)]
pub struct Table<'a> {
    /// For messages; its stem determines which table it is.
    pub name: &'a str,
    pub text: &'a str,
}

/// A record with its place and the names of its columns.
struct Row<'a> {
    file: &'a str,
    line: u64,
    columns: &'a StringRecord,
    cells: &'a StringRecord,
}

/// Reads each row of a table, which must have the `required` columns and may have the `optional` ones. `left` is how many
/// rows it and the tables after it may have.
fn rows<T>(
    table: &Table,
    left: &mut usize,
    required: &[&str],
    optional: &[&str],
    read: impl Fn(&Row) -> Result<T, LibraryError>,
) -> Result<Vec<T>, LibraryError> {
    let (file, text) = (table.name, table.text.as_bytes());
    let not_csv = |source: csv::Error| match source.kind() {
        csv::ErrorKind::UnequalLengths { pos: Some(position), expected_len, len } => LibraryError::Ragged {
            file: file.to_owned(),
            line: files::line_at(text, position),
            cells: *len,
            columns: *expected_len,
        },
        _ => LibraryError::NotCsv { file: file.to_owned(), source },
    };
    let mut reader = files::table(text);
    let columns = reader.headers().map_err(not_csv)?.clone();
    let line = files::line_at(text, &csv::Position::new());
    if let Some(column) = required.iter().find(|name| !columns.iter().any(|column| column == **name)) {
        return Err(LibraryError::MissingColumn { file: file.to_owned(), line, column: (*column).to_owned() });
    }
    for (at, column) in columns.iter().enumerate() {
        let (file, number, column) = (file.to_owned(), at + 1, column.to_owned());
        if !required.contains(&column.as_str()) && !optional.contains(&column.as_str()) {
            return Err(LibraryError::UnknownColumn { file, line, number, column });
        }
        if columns.iter().take(at).any(|earlier| earlier == column) {
            return Err(LibraryError::RepeatedColumn { file, line, number, column });
        }
    }
    let mut cells = StringRecord::new();
    let mut rows = Vec::new();
    while reader.read_record(&mut cells).map_err(not_csv)? {
        let line = cells.position().map_or(0, |position| files::line_at(text, position));
        *left = left.checked_sub(1).ok_or_else(|| LibraryError::TooManyRows { file: file.to_owned(), line })?;
        rows.push(read(&Row { file, line, columns: &columns, cells: &cells })?);
    }
    Ok(rows)
}

impl Row<'_> {
    fn index(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|name| name == column)
    }

    /// The cell's text; empty if an optional column is left out.
    fn text(&self, column: &str) -> &str {
        self.index(column).and_then(|at| self.cells.get(at)).unwrap_or_default()
    }

    fn bad(&self, column: &str, problem: impl Into<String>) -> LibraryError {
        LibraryError::BadCell {
            file: self.file.to_owned(),
            line: self.line,
            number: self.index(column).map_or(0, |at| at + 1),
            column: column.to_owned(),
            found: self.text(column).chars().take(LONGEST_NAME).collect(),
            problem: problem.into(),
        }
    }

    fn filled(&self, column: &str) -> Result<String, LibraryError> {
        match self.text(column) {
            "" => Err(self.bad(column, "must not be empty")),
            text => Ok(text.to_owned()),
        }
    }

    /// The name of a material, a family or a filling.
    fn name(&self, column: &str) -> Result<String, LibraryError> {
        self.checked_name(column, self.filled(column)?)
    }

    /// Names separated by semicolons.
    fn names(&self, column: &str) -> Result<Vec<String>, LibraryError> {
        list(self.text(column)).into_iter().map(|name| self.checked_name(column, name)).collect()
    }

    fn checked_name(&self, column: &str, name: String) -> Result<String, LibraryError> {
        if name.chars().count() > LONGEST_NAME {
            return Err(self.bad(column, format!("is too long; a name may have at most {LONGEST_NAME} characters")));
        }
        if name.contains(is_not_shown) {
            return Err(self.bad(column, "has characters that control the display or cannot be seen; remove them"));
        }
        Ok(name)
    }

    fn number(&self, column: &str) -> Result<f64, LibraryError> {
        let number: f64 =
            self.text(column).parse().map_err(|_| self.bad(column, "is not a number; write it like 680 or 6.8e2"))?;
        if number.is_finite() { Ok(number) } else { Err(self.bad(column, "is not finite")) }
    }

    fn number_within(&self, column: &str, bounds: &RangeInclusive<f64>) -> Result<f64, LibraryError> {
        let number = self.number(column)?;
        if bounds.contains(&number) { Ok(number) } else { Err(self.bad(column, format!("must be {}", within(bounds)))) }
    }

    /// The range in the columns `name_low` and `name_high`, which must lie within `bounds`.
    fn range(&self, name: &str, bounds: RangeInclusive<f64>) -> Result<Range, LibraryError> {
        let [low, high] = [format!("{name}_low"), format!("{name}_high")];
        let range = Range::new(self.number_within(&low, &bounds)?, self.number_within(&high, &bounds)?);
        if range.low > range.high {
            return Err(self.bad(&high, format!("is less than the low end, {}", range.low)));
        }
        Ok(range)
    }

    /// The variant that the column names, as serde writes it; `kind` describes all variants, for the message.
    fn variant<'a, T: Deserialize<'a>>(&'a self, column: &str, kind: &str) -> Result<T, LibraryError> {
        word::variant(self.text(column)).map_err(|mismatch| match mismatch {
            Mismatch::Word(known) => self.bad(column, format!("is not {kind}; write {}", word::alternatives(known))),
            other => self.bad(column, other.to_string()),
        })
    }

    fn scale(&self, column: &str) -> Result<ShoreScale, LibraryError> {
        self.variant(column, "a Shore scale")
    }

    fn sources(&self, column: &str) -> Vec<String> {
        let cited: Vec<String> = list(self.text(column));
        if cited.is_empty() { vec![USER.to_owned()] } else { cited }
    }

    fn label(&self, name: &str) -> Result<Label, LibraryError> {
        let flag = format!("{name}_exact");
        let exact = match self.text(&flag) {
            "1" => true,
            "0" | "" => false,
            _ => return Err(self.bad(&flag, "must be 1 (the label means this material) or 0 (it is the nearest)")),
        };
        Ok(Label { name: self.text(name).to_owned(), exact })
    }

    fn labels(&self) -> Result<Labels, LibraryError> {
        Ok(Labels { abo: self.label("label_abo")?, mvimgnet: self.label("label_mvimgnet")? })
    }
}

/// Bounds as text; large numbers as powers of ten.
fn within(bounds: &RangeInclusive<f64>) -> String {
    let written = |value: &f64| if value.abs() >= 1e4 { format!("{value:e}") } else { value.to_string() };
    format!("{} to {} (SI)", written(bounds.start()), written(bounds.end()))
}

/// The entries of a list cell, which are separated by `;`.
fn list(cell: &str) -> Vec<String> {
    cell.split(';').map(str::trim).filter(|entry| !entry.is_empty()).map(str::to_owned).collect()
}
