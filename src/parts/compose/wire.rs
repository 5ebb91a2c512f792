//! Wires and strips: solids thinner than the soft surface of a splat, long in one direction, with the cross-section that
//! the photos show.
//!
//! After carving, a wire that is a few pixels wide is a few cells thick, with an error of as many cells; so is a saw blade
//! across its faces. But its width in a photo, between the two edges of the object, is known to a fraction of a pixel, see
//! [`silhouettes`](crate::parts::inside::silhouettes). If the views agree on the width, from whatever side they look, it
//! is the diameter of a round wire. Otherwise the thing may be a strip with a rectangular cross-section: a view that looks
//! at its edge shows its thickness, one that looks at its face its breadth, and the others a sum of both. Each cell then
//! holds the share of the true cross-section in the carved one, so the sum over the cells is length times cross-section.

use std::f64::consts::{FRAC_PI_4, SQRT_2};

use nalgebra::{Matrix2, Vector2, Vector3};
use rayon::prelude::*;

use super::spread::Spread;
use super::thickness::Chord;
use crate::parts::assign::Labelled;
use crate::parts::inside::silhouettes::{Silhouettes, Width};

/// The direction of a wire is measured within the greatest thickness of a wire plus this many cells.
const AROUND_CELLS: f64 = 2.0;
/// Across a wire, in the direction of the larger spread, the variance of its cells is at most this share of the variance
/// along it. A stretch of a cylinder that is twice as long as it is wide has 0.19.
const ELONGATED: f64 = 0.25;
/// The direction of a strip, which is broader than a wire, is measured within this many times the distance.
const BROADER: usize = 2;
/// A stretch of a strip has a direction if the variance of its cells across is at most this share of the variance along
/// it: it is then at least 1.3 times as long as it is broad. A strip is also at least twice as broad as it is thick, see
/// [`ELONGATED`].
const DIRECTED: f64 = 0.6;
/// The thin cells of a part within a block of this many cells per side are measured as one: along a wire, little changes.
const BLOCK_CELLS: usize = 4;
/// Number of views that must show a wire between two backgrounds.
const VIEWS_MIN: usize = 3;
/// A wire is round if the quartiles of its widths, over the views, differ by no more than this factor.
const ROUND: f64 = 1.3;
/// Error of an edge in a photo's mask, as the half-width of a 90 % interval, in pixels: masks have soft edges, and where
/// light is blended over a bright background, an edge moves.
const EDGE_PIXELS: f64 = 0.25;
/// Half-width of a 90 % interval, in standard deviations.
const NINETY: f64 = 1.645;
/// The face of a strip is looked for within this angle of the carved one, degrees: it is carved from a soft splat.
const TILT_MOST: i32 = 15;

/// The measurements of a wire or a strip in the photos, at one of its cells.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wire {
    /// The true cross-section over the carved one; 0 if the cell belongs to no wire that was measured.
    pub share: f32,
    /// Relative error of the cross-section, as the half-width of a 90 % interval.
    pub error: f32,
}

impl Wire {
    /// Carving makes a wire thicker, if anything. A cross-section that is certainly larger than the carved one includes
    /// something beside the part, or is that of a strip of which the views show the faces only: then `None`.
    fn of(section: f64, carved: f64, error: f64) -> Option<Self> {
        let share = section / carved;
        (share <= 1.0 + error).then_some(Self { share: share as f32, error: error as f32 })
    }
}

/// The accuracy of carving and of the photos, scene units.
#[derive(Debug, Clone, Copy)]
pub struct Sharpness {
    /// The possible error of the carved surface's position.
    pub surface: f64,
    /// A wire or strip is thinner than this, and carving makes it thicker by no more than this.
    pub soft: f64,
    /// The width of a pixel.
    pub pixel: f64,
}

/// The wires and strips among the solids, per cell. `is_solid` is per label, `chords` are per surface cell.
pub fn wires(
    cells: &Labelled,
    is_solid: &[bool],
    chords: &[Option<Chord>],
    silhouettes: &Silhouettes,
    sharpness: Sharpness,
) -> Vec<Wire> {
    let mut wires = vec![Wire::default(); cells.label.len()];
    if silhouettes.views.len() < VIEWS_MIN {
        return wires;
    }
    // From the edge of a strip, a ray inward is as long as the strip is broad. Without a ray, only the depth decides.
    let longest = (1 + BROADER) as f64 * sharpness.soft;
    let is_thin = |&i: &usize| {
        is_solid.get(cells.label[i] as usize) == Some(&true)
            && f64::from(cells.surface.depth[i]) <= sharpness.soft
            && chords[cells.surface.nearest[i] as usize].is_none_or(|chord| chord.length <= longest)
    };
    let mut thin: Vec<([usize; 3], u32, usize)> = (0..cells.label.len())
        .into_par_iter()
        .filter(is_thin)
        .map(|i| (cells.grid.coords(i).map(|at| at / BLOCK_CELLS), cells.label[i], i))
        .collect();
    thin.par_sort_unstable();
    let blocks: Vec<_> = thin.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
    let measured: Vec<Option<Wire>> = blocks
        .par_iter()
        .map(|block| {
            let block: Vec<usize> = block.iter().map(|(_, _, i)| *i).collect();
            at_cell(cells, central(cells, &block), silhouettes, sharpness)
        })
        .collect();
    for (block, wire) in blocks.iter().zip(measured) {
        block.iter().for_each(|(_, _, i)| wires[*i] = wire.unwrap_or_default());
    }
    wires
}

