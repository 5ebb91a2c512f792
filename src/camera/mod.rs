//! Cameras: intrinsics, distortion, pose, projection, and the conversion from OpenGL's axes.
//!
//! The camera frame is OpenCV's: x right, y down, z forward. The centre of pixel (0,0) is (0.5, 0.5).

mod distortion;

use nalgebra::{Isometry3, Matrix3, Matrix4, Point2, Point3, Rotation3, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

pub use distortion::{Distortion, Polynomial};

/// Pinhole intrinsics in pixels, with the size of the picture they apply to and its lens distortion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    pub width: u32,
    pub height: u32,
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub distortion: Distortion,
}

impl Intrinsics {
    /// The intrinsics of the same picture resized to `width` x `height` pixels. Distortion is on normalised coordinates
    /// and does not change.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Self { width, height, fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy, ..*self }
    }
}

/// One calibrated picture: its camera's pose and projection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    pub intrinsics: Intrinsics,
    /// Maps a point of the world frame (the PLY's, in scene units) to the OpenCV camera frame.
    pub camera_from_world: Isometry3<f64>,
}

impl Camera {
    /// Transforms a point of the world frame to the camera frame; its z is the depth along the optical axis.
    pub fn point_in_camera(&self, point_in_world: Point3<f64>) -> Point3<f64> {
        self.camera_from_world * point_in_world
    }

    /// Pixel of a point in the camera frame, in pixels from the upper left corner; `None` if the point is behind the
    /// camera or [the lens model folds back](Distortion::folds_back_at) there.
    pub fn pixel(&self, point_in_camera: Point3<f64>) -> Option<Point2<f64>> {
        if point_in_camera.z <= 0.0 {
            return None;
        }
        let i = &self.intrinsics;
        let (x, y) = (point_in_camera.x / point_in_camera.z, point_in_camera.y / point_in_camera.z);
        if !i.distortion.is_none() && i.distortion.folds_back_at(x, y) {
            return None;
        }
        let (x, y) = i.distortion.apply(x, y);
        Some(Point2::new(i.fx * x + i.cx, i.fy * y + i.cy))
    }

    /// The camera's centre in the world frame, in scene units.
    pub fn center_in_world(&self) -> Point3<f64> {
        self.camera_from_world.inverse() * Point3::origin()
    }
}

/// A pose in OpenGL axes (x right, y up, z backward; nerfstudio, Blender), camera-to-world, as `camera_from_world` in
/// OpenCV axes (x right, y down, z forward). `None` if the upper left 3x3 is not a rotation.
pub fn camera_from_world_of_opengl(world_from_camera_opengl: &Matrix4<f64>) -> Option<Isometry3<f64>> {
    let flip = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0));
    let rotation = rotation_of(&(world_from_camera_opengl.fixed_view::<3, 3>(0, 0) * flip))?;
    let translation = Translation3::from(world_from_camera_opengl.fixed_view::<3, 1>(0, 3).into_owned());
    let finite = translation.vector.iter().all(|value| value.is_finite());
    finite.then(|| Isometry3::from_parts(translation, rotation).inverse())
}

/// The rotation that a matrix represents, allowing for rounding in files; `None` if it is not orthonormal and
/// right-handed.
pub fn rotation_of(matrix: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    /// Poses are often written with six digits; a matrix that is further from orthonormal than this is not a rotation.
    const ORTHONORMAL_TOLERANCE: f64 = 1e-3;
    let error = (matrix.transpose() * matrix - Matrix3::identity()).norm();
    if !(error < ORTHONORMAL_TOLERANCE && matrix.determinant() > 0.0) {
        return None;
    }
    // The closed form is correct for every angle; an iteration that starts at the identity would stay there for a half
    // turn.
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*matrix));
    Some(UnitQuaternion::new_normalize(rotation.into_inner()))
}
