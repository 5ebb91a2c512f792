//! Runs the stages in order, decides which artifacts can be reused, and resumes runs.
//!
//! A stage is done again if its key changes (the hash of its options and of the results of the stages before it) or if
//! a file that it wrote has changed or is missing. Its results are written first and its record only after them, so
//! the next run can continue after a run that was killed. Stages with costly items (views, answers, frames) save each
//! item with a checksum and resume where they were killed.

mod asked;
mod batch_api;
mod builder;
pub mod compat;
mod consensus;
mod export;
mod grasp;
mod options;
mod parts;
pub mod picture;
mod plan;
mod preset;
mod query;
pub mod query_session;
mod record;
mod report;
mod results;
mod scene;
mod segment;
mod show;
mod simulate;
pub mod stored;
mod variants;
mod vote;

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use anyhow::{Context, Result};
use image::RgbImage;
use image::codecs::png::PngEncoder;
use serde_json::Value;
use tracing::{info, warn};

use crate::error::{Error, UsageError};
use crate::from_splat;
use crate::grasp::gripper::GripperProfile;
use crate::materials::MaterialLibrary;
use crate::parts::Interior;
use crate::query::Answers;
use crate::scene::{Scene, View};
use crate::segment::Segmentation;
use crate::vote::MaterialField;
use crate::words::progress::{Progress, StageNumber};
use crate::workdir::{self, Artifact, WorkDir};
pub use segment::open_segmenter;
pub use vote::stored_field;

pub use batch_api::{Collected, Sent, check_submission};
pub use builder::Builder;
pub use options::{Options, THREADS, known_flags, scene_keys};
pub(crate) use options::{problem_of, problem_with, with_values_on_one_line};
pub use plan::{Plan, Stage};
pub use preset::Preset;
pub use record::{FieldFlags, Hasher, flags_of_last_run};
use record::{Left, Output};
pub(crate) use record::{RunRecord, StageRecord};

/// A scene being processed by the stages, with its work folder, whose lock it holds.
///
/// The methods for its results ([`segments`](Self::segments), [`answers`](Self::answers), [`field`](Self::field),
/// [`parts`](Self::parts), [`simulation`](Self::simulation), [`grasp`](Self::grasp)) do the stages that are missing and
/// read the results that exist. Every command of the program uses this type, so the library and the program can use
/// each other's work folders.
///
/// Nothing is sent to a model unless the options name its server (`options.query.lmm_url`): answers come from
/// recordings. SAM and ONNX Runtime are taken from the cache, or downloaded if they are missing and
/// `options.setup.offline` is off.
pub struct Pipeline {
    folder: PathBuf,
    work: WorkDir,
    options: Options,
    plan: Plan,
    /// Whether runs and reports include the simulation.
    simulates: bool,
    command_line: CommandLine,
    progress: Progress,
    record: RunRecord,
    /// The stages that this process has done or found already done.
    done: Vec<Stage>,
    library: Cow<'static, MaterialLibrary>,
    gripper: GripperProfile,
    scene: Scene,
    views: Vec<View>,
    /// Identifies the models that make the masks.
    models: OnceLock<String>,
    segmentation: OnceLock<Segmentation>,
    found: OnceLock<consensus::FoundParts>,
    answers: OnceLock<Answers>,
    field: OnceLock<MaterialField>,
    interior: OnceLock<Interior>,
    /// The index of the chosen view that shows most of the object.
    showing: OnceLock<Option<usize>>,
}

/// The flags that stand for the options of a pipeline; none if it was opened through the library.
#[derive(Debug, Clone, Default)]
pub(crate) struct CommandLine {
    /// All of them, with those of the configuration files: the report shows them as the command that made it.
    pub effective: Vec<String>,
    /// Those that were typed, for `run.json`.
    pub typed: FieldFlags,
    /// A stage whose options are for this time only: `run.json` keeps the flags that the last run left for it.
    pub once: Option<Stage>,
}

/// The result of doing a stage.
struct Done {
    /// The files it wrote.
    outputs: Vec<PathBuf>,
    /// Messages about what the user should check because the result may be wrong.
    warnings: Vec<String>,
    /// Messages about what the user may want to know.
    notes: Vec<String>,
    /// Hash of its results if its key does not determine them.
    digest: Option<String>,
}

impl Pipeline {
    /// Opens the scene in `folder`: a splat, cameras and photos, as for `gprop run`. The options are
    /// [`Options::of_scene`], the work folder is `folder`/gprop.
    ///
    /// # Errors
    /// As for [`Builder::open`].
    pub fn open(folder: impl AsRef<Path>) -> Result<Self, Error> {
        Self::builder(folder).open()
    }

    /// Like [`open`](Self::open), but the work folder and the options can be set.
    pub fn builder(folder: impl AsRef<Path>) -> Builder {
        Builder::new(folder.as_ref())
    }

