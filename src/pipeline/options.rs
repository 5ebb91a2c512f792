//! The options of all stages, and how a file in a scene's folder sets them.

use std::any::TypeId;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue};
use clap::{ArgAction, Args, FromArgMatches};
use serde::Serialize;

use crate::config::option_values::OptionError;
use crate::config::{self, ConfigError, FileFlags, SceneKey};
use crate::error::{Error, Result, UsageError};
use crate::scene::{ObjectChoice, ObjectNumber};
use crate::words::output;

use super::corrections_file;
use super::preset::Preset;

/// The options of all stages. In a library, `preset` changes nothing, because the command line is what applies it; begin
/// with [`Preset::options`] instead.
#[derive(Debug, Clone, Default, Serialize, clap::Args)]
#[non_exhaustive]
pub struct Options {
    /// Set of defaults; other options override it
    #[arg(long, value_enum, default_value_t = Preset::default(), help_heading = "Presets")]
    pub preset: Preset,
    #[command(flatten)]
    pub scene: crate::scene::Options,
    #[command(flatten)]
    pub segment: crate::segment::Options,
    #[command(flatten)]
    pub consensus: crate::consensus::Options,
    #[command(flatten)]
    pub setup: crate::setup::Options,
    #[command(flatten)]
    pub query: crate::query::Options,
    #[command(flatten)]
    pub materials: crate::materials::Options,
    #[command(flatten)]
    pub vote: crate::vote::Options,
    #[command(flatten)]
    pub parts: crate::parts::Options,
    #[command(flatten)]
    pub simulate: crate::simulate::Options,
    #[command(flatten)]
    pub grasp: crate::grasp::Options,
}

impl Options {
    /// Checks that every number of every stage is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        self.scene.check()?;
        self.segment.check()?;
        self.consensus.check()?;
        self.query.check()?;
        self.vote.check()?;
        self.parts.check()?;
        self.simulate.check()?;
        self.grasp.check()
    }

    /// The defaults, changed by `gprop.toml` and `corrections.toml` in the folder `scene`. These are the options of `gprop run` without flags
    /// if the user has no `config.toml`.
    ///
    /// # Errors
    /// If one of the files cannot be read, has a key that it may not set, or a value that the key does not accept.
    pub fn of_scene(scene: impl AsRef<Path>) -> Result<Self, Error> {
        let scene = scene.as_ref();
        Self::of_file(&flags_of_scene(scene, None, &known_flags())?, &scene.join(config::FILE_NAME))
    }

    /// The same options for one object of the capture in the folder `scene`, with the corrections of that object.
    ///
    /// # Errors
    /// As for [`Self::of_scene`].
    pub(crate) fn of_object(mut self, scene: &Path, number: ObjectNumber) -> Result<Self, Error> {
        self.scene.object = ObjectChoice::One(number);
        let path = corrections_file(scene, self.scene.object);
        let corrections = Self::of_file(&config::flags_of_corrections(&path, &known_flags())?, &path)?;
        self.vote.correct.extend(corrections.vote.correct);
        Ok(self)
    }

    fn of_file(file: &FileFlags, path: &Path) -> Result<Self, Error> {
        let wrong = |error: clap::Error| -> Error {
            let invalid = file.invalid_value(&|flag| problem_with(flag, Self::augment_args(stages()), &error));
            match invalid {
                Some(invalid) => invalid.into(),
                None => UsageError(format!("{path:?}: {}", problem_of(error))).into(),
            }
        };
        Self::of_flags(&file.flags).map_err(wrong)
    }

    /// The defaults, changed by flags.
    ///
    /// # Errors
    /// clap's error for an unknown flag, an invalid value, or flags that exclude each other.
    pub(crate) fn of_flags(flags: &[OsString]) -> Result<Self, clap::Error> {
        let command = Self::augment_args(stages().no_binary_name(true).args_override_self(true));
        Self::from_arg_matches(&command.try_get_matches_from(flags)?)
    }
}

/// The flags of a scene's own files: `gprop.toml`, then its [corrections](corrections_file), those of the object that the user
/// chose or else `gprop.toml`.
///
/// # Errors
/// [`ConfigError`] names the file, the line and the key.
pub fn flags_of_scene(
    scene: &Path,
    object: Option<ObjectChoice>,
    known: &[config::Flag],
) -> Result<FileFlags, ConfigError> {
    let file = config::flags_of_scene(scene, known)?;
    let named = || {
        let flag = file.flags.iter().rfind(|flag| config::name_of(flag) == OBJECT)?;
        config::value_of(flag)?.to_str()?.parse().ok()
    };
    let object = object.or_else(named).unwrap_or_default();
    Ok(file.then(config::flags_of_corrections(&corrections_file(scene, object), known)?))
}

/// The name of the option that chooses an object.
pub const OBJECT: &str = "object";

