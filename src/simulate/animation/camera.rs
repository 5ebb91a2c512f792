//! The cameras of the animation.

use nalgebra::Point3;

use super::Viewpoint;
use crate::camera::Camera;
use crate::film::{Size, orbit};
use crate::simulate::SimulationReport;

/// Angle between the line of sight and the object's longer horizontal side: most of its length shows, and some depth.
const FROM_SIDE_RAD: f64 = 60.0 * std::f64::consts::PI / 180.0;

/// Cameras that see everywhere the object goes, world frame, scene units: one camera, or on a turntable one for each of
/// `count` pictures.
pub fn cameras_around(report: &SimulationReport, viewpoint: &Viewpoint, count: usize, size: Size) -> Vec<Camera> {
    let azimuth = viewpoint.azimuth_deg.map_or_else(|| from_the_side(report), f64::to_radians);
    let elevation = viewpoint.elevation_deg.to_radians();
    let corners: Vec<Point3<f64>> = report.frames.iter().flat_map(|frame| orbit::corners(frame.bounds)).collect();
    if viewpoint.turntable {
        return orbit::turntable(&corners, azimuth, elevation, count, size);
    }
    vec![orbit::still(&corners, azimuth, elevation, size)]
}

/// The azimuth of a three-quarter view that shows most of the object's length across the picture.
fn from_the_side(report: &SimulationReport) -> f64 {
    let first = report.frames.first().map_or([[0.0; 3]; 2], |frame| frame.bounds);
    let side = |a: usize| first[1][a] - first[0][a];
    let along = if side(0) >= side(1) { 0.0 } else { std::f64::consts::FRAC_PI_2 };
    along - FROM_SIDE_RAD
}
