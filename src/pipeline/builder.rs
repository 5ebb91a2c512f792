//! The builder of a pipeline: its folders and options.

use std::path::{Path, PathBuf};

use anyhow::Result;

use super::run::{CommandLine, Run};
use super::stages::{OpenScene, Stage, Tools};
use super::{Options, Pipeline, Plan, work_folder};
use crate::error::Error;
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
    command_line: CommandLine,
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
            command_line: CommandLine::default(),
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

    /// The flags that stand for the options.
    pub(crate) fn command_line(self, command_line: CommandLine) -> Self {
        Self { command_line, ..self }
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
        let open = load(&self.folder, self.out.as_deref(), options, self.progress).map_err(Error)?;
        let run = Run::new(&open, self.plan, self.simulates, self.command_line);
        Ok(Pipeline { open, run })
    }
}

fn load(folder: &Path, out: Option<&Path>, options: Options, progress: Progress) -> Result<OpenScene> {
    options.check()?;
    let scene = crate::scene::load(folder, &options.scene)?;
    let tools = Tools::load(&options)?;
    crate::simulate::script_of(&options.simulate)?;
    let root = workdir::named_or(out, work_folder(folder, None))?;
    OpenScene::new(folder, WorkDir::open(&root)?, scene, tools, options, progress)
}

/// True if nothing has been done in the work folder yet; does not create one.
///
/// # Errors
/// If the scene cannot be read or the options do not fit it.
pub fn is_untouched(folder: &Path, out: Option<&Path>, options: &Options) -> Result<bool> {
    if work_folder(folder, out).exists() {
        return Ok(false);
    }
    crate::scene::load(folder, &options.scene)?;
    Ok(true)
}
