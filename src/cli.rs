//! Subcommands and flags: what the user typed becomes a call into the pipeline or a stage, and a result on stdout.

mod evaluate;
mod scene;
mod tools;

use std::ffi::{OsStr, OsString};
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::{Args, CommandFactory, Parser, Subcommand};
use serde::Serialize;

use crate::exit::UsageError;
use crate::pipeline::{self, Stage};
use crate::progress::Progress;
use crate::{config, inspect, materials, setup};

/// Materials and physical properties for every Gaussian of a 3D Gaussian Splatting scene.
#[derive(Debug, Parser)]
#[command(name = "gprop", version, args_override_self = true, max_term_width = 110)]
struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Flags that any command takes.
#[derive(Debug, Clone, Args)]
struct Global {
    /// Print the result as JSON.
    #[arg(long, global = true, display_order = 900)]
    json: bool,
    /// No progress, no summary; errors and warnings only.
    #[arg(short, long, global = true, display_order = 901)]
    quiet: bool,
    /// Say more on stderr; twice for debugging.
    #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 902)]
    verbose: u8,
    /// Threads to use; all cores where it is not given. The result is the same on any number.
    #[arg(long, global = true, value_name = "N", display_order = 903)]
    threads: Option<usize>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The main job: every stage in order; what an earlier run left is reused.
    Run(RunArgs),
    /// SAM parts of the chosen views (and what they need).
    Segment(SceneArgs),
    /// What each part is made of, by recorded answers or a model; or move queries out and answers in.
    Query(QueryArgs),
    /// A material for every Gaussian.
    Vote(SceneArgs),
    /// 3D parts: volume, thickness, mass.
    Parts(SceneArgs),
    /// Material Point Method on the Gaussians.
    Simulate(SceneArgs),
    /// The force with which a gripper may lift the object.
    Grasp(SceneArgs),
    /// Do photos, cameras and Gaussians agree? What lies in a scene folder, and how its parts fit together.
    Inspect(inspect::Args),
    /// Measure against a reference or ground truth.
    #[command(subcommand)]
    Evaluate(Evaluate),
    /// The material library.
    #[command(subcommand)]
    Materials(Materials),
    /// Fetch ONNX Runtime and SAM into the cache, or say where they lie.
    Setup(SetupArgs),
    /// Check ONNX Runtime and SAM without fetching anything.
    Doctor(SetupArgs),
}

#[derive(Debug, Args)]
struct SceneArgs {
    /// Folder with a 3DGS PLY, cameras and photos.
    scene: PathBuf,
    /// Work folder; SCENE/gprop where it is not given.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Do this stage and those after it again, whatever an earlier run left.
    #[arg(long, value_name = "STAGE")]
    from: Option<Stage>,
    /// Say what would be done and what it would cost, and do nothing.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    options: pipeline::Options,
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Stop after this stage.
    #[arg(long, value_name = "STAGE", default_value = "report")]
    to: Stage,
    #[command(flatten)]
    scene: SceneArgs,
}

#[derive(Debug, Args)]
struct QueryArgs {
    /// Write the open queries (sheets, prompt, schema) into this folder, to be answered elsewhere.
    #[arg(long, value_name = "DIR", conflicts_with = "import")]
    export: Option<PathBuf>,
    /// Read answers from this folder, check them and record them.
    #[arg(long, value_name = "DIR")]
    import: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
}

#[derive(Debug, Args)]
struct SetupArgs {
    #[command(flatten)]
    options: setup::Options,
}

#[derive(Debug, Subcommand)]
enum Evaluate {
    /// Masks of one picture against those of a reference generator, level by level.
    Masks {
        /// The picture, as the reference generator saw it.
        image: PathBuf,
        /// Settings and masks of the reference (JSON; masks run-length encoded).
        reference: PathBuf,
        #[command(flatten)]
        setup: setup::Options,
    },
    /// Masses against true ones: ADE, ALDE, APE, MnRE as NeRF2Physics computes them, and PRA.
    Mass {
        /// Scene folders that `gprop run` has been through, with `ground_truth/parts.json`.
        #[arg(required_unless_present = "predictions")]
        scenes: Vec<PathBuf>,
        /// Work folder of the scene; SCENE/gprop where it is not given. With one scene only.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Predictions in NeRF2Physics' format: [low, high] in kilograms by id.
        #[arg(long, value_name = "FILE", requires = "truth", conflicts_with_all = ["scenes", "out"])]
        predictions: Option<PathBuf>,
        /// True masses: kilograms by what comes before the first underscore of an id.
        #[arg(long, value_name = "FILE", requires = "predictions")]
        truth: Option<PathBuf>,
    },
    /// Shore hardness at points of the photos against readings: A as 0 to 100 and D as 100 to 200 on one axis.
    Hardness {
        /// Readings (CSV with the columns scene,view,x,y,shore,hardness; a scene is a folder relative to the file that
        /// `gprop run` has been through, x and y are pixels of its view, shore is A or D).
        points: PathBuf,
        /// Work folder of the scene; SCENE/gprop where it is not given. With points of one scene only.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

#[derive(Debug, Subcommand)]
enum Materials {
    /// One material with every property and its sources.
    Show {
        /// Name or alias; case and punctuation do not matter.
        name: String,
        #[command(flatten)]
        library: materials::Options,
    },
    /// The names of all materials, or of one family.
    List {
        /// Only this family.
        #[arg(long, value_name = "NAME")]
        family: Option<String>,
        #[command(flatten)]
        library: materials::Options,
    },
    /// Check the library for what cannot be true.
    Check {
        /// Also print how many numbers come from a cited table.
        #[arg(long)]
        stats: bool,
        #[command(flatten)]
        library: materials::Options,
    },
}

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
        Command::Run(args) => scene::run(global, &args.scene, args.to),
        Command::Segment(args) => scene::run(global, args, Stage::Segment),
        Command::Query(args) => scene::query(global, args),
        Command::Vote(args) => scene::run(global, args, Stage::Vote),
        Command::Parts(args) => scene::run(global, args, Stage::Parts),
        Command::Simulate(args) => scene::run(global, args, Stage::Simulate),
        Command::Grasp(args) => scene::run(global, args, Stage::Grasp),
        Command::Inspect(args) => {
            let (inspection, text) = inspect::command(args, global.progress())?;
            print(global, &inspection, || text)
        }
        Command::Evaluate(what) => evaluate::evaluate(global, what),
        Command::Materials(what) => tools::materials(global, what),
        Command::Setup(args) => tools::set_up(global, &args.options),
        Command::Doctor(args) => tools::doctor(global, &args.options),
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
    Ok(Cli::parse_from(all))
}

/// The options of a scene that was named without any: the defaults and what its `gprop.toml` says.
fn options_of(scene: &Path) -> anyhow::Result<pipeline::Options> {
    let typed = [OsStr::new("gprop"), OsStr::new("parts"), scene.as_os_str()].map(OsStr::to_owned);
    match parse(&typed)?.command {
        Command::Parts(args) => Ok(args.options),
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
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "gprop=info",
        (false, _) => "gprop=debug",
    };
    let filter = tracing_subscriber::EnvFilter::new(level);
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(io::stderr).without_time().init();
}

/// Prints a result: as JSON where that is asked for, else as text. A reader that has gone away is no error.
fn print(global: &Global, value: &impl Serialize, text: impl FnOnce() -> String) -> anyhow::Result<()> {
    let text = if global.json { serde_json::to_string_pretty(value)? } else { text() };
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
