//! The places where a rigid part can touch the ground: its points that are outermost in some direction.

use nalgebra::Vector3;

use crate::numeric::sphere_directions;
use crate::parallel;

/// Directions in which a part's outermost points are looked up, spread evenly: two neighbours are at most 0.08 rad
/// apart, so that the lowest point is missed by at most 0.04^2 / 2 of the distance between points, below the share of
/// the size that is visible.
const DIRECTIONS: usize = 4096;

/// The points with which a part can touch the ground, and how hard it has been pressed so far.
#[derive(Debug, Clone, PartialEq)]
pub struct Face {
    /// Label of the part.
    pub part: u32,
    /// E / (1 - nu^2), Pa.
    pub plane_modulus_pa: f64,
    /// The least area of a contact, m^2: that of one particle.
    pub least_area_m2: f64,
    /// In the body's frame, m.
    pub(super) points_m: Vec<Vector3<f64>>,
    /// Highest pressure on the ground so far.
    pub peak_pressure_pa: f64,
}

impl Face {
    /// The outermost of `points_m`, given in the simulation's frame.
    pub fn new(part: u32, points_m: &[Vector3<f64>], plane_modulus_pa: f64, least_area_m2: f64) -> Self {
        let directions: Vec<Vector3<f64>> = sphere_directions(DIRECTIONS).collect();
        let mut outermost: Vec<usize> = parallel::flat_map(&directions, |along| farthest(points_m, along));
        outermost.sort_unstable();
        outermost.dedup();
        let points_m = outermost.into_iter().map(|i| points_m[i]).collect();
        Self { part, plane_modulus_pa, least_area_m2, points_m, peak_pressure_pa: 0.0 }
    }

    /// The same face with its points relative to `center_m`.
    pub(super) fn about(mut self, center_m: Vector3<f64>) -> Self {
        self.points_m.iter_mut().for_each(|p| *p -= center_m);
        self
    }
}

fn farthest(points: &[Vector3<f64>], direction: &Vector3<f64>) -> Option<usize> {
    let (mut most, mut at) = (f64::NEG_INFINITY, None);
    for (i, p) in points.iter().enumerate() {
        let along = p.dot(direction);
        if along > most {
            (most, at) = (along, Some(i));
        }
    }
    at
}
