//! A picture as a camera file describes it, before the photo has been opened.

use std::path::PathBuf;

use nalgebra::Isometry3;
use thiserror::Error;

use crate::camera::{Distortion, Intrinsics};

/// An error in one frame of a camera file.
#[derive(Debug, Error)]
pub enum FrameProblem {
    #[error("transform_matrix is not 4 x 4 (or 3 x 4)")]
    MatrixShape,
    #[error(
        "its pose is not a rotation (orthonormal, right-handed; in transforms.json, the upper left 3 x 3 of transform_matrix) \
         and a finite translation; export the cameras again without scaling or mirroring the axes"
    )]
    NotARotation,
    #[error("no focal length: fl_x or camera_angle_x is needed, in the frame or at the top")]
    NoFocalLength,
    #[error("{name} = {value} makes no sense; it must be finite{}", if *.positive { " and above zero" } else { "" })]
    Number { name: &'static str, value: f64, positive: bool },
    #[error(
        "gprop does not know the camera_model {model}, or it does not project onto a plane; undistort the photos to \
         PINHOLE first"
    )]
    CameraModel { model: String },
    #[error(
        "the path of its photo or mask has {length} characters and {folders} folders; gprop takes up to {LONGEST_PATH} and \
         {MOST_FOLDERS}"
    )]
    LongPath { length: usize, folders: usize },
    #[error(
        "file_path leads out of the scene folder, to `{}`; if you trust it, name the folder of the photos with --images DIR, or \
         copy the photo into the scene and write a relative path",
        leads_to.display()
    )]
    OutsideScene { leads_to: PathBuf },
}

/// The longest path that Linux opens, in bytes.
const LONGEST_PATH: usize = 4096;
/// More folders than the path of any photo has. Photos are looked for at every end of a path.
const MOST_FOLDERS: usize = 64;

/// One calibrated picture of a camera file.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The photo's name in the file, with or without folders and extension.
    pub file: String,
    /// The photo's mask, if the file names one.
    pub mask: Option<String>,
    pub declared: Declared,
    /// From the camera file's world to the OpenCV camera frame.
    pub camera_from_world: Isometry3<f64>,
}

impl Frame {
    /// Refuses paths that no photo has.
    pub(super) fn check_paths(&self) -> Result<(), FrameProblem> {
        for path in [Some(&self.file), self.mask.as_ref()].into_iter().flatten() {
            let (length, folders) = (path.len(), path.matches(['/', '\\']).count());
            if length > LONGEST_PATH || folders > MOST_FOLDERS {
                return Err(FrameProblem::LongPath { length, folders });
            }
        }
        Ok(())
    }
}

/// The intrinsics that a file declares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Declared {
    /// Width and height in pixels that the other numbers refer to; the photo's own if not declared.
    pub size: Option<(u32, u32)>,
    pub fx: Focal,
    /// Equal to fx if not declared.
    pub fy: Option<Focal>,
    /// The middle of the picture if not declared.
    pub cx: Option<f64>,
    pub cy: Option<f64>,
    pub distortion: Distortion,
}

/// A focal length, or the field of view that it gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Focal {
    Pixels(f64),
    /// Full field of view in radians along the axis.
    Angle(f64),
}

impl Focal {
    fn pixels(self, side: f64) -> f64 {
        match self {
            Self::Pixels(pixels) => pixels,
            Self::Angle(angle) => 0.5 * side / (0.5 * angle).tan(),
        }
    }
}

impl Declared {
    /// The intrinsics for the declared size, or for the photo's own if none is declared.
    pub(in crate::scene) fn intrinsics(&self, photo: (u32, u32)) -> Result<Intrinsics, FrameProblem> {
        let (width, height) = self.size.unwrap_or(photo);
        let (w, h) = (positive("width", width.into())?, positive("height", height.into())?);
        let fx = positive("focal length x", self.fx.pixels(w))?;
        let fy = positive("focal length y", self.fy.map_or(fx, |fy| fy.pixels(h)))?;
        let (cx, cy) = (self.cx.unwrap_or(0.5 * w), self.cy.unwrap_or(0.5 * h));
        Ok(Intrinsics {
            width,
            height,
            fx,
            fy,
            cx: finite("cx", cx)?,
            cy: finite("cy", cy)?,
            distortion: self.distortion,
        })
    }
}

pub(super) fn positive(name: &'static str, value: f64) -> Result<f64, FrameProblem> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(FrameProblem::Number { name, value, positive: true }) }
}

pub(super) fn finite(name: &'static str, value: f64) -> Result<f64, FrameProblem> {
    if value.is_finite() { Ok(value) } else { Err(FrameProblem::Number { name, value, positive: false }) }
}
