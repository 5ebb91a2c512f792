//! Runs the stages in order, decides which artifacts can be reused, and resumes runs.
//!
//! [`stages`] is the table of stages, one file for each; [`run`] carries out a plan, and alone keeps keys, records and
//! stored results. The other files are what commands do with an open scene besides running stages.
//!
//! A stage is done again if its key changes (the hash of its options and of the results of the stages before it) or if
//! a file that it wrote has changed or is missing. Its results are written first and its record only after them, so
//! the next run can continue after a run that was killed. Stages with costly items (views, answers, frames) save each
//! item with a checksum and resume where they were killed.

mod builder;
pub mod compat;
pub mod export;
mod hasher;
pub(crate) mod options;
pub mod picture;
mod plan;
mod preset;
mod record;
mod run;
mod segment_files;
pub mod show;
pub mod stages;
pub mod stored;
pub mod variants;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::grasp::GraspReport;
use crate::parts::{Parts, PartsError};
use crate::query::Answers;
use crate::report::Report;
use crate::scene::ObjectChoice;
use crate::segment::Segmentation;
use crate::simulate::SimulationReport;
use crate::vote::MaterialField;
use crate::workdir::{self, WorkDirError};

pub use builder::{Builder, is_untouched};
pub use hasher::Hasher;
pub use options::{OBJECT, Options, THREADS, flags_of_scene, known_flags, scene_keys};
pub(crate) use options::{problem_of, problem_with, with_values_on_one_line};
pub use plan::Plan;
pub use preset::Preset;
pub(crate) use record::RunRecord;
pub use record::{FieldFlags, flags_of_last_run};
pub(crate) use run::CommandLine;
use run::Run;
pub use segment_files::open_segmenter;
use stages::grasp::{Grasped, found_no_place};
use stages::parts::metric_parts;
pub use stages::vote::stored_field;
pub use stages::{OpenScene, Stage, StageRecord};

/// A scene being processed by the stages, with its work folder, whose lock it holds.
///
/// The methods for its results ([`segments`](Self::segments), [`answers`](Self::answers), [`field`](Self::field),
/// [`parts`](Self::parts), [`simulation`](Self::simulation), [`grasp`](Self::grasp)) run the stages that they need, unless
/// this pipeline or an earlier run did them with the same options, and read their results from the work folder. Every
/// command of the program uses this type, so the library and the program can use each other's work folders. Several
/// pipelines can be open at once, each with a work folder of its own.
///
/// Nothing is sent to a model unless the options name its server (`options.query.lmm_url`): answers come from
/// recordings. SAM and ONNX Runtime are taken from the cache, or downloaded if they are missing and
/// `options.setup.offline` is off.
pub struct Pipeline {
    open: OpenScene,
    run: Run,
}

impl Pipeline {
    /// Opens the scene in `folder`: a splat, cameras and photos, as for `gprop run`, or a mesh file. The options are
    /// [`Options::of_scene`], the work folder is `folder`/gprop, or beside a mesh, named after it (`mug.gprop/`).
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

    /// Does the stages of the plan that neither an earlier run nor this pipeline has done.
    ///
    /// # Errors
    /// The errors of the stages.
    pub fn run(&mut self) -> Result<(), Error> {
        self.run.carry_out(&mut self.open)
    }

    /// The segments that SAM cuts out of each chosen photo, nested: a label map in pixels of the photo, and for each
    /// segment its area, box, quality and the segment in which it lies.
    ///
    /// # Errors
    /// If SAM or ONNX Runtime is missing, a photo cannot be read, or the work folder cannot be written.
    pub fn segments(&mut self) -> Result<Arc<Segmentation>, Error> {
        self.up_to(Stage::Segment)?;
        self.open.get()
    }

    /// The answer to each question about a part (or a segment, with `--ask segments`), in SI units, or why there is none.
    ///
    /// # Errors
    /// As for [`segments`](Self::segments); also if an answer is not recorded and no server can give it.
    pub fn answers(&mut self) -> Result<Arc<Answers>, Error> {
        self.up_to(Stage::Query)?;
        self.open.get()
    }

    /// The label, votes and confidence of each Gaussian, in the order of the splat, and what each label stands for, in
    /// SI units.
    ///
    /// # Errors
    /// As for [`answers`](Self::answers); also if no view has a segment with an answer.
    pub fn field(&mut self) -> Result<Arc<MaterialField>, Error> {
        self.up_to(Stage::Vote)?;
        self.open.get()
    }

    /// The object and its parts in metres and kilograms, positions in the world frame.
    ///
    /// # Errors
    /// As for [`field`](Self::field); also if the metric scale is unknown, or nothing is inside the object.
    pub fn parts(&mut self) -> Result<Arc<Parts>, Error> {
        self.up_to(Stage::Parts)?;
        metric(metric_parts(&self.open))
    }

