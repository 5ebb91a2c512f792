//! The command-line arguments: subcommands and their flags.

use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::config::option_values::{self, from_to};
use crate::evaluate::vocabulary::Vocabulary;
use crate::pictures::figure::Shown;
use crate::pipeline::{self, FieldFlags, Stage};
use crate::query::batch_api;
use crate::scene::SizedMarker;
use crate::{audit, batch, export, grasp, inspect, materials, objects, scene, setup};

/// More than the cores of any machine on which gprop was run. A thread takes a 2 MB stack and milliseconds to start.
const MOST_THREADS: usize = 1024;

/// More than anyone lets a program spend on one scene after another.
const MOST_USD: f64 = 1e6;

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
    /// Show no progress and no summary, only errors and warnings.
    #[arg(short, long, global = true, display_order = 901)]
    pub quiet: bool,
    /// Log more to stderr; give it twice for debugging.
    #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 902)]
    pub verbose: u8,
    /// Number of threads; the result does not depend on it [default: all cores]
    #[arg(long, global = true, value_name = "N", display_order = 903, value_parser = from_to(1, MOST_THREADS))]
    pub threads: Option<usize>,
    /// For `gprop mcp`: tell what happens as lines of JSON on stderr, and end when stdin closes.
    #[arg(long, global = true, hide = true)]
    pub for_mcp: bool,
    #[arg(skip)]
    pub flags: StageFlags,
    /// True in the process of a scene of a batch.
    #[arg(skip)]
    pub is_in_batch: bool,
}