/// The cell nearest to the mean of some cells.
fn central(cells: &Labelled, of: &[usize]) -> usize {
    let center = |i: usize| cells.grid.center(cells.grid.coords(i)).coords;
    let mean = of.iter().map(|&i| center(i)).sum::<Vector3<f64>>() / of.len() as f64;
    let distance = |i: usize| (center(i) - mean).norm_squared();
    of.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b))).expect("a block has a cell")
}

fn at_cell(cells: &Labelled, i: usize, silhouettes: &Silhouettes, of: Sharpness) -> Option<Wire> {
    let cell = cells.grid.cell;
    let reach = (of.soft / cell + AROUND_CELLS).ceil() as usize;
    let center = cells.grid.center(cells.grid.coords(i));
    let spread = Spread::around(cells, i, reach);
    if spread.variance(1) <= ELONGATED * spread.variance(2) {
        let widths = silhouettes.widths(center, spread.axis(), of.soft);
        if let Some(wire) = wire(&spread, widths, cell, of.pixel) {
            return Some(wire);
        }
    }
    if spread.thickness() * cell > of.soft {
        return None;
    }
    let spread = Spread::around(cells, i, BROADER * reach);
    if spread.variance(1) > DIRECTED * spread.variance(2) || spread.variance(0) > ELONGATED * spread.variance(1) {
        return None;
    }
    let breadth = (12.0 * spread.variance(1)).sqrt() * cell;
    let widths = silhouettes.widths(center, spread.axis(), breadth + of.soft);
    strip(&spread, &widths, cell, of)
}

/// A round wire.
fn wire(spread: &Spread, widths: Vec<Width>, cell: f64, pixel: f64) -> Option<Wire> {
    if widths.len() < VIEWS_MIN {
        return None;
    }
    let mut widths: Vec<f64> = widths.iter().map(|width| width.length).collect();
    widths.sort_by(f64::total_cmp);
    let at = |share: f64| widths[(share * (widths.len() - 1) as f64).round() as usize];
    let [low, diameter, high] = [0.25, 0.5, 0.75].map(at);
    if high > ROUND * low {
        return None;
    }
    let of_widths = (high / low).ln().abs();
    let of_edges = SQRT_2 * EDGE_PIXELS * pixel / diameter;
    Wire::of(FRAC_PI_4 * diameter * diameter, spread.section() * cell * cell, 2.0 * of_widths.hypot(of_edges))
}

/// A strip, if the photos tell its thickness better than carving does, which may err at both its surfaces.
fn strip(spread: &Spread, widths: &[Width], cell: f64, of: Sharpness) -> Option<Wire> {
    let fits = (-TILT_MOST..=TILT_MOST).filter_map(|degrees| {
        let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
        let [face, side] = [spread.direction(0), spread.direction(1)];
        Rectangle::fit(widths, face * cos + side * sin, side * cos - face * sin)
    });
    let Rectangle { thickness, breadth, errors, .. } = fits.min_by(|a, b| a.residual.total_cmp(&b.residual))?;
    let edges = SQRT_2 * EDGE_PIXELS * of.pixel;
    let errors = errors.map(|of_widths| of_widths.hypot(edges));
    if errors.x >= 2.0 * of.surface {
        return None;
    }
    let error = (errors.x / thickness).hypot(errors.y / breadth);
    Wire::of(thickness * breadth, spread.section() * cell * cell, error)
}

/// A rectangular cross-section that fits the widths of a strip. Scene units.
struct Rectangle {
    thickness: f64,
    breadth: f64,
    /// Of thickness and breadth, by the scatter of the widths: half-widths of 90 % intervals.
    errors: Vector2<f64>,
    /// The sum of squares that is left.
    residual: f64,
}

impl Rectangle {
    /// Least squares: seen along a direction, a rectangle is as wide as the sum of its sides, each foreshortened. `face`
    /// is the normal of the broader sides, `side` that of the narrower ones.
    fn fit(widths: &[Width], face: Vector3<f64>, side: Vector3<f64>) -> Option<Self> {
        if widths.len() <= VIEWS_MIN {
            return None;
        }
        let row = |width: &Width| Vector2::new(width.across.dot(&face).abs(), width.across.dot(&side).abs());
        let normal: Matrix2<f64> = widths.iter().map(|width| row(width) * row(width).transpose()).sum();
        let right: Vector2<f64> = widths.iter().map(|width| row(width) * width.length).sum();
        let inverse = normal.try_inverse()?;
        let sides = inverse * right;
        if sides.min() <= 0.0 {
            return None;
        }
        let residual: f64 = widths.iter().map(|width| (width.length - row(width).dot(&sides)).powi(2)).sum();
        // Three things are fitted: the two sides and, by the caller, the tilt.
        let variance = residual / (widths.len() - 3) as f64;
        let errors = inverse.diagonal().map(|of_one| NINETY * (of_one * variance).sqrt());
        Some(Self { thickness: sides.x, breadth: sides.y, errors, residual })
    }
}
