//! The values that options accept: numbers within a sensible domain, files and folders that exist. Invalid values are
//! refused before anything is done, with the option's name, whether they were typed, set in `gprop.toml`, or come from a
//! caller of the library: a [`Domain`] parses what is typed, and each type of options has a `check` that applies the
//! same domains to its fields. Default values are defined only beside their options; [`defaults`] reads them from there.

use std::ffi::OsStr;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Arg, Command};

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

/// An option has a value that it does not accept.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{flag} is {value}: {remedy}")]
pub struct OptionError {
    /// As it is typed.
    pub flag: &'static str,
    pub value: String,
    /// The values that it accepts.
    pub remedy: String,
}

/// The numbers that an option accepts.
#[derive(Debug, Clone, Copy)]
pub struct Domain<T> {
    low: T,
    high: T,
    ends: Ends,
}

/// The ends of a domain that belong to it.
#[derive(Debug, Clone, Copy)]
enum Ends {
    Both,
    High,
    Low,
}

/// The numbers from `low` to `high`.
pub const fn from_to<T: Copy>(low: T, high: T) -> Domain<T> {
    Domain { low, high, ends: Ends::Both }
}

/// The numbers above `low`, up to `high`.
pub const fn above<T: Copy>(low: T, high: T) -> Domain<T> {
    Domain { low, high, ends: Ends::High }
}

/// The numbers from `low` up to but not including `high`.
pub const fn below<T: Copy>(low: T, high: T) -> Domain<T> {
    Domain { low, high, ends: Ends::Low }
}

/// A numeric type of an option's value.
pub trait Number: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static {}

impl<T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static> Number for T {}

impl<T: Number> Domain<T> {
    /// False for NaN, which compares with nothing.
    pub fn contains(&self, value: T) -> bool {
        let Self { low, high, ends } = *self;
        match ends {
            Ends::Both => low <= value && value <= high,
            Ends::High => low < value && value <= high,
            Ends::Low => low <= value && value < high,
        }
    }

    /// Checks the value of an option, if it has one.
    ///
    /// # Errors
    /// [`OptionError`] if the value is outside the domain.
    pub fn check(&self, flag: &'static str, value: impl Into<Option<T>>) -> Result<(), OptionError> {
        match value.into().filter(|value| !self.contains(*value)) {
            Some(value) => Err(OptionError { flag, value: value.to_string(), remedy: self.remedy() }),
            None => Ok(()),
        }
    }

    fn parse(&self, text: &str) -> Result<T, String> {
        let number = text.trim().parse().ok().filter(|number| self.contains(*number));
        number.ok_or_else(|| self.remedy())
    }

    fn remedy(&self) -> String {
        let Self { low, high, ends } = self;
        match ends {
            Ends::Both => format!("give a number from {low} to {high}"),
            Ends::High => format!("give a number above {low}, up to {high}"),
            Ends::Low => format!("give a number from {low} up to but not including {high}"),
        }
    }
}

impl<T: Number> TypedValueParser for Domain<T> {
    type Value = T;

    fn parse_ref(&self, command: &Command, argument: Option<&Arg>, value: &OsStr) -> Result<T, clap::Error> {
        let domain = *self;
        let parse = move |text: &str| domain.parse(text);
        TypedValueParser::parse_ref(&parse, command, argument, value)
    }
}

/// Checks the value of an option, if it has one, whose type is also that of what is typed: it has to survive being typed.
///
/// # Errors
/// [`OptionError`] if it does not.
pub fn check_typed<'a, T: FromStr<Err = String> + Display + 'a>(
    flag: &'static str,
    value: impl Into<Option<&'a T>>,
) -> Result<(), OptionError> {
    let Some(value) = value.into().map(ToString::to_string) else { return Ok(()) };
    match value.parse::<T>() {
        Ok(_) => Ok(()),
        Err(remedy) => Err(OptionError { flag, value, remedy }),
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
    PathBufValueParser::new().try_map(|path| {
        if path.exists() && !path.is_dir() { Err("this is a file; give a folder".to_owned()) } else { Ok(path) }
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
