//! The two configuration files: `gprop.toml` in a scene's folder, and the user's own `config.toml`. A key is the long
//! name of a flag. The command line takes precedence over the scene's file, which takes precedence over the user's.
//!
//! Both files are turned into flags that are inserted before those on the command line, so every option has one
//! definition, one default and one check, wherever it is set. A switch has no flag that turns it off, so one that the
//! scene's file sets to false is [removed](FileFlags::yield_to) from those of the user.
//!
//! Beside `gprop.toml` may lie a file with corrections of parts alone, which the report writes: a file that is only saved
//! cannot clash with what another file says of the same part.
//!
//! A scene folder may come from anyone, so its file is treated as data and not as a program: each stage lists beside
//! its options the [keys that a scene may set](SceneKey), and any other key is refused. Paths are relative to the file
//! that names them; those of a scene must stay inside its folder.

pub mod as_typed;
pub mod option_values;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::{Component, Path, PathBuf};

use serde::{Serialize, Serializer};
use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::files::read_scope::ReadScope;

/// Name of the file in the scene folder.
pub const FILE_NAME: &str = "gprop.toml";

/// The table whose tables correct parts: `[part.head]` with `material = "steel"` means `--correct head.material=steel`.
const CORRECTED_PART: &str = "part";

/// The flag for one correction.
const CORRECTION: &str = "correct";

/// Path of the user's file, for display.
pub const USER_FILE: &str = "~/.config/gprop/config.toml";

/// Errors in a configuration file.
#[derive(Debug, Error)]
pub enum ConfigError {
    #[error("cannot read {path:?}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path:?} line {line}: {message}")]
    Syntax { path: PathBuf, line: usize, message: String },
    #[error(
        "{path:?} line {line}: unknown key `{key}`; keys are `threads` and the long flags of `gprop run --help-all` from \"Presets\" on{hint}"
    )]
    UnknownKey { path: PathBuf, line: usize, key: String, hint: String },
    #[error(
        "{path:?} line {line}: a scene may not set `{key}`{allowed}, because a scene folder is data and may come from \
         anyone; if you want it, give --{flag} on the command line or write it into {USER_FILE} instead"
    )]
    NotForScenes { path: PathBuf, line: usize, key: String, allowed: String, flag: String },
    #[error(
        "{path:?} line {line}: `{key}` leads out of the scene folder, to {leads_to:?}; a scene may only name files of its own, \
         relative to its folder; to use this one, give --{flag} on the command line instead"
    )]
    OutsideScene { path: PathBuf, line: usize, key: String, flag: String, leads_to: PathBuf },
    #[error("{path:?} line {line}: `{key}` takes a string, a number, true, false or a list of these")]
    BadValue { path: PathBuf, line: usize, key: String },
    #[error(
        "{path:?} line {line}: `{key}` corrects a part: give it a table with keys such as material = \"steel\" or wall = \"3mm\""
    )]
    NoCorrection { path: PathBuf, line: usize, key: String },
    #[error(
        "{path:?} line {line}: `{key}` is no correction; this file holds only tables such as [part.head], and other options \
         belong in {FILE_NAME}"
    )]
    OnlyCorrections { path: PathBuf, line: usize, key: String },
    #[error("{path:?} line {line}: `{key}` takes one string or number")]
    NotOneValue { path: PathBuf, line: usize, key: String },
    #[error("{path:?} line {line}: {problem}")]
    InvalidValue { path: PathBuf, line: usize, problem: String },
    #[error(
        "{path:?} line {line}: `{key}` is already set on line {earlier}; tables only group keys, and `_` means the same as \
         `-`, so set it only once"
    )]
    Twice { path: PathBuf, line: usize, key: String, earlier: usize },
    #[error(
        "{path:?}: the last run had {flag}, which gprop does not take from a scene's work folder, because that may come from \
         anyone; give --{name} again, name the work folder with {option}, or start afresh with --fresh"
    )]
    NotFromLastRun { path: PathBuf, flag: String, name: String, option: &'static str },
    #[error("{path:?}: the options of the last run cannot be used again: {problem}; start afresh with --fresh")]
    LastRun { path: PathBuf, problem: String },
}