/// The stages' flags of a command line, by where they come from.
#[derive(Debug, Clone, Default)]
pub struct StageFlags {
    /// Those that were typed.
    pub typed: Vec<OsString>,
    /// Whether the command goes on from the last run.
    pub goes_on: bool,
    /// Those of the last run that are used because they were not typed again.
    pub of_last_run: Vec<OsString>,
    /// All: those of the preset, of the configuration files, of the last run, and typed.
    pub effective: Vec<OsString>,
    /// Those of the last run and typed, as they are written to `run.json`.
    pub recorded: FieldFlags,
    /// The stage whose options are not written there, because they are for this command only.
    pub once: Option<Stage>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run every stage in order, reusing the results of earlier runs; of a URDF or MJCF, link by link.
    Run(RunArgs),
    /// Run every stage as `gprop run` does; with --open, open the report in the browser.
    Report(ReportArgs),
    /// Open the report of an earlier run, or the page of an earlier batch, in the browser.
    View(ViewArgs),
    /// Cut the chosen views of a scene, or a single picture, into segments with SAM.
    #[command(after_help = "SCENE may also be a single picture: its alpha channel, if it has one, marks the object.")]
    Segment(SceneArgs),
    /// Get the material of each part from recorded answers or a model; or export questions and import answers.
    Query(QueryArgs),
    /// Answer the questions yourself, on a page on this machine that shows after each answer how the mass stands.
    Answer(AnswerArgs),
    /// Give every Gaussian a material by a vote of the views.
    Vote(SceneArgs),
    /// Draw the materials, the parts or the confidence from any view of the scene, or film them on a turntable.
    Show(ShowArgs),
    /// Compute volume, thickness and mass of the 3D parts.
    Parts(SceneArgs),
    /// Simulate the object with the Material Point Method.
    Simulate(SimulateArgs),
    /// Find where and with what force a gripper can lift the object; or calibrate a gripper.
    #[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
    Grasp(GraspArgs),
    /// Write the result in the format of another program.
    Export(ExportArgs),
    /// Show what a scene folder contains, and check whether photos, cameras and Gaussians agree.
    #[command(
        after_help = "Unless --views or --view-list is given, up to 60 views are compared, spread over all directions."
    )]
    Inspect(inspect::Args),
    /// List the objects that stand on the table of a capture, with a photo that shows their numbers.
    Objects(objects::Args),
    /// Check what URDF, MJCF, USD and glTF claim of masses, inertias, centres of mass, frictions and colliders; no model is asked.
    Audit(audit::Args),
    /// Run all scenes of a data set, each in its own process; scenes that are done are not run again.
    Batch(Box<BatchArgs>),
    /// Compare results with ground truth or a reference.
    #[command(subcommand)]
    Evaluate(Evaluate),
    /// Show, list or check the materials of the library.
    #[command(subcommand)]
    Materials(Materials),
    /// Draw a marker that, printed and photographed, gives a scene its scale.
    #[command(subcommand)]
    Scale(Scale),
    /// Serve these commands to an agent as tools of the Model Context Protocol (MCP), on stdin and stdout.
    Mcp(McpArgs),
    /// Fetch ONNX Runtime and SAM into the cache, or show where they are.
    Setup(SetupArgs),
    /// Check ONNX Runtime and SAM without fetching anything.
    Doctor(SetupArgs),
    /// Print the help of a command.
    Help {
        /// The command, such as `grasp` or `evaluate mass` [default: gprop itself]
        #[arg(value_name = "COMMAND")]
        of: Vec<String>,
    },
    /// Print a completion script for a shell.
    Completions {
        /// Shell to write the script for.
        shell: clap_complete::Shell,
    },
    /// Print gprop's manual page, or write the pages of all commands into a folder.
    Man {
        /// Folder for gprop.1, gprop-run.1 and the other pages.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Folder with a splat, cameras and photos, or a mesh (.glb, .gltf, .obj, .stl, .ply).
    pub scene: PathBuf,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// How a command works on its scene.
#[derive(Debug, Clone, Args)]
pub struct WorkArgs {
    /// Work folder [default: SCENE/gprop, or mug.gprop beside mug.glb]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Run this stage and those after it again, even if an earlier run did them.
    #[arg(long, value_name = "STAGE")]
    pub from: Option<Stage>,
    /// Show what would be done and what it would cost, without doing it.
    #[arg(long)]
    pub dry_run: bool,
    #[command(flatten)]
    pub last_run: LastRun,
    #[command(flatten)]
    pub options: pipeline::Options,
}

/// Whether a command [goes on from the last run](super::last_run).
#[derive(Debug, Clone, Args)]
pub struct LastRun {
    /// Start with the defaults and gprop.toml, not with the last run's options.
    #[arg(long)]
    pub fresh: bool,
}

#[derive(Debug, Args)]
pub struct ShowArgs {
    /// Folder with a splat, cameras and photos, or a mesh; stages that the picture needs and that have not run yet are run first.
    pub scene: PathBuf,
    /// File to write: a .png from one view, or a .gif or .mp4 (with ffmpeg) of the object on a turntable:
    /// photo colours, parts, materials and Young's modulus side by side, unless --what names another subject (not `vote`
    /// or `levels`).
    #[arg(value_name = "FILE")]
    pub to: PathBuf,
    /// The subject of the picture.
    #[arg(long, value_enum, default_value_t)]
    pub what: What,
    /// Name of the view of a .png; it need not have voted, except for `--what vote` [default: the voting view that shows
    /// most of the object]
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    #[command(flatten)]
    pub work: WorkArgs,
}

/// The subjects of `gprop show`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The field.
    Field(Shown),
    /// One view's answers beside the vote of all views.
    Vote,
    /// One view's segments at SAM's three levels.
    Levels,
}

impl Default for What {
    fn default() -> Self {
        Self::Field(Shown::default())
    }
}

