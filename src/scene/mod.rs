//! The scene: Gaussians, calibrated photos, metric scale. Everything read from outside enters here.
//!
//! [`load`] finds the splat and the cameras in a folder; [`Scene::chosen_views`] picks the views to work on;
//! [`View::photo`] decodes one.

mod bounds;
mod choose;
mod error;
pub mod gaussians;
mod nerfstudio;
mod options;
mod photo;
pub mod ply;
mod splat_file;
mod view_names;

use std::path::{Path, PathBuf};

use crate::camera::Camera;
use crate::units::MetricScale;
use gaussians::Gaussians;

pub use bounds::Bounds;
pub(crate) use bounds::robust_bounds;
pub use choose::DEFAULT_VIEWS;
pub use error::SceneError;
pub use options::{Options, ScaleChoice};
pub use photo::Photo;

/// What a scene folder holds.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The folder's name.
    pub name: String,
    pub gaussians: Gaussians,
    /// Every view with a camera and a photo, in the order of the camera file.
    pub views: Vec<View>,
    /// `None` where nobody says how long a scene unit is.
    pub scale: Option<MetricScale>,
    /// What the user should know: counted, never fatal.
    pub warnings: Vec<String>,
}

/// One photo and its camera.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The photo's file name without extension; unique within the scene and safe as a file name.
    pub name: String,
    /// Its intrinsics fit the photo as it lies on disk.
    pub camera: Camera,
    pub image: PathBuf,
}

/// Loads the scene in `folder`: the splat, the cameras, and of each photo its size.
///
/// # Errors
/// [`SceneError`] says what is missing or broken, where, and what to do.
pub fn load(folder: &Path, options: &Options) -> Result<Scene, SceneError> {
    if !folder.is_dir() {
        return Err(match folder.exists() {
            true => SceneError::NotAFolder { path: folder.to_owned() },
            false => SceneError::NoFolder { path: folder.to_owned() },
        });
    }
    let splat = splat_file::find(folder)?;
    let cameras = nerfstudio::find(folder)?;
    let nerfstudio::Views { views, warnings } = nerfstudio::read(&cameras)?;
    let ply::Loaded { gaussians, warnings: splat_warnings } = ply::read(&splat)?;
    let prefixed = splat_warnings.into_iter().map(|warning| format!("`{}`: {warning}", splat.display()));
    Ok(Scene {
        name: name_of(folder),
        gaussians,
        views,
        scale: options.scale.metric_scale(),
        warnings: warnings.into_iter().chain(prefixed).collect(),
    })
}

/// The folder's own name, also where it was given as `.`.
fn name_of(folder: &Path) -> String {
    let absolute = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    absolute.file_name().map_or_else(|| "scene".to_owned(), |name| name.to_string_lossy().into_owned())
}