/// The values that a scene may give to a key.
#[derive(Debug, Clone, Copy)]
pub enum SceneValue {
    /// Anything that the option takes.
    Any,
    /// Those for which the function is true; `allowed` describes them, for the message about any other.
    AnyOf { is_allowed: fn(&str) -> bool, allowed: &'static str },
    /// A path inside the scene folder.
    Path,
    /// A name for which the function is true, or else a path inside the scene folder.
    NameOrPath(fn(&str) -> bool),
}

/// A key that a scene may set.
#[derive(Debug, Clone, Copy)]
pub struct SceneKey {
    /// The long name of the flag.
    pub name: &'static str,
    pub value: SceneValue,
}

impl SceneKey {
    /// A key with any value that its option takes.
    pub const fn any(name: &'static str) -> Self {
        Self { name, value: SceneValue::Any }
    }

    /// A key with any value for which `is_allowed` is true; `allowed` describes these values in a few words.
    pub const fn with(name: &'static str, is_allowed: fn(&str) -> bool, allowed: &'static str) -> Self {
        Self { name, value: SceneValue::AnyOf { is_allowed, allowed } }
    }

    /// A key with a path inside the scene folder as its value.
    pub const fn path(name: &'static str) -> Self {
        Self { name, value: SceneValue::Path }
    }

    /// A key whose value is a name for which `is_name` is true, or a path inside the scene folder.
    pub const fn name_or_path(name: &'static str, is_name: fn(&str) -> bool) -> Self {
        Self { name, value: SceneValue::NameOrPath(is_name) }
    }
}

/// A flag that a file may set.
#[derive(Debug, Clone, Default)]
pub struct Flag {
    /// Without the dashes.
    pub name: String,
    /// False for a switch, which takes no value.
    pub takes_value: bool,
    /// A list becomes one flag per item, instead of one flag with commas.
    pub repeats: bool,
    /// Its value is always a path.
    pub is_path: bool,
    /// The values that a scene may give it; `None` if only the user may set it.
    pub scene: Option<SceneValue>,
    /// The field of the pipeline's options to which it belongs, such as `segment`.
    pub field: &'static str,
}

/// Why a scene may not give a value to a flag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// Only the user may set this flag.
    NotForScenes,
    /// Only the user may set it to this value; a scene may set it to those that are described here.
    OtherValuesOnly(&'static str),
    /// It leads out of the scene's folder, to this path.
    LeadsTo(PathBuf),
}

impl Flag {
    /// True if `value` is the path of a file or folder.
    pub fn is_path(&self, value: &str) -> bool {
        match self.scene {
            Some(SceneValue::NameOrPath(is_name)) => !is_name(value),
            Some(SceneValue::Path) => true,
            _ => self.is_path,
        }
    }

    /// `--name=value`; a path is joined to `folder`, the scene's folder if the owner is a scene.
    ///
    /// # Errors
    /// If a scene may not set it, or not to this value.
    pub fn set_to(&self, value: &str, folder: &Path, owner: Owner) -> Result<OsString, Refusal> {
        if owner == Owner::Scene {
            match self.scene {
                None => return Err(Refusal::NotForScenes),
                Some(SceneValue::AnyOf { is_allowed, allowed }) if !is_allowed(value) => {
                    return Err(Refusal::OtherValuesOnly(allowed));
                }
                Some(_) => {}
            }
        }
        let mut text = OsString::from(format!("--{}=", self.name));
        if !self.is_path(value) {
            text.push(value);
            return Ok(text);
        }
        if owner == Owner::Scene
            && let Some(leads_to) = leads_out_of_scene(folder, value)
        {
            return Err(Refusal::LeadsTo(leads_to));
        }
        text.push(folder.join(value));
        Ok(text)
    }
}

/// The owner of a configuration file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Owner {
    Scene,
    User,
}

/// The user's file: `$XDG_CONFIG_HOME/gprop/config.toml`, else `~/.config/gprop/config.toml`; `None` if neither
/// XDG_CONFIG_HOME nor HOME is set.
pub fn user_file() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    // The XDG base directory specification: a relative path is invalid and ignored.
    let base = set("XDG_CONFIG_HOME").filter(|path| path.is_absolute());
    let base = base.or_else(|| set("HOME").map(|home| home.join(".config")));
    base.map(|base| base.join("gprop/config.toml"))
}