impl clap::ValueEnum for What {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: std::sync::LazyLock<Vec<What>> = std::sync::LazyLock::new(|| {
            let of_field = Shown::value_variants().iter().copied().map(What::Field);
            of_field.chain([What::Vote, What::Levels]).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let picture = |name: &'static str, help: &'static str| Some(PossibleValue::new(name).help(help));
        match self {
            Self::Field(shown) => shown.to_possible_value(),
            Self::Vote => {
                picture("vote", "Photo, the materials in the answers about this view, and the vote of all views")
            }
            Self::Levels => picture("levels", "Photo and its segments at SAM's levels small, middle and large"),
        }
    }
}

#[derive(Debug, Args)]
pub struct GraspArgs {
    #[command(subcommand)]
    pub what: Option<Grasp>,
    /// Folder with a splat, cameras and photos, or a mesh.
    #[arg(required = true)]
    pub scene: Option<PathBuf>,
    #[command(flatten)]
    pub work: WorkArgs,
}

#[derive(Debug, Args)]
pub struct McpArgs {
    /// Folder that the tools may read and write; may be repeated. Links that lead out of it are not followed [default: the
    /// current folder]
    #[arg(long = "root", value_name = "DIR", value_parser = option_values::folder())]
    pub roots: Vec<PathBuf>,
    /// Let the tool `run` ask the model that your configuration names, for at most this many US dollars until the server ends
    /// [default: no model is asked]
    #[arg(long, value_name = "USD", value_parser = from_to(0.0, MOST_USD))]
    pub allow_paid: Option<f64>,
}

#[derive(Debug, Subcommand)]
pub enum Grasp {
    /// Fit a rising polynomial of fifth order to a gripper's measured commands and forces.
    Calibrate {
        /// Measurements (CSV with the header command,force_n; any number of rows per command).
        points: PathBuf,
        /// The gripper that was measured: a built-in one or a TOML profile.
        #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
        gripper: String,
        /// Plot measurements, curve and residuals into this file.
        #[arg(long, value_name = "FILE.svg")]
        plot: Option<PathBuf>,
        /// Write the profile of --gripper (which must be given) with these measurements into this file.
        #[arg(long, value_name = "FILE.toml", requires = "gripper")]
        profile: Option<PathBuf>,
    },
}

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Folder with a splat, cameras and photos, a mesh, or a URDF or MJCF; stages that have not run yet are run first.
    #[arg(required_unless_present = "list")]
    scene: Option<PathBuf>,
    /// Formats to write, separated by commas, or `all` in which the scene can be written; required for a splat. A mesh is written as
    /// `asset` without it; a URDF or MJCF is always written as it is, with masses, inertias and frictions filled in.
    #[arg(long, value_parser = format_choice(), value_delimiter = ',')]
    pub format: Vec<FormatChoice>,
    /// List the formats, what each is for and which programs read it; needs no scene.
    #[arg(long)]
    pub list: bool,
    /// Colliders of the format `asset`.
    #[arg(long, value_enum, default_value_t)]
    pub colliders: export::Colliders,
    /// Samples of the format `belief`, which is then written without being named, too [default: 32].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub samples: Option<u32>,
    /// Origin of the object's own axes, for simulators and glTF.
    #[arg(long, value_enum, default_value_t)]
    pub origin: export::Origin,
    /// Where these axes are by default, in metres: so exports that are loaded together stand side by side.
    #[arg(long, value_name = "X,Y,Z", value_parser = grasp::options::point, allow_hyphen_values = true, default_value = "0,0,0")]
    pub at: [f64; 3],
    /// Hang a URDF's object on a floating joint, for readers that fix a root to the world (MuJoCo); --at does so too.
    #[arg(long)]
    pub floating: bool,
    /// Links of the object in URDF, MJCF, SDF and USD: one rigid body, or each part by itself, fixed to its neighbour.
    #[arg(long, value_enum, default_value_t)]
    pub links: export::Links,
    /// Let soft parts (foam, rubber, food and the like: E up to 10 MPa) deform in MJCF (`flex`) and USD (`TetMesh`): at most 4,000
    /// tetrahedra each, which hang on the rigid parts that they touch.
    #[arg(long)]
    pub deformable: bool,
    /// What the GLB shows of the object: a mesh for each part, its Gaussians, or both.
    #[arg(long, value_enum, default_value_t)]
    pub glb_look: export::GlbLook,
    /// Write the Gaussians of each body of the MJCF as a PLY in the body's frame, which the MJCF names.
    #[arg(long)]
    pub mjcf_splats: bool,
    /// Geoms of your gripper's pads, separated by commas: NAME_pads.xml beside the MJCF states the friction between each and the
    /// object as pairs.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = clap::builder::NonEmptyStringValueParser::new())]
    pub pad_geom: Vec<String>,
    /// Surface with which the frictions are.
    #[arg(long, value_enum, default_value_t)]
    pub friction: export::Counterface,
    #[command(flatten)]
    pub credits: export::Credits,
    /// Folder to write into.
    #[arg(long, value_name = "DIR", required_unless_present = "list")]
    out: Option<PathBuf>,
    /// Work folder [default: SCENE/gprop]
    #[arg(long, value_name = "DIR")]
    pub work: Option<PathBuf>,
    #[command(flatten)]
    pub last_run: LastRun,
    #[command(flatten)]
    pub options: pipeline::Options,
}

