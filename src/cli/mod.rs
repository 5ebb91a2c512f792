//! Subcommands and flags: turns command-line arguments into a call of the pipeline or a stage, and prints the result on
//! stdout.

mod answer;
mod arguments;
mod batch;
mod container;
mod evaluate;
mod found;
mod help;
mod last_run;
mod log;
mod manual;
mod mcp;
mod object_names;
mod objects;
mod option_types;
mod picture;
#[cfg(test)]
mod python;
mod query;
mod scene;
mod simulate;
mod tools;
mod view;

use std::ffi::{OsStr, OsString};
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::parser::ValueSource;
use clap::{Args, CommandFactory, FromArgMatches, ValueEnum};
use serde::Serialize;

use crate::error::{Error, Result, UsageError};
use crate::files::json;
use crate::pipeline::{self, OBJECT, Preset, Stage, THREADS, flags_of_scene, known_flags};
use crate::scene::ObjectChoice;
use crate::scene::mesh::containers::is_robot;
use crate::scene::mesh::is_mesh;
use crate::words::output;
use crate::words::progress::{Progress, ShowProgress};
use crate::{config, exit, export};
use arguments::{
    AnswerArgs, BatchArgs, Cli, Command, Compat, Evaluate, ExportArgs, Global, Grasp, GraspArgs, LastRun, Materials,
    QueryArgs, ReportArgs, RunArgs, Scale, SceneArgs, ShowArgs, SimulateArgs, StageFlags, ViewArgs, What, WorkArgs,
};

/// The program: runs the command line, prints an error once, and returns the exit code. A panic is reported as a bug
/// and ends the process; clap handles invalid usage, help and version, and ends the process itself.
pub fn main() -> ExitCode {
    exit::report_panics_as_bugs();
    match run(std::env::args_os().collect()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            output::tell(&format!("error: {}", exit::message(&error)));
            ExitCode::from(error.kind().exit_code())
        }
    }
}

/// Runs the command line in `arguments` (the program's name first).
///
/// # Errors
/// Any failure.
fn run(arguments: Vec<OsString>) -> Result<()> {
    let cli = match parse(&arguments) {
        Ok(cli) => cli,
        Err(error) => refuse(error.downcast::<clap::Error>()?),
    };
    prepare(&cli)?;
    let global = &cli.global;
    match &cli.command {
        Command::Run(args) if is_robot(&args.scene.scene) => container::run(global, args),
        Command::Run(args) => {
            let run = objects::Run { to: args.to, simulates: !args.no_simulate, for_python: args.for_python };
            // A scene of a batch is one object.
            let run_scene = if global.is_in_batch { objects::run_one } else { objects::run };
            run_scene(global, &args.scene.scene, &args.scene.work, run)
        }
        Command::Report(args) => view::report(global, args),
        Command::View(args) => view::view(global, args),
        Command::Segment(args) if is_picture(&args.scene) => picture::segment(global, args),
        Command::Segment(args) => scene::run(global, &args.scene, &args.work, Stage::Segment),
        Command::Query(args) => query::query(global, args),
        Command::Answer(args) => answer::answer(global, args),
        Command::Vote(args) => scene::run(global, &args.scene, &args.work, Stage::Vote),
        Command::Show(args) => scene::show(global, args),
        Command::Parts(args) => scene::run(global, &args.scene, &args.work, Stage::Parts),
        Command::Simulate(args) => simulate::run(global, args),
        Command::Grasp(GraspArgs { what: Some(what), .. }) => tools::grasp(global, what),
        Command::Grasp(GraspArgs { scene: Some(folder), work, .. }) => scene::run(global, folder, work, Stage::Grasp),
        Command::Grasp(_) => unreachable!("clap asks for a scene if there is no subcommand"),
        Command::Export(args) if args.list => {
            let formats = export::list();
            print(global, &formats, || export::text(&formats))
        }
        Command::Export(args) if is_robot(args.scene()) => container::export(global, args),
        Command::Export(args) if args.options.scene.object == ObjectChoice::All => objects::export_all(global, args),
        Command::Export(args) => scene::export(global, args),
        Command::Inspect(args) => tools::inspect(global, args),
        Command::Objects(args) => objects::list(global, args),
        Command::Audit(args) => tools::audit(global, args),
        Command::Batch(args) => batch::run(global, args),
        Command::Evaluate(what) => evaluate::evaluate(global, what),
        Command::Materials(what) => tools::materials(global, what),
        Command::Scale(what) => tools::scale(global, what),
        Command::Mcp(args) => mcp::serve(global, args),
        Command::Setup(args) => tools::set_up(global, &args.options),
        Command::Doctor(args) => tools::doctor(global, &args.options),
        Command::Help { of } => help::show(of),
        Command::Completions { shell } => manual::completions(global, *shell),
        Command::Man { out: None } => manual::page(global),
        Command::Man { out: Some(folder) } => manual::pages(global, folder),
    }
}

