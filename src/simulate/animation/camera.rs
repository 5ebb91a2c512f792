//! Where to look from.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::camera::{Camera, Distortion, Intrinsics};
use crate::simulate::SimulationReport;

/// Angle between the line of sight and the object's longer horizontal side: most of its length shows, and some depth.
const FROM_SIDE_RAD: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// How far the camera looks down.
const DOWN_RAD: f64 = 22.0 * std::f64::consts::PI / 180.0;
/// Vertical field of view.
const FIELD_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Share of the picture, each way, that the motion may fill.
const FILLED: f64 = 0.86;

/// A three-quarter view of all places that the object passes, world frame, scene units.
pub fn camera_around(report: &SimulationReport, [width, height]: [u32; 2]) -> Camera {
    let ([low, high], first) = (report.bounds(), report.frames.first().map_or([[0.0; 3]; 2], |f| f.bounds));
    let center = nalgebra::center(&Point3::from(low), &Point3::from(high));
    let side = |a: usize| first[1][a] - first[0][a];
    let along: f64 = if side(0) >= side(1) { 0.0 } else { std::f64::consts::FRAC_PI_2 };
    let azimuth = along - FROM_SIDE_RAD;
    let toward_camera = Vector3::new(azimuth.cos() * DOWN_RAD.cos(), azimuth.sin() * DOWN_RAD.cos(), DOWN_RAD.sin());
    let focal = f64::from(height) / 2.0 / (FIELD_RAD / 2.0).tan();
    let half = [f64::from(width) / 2.0, f64::from(height) / 2.0];
    // Axes of an OpenCV camera at the origin that looks back along `toward_camera`.
    let look = Isometry3::look_at_rh(&Point3::origin(), &Point3::from(-toward_camera), &Vector3::z());
    let opencv = Isometry3::rotation(Vector3::x() * std::f64::consts::PI) * look;
    let distance = corners(low, high)
        .map(|corner| {
            let p = opencv * (corner - center);
            // |focal p / (z + distance)| <= FILLED half, for the corner's x and y.
            (0..2).map(|a| focal * p[a].abs() / (FILLED * half[a]) - p.z).fold(0.0, f64::max)
        })
        .fold(0.0, f64::max);
    let eye = center + toward_camera * distance;
    let intrinsics =
        Intrinsics { width, height, fx: focal, fy: focal, cx: half[0], cy: half[1], distortion: Distortion::default() };
    Camera { intrinsics, camera_from_world: opencv * nalgebra::Translation3::from(-eye.coords) }
}

fn corners(low: [f64; 3], high: [f64; 3]) -> impl Iterator<Item = Point3<f64>> {
    (0..8).map(move |n| Point3::from([0, 1, 2].map(|a| if n >> a & 1 == 0 { low[a] } else { high[a] })))
}
