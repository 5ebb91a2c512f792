//! Cameras: intrinsics, distortion, pose, projection; the only place where axes are flipped.
//!
//! The camera frame is OpenCV's: x right, y down, z forward. The centre of pixel (0,0) is (0.5, 0.5).

use nalgebra::{Isometry3, Matrix3, Matrix4, Point2, Point3, Rotation3, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// Pinhole intrinsics in pixels, with the size of the picture they belong to and its lens distortion.
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
    /// The intrinsics of the same picture resized to `width` x `height` pixels. Distortion is on normalised coordinates and
    /// stays.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Self { width, height, fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy, ..*self }
    }
}

/// Brown-Conrady lens distortion in OpenCV's convention (`k1 k2 p1 p2 k3`), on normalised image coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Distortion {
    pub k1: f64,
    pub k2: f64,
    pub p1: f64,
    pub p2: f64,
    pub k3: f64,
}

impl Distortion {
    /// True where the lens is an ideal pinhole.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Distorts a point of the normalised image plane (x/z, y/z), as OpenCV's `projectPoints` does.
    pub fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        (
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// True where the lens model has left what a lens can do: going outwards, its radial part has turned back before it
    /// reaches the point (x/z, y/z). Fitted polynomials do so outside of the picture, and a point there would seem to lie
    /// in the picture. The part's slope is f(u) = 1 + 3 k1 u + 5 k2 u^2 + 7 k3 u^3 with u = r^2.
    pub fn folds_back_at(&self, x: f64, y: f64) -> bool {
        let (a, b, c) = (3.0 * self.k1, 5.0 * self.k2, 7.0 * self.k3);
        let slope = |u: f64| 1.0 + u * (a + u * (b + u * c));
        let u = x * x + y * y;
        if slope(u) <= 0.0 {
            return true;
        }
        // The slope may be lowest in between, where f'(u) = a + 2 b u + 3 c u^2 = 0; NaN and infinity stand for no root.
        let q = -(b + b.signum() * (b * b - 3.0 * a * c).sqrt());
        let turns_at = |lowest: f64| lowest > 0.0 && lowest < u && slope(lowest) <= 0.0;
        turns_at(q / (3.0 * c)) || turns_at(a / q)
    }

    /// Jacobian of [`Self::apply`], row by row: `[[dx'/dx, dx'/dy], [dy'/dx, dy'/dy]]`.
    pub fn jacobian(&self, x: f64, y: f64) -> [[f64; 2]; 2] {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        let slope = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + 3.0 * r2 * self.k3));
        let cross = x * y * slope + 2.0 * self.p1 * x + 2.0 * self.p2 * y;
        [
            [radial + x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x, cross],
            [cross, radial + y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x],
        ]
    }
}

/// One calibrated picture: where it was taken and how it projects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    pub intrinsics: Intrinsics,
    /// Takes a point of the world frame (the PLY's, in scene units) to the OpenCV camera frame.
    pub camera_from_world: Isometry3<f64>,
}

impl Camera {
    /// A point of the world frame in the camera frame; its z is the depth along the optical axis.
    pub fn point_in_camera(&self, point_in_world: Point3<f64>) -> Point3<f64> {
        self.camera_from_world * point_in_world
    }

    /// Pixel of a point in the camera frame, in pixels from the upper left corner; `None` behind the camera and where
    /// [`Distortion::folds_back_at`].
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
/// OpenCV axes (x right, y down, z forward). `None` where the upper left 3x3 is no rotation.
pub fn camera_from_world_of_opengl(world_from_camera_opengl: &Matrix4<f64>) -> Option<Isometry3<f64>> {
    /// Poses are often written with six digits; a matrix further from orthonormal than this is no rotation.
    const ORTHONORMAL_TOLERANCE: f64 = 1e-3;
    let flip = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0));
    let rotation = world_from_camera_opengl.fixed_view::<3, 3>(0, 0) * flip;
    let error = (rotation.transpose() * rotation - Matrix3::identity()).norm();
    if !(error < ORTHONORMAL_TOLERANCE && rotation.determinant() > 0.0) {
        return None;
    }
    let translation = Translation3::from(world_from_camera_opengl.fixed_view::<3, 1>(0, 3).into_owned());
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Some(Isometry3::from_parts(translation, rotation).inverse())
}