impl ExportArgs {
    /// Empty with `--list`.
    pub fn scene(&self) -> &Path {
        self.scene.as_deref().unwrap_or(Path::new(""))
    }

    /// Empty with `--list`.
    pub fn out(&self) -> &Path {
        self.out.as_deref().unwrap_or(Path::new(""))
    }
}

/// A format, or all that are possible.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FormatChoice {
    All,
    One(export::Format),
}

fn format_choice() -> impl TypedValueParser<Value = FormatChoice> {
    let formats = export::Format::value_variants().iter().filter_map(ValueEnum::to_possible_value);
    let all =
        PossibleValue::new("all").help("All in which the scene can be written; the others are listed with why not");
    PossibleValuesParser::new(formats.chain([all]))
        .map(|name| export::Format::from_str(&name, false).map_or(FormatChoice::All, FormatChoice::One))
}

#[derive(Debug, Args)]
#[command(
    after_help = "Options from \"Presets\" on can also be set in TOML files, one `name = value` per line, with the names of the \
                        flags: SCENE/gprop.toml may set those that concern only the scene, ~/.config/gprop/config.toml \
                        ($XDG_CONFIG_HOME/gprop/config.toml if that variable is set) all of them and `threads`. The command line overrides the scene's file, which overrides yours."
)]
pub struct RunArgs {
    /// Last stage to run; the stages that it needs are run first.
    #[arg(long, value_name = "STAGE", default_value = "report")]
    pub to: Stage,
    /// Leave out the simulation and its film.
    #[arg(long)]
    pub no_simulate: bool,
    /// For `gprop batch`: end when stdin closes.
    #[arg(long, hide = true)]
    pub end_with_stdin: bool,
    /// For the Python module: print the name and the work folder of each object instead of the result, and end when stdin
    /// closes.
    #[arg(long, value_name = "OBJECTS", hide = true)]
    pub for_python: Option<ForPython>,
    #[command(flatten)]
    pub scene: SceneArgs,
}

/// Which scenes the Python module runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ForPython {
    /// Those of one object; others are refused before anything is done.
    One,
    /// Any, object by object.
    All,
}

#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Open the report in the browser.
    #[arg(long)]
    pub open: bool,
    /// Leave out the simulation and its film.
    #[arg(long)]
    pub no_simulate: bool,
    #[command(flatten)]
    pub scene: SceneArgs,
}

#[derive(Debug, Args)]
pub struct ViewArgs {
    /// Scene folder, work folder, folder on which `gprop batch` was run, or the folder given to it with --out.
    pub folder: PathBuf,
}