/// The flags of one file, or of several.
#[derive(Debug, Clone, Default)]
pub struct FileFlags {
    pub flags: Vec<OsString>,
    /// The switches that the file turns off.
    off: Vec<String>,
    /// The place of each key, by the name of its flag; of a correction, by all of its flag without dashes.
    places: BTreeMap<String, Place>,
}

/// A line of a file.
#[derive(Debug, Clone)]
struct Place {
    path: PathBuf,
    line: usize,
}

impl FileFlags {
    /// Removes the switches that `other`, which takes precedence, turns off.
    pub fn yield_to(&mut self, other: &Self) {
        self.flags.retain(|flag| !other.off.iter().any(|off| off == name_of(flag)));
    }

    /// Adds the flags of another file, which take precedence.
    pub fn then(mut self, other: Self) -> Self {
        self.flags.extend(other.flags);
        self.off.extend(other.off);
        self.places.extend(other.places);
        self
    }

    /// The error for the first flag that has a problem with its value.
    pub fn invalid_value(&self, problem_with: &dyn Fn(&OsString) -> Option<String>) -> Option<ConfigError> {
        self.flags.iter().find_map(|flag| {
            let problem = problem_with(flag)?;
            let of_one = flag.to_str().and_then(|flag| self.places.get(flag.trim_start_matches('-')));
            let Place { path, line } = of_one.or_else(|| self.places.get(name_of(flag)))?.clone();
            Some(ConfigError::InvalidValue { path, line, problem })
        })
    }
}

/// The flags for `gprop.toml` in the folder `scene`; none if there is no such file.
///
/// # Errors
/// [`ConfigError`] names the file, the line and the key.
pub fn flags_of_scene(scene: &Path, known: &[Flag]) -> Result<FileFlags, ConfigError> {
    flags(&scene.join(FILE_NAME), Owner::Scene, known)
}

/// The flags for the corrections in the file at `path`, which belongs to a scene and may hold nothing else; none if there
/// is no such file.
///
/// # Errors
/// [`ConfigError`] names the file, the line and the key.
pub fn flags_of_corrections(path: &Path, known: &[Flag]) -> Result<FileFlags, ConfigError> {
    let Some(text) = text_of(path)? else { return Ok(FileFlags::default()) };
    let table = parsed(&text, path)?;
    let (reader, mut found) = (Reader { path, text: &text, owner: Owner::Scene, known }, FileFlags::default());
    for (key, value) in table.get_ref() {
        let line = line_of(&text, key.span().start);
        match value.get_ref() {
            DeValue::Table(parts) if key.get_ref() == CORRECTED_PART => {
                reader.collect_corrections(parts, &mut found)?;
            }
            _ => {
                let key = key.get_ref().to_string();
                return Err(ConfigError::OnlyCorrections { path: path.to_owned(), line, key });
            }
        }
    }
    Ok(found)
}

/// The flags for the user's file at `path`; none if there is no such file.
///
/// # Errors
/// [`ConfigError`] names the file, the line and the key.
pub fn flags_of_user(path: &Path, known: &[Flag]) -> Result<FileFlags, ConfigError> {
    flags(path, Owner::User, known)
}

fn flags(path: &Path, owner: Owner, known: &[Flag]) -> Result<FileFlags, ConfigError> {
    text_of(path)?.map_or_else(|| Ok(FileFlags::default()), |text| flags_in(&text, path, owner, known))
}

/// The content of a file; `None` if there is none.
fn text_of(path: &Path) -> Result<Option<String>, ConfigError> {
    match crate::files::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if matches!(error.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory) => {
            Ok(None)
        }
        Err(source) => Err(ConfigError::Read { path: path.to_owned(), source }),
    }
}

fn parsed<'a>(text: &'a str, path: &Path) -> Result<Spanned<DeTable<'a>>, ConfigError> {
    DeTable::parse(text).map_err(|error| ConfigError::Syntax {
        path: path.to_owned(),
        line: error.span().map_or(1, |span| line_of(text, span.start)),
        message: error.message().to_owned(),
    })
}

/// The flags for `text`, treated as the content of the file at `path`. Tables only group keys for the reader and have
/// no meaning, except for those that correct parts.
///
/// # Errors
/// [`ConfigError`] names the file, the line and the key.
pub fn flags_in(text: &str, path: &Path, owner: Owner, known: &[Flag]) -> Result<FileFlags, ConfigError> {
    let (table, mut found) = (parsed(text, path)?, FileFlags::default());
    Reader { path, text, owner, known }.collect(table.get_ref(), &mut found)?;
    Ok(found)
}

struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
    owner: Owner,
    known: &'a [Flag],
}

impl Reader<'_> {
    /// Adds the flags of a table.
    fn collect(&self, table: &DeTable, found: &mut FileFlags) -> Result<(), ConfigError> {
        for (key, value) in table {
            if let DeValue::Table(group) = value.get_ref() {
                if key.get_ref() == CORRECTED_PART {
                    self.collect_corrections(group, found)?;
                } else {
                    self.collect(group, found)?;
                }
                continue;
            }
            let name = key.get_ref().replace('_', "-");
            let line = line_of(self.text, key.span().start);
            let Some(flag) = self.known.iter().find(|flag| flag.name == name) else {
                return Err(self.unknown_key(key.get_ref(), &name, line));
            };
            if self.owner == Owner::Scene && flag.scene.is_none() {
                let (path, key) = (self.path.to_owned(), key.get_ref().to_string());
                return Err(ConfigError::NotForScenes { path, line, key, allowed: String::new(), flag: name });
            }
            // A table's keys come in the order of their names.
            if let Some(other) = found.places.insert(name.clone(), self.place(line)) {
                let (path, earlier) = (self.path.to_owned(), line.min(other.line));
                return Err(ConfigError::Twice { path, line: line.max(other.line), key: name, earlier });
            }
            let bad_value =
                || ConfigError::BadValue { path: self.path.to_owned(), line, key: key.get_ref().to_string() };
            match (value.get_ref(), flag.takes_value) {
                (DeValue::Boolean(true), false) => found.flags.push(format!("--{name}").into()),
                (DeValue::Boolean(false), false) => found.off.push(name),
                (DeValue::Array(items), true) if flag.repeats => {
                    for item in items {
                        let value = scalar(item.get_ref()).ok_or_else(bad_value)?;
                        found.flags.push(self.flag(flag, &value, key.get_ref(), line)?);
                    }
                }
                (value, true) => {
                    let value = scalar(value).ok_or_else(bad_value)?;
                    found.flags.push(self.flag(flag, &value, key.get_ref(), line)?);
                }
                _ => return Err(bad_value()),
            }
        }
        Ok(())
    }

    /// Adds a flag `--correct=PART.KEY=VALUE` for each key of each part.
    fn collect_corrections(&self, parts: &DeTable, found: &mut FileFlags) -> Result<(), ConfigError> {
        for (part, keys) in parts {
            let line = line_of(self.text, part.span().start);
            let (path, shown) = (self.path, format!("{CORRECTED_PART}.{}", part.get_ref()));
            let no_table = |line| ConfigError::NoCorrection { path: path.to_owned(), line, key: shown.clone() };
            let DeValue::Table(keys) = keys.get_ref() else { return Err(no_table(line)) };
            let corrects = self.known.iter().find(|flag| flag.name == CORRECTION).ok_or_else(|| no_table(line))?;
            for (key, value) in keys {
                let line = line_of(self.text, key.span().start);
                let key_of_part = format!("{shown}.{}", key.get_ref());
                let value = scalar(value.get_ref());
                let value =
                    value.ok_or_else(|| ConfigError::NotOneValue { path: path.to_owned(), line, key: key_of_part })?;
                let text = format!("{}.{}={value}", part.get_ref(), key.get_ref());
                found.places.insert(format!("{CORRECTION}={text}"), self.place(line));
                found.flags.push(self.flag(corrects, &text, key.get_ref(), line)?);
            }
        }
        Ok(())
    }

    fn place(&self, line: usize) -> Place {
        Place { path: self.path.to_owned(), line }
    }

    /// `--name=value`; a path is joined to the folder of the file.
    fn flag(&self, flag: &Flag, value: &str, key: &str, line: usize) -> Result<OsString, ConfigError> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        flag.set_to(value, folder, self.owner).map_err(|refusal| {
            let (path, flag) = (self.path.to_owned(), flag.name.clone());
            match refusal {
                Refusal::NotForScenes => {
                    ConfigError::NotForScenes { path, line, key: key.to_owned(), allowed: String::new(), flag }
                }
                Refusal::OtherValuesOnly(allowed) => {
                    let (key, allowed) = (format!("{key} = {value}"), format!(" (allowed: {allowed})"));
                    ConfigError::NotForScenes { path, line, key, allowed, flag }
                }
                Refusal::LeadsTo(leads_to) => {
                    ConfigError::OutsideScene { path, line, key: key.to_owned(), flag, leads_to }
                }
            }
        })
    }

    fn unknown_key(&self, key: &str, name: &str, line: usize) -> ConfigError {
        let may_set = |flag: &&Flag| self.owner == Owner::User || flag.scene.is_some();
        let mut names = self.known.iter().filter(may_set).map(|flag| flag.name.as_str());
        let near = names.find(|known| known.contains(name) || name.contains(known));
        ConfigError::UnknownKey {
            path: self.path.to_owned(),
            line,
            key: key.to_owned(),
            hint: near.map(|near| format!(" (did you mean `{near}`?)")).unwrap_or_default(),
        }
    }
}

