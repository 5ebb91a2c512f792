//! `gprop.toml`: the options of a scene, beside it. A key is the long name of a flag; the command line wins.
//!
//! The file is turned into flags that stand before those the user typed, so every option has one definition, one
//! default and one check, whether it was typed or written.

use std::path::{Path, PathBuf};

use thiserror::Error;
use toml::de::{DeTable, DeValue};

/// Name of the file in the scene folder.
pub const FILE_NAME: &str = "gprop.toml";

/// What can be wrong with `gprop.toml`.
#[derive(Debug, Error)]
pub enum ConfigError {
    #[error("cannot read {path:?}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path:?} line {line}: {message}")]
    Syntax { path: PathBuf, line: usize, message: String },
    #[error("{path:?} line {line}: unknown key `{key}`; keys are the long flags of `gprop run --help`{hint}")]
    UnknownKey { path: PathBuf, line: usize, key: String, hint: String },
    #[error("{path:?} line {line}: `{key}` takes a text, a number, true, false or a list of these")]
    BadValue { path: PathBuf, line: usize, key: String },
}

/// A flag that a scene may set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flag {
    /// Without the dashes.
    pub name: String,
    /// False for a switch, which stands alone.
    pub takes_value: bool,
}

/// The flags that `gprop.toml` in `scene` stands for; none where there is no such file. Tables group keys for the reader
/// and mean nothing.
pub fn flags(scene: &Path, known: &[Flag]) -> Result<Vec<String>, ConfigError> {
    let path = scene.join(FILE_NAME);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if matches!(error.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory) => {
            return Ok(Vec::new());
        }
        Err(source) => return Err(ConfigError::Read { path, source }),
    };
    flags_in(&text, &path, known)
}

/// The flags that `text` stands for; errors name `path`.
pub fn flags_in(text: &str, path: &Path, known: &[Flag]) -> Result<Vec<String>, ConfigError> {
    let table = DeTable::parse(text).map_err(|error| ConfigError::Syntax {
        path: path.to_owned(),
        line: error.span().map_or(1, |span| line_of(text, span.start)),
        message: error.message().to_owned(),
    })?;
    let mut flags = Vec::new();
    Reader { path, text, known }.collect(table.get_ref(), &mut flags)?;
    Ok(flags)
}

struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
    known: &'a [Flag],
}

impl Reader<'_> {
    fn collect(&self, table: &DeTable, flags: &mut Vec<String>) -> Result<(), ConfigError> {
        for (key, value) in table {
            if let DeValue::Table(group) = value.get_ref() {
                self.collect(group, flags)?;
                continue;
            }
            let name = key.get_ref().replace('_', "-");
            let line = line_of(self.text, key.span().start);
            let Some(flag) = self.known.iter().find(|flag| flag.name == name) else {
                return Err(self.unknown_key(key.get_ref(), &name, line));
            };
            match (value.get_ref(), flag.takes_value) {
                (DeValue::Boolean(on), false) => flags.extend(on.then(|| format!("--{name}"))),
                (value, true) if let Some(text) = scalar(value) => flags.push(format!("--{name}={text}")),
                _ => return Err(self.bad_value(key.get_ref(), line)),
            }
        }
        Ok(())
    }

    fn bad_value(&self, key: &str, line: usize) -> ConfigError {
        ConfigError::BadValue { path: self.path.to_owned(), line, key: key.to_owned() }
    }

    fn unknown_key(&self, key: &str, name: &str, line: usize) -> ConfigError {
        let names = || self.known.iter().map(|flag| flag.name.as_str());
        let near = names().find(|known| known.contains(name) || name.contains(known));
        ConfigError::UnknownKey {
            path: self.path.to_owned(),
            line,
            key: key.to_owned(),
            hint: near.map(|near| format!(" (did you mean `{near}`?)")).unwrap_or_default(),
        }
    }
}

/// A value as it would be typed; a list as its items between commas.
fn scalar(value: &DeValue) -> Option<String> {
    match value {
        DeValue::Boolean(on) => Some(on.to_string()),
        DeValue::String(text) => Some(text.to_string()),
        DeValue::Integer(number) => Some(number.as_str().to_owned()),
        DeValue::Float(number) => Some(number.as_str().to_owned()),
        DeValue::Array(items) => {
            let items: Option<Vec<_>> = items.iter().map(|item| scalar(item.get_ref())).collect();
            Some(items?.join(","))
        }
        _ => None,
    }
}

fn line_of(text: &str, byte: usize) -> usize {
    text[..byte].bytes().filter(|&b| b == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags_of(text: &str) -> Result<Vec<String>, ConfigError> {
        let scene = tempfile::tempdir().unwrap();
        std::fs::write(scene.path().join(FILE_NAME), text).unwrap();
        let flag = |(name, takes_value): (&str, bool)| Flag { name: name.to_owned(), takes_value };
        flags(scene.path(), &[("views", true), ("view-list", true), ("crop", true), ("offline", false)].map(flag))
    }

    #[test]
    fn keys_become_flags() {
        let cases: [(&str, &[&str]); 6] = [
            ("views = 5", &["--views=5"]),
            ("view_list = [\"003\", \"022\"]", &["--view-list=003,022"]),
            ("[segment]\ncrop = false", &["--crop=false"]),
            ("offline = true", &["--offline"]),
            ("offline = false", &[]),
            ("", &[]),
        ];
        for (text, expected) in cases {
            assert_eq!(flags_of(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, words) in [
            ("\nviewz = 5", "line 2: unknown key `viewz`"),
            ("offline = 3", "line 1: `offline` takes"),
            ("views = 1979-05-27", "line 1: `views` takes"),
            ("views = ", "line 1: "),
        ] {
            let message = flags_of(text).unwrap_err().to_string();
            assert!(message.contains(words), "{text}: {message}");
        }
    }
}
