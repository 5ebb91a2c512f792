//! A tool's arguments as the words of a command line. What a tool may set of a scene's options is what a scene's own
//! `gprop.toml` may set: neither code, servers, keys and prices, nor files outside the scene.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Arg;
use serde_json::{Map, Value};

use crate::cli::option_types::{self, takes_several};
use crate::config::{Flag, Owner, Refusal};
use crate::mcp::{Refused, Roots};
use crate::pipeline::known_flags;
use crate::scene;
use crate::scene::mesh::containers::is_robot;

use super::tools::{Kind, OPTIONS, On, Tool};

/// A command line.
#[derive(Debug)]
pub struct Words {
    command: Vec<OsString>,
    pub flags: Vec<OsString>,
    /// Paths without links, inside the roots; or a name.
    positionals: Vec<OsString>,
    /// Whether it is about a URDF or MJCF.
    pub is_robot_file: bool,
}

impl Words {
    /// The words for a tool with these arguments, which follow its schema.
    ///
    /// # Errors
    /// If a path leads out of the roots, or an option is not for tools to set.
    pub fn of(tool: &Tool, arguments: &Map<String, Value>, roots: &Roots) -> Result<Self, Refused> {
        let texts = |name: &str| -> Vec<&str> {
            match arguments.get(name) {
                Some(Value::Array(items)) => items.iter().filter_map(Value::as_str).collect(),
                given => given.and_then(Value::as_str).into_iter().collect(),
            }
        };
        let mut command: Vec<OsString> = tool.command.iter().map(OsString::from).collect();
        let mut names = Vec::new();
        let on = match tool.kind {
            Kind::Command { on } => on,
            Kind::Questions | Kind::Answers => Some(On::Scene),
        };
        let mut paths = Vec::new();
        match on {
            Some(On::Scene) => paths = resolved(roots, &texts("scene"))?,
            Some(On::Paths) => paths = resolved(roots, &texts("paths"))?,
            Some(On::Material) => match texts("name").as_slice() {
                [name, ..] => {
                    command.push("show".into());
                    names.push(as_word("name", name)?);
                }
                [] => command.push("list".into()),
            },
            None => {}
        }
        let folder = paths.first().map(|scene| scene::home(scene)).unwrap_or_default();
        let setter = Setter { known: known_flags(), folder, roots };
        let mut flags = Vec::new();
        for flag in &tool.flags {
            let name = flag.get_long().unwrap_or_default();
            if let Some(value) = arguments.get(name) {
                flags.extend(setter.flags_of(flag, name, value)?);
            }
        }
        for (name, value) in arguments.get(OPTIONS).and_then(Value::as_object).into_iter().flatten() {
            flags.extend(setter.option(name, value)?);
        }
        let takes_answers = on == Some(On::Scene) && !["inspect", "objects"].contains(&tool.name);
        if takes_answers && !arguments.get("answers").is_some_and(Value::is_string) {
            flags.push("--answers=replay".into());
        }
        let is_robot_file = on == Some(On::Scene) && paths.first().is_some_and(|path| is_robot(path));
        let positionals = paths.into_iter().map(PathBuf::into_os_string).chain(names).collect();
        Ok(Self { command, flags, positionals, is_robot_file })
    }

    /// The command line, with more flags.
    pub fn line(&self, more: &[OsString]) -> Vec<OsString> {
        [&self.command[..], &self.flags, more, &["--".into()], &self.positionals].concat()
    }

    /// The same with another command.
    pub fn with_command(&self, command: &str) -> Self {
        let (flags, positionals) = (self.flags.clone(), self.positionals.clone());
        Self { command: vec![command.into()], flags, positionals, is_robot_file: self.is_robot_file }
    }
}

fn resolved(roots: &Roots, given: &[&str]) -> Result<Vec<PathBuf>, Refused> {
    let existing = |given: &&str| {
        let path = roots.resolve(given)?;
        if path.exists() { Ok(path) } else { Err(Refused::params(format!("there is no {given:?}"))) }
    };
    given.iter().map(existing).collect()
}

/// Turns values into flags.
struct Setter<'a> {
    known: Vec<Flag>,
    folder: PathBuf,
    roots: &'a Roots,
}

impl Setter<'_> {
    /// The flags for one of the options of a tool.
    fn flags_of(&self, flag: &Arg, name: &str, value: &Value) -> Result<Vec<OsString>, Refused> {
        match (option_types::Kind::of(flag), value) {
            (option_types::Kind::Switch, value) => {
                Ok((*value == Value::Bool(true)).then(|| format!("--{name}").into()).into_iter().collect())
            }
            (option_types::Kind::Path, Value::String(path)) if !self.is_of_scene(name) => {
                let mut text = OsString::from(format!("--{name}="));
                text.push(self.roots.resolve(path)?);
                Ok(vec![text])
            }
            _ if self.is_of_scene(name) => self.option(name, value),
            _ => values(value, takes_several(flag) && flag.get_value_delimiter().is_none())
                .iter()
                .map(|value| as_word(name, &format!("--{name}={value}")))
                .collect(),
        }
    }

    fn is_of_scene(&self, name: &str) -> bool {
        self.known.iter().any(|flag| flag.name == name && flag.scene.is_some())
    }

    /// The flags for an option that a scene may set.
    fn option(&self, name: &str, value: &Value) -> Result<Vec<OsString>, Refused> {
        let name = name.replace('_', "-");
        let flag = self.known.iter().find(|flag| flag.name == name && flag.scene.is_some());
        let flag = flag.ok_or_else(|| {
            Refused::params(format!(
                "{name:?} is no option that a tool may set: those are the ones that gprop.toml may set"
            ))
        })?;
        match value {
            Value::Bool(is_set) if !flag.takes_value => {
                Ok(is_set.then(|| format!("--{name}").into()).into_iter().collect())
            }
            _ if !flag.takes_value => Err(Refused::params(format!("{name} is true or false"))),
            value => values(value, flag.repeats).iter().map(|value| self.set(flag, value)).collect(),
        }
    }

    fn set(&self, flag: &Flag, value: &str) -> Result<OsString, Refused> {
        as_word(&flag.name, value)?;
        let name = &flag.name;
        flag.set_to(value, Path::new(&self.folder), Owner::Scene).map_err(|refusal| {
            Refused::params(match refusal {
                Refusal::NotForScenes => format!("only the user may set {name}"),
                Refusal::OtherValuesOnly(allowed) => {
                    format!("only the user may set {name} to {value:?}; a tool may set it to {allowed}")
                }
                Refusal::LeadsTo(path) => {
                    format!("{name} leads out of the scene's folder, to {path:?}; name a file of the scene, relative to its folder")
                }
            })
        })
    }
}

/// A word of a command line.
fn as_word(name: &str, text: &str) -> Result<OsString, Refused> {
    if text.contains('\0') { Err(Refused::params(format!("{name} has a NUL character"))) } else { Ok(text.into()) }
}

/// A value as it would be typed: a list as several, or as one with commas.
fn values(value: &Value, are_several: bool) -> Vec<String> {
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    match value {
        Value::Array(items) if are_several => items.iter().map(text).collect(),
        Value::Array(items) => vec![items.iter().map(text).collect::<Vec<_>>().join(",")],
        value => vec![text(value)],
    }
}
