//! Subcommands and flags: what the user typed becomes a call into the pipeline or a stage, and a result on stdout.

mod arguments;
mod batch;
mod evaluate;
mod manual;
mod picture;
mod query;
mod scene;
mod simulate;
mod tools;

use std::ffi::{OsStr, OsString};
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Args, CommandFactory, FromArgMatches};
use serde::Serialize;

use crate::exit::UsageError;
use crate::pipeline::{self, Stage};
use crate::progress::Progress;
use crate::{config, inspect};
use arguments::{
    BatchArgs, Cli, Command, Compat, Evaluate, ExportArgs, Global, Grasp, GraspArgs, Materials, QueryArgs, SceneArgs,
    ShowArgs, SimulateArgs, WorkArgs,
};

/// Does what `arguments` (the program's name first) ask for.
///
/// # Errors
/// Whatever went wrong, with a typed error in its chain from which [`crate::exit::of`] finds the exit code. Usage that clap
/// refuses, help and version end the process right here.
pub fn run(arguments: Vec<OsString>) -> anyhow::Result<()> {
    let cli = parse(&arguments)?;
    let global = &cli.global;
    start_log(global);
    if let Some(threads) = global.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|error| UsageError(format!("--threads {threads}: {error}")))?;
    }
    match &cli.command {
        Command::Run(args) => {
            if args.end_with_stdin {
                crate::batch::end_with_the_batch();
            }
            scene::run(global, &args.scene.scene, &args.scene.work, args.to)
        }
        Command::Segment(args) if args.scene.is_file() => picture::segment(global, args),
        Command::Segment(args) => scene::run(global, &args.scene, &args.work, Stage::Segment),
        Command::Query(args) => query::query(global, args),
        Command::Vote(args) => scene::run(global, &args.scene, &args.work, Stage::Vote),
        Command::Show(args) => scene::show(global, args),
        Command::Parts(args) => scene::run(global, &args.scene, &args.work, Stage::Parts),
        Command::Simulate(args) => simulate::run(global, args),
        Command::Grasp(GraspArgs { what: Some(what), .. }) => tools::grasp(global, what),
        Command::Grasp(GraspArgs { scene: Some(folder), work, .. }) => scene::run(global, folder, work, Stage::Grasp),
        Command::Grasp(_) => unreachable!("clap asks for a scene where there is no subcommand"),
        Command::Export(args) => scene::export(global, args),
        Command::Inspect(args) => {
            let (inspection, text) = inspect::command(args, global.progress())?;
            print(global, &inspection, || text)
        }
        Command::Batch(args) => batch::run(global, args),
        Command::Evaluate(what) => evaluate::evaluate(global, what),
        Command::Materials(what) => tools::materials(global, what),
        Command::Setup(args) => tools::set_up(global, &args.options),
        Command::Doctor(args) => tools::doctor(global, &args.options),
        Command::Completions { shell } => manual::completions(global, *shell),
        Command::Man { out: None } => manual::page(global),
        Command::Man { out: Some(folder) } => manual::pages(global, folder),
    }
}

/// Parses what was typed behind the flags that the scene's `gprop.toml` stands for. A first look, which forgives
/// everything, finds the scene.
fn parse(arguments: &[OsString]) -> anyhow::Result<Cli> {
    let mut all = arguments.to_vec();
    if let Ok(typed) = Cli::command().ignore_errors(true).try_get_matches_from(arguments)
        && let Some((name, matches)) = typed.subcommand()
        && let Ok(Some(scene)) = matches.try_get_one::<PathBuf>("scene")
    {
        // The file speaks to every command on the scene; each takes the options that it has.
        let command = Cli::command();
        let own = command.find_subcommand(name).into_iter().flat_map(clap::Command::get_arguments);
        let own: Vec<&str> = own.filter_map(clap::Arg::get_long).collect();
        let is_own = |flag: &String| own.contains(&flag.trim_start_matches('-').split('=').next().unwrap_or_default());
        let flags = config::flags(scene, &scene_flags())?.into_iter().filter(is_own);
        let place = 1 + arguments.iter().position(|argument| argument == name).unwrap_or(0);
        all.splice(place..place, flags.map(OsString::from));
    }
    let matches = Cli::command().get_matches_from(all);
    let mut cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    cli.global.typed = matches.subcommand().map_or_else(Vec::new, |(_, matches)| typed_flags(matches));
    Ok(cli)
}

/// The stages' flags that were given in `matches`, as they may be given again.
fn typed_flags(matches: &clap::ArgMatches) -> Vec<OsString> {
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
        let with = |value: &OsStr| [OsStr::new(&format!("--{flag}=")), value].into_iter().collect();
        match argument.get_value_delimiter() {
            Some(delimiter) => typed.push(with(&values.join(OsStr::new(&delimiter.to_string())))),
            None => typed.extend(values.into_iter().map(with)),
        }
    }
    typed
}

/// The options of a scene that was named with some `flags` or none: the defaults, what its `gprop.toml` says, the flags.
fn options_of(scene: &Path, flags: &[OsString]) -> anyhow::Result<pipeline::Options> {
    let typed = [OsStr::new("gprop"), OsStr::new("parts"), scene.as_os_str()].map(OsStr::to_owned);
    match parse(&[&typed, flags].concat())?.command {
        Command::Parts(args) => Ok(args.work.options),
        _ => Err(UsageError(format!("{scene:?} is no scene folder")).into()),
    }
}

/// The options that a scene may set: those of the stages, not those of the command.
fn scene_flags() -> Vec<config::Flag> {
    let stages = pipeline::Options::augment_args(clap::Command::new("stages"));
    let flag = |argument: &clap::Arg| {
        let name = argument.get_long()?.to_owned();
        Some(config::Flag { name, takes_value: argument.get_action().takes_values() })
    };
    stages.get_arguments().filter_map(flag).collect()
}

fn start_log(global: &Global) {
    let level = match (global.quiet, global.verbose) {
        (true, _) | (false, 0) => "warn",
        (false, 1) => "gprop=info",
        (false, _) => "gprop=debug",
    };
    let filter = tracing_subscriber::EnvFilter::new(level);
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(io::stderr).without_time();
    log.with_target(global.verbose > 0).init();
}

/// Prints a result: as JSON where that is asked for, else as text. A reader that has gone away is no error.
fn print(global: &Global, value: &impl Serialize, text: impl FnOnce() -> String) -> anyhow::Result<()> {
    print_text(&if global.json { serde_json::to_string_pretty(value)? } else { text() })
}

/// Prints a text. A reader that has gone away is no error.
fn print_text(text: &str) -> anyhow::Result<()> {
    match writeln!(io::stdout(), "{}", text.trim_end()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(UsageError(format!("cannot print: {error}")).into())
        }
        _ => Ok(()),
    }
}

impl Global {
    fn progress(&self) -> Progress {
        match (self.quiet, io::stderr().is_terminal()) {
            (true, _) => Progress::Hidden,
            (false, true) => Progress::Shown,
            (false, false) => Progress::Lines,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stage_options_are_handed_on_as_they_were_typed() {
        let flags = |typed: &str| {
            let typed: Vec<OsString> = typed.split(' ').map(OsString::from).collect();
            parse(&typed).unwrap().global.typed
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
}
