//! Which way the patches of a surface face if it is not closed: the front is the side from which more of the surroundings are
//! seen (after Takayama et al. 2014, "A Simple Method for Correcting Facet Orientations in Polygon Meshes Based on Ray
//! Casting").

use nalgebra::Point3;

use super::sample::{Place, places};
use super::tree::Tree;
use crate::numeric::sphere_directions;
use crate::parallel;

/// Rays from each place.
const DIRECTIONS: usize = 24;
/// Places on all patches together, and on one.
const PLACES: usize = 16_384;
const PLACES_PER_PATCH: usize = 64;
/// A patch is reversed if its back sees more of the surroundings than its front by this share of the rays to one side: below
/// it, as on a flat sheet, the file's own direction counts.
const CLEARLY: f64 = 0.1;

/// Per patch, whether its triangles should be reversed. `triangles_of` are those of each patch; only those that
/// `is_asked` names are looked at.
pub fn is_backward(
    tree: &Tree,
    corners: &[[Point3<f64>; 3]],
    triangles_of: &[Vec<u32>],
    is_asked: impl Fn(usize) -> bool + Sync,
) -> Vec<bool> {
    let asked = (0..triangles_of.len()).filter(|patch| is_asked(*patch)).count().max(1);
    let count = (PLACES / asked).clamp(1, PLACES_PER_PATCH);
    let decide = |patch: usize| {
        is_asked(patch) && {
            let places = places(corners, &triangles_of[patch], count);
            let seen: i64 = places.iter().map(|place| front_less_back(tree, place)).sum();
            (seen as f64) < -CLEARLY * (places.len() * DIRECTIONS / 2) as f64
        }
    };
    parallel::map_range(triangles_of.len(), decide)
}

/// The number of rays that reach the surroundings from the front of a place, less those from its back.
fn front_less_back(tree: &Tree, place: &Place) -> i64 {
    let sees = |direction: nalgebra::Vector3<f64>| {
        let mut is_free = true;
        tree.hits(place.point, direction, |hit| is_free &= hit.triangle == place.triangle);
        let side = if direction.dot(&place.normal) > 0.0 { 1 } else { -1 };
        if is_free { side } else { 0 }
    };
    sphere_directions(DIRECTIONS).map(sees).sum()
}
