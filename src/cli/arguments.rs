//! What can be typed: subcommands and their flags.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use crate::evaluate::vocabulary::Vocabulary;
use crate::pipeline::{self, Stage};
use crate::report::figure::Shown;
use crate::{batch, export, inspect, materials, setup};

use super::query;

/// Materials and physical properties for every Gaussian of a 3D Gaussian Splatting scene.
#[derive(Debug, Parser)]
#[command(name = "gprop", version, args_override_self = true, max_term_width = 110)]
pub struct Cli {
    #[command(flatten)]
    pub global: Global,
    #[command(subcommand)]
    pub command: Command,
}

/// Flags that any command takes.
#[derive(Debug, Clone, Args)]
pub struct Global {
    /// Print the result as JSON.
    #[arg(long, global = true, display_order = 900)]
    pub json: bool,
    /// No progress, no summary; errors and warnings only.
    #[arg(short, long, global = true, display_order = 901)]
    pub quiet: bool,
    /// Say more on stderr; twice for debugging.
    #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 902)]
    pub verbose: u8,
    /// Threads to use; all cores where it is not given. The result is the same on any number.
    #[arg(long, global = true, value_name = "N", display_order = 903)]
    pub threads: Option<usize>,
    /// The stages' flags as they were typed or stand in `gprop.toml`.
    #[arg(skip)]
    pub typed: Vec<OsString>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// The main job: every stage in order; what an earlier run left is reused.
    Run(RunArgs),
    /// SAM parts of the chosen views (and what they need), or of one picture where SCENE is one.
    Segment(SceneArgs),
    /// What each part is made of, by recorded answers or a model; or move queries out and answers in.
    Query(QueryArgs),
    /// A material for every Gaussian.
    Vote(SceneArgs),
    /// A picture of the materials, the parts or their confidence as any view of the scene sees them.
    Show(ShowArgs),
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
    /// All scenes of a data set, each in a process of its own; done scenes are skipped.
    Batch(Box<BatchArgs>),
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
    /// Print the script by which a shell completes gprop's commands and flags.
    Completions {
        /// The shell that is to read it.
        shell: clap_complete::Shell,
    },
    /// Print gprop's manual page, or write the pages of all commands into a folder.
    Man {
        /// Folder to write gprop.1, gprop-run.1 and so on into.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Folder with a 3DGS PLY, cameras and photos.
    pub scene: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// How a command works on its scene.
#[derive(Debug, Clone, Args)]
pub struct WorkArgs {
    /// Work folder; SCENE/gprop where it is not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Do this stage and those after it again, whatever an earlier run left.
    #[arg(long, value_name = "STAGE")]
    pub from: Option<Stage>,
    /// Say what would be done and what it would cost, and do nothing.
    #[arg(long)]
    pub dry_run: bool,
    #[command(flatten)]
    pub options: pipeline::Options,
}

#[derive(Debug, Args)]
pub struct ShowArgs {
    /// Folder with a 3DGS PLY, cameras and photos; what `gprop run` has not done of it up to the vote is done first.
    pub scene: PathBuf,
    /// The picture to write (PNG).
    pub to: PathBuf,
    /// What it shows.
    #[arg(long, value_enum, default_value_t)]
    pub what: Shown,
    /// Name of the view, one that voted or not; the first that voted where it is not given.
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    #[command(flatten)]
    pub work: WorkArgs,
}

#[derive(Debug, Args)]
pub struct GraspArgs {
    #[command(subcommand)]
    pub what: Option<Grasp>,
    /// Folder with a 3DGS PLY, cameras and photos.
    #[arg(required = true)]
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub work: WorkArgs,
}

#[derive(Debug, Subcommand)]
pub enum Grasp {
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
pub struct ExportArgs {
    /// Folder with a 3DGS PLY, cameras and photos; what is not done yet is done first.
    pub scene: PathBuf,
    /// What to write
    #[arg(long, value_enum)]
    pub format: export::Format,
    /// Folder to write into.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Work folder; SCENE/gprop where it is not given.
    #[arg(long, value_name = "DIR")]
    pub work: Option<PathBuf>,
    #[command(flatten)]
    pub options: pipeline::Options,
}

#[derive(Debug, Args)]
pub struct RunArgs {
    /// The last stage; those before it are done as far as it needs them.
    #[arg(long, value_name = "STAGE", default_value = "report")]
    pub to: Stage,
    /// For `gprop batch`: end when stdin closes.
    #[arg(long, hide = true)]
    pub end_with_stdin: bool,
    #[command(flatten)]
    pub scene: SceneArgs,
}

#[derive(Debug, Args)]
pub struct BatchArgs {
    /// Folder with the scenes: ABO-500, MVImgNet, or any folder of scene folders.
    pub folder: PathBuf,
    /// The last stage; those before it are done as far as it needs them.
    #[arg(long, value_name = "STAGE", default_value = "report")]
    pub to: Stage,
    /// Do this stage and those after it again in every scene, whatever an earlier run left.
    #[arg(long, value_name = "STAGE")]
    pub from: Option<Stage>,
    /// Folder for the work folders, each named as its scene, and for batch/ with what concerns them all; SCENE/gprop and
    /// FOLDER/gprop/batch where it is not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// List the scenes, how they stand and what they are taken to need, and do nothing.
    #[arg(long)]
    pub dry_run: bool,
    /// Run nothing; make the summary of all shards, which must have had the same choice of scenes.
    #[arg(long, conflicts_with_all = ["dry_run", "queries"])]
    pub merge: bool,
    /// Send the open queries of all scenes by OpenAI's Batch API, at half the price and within a day; or collect the answers.
    #[arg(long, value_name = "STEP", conflicts_with = "dry_run")]
    pub queries: Option<batch::QuestionStep>,
    #[command(flatten)]
    pub batch: batch::Options,
    #[command(flatten)]
    pub options: pipeline::Options,
}

#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// Folder with a 3DGS PLY, cameras and photos.
    #[arg(required_unless_present = "list")]
    pub scene: Option<PathBuf>,
    /// List the scenarios with their parameters, and do nothing.
    #[arg(long)]
    pub list: bool,
    /// Run a configuration of this program as it would: its units, laws, boundary conditions and defects.
    #[arg(long, value_name = "PROGRAM", requires = "config")]
    pub compat: Option<Compat>,
    /// The configuration (PhysGaussian's JSON). SCENE may be a PLY then.
    #[arg(long, value_name = "FILE", requires = "compat")]
    pub config: Option<PathBuf>,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// A program whose simulations gprop reproduces.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub enum Compat {
    #[value(name = "physgaussian")]
    PhysGaussian,
}

#[derive(Debug, Args)]
#[command(
    after_help = "A picture may stand in the scene's place: its parts are found by its alpha or --mask, and a map of \
                        its materials is drawn."
)]
pub struct QueryArgs {
    /// Write the open queries (sheets, prompt, schema, a form to fill in) into this folder, to be answered elsewhere.
    #[arg(long, value_name = "DIR", group = "errand")]
    pub export: Option<PathBuf>,
    /// Read answers from this folder, check them and record them.
    #[arg(long, value_name = "DIR", group = "errand")]
    pub import: Option<PathBuf>,
    /// Send the open queries by OpenAI's Batch API, at half the price and within a day; or collect the answers.
    #[arg(long, value_name = "STEP", group = "errand")]
    pub batch: Option<query::BatchStep>,
    /// Remove the scene's recordings that no part uses with these options.
    #[arg(long, group = "errand")]
    pub prune: bool,
    /// Foreground of a single picture: white on the object, or its alpha.
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,
    #[command(flatten)]
    pub scene: SceneArgs,
}

#[derive(Debug, Args)]
pub struct SetupArgs {
    #[command(flatten)]
    pub options: setup::Options,
}

#[derive(Debug, Subcommand)]
pub enum Evaluate {
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
    /// Materials rendered into labelled views, as IoU by label: the paper's table with its two ablations.
    Segmentation {
        /// Scene folders; what `gprop run` has not done of them up to the vote is done first.
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Label maps (one PNG a view, and labels.json or EISeg's autosave_label.txt): a folder inside each scene, or a
        /// folder with one such folder a scene by its name, or the folder of the only scene.
        #[arg(long, value_name = "DIR")]
        truth: PathBuf,
        /// The label set that materials and labels are counted by.
        #[arg(long, value_enum, default_value_t)]
        labels: Vocabulary,
        /// Work folder of the scene; SCENE/gprop where it is not given. With one scene only.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
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
pub enum Materials {
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