    /// Opens the scene with its work folder.
    fn within(
        folder: &Path,
        work: WorkDir,
        mut scene: Scene,
        (library, gripper): (Cow<'static, MaterialLibrary>, GripperProfile),
        options: Options,
        plan: Plan,
        progress: Progress,
    ) -> Result<Self> {
        segment::check_formats(&options.segment.also)?;
        if let Some(count) = options.scene.render_views {
            let folder = work.root().join("rendered");
            workdir::refuse_link(&folder, "--out")?;
            let folder = folder.join(scene::rendering_key(&scene, &options.scene)?);
            workdir::refuse_link(&folder, "--out")?;
            from_splat::render_views(&mut scene, count.get(), &folder, work.is_writable())
                .map_err(|error| UsageError(format!("cannot write views into {folder:?}: {error}")))?;
        }
        let record = RunRecord::load(&work);
        Ok(Self {
            folder: folder.to_owned(),
            views: scene.chosen_views(&options.scene)?,
            work,
            options,
            plan,
            simulates: true,
            command_line: CommandLine::default(),
            progress,
            record,
            done: Vec::new(),
            library,
            gripper,
            scene,
            models: OnceLock::new(),
            segmentation: OnceLock::new(),
            found: OnceLock::new(),
            answers: OnceLock::new(),
            field: OnceLock::new(),
            interior: OnceLock::new(),
            showing: OnceLock::new(),
        })
    }

    /// Adds the flags that stand for its options.
    pub(crate) fn of_command_line(self, command_line: CommandLine) -> Self {
        Self { command_line, ..self }
    }

    /// True if nothing has been done in the work folder yet; does not create one.
    ///
    /// # Errors
    /// If the scene cannot be read or the options do not fit it.
    pub(crate) fn is_untouched(folder: &Path, out: Option<&Path>, options: &Options) -> Result<bool> {
        if work_folder(folder, out).exists() {
            return Ok(false);
        }
        crate::scene::load(folder, &options.scene)?;
        Ok(true)
    }

    /// Does the stages of the plan that neither an earlier run nor this pipeline has done.
    ///
    /// # Errors
    /// The errors of the stages.
    pub fn run(&mut self) -> Result<(), Error> {
        self.carry_out().map_err(Error)
    }

    fn carry_out(&mut self) -> Result<()> {
        let stages: Vec<Stage> = self.stages().collect();
        for (index, &stage) in stages.iter().enumerate() {
            if !self.done.contains(&stage) {
                self.progress = self.progress.of_stage(StageNumber { number: index + 1, of: stages.len() });
                self.step(stage)?;
                match stage {
                    Stage::Scene => self.recall_scale()?,
                    Stage::Query => self.recall_estimated_scale()?,
                    _ => {}
                }
                self.done.push(stage);
            }
        }
        Ok(())
    }

    /// Hash of everything a stage depends on; the stages before it must be done.
    fn key(&self, stage: Stage) -> Result<String> {
        Ok(match stage {
            Stage::Scene => self.scene_key()?,
            Stage::Segment => self.segment_key()?,
            Stage::Consensus => self.consensus_key(),
            Stage::Query => self.query_key()?,
            Stage::Vote => self.vote_key(),
            Stage::Parts => self.parts_key()?,
            Stage::Simulate => self.simulate_key(),
            Stage::Grasp => self.grasp_key(),
            Stage::Report => self.report_key(),
        })
    }

    fn work_on(&self, stage: Stage, key: &str) -> Result<Done> {
        match stage {
            Stage::Scene => self.do_scene(),
            Stage::Segment => self.do_segment(),
            Stage::Consensus => self.do_consensus(),
            Stage::Query => self.do_query(),
            Stage::Vote => self.do_vote(),
            Stage::Parts => self.do_parts(),
            Stage::Simulate => self.do_simulate(key),
            Stage::Grasp => self.do_grasp(),
            Stage::Report => self.do_report(),
        }
    }

    /// The stages of the plan whose results from an earlier run can be reused.
    pub(crate) fn reusable(&self) -> Result<Vec<Stage>> {
        let mut found: Vec<Stage> = Vec::new();
        for stage in self.stages() {
            let has_inputs = self.reads_from(stage).all(|input| found.contains(&input));
            if has_inputs && self.left(stage, &self.key(stage)?).is_some() {
                found.push(stage);
            }
        }
        Ok(found)
    }

    /// The record of a stage that need not be done again; warns about files that were changed.
    fn left(&self, stage: Stage, key: &str) -> Option<&StageRecord> {
        if self.must_redo(stage) {
            return None;
        }
        match self.record.left(stage, key, &self.work) {
            Left::Good(record) => Some(record),
            Left::Nothing => None,
            Left::Changed(paths) => {
                let remedy = format!("the {} stage has to be done again", stage.name());
                paths.into_iter().for_each(|path| self.work.warn_changed(path, &remedy));
                None
            }
        }
    }

    /// The work folder.
    pub(crate) fn work(&self) -> &WorkDir {
        &self.work
    }

    /// Does a stage unless its results from an earlier run can be reused.
    fn step(&mut self, stage: Stage) -> Result<()> {
        let key = self.key(stage)?;
        let options = serde_json::to_value(stored::with_portable_paths(&self.options, &self.folder))?;
        if let Some(good) = self.left(stage, &key) {
            info!(?stage, "still good");
            let record = StageRecord { reused: true, ..good.clone() };
            self.keep_options(stage, &options);
            return Ok(self.record.put(record, &self.work)?);
        }
        self.work.require_writable().with_context(|| format!("the {} stage has to be done", stage.name()))?;
        self.record.forget(stage, &self.work)?;
        let start = Instant::now();
        let done = self.work_on(stage, &key)?;
        // Recordings are part of the query's key, and this run has added some.
        let key = if stage == Stage::Query { self.key(stage)? } else { key };
        let output = |path: PathBuf| Ok(Output { checksum: self.work.checksum(&path)?, path });
        let record = StageRecord {
            name: stage,
            seconds: start.elapsed().as_secs_f64(),
            reused: false,
            warnings: done.warnings,
            notes: done.notes,
            inputs: self.inputs_of(stage).map(|(input, digest)| (input, digest.to_owned())).collect(),
            digest: done.digest.unwrap_or_else(|| key.clone()),
            outputs: done.outputs.into_iter().map(output).collect::<Result<_>>()?,
            key,
        };
        self.progress.stage_done(&stage.name(), record.seconds);
        record.warnings.iter().for_each(|warning| warn!("{warning}"));
        record.notes.iter().for_each(|note| info!("{note}"));
        self.keep_options(stage, &options);
        Ok(self.record.put(record, &self.work)?)
    }

    /// Stores the options of a stage that is done, and the flags that were typed for them.
    fn keep_options(&mut self, stage: Stage, all: &Value) {
        self.record.keep_options(stage, all);
        if self.command_line.once != Some(stage) {
            self.record.keep_flags(stage, &self.command_line.typed);
        }
    }

    /// True if a stage is to be done again in any case.
    fn must_redo(&self, stage: Stage) -> bool {
        self.plan.redoes(stage)
            || (stage == Stage::Query && self.asks_anew())
            || (stage == Stage::Grasp && self.lacks_a_place())
    }

    /// A hasher that has already taken in the digests of the stages that `stage` reads from.
    fn key_after_inputs(&self, stage: Stage) -> Hasher {
        let name = serde_json::to_string(&stage).expect("a stage is a word");
        self.inputs_of(stage).fold(Hasher::new(&name), |hasher, (_, digest)| hasher.with(digest.as_bytes()))
    }

    /// The stages that `stage` reads from, which must be done, with their digests.
    fn inputs_of(&self, stage: Stage) -> impl Iterator<Item = (Stage, &str)> {
        self.reads_from(stage).map(|input| {
            let record = self.record.of(input).expect("stages run in order");
            (input, record.digest.as_str())
        })
    }

    /// The stages of the plan.
    pub(crate) fn stages(&self) -> impl Iterator<Item = Stage> + use<> {
        let simulates = self.simulates;
        self.plan.stages().filter(move |stage| simulates || *stage != Stage::Simulate)
    }

    /// The stages that `stage` reads from.
    fn reads_from(&self, stage: Stage) -> impl Iterator<Item = Stage> + use<> {
        let simulates = self.simulates;
        stage.inputs().iter().copied().filter(move |input| simulates || *input != Stage::Simulate)
    }
}

impl Done {
    /// A stage that wrote `outputs` and has no warnings.
    fn writing<'a>(outputs: impl IntoIterator<Item = Artifact<'a>>) -> Self {
        Self {
            outputs: outputs.into_iter().map(|artifact| artifact.path()).collect(),
            warnings: Vec::new(),
            notes: Vec::new(),
            digest: None,
        }
    }

    fn warning(self, warnings: Vec<String>) -> Self {
        Self { warnings, ..self }
    }

    fn noting(self, notes: Vec<String>) -> Self {
        Self { notes, ..self }
    }
}

/// The work folder of the scene in `scene`.
pub fn work_folder(scene: &Path, out: Option<&Path>) -> PathBuf {
    out.map_or_else(|| scene.join(workdir::DEFAULT_NAME), Path::to_owned)
}

/// The value in `cell`, created by `make` when first needed.
fn get_or_load<T>(cell: &OnceLock<T>, make: impl FnOnce() -> Result<T>) -> Result<&T> {
    if cell.get().is_none() {
        let _ = cell.set(make()?);
    }
    Ok(cell.get().expect("it was just set"))
}

/// A picture as PNG.
fn png(picture: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    picture.write_with_encoder(PngEncoder::new(&mut bytes)).context("the picture does not encode")?;
    Ok(bytes)
}