/// Sets up the process as the options say.
fn prepare(Cli { global, command }: &Cli) -> Result<()> {
    log::start(global);
    if let Some(threads) = global.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|error| UsageError(format!("--threads {threads}: {error}")))?;
    }
    last_run::tell(global);
    let serves_another = |args: &RunArgs| args.end_with_stdin || args.for_python.is_some();
    if global.for_mcp || matches!(command, Command::Run(args) if serves_another(args)) {
        crate::batch::end_with_the_batch();
    }
    Ok(())
}

/// True if the user named a single picture instead of a scene: a file that is no mesh and no robot.
fn is_picture(scene: &Path) -> bool {
    scene.is_file() && !is_mesh(scene) && !is_robot(scene)
}

/// The program's clap command: all arguments, with their help.
pub fn command() -> clap::Command {
    help::with_help(Cli::command())
}

/// Parses the arguments, with the flags of the configuration files and of the last run inserted before them.
///
/// # Errors
/// [`clap::Error`] for invalid usage, help or version; typed errors of the files.
fn parse(arguments: &[OsString]) -> Result<Cli> {
    parse_with(arguments, config::user_file().as_deref())
}

/// Like [`parse`], with the user's configuration in `user_file`.
fn parse_with(arguments: &[OsString], user_file: Option<&Path>) -> Result<Cli> {
    let arguments = &*object_names::by_number(arguments)?;
    let Inserted { arguments: all, files, mut stages } = insert_flags(arguments, user_file)?;
    let matches = command().try_get_matches_from(all).map_err(|error| with_its_place(error, arguments, &files))?;
    let mut cli = Cli::from_arg_matches(&matches)?;
    stages.effective = matches.subcommand().map_or_else(Vec::new, |(_, matches)| stage_flags(matches));
    cli.global.flags = stages;
    cli.global.is_in_batch = matches!(&cli.command, Command::Run(args) if args.end_with_stdin);
    Ok(cli)
}

/// The arguments with the flags of the configuration files and of the last run.
struct Inserted {
    arguments: Vec<OsString>,
    /// The files that the flags come from: the scene's, then the user's.
    files: Vec<config::FileFlags>,
    stages: StageFlags,
}