#[derive(Debug, Args)]
pub struct BatchArgs {
    /// Folder with the scenes: ABO-500, MVImgNet, or any folder of scene folders or meshes.
    pub folder: PathBuf,
    /// Last stage to run; the stages that it needs are run first.
    #[arg(long, value_name = "STAGE", default_value = "report")]
    pub to: Stage,
    /// Leave out the simulation and its film.
    #[arg(long)]
    pub no_simulate: bool,
    /// Run this stage and those after it again in every scene, even if an earlier run did them.
    #[arg(long, value_name = "STAGE")]
    pub from: Option<Stage>,
    /// Folder to write into: a work folder for each scene, named after it, and batch/ with the results of all scenes
    /// [default: SCENE/gprop and FOLDER/gprop/batch]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// List the scenes with their state, their expected memory and what asking about them would cost, without running them.
    #[arg(long)]
    pub dry_run: bool,
    /// Run nothing; write one summary of all shards, which must all have been run with the same choice of scenes.
    #[arg(long, conflicts_with_all = ["dry_run", "queries"])]
    pub merge: bool,
    /// Send the questions that are due in all scenes through OpenAI's Batch API (half the price, within a day), or
    /// collect the answers.
    #[arg(long, value_name = "STEP", conflicts_with = "dry_run")]
    pub queries: Option<batch_api::Step>,
    #[command(flatten)]
    pub batch: batch::Options,
    #[command(flatten)]
    pub options: pipeline::Options,
}

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("solver_input").multiple(true))]
pub struct SimulateArgs {
    /// Folder with a splat, cameras and photos, or a mesh.
    #[arg(required_unless_present = "list")]
    pub scene: Option<PathBuf>,
    /// List the scenarios with their parameters, without simulating.
    #[arg(long)]
    pub list: bool,
    /// Reproduce another program's solver exactly, with its units, laws, boundary conditions and defects.
    #[arg(long, value_name = "PROGRAM", requires = "solver_input")]
    pub compat: Option<Compat>,
    /// Configuration of that program (PhysGaussian's JSON); without --field, SCENE may be a PLY.
    #[arg(long, value_name = "FILE", requires = "compat", group = "solver_input", value_parser = option_values::file())]
    pub config: Option<PathBuf>,
    /// Give each particle the law, E (at most --max-stiffness, by default 2e7 Pa), nu and density that the scene's
    /// field.ply has for its Gaussian, instead of those of the configuration; without --config, the object falls, with
    /// the configuration that `gprop export --format physgaussian` writes.
    #[arg(long, requires = "compat", group = "solver_input")]
    pub field: bool,
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
    after_help = "SCENE may also be a single picture: its alpha channel or --mask marks the object, and gprop draws a \
                        map of the materials."
)]
pub struct QueryArgs {
    /// Write the questions that are due (pictures, prompt, schema, a form to fill in) into this folder, so that they can
    /// be answered elsewhere.
    #[arg(long, value_name = "DIR", group = "action")]
    pub export: Option<PathBuf>,
    /// Read answers from this folder, check them and record them.
    #[arg(long, value_name = "DIR", group = "action", value_parser = option_values::folder())]
    pub import: Option<PathBuf>,
    /// Send the questions that are due through OpenAI's Batch API (half the price, within a day), or collect the
    /// answers.
    #[arg(long, value_name = "STEP", group = "action")]
    pub batch_api: Option<batch_api::Step>,
    /// Delete the scene's recordings that are not used with these options.
    #[arg(long, group = "action")]
    pub prune: bool,
    /// Ask only how heavy the object is, from three photos and its outer size: what a model says without gprop, for
    /// `evaluate mass --beside direct`.
    #[arg(long, conflicts_with_all = ["batch_api", "prune", "mask"])]
    pub direct: bool,
    /// Mask of a single picture: white, or opaque, on the object.
    #[arg(long, value_name = "FILE", value_parser = option_values::file())]
    pub mask: Option<PathBuf>,
    #[command(flatten)]
    pub scene: SceneArgs,
}

#[derive(Debug, Args)]
pub struct AnswerArgs {
    /// Port of 127.0.0.1 on which the page is served; 0 for any that is free.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub port: u16,
    #[command(flatten)]
    pub scene: SceneArgs,
}

/// What masses are compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Beside {
    /// A guess of the model that saw three photos and the outer size of the object.
    Direct,
}

#[derive(Debug, Args)]
pub struct SetupArgs {
    #[command(flatten)]
    pub options: setup::Options,
}

/// Scenes with true part maps, and how to segment their views.
#[derive(Debug, clap::Args)]
#[group(skip)]
pub struct TrueParts {
    /// Scene folders with SCENE/ground_truth/part_maps/VIEW.png: 8-bit part numbers, 255 for no part.
    #[arg(required = true)]
    pub scenes: Vec<PathBuf>,
    #[command(flatten)]
    pub scene: Box<crate::scene::Options>,
    #[command(flatten)]
    pub segment: Box<crate::segment::Options>,
    #[command(flatten)]
    pub setup: Box<setup::Options>,
}

