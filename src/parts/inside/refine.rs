//! Corrects the surface, which carving leaves too far out, to sub-cell accuracy.
//!
//! Carving must not follow the noise in one view's depth, so it leaves a layer as thick as its tolerance on everything.
//! Here, for every place of the carved surface, the views that face it measure how far behind it, along its normal,
//! they see the surface, and the cells above the mean of these distances are emptied: this is the fusion of signed
//! distances by Curless and Levoy (1996), on the surface alone. Views that see something else there (an occluder, the
//! background) are ignored. If the distances disagree by more than their mean, as on polished metal, the surface stays
//! where the silhouettes left it.

use nalgebra::{Point3, Vector3};

use super::carve::facing;
use super::depth_view::DepthView;
use crate::parallel;
use crate::parts::grid::Grid;
use crate::parts::grid::surface::{NONE, Surface};

/// Empties the cells of `inside` that lie above the surface seen by the views, at most `reach` (scene units) deep.
/// Returns how much the views disagree: the root mean square of the standard deviations of their distances.
pub fn refine(grid: &Grid, views: &[DepthView], reach: f64, inside: &mut [bool]) -> f64 {
    let surface = Surface::of(grid, inside);
    let said: Vec<Option<Said>> =
        parallel::map_range(surface.points.len(), |n| Said::by(views, surface.points[n], surface.normals[n], reach));
    let excess: Vec<f32> = said.iter().map(|said| said.as_ref().map_or(0.0, Said::excess) as f32).collect();
    parallel::for_each_mut(inside, |i, cell| {
        let nearest = surface.nearest[i];
        *cell = *cell && (nearest == NONE || surface.depth[i] >= excess[nearest as usize]);
    });
    let variances: Vec<f64> = said.iter().flatten().map(|said| said.deviation * said.deviation).collect();
    (variances.iter().sum::<f64>() / variances.len().max(1) as f64).sqrt()
}

/// A view's weight is the cosine between normal and line of sight raised to this power: the low-pass filter of a splat
/// thickens what is seen obliquely.
const OBLIQUENESS: i32 = 4;

/// The distance below a place of the carved surface, along its normal, at which the views see the surface, scene units.
struct Said {
    mean: f64,
    deviation: f64,
}

impl Said {
    /// Combines the distances from the views that face the place; `None` if there are none.
    fn by(views: &[DepthView], point: Point3<f64>, normal: Vector3<f64>, reach: f64) -> Option<Self> {
        let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for view in views {
            let Some(cosine) = facing(view, point, normal) else { continue };
            let Some(below) = view.surface_behind(point).map(|behind| behind * cosine) else { continue };
            if below.abs() <= reach {
                let weight = cosine.powi(OBLIQUENESS);
                weights += weight;
                sum += weight * below;
                squares += weight * below * below;
            }
        }
        let mean = sum / weights;
        let variance = (squares / weights - mean * mean).max(0.0);
        (weights > 0.0).then(|| Self { mean, deviation: variance.sqrt() })
    }

    /// The mean if it is larger than the views' disagreement, else 0.
    fn excess(&self) -> f64 {
        if self.mean > self.deviation { self.mean } else { 0.0 }
    }
}