/// Inserts the flags of the files and of the last run after the command's name. A first pass, which ignores errors, finds
/// the command and the scene; without them, nothing is inserted.
///
/// # Errors
/// Typed errors of the files.
fn insert_flags(typed: &[OsString], user_file: Option<&Path>) -> Result<Inserted> {
    let first_look = |arguments: &[OsString]| command().ignore_errors(true).try_get_matches_from(arguments);
    let mut stages = StageFlags::default();
    let Ok(matches) = &first_look(typed) else {
        return Ok(Inserted { arguments: typed.to_vec(), files: Vec::new(), stages });
    };
    let (place, command, matches) = innermost(typed, matches);
    let known = known_flags();
    stages.typed = stage_flags(matches);
    stages.goes_on = last_run::going_on(command.get_name(), matches).is_some();
    let scene = matches.try_get_one::<PathBuf>("scene").ok().flatten();
    let none = || Ok(config::FileFlags::default());
    let mut user = user_file.map_or_else(none, |path| config::flags_of_user(path, &known))?;
    let object = matches.try_get_one(OBJECT).ok().flatten().filter(|_| is_typed(matches, OBJECT)).copied();
    let in_scene = scene.map_or_else(none, |scene| flags_of_scene(scene, object, &known))?;
    user.yield_to(&in_scene);
    let (mut of_user, mut of_scene) = (user.flags.clone(), in_scene.flags.clone());
    let mut of_last_run =
        scene.map_or_else(|| Ok(Vec::new()), |scene| last_run::flags(&command, matches, scene, &known))?;
    drop_replaced_parameters([&mut of_user, &mut of_scene, &mut of_last_run], &stages.typed);
    let preset = preset(matches, [&of_last_run, &of_user]);
    let mut flags: Vec<OsString> = preset.flags().iter().map(OsString::from).collect();
    flags.extend([of_user, of_scene].concat());
    // The files apply to all commands; each command takes the options that it has.
    let takes = |flag: &OsString| match config::name_of(flag) {
        // Inserted after the command's name, it would override one typed before that name.
        THREADS => !matches.contains_id(THREADS),
        name => command.get_arguments().any(|argument| argument.get_long() == Some(name)),
    };
    flags.retain(takes);
    // clap lets a typed flag override those of the last run that contradict it.
    let go_on = [&typed[..place], &of_last_run[..], &typed[place..]].concat();
    let own = first_look(&go_on).map_or_else(|_| Vec::new(), |own| stage_flags(innermost(&go_on, &own).2));
    stages.of_last_run = own.iter().filter(|flag| !stages.typed.contains(flag)).cloned().collect();
    stages.once = last_run::once(command.get_name());
    stages.recorded = scene.map(|scene| last_run::recorded(&own, scene, &known)).unwrap_or_default();
    let arguments = [&typed[..place], &flags[..], &of_last_run[..], &typed[place..]].concat();
    Ok(Inserted { arguments, files: vec![in_scene, user], stages })
}

/// An error of the arguments and the inserted flags: a value that a file sets and its option refuses is reported with its
/// place. clap's usage lists every flag that was given, so an error of the typed arguments is reported without the flags
/// inserted before them.
fn with_its_place(error: clap::Error, typed: &[OsString], files: &[config::FileFlags]) -> Error {
    let problem_with = |flag: &OsString| pipeline::problem_with(flag, with_flags_of_files(), &error);
    let invalid = files.iter().find_map(|file| file.invalid_value(&problem_with));
    invalid.map_or_else(|| as_typed(typed, error).into(), Error::from)
}

/// The error of the typed `arguments` alone if it is of the same kind as `error`, which they cause together with the
/// inserted flags; else `error`.
fn as_typed(arguments: &[OsString], error: clap::Error) -> clap::Error {
    let alone = command().try_get_matches_from(arguments).err();
    alone.filter(|alone| alone.kind() == error.kind()).unwrap_or(error)
}

/// A command with every flag that a configuration file may set.
fn with_flags_of_files() -> clap::Command {
    Global::augment_args(pipeline::Options::augment_args(clap::Command::new("flags")))
}

