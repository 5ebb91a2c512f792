//! Subcommands and flags: what the user typed becomes a call into the pipeline or a stage, and a result on stdout.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::config;
use crate::exit::UsageError;
use crate::materials::MaterialLibrary;
use crate::pipeline::{self, Pipeline, Stage};
use crate::progress::Progress;
use crate::{report, setup, workdir};

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
