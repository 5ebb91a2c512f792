//! The options of the last run in a work folder, with which every command on a scene goes on unless `--fresh` is given.
//!
//! Each stage leaves in `run.json` the flags that were typed for it. The commands insert those of the stages that
//! they may run before the typed ones, so that they find the results of the run instead of doing them again with the
//! defaults. Scenes of a batch and runs of the Python module start afresh: a program says all of its options each time,
//! and the same program must have the same results.
//!
//! They take flags, not the options that `run.json` stores for each stage: options do not tell what was typed from a default, a
//! preset, or the scene's `gprop.toml`, which may have changed since, and whether a value may be taken back is known by flag.
//!
//! A work folder may come with a scene from anyone. So the only flags that are recorded and taken back are those that a
//! scene's `gprop.toml` may set, after the same checks, and `--preset`, which stands for such flags. If the user names
//! the work folder, it is the user's own: then paths outside the scene are taken as well, and [the
//! flags](OF_OWN_FOLDER) for the user's other folders. Nothing that loads code, names a server, pays or allows more to
//! be read is ever recorded. A flag that gprop would not have recorded is ignored. A flag that gprop recorded but may
//! not take back is an error: without it, the results of the run would be replaced.

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap::ArgMatches;

use crate::config::{self, ConfigError, Flag, Owner};
use crate::objects;
use crate::pipeline::{self, FieldFlags, OBJECT, Options, Plan, Stage, work_folder_of};
use crate::scene::{self, ObjectChoice, ObjectNumber};
use crate::words::output::one_line;
use crate::workdir::{self, Artifact};

use super::arguments::StageFlags;
use super::{Global, is_picture};

/// Flags that no scene may set, but that are taken back from any work folder: they stand for flags that a scene may set.
const FOR_SCENE_FLAGS: &[&str] = &["preset"];

/// Flags that no scene may set, but that are taken back from a work folder that the user names.
const OF_OWN_FOLDER: &[&str] = &["prompts", "recordings"];

/// Whether something is typed in place of a recorded flag. The scenario stays, because the recorded parameters belong to it, and so
/// does a correction, except of what is typed otherwise.
fn is_replaced(name: &str, recorded: &OsStr, typed: &[OsString]) -> bool {
    // The second piece of `--correct=PART.KEY=VALUE`.
    let corrects = |flag: &OsStr| flag.to_str().and_then(|flag| flag.split('=').nth(1).map(str::to_owned));
    let mut of_name = typed.iter().filter(|typed| config::name_of(typed) == name);
    match name {
        "scenario" => false,
        "correct" => of_name.any(|typed| corrects(typed) == corrects(recorded)),
        _ => of_name.next().is_some(),
    }
}

/// Linux accepts no argument longer than this (MAX_ARG_STRLEN), so a longer flag was not typed.
const LONGEST_FLAG: usize = 128 * 1024;

/// Characters that are shown at the beginning and at the end of a long recorded text.
const MOST_SHOWN: usize = 250;

/// The last stage that a command may run on the work folder of a scene, if it goes on from the last run.
pub fn going_on(command: &str, matches: &ArgMatches) -> Option<Stage> {
    let is_given = |name: &str| matches.try_get_one::<bool>(name).ok().flatten() == Some(&true);
    if is_given("fresh") || is_given("end_with_stdin") || matches.try_contains_id("for_python").unwrap_or(false) {
        return None;
    }
    match command {
        "run" => matches.try_get_one("to").ok().flatten().copied(),
        "report" => Some(Stage::Report),
        "segment" => Some(Stage::Segment),
        "query" => Some(Stage::Query),
        "vote" | "show" => Some(Stage::Vote),
        "answer" | "parts" => Some(Stage::Parts),
        "simulate" => Some(Stage::Simulate),
        "grasp" | "export" => Some(Stage::Grasp),
        _ => None,
    }
}

/// The option that names the work folder of `command`, if it has one.
pub fn work_option(command: &str) -> &'static str {
    if command == "export" { "work" } else { "out" }
}