/// What may be read besides the scenes whose results are evaluated.
#[derive(Debug, Args)]
pub struct Allowed {
    /// Folder outside the scene to which the scene's links and 3DGS's `cfg_args` may lead; may be given several times.
    #[arg(long, value_name = "DIR", value_parser = option_values::folder())]
    pub allow_read: Vec<PathBuf>,
}

/// Fewer than the ten views that vote by default, and enough to see an object from all sides.
const FEW_VIEWS: NonZeroUsize = NonZeroUsize::new(6).expect("six is not zero");
/// Upper limit of `--few-views`: a thousand views are not few.
const MOST_FEW_VIEWS: NonZeroUsize = NonZeroUsize::new(1000).expect("a thousand is not zero");

#[derive(Debug, Subcommand)]
pub enum Evaluate {
    /// Compute pick-up, no-damage and success rates of gripping policies, from recorded trials or as predicted for the
    /// grasps that runs proposed.
    Grasp {
        /// Scene folders with results of `gprop run` and with a `ground_truth` folder (`parts.json`, `part_maps`): the
        /// outcomes of gprop's force and of three fixed ones are predicted.
        #[arg(required_unless_present = "outcomes")]
        scenes: Vec<PathBuf>,
        /// Work folder of the scene, for a single scene only [default: SCENE/gprop]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Recorded outcomes (CSV with the header object,policy,picked_up,undamaged; true or false).
        #[arg(long, value_name = "FILE.csv", value_parser = option_values::file())]
        #[arg(conflicts_with_all = ["scenes", "out", "gripper", "allow_read"])]
        outcomes: Option<PathBuf>,
        /// The gripper of the runs.
        #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
        gripper: String,
        #[command(flatten)]
        allowed: Allowed,
    },
    /// Compare the masks of one picture with those of a reference generator, level by level.
    Masks {
        /// The picture that the reference generator segmented.
        image: PathBuf,
        /// Settings and masks of the reference (JSON; masks run-length encoded).
        reference: PathBuf,
        #[command(flatten)]
        setup: setup::Options,
    },
    /// Repeat a recorded simulation of PhysGaussian and compare the trajectories; or compare gprop's filling of the
    /// inside with PhysGaussian's.
    Simulation {
        /// The recorded trajectory or filling, with its settings (NPZ).
        reference: PathBuf,
    },
    /// Render the materials into labelled views and compute the IoU per label: the paper's table with its two
    /// ablations.
    Segmentation {
        /// Scene folders on which `gprop run` has done at least the vote.
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Label maps (one PNG per view, and labels.json or EISeg's autosave_label.txt): a folder inside each scene, or
        /// a folder that holds one such folder per scene, named after it, or the folder of a single scene.
        #[arg(long, value_name = "DIR")]
        truth: PathBuf,
        /// The label set to which materials and labels are mapped.
        #[arg(long, value_enum, default_value_t)]
        labels: Vocabulary,
        /// Work folder of the scene, for a single scene only [default: SCENE/gprop]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        allowed: Allowed,
    },
    /// Compare --point-prompts adaptive with --point-prompts grid on scenes with true part maps: number of prompts,
    /// time and part IoU.
    Prompts {
        #[command(flatten)]
        asked: TrueParts,
    },
    /// Find the parts of scenes with true part maps, and compare them with the true parts in views that were not
    /// segmented; do the same for the segments of each view by itself.
    Parts {
        #[command(flatten)]
        asked: TrueParts,
    },
    /// Tell the objects of captures apart, and compare their masks, boxes and which way is up with the truth.
    Objects {
        /// Scene folders with SCENE/ground_truth/objects.json and SCENE/ground_truth/object_maps/VIEW.png.
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        #[command(flatten)]
        scene: Box<scene::Options>,
    },
    /// Measure how the IoU of labels falls when half of the segments are merged with a neighbour, a tenth of the answers
    /// are wrong, or fewer views vote; scenes need true part maps, which also give the answers.
    Robustness {
        /// Scene folders with SCENE/ground_truth/part_maps/VIEW.png on which `gprop run` has done at least the vote;
        /// questions and votes follow the options of that run.
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Number of views that vote in the condition with fewer views.
        #[arg(long, value_name = "N", default_value_t = FEW_VIEWS, value_parser = from_to(NonZeroUsize::MIN, MOST_FEW_VIEWS))]
        few_views: NonZeroUsize,
        /// Work folder of the scene, for a single scene only [default: SCENE/gprop]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        allowed: Allowed,
    },
    /// Compare masses with true ones: NeRF2Physics' errors ADE, ALDE, APE and MnRE, and pairwise relationship accuracy
    /// (PRA).
    Mass {
        /// Scene folders with results of `gprop run` and with `ground_truth/parts.json`; with --weights, meshes too.
        #[arg(required_unless_present_any = ["predictions", "data_set"])]
        scenes: Vec<PathBuf>,
        /// What a kitchen scale says: CSV with the columns name,mass_kg, where the name is that of a scene's folder, of a
        /// mesh without its ending, or of a scene in `gprop batch`
        #[arg(long, value_name = "FILE", value_parser = option_values::file(), conflicts_with = "predictions")]
        weights: Option<PathBuf>,
        /// Also score what a model says of the mass without gprop, as `gprop query SCENE --direct` recorded it
        #[arg(long, value_name = "WHAT", requires = "scenes")]
        beside: Option<Beside>,
        /// Work folder of a single scene [default: SCENE/gprop], or, with --data-set, the folder that
        /// `gprop batch --out` wrote
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Folder on which `gprop batch` was run, of a data set that states weights (ABO-500) or with --weights
        #[arg(long, value_name = "DIR", value_parser = option_values::folder())]
        #[arg(conflicts_with_all = ["scenes", "allow_read"])]
        data_set: Option<PathBuf>,
        /// Only the scenes of this split of the data set
        #[arg(long, value_name = "NAME", requires = "data_set")]
        split: Option<String>,
        /// Predictions in NeRF2Physics' format: [low, high] in kilograms, keyed by id.
        #[arg(long, value_name = "FILE", requires = "truth", value_parser = option_values::file())]
        #[arg(conflicts_with_all = ["scenes", "out", "data_set", "allow_read"])]
        predictions: Option<PathBuf>,
        /// True masses in kilograms, keyed by the id up to its first underscore.
        #[arg(long, value_name = "FILE", requires = "predictions", value_parser = option_values::file())]
        truth: Option<PathBuf>,
        #[command(flatten)]
        allowed: Allowed,
    },
    /// Compare Shore hardness at points of the photos with readings of a durometer. Shore A counts as 0 to 100, Shore D
    /// as 100 to 200.
    Hardness {
        /// Readings (CSV with the columns scene,view,x,y,shore,hardness: scene is a folder with results of `gprop run`,
        /// relative to the CSV; x and y are pixels of the view; shore is A or D).
        points: PathBuf,
        /// Work folder of the scene, for readings of a single scene only [default: SCENE/gprop]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        allowed: Allowed,
    },
}

#[derive(Debug, Subcommand)]
pub enum Scale {
    /// Draw a marker for printing, with its size and a ruler to check the printer.
    Board {
        /// File to write.
        #[arg(long, value_name = "FILE.svg")]
        out: PathBuf,
        /// The marker and the side of its black square, as for --scale: apriltag:FAMILY,ID=M or aruco:DICT,ID=M.
        #[arg(long, value_name = "MARKER=M", default_value = "apriltag:36h11,0=80mm")]
        marker: SizedMarker,
    },
}

#[derive(Debug, Subcommand)]
pub enum Materials {
    /// Show a material with every property and its sources.
    Show {
        /// Name or alias, ignoring case and punctuation.
        name: String,
        #[command(flatten)]
        library: materials::Options,
    },
    /// List all materials, or those of one family, with density and Young's modulus.
    List {
        /// Only this family.
        #[arg(long, value_name = "NAME")]
        family: Option<String>,
        #[command(flatten)]
        library: materials::Options,
    },
    /// Check the library for values that cannot be true.
    Check {
        /// Also print the share of numbers that are cited, by family and property.
        #[arg(long)]
        stats: bool,
        #[command(flatten)]
        library: materials::Options,
    },
}