/// The target of a path in a scene's file if the path is absolute, goes up with `..`, or meets a link that leaves the
/// folder `scene`.
fn leads_out_of_scene(scene: &Path, value: &str) -> Option<PathBuf> {
    // Windows' separators and drives have no meaning here, but the scene may be opened on Windows later.
    let plain = value.replace('\\', "/");
    let climbs = Path::new(&plain).components().any(|part| !matches!(part, Component::Normal(_) | Component::CurDir));
    if climbs || plain.as_bytes().get(1) == Some(&b':') {
        return Some(PathBuf::from(value));
    }
    ReadScope::new(scene).leads_out_below(&scene.join(value)).map(|(_, real)| real)
}

/// A value as it would be typed; a list as its items separated by commas.
fn scalar(value: &DeValue) -> Option<String> {
    match value {
        DeValue::Boolean(on) => Some(on.to_string()),
        DeValue::String(text) => Some(text.to_string()),
        DeValue::Integer(number) if number.radix() == 10 => Some(number.as_str().to_owned()),
        DeValue::Integer(number) => Some(u64::from_str_radix(number.as_str(), number.radix()).ok()?.to_string()),
        DeValue::Float(number) => Some(number.as_str().to_owned()),
        DeValue::Array(items) => {
            let items: Option<Vec<_>> = items.iter().map(|item| scalar(item.get_ref())).collect();
            Some(items?.join(","))
        }
        _ => None,
    }
}

/// The name of the flag in `--name=value`.
pub fn name_of(flag: &OsStr) -> &str {
    let bytes = flag.as_encoded_bytes();
    let name = bytes.split(|byte| *byte == b'=').next().unwrap_or_default();
    std::str::from_utf8(name).unwrap_or_default().trim_start_matches('-')
}

/// The value in `--name=value`; `None` for a switch.
pub fn value_of(flag: &OsStr) -> Option<&OsStr> {
    let bytes = flag.as_bytes();
    let equals = bytes.iter().position(|byte| *byte == b'=')?;
    Some(OsStr::from_bytes(&bytes[equals + 1..]))
}

/// A path that means the same whatever the current folder is: relative to `folder` if it is inside it, else absolute.
pub fn portable(path: &Path, folder: &Path) -> PathBuf {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| absolute(path));
    match real(path).strip_prefix(real(folder)) {
        Ok(inside) if inside == OsStr::new("") => PathBuf::from("."),
        Ok(inside) => inside.to_owned(),
        Err(_) => absolute(path),
    }
}

/// A path as JSON, which has only Unicode, can show it. If that is not the path itself, it is only for people to read.
pub(crate) fn in_json(path: &Path) -> Cow<'_, str> {
    path.to_string_lossy()
}

/// Serializes a path, if there is one, [for JSON](in_json).
pub(crate) fn serialize_path<'a, S: Serializer>(
    path: impl Into<Option<&'a PathBuf>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    path.into().map(|path| in_json(path)).serialize(serializer)
}

