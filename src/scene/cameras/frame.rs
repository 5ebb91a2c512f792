//! A picture as a camera file knows it: before anybody has looked at the photo.

use std::path::PathBuf;

use nalgebra::Isometry3;
use thiserror::Error;

use crate::camera::{Distortion, Intrinsics};

/// What is wrong with one frame of a camera file.
#[derive(Debug, Error)]
pub enum FrameProblem {
    #[error("transform_matrix is not 4 x 4 (or 3 x 4)")]
    MatrixShape,
    #[error(
        "the upper left 3 x 3 of transform_matrix is not a rotation (orthonormal, right-handed); export the cameras again \
         without scaling or mirroring the axes"
    )]
    NotARotation,
    #[error("no focal length: fl_x or camera_angle_x is needed, in the frame or at the top")]
    NoFocalLength,
    #[error("{name} = {value} makes no sense; it must be finite{}", if *.positive { " and above zero" } else { "" })]
    Number { name: &'static str, value: f64, positive: bool },
    #[error(
        "gprop does not know the camera_model {model}, or it has no flat picture; undistort the photos to PINHOLE first"
    )]
    CameraModel { model: String },
    #[error(
        "file_path leads out of the scene folder, to `{}`; if you trust it, name the folder of the photos with --images DIR, or \
         copy the photo into the scene and write a relative path",
        leads_to.display()
    )]
    OutsideScene { leads_to: PathBuf },
}

/// One calibrated picture of a camera file.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The photo as the file names it: with or without folders and extension.
    pub file: String,
    /// The mask that the file names for it.
    pub mask: Option<String>,
    pub declared: Declared,
    /// From the camera file's world to the OpenCV camera frame.
    pub camera_from_world: Isometry3<f64>,
}

/// Intrinsics as far as a file declares them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Declared {
    /// Width and height in pixels that the other numbers belong to; the photo's own where it is not declared.
    pub size: Option<(u32, u32)>,
    pub fx: Focal,
    /// As fx where it is not declared.
    pub fy: Option<Focal>,
    /// The middle of the picture where it is not declared.
    pub cx: Option<f64>,
    pub cy: Option<f64>,
    pub distortion: Distortion,
}

/// A focal length, or the angle that it makes of the picture's side.
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
    /// The intrinsics for the declared size, or for the photo's own where none is declared.
    pub(super) fn intrinsics(&self, photo: (u32, u32)) -> Result<Intrinsics, FrameProblem> {
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
    match value.is_finite() && value > 0.0 {
        true => Ok(value),
        false => Err(FrameProblem::Number { name, value, positive: true }),
    }
}

pub(super) fn finite(name: &'static str, value: f64) -> Result<f64, FrameProblem> {
    match value.is_finite() {
        true => Ok(value),
        false => Err(FrameProblem::Number { name, value, positive: false }),
    }
}
