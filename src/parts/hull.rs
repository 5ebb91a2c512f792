//! A convex bound on the object from its Gaussians: photos from above do not see the underside, and without a bound the
//! space under it, that no view looks through, would count as inside.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use super::grid::Grid;
use crate::scene::gaussians::Gaussians;

/// Directions in which the extent is measured, spread evenly (Fibonacci sphere) beside the six axes. With 250 of them the
/// bound of a ball is 1 % too large.
const DIRECTIONS: usize = 250;
/// A Gaussian fainter than this bounds nothing.
const OPACITY_MIN: f64 = 0.1;
/// Share of the Gaussians that may lie beyond the bound in any direction: a few always stray.
const STRAYS: f64 = 0.003;

/// Half spaces that hold the Gaussians' centres, but for a few strays.
pub struct ConvexBound {
    planes: Vec<(Vector3<f64>, f64)>,
}

impl ConvexBound {
    /// The bound of the Gaussians that `kept` names.
    pub fn of(gaussians: &Gaussians, kept: &[bool]) -> Self {
        let solid = |&i: &usize| kept[i] && gaussians.opacity(i) >= OPACITY_MIN;
        let centers: Vec<Point3<f64>> = (0..gaussians.len()).filter(solid).map(|i| gaussians.center(i)).collect();
        if centers.is_empty() {
            return Self { planes: Vec::new() };
        }
        let planes = directions().into_par_iter().map(|n| {
            let mut reach: Vec<f64> = centers.iter().map(|c| n.dot(&c.coords)).collect();
            let within = reach.len() - 1 - (reach.len() as f64 * STRAYS) as usize;
            let reach = *reach.select_nth_unstable_by(within, f64::total_cmp).1;
            (n, reach)
        });
        Self { planes: planes.collect() }
    }

    pub fn holds(&self, point: Point3<f64>) -> bool {
        self.planes.iter().all(|(n, reach)| n.dot(&point.coords) <= *reach)
    }

    /// Empties the cells beyond the bound.
    pub fn clip(&self, grid: &Grid, inside: &mut [bool]) {
        inside.par_chunks_mut(grid.layer()).enumerate().for_each(|(z, layer)| {
            for (i, cell) in layer.iter_mut().enumerate() {
                *cell = *cell && self.holds(grid.center([i % grid.dims[0], i / grid.dims[0], z]));
            }
        });
    }
}

fn directions() -> Vec<Vector3<f64>> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let spiral = (0..DIRECTIONS).map(|i| {
        let z = 1.0 - (2 * i + 1) as f64 / DIRECTIONS as f64;
        let (sin, cos) = (golden_angle * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vector3::new(r * cos, r * sin, z)
    });
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    axes.into_iter().flat_map(|a| [a, -a]).chain(spiral).collect()
}
