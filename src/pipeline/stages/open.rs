//! A scene that is open, with everything its stages read.

use std::any::{Any, TypeId};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Stage, Stored};
use crate::error::{Result, UsageError};
use crate::from_splat::{self, photo_with_foreground};
use crate::grasp::gripper::GripperProfile;
use crate::materials::MaterialLibrary;
use crate::pipeline::hasher::{Hasher, file_digest};
use crate::pipeline::options::Options;
use crate::pipeline::segment_files::check_formats;
use crate::query::ask::budget::Budget;
use crate::scene::{self, Photo, Scene, SceneError, View};
use crate::words::progress::{Progress, StageNumber, Watcher};
use crate::workdir::WorkDir;

/// A scene with its options and its work folder, whose lock it holds. Stages only read it.
pub struct OpenScene {
    /// The scene as the user named it: its folder, or a mesh file.
    pub path: PathBuf,
    /// The scene's folder, or that of the mesh.
    pub folder: PathBuf,
    pub work: WorkDir,
    pub options: Options,
    pub library: Cow<'static, MaterialLibrary>,
    pub gripper: GripperProfile,
    pub scene: Scene,
    /// The chosen views.
    pub views: Vec<View>,
    /// Who follows the run.
    pub watcher: Watcher,
    /// The stage that is being done.
    pub number: Option<StageNumber>,
    /// That of the questions about the whole object, for those about its parts.
    pub budget: LeftBudget,
    kept: Kept,
}

/// A budget that a stage leaves to the next one that asks.
#[derive(Default)]
pub struct LeftBudget(Mutex<Option<Budget>>);

impl LeftBudget {
    pub fn leave(&self, budget: Budget) {
        *self.left() = Some(budget);
    }

    pub fn take(&self) -> Option<Budget> {
        self.left().take()
    }

    fn left(&self) -> MutexGuard<'_, Option<Budget>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The tables and profiles that the options name, besides the scene.
pub struct Tools {
    pub library: Cow<'static, MaterialLibrary>,
    pub gripper: GripperProfile,
}

impl Tools {
    /// Reads them.
    ///
    /// # Errors
    /// If one of them cannot be read or is not valid.
    pub fn load(options: &Options) -> Result<Self> {
        Ok(Self { library: options.materials.library()?, gripper: GripperProfile::load(&options.grasp.gripper)? })
    }
}

/// Results that were read from the work folder, by type, each with the stage that made it.
#[derive(Default)]
struct Kept(Mutex<Results>);

type Results = BTreeMap<TypeId, (Stage, Arc<dyn Any + Send + Sync>)>;

impl OpenScene {
    /// The scene at `path`, with its chosen views; they are rendered if it is a mesh or the options say so.
    ///
    /// # Errors
    /// If an option does not fit the scene, or views cannot be rendered.
    pub fn new(
        path: &Path,
        work: WorkDir,
        mut scene: Scene,
        Tools { library, gripper }: Tools,
        options: Options,
        watcher: Watcher,
    ) -> Result<Self> {
        check_formats(&options.segment.also)?;
        if let Some(count) = scene.views_to_render(&options.scene) {
            let below = Path::new("rendered").join(rendering_key(&scene, &options.scene)?);
            let folder = work.root().join(&below);
            let cannot = |error| UsageError(format!("cannot write views into {folder:?}: {error}"));
            let write_to = work.writable_folder().ok().map(|work| work.below(&below)).transpose().map_err(cannot)?;
            from_splat::render_views(&mut scene, count.get(), &folder, write_to.as_ref()).map_err(cannot)?;
        }
        Ok(Self {
            path: path.to_owned(),
            folder: scene::home(path),
            work,
            library,
            gripper,
            views: scene.chosen_views(&options.scene)?,
            scene,
            options,
            watcher,
            number: None,
            budget: LeftBudget::default(),
            kept: Kept::default(),
        })
    }

    /// The folder that holds the scene's recordings: its own, or a mesh's work folder, since other meshes may lie beside it.
    pub(crate) fn home_of_recordings(&self) -> &Path {
        if self.scene.mesh.is_some() { self.work.root() } else { &self.folder }
    }

    /// Where to tell progress.
    pub(crate) fn progress(&self) -> Progress<'_> {
        self.watcher.progress(self.number)
    }

    /// A stored result. It is read once.
    ///
    /// # Errors
    /// If the stage that makes it is not done, or its files are not what gprop wrote.
    pub(crate) fn get<T: Stored>(&self) -> Result<Arc<T>> {
        if let Some(kept) = self.kept.get() {
            return Ok(kept);
        }
        let loaded = Arc::new(T::load(self)?);
        self.kept.put(T::STAGE, Arc::clone(&loaded));
        Ok(loaded)
    }

    /// Keeps a result that was just made, so that it is not read or computed again.
    pub(crate) fn keep<T: Stored>(&self, value: T) -> Arc<T> {
        let value = Arc::new(value);
        self.kept.put(T::STAGE, Arc::clone(&value));
        value
    }

    /// Drops the results of a stage that is about to be done again, and of those after it.
    pub(crate) fn forget_from(&self, stage: Stage) {
        self.kept.all().retain(|_, (of, _)| *of < stage);
    }

    /// The photo of a view, with the foreground that the Gaussians give it if neither alpha nor a mask does.
    pub(crate) fn photo(&self, view: &View) -> Result<Photo, SceneError> {
        photo_with_foreground(&self.scene, view)
    }

    /// True if a view is among those that vote.
    pub(crate) fn votes(&self, view: &str) -> bool {
        self.views.iter().any(|chosen| chosen.name == view)
    }
}

impl Kept {
    fn get<T: Stored>(&self) -> Option<Arc<T>> {
        let (_, kept) = self.all().get(&TypeId::of::<T>())?.clone();
        Some(kept.downcast().expect("it is kept under its type"))
    }

    fn put<T: Stored>(&self, stage: Stage, value: Arc<T>) {
        self.all().insert(TypeId::of::<T>(), (stage, value));
    }

    /// The map is whole whenever the mutex is free.
    fn all(&self) -> MutexGuard<'_, Results> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Hash of everything that pictures rendered from the splat or the mesh depend on, short enough for a folder's name.
fn rendering_key(scene: &Scene, options: &scene::Options) -> Result<String> {
    let mut hasher = Hasher::new("rendered").with_json(&without_paths(options)).with_json(&scene.up.direction);
    for path in &scene.files {
        hasher = hasher.with(&file_digest(path)?);
    }
    Ok(hasher.hex().chars().take(16).collect())
}

/// The options without paths, whose files are hashed by their content.
pub(super) fn without_paths(options: &scene::Options) -> scene::Options {
    scene::Options { splat: None, cameras: None, images: None, masks: None, ..options.clone() }
}
