//! The commands that work on a scene.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;
use serde_json::Value;

use crate::consensus::AskAbout;
use crate::error::{Result, UsageError};
use crate::export::{self, Exported, Format, Formats, LeftOut};
use crate::files::write;
use crate::film;
use crate::pipeline::export::ExportOptions;
use crate::pipeline::{self, Builder, CommandLine, Options, Pipeline, Plan, Stage, is_untouched, show, stages};
use crate::query::Preview;
use crate::report;
use crate::units::MetricScale;
use crate::words::{readable, shell};
use crate::workdir::Artifact;
use crate::{batch, config, mcp};

use super::arguments::FormatChoice;
use super::{ExportArgs, Global, ShowArgs, What, WorkArgs, found, print, print_path, print_text, shown};

/// Samples of what is believed, if no other number is asked for.
const SAMPLES: u32 = 32;

/// What a run would do.
#[derive(Serialize)]
pub struct DryRun {
    stages: Vec<DryStage>,
    /// `None` if nothing would be asked, or it is not known yet.
    pub queries: Option<Preview>,
    #[serde(skip)]
    to: Stage,
}

/// A stage in the output of a dry run.
#[derive(Serialize)]
struct DryStage {
    name: Stage,
    reusable: bool,
}

/// Runs the stage `to`, after those that it needs, and prints its result.
pub fn run(global: &Global, folder: &Path, work: &WorkArgs, to: Stage) -> Result<()> {
    carry_out(global, folder, work, to, true)
}

/// As [`run`], but leaves out the simulation.
pub fn run_without_simulation(global: &Global, folder: &Path, work: &WorkArgs, to: Stage) -> Result<()> {
    check_without_simulation(to)?;
    carry_out(global, folder, work, to, false)
}

/// Checks that the last stage `to` is not the simulation, which is to be left out.
pub fn check_without_simulation(to: Stage) -> Result<(), UsageError> {
    match to {
        Stage::Simulate => Err(UsageError("--no-simulate leaves out the stage that --to asks for".to_owned())),
        _ => Ok(()),
    }
}

fn carry_out(global: &Global, folder: &Path, work: &WorkArgs, to: Stage, simulates: bool) -> Result<()> {
    if work.dry_run {
        let dry = dry_run(global, folder, work, to, simulates)?;
        return print(global, &dry, || dry.text());
    }
    let mut pipeline = open(global, folder, work, to, simulates)?;
    pipeline.run()?;
    if !global.prints_summary() {
        return Ok(());
    }
    if to == Stage::Report {
        let report = pipeline.report()?;
        return print(global, &report, || report::summary(&report, &pipeline.opened().work.path(Artifact::ReportHtml)));
    }
    let artifact = to.row().result;
    if global.json {
        return print(global, &json_of(&mut pipeline, artifact)?, String::new);
    }
    print_text(&found::text(&mut pipeline, to)?)
}

/// Draws a picture or film, after running the stages that it needs.
pub fn show(global: &Global, args: &ShowArgs) -> Result<()> {
    let film = film::Format::of(&args.to);
    let is_typed = |name: &str| global.flags.typed.iter().any(|flag| config::name_of(flag) == name);
    if film.is_none() && is_typed("turntable") {
        return Err(UsageError(format!("a turntable is a film: name a .gif or .mp4 instead of {:?}", args.to)).into());
    }
    if film.is_none() && (is_typed("size") || is_typed("fps")) {
        let problem = format!("--size and --fps are for a film: name a .gif or .mp4 instead of {:?}", args.to);
        return Err(UsageError(problem).into());
    }
    let is_png = args.to.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    if film.is_none() && !is_png {
        let problem = format!("cannot write {:?}: name a file that ends in .png, .gif or .mp4", args.to);
        return Err(UsageError(problem).into());
    }
    if film.is_some() && !matches!(args.what, What::Field(_)) {
        let problem = format!("--what vote and levels are pictures of one view: name a .png instead of {:?}", args.to);
        return Err(UsageError(problem).into());
    }
    if film.is_some() && args.view.is_some() {
        let problem = format!("--view is for a picture of one view: name a .png instead of {:?}", args.to);
        return Err(UsageError(problem).into());
    }
    let needed = if args.what == What::Levels { Stage::Scene } else { Stage::Vote };
    if args.work.dry_run {
        return run(global, &args.scene, &args.work, needed);
    }
    let mut pipeline = open(global, &args.scene, &args.work, needed, true)?;
    pipeline.run()?;
    let (open, view) = (pipeline.opened(), args.view.as_deref());
    let bytes = match (args.what, film) {
        (What::Field(shown), Some(format)) => show::turntable(open, shown, format)?,
        (What::Field(shown), None) => show::field(open, shown, view)?,
        (What::Vote, _) => show::vote(open, view)?,
        (What::Levels, _) => show::levels(open, view)?,
    };
    write::file(&args.to, |out| out.write_all(&bytes))
        .map_err(|error| UsageError(format!("cannot write {:?}: {error}", args.to)))?;
    print_path(global, &args.to)
}