/// Removes parameters of a scenario (`--set`) that something later in the order of precedence replaces: another scenario,
/// or the option that stands for the same parameter of `drop`.
fn drop_replaced_parameters(mut lists: [&mut Vec<OsString>; 3], typed: &[OsString]) {
    const SAME: [(&str, &str); 2] = [("drop-height", "--set=height="), ("tilt-deg", "--set=tilt=")];
    let is_text = |flag: &OsString, start: &str| flag.to_str().is_some_and(|flag| flag.starts_with(start));
    let named = |list: &[OsString]| list.iter().rfind(|flag| config::name_of(flag) == "scenario").cloned();
    let mut scenario = OsString::from("--scenario=drop");
    for later in 0..=lists.len() {
        let list = lists.get(later).map_or(typed, |list| &list[..]).to_vec();
        let replaces = named(&list).is_some_and(|named| named != scenario);
        scenario = named(&list).unwrap_or(scenario);
        for earlier in lists.iter_mut().take(later) {
            earlier.retain(|flag| {
                let same = |(name, set): &(&str, &str)| {
                    is_text(flag, set) && list.iter().any(|later| config::name_of(later) == *name)
                };
                !(replaces && is_text(flag, "--set=") || scenario == "--scenario=drop" && SAME.iter().any(same))
            });
        }
    }
}

/// True if the option of this name was given on the command line.
fn is_typed(matches: &clap::ArgMatches, name: &str) -> bool {
    matches.value_source(name) == Some(ValueSource::CommandLine)
}

/// The preset that the command line names, or else the first of these lists of flags that names one.
fn preset(matches: &clap::ArgMatches, lists: [&[OsString]; 2]) -> Preset {
    if let Ok(Some(named)) = matches.try_get_one::<Preset>("preset")
        && is_typed(matches, "preset")
    {
        return *named;
    }
    let named = |list: &[OsString]| {
        let name = list.iter().rev().find_map(|flag| flag.to_str()?.strip_prefix("--preset="))?;
        Preset::from_str(name, false).ok()
    };
    lists.into_iter().find_map(named).unwrap_or_default()
}

/// The innermost subcommand, its matches, and the index in `arguments` after its name.
fn innermost<'a>(
    arguments: &[OsString],
    mut matches: &'a clap::ArgMatches,
) -> (usize, clap::Command, &'a clap::ArgMatches) {
    let (mut place, mut command) = (1, command());
    while let Some((name, inner)) = matches.subcommand() {
        let behind = arguments.iter().skip(place).position(|argument| argument == name);
        let (Some(behind), Some(found)) = (behind, command.find_subcommand(name)) else { break };
        (place, command, matches) = (place + behind + 1, found.clone(), inner);
    }
    (place.min(arguments.len()), command, matches)
}

/// Ends the process as clap would: with help or version on stdout, or with a usage error.
fn refuse(error: clap::Error) -> ! {
    if !error.use_stderr() {
        error.exit();
    }
    let error = pipeline::with_values_on_one_line(error);
    output::tell(error.render().to_string().trim_end());
    std::process::exit(error.exit_code());
}

/// The stages' flags in `matches`, in a form in which they can be passed on.
fn stage_flags(matches: &clap::ArgMatches) -> Vec<OsString> {
    let stages = pipeline::Options::augment_args(clap::Command::new("stages"));
    let mut typed = Vec::new();
    for argument in stages.get_arguments() {
        let (Some(flag), id) = (argument.get_long(), argument.get_id().as_str()) else { continue };
        let is_here = matches.try_contains_id(id).is_ok();
        if !is_here || matches.value_source(id) != Some(ValueSource::CommandLine) {
            continue;
        }
        if !argument.get_action().takes_values() {
            typed.push(format!("--{flag}").into());
            continue;
        }
        let values: Vec<_> = matches.get_raw(id).into_iter().flatten().collect();
        let flag_with = |value: &OsStr| [OsStr::new(&format!("--{flag}=")), value].into_iter().collect();
        match argument.get_value_delimiter() {
            Some(delimiter) => typed.push(flag_with(&values.join(OsStr::new(&delimiter.to_string())))),
            None => typed.extend(values.into_iter().map(flag_with)),
        }
    }
    typed
}

