//! The thickness of the material behind a surface: from each place straight in, to where the ray leaves the material.

use nalgebra::Point3;

use super::sample::places;
use super::tree::Tree;
use crate::parallel;
use crate::units::Estimate;

/// Places at which the thickness is measured.
const PLACES: usize = 2048;
/// The interval of the thickness leaves out this share of the surface at either end.
const TAIL: f64 = 0.05;

/// The thickness behind the `triangles`, median and interval of 90 % of their area; `None` if fewer than half of the rays
/// come out. `side_of` is 1 for triangles with material behind them, -1 with material in front, 0 for those that bound none.
pub fn thickness(
    tree: &Tree,
    corners: &[[Point3<f64>; 3]],
    triangles: &[u32],
    side_of: impl Fn(u32) -> f64 + Sync,
) -> Option<Estimate> {
    let places = places(corners, triangles, PLACES);
    let depth = |place: &super::sample::Place| {
        let mut nearest: Option<f64> = None;
        tree.hits(place.point, -place.normal.into_inner() * side_of(place.triangle), |hit| {
            if side_of(hit.triangle) != 0.0 && hit.triangle != place.triangle {
                nearest = Some(nearest.map_or(hit.distance, |least| least.min(hit.distance)));
            }
        });
        nearest
    };
    let mut depths: Vec<f64> = parallel::flat_map(&places, depth);
    depths.sort_by(f64::total_cmp);
    let quantile = |share: f64| depths[((depths.len() - 1) as f64 * share).round() as usize];
    (2 * depths.len() > places.len()).then(|| Estimate::new(quantile(TAIL), quantile(0.5), quantile(1.0 - TAIL)))
}
