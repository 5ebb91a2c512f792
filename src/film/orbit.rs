//! Cameras that see all of an object, from one side or on a circle around it. World z is up.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use super::Size;
use crate::camera::{Camera, Distortion, Intrinsics};

/// Vertical field of view.
const FIELD_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Share of the picture, each way, that the object may fill.
const FILLED: f64 = 0.9;

/// A camera that looks from an azimuth (from +x towards +y) and an elevation above the ground, and sees all `points` as
/// large as possible; world frame, scene units.
pub fn still(points: &[Point3<f64>], azimuth: f64, elevation: f64, size: Size) -> Camera {
    let pose = looking_from(azimuth, elevation);
    let seen: Vec<_> = points.iter().map(|point| pose * point).collect();
    let middle = middle(&seen);
    camera(&pose, &middle, needed(&seen, &middle, size), size)
}

/// `count` cameras on a circle, once around, that all see all `points`: around one axis and at one distance, so that
/// only the object moves.
pub fn turntable(points: &[Point3<f64>], azimuth: f64, elevation: f64, count: usize, size: Size) -> Vec<Camera> {
    let axis = Point3::from(middle(points));
    let pose = |i: usize| looking_from(azimuth + std::f64::consts::TAU * i as f64 / count as f64, elevation);
    let poses: Vec<Isometry3<f64>> = (0..count).map(pose).collect();
    let needed_by = |pose: &Isometry3<f64>| {
        let seen: Vec<_> = points.iter().map(|point| pose * point).collect();
        needed(&seen, &(pose * axis).coords, size)
    };
    let distance = poses.iter().map(needed_by).fold(0.0, f64::max);
    poses.iter().map(|pose| camera(pose, &(pose * axis).coords, distance, size)).collect()
}

/// The corners of a box.
pub fn corners([low, high]: [[f64; 3]; 2]) -> impl Iterator<Item = Point3<f64>> {
    (0..8).map(move |n| Point3::from([0, 1, 2].map(|a| if n >> a & 1 == 0 { low[a] } else { high[a] })))
}

fn camera(pose: &Isometry3<f64>, middle: &Vector3<f64>, distance: f64, size: Size) -> Camera {
    let (focal, half) = (focal(size), half(size));
    let distortion = Distortion::default();
    let intrinsics = Intrinsics {
        width: size.width,
        height: size.height,
        fx: focal,
        fy: focal,
        cx: half[0],
        cy: half[1],
        distortion,
    };
    Camera { intrinsics, camera_from_world: Translation3::from(Vector3::z() * distance - middle) * pose }
}

/// The distance of the camera from `middle` at which |focal p / (z + distance)| <= FILLED half, for x and y of every
/// point p in the axes of the camera, seen from the middle.
fn needed(points: &[Point3<f64>], middle: &Vector3<f64>, size: Size) -> f64 {
    let (focal, half) = (focal(size), half(size));
    let distance_for = |point: &Point3<f64>| {
        let p = point - middle;
        (0..2).map(|a| focal * p[a].abs() / (FILLED * half[a]) - p.z).fold(0.0, f64::max)
    };
    points.iter().map(distance_for).fold(0.0, f64::max)
}

fn focal(size: Size) -> f64 {
    half(size)[1] / (FIELD_RAD / 2.0).tan()
}

fn half(size: Size) -> [f64; 2] {
    [f64::from(size.width) / 2.0, f64::from(size.height) / 2.0]
}

/// Axes of an OpenCV camera at the world's origin that looks back from a direction.
fn looking_from(azimuth: f64, elevation: f64) -> Isometry3<f64> {
    let toward_camera = Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
    let look = Isometry3::look_at_rh(&Point3::origin(), &Point3::from(-toward_camera), &Vector3::z());
    Isometry3::rotation(Vector3::x() * std::f64::consts::PI) * look
}

/// The middle of the box around points.
fn middle(points: &[Point3<f64>]) -> Vector3<f64> {
    let along = |a: usize| {
        let (low, high) = points.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[a]), h.max(p[a])));
        0.5 * (low + high)
    };
    Vector3::new(along(0), along(1), along(2))
}
