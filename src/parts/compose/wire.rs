//! Wires: solids thinner than the soft surface of a splat, long in one direction, as thick as the photos show them.
//!
//! After carving, a wire that is a few pixels wide is a few cells thick, with an error of as many cells. But its width in
//! a photo, between the two edges of the object, is known to a fraction of a pixel, see
//! [`silhouettes`](crate::parts::inside::silhouettes). If the views agree on the width, from whatever side they look, it
//! is the diameter of a round wire. Each cell then holds the share of the true cross-section in the carved one, so the
//! sum over the cells is length times cross-section.

use rayon::prelude::*;

use super::spread::Spread;
use super::thickness::Chord;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;
use crate::parts::inside::silhouettes::Silhouettes;

/// The direction of a wire is measured within the greatest thickness of a wire plus this many cells.
const AROUND_CELLS: f64 = 2.0;
/// Across a wire, in the direction of the larger spread, the variance of its cells is at most this share of the variance
/// along it. A stretch of a cylinder that is twice as long as it is wide has 0.19.
const ELONGATED: f64 = 0.25;
/// Number of views that must show a wire between two backgrounds.
const VIEWS_MIN: usize = 3;
/// A wire is round if the quartiles of its widths, over the views, differ by no more than this factor.
const ROUND: f64 = 1.3;
/// Error of an edge in a photo's mask, as the half-width of a 90 % interval, in pixels: masks have soft edges, and where
/// light is blended over a bright background, an edge moves.
const EDGE_PIXELS: f64 = 0.25;

/// The measurements of a wire in the photos, at one of its cells.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wire {
    /// The true cross-section over the carved one; 0 if the cell belongs to no wire that was measured.
    pub share: f32,
    /// Relative error of the cross-section, as the half-width of a 90 % interval.
    pub error: f32,
}

/// The wires among all parts, per cell. A wire is thinner than `soft`, and carving makes it thicker by no more than that;
/// `pixel` is the width of a pixel. Both in scene units. `chords` are per surface cell.
pub fn wires(
    cells: &Labelled,
    chords: &[Option<Chord>],
    silhouettes: &Silhouettes,
    soft: f64,
    pixel: f64,
) -> Vec<Wire> {
    if silhouettes.views.len() < VIEWS_MIN {
        return vec![Wire::default(); cells.label.len()];
    }
    let reach = (soft / cells.grid.cell + AROUND_CELLS).ceil() as usize;
    // Without a ray inward, only the depth decides.
    let is_thin = |i: usize| {
        cells.label[i] != NONE
            && f64::from(cells.surface.depth[i]) <= soft
            && chords[cells.surface.nearest[i] as usize].is_none_or(|chord| chord.length <= 2.0 * soft)
    };
    let of_cell = |i: usize| {
        let spread = is_thin(i).then(|| Spread::around(cells, i, reach));
        spread.and_then(|spread| wire(cells, i, &spread, silhouettes, soft, pixel)).unwrap_or_default()
    };
    (0..cells.label.len()).into_par_iter().map(of_cell).collect()
}

fn wire(cells: &Labelled, i: usize, spread: &Spread, silhouettes: &Silhouettes, soft: f64, pixel: f64) -> Option<Wire> {
    let cell = cells.grid.cell;
    if spread.variance(1) > ELONGATED * spread.variance(2) {
        return None;
    }
    let axis = spread.axis();
    let mut widths = silhouettes.widths(cells.grid.center(cells.grid.coords(i)), axis, soft);
    if widths.len() < VIEWS_MIN {
        return None;
    }
    widths.sort_by(f64::total_cmp);
    let at = |share: f64| widths[(share * (widths.len() - 1) as f64).round() as usize];
    let [low, diameter, high] = [0.25, 0.5, 0.75].map(at);
    if high > ROUND * low {
        return None;
    }
    let of_widths = (high / low).ln().abs();
    let of_edges = std::f64::consts::SQRT_2 * EDGE_PIXELS * pixel / diameter;
    let true_section = std::f64::consts::FRAC_PI_4 * diameter * diameter;
    Some(Wire {
        share: (true_section / (spread.section() * cell * cell)) as f32,
        error: (2.0 * of_widths.hypot(of_edges)) as f32,
    })
}
