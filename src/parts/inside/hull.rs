//! A bound on the object, derived from its Gaussians, on the sides that no carving view looks at: photos from above do
//! not show the underside, and without a bound the space under it, which no view looks through, would count as inside.

use nalgebra::{Matrix3, Point3, Vector3};

use super::depth_view::DepthView;
use crate::gaussians::Gaussians;
use crate::numeric::sphere_directions;
use crate::parallel;
use crate::parts::grid::Grid;

/// Directions in which the extent is measured, spread evenly (Fibonacci sphere), in addition to the two directions of
/// each axis. With 250 of them the bound of a ball is 1 % too large.
const DIRECTIONS: usize = 250;
/// A Gaussian with a lower opacity than this is ignored.
const OPACITY_MIN: f64 = 0.1;
/// Share of the Gaussians that may lie beyond the bound in any direction: there are always a few strays.
const STRAYS: f64 = 0.001;
/// A direction is bounded if every carving view sees a face pointing that way from behind, or grazes it at an angle whose
/// sine is below this (12 degrees). Silhouettes bound the other directions better.
const GRAZING: f64 = 0.2;

/// Half spaces that contain the Gaussians, except for a few strays.
pub struct UnseenBound {
    planes: Vec<(Vector3<f64>, f64)>,
}

impl UnseenBound {
    /// Computes the bound of the Gaussians for which `kept` is true: their centres and one standard deviation beyond.
    /// `views` are those that carve: no silhouette of any other view bounds the object. `middle` is the middle of the object.
    pub fn of(gaussians: &Gaussians, kept: &[bool], views: &[DepthView], middle: Point3<f64>) -> Self {
        let eyes = views.iter().filter_map(|view| (view.camera.center_in_world() - middle).try_normalize(0.0));
        let eyes: Vec<Vector3<f64>> = eyes.collect();
        let unseen = |n: &Vector3<f64>| eyes.iter().all(|eye| eye.dot(n) < GRAZING);
        let solid = |&i: &usize| kept[i] && gaussians.opacity(i) >= OPACITY_MIN;
        let solid: Vec<usize> = (0..gaussians.len()).filter(solid).collect();
        let covariances: Vec<Matrix3<f64>> = parallel::map(&solid, |&i| gaussians.covariance(i));
        let plane = |&n: &Vector3<f64>| {
            let reach = |(&i, covariance): (&usize, &Matrix3<f64>)| {
                n.dot(&gaussians.center(i).coords) + n.dot(&(covariance * n)).max(0.0).sqrt()
            };
            let mut reaches: Vec<f64> = solid.iter().zip(&covariances).map(reach).collect();
            let within = reaches.len().checked_sub(1 + (reaches.len() as f64 * STRAYS) as usize)?;
            Some((n, *reaches.select_nth_unstable_by(within, f64::total_cmp).1))
        };
        let directions: Vec<Vector3<f64>> = directions().into_iter().filter(unseen).collect();
        Self { planes: parallel::flat_map(&directions, plane) }
    }

    pub fn holds(&self, point: Point3<f64>) -> bool {
        self.planes.iter().all(|(n, reach)| n.dot(&point.coords) <= *reach)
    }

    /// Empties the cells beyond the bound.
    pub fn clip(&self, grid: &Grid, inside: &mut [bool]) {
        parallel::for_each_chunk_mut(inside, grid.layer(), |z, layer| {
            for (i, cell) in layer.iter_mut().enumerate() {
                *cell = *cell && self.holds(grid.center([i % grid.dims[0], i / grid.dims[0], z]));
            }
        });
    }
}

fn directions() -> Vec<Vector3<f64>> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    axes.into_iter().flat_map(|a| [a, -a]).chain(sphere_directions(DIRECTIONS)).collect()
}