    /// The simulation frame by frame, in SI units; the frames themselves are in the work folder. Simulates even if runs
    /// and reports leave the simulation out ([`Plan::without`]).
    ///
    /// # Errors
    /// As for [`parts`](Self::parts), but an unknown metric scale is assumed; also if the simulation fails.
    pub fn simulation(&mut self) -> Result<Arc<SimulationReport>, Error> {
        let left_out = self.run.plan.without.take();
        let done = self.up_to(Stage::Simulate);
        self.run.plan.without = left_out;
        done.and_then(|()| self.open.get())
    }

    /// The forces with which a gripper may hold the object, in newtons, and the places to grasp at, in metres in the
    /// world frame.
    ///
    /// # Errors
    /// As for [`parts`](Self::parts); also if the object cannot be grasped, or a part or point that the options name does
    /// not exist.
    pub fn grasp(&mut self) -> Result<Arc<GraspReport>, Error> {
        // If only a report needed it, a grasp that cannot be computed was a warning. Here it is an error, which says why.
        if found_no_place(&self.open) {
            self.run.reconsider(Stage::Grasp);
        }
        self.up_to(Stage::Grasp)?;
        metric(self.open.get::<Grasped>().map(|grasped| grasped.0.clone()))
    }

    /// The parts as they are with the answers that are recorded by now.
    pub(crate) fn weigh_anew(&mut self) -> Result<Arc<Parts>, Error> {
        [Stage::Recognise, Stage::Refine, Stage::Query, Stage::Vote, Stage::Parts]
            .into_iter()
            .for_each(|stage| self.run.reconsider(stage));
        self.parts()
    }

    /// Does the stages that `to` needs and that this pipeline has not done yet. The plan of [`run`](Self::run) stays.
    fn up_to(&mut self, to: Stage) -> Result<(), Error> {
        let last = std::mem::replace(&mut self.run.plan.to, to);
        let done = self.run();
        self.run.plan.to = last;
        done
    }

    /// The open scene.
    pub(crate) fn opened(&self) -> &OpenScene {
        &self.open
    }

    /// The stages that are done and planned.
    pub(crate) fn run_state(&self) -> &Run {
        &self.run
    }

    /// Stores the flags that were typed for a stage which a later command does.
    pub(crate) fn keep_flags(&mut self, stage: Stage) -> Result<()> {
        self.run.keep_flags(&self.open, &[stage])
    }

    /// Does one more stage, all of whose inputs are done, unless its results from an earlier run can be reused.
    pub(crate) fn also(&mut self, stage: Stage) -> Result<()> {
        self.run.step(&self.open, stage)
    }

    /// The result of a finished run.
    pub(crate) fn report(&self) -> Result<Report> {
        stages::report::report(&self.open, &self.run.job(Stage::Report, ""))
    }
}

/// A result that exists only if the metric scale is known.
fn metric<T>(found: Result<Option<T>>) -> Result<T, Error> {
    found.and_then(|found| Ok(found.ok_or(PartsError::ScaleUnknown)?))
}

/// The work folder of the chosen object of a scene: that of the scene, or one below it.
///
/// # Errors
/// [`WorkDirError::Link`] if a folder that the user did not name is a link.
pub fn work_folder_of(scene: &Path, out: Option<&Path>, object: ObjectChoice) -> Result<PathBuf, WorkDirError> {
    let root = workdir::named_or(out, work_folder(scene, None))?;
    let ObjectChoice::One(number) = object else { return Ok(root) };
    let folder = workdir::object_folder(&root, &number.to_string());
    let below = folder.ancestors().take_while(|path| *path != root);
    below.into_iter().try_for_each(|path| workdir::refuse_link(path, workdir::OUT))?;
    Ok(folder)
}

/// The file with corrections of a scene, which the report writes: `corrections.toml` in its folder, or beside a mesh, named
/// after it; of an object of several, named after that (`object_2.corrections.toml`).
pub fn corrections_file(scene: &Path, object: ObjectChoice) -> PathBuf {
    const NAME: &str = "corrections.toml";
    match object {
        _ if scene.is_file() => scene.with_extension(NAME),
        ObjectChoice::One(number) => scene.join(format!("{number}.{NAME}")),
        ObjectChoice::Auto | ObjectChoice::All => scene.join(NAME),
    }
}

/// The work folder of the scene in `scene`: by default `gprop/` in its folder, or beside a mesh, named after it.
pub fn work_folder(scene: &Path, out: Option<&Path>) -> PathBuf {
    let default = || {
        if scene.is_file() { scene.with_extension(workdir::DEFAULT_NAME) } else { scene.join(workdir::DEFAULT_NAME) }
    };
    out.map_or_else(default, Path::to_owned)
}
