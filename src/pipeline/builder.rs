//! The builder of a pipeline: its folders and options.

use std::path::{Path, PathBuf};

use anyhow::Result;

use super::{Options, Pipeline, Plan, Stage, work_folder};
use crate::error::Error;
use crate::grasp::gripper::GripperProfile;
use crate::words::progress::Progress;
use crate::workdir::{self, WorkDir};

/// Settings for opening a [`Pipeline`]; from [`Pipeline::builder`].
#[derive(Debug, Clone)]
pub struct Builder {
    folder: PathBuf,
    out: Option<PathBuf>,
    options: Option<Options>,
    plan: Plan,
    simulates: bool,
    progress: Progress,
}

impl Builder {
    pub(super) fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            out: None,
            options: None,
            plan: Plan { to: Stage::Report, from: None },
            simulates: true,
            progress: Progress::Hidden,
        }
    }

    /// The work folder; by default `gprop/` in the scene's folder.
    pub fn out(self, folder: impl AsRef<Path>) -> Self {
        Self { out: Some(folder.as_ref().to_owned()), ..self }
    }

    /// The options; by default [`Options::of_scene`].
    pub fn options(self, options: Options) -> Self {
        Self { options: Some(options), ..self }
    }

    /// The last stage that [`Pipeline::run`] does, and the first stage that does not reuse the results of an earlier run.
    /// By default, all stages are done and any results can be reused.
    pub fn plan(self, plan: Plan) -> Self {
        Self { plan, ..self }
    }

    /// Leaves the simulation out of the run and of the report.
    pub fn without_simulation(self) -> Self {
        Self { simulates: false, ..self }
    }

    /// The progress shown on stderr while stages run; by default only warnings, which go to `tracing`.
    pub fn progress(self, progress: Progress) -> Self {
        Self { progress, ..self }
    }

    /// Loads the scene and locks its work folder, which is created if it does not exist.
    ///
    /// # Errors
    /// If the scene cannot be read, an option is outside its domain, or the work folder cannot be used.
    pub fn open(self) -> Result<Pipeline, Error> {
        let options = match self.options {
            Some(options) => options,
            None => Options::of_scene(&self.folder)?,
        };
        let opened = Self::load(&self.folder, self.out.as_deref(), options, self.plan, self.progress);
        let opened = opened.map(|pipeline| Pipeline { simulates: self.simulates, ..pipeline });
        opened.map_err(Error)
    }

    fn load(folder: &Path, out: Option<&Path>, options: Options, plan: Plan, progress: Progress) -> Result<Pipeline> {
        options.check()?;
        let scene = crate::scene::load(folder, &options.scene)?;
        let library = options.materials.library()?;
        let gripper = GripperProfile::load(&options.grasp.gripper)?;
        crate::simulate::script_of(&options.simulate)?;
        let root = workdir::named_or(out, work_folder(folder, None))?;
        Pipeline::within(folder, WorkDir::open(&root)?, scene, (library, gripper), options, plan, progress)
    }
}