/// Exports the parts, after running the stages up to them.
pub fn export(global: &Global, args: &ExportArgs) -> Result<()> {
    let OfScene { mut exported, inputs, .. } = export_one(global, args, &args.options)?;
    export::write_summary(&mut exported, &inputs, args.out())?;
    print_exported(global, &exported)
}

/// The formats to write, all that are possible if `None`: the asset itself for a mesh, if none is named, and what other options ask for.
///
/// # Errors
/// If there is none.
pub fn formats(args: &ExportArgs) -> Result<Option<Vec<Format>>, UsageError> {
    let one = |choice: &FormatChoice| match choice {
        FormatChoice::All => None,
        FormatChoice::One(format) => Some(*format),
    };
    let Some(mut formats) = args.format.iter().map(one).collect::<Option<Vec<Format>>>() else { return Ok(None) };
    if formats.is_empty() && args.scene().is_file() {
        formats.push(Format::Asset);
    }
    if args.samples.is_some() && !formats.contains(&Format::Belief) {
        formats.push(Format::Belief);
    }
    if formats.is_empty() {
        let possible = Format::value_variants().iter().filter(|format| !format.needs_mesh());
        let possible: Vec<String> = possible.map(|format| format.name()).collect();
        return Err(UsageError(format!("--format is missing: name `all` or one or more of {}", possible.join(", "))));
    }
    Ok(Some(formats))
}

/// An object that was exported.
pub struct OfScene {
    /// The name of the scene, by which its files are called.
    pub name: String,
    pub exported: Exported,
    /// `None` if it is unknown.
    pub scale: Option<MetricScale>,
    /// The files that the scene was read from.
    pub inputs: Vec<PathBuf>,
}

/// Exports one object with these options.
pub fn export_one(global: &Global, args: &ExportArgs, options: &Options) -> Result<OfScene> {
    let formats = formats(args)?;
    let plan = Plan::to(Stage::Parts);
    let mut pipeline = builder_with(global, args.scene(), args.work.as_deref(), options, plan).open()?;
    pipeline.run()?;
    let wanted = ExportOptions {
        formats: formats.as_deref().map_or(Formats::Possible, Formats::Each),
        colliders: args.colliders,
        samples: args.samples.unwrap_or(SAMPLES) as usize,
        origin: args.origin,
        at: args.at,
        floating: args.floating,
        glb_look: args.glb_look,
        mjcf_splats: args.mjcf_splats,
        links: args.links,
        deformable: args.deformable,
        pad_geoms: &args.pad_geom,
        friction: args.friction,
        credits: &args.credits,
    };
    let exported = pipeline::export::export(&mut pipeline, &wanted, args.out())?;
    let open = pipeline.opened();
    let scale = stages::parts::scale(open)?;
    Ok(OfScene { name: open.scene.name.clone(), exported, scale, inputs: open.scene.files.clone() })
}

/// A file that was written, for programs.
#[derive(Serialize)]
struct WrittenFile<'a> {
    path: Cow<'a, str>,
    bytes: u64,
    formats: Vec<String>,
}

impl<'a> WrittenFile<'a> {
    fn of(file: &'a export::File) -> Self {
        let formats = file.formats.iter().map(|format| format.name()).collect();
        Self { path: config::in_json(&file.path), bytes: file.bytes, formats }
    }
}

/// What an export wrote, for programs.
#[derive(Serialize)]
struct Written<'a> {
    files: Vec<WrittenFile<'a>>,
    left_out: &'a [LeftOut],
}

/// Prints the files of an export with their sizes, and the formats that were left out.
pub fn print_exported(global: &Global, exported: &Exported) -> Result<()> {
    print_written(global, &exported.files, &exported.left_out)
}

/// As [`print_exported`].
pub fn print_written(global: &Global, files: &[export::File], left_out: &[LeftOut]) -> Result<()> {
    let written = Written { files: files.iter().map(WrittenFile::of).collect(), left_out };
    print(global, &written, || {
        let files = files.iter().map(|file| format!("{:>9}  {}\n", readable::bytes(file.bytes), shown(&file.path)));
        let left_out = left_out.iter().map(|left| format!("left out  {}: {}\n", left.format.name(), left.why));
        files.chain(left_out).collect()
    })
}

/// Opens a scene to do the stages up to one, with or without the simulation.
pub fn open(global: &Global, folder: &Path, work: &WorkArgs, to: Stage, simulates: bool) -> Result<Pipeline> {
    builder_with(global, folder, work.out.as_deref(), &work.options, plan(work, to, simulates)?).open()
}