/// The stage whose options are only for the command itself, if there is one: the user may be trying out a simulation or a
/// grasp, or exporting a grasp. A later command does the stage again with its own options.
pub fn once(command: &str) -> Option<Stage> {
    match command {
        "simulate" => Some(Stage::Simulate),
        "grasp" | "export" => Some(Stage::Grasp),
        _ => None,
    }
}

/// The flags of the last run on `scene` that `command` reuses: those that no typed flag replaces.
///
/// # Errors
/// [`ConfigError`] if a flag was recorded but may not be taken back, or is not valid.
pub fn flags(
    command: &clap::Command,
    matches: &ArgMatches,
    scene: &Path,
    known: &[Flag],
) -> Result<Vec<OsString>, ConfigError> {
    let Some(to) = going_on(command.get_name(), matches).filter(|_| !is_picture(scene)) else {
        return Ok(Vec::new());
    };
    let option = work_option(command.get_name());
    let named = matches.try_get_one::<PathBuf>(option).ok().flatten();
    let object = matches.try_get_one::<ObjectChoice>(OBJECT).ok().flatten().copied().unwrap_or_default();
    let home = scene::home(scene);
    let Some((root, of_all)) = root_of(scene, named.map(PathBuf::as_path), object) else { return Ok(Vec::new()) };
    let owner = if named.is_some() { Owner::User } else { Owner::Scene };
    let path = root.join(Artifact::Run.path());
    let typed = super::stage_flags(matches);
    let mut flags = Vec::new();
    for text in pipeline::flags_of_last_run(&root, Plan::to(to)) {
        let Some((flag, value)) = parsed(&text, known) else { continue };
        // The work folder is that of the object.
        let is_other = flag.name == OBJECT || of_all && is_of_one_object(&flag.name, value);
        if is_other || is_replaced(&flag.name, OsStr::new(&text), &typed) {
            continue;
        }
        flags.push(taken_back(flag, value, &home, owner).ok_or_else(|| ConfigError::NotFromLastRun {
            path: path.clone(),
            flag: shown(&text).into_owned(),
            name: flag.name.clone(),
            option: if option == "work" { "--work" } else { "--out" },
        })?);
    }
    match Options::of_flags(&flags) {
        Ok(_) => Ok(flags),
        Err(error) => {
            let problem = shown(&pipeline::problem_of(error)).into_owned();
            Err(ConfigError::LastRun { path, problem })
        }
    }
}

/// The work folder of the last run on `scene`, and whether it stands for all objects of a capture: they are run with the same
/// options, so those of the first one that was run are taken.
fn root_of(scene: &Path, named: Option<&Path>, object: ObjectChoice) -> Option<(PathBuf, bool)> {
    let root = |object| work_folder_of(scene, named, object).ok();
    let own = root(object)?;
    match object {
        ObjectChoice::One(_) => Some((own, false)),
        ObjectChoice::Auto if own.join(Artifact::Run.path()).exists() => Some((own, false)),
        ObjectChoice::Auto | ObjectChoice::All => {
            let numbers = objects::folders_in(&workdir::objects_folder(&own)).into_keys();
            let mut folders = numbers.filter_map(|number| root(ObjectChoice::One(number)));
            Some((folders.find(|folder| folder.join(Artifact::Run.path()).exists())?, true))
        }
    }
}

/// Whether a flag can only have been typed for one object of a capture: a correction, or a mass without the object's number.
fn is_of_one_object(name: &str, value: &str) -> bool {
    name == "correct" || name == "known-mass" && !value.contains('=')
}

/// The flag with its value if it is one that gprop records; the value is empty if the flag takes none.
fn parsed<'a, 'b>(text: &'b str, known: &'a [Flag]) -> Option<(&'a Flag, &'b str)> {
    let words = text.strip_prefix("--").filter(|_| text.len() <= LONGEST_FLAG)?;
    let (name, value) = words.split_once('=').map_or((words, None), |(name, value)| (name, Some(value)));
    let flag = known.iter().find(|flag| flag.name == name && is_recorded(flag))?;
    (flag.takes_value == value.is_some()).then_some((flag, value.unwrap_or_default()))
}

