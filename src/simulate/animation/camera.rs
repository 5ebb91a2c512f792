//! Where to look from.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use crate::camera::{Camera, Distortion, Intrinsics};
use crate::simulate::SimulationReport;

/// Angle between the line of sight and the object's longer horizontal side: most of its length shows, and some depth.
const FROM_SIDE_RAD: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// How far the camera looks down.
const DOWN_RAD: f64 = 22.0 * std::f64::consts::PI / 180.0;
/// Vertical field of view.
const FIELD_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Share of the picture, each way, that the motion may fill.
const FILLED: f64 = 0.9;

/// A three-quarter view of all places that the object passes, world frame, scene units.
pub fn camera_around(report: &SimulationReport, [width, height]: [u32; 2]) -> Camera {
    let first = report.frames.first().map_or([[0.0; 3]; 2], |frame| frame.bounds);
    let side = |a: usize| first[1][a] - first[0][a];
    let along = if side(0) >= side(1) { 0.0 } else { std::f64::consts::FRAC_PI_2 };
    let azimuth: f64 = along - FROM_SIDE_RAD;
    let toward_camera = Vector3::new(azimuth.cos() * DOWN_RAD.cos(), azimuth.sin() * DOWN_RAD.cos(), DOWN_RAD.sin());
    let focal = f64::from(height) / 2.0 / (FIELD_RAD / 2.0).tan();
    let half = [f64::from(width) / 2.0, f64::from(height) / 2.0];
    // Axes of an OpenCV camera at the world's origin that looks back along `toward_camera`.
    let look = Isometry3::look_at_rh(&Point3::origin(), &Point3::from(-toward_camera), &Vector3::z());
    let turned = Isometry3::rotation(Vector3::x() * std::f64::consts::PI) * look;
    let corners: Vec<Point3<f64>> = report.frames.iter().flat_map(|f| corners(f.bounds)).map(|c| turned * c).collect();
    let middle = |a: usize| {
        let (low, high) = corners.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p[a]), h.max(p[a])));
        0.5 * (low + high)
    };
    let middle = Vector3::new(middle(0), middle(1), middle(2));
    // |focal p / (z + distance)| <= FILLED half, for x and y of every corner seen from the middle.
    let needed = |p: &Point3<f64>| {
        let p = p - middle;
        (0..2).map(|a| focal * p[a].abs() / (FILLED * half[a]) - p.z).fold(0.0, f64::max)
    };
    let distance = corners.iter().map(needed).fold(0.0, f64::max);
    let intrinsics =
        Intrinsics { width, height, fx: focal, fy: focal, cx: half[0], cy: half[1], distortion: Distortion::default() };
    let back = Translation3::from(Vector3::z() * distance - middle);
    Camera { intrinsics, camera_from_world: back * turned }
}

fn corners([low, high]: [[f64; 3]; 2]) -> impl Iterator<Item = Point3<f64>> {
    (0..8).map(move |n| Point3::from([0, 1, 2].map(|a| if n >> a & 1 == 0 { low[a] } else { high[a] })))
}
