//! The stages in order; which artifacts are still good; resume.
//!
//! A stage is done again when its key changes, the hash of its options and of what the stages before it made, or when a
//! file that it wrote holds other bytes now. What it made is then written, and only after that its record, so a run that
//! is killed finds its way at the next start. Stages with costly items (views, answers, frames) save each item with a
//! checksum and take up where they were killed.

mod batch_api;
pub mod compat;
mod export;
mod grasp;
mod parts;
pub mod picture;
mod plan;
mod query;
pub mod query_session;
mod record;
mod report;
mod scene;
mod segment;
mod simulate;
pub mod stored;
mod variants;
mod vote;

use std::borrow::Cow;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use anyhow::{Context, Result};
use image::{ImageFormat, RgbImage};
use serde::Serialize;
use tracing::{info, warn};

use crate::config::SceneKey;
use crate::error::UsageError;
use crate::from_splat;
use crate::grasp::gripper::GripperProfile;
use crate::materials::MaterialLibrary;
use crate::parts::Interior;
use crate::progress::Progress;
use crate::query::Answers;
use crate::scene::{Scene, View};
use crate::segment::Segmentation;
use crate::vote::MaterialField;
use crate::workdir::{self, Artifact, WorkDir};
pub use segment::open_segmenter;
pub use vote::stored_field;

pub use batch_api::{Collected, Sent, check_submission};
pub use plan::{Plan, Stage};
pub use record::Hasher;
use record::{Left, Output, RunRecord, StageRecord};

/// The options of all stages.
#[derive(Debug, Clone, Default, Serialize, clap::Args)]
pub struct Options {
    #[command(flatten)]
    pub scene: crate::scene::Options,
    #[command(flatten)]
    pub segment: crate::segment::Options,
    #[command(flatten)]
    pub setup: crate::setup::Options,
    #[command(flatten)]
    pub query: crate::query::Options,
    #[command(flatten)]
    pub materials: crate::materials::Options,
    #[command(flatten)]
    pub vote: crate::vote::Options,
    #[command(flatten)]
    pub parts: crate::parts::Options,
    #[command(flatten)]
    pub simulate: crate::simulate::Options,
    #[command(flatten)]
    pub grasp: crate::grasp::Options,
}

/// The keys of all stages' options that a scene's `gprop.toml` may set. Every other option is the user's alone.
pub fn scene_keys() -> Vec<SceneKey> {
    let stages = [
        crate::scene::SCENE_KEYS,
        crate::segment::SCENE_KEYS,
        crate::setup::SCENE_KEYS,
        crate::query::SCENE_KEYS,
        crate::materials::SCENE_KEYS,
        crate::vote::SCENE_KEYS,
        crate::parts::SCENE_KEYS,
        crate::simulate::SCENE_KEYS,
        crate::grasp::SCENE_KEYS,
    ];
    stages.concat()
}

/// A scene on its way through the stages.
pub struct Pipeline {
    folder: PathBuf,
    work: WorkDir,
    options: Options,
    plan: Plan,
    typed: Vec<String>,
    progress: Progress,
    record: RunRecord,
    library: Cow<'static, MaterialLibrary>,
    gripper: GripperProfile,
    scene: Scene,
    views: Vec<View>,
    segmentation: OnceLock<Segmentation>,
    answers: OnceLock<Answers>,
    field: OnceLock<MaterialField>,
    interior: OnceLock<Interior>,
}

/// What a stage says of itself when it is done.
struct Done {
    /// The files it wrote.
    outputs: Vec<PathBuf>,
    warnings: Vec<String>,
    /// Hash of what it made where its key does not determine it.
    digest: Option<String>,
}

impl Pipeline {
    /// Loads the scene in `folder` and what an earlier run left in `out` (`folder`/gprop where it is not given).
    pub fn open(folder: &Path, out: Option<&Path>, options: Options, plan: Plan, progress: Progress) -> Result<Self> {
        let scene = crate::scene::load(folder, &options.scene)?;
        let library = options.materials.library()?;
        let gripper = GripperProfile::load(&options.grasp.gripper)?;
        options.grasp.checked_lift_angle_rad()?;
        options.parts.check()?;
        crate::simulate::script_of(&options.simulate)?;
        let root = work_folder(folder, out);
        if out.is_none() {
            workdir::refuse_link(&root, "--out")?;
        }
        Self::within(folder, WorkDir::open(&root)?, scene, (library, gripper), options, plan, progress)
    }

