//! The cameras of the animation.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use super::Viewpoint;
use crate::camera::{Camera, Distortion, Intrinsics};
use crate::simulate::SimulationReport;

/// Angle between the line of sight and the object's longer horizontal side: most of its length shows, and some depth.
const FROM_SIDE_RAD: f64 = 60.0 * std::f64::consts::PI / 180.0;
/// Vertical field of view.
const FIELD_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Share of the picture, each way, that the motion may fill.
const FILLED: f64 = 0.9;

/// Cameras that see everywhere the object goes, world frame, scene units: one camera, or one per frame on a turntable.
pub fn cameras_around(report: &SimulationReport, viewpoint: &Viewpoint, [width, height]: [u32; 2]) -> Vec<Camera> {
    let focal = f64::from(height) / 2.0 / (FIELD_RAD / 2.0).tan();
    let half = [f64::from(width) / 2.0, f64::from(height) / 2.0];
    let intrinsics =
        Intrinsics { width, height, fx: focal, fy: focal, cx: half[0], cy: half[1], distortion: Distortion::default() };
    let azimuth = viewpoint.azimuth_deg.map_or_else(|| from_the_side(report), f64::to_radians);
    let elevation = viewpoint.elevation_deg.to_radians();
    let corners: Vec<Point3<f64>> = report.frames.iter().flat_map(|f| corners(f.bounds)).collect();
    let turned_corners = |turned: &Isometry3<f64>| corners.iter().map(|c| turned * c).collect::<Vec<_>>();
    // |focal p / (z + distance)| <= FILLED half, for x and y of every corner seen from the middle.
    let needed = |corners: &[Point3<f64>], middle: &Vector3<f64>| {
        let of = |p: &Point3<f64>| {
            let p = p - middle;
            (0..2).map(|a| focal * p[a].abs() / (FILLED * half[a]) - p.z).fold(0.0, f64::max)
        };
        corners.iter().map(of).fold(0.0, f64::max)
    };
    let camera = |turned: &Isometry3<f64>, middle: &Vector3<f64>, distance: f64| {
        let back = Translation3::from(Vector3::z() * distance - middle);
        Camera { intrinsics, camera_from_world: back * turned }
    };
    if !viewpoint.turntable {
        let turned = looking_from(azimuth, elevation);
        let corners = turned_corners(&turned);
        let middle = middle(&corners);
        return vec![camera(&turned, &middle, needed(&corners, &middle))];
    }
    // Around one axis and at one distance, so that only the object moves.
    let axis = Point3::from(middle(&corners));
    let count = report.frames.len();
    let poses: Vec<Isometry3<f64>> = (0..count)
        .map(|i| looking_from(azimuth + std::f64::consts::TAU * i as f64 / count as f64, elevation))
        .collect();
    let distance = poses.iter().map(|pose| needed(&turned_corners(pose), &(pose * axis).coords)).fold(0.0, f64::max);
    poses.iter().map(|pose| camera(pose, &(pose * axis).coords, distance)).collect()
}

/// The azimuth of a three-quarter view that shows most of the object's length across the picture.
fn from_the_side(report: &SimulationReport) -> f64 {
    let first = report.frames.first().map_or([[0.0; 3]; 2], |frame| frame.bounds);
    let side = |a: usize| first[1][a] - first[0][a];
    let along = if side(0) >= side(1) { 0.0 } else { std::f64::consts::FRAC_PI_2 };
    along - FROM_SIDE_RAD
}

/// Axes of an OpenCV camera at the world's origin that looks back from the direction of an azimuth (from +x towards +y)
/// and an elevation above the ground.
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

fn corners([low, high]: [[f64; 3]; 2]) -> impl Iterator<Item = Point3<f64>> {
    (0..8).map(move |n| Point3::from([0, 1, 2].map(|a| if n >> a & 1 == 0 { low[a] } else { high[a] })))
}
