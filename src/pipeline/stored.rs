//! Opens the results of a run for evaluation, with the options that the run used, without changing anything on disk.
//!
//! A work folder may come with a scene from elsewhere, so its `run.json` is trusted only as far as it can do no harm:
//! no server is asked, no library is opened, and files outside the scene are read only if the user named the work
//! folder, or allowed the folder to which a link of the scene leads.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::config;
use crate::error::Result;
use crate::gaussians::Gaussians;
use crate::objects;
use crate::parts::Parts;
use crate::query::LabelSet;
use crate::scene::object::outliers;
use crate::scene::{ScaleChoice, SceneError};
use crate::setup;
use crate::units::MetricScale;
use crate::vote::MaterialField;
use crate::words::progress::{Progress, ShowProgress, Watcher};
use crate::words::shell;
use crate::workdir::{self, Artifact, Standing, WorkDir, WorkDirError};

use super::hasher::version;
use super::record::RunRecord;
use super::stages::parts::scale_after_weighing;
use super::stages::vote::stored_field;
use super::stages::{self, OpenScene, Stage, Tools};
use super::{Options, Plan, work_folder};

/// The work folder of a scene in which some stages are completely done.
pub struct StoredRun {
    work: WorkDir,
    record: RunRecord,
    command: String,
}

impl StoredRun {
    /// Opens the results of a run on the scene in `folder` (in `out` if given), from which `stages` are to be read.
    ///
    /// # Errors
    /// [`WorkDirError::Unfinished`] if one of the stages is not done, was done before a stage that it reads from was
    /// done again, or wrote files that have changed since; [`WorkDirError::Link`] if the folder is a link that the user
    /// did not name.
    pub fn open(folder: &Path, out: Option<&Path>, stages: &[Stage]) -> Result<Self, WorkDirError> {
        let root = workdir::named_or(out, work_folder(folder, None))?;
        let command = match out {
            None => format!("gprop run {}", shell::path(folder)),
            Some(out) => format!("gprop run {} --out {}", shell::path(folder), shell::path(out)),
        };
        let work = WorkDir::open_to_read(&root)?;
        let unfinished =
            |problem: String| WorkDirError::Unfinished { path: root.clone(), problem, command: command.clone() };
        if work.size(Artifact::Run).is_none() {
            if let Some((_, object)) = objects::folders_in(&workdir::objects_folder(&root)).pop_first() {
                return Err(WorkDirError::OfSeveral { path: root, object });
            }
            return Err(unfinished("nothing has been run: there is no run.json".to_owned()));
        }
        let record: RunRecord = work.read_json(Artifact::Run)?;
        if record.version != version() {
            return Err(unfinished(format!("it was made by gprop {:?}, but this is {:?}", record.version, version())));
        }
        for stage in stages {
            require_done(*stage, &record).map_err(|reason| unfinished(reason.to_string()))?;
            for (path, standing) in record.of(*stage).map(|done| done.standing(&work)).unwrap_or_default() {
                match standing {
                    Standing::Whole => {}
                    Standing::Missing => return Err(unfinished(format!("{path:?} is missing"))),
                    Standing::Changed => {
                        return Err(unfinished(format!("{path:?} has changed since gprop wrote it")));
                    }
                }
            }
        }
        Ok(Self { work, record, command })
    }

    /// Path of an artifact.
    pub fn path(&self, artifact: Artifact) -> PathBuf {
        self.work.path(artifact)
    }

    /// The Gaussians in the input's frame, with the outliers set aside as in the run, and their material field; the vote must
    /// be among the stages.
    ///
    /// # Errors
    /// If they are not what gprop wrote.
    pub fn field(&self) -> Result<(Gaussians, MaterialField)> {
        let (mut gaussians, field) = stored_field(self.work.root())?;
        outliers::set_aside(&mut gaussians, Progress::HIDDEN).map_err(SceneError::from)?;
        Ok((gaussians, field))
    }

    /// The metric scale that the run found in the photos, by a model's estimate or by the object's mass; the grasp stage,
    /// which needs it, must be among the stages. `None` if the run did not look for it.
    ///
    /// # Errors
    /// If the files are not what gprop wrote.
    pub fn found_scale(&self) -> Result<Option<MetricScale>> {
        let scene = self.field_of_options::<crate::scene::Options>("scene")?;
        let known = match scene.scale {
            ScaleChoice::Estimate => {
                let options = Options { scene, ..Options::default() };
                let shared = stages::shared_scale::of_object(self.work.root(), &options);
                return Ok(
                    shared.map_or_else(|| stages::recognise::estimated_scale(&self.work), |scale| Ok(Some(scale)))?
                );
            }
            _ => stages::scene::stored_scale(&self.work)?,
        };
        let parts = self.work.read_json::<Parts>(Artifact::Parts).ok();
        // With no other scale, the one of the parts is that of a weight.
        let is_weighed = |parts: &Parts| known.is_none() || parts.known_mass.is_some();
        Ok(scale_after_weighing(known.clone(), parts.filter(is_weighed).as_ref()))
    }

