//! What users call an object on the command line, replaced by its number before anything else is read: the number decides
//! which work folder, corrections and last run a command has.

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

use crate::error::{Result, UsageError};
use crate::objects::Names;
use crate::pipeline;
use crate::pipeline::{OBJECT, work_folder};
use crate::scene::{ObjectChoice, ObjectNumber, Options};

use super::{command, innermost, last_run, stage_flags};

const OBJECT_AT: &str = "object-at";
const KNOWN_MASS: &str = "known-mass";

/// The arguments with `--object NAME`, `--known-mass NAME=MASS` and `--object-at VIEW:X,Y` by number. They are left as they are if
/// the command has no scene.
///
/// # Errors
/// If a name is not that of one object, or a pixel shows none.
pub fn by_number(arguments: &[OsString]) -> Result<Cow<'_, [OsString]>> {
    let joined = with_values_joined(arguments);
    if !joined.iter().any(|argument| Named::of(argument).is_some()) {
        return Ok(Cow::Borrowed(arguments));
    }
    let others: Vec<OsString> = joined.iter().filter(|argument| Named::of(argument).is_none()).cloned().collect();
    let Some(capture) = Capture::of(&others) else { return Ok(Cow::Borrowed(arguments)) };
    let numbered = |argument: OsString| match Named::of(&argument) {
        Some(named) => capture.by_number(&named),
        None => Ok(argument),
    };
    Ok(Cow::Owned(joined.into_iter().map(numbered).collect::<Result<_>>()?))
}

/// An argument that says which object is meant other than by its number.
enum Named<'a> {
    Object(&'a str),
    KnownMass { name: &'a str, mass: &'a str },
    At(&'a str),
}

impl<'a> Named<'a> {
    /// `None` if the argument is another, or has a number.
    fn of(argument: &'a OsStr) -> Option<Self> {
        let (option, value) = argument.to_str()?.strip_prefix("--")?.split_once('=')?;
        match option {
            OBJECT if value.parse::<ObjectChoice>().is_err() => Some(Self::Object(value)),
            KNOWN_MASS => {
                let (name, mass) = value.split_once('=')?;
                name.trim().parse::<ObjectNumber>().is_err().then_some(Self::KnownMass { name, mass })
            }
            OBJECT_AT => Some(Self::At(value)),
            _ => None,
        }
    }
}

/// The arguments, with each of these options in one piece with its value.
fn with_values_joined(arguments: &[OsString]) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        if argument == "--" {
            joined.push(argument.clone());
            break;
        }
        let is_option = [OBJECT, OBJECT_AT, KNOWN_MASS].iter().any(|name| *argument == *format!("--{name}"));
        let mut whole = argument.clone();
        if let Some(value) = is_option.then(|| rest.next()).flatten() {
            whole.push("=");
            whole.push(value);
        }
        joined.push(whole);
    }
    joined.extend(rest.cloned());
    joined
}

/// Where a command looks for objects.
struct Capture {
    scene: PathBuf,
    work: PathBuf,
    options: Options,
}

impl Capture {
    /// `None` if the command takes no scene.
    fn of(arguments: &[OsString]) -> Option<Self> {
        let matches = command().ignore_errors(true).try_get_matches_from(arguments).ok()?;
        let (_, command, matches) = innermost(arguments, &matches);
        let path = |name: &str| matches.try_get_one::<PathBuf>(name).ok().flatten();
        let scene = path("scene")?.clone();
        let work = work_folder(&scene, path(last_run::work_option(command.get_name())).map(PathBuf::as_path));
        // What is wrong with the options is reported when all are parsed.
        let in_scene = pipeline::flags_of_scene(&scene, None, &pipeline::known_flags()).unwrap_or_default();
        let flags = [in_scene.flags, stage_flags(matches)].concat();
        let options = pipeline::Options::of_flags(&flags).unwrap_or_default().scene;
        Some(Self { scene, work, options })
    }

    fn by_number(&self, named: &Named) -> Result<OsString> {
        Ok(match named {
            Named::Object(name) => option(OBJECT, self.number_of(OBJECT, name)?.to_string()),
            Named::KnownMass { name, mass } => {
                option(KNOWN_MASS, format!("{}={mass}", self.number_of(KNOWN_MASS, name.trim())?))
            }
            Named::At(text) => {
                let point = text.parse().map_err(|problem| UsageError(format!("--{OBJECT_AT} {text}: {problem}")))?;
                let options = Options { object_at: Some(point), ..self.options.clone() };
                option(OBJECT, options.with_object_by_number(&self.scene)?.object.to_string())
            }
        })
    }

    fn number_of(&self, option: &str, name: &str) -> Result<ObjectNumber> {
        let number = Names::read(&self.work).number_of(name);
        Ok(number.map_err(|problem| UsageError(format!("--{option} {name}: {problem}")))?)
    }
}

fn option(name: &str, value: String) -> OsString {
    format!("--{name}={value}").into()
}
