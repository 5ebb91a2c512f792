//! Subcommands and flags: what the user typed becomes a call into the pipeline or a stage, and a result on stdout.

mod evaluate;
mod picture;
mod query;
mod scene;
mod simulate;
mod tools;

use std::ffi::{OsStr, OsString};
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::{Args, CommandFactory, Parser, Subcommand};
use serde::Serialize;

use crate::exit::UsageError;
use crate::pipeline::{self, Stage};
use crate::progress::Progress;
use crate::{config, export, inspect, materials, setup};

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
    /// SAM parts of the chosen views (and what they need), or of one picture where SCENE is one.
    Segment(SceneArgs),
    /// What each part is made of, by recorded answers or a model; or move queries out and answers in.
    Query(QueryArgs),
    /// A material for every Gaussian.
    Vote(SceneArgs),
    /// 3D parts: volume, thickness, mass.
    Parts(SceneArgs),
    /// Material Point Method on the Gaussians.
    Simulate(SimulateArgs),
    /// Where and with which force a gripper may lift the object; or calibrate a gripper.
    #[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
    Grasp(GraspArgs),
    /// The result in the format of another program.
    Export(ExportArgs),
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
    #[command(flatten)]
    work: WorkArgs,
}

/// How a command works on its scene.
#[derive(Debug, Clone, Args)]
struct WorkArgs {
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
struct GraspArgs {
    #[command(subcommand)]
    what: Option<Grasp>,
    /// Folder with a 3DGS PLY, cameras and photos.
    #[arg(required = true)]
    scene: Option<PathBuf>,
    #[command(flatten)]
    work: WorkArgs,
}

#[derive(Debug, Subcommand)]
enum Grasp {
    /// The command of a gripper from repeated measurements: a polynomial of 5th order, checked to rise.
    Calibrate {
        /// Measurements (CSV with the header command,force_n; any number at each command).
        points: PathBuf,
        /// The gripper they are of: a built-in one or a TOML profile.
        #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
        gripper: String,
        /// Plot measurements, curve and residuals into this file.
        #[arg(long, value_name = "FILE.svg")]
        plot: Option<PathBuf>,
        /// Write the gripper's profile with the measurements in it into this file, for --gripper.
        #[arg(long, value_name = "FILE.toml")]
        profile: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
struct ExportArgs {
    /// Folder with a 3DGS PLY, cameras and photos; what is not done yet is done first.
    scene: PathBuf,
    /// What to write
    #[arg(long, value_enum)]
    format: export::Format,
    /// Folder to write into.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Work folder; SCENE/gprop where it is not given.
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
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
struct SimulateArgs {
    /// Folder with a 3DGS PLY, cameras and photos.
    #[arg(required_unless_present = "list")]
    scene: Option<PathBuf>,
    /// List the scenarios with their parameters, and do nothing.
    #[arg(long)]
    list: bool,
    /// Run a configuration of this program as it would: its units, laws, boundary conditions and defects.
    #[arg(long, value_name = "PROGRAM", requires = "config")]
    compat: Option<Compat>,
    /// The configuration (PhysGaussian's JSON). SCENE may be a PLY then.
    #[arg(long, value_name = "FILE", requires = "compat")]
    config: Option<PathBuf>,
    #[command(flatten)]
    work: WorkArgs,
}

/// A program whose simulations gprop reproduces.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Compat {
    #[value(name = "physgaussian")]
    PhysGaussian,
}

#[derive(Debug, Args)]
#[command(
    after_help = "A picture may stand in the scene's place: its parts are found by its alpha or --mask, and a map of \
                        its materials is drawn."
)]
struct QueryArgs {
    /// Write the open queries (sheets, prompt, schema, a form to fill in) into this folder, to be answered elsewhere.
    #[arg(long, value_name = "DIR", group = "errand")]
    export: Option<PathBuf>,
    /// Read answers from this folder, check them and record them.
    #[arg(long, value_name = "DIR", group = "errand")]
    import: Option<PathBuf>,
    /// Send the open queries by OpenAI's Batch API, at half the price and within a day; or collect the answers.
    #[arg(long, value_name = "STEP", group = "errand")]
    batch: Option<query::BatchStep>,
    /// Remove the scene's recordings that no part uses with these options.
    #[arg(long, group = "errand")]
    prune: bool,
    /// Foreground of a single picture: white on the object, or its alpha.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
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
    /// Pick-up, no-damage and success rate of gripping policies, recorded or predicted.
    #[command(group(clap::ArgGroup::new("from").required(true)))]
    Grasp {
        /// Recorded outcomes (CSV with the header object,policy,picked_up,undamaged; true or false).
        #[arg(long, value_name = "FILE.csv", group = "from")]
        outcomes: Option<PathBuf>,
        /// Predict them from true properties of objects (CSV; see docs/grasp.md) for gprop and three fixed forces.
        #[arg(long, value_name = "FILE.csv", group = "from")]
        objects: Option<PathBuf>,
        /// The gripper that the predicted policies command.
        #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
        gripper: String,
    },
    /// Masks of one picture against those of a reference generator, level by level.
    Masks {
        /// The picture, as the reference generator saw it.
        image: PathBuf,
        /// Settings and masks of the reference (JSON; masks run-length encoded).
        reference: PathBuf,
        #[command(flatten)]
        setup: setup::Options,
    },
    /// A run in the public PhysGaussian solver's setting against its trajectory, or a filling against its filling.
    Simulation {
        /// The trajectory (NPZ) with its setting.
        reference: PathBuf,
    },
    /// Prompts, time and part IoU of --prompts adaptive beside --prompts grid, on scenes with true part maps.
    Prompts {
        /// Scene folders with SCENE/ground_truth/part_maps/VIEW.png: 8-bit part numbers, 255 where there is no part.
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        #[command(flatten)]
        scene: Box<crate::scene::Options>,
        #[command(flatten)]
        segment: Box<crate::segment::Options>,
        #[command(flatten)]
        setup: Box<setup::Options>,
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
        Command::Segment(args) if args.scene.is_file() => picture::segment(global, args),
        Command::Segment(args) => scene::run(global, args, Stage::Segment),
        Command::Query(args) => query::query(global, args),
        Command::Vote(args) => scene::run(global, args, Stage::Vote),
        Command::Parts(args) => scene::run(global, args, Stage::Parts),
        Command::Simulate(args) => simulate::run(global, args),
        Command::Grasp(GraspArgs { what: Some(what), .. }) => tools::grasp(global, what),
        Command::Grasp(GraspArgs { scene: Some(scene), work, .. }) => {
            let args = SceneArgs { scene: scene.clone(), work: work.clone() };
            scene::run(global, &args, Stage::Grasp)
        }
        Command::Grasp(_) => unreachable!("clap asks for a scene where there is no subcommand"),
        Command::Export(args) => scene::export(global, args),
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
