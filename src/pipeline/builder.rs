//! The builder of a pipeline: its folders and options.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::run::{CommandLine, Run};
use super::stages::{OpenScene, Stage, Tools, shared_scale};
use super::{Options, Pipeline, Plan, work_folder_of};
use crate::error::{Error, Result};
use crate::scene::{self, Scene, SceneError};
use crate::vote::{self, VoteError};
use crate::words::progress::{CancelToken, Event, Progress, ShowProgress, Watcher};
use crate::workdir::WorkDir;

/// Settings for opening a [`Pipeline`]; from [`Pipeline::builder`].
#[derive(Debug, Clone)]
pub struct Builder {
    folder: PathBuf,
    out: Option<PathBuf>,
    options: Option<Options>,
    plan: Plan,
    command_line: CommandLine,
    watcher: Watcher,
}

impl Builder {
    pub(super) fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            out: None,
            options: None,
            plan: Plan::to(Stage::Report),
            command_line: CommandLine::default(),
            watcher: Watcher::default(),
        }
    }

    /// The work folder; by default `gprop/` in the scene's folder, or beside a mesh, named after it.
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

    /// The flags that stand for the options.
    pub(crate) fn command_line(self, command_line: CommandLine) -> Self {
        Self { command_line, ..self }
    }

    /// The progress shown on stderr while stages run; by default only warnings, which go to `tracing`.
    pub fn progress(self, shown: ShowProgress) -> Self {
        Self { watcher: Watcher { shown, ..self.watcher }, ..self }
    }

    /// Calls `listener` at each step while stages run, from any thread.
    pub fn on_progress(self, listener: impl Fn(&Event) + Send + Sync + 'static) -> Self {
        Self { watcher: Watcher { listener: Some(Arc::new(listener)), ..self.watcher }, ..self }
    }

    /// Lets the token cancel what the pipeline does: that ends with an error of the kind
    /// [`Cancelled`](crate::ErrorKind::Cancelled), and the next run goes on from there.
    pub fn cancel_with(self, token: &CancelToken) -> Self {
        Self { watcher: Watcher { cancel: token.clone(), ..self.watcher }, ..self }
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
        let open = load(&self.folder, self.out.as_deref(), options, self.watcher)?;
        let run = Run::new(&open, self.plan, self.command_line);
        Ok(Pipeline { open, run })
    }
}

fn load(folder: &Path, out: Option<&Path>, mut options: Options, watcher: Watcher) -> Result<OpenScene> {
    options.check()?;
    options.scene = options.scene.with_object_by_number(folder)?.into_owned();
    shared_scale::check(&options)?;
    let scene = one_object(folder, &options.scene, watcher.progress(None))?;
    let tools = Tools::load(&options)?;
    vote::check_materials(&options.vote.correct, &tools.library).map_err(VoteError::from)?;
    crate::simulate::script_of(&options.simulate)?;
    let root = work_folder_of(folder, out, options.scene.object)?;
    OpenScene::new(folder, WorkDir::open(&root)?, scene, tools, options, watcher)
}

/// True if nothing has been done in the work folder yet; does not create one.
///
/// # Errors
/// If the scene cannot be read or the options do not fit it.
pub fn is_untouched(folder: &Path, out: Option<&Path>, options: &Options) -> Result<bool> {
    if work_folder_of(folder, out, options.scene.object)?.exists() {
        return Ok(false);
    }
    one_object(folder, &options.scene, Progress::HIDDEN)?;
    Ok(true)
}

/// The scene in `folder`, if it is clear which object it is about.
fn one_object(folder: &Path, options: &scene::Options, progress: Progress) -> Result<Scene, SceneError> {
    let scene = scene::load_with_progress(folder, options, progress)?;
    match scene.unchosen {
        Some(count) => Err(SceneError::SeveralObjects { count }),
        None => Ok(scene),
    }
}