/// True if the flag may be recorded in `run.json`.
pub fn is_recorded(flag: &Flag) -> bool {
    let name = flag.name.as_str();
    flag.scene.is_some() || FOR_SCENE_FLAGS.contains(&name) || OF_OWN_FOLDER.contains(&name)
}

/// A recorded flag as it would be typed; `None` if its value may not come from a work folder of this owner.
fn taken_back(flag: &Flag, value: &str, scene: &Path, owner: Owner) -> Option<OsString> {
    if !flag.takes_value {
        return Some(format!("--{}", flag.name).into());
    }
    let owner = if FOR_SCENE_FLAGS.contains(&flag.name.as_str()) { Owner::User } else { owner };
    flag.set_to(value, scene, owner).ok()
}

/// The flags that a run on `scene` leaves in `run.json`, if `flags` are those that it was given.
pub fn recorded(flags: &[OsString], scene: &Path, known: &[Flag]) -> FieldFlags {
    let (mut recorded, home) = (FieldFlags::new(), scene::home(scene));
    for flag in flags {
        // A path that is not Unicode has no place in JSON.
        let Some((of, value)) = flag.to_str().and_then(|text| parsed(text, known)) else { continue };
        let text = if of.takes_value && of.is_path(value) {
            config::portable(Path::new(value), &home).to_str().map(|path| format!("--{}={path}", of.name))
        } else {
            flag.to_str().map(str::to_owned)
        };
        recorded.entry(of.field.to_owned()).or_default().extend(text);
    }
    recorded
}

/// Tells the user which options of the last run are used.
pub fn tell(global: &Global) {
    let flags: Vec<_> = global.flags.of_last_run.iter().map(|flag| flag.to_string_lossy()).collect();
    if !flags.is_empty() {
        global.progress().line(&format!("options of the last run: {}", shown(&flags.join(" "))));
    }
}

/// Tells the user which options of an object's own last run, in the work folder `root`, all objects are run without.
pub fn tell_left_out(global: &Global, number: ObjectNumber, root: &Path, to: Stage) {
    let StageFlags { typed, goes_on, of_last_run, .. } = &global.flags;
    if !goes_on {
        return;
    }
    let is_left_out = |flag: &String| {
        let (flag, name) = (OsStr::new(flag), config::name_of(flag.as_ref()));
        name != OBJECT && !of_last_run.iter().any(|used| used == flag) && !is_replaced(name, flag, typed)
    };
    let mut flags = pipeline::flags_of_last_run(root, Plan::to(to));
    flags.retain(is_left_out);
    if !flags.is_empty() {
        let flags = flags.join(" ");
        let text = format!("{number}: not used, because all objects have the same options: {}", shown(&flags));
        global.progress().line(&text);
    }
}

/// The text on one line, without its middle if it is long.
fn shown(text: &str) -> Cow<'_, str> {
    let (head, tail) = (text.char_indices().nth(MOST_SHOWN), text.char_indices().nth_back(MOST_SHOWN - 1));
    match (head, tail) {
        (Some((head, _)), Some((tail, _))) if head < tail => {
            format!("{}…{}", one_line(&text[..head]), one_line(&text[tail..])).into()
        }
        _ => one_line(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_replaces_a_recorded_one_of_the_same_thing() {
        let typed = ["--correct=cup.wall=3mm", "--drop-height=2"].map(OsString::from);
        let replaced = |name: &str, recorded: &str| is_replaced(name, OsStr::new(recorded), &typed);
        assert!(replaced("correct", "--correct=cup.wall=5mm"));
        assert!(!replaced("correct", "--correct=cup.material=glass"));
        assert!(replaced("drop-height", "--drop-height=1") && !replaced("grid", "--grid=64"));
    }
}