    /// The scene with its work folder.
    fn within(
        folder: &Path,
        work: WorkDir,
        mut scene: Scene,
        (library, gripper): (Cow<'static, MaterialLibrary>, GripperProfile),
        options: Options,
        plan: Plan,
        progress: Progress,
    ) -> Result<Self> {
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
            typed: Vec::new(),
            progress,
            record,
            library,
            gripper,
            scene,
            segmentation: OnceLock::new(),
            answers: OnceLock::new(),
            field: OnceLock::new(),
            interior: OnceLock::new(),
        })
    }

    /// The same with the flags that stand for its options, for the report to say how it was made.
    pub fn typed(self, typed: Vec<String>) -> Self {
        Self { typed, ..self }
    }

    /// Whether nothing has been done in the work folder yet; makes none.
    ///
    /// # Errors
    /// Where the scene cannot be read or the options do not fit it.
    pub fn is_untouched(folder: &Path, out: Option<&Path>, options: &Options) -> Result<bool> {
        if work_folder(folder, out).exists() {
            return Ok(false);
        }
        crate::scene::load(folder, &options.scene)?;
        Ok(true)
    }

    /// Runs the stages of the plan.
    pub fn run(&mut self) -> Result<()> {
        self.plan.stages().try_for_each(|stage| self.step(stage))
    }

    /// Hash of everything a stage depends on; the stages before it must be done.
    fn key(&self, stage: Stage) -> Result<String> {
        Ok(match stage {
            Stage::Scene => self.scene_key()?,
            Stage::Segment => self.segment_key()?,
            Stage::Query => self.query_key()?,
            Stage::Vote => self.vote_key(),
            Stage::Parts => self.parts_key(),
            Stage::Simulate => self.simulate_key(),
            Stage::Grasp => self.grasp_key(),
            Stage::Report => self.report_key(),
        })
    }

    fn work_on(&self, stage: Stage, key: &str) -> Result<Done> {
        match stage {
            Stage::Scene => self.do_scene(),
            Stage::Segment => self.do_segment(),
            Stage::Query => self.do_query(),
            Stage::Vote => self.do_vote(),
            Stage::Parts => self.do_parts(),
            Stage::Simulate => self.do_simulate(key),
            Stage::Grasp => self.do_grasp(),
            Stage::Report => self.do_report(),
        }
    }

    /// Stages of the plan that an earlier run left as this one would.
    pub fn reusable(&self) -> Result<Vec<Stage>> {
        let mut found: Vec<Stage> = Vec::new();
        for stage in self.plan.stages() {
            let has_inputs = stage.inputs().iter().all(|input| found.contains(input));
            if has_inputs && self.left(stage, &self.key(stage)?).is_some() {
                found.push(stage);
            }
        }
        Ok(found)
    }

    /// The record of a stage that needs not be done; warns of files that somebody changed.
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
    pub fn work(&self) -> &WorkDir {
        &self.work
    }

    /// Does a stage unless what an earlier run left of it is still good.
    fn step(&mut self, stage: Stage) -> Result<()> {
        let key = self.key(stage)?;
        let options = serde_json::to_value(&self.options)?;
        if let Some(good) = self.left(stage, &key) {
            info!(?stage, "still good");
            let record = StageRecord { reused: true, ..good.clone() };
            self.record.keep_options(stage, &options);
            return Ok(self.record.put(record, &self.work)?);
        }
        self.work.require_writable().with_context(|| format!("the {} stage is to be done", stage.name()))?;
        self.record.forget(stage, &self.work)?;
        let start = Instant::now();
        let done = self.work_on(stage, &key)?;
        // Recordings are part of the query's key, and what was asked is recorded now.
        let key = if stage == Stage::Query { self.key(stage)? } else { key };
        let output = |path: PathBuf| Ok(Output { checksum: self.work.checksum(&path)?, path });
        let record = StageRecord {
            name: stage,
            seconds: start.elapsed().as_secs_f64(),
            reused: false,
            warnings: done.warnings,
            inputs: self.inputs_of(stage).map(|(input, digest)| (input, digest.to_owned())).collect(),
            digest: done.digest.unwrap_or_else(|| key.clone()),
            outputs: done.outputs.into_iter().map(output).collect::<Result<_>>()?,
            key,
        };
        self.progress.line(&format!("{:<9} {:.1} s", stage.name(), record.seconds));
        record.warnings.iter().for_each(|warning| warn!("{warning}"));
        self.record.keep_options(stage, &options);
        Ok(self.record.put(record, &self.work)?)
    }

    /// Whether the user wants a stage done again whatever was left of it.
    fn must_redo(&self, stage: Stage) -> bool {
        self.plan.redoes(stage) || (stage == Stage::Query && self.asks_anew())
    }

    /// A hash that begins with the digests of the stages that `stage` reads from.
    fn key_after_inputs(&self, stage: Stage) -> Hasher {
        let name = serde_json::to_string(&stage).expect("a stage is a word");
        self.inputs_of(stage).fold(Hasher::new(&name), |hasher, (_, digest)| hasher.with(digest.as_bytes()))
    }

    /// The stages that `stage` reads from, which must be done, with their digests.
    fn inputs_of(&self, stage: Stage) -> impl Iterator<Item = (Stage, &str)> {
        stage.inputs().iter().map(|input| {
            let record = self.record.of(*input).expect("stages run in order");
            (*input, record.digest.as_str())
        })
    }
}

impl Done {
    /// A stage that wrote `outputs` and found nothing to warn of.
    fn writing<'a>(outputs: impl IntoIterator<Item = Artifact<'a>>) -> Self {
        Self {
            outputs: outputs.into_iter().map(|artifact| artifact.path()).collect(),
            warnings: Vec::new(),
            digest: None,
        }
    }

    fn warning(self, warnings: Vec<String>) -> Self {
        Self { warnings, ..self }
    }
}

/// The work folder of the scene in `scene`.
pub fn work_folder(scene: &Path, out: Option<&Path>) -> PathBuf {
    out.map_or_else(|| scene.join(workdir::DEFAULT_NAME), Path::to_owned)
}

/// The value in `cell`, made by `make` at the first need.
fn get_or_load<T>(cell: &OnceLock<T>, make: impl FnOnce() -> Result<T>) -> Result<&T> {
    if cell.get().is_none() {
        let _ = cell.set(make()?);
    }
    Ok(cell.get().expect("it was just set"))
}

/// A picture as PNG.
fn png(picture: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png).context("the picture does not encode")?;
    Ok(bytes.into_inner())
}