    /// The options of the run, as far as they determine what was read. The folders outside the scene `folder` that may be
    /// read are not among them: the user allows them again (`allow_read`).
    ///
    /// # Errors
    /// If `run.json` is invalid, or names files outside the scene although the user did not name the work folder
    /// (`trusted`).
    pub fn options(&self, folder: &Path, trusted: bool, allow_read: &[PathBuf]) -> Result<Options, WorkDirError> {
        let scene: crate::scene::Options = self.field_of_options("scene")?;
        let mut options = Options {
            scene: crate::scene::Options { allow_read: allow_read.to_owned(), ..scene },
            consensus: self.field_of_options("consensus")?,
            query: self.field_of_options("query")?,
            materials: self.field_of_options("materials")?,
            vote: self.field_of_options("vote")?,
            ..Options::default()
        };
        for path in paths(&mut options) {
            *path = folder.join(&*path);
            if !trusted && !is_within(path, folder) {
                return Err(WorkDirError::Foreign { path: self.work.root().to_owned(), input: path.clone() });
            }
        }
        Ok(options)
    }

    /// A field of the run's options; the default if `run.json` does not have it.
    fn field_of_options<T: DeserializeOwned + Default>(&self, name: &str) -> Result<T, WorkDirError> {
        let Some(value) = self.record.options.get(name) else { return Ok(T::default()) };
        T::deserialize(value).map_err(|error| self.work.damaged(Artifact::Run, format!("options of {name}: {error}")))
    }
}

/// Why a stage's results cannot be read.
#[derive(Debug, thiserror::Error)]
enum NotDone {
    #[error("the {} stage is not done", .0.name())]
    Never(Stage),
    #[error("the {} stage was done again after the {} stage", input.name(), stage.name())]
    BeforeItsInput { input: Stage, stage: Stage },
}

/// Fails with the reason unless `stage` is done, and was done after those that it reads from.
fn require_done(stage: Stage, record: &RunRecord) -> Result<(), NotDone> {
    let done = record.of(stage).ok_or(NotDone::Never(stage))?;
    for input in stage.row().inputs {
        require_done(*input, record)?;
        let now = record.of(*input).map(|input| &input.digest);
        let then = done.inputs.iter().find(|(name, _)| name == input).map(|(_, digest)| digest);
        if now != then {
            return Err(NotDone::BeforeItsInput { input: *input, stage });
        }
    }
    Ok(())
}

/// The options of a run on the scene in `folder` as `run.json` stores them: with [portable](config::portable) paths.
pub(super) fn with_portable_paths(options: &Options, folder: &Path) -> Options {
    let mut options = options.clone();
    for path in paths(&mut options) {
        let portable = config::portable(path, folder);
        *path = if portable.to_str().is_some() { portable } else { unicode(path) };
    }
    let setup::Options { ort_lib, sam_encoder, sam_decoder, .. } = &mut options.setup;
    for path in [ort_lib, sam_encoder, sam_decoder].into_iter().flatten() {
        *path = unicode(path);
    }
    options
}

/// The path [as JSON can show it](config::in_json).
fn unicode(path: &Path) -> PathBuf {
    config::in_json(path).into_owned().into()
}

/// The files and folders of the user that the options name, as far as they determine what was read.
fn paths(options: &mut Options) -> Vec<&mut PathBuf> {
    let Options { scene, segment, query, materials, .. } = options;
    let labels = match &mut query.labels {
        Some(LabelSet::File(path)) => Some(path),
        _ => None,
    };
    let of_scene = [&mut scene.splat, &mut scene.cameras, &mut scene.images, &mut scene.masks];
    let of_query = [&mut query.prompts, &mut query.recordings, &mut query.lmm_body];
    let others = [&mut segment.segments, &mut materials.materials].into_iter().chain(of_query);
    of_scene.into_iter().chain(others).flatten().chain(labels).collect()
}

fn is_within(path: &Path, folder: &Path) -> bool {
    matches!((path.canonicalize(), folder.canonicalize()), (Ok(path), Ok(folder)) if path.starts_with(&folder))
}

/// Opens the results of a run on the scene in `folder` (in `out` if given), to read those of `last`, at most the vote,
/// and of the stages that it needs, with the options of the run. Files of the scene that lie outside its folder are read
/// only from the folders in `allow_read`. Changes nothing on disk.
///
/// # Errors
/// As for [`StoredRun::open`]; also if the scene's files have changed since, or the scene cannot be loaded.
pub fn open(
    folder: &Path,
    out: Option<&Path>,
    allow_read: &[PathBuf],
    last: Stage,
    shown: ShowProgress,
) -> Result<OpenScene> {
    let plan = Plan::to(last);
    let stored = StoredRun::open(folder, out, &plan.stages().collect::<Vec<_>>())?;
    let options = stored.options(folder, out.is_some(), allow_read)?;
    let scene =
        crate::scene::load_with_progress(folder, &options.scene, shown.into()).map_err(SceneError::without_flag)?;
    let tools = Tools::load(&options)?;
    let StoredRun { work, record, command } = stored;
    let open = OpenScene::new(folder, work, scene, tools, options, Watcher { shown, ..Watcher::default() })?;
    let key = stages::scene::key(&open)?;
    if record.of(Stage::Scene).is_none_or(|done| done.key != key) {
        let (path, problem) = (open.work.root().to_owned(), "the scene's files have changed since that run".to_owned());
        return Err(WorkDirError::Unfinished { path, problem, command }.into());
    }
    Ok(open)
}