/// The options of a scene that was named with `flags`, if any: the defaults, the user's configuration, the scene's
/// `gprop.toml`, the flags.
///
/// # Errors
/// If the scene's `gprop.toml` cannot be used. One scene of several must not end the process.
fn options_of(scene: &Path, flags: &[OsString]) -> Result<pipeline::Options> {
    let typed = [OsStr::new("gprop"), OsStr::new("parts"), scene.as_os_str()].map(OsStr::to_owned);
    let wrong = |error: Error| -> Error {
        match error.downcast::<clap::Error>() {
            Ok(invalid) => UsageError(format!("{scene:?}: {}", pipeline::problem_of(invalid))).into(),
            Err(error) => error,
        }
    };
    match parse(&[&typed, flags].concat()).map_err(wrong)?.command {
        Command::Parts(args) => Ok(args.work.options),
        _ => Err(UsageError(format!("{scene:?} is not a scene folder")).into()),
    }
}

/// Prints a result: as JSON if requested, else as text. A closed stdout is not an error.
fn print(global: &Global, value: &impl Serialize, text: impl FnOnce() -> String) -> Result<()> {
    print_text(&if global.json { json::pretty(value)? } else { text() })
}

/// Prints a text. A closed stdout is not an error.
fn print_text(text: &str) -> Result<()> {
    match writeln!(io::stdout(), "{}", output::harmless(text.trim_end())) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(UsageError(format!("cannot print: {error}")).into())
        }
        _ => Ok(()),
    }
}

/// Prints the path of a file or folder that was written.
fn print_path(global: &Global, path: &Path) -> Result<()> {
    print(global, &config::in_json(path), || shown(path))
}

/// Prints the names of objects and their work folders, for the Python module.
fn print_works<'a>(works: impl Iterator<Item = (&'a str, PathBuf)>) -> Result<()> {
    let works: Vec<_> = works.map(|(name, work)| (name, config::in_json(&work).into_owned())).collect();
    print_text(&json::compact(&works)?)
}

/// A path on one line.
fn shown(path: &Path) -> String {
    output::one_line(&path.to_string_lossy()).into_owned()
}

impl Global {
    /// Whether a command prints a summary of what it did, or its JSON.
    fn prints_summary(&self) -> bool {
        self.json || !self.quiet
    }

