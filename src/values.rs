//! Parsers of options' values: numbers within the domain that makes sense, files and folders that are there. What cannot be
//! used is refused before anything is done, with the option's name, wherever it was given: typed, or in `gprop.toml`.
//! Default values stand beside their options and nowhere else: [`defaults`].

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PathBufValueParser, TypedValueParser};

/// The options as a command line without any of them gives them.
pub fn defaults<T: clap::Args>() -> T {
    typed(&[]).expect("no option is required, and every default is a value of its option")
}

/// The options as a command line with `arguments` gives them.
///
/// # Errors
/// What clap says of an argument that is none, or of a value outside its domain.
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
    within(move |value: &T| *value >= low && *value < high, format!("from {low} to below {high}"))
}

/// What is counted, measured or shared.
pub trait Number: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static {}

impl<T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static> Number for T {}

/// A parser as clap takes it.
pub trait Parser<T>: Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static {}

impl<T, F: Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static> Parser<T> for F {}

/// NaN is in no domain, for it compares with nothing.
fn within<T: Number>(is_within: impl Fn(&T) -> bool + Clone + Send + Sync + 'static, domain: String) -> impl Parser<T> {
    move |text: &str| match text.trim().parse() {
        Ok(value) if is_within(&value) => Ok(value),
        _ => Err(format!("give a number {domain}")),
    }
}

/// A file that is there. A pipe serves as well.
pub fn file() -> impl TypedValueParser<Value = PathBuf> {
    existing("file", |path| !path.is_dir())
}

/// A folder that is there.
pub fn folder() -> impl TypedValueParser<Value = PathBuf> {
    existing("folder", Path::is_dir)
}

/// A file or folder that is there.
pub fn file_or_folder() -> impl TypedValueParser<Value = PathBuf> {
    existing("file or folder", |_| true)
}

/// A folder that is there or can be made.
pub fn new_folder() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path.exists() && !path.is_dir() {
        true => Err("this is a file; give a folder".to_owned()),
        false => Ok(path),
    })
}

/// Why there is no such `kind` of thing at `path`, if there is none.
pub fn missing(path: &Path, kind: &str, is_kind: impl Fn(&Path) -> bool) -> Option<String> {
    match path.try_exists() {
        Ok(true) if is_kind(path) => None,
        Ok(true) => Some(format!("this is a {}; give a {kind}", if path.is_dir() { "folder" } else { "file" })),
        Ok(false) => Some(format!("no such {kind}")),
        Err(error) => Some(format!("cannot look there: {error}")),
    }
}

fn existing(
    kind: &'static str,
    is_kind: impl Fn(&Path) -> bool + Clone + Send + Sync + 'static,
) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |path| missing(&path, kind, &is_kind).map_or(Ok(path.clone()), Err))
}
