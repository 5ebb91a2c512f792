//! `transforms.json` of nerfstudio and instant-ngp, `transforms_train.json` of Blender exporters: camera-to-world
//! matrices in OpenGL axes, intrinsics at the top or per frame.
//!
//! The layout is that of the nerfstudio documentation, "Data conventions": `fl_x fl_y cx cy w h` in pixels; `k1 k2 k3 k4 p1 p2`
//! of its lens model, whose k4 is the coefficient of r^8; or k1 to k4 of OpenCV's fisheye; `camera_angle_x` (horizontal
//! field of view, radians) if there is no `fl_x`; `mask_path` per frame. `applied_transform` (3x4) and `applied_scale`
//! are the transform that was applied to the cameras before they were written. In Blender, z is up.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Matrix4, Translation3};
use serde::Deserialize;

use super::frame::{Declared, Focal, Frame, FrameProblem, finite, positive};
use super::{Applied, Capture, bytes_of};
use crate::camera::{Distortion, Polynomial, camera_from_world_of_opengl, rotation_of};
use crate::files::json;
use crate::scene::SceneError;

#[derive(Debug, Deserialize)]
struct Transforms {
    #[serde(flatten)]
    lens: Lens,
    applied_transform: Option<Vec<Vec<f64>>>,
    applied_scale: Option<f64>,
    frames: Vec<JsonFrame>,
}

#[derive(Debug, Deserialize)]
struct JsonFrame {
    file_path: String,
    mask_path: Option<String>,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    lens: Lens,
}

/// The intrinsics that are given.
#[derive(Debug, Clone, Deserialize)]
struct Lens {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// Reads the camera file at `path`.
pub(super) fn read(path: &Path) -> Result<Capture, SceneError> {
    parse(&bytes_of(path)?).map_err(|problem| problem.in_file(path))
}

/// An error in a JSON file of cameras.
#[derive(Debug)]
pub enum Problem {
    Json(json::Problem),
    NoFrames,
    Frame { frame: usize, file: String, problem: FrameProblem },
    Applied,
}

impl Problem {
    pub(super) fn in_file(self, path: &Path) -> SceneError {
        let path = path.to_owned();
        match self {
            Self::Json(reason) => SceneError::Json { path, reason },
            Self::NoFrames => SceneError::NoFrames { path },
            Self::Frame { frame, file, problem } => SceneError::Frame { path, frame, file, problem },
            Self::Applied => SceneError::NotASimilarity { path, key: "applied_transform and applied_scale" },
        }
    }
}

/// Reads a transforms.json from memory.
///
/// # Errors
/// [`Problem`] if it is not JSON, has no frames, or a frame is invalid.
pub fn parse(bytes: &[u8]) -> Result<Capture, Problem> {
    let transforms: Transforms = json::parse(bytes).map_err(Problem::Json)?;
    if transforms.frames.is_empty() {
        return Err(Problem::NoFrames);
    }
    let applied = Applied {
        transform: match &transforms.applied_transform {
            Some(rows) => rigid(rows).ok_or(Problem::Applied)?,
            None => Isometry3::identity(),
        },
        scale: transforms.applied_scale.unwrap_or(1.0),
    };
    if !(applied.scale.is_normal() && applied.scale > 0.0) {
        return Err(Problem::Applied);
    }
    // Blender's exporters give a field of view alone; calibration programs give a focal length.
    let z_is_up = transforms.lens.camera_angle_x.is_some()
        && transforms.lens.fl_x.is_none()
        && transforms.applied_transform.is_none();
    let frames = transforms.frames.into_iter().enumerate().map(|(index, frame)| {
        let in_frame = |problem| Problem::Frame { frame: index, file: frame.file_path.clone(), problem };
        let camera_from_world = pose(&frame.transform_matrix).map_err(in_frame)?;
        let declared = frame.lens.clone().or(&transforms.lens).declared().map_err(in_frame)?;
        Ok(Frame { file: frame.file_path, mask: frame.mask_path, declared, camera_from_world })
    });
    let frames = frames.collect::<Result<_, _>>()?;
    Ok(Capture { frames, applied, z_is_up, ..Capture::default() })
}

fn pose(rows: &[Vec<f64>]) -> Result<Isometry3<f64>, FrameProblem> {
    // Some programs omit the last row, which is always 0 0 0 1.
    if !(3..=4).contains(&rows.len()) || rows.iter().any(|row| row.len() != 4) {
        return Err(FrameProblem::MatrixShape);
    }
    let last = [0.0, 0.0, 0.0, 1.0];
    let world_from_camera_opengl =
        Matrix4::from_fn(|row, column| rows.get(row).map_or(last[column], |values| values[column]));
    camera_from_world_of_opengl(&world_from_camera_opengl).ok_or(FrameProblem::NotARotation)
}

/// Reads a 3x4 or 4x4 matrix; `None` unless it is a rotation and a translation and nothing else.
pub(super) fn rigid(rows: &[Vec<f64>]) -> Option<Isometry3<f64>> {
    if rows.len() < 3 || rows.iter().any(|row| row.len() != 4 || row.iter().any(|value| !value.is_finite())) {
        return None;
    }
    let rotation = Matrix3::from_fn(|row, column| rows[row][column]);
    let translation = Translation3::new(rows[0][3], rows[1][3], rows[2][3]);
    Some(Isometry3::from_parts(translation, rotation_of(&rotation)?))
}

impl Lens {
    /// This lens, with missing values taken from `other`.
    fn or(self, other: &Self) -> Self {
        // A focal length and an angle say the same, so a horizontal one replaces all that `other` says.
        let has_focal = self.fl_x.is_some() || self.camera_angle_x.is_some();
        let focal = |own: Option<f64>, other: Option<f64>| if has_focal { own } else { own.or(other) };
        Self {
            camera_model: self.camera_model.or_else(|| other.camera_model.clone()),
            is_fisheye: self.is_fisheye.or(other.is_fisheye),
            fl_x: focal(self.fl_x, other.fl_x),
            fl_y: focal(self.fl_y, other.fl_y),
            camera_angle_x: focal(self.camera_angle_x, other.camera_angle_x),
            camera_angle_y: focal(self.camera_angle_y, other.camera_angle_y),
            cx: self.cx.or(other.cx),
            cy: self.cy.or(other.cy),
            w: self.w.or(other.w),
            h: self.h.or(other.h),
            k1: self.k1.or(other.k1),
            k2: self.k2.or(other.k2),
            k3: self.k3.or(other.k3),
            k4: self.k4.or(other.k4),
            p1: self.p1.or(other.p1),
            p2: self.p2.or(other.p2),
        }
    }