    fn progress(&self) -> Progress<'static> {
        self.show_progress().into()
    }

    fn show_progress(&self) -> ShowProgress {
        match (self.quiet, io::stderr().is_terminal()) {
            (true, _) => ShowProgress::Hidden,
            (false, true) => ShowProgress::Bars,
            (false, false) => ShowProgress::Lines,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::options::{Field, fields};

    #[test]
    fn stage_options_are_handed_on_as_they_were_typed() {
        let flags = |typed: &str| {
            let typed: Vec<OsString> = typed.split(' ').map(OsString::from).collect();
            parse_with(&typed, None).unwrap().global.flags.typed
        };
        assert_eq!(
            flags("gprop batch DATA --jobs 3 --to vote --out X -q"),
            [] as [&str; 0],
            "these are the batch's own"
        );
        assert_eq!(
            flags(
                "gprop batch DATA --lmm-url http://h/v1 --view-list a,b --offline --object-box=-1,0,0:1,1,1 --grid 16"
            ),
            ["--view-list=a,b", "--object-box=-1,0,0:1,1,1", "--offline", "--lmm-url=http://h/v1", "--grid=16"]
        );
        assert_eq!(flags("gprop batch DATA --grid 16 --grid 24"), ["--grid=24"]);
        assert_eq!(flags("gprop batch DATA --also npy,coco"), ["--also=npy,coco"]);
    }

    /// The user's configuration in the folder of a test's scene, if there is one.
    const USER_FILE: &str = "config.toml";

    /// The options of `gprop simulate SCENE` with these typed flags, if the scene's `gprop.toml` has the text `of_scene`.
    fn simulate_options(scene: &Path, of_scene: &str, typed: &[&str]) -> crate::simulate::Options {
        std::fs::write(scene.join(config::FILE_NAME), of_scene).unwrap();
        let words = ["gprop", "simulate"].iter().chain(typed).map(OsString::from);
        let arguments: Vec<OsString> = words.chain([scene.into()]).collect();
        match parse_with(&arguments, Some(&scene.join(USER_FILE))).unwrap().command {
            Command::Simulate(args) => args.work.options.simulate,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_typed_viewpoint_overrides_the_scenes() {
        let scene = tempfile::tempdir().unwrap();
        let viewpoint = |of_scene: &str, typed: &[&str]| simulate_options(scene.path(), of_scene, typed).viewpoint;
        let filmed = viewpoint("film-from = \"003\"", &["--turntable"]);
        assert!(filmed.turntable && filmed.film_from.is_none(), "{filmed:?}");
        let filmed = viewpoint("film-from = \"003\"", &["--azimuth-deg", "30"]);
        assert!(filmed.azimuth_deg == Some(30.0) && filmed.film_from.is_none(), "{filmed:?}");
        let filmed = viewpoint("turntable = true\nazimuth-deg = 30", &["--film-from", "003"]);
        assert!(!filmed.turntable && filmed.azimuth_deg.is_none(), "{filmed:?}");
        assert_eq!(filmed.film_from.as_deref(), Some("003"));
    }

    #[test]
    fn a_scene_turns_off_a_switch_of_the_user() {
        let scene = tempfile::tempdir().unwrap();
        std::fs::write(scene.path().join(USER_FILE), "turntable = true").unwrap();
        let turntable =
            |of_scene: &str, typed: &[&str]| simulate_options(scene.path(), of_scene, typed).viewpoint.turntable;
        assert!(turntable("", &[]));
        assert!(!turntable("turntable = false", &[]));
        assert!(turntable("turntable = false", &["--turntable"]));
    }

    #[test]
    fn a_usage_error_shows_no_flags_of_the_files() {
        let scene = tempfile::tempdir().unwrap();
        std::fs::write(scene.path().join(config::FILE_NAME), "ask-views = 5\nscale = \"metric\"").unwrap();
        let message = |command: &str, flags: &[&str]| {
            let mut arguments: Vec<OsString> = vec!["gprop".into(), command.into(), scene.path().into()];
            arguments.extend(flags.iter().map(OsString::from));
            let error = parse_with(&arguments, None).unwrap_err();
            error.downcast::<clap::Error>().unwrap().to_string()
        };
        for (message, words) in [(message("show", &[]), "<FILE>"), (message("run", &["--view", "20"]), "--view")] {
            assert!(message.contains(words), "{message}");
            assert!(!message.contains("--ask-views") && !message.contains("--scale"), "{message}");
        }
    }

    #[test]
    fn another_scenario_does_not_take_over_parameters() {
        let scene = tempfile::tempdir().unwrap();
        let set = |of_scene: &str, typed: &[&str]| simulate_options(scene.path(), of_scene, typed).set;
        let poke = "scenario = \"poke\"\nset = [\"force=9\"]";
        assert_eq!(set(poke, &[]), ["force=9"]);
        assert_eq!(set(poke, &["--scenario", "poke"]), ["force=9"]);
        assert_eq!(set(poke, &["--scenario", "wind"]), [] as [&str; 0]);
        assert_eq!(set(poke, &["--scenario", "wind", "--set", "speed=1"]), ["speed=1"]);
        let drop = "set = [\"height=2\", \"tilt=5\"]";
        assert_eq!(set(drop, &["--scenario", "drop"]), ["height=2", "tilt=5"]);
        assert_eq!(set(drop, &["--drop-height", "0.1"]), ["tilt=5"]);
        let release = "scenario = \"release\"\nset = [\"height=2\"]";
        assert_eq!(set(release, &["--drop-height", "0.1"]), ["height=2"], "another parameter of the same name");
        let recorded = r#"{"flags": {"simulate": ["--scenario=wind", "--set=speed=1"]}}"#;
        std::fs::create_dir(scene.path().join("gprop")).unwrap();
        std::fs::write(scene.path().join("gprop/run.json"), recorded).unwrap();
        assert_eq!(set("", &[]), ["speed=1"]);
        assert_eq!(set("", &["--scenario", "wind"]), ["speed=1"]);
        assert_eq!(set("", &["--scenario", "drop"]), [] as [&str; 0]);
    }

    /// Options that no scene may set: those that run code, send, pay, wait, write, or read elsewhere. A new option must
    /// be added here or to its stage's `SCENE_KEYS`.
    const USER_ONLY: &[&str] = &[
        "allow-read",
        "also",
        "answers",
        "cache-embeddings",
        "decoder",
        "fps",
        "hints",
        "lmm-body",
        "lmm-key-env",
        "lmm-key-header",
        "lmm-max-tokens",
        "lmm-model",
        "lmm-parallel",
        "lmm-retries",
        "lmm-temperature",
        "lmm-timeout-s",
        "lmm-url",
        "lmm-wait-s",
        "max-questions",
        "max-simulation-minutes",
        "max-usd",
        "object-at",
        "offline",
        "ort-lib",
        "preset",
        "price",
        "prices",
        "prompts",
        "recordings",
        "sam-decoder",
        "sam-encoder",
        "size",
        "threads",
    ];

    #[test]
    fn every_option_is_a_scenes_or_the_users() {
        for Field { options, scene_keys, .. } in fields() {
            let has = |key: &config::SceneKey| options.get_arguments().any(|arg| arg.get_long() == Some(key.name));
            assert!(scene_keys.iter().all(has), "one of these is not an option of its stage: {scene_keys:?}");
        }
        let known = known_flags();
        let (scene, user): (Vec<_>, Vec<_>) = known.iter().partition(|flag| flag.scene.is_some());
        let mut user: Vec<&str> = user.iter().map(|flag| flag.name.as_str()).collect();
        user.sort_unstable();
        user.dedup();
        assert_eq!(user, USER_ONLY, "may a scene from a stranger set it?");
        assert_eq!(scene.len(), pipeline::scene_keys().len(), "every key is listed once");
    }

    /// The options that a run leaves in its work folder for later commands. Those that no scene may set are the preset,
    /// which stands for options that a scene may set, and the user's own folders, which are taken only from a work folder
    /// that the user names.
    #[test]
    fn a_run_records_a_scenes_options_and_little_else() {
        let known = known_flags();
        let recorded: Vec<_> = known.iter().filter(|flag| last_run::is_recorded(flag)).collect();
        let others = recorded.iter().filter(|flag| flag.scene.is_none());
        assert_eq!(others.map(|flag| flag.name.as_str()).collect::<Vec<_>>(), ["preset", "prompts", "recordings"]);
        assert!(known.iter().all(|flag| flag.scene.is_none() || last_run::is_recorded(flag)));
        let may_be_of_scene = |flag: &&str| {
            let name = config::name_of(OsStr::new(flag));
            known.iter().any(|known| known.name == name && known.scene.is_some())
        };
        assert!(Preset::value_variants().iter().all(|preset| preset.flags().iter().all(may_be_of_scene)));
        let stored = serde_json::to_value(pipeline::Options::default()).unwrap();
        assert!(
            recorded.iter().all(|flag| stored.get(flag.field).is_some()),
            "each is stored with its stage's options"
        );
    }

    #[test]
    fn a_scene_names_no_path_unchecked() {
        let stages = pipeline::Options::augment_args(clap::Command::new("stages"));
        for flag in known_flags() {
            let argument = stages.get_arguments().find(|argument| argument.get_long() == Some(&flag.name));
            let Some(value_names) = argument.and_then(clap::Arg::get_value_names) else { continue };
            let says_path =
                value_names.iter().any(|name| ["FILE", "DIR", "PATH"].iter().any(|word| name.contains(word)));
            let unchecked = matches!(flag.scene, Some(config::SceneValue::Any | config::SceneValue::AnyOf { .. }));
            assert!(!(unchecked && (says_path || flag.is_path)), "--{} takes a path", flag.name);
        }
    }
}
