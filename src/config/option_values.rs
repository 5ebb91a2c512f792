//! Parsers of options' values: numbers within a sensible domain, files and folders that exist. Invalid values are
//! refused before anything is done, with the option's name, whether they were typed or set in `gprop.toml`. Default
//! values are defined only beside their options; [`defaults`] reads them from there.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PathBufValueParser, TypedValueParser};

/// The options of an empty command line: each has its default value.
pub fn defaults<T: clap::Args>() -> T {
    typed(&[]).expect("no option is required, and every default is a value of its option")
}

/// The options of a command line with `arguments`.
///
/// # Errors
/// clap's error for an unknown argument or a value outside its domain.
pub fn typed<T: clap::Args>(arguments: &[&str]) -> Result<T, clap::Error> {
    let command = T::augment_args(clap::Command::new("gprop").no_binary_name(true));
    T::from_arg_matches(&command.try_get_matches_from(arguments)?)
}

/// A number from `low` to `high`.
pub fn from_to<T: Number>(low: T, high: T) -> impl Parser<T> {
    within(move |value: &T| *value >= low && *value <= high, format!("from {low} to {high}"))
}

/// A number above `low`, up to `high`.
pub fn above<T: Number>(low: T, high: T) -> impl Parser<T> {
    within(move |value: &T| *value > low && *value <= high, format!("above {low}, up to {high}"))
}

/// A number from `low` up to but not including `high`.
pub fn below<T: Number>(low: T, high: T) -> impl Parser<T> {
    within(move |value: &T| *value >= low && *value < high, format!("from {low} up to but not including {high}"))
}

/// A numeric type of an option's value.
pub trait Number: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static {}

impl<T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static> Number for T {}

/// A value parser as clap expects it.
pub trait Parser<T>: Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {}

impl<T, F: Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static> Parser<T> for F {}

/// NaN is in no domain, because it compares with nothing.
fn within<T: Number>(is_within: impl Fn(&T) -> bool + Clone + Send + Sync + 'static, domain: String) -> impl Parser<T> {
    move |text: &str| match text.trim().parse() {
        Ok(value) if is_within(&value) => Ok(value),
        _ => Err(format!("give a number {domain}")),
    }
}

/// A number in an SI unit, or with one of `units` after it: `0.3`, `30cm`. The units are named with the longest name
/// first, and with how many of them make the SI unit.
pub fn with_unit(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let text = text.trim();
    let found = units.iter().find_map(|(unit, per_si)| Some((text.strip_suffix(unit)?, *per_si)));
    let (number, per_si) = found.unwrap_or((text, 1.0));
    Some(number.trim().parse::<f64>().ok()? / per_si)
}

/// An existing file, which may be a pipe.
pub fn file() -> impl TypedValueParser<Value = PathBuf> {
    existing("file", |path| !path.is_dir())
}

/// An existing folder.
pub fn folder() -> impl TypedValueParser<Value = PathBuf> {
    existing("folder", Path::is_dir)
}

/// An existing file or folder.
pub fn file_or_folder() -> impl TypedValueParser<Value = PathBuf> {
    existing("file or folder", |_| true)
}

/// A folder, or a path at which nothing exists yet.
pub fn new_folder() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path.exists() && !path.is_dir() {
        true => Err("this is a file; give a folder".to_owned()),
        false => Ok(path),
    })
}

/// The reason why there is no such `kind` of thing at `path`; `None` if there is one.
pub fn missing(path: &Path, kind: &str, is_kind: impl Fn(&Path) -> bool) -> Option<String> {
    match path.try_exists() {
        Ok(true) if is_kind(path) => None,
        Ok(true) => Some(format!("this is a {}; give a {kind}", if path.is_dir() { "folder" } else { "file" })),
        Ok(false) => Some(format!("no such {kind}")),
        Err(error) => Some(format!("cannot be checked: {error}")),
    }
}

fn existing(
    kind: &'static str,
    is_kind: impl Fn(&Path) -> bool + Clone + Send + Sync + 'static,
) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |path| missing(&path, kind, &is_kind).map_or(Ok(path.clone()), Err))
}