fn line_of(text: &str, byte: usize) -> usize {
    text[..byte].bytes().filter(|&b| b == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<Flag> {
        let value = |name: &str, scene| Flag { name: name.into(), takes_value: true, scene, ..Flag::default() };
        vec![
            value("views", Some(SceneValue::Any)),
            value("view-list", Some(SceneValue::Any)),
            value("crop", Some(SceneValue::Any)),
            Flag { name: "turntable".into(), scene: Some(SceneValue::Any), ..Flag::default() },
            Flag { repeats: true, ..value("anchor", Some(SceneValue::Any)) },
            Flag { repeats: true, ..value("correct", Some(SceneValue::Any)) },
            Flag { is_path: true, ..value("images", Some(SceneValue::Path)) },
            value("gripper", Some(SceneValue::NameOrPath(|name| name == "paper"))),
            Flag { is_path: true, ..value("ort-lib", None) },
        ]
    }

    fn flags_of(text: &str) -> Result<Vec<OsString>, ConfigError> {
        flags_in(text, Path::new("S/gprop.toml"), Owner::Scene, &known()).map(|file| file.flags)
    }

    #[test]
    fn keys_become_flags() {
        let cases: [(&str, &[&str]); 14] = [
            ("views = 5", &["--views=5"]),
            ("views = 1_0", &["--views=10"]),
            ("views = 0x1F", &["--views=31"]),
            ("views = 0o17", &["--views=15"]),
            ("views = [0b101, 2]", &["--views=5,2"]),
            ("view_list = [\"003\", \"022\"]", &["--view-list=003,022"]),
            ("anchor = [\"lid\", \"base, left\"]", &["--anchor=lid", "--anchor=base, left"]),
            ("[segment]\ncrop = false", &["--crop=false"]),
            ("turntable = true", &["--turntable"]),
            ("turntable = false", &[]),
            ("images = \"photos\"", &["--images=S/photos"]),
            ("gripper = \"paper\"", &["--gripper=paper"]),
            ("gripper = \"./hand.toml\"", &["--gripper=S/./hand.toml"]),
            (
                "[part.\"hammer head\"]\nmaterial = \"steel\"\n[part.2]\nwall = \"3mm\"",
                &["--correct=2.wall=3mm", "--correct=hammer head.material=steel"],
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(flags_of(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, words) in [
            ("\nviewz = 5", "line 2: unknown key `viewz`"),
            ("turntable = 3", "line 1: `turntable` takes"),
            ("views = 1979-05-27", "line 1: `views` takes"),
            ("views = 5\n[scene]\nviews = 7", "line 3: `views` is already set on line 1"),
            ("view_list = \"a\"\nview-list = \"b\"", "line 2: `view-list` is already set on line 1"),
            ("[part]\nhead = \"steel\"", "line 2: `part.head` corrects a part"),
            ("views = ", "line 1: "),
            ("\n[setup]\nort_lib = \"lib.so\"", "line 3: a scene may not set `ort_lib`"),
            ("images = \"/photos\"", "line 1: `images` leads out of the scene folder, to \"/photos\""),
            ("images = \"a/../../photos\"", "line 1: `images` leads out of the scene folder"),
            ("images = 'C:\\photos'", "line 1: `images` leads out of the scene folder"),
            ("gripper = \"../hand.toml\"", "line 1: `gripper` leads out of the scene folder"),
        ] {
            let message = flags_of(text).unwrap_err().to_string();
            assert!(message.contains(words), "{text}: {message}");
        }
    }

    #[test]
    fn the_users_file_may_set_anything() {
        let of_user = |text| flags_in(text, Path::new("/home/me/config.toml"), Owner::User, &known());
        let flags = |text| of_user(text).map(|file| file.flags);
        assert_eq!(flags("ort-lib = \"x.so\"").unwrap(), ["--ort-lib=/home/me/x.so"]);
        assert_eq!(flags("images = \"/data\"\ngripper = \"hand.toml\"").unwrap().len(), 2);
        assert!(flags("ort-libb = \"x\"").unwrap_err().to_string().contains("did you mean `ort-lib`?"));
    }

    #[test]
    fn a_scene_turns_off_what_the_user_turned_on() {
        let file = |text, owner| flags_in(text, Path::new("S/gprop.toml"), owner, &known()).unwrap();
        let mut user = file("turntable = true\nviews = 5", Owner::User);
        user.yield_to(&file("views = 6", Owner::Scene));
        assert_eq!(user.flags, ["--turntable", "--views=5"]);
        user.yield_to(&file("turntable = false", Owner::Scene));
        assert_eq!(user.flags, ["--views=5"]);
    }
}
