//! The cameras of a capture, from any calibration program.
//!
//! 1. [`find`]: the camera files in the folder, in a fixed order.
//! 2. One reader per format turns a camera file into [`Frame`]s: [`transforms`] (nerfstudio, instant-ngp, Blender),
//!    [`colmap`], [`gaussian_splatting`] (the `cameras.json` of a 3DGS output folder).
//! 3. [`dataparser`]: nerfstudio trains in its own frame; the cameras are moved to that frame, which is the splat's.
//! 4. [`align`]: the conversion that the user gives; [`gsplat`]: the one that follows from the cameras themselves.
//! 5. [`find_photos`](crate::scene::photos::find::find_photos): the photo of each frame on disk, its actual size, its mask.

pub mod align;
pub mod colmap;
pub mod dataparser;
mod find;
pub(super) mod frame;
pub mod gaussian_splatting;
pub mod gsplat;
mod registered;
pub mod transforms;

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

pub(super) use find::{CameraSource, Kind, Places, choose};
pub use frame::{Declared, Focal, Frame, FrameProblem};
pub use registered::Registered;

use super::SceneError;
use crate::files;

/// The contents of one camera file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Capture {
    pub frames: Vec<Frame>,
    pub applied: Applied,
    /// Whether z is up in the cameras' world by the convention of the program that wrote the file.
    pub z_is_up: bool,
    /// Messages about how the file was read.
    pub notes: Vec<String>,
}

/// The transform that was applied to the cameras before they were written, according to their file (nerfstudio's
/// `applied_transform`, `applied_scale`).
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

/// Reads the chosen camera file; also returns every file that was opened.
pub(super) fn read(choice: &CameraSource) -> Result<(Capture, Vec<PathBuf>), SceneError> {
    let (capture, files) = match choice.kind {
        Kind::Colmap => colmap::read(&choice.path)?,
        Kind::Transforms => (transforms::read(&choice.path)?, vec![choice.path.clone()]),
        Kind::GaussianSplatting => (gaussian_splatting::read(&choice.path)?, vec![choice.path.clone()]),
    };
    for (index, frame) in capture.frames.iter().enumerate() {
        frame.check_paths().map_err(|problem| SceneError::Frame {
            path: choice.path.clone(),
            frame: index,
            file: frame.file.chars().take(100).collect(),
            problem,
        })?;
    }
    Ok((capture, files))
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, SceneError> {
    files::read(path).map_err(|reason| SceneError::Io { path: path.to_owned(), reason })
}

/// The bytes of a text file, without the byte order mark with which some editors begin it.
fn text_of(path: &Path) -> Result<Vec<u8>, SceneError> {
    let mut bytes = bytes_of(path)?;
    if bytes.starts_with(files::BYTE_ORDER_MARK.as_bytes()) {
        bytes.drain(..files::BYTE_ORDER_MARK.len());
    }
    Ok(bytes)
}
