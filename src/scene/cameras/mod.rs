//! The cameras of a capture, whoever calibrated them.
//!
//! 1. [`find`]: which camera files lie in the folder, in a fixed order.
//! 2. A reader a format turns one into [`Frame`]s: [`transforms`] (nerfstudio, instant-ngp, Blender), [`colmap`],
//!    [`gaussian_splatting`] (the `cameras.json` of a 3DGS output folder).
//! 3. [`dataparser`]: nerfstudio trains in a frame of its own; the cameras follow the splat there.
//! 4. [`photos`]: the photo of each frame on disk, its true size, its mask.

pub mod colmap;
pub mod dataparser;
mod find;
mod frame;
pub mod gaussian_splatting;
mod photos;
pub mod transforms;

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

pub(super) use find::{CameraSource, Kind, Places, choose};
pub use frame::{Declared, Focal, Frame, FrameProblem};
pub(super) use photos::find_photos;

use super::SceneError;
use crate::files;

/// What one camera file says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Capture {
    pub frames: Vec<Frame>,
    pub applied: Applied,
}

/// What a file says was done to its cameras before they were written (nerfstudio's `applied_transform`, `applied_scale`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Applied {
    pub transform: Isometry3<f64>,
    pub scale: f64,
}

impl Default for Applied {
    fn default() -> Self {
        Self { transform: Isometry3::identity(), scale: 1.0 }
    }
}

/// Reads the chosen camera file, and hands back every file that was opened.
pub(super) fn read(choice: &CameraSource) -> Result<(Capture, Vec<PathBuf>), SceneError> {
    match choice.kind {
        Kind::Colmap => colmap::read(&choice.path),
        Kind::Transforms => Ok((transforms::read(&choice.path)?, vec![choice.path.clone()])),
        Kind::GaussianSplatting => Ok((gaussian_splatting::read(&choice.path)?, vec![choice.path.clone()])),
    }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, SceneError> {
    files::read(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })
}
