//! The stages in order; which artifacts are still good; resume.
//!
//! A stage is done again when its key changes: the hash of its options and of what the stages before it made. What it
//! made is then written, and only after that its record, so a run that is killed finds its way at the next start.
//! Stages with costly items (views, answers, frames) save each item and take up where they were killed.

mod batch;
pub mod compat;
pub mod desk;
mod export;
mod grasp;
mod parts;
pub mod picture;
mod plan;
mod query;
mod record;
mod report;
mod scene;
mod segment;
mod simulate;
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

use crate::exit::UsageError;
use crate::from_splat;
use crate::grasp::gripper::GripperProfile;
use crate::materials::MaterialLibrary;
use crate::parts::PartsResult;
use crate::progress::Progress;
use crate::query::Answers;
use crate::scene::{Scene, View};
use crate::segment::Segmentation;
use crate::vote::MaterialField;
use crate::workdir::{self, Artifact, WorkDir};
pub use segment::open_segmenter;
pub use vote::stored_field;

pub use batch::{Collected, Sent};
pub use plan::{Plan, Stage};
pub use record::Hasher;
use record::{RunRecord, StageRecord};

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
    parts: OnceLock<PartsResult>,
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
        let mut scene = crate::scene::load(folder, &options.scene)?;
        let library = options.materials.library()?;
        let gripper = GripperProfile::load(&options.grasp.gripper)?;
        options.grasp.checked_lift_angle_rad()?;
        let root = work_folder(folder, out);
        if out.is_none() {
            workdir::refuse_link(&root, "--out")?;
        }
        let work = WorkDir::open(&root)?;
        if let Some(count) = options.scene.render_views {
            let folder = root.join("rendered");
            workdir::refuse_link(&folder, "--out")?;
            let folder = folder.join(scene::rendering_key(&scene, &options.scene)?);
            from_splat::render_views(&mut scene, count.get(), &folder)
                .map_err(|error| UsageError(format!("cannot write views into {folder:?}: {error}")))?;
        }
        let views = scene.chosen_views(&options.scene)?;
        let mut record = RunRecord::load(&work);
        record.options = serde_json::to_value(&options)?;
        Ok(Self {
            folder: folder.to_owned(),
            work,
            options,
            plan,
            typed: Vec::new(),
            progress,
            record,
            library,
            gripper,
            scene,
            views,
            segmentation: OnceLock::new(),
            answers: OnceLock::new(),
            field: OnceLock::new(),
            parts: OnceLock::new(),
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
            if has_inputs
                && !self.must_redo(stage)
                && self.record.still_good(stage, &self.key(stage)?, &self.work).is_some()
            {
                found.push(stage);
            }
        }
        Ok(found)
    }

    /// The work folder.
    pub fn work(&self) -> &WorkDir {
        &self.work
    }

    /// Does a stage unless what an earlier run left of it is still good.
    fn step(&mut self, stage: Stage) -> Result<()> {
        let key = self.key(stage)?;
        let good = self.record.still_good(stage, &key, &self.work).filter(|_| !self.must_redo(stage));
        if let Some(good) = good {
            info!(?stage, "still good");
            let record = StageRecord { reused: true, ..good.clone() };
            return Ok(self.record.put(record, &self.work)?);
        }
        self.record.forget(stage, &self.work)?;
        let start = Instant::now();
        let done = self.work_on(stage, &key)?;
        // Recordings are part of the query's key, and what was asked is recorded now.
        let key = if stage == Stage::Query { self.key(stage)? } else { key };
        let size = |path: PathBuf| -> Result<_> {
            let length = std::fs::metadata(self.work.root().join(&path))?.len();
            Ok((path, length))
        };
        let record = StageRecord {
            name: stage,
            seconds: start.elapsed().as_secs_f64(),
            reused: false,
            warnings: done.warnings,
            digest: done.digest.unwrap_or_else(|| key.clone()),
            outputs: done.outputs.into_iter().map(size).collect::<Result<_>>()?,
            key,
        };
        self.progress.line(&format!("{:<9} {:.1} s", stage.name(), record.seconds));
        record.warnings.iter().for_each(|warning| warn!("{warning}"));
        Ok(self.record.put(record, &self.work)?)
    }

    /// Whether the user wants a stage done again whatever was left of it.
    fn must_redo(&self, stage: Stage) -> bool {
        self.plan.redoes(stage) || (stage == Stage::Query && self.asks_anew())
    }

    /// A hash that begins with the digests of the stages that `stage` reads from.
    fn key_after_inputs(&self, stage: Stage) -> Hasher {
        let name = serde_json::to_string(&stage).expect("a stage is a word");
        stage.inputs().iter().fold(Hasher::new(&name), |hasher, input| {
            let record = self.record.stages.iter().find(|record| record.name == *input);
            hasher.with(record.expect("stages run in order").digest.as_bytes())
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

fn work_folder(scene: &Path, out: Option<&Path>) -> PathBuf {
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