/// What clap says is wrong, on one line and without the usage.
pub(crate) fn problem_of(error: clap::Error) -> String {
    let text = with_values_on_one_line(error).to_string();
    // The values that are possible, if they are few, are on the second line.
    let lines: Vec<&str> = text.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
    lines.join(" ").trim_start_matches("error: ").to_owned()
}

/// The error with each given value on one line: it may come from a scene's `gprop.toml`.
pub(crate) fn with_values_on_one_line(mut error: clap::Error) -> clap::Error {
    let given: Vec<_> = error.context().map(|(kind, value)| (kind, value.clone())).collect();
    for (kind, value) in given {
        if let ContextValue::String(text) = value {
            error.insert(kind, ContextValue::String(output::one_line(&text).into_owned()));
        }
    }
    error
}

/// What is wrong with the value of a flag, if it is the cause of `error`; `command` has the flag.
pub(crate) fn problem_with(flag: &OsString, command: clap::Command, error: &clap::Error) -> Option<String> {
    error.get(ContextKind::InvalidValue)?;
    let alone = command.no_binary_name(true).try_get_matches_from([flag]).err()?;
    let same =
        [ContextKind::InvalidArg, ContextKind::InvalidValue].iter().all(|kind| alone.get(*kind) == error.get(*kind));
    same.then(|| problem_of(alone))
}

impl Preset {
    /// The default options with those of the preset.
    pub fn options(self) -> Options {
        let command = Options::augment_args(stages().no_binary_name(true));
        let matches = command.try_get_matches_from(self.flags()).expect("a test parses the flags of every preset");
        let options = Options::from_arg_matches(&matches).expect("the same test reads them");
        Options { preset: self, ..options }
    }
}

/// A field of [`Options`]: the options of a stage, or those that several share.
pub(crate) struct Field {
    pub name: &'static str,
    pub options: clap::Command,
    /// The keys that a scene's `gprop.toml` may set. Every other option is only for the user to set.
    pub scene_keys: &'static [SceneKey],
}

/// The fields of [`Options`].
pub(crate) fn fields() -> [Field; 10] {
    fn field<T: Args>(name: &'static str, scene_keys: &'static [SceneKey]) -> Field {
        Field { name, options: T::augment_args(clap::Command::new(name)), scene_keys }
    }
    [
        field::<crate::scene::Options>("scene", crate::scene::SCENE_KEYS),
        field::<crate::segment::Options>("segment", crate::segment::SCENE_KEYS),
        field::<crate::consensus::Options>("consensus", crate::consensus::SCENE_KEYS),
        field::<crate::setup::Options>("setup", crate::setup::SCENE_KEYS),
        field::<crate::query::Options>("query", crate::query::SCENE_KEYS),
        field::<crate::materials::Options>("materials", crate::materials::SCENE_KEYS),
        field::<crate::vote::Options>("vote", crate::vote::SCENE_KEYS),
        field::<crate::parts::Options>("parts", crate::parts::SCENE_KEYS),
        field::<crate::simulate::Options>("simulate", crate::simulate::SCENE_KEYS),
        field::<crate::grasp::Options>("grasp", crate::grasp::SCENE_KEYS),
    ]
}

/// The keys of all stages' options that a scene's `gprop.toml` may set.
pub fn scene_keys() -> Vec<SceneKey> {
    fields().iter().flat_map(|field| field.scene_keys).copied().collect()
}

/// The one flag, besides those of the stages, that a configuration file may set.
pub const THREADS: &str = "threads";

/// The flags that a configuration file may set: those of the stages, but not those of the command, and the number of
/// threads. A scene's file may set those with [`config::Flag::scene`].
pub fn known_flags() -> Vec<config::Flag> {
    let stages = Options::augment_args(stages());
    let (scene_keys, fields) = (scene_keys(), fields());
    // The preset has options of several stages; it is stored with those of the first one, which every run does.
    let field_of = |name: &str| {
        let has = |field: &&Field| field.options.get_arguments().any(|option| option.get_long() == Some(name));
        fields.iter().find(has).map_or("scene", |field| field.name)
    };
    let flag = |argument: &clap::Arg| {
        let name = argument.get_long()?.to_owned();
        Some(config::Flag {
            takes_value: argument.get_action().takes_values(),
            repeats: matches!(argument.get_action(), ArgAction::Append) && argument.get_value_delimiter().is_none(),
            is_path: argument.get_value_parser().type_id() == TypeId::of::<PathBuf>(),
            scene: scene_keys.iter().find(|key| key.name == name).map(|key| key.value),
            field: field_of(&name),
            name,
        })
    };
    let threads = config::Flag { name: THREADS.to_owned(), takes_value: true, ..config::Flag::default() };
    stages.get_arguments().filter_map(flag).chain([threads]).collect()
}

/// A command without arguments, to which those of the stages are added.
fn stages() -> clap::Command {
    clap::Command::new("stages")
}