/// Opens a scene later, to do the stages up to one.
pub fn builder(global: &Global, folder: &Path, work: &WorkArgs, to: Stage) -> Result<Builder> {
    Ok(builder_with(global, folder, work.out.as_deref(), &work.options, plan(work, to, true)?))
}

fn builder_with(global: &Global, folder: &Path, out: Option<&Path>, options: &Options, plan: Plan) -> Builder {
    let builder = Pipeline::builder(folder).options(options.clone()).plan(plan).progress(global.show_progress());
    let builder = if global.is_in_batch { builder.on_progress(batch::tell_the_batch) } else { builder };
    let builder = if global.for_mcp { builder.on_progress(mcp::tell_the_server) } else { builder };
    let builder = match out {
        Some(out) => builder.out(out),
        None => builder,
    };
    // The server's address is left out: the answers are recorded, and the address is private.
    let effective = global.flags.effective.iter().map(|flag| flag.to_string_lossy().into_owned());
    let effective = effective.filter(|flag| !flag.starts_with("--lmm-url=")).collect();
    let command_line = CommandLine { effective, typed: global.flags.recorded.clone(), once: global.flags.once };
    builder.command_line(command_line)
}

fn plan(work: &WorkArgs, to: Stage, simulates: bool) -> Result<Plan, UsageError> {
    check_from(work.from, to)?;
    let plan = work.from.map_or(Plan::to(to), |from| Plan::to(to).from(from));
    Ok(if simulates { plan } else { plan.without(Stage::Simulate) })
}

/// Refuses a first stage that comes after the last.
pub fn check_from(from: Option<Stage>, to: Stage) -> Result<(), UsageError> {
    match from {
        Some(from) if from > to => {
            Err(UsageError(format!("--from {} comes after the last stage, {}", from.name(), to.name())))
        }
        _ => Ok(()),
    }
}

/// Looks up what a run would do.
pub fn dry_run(global: &Global, folder: &Path, work: &WorkArgs, to: Stage, simulates: bool) -> Result<DryRun> {
    let listed = |stages: &[Stage], reusable: &[Stage]| {
        stages.iter().map(|&name| DryStage { name, reusable: reusable.contains(&name) }).collect()
    };
    if is_untouched(folder, work.out.as_deref(), &work.options)? {
        let stages: Vec<Stage> = plan(work, to, simulates)?.stages().collect();
        return Ok(DryRun { stages: listed(&stages, &[]), queries: None, to });
    }
    let pipeline = open(global, folder, work, to, simulates)?;
    let reusable = pipeline.run_state().reusable(pipeline.opened())?;
    // The questions are known only once the parts are.
    let asked = to >= Stage::Query && reusable.contains(&Stage::Consensus) && !reusable.contains(&Stage::Query);
    let queries = if asked { Some(stages::questions::preview(pipeline.opened())?) } else { None };
    let stages: Vec<Stage> = pipeline.run_state().stages().collect();
    Ok(DryRun { stages: listed(&stages, &reusable), queries, to })
}

impl DryRun {
    /// True if the questions are unknown because the parts are not found yet.
    pub fn lacks_parts(&self) -> bool {
        let has_parts = self.stages.iter().any(|stage| stage.name == Stage::Consensus && stage.reusable);
        self.to >= Stage::Query && !has_parts
    }

    pub fn text(&self) -> String {
        let mut text = String::new();
        for stage in &self.stages {
            let state = if stage.reusable { "done" } else { "to do" };
            text += &format!("{:<9} {state}\n", stage.name.name());
        }
        match &self.queries {
            Some(plan) => text += &format!("questions: {plan}\n"),
            None if self.lacks_parts() => {
                text += "questions: unknown until the parts are found; `gprop run SCENE --to consensus` (with the same --object, \
                         if any) finds them and sends nothing\n";
            }
            None => {}
        }
        text
    }
}

/// An artifact as one JSON value; for the field, the labels that its numbers stand for; null for the parts if the model
/// is asked about segments.
fn json_of(pipeline: &mut Pipeline, artifact: Artifact) -> Result<Value> {
    Ok(match artifact {
        Artifact::FoundParts if pipeline.opened().options.consensus.ask == AskAbout::Segments => Value::Null,
        Artifact::Answers => serde_json::to_value(&pipeline.answers()?.all)?,
        Artifact::Field => pipeline.opened().work.read_json(Artifact::Labels)?,
        other => pipeline.opened().work.read_json(other)?,
    })
}

/// A scene with the options of the stages that were typed, for a command that goes on with it.
pub fn as_typed(global: &Global, scene: &Path) -> String {
    let flags = global.flags.typed.iter().map(|flag| format!(" {}", shell::word(&flag.to_string_lossy())));
    shell::path(scene) + &flags.collect::<String>()
}