    fn declared(&self) -> Result<Declared, FrameProblem> {
        let side = |name, value: f64| positive(name, value.round()).map(|side| side as u32);
        let size = match (self.w, self.h) {
            (Some(w), Some(h)) => Some((side("w", w)?, side("h", h)?)),
            _ => None,
        };
        let x = self.fl_x.map(|fl| positive("fl_x", fl).map(Focal::Pixels));
        let x = x.or(self.camera_angle_x.map(|angle| field_of_view("camera_angle_x", angle)));
        let y = self.fl_y.map(|fl| positive("fl_y", fl).map(Focal::Pixels));
        let angle_y = self.camera_angle_y.filter(|_| self.fl_x.is_none());
        let y = y.or(angle_y.map(|angle| field_of_view("camera_angle_y", angle)));
        Ok(Declared {
            size,
            fx: x.ok_or(FrameProblem::NoFocalLength)??,
            fy: y.transpose()?,
            cx: self.cx.map(|cx| finite("cx", cx)).transpose()?,
            cy: self.cy.map(|cy| finite("cy", cy)).transpose()?,
            distortion: self.distortion()?,
        })
    }

    fn distortion(&self) -> Result<Distortion, FrameProblem> {
        let value = |name, k: Option<f64>| finite(name, k.unwrap_or(0.0));
        let radial = [value("k1", self.k1)?, value("k2", self.k2)?, value("k3", self.k3)?, value("k4", self.k4)?];
        let tangential = [value("p1", self.p1)?, value("p2", self.p2)?];
        let model = self.camera_model.as_deref().unwrap_or("OPENCV");
        match model {
            _ if self.is_fisheye == Some(true) => Ok(Distortion::fisheye(radial)),
            "OPENCV_FISHEYE" | "FISHEYE" | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" => {
                Ok(Distortion::fisheye(radial))
            }
            "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" | "PERSPECTIVE" => {
                let [k1, k2, k3, k4] = radial;
                let radial = [k1, k2, k3, k4, 0.0, 0.0];
                Ok(Distortion::perspective(Polynomial { radial, tangential, ..Default::default() }))
            }
            _ => Err(FrameProblem::CameraModel { model: model.to_owned() }),
        }
    }
}

/// Checks that the angle is one that a flat picture can show.
fn field_of_view(name: &'static str, angle: f64) -> Result<Focal, FrameProblem> {
    if positive(name, angle)? < std::f64::consts::PI {
        Ok(Focal::Angle(angle))
    } else {
        Err(FrameProblem::Number { name, value: angle, positive: true })
    }
}
