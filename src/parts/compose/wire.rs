//! Wires and strips: solids thinner than the soft surface of a splat, long in one direction, with the cross-section that
//! the photos show.
//!
//! After carving, a wire that is a few pixels wide is a few cells thick, with an error of as many cells; so is a saw blade
//! across its faces. But its width in a photo, between the two edges of the object, is known to a fraction of a pixel, see
//! [`silhouettes`](crate::parts::inside::silhouettes). If the views look at it from several sides, their widths tell a
//! round wire, as wide from everywhere, from a strip with a rectangular cross-section: a view that looks at its edge shows
//! its thickness, one that looks at its face its breadth, and the others a sum of both. Each cell then holds the share of
//! the true cross-section in the carved one, so the sum over the cells is length times cross-section.

use std::f64::consts::{FRAC_PI_4, SQRT_2};

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::SHEET_SLACK;
use super::spread::{Rows, Spread};
use super::thickness::Chord;
use crate::numeric::{NORMAL_90, upper_median};
use crate::parallel;
use crate::parts::assign::Labelled;
use crate::parts::inside::silhouettes::{Silhouettes, Width};

/// The direction of a wire is measured within the greatest thickness of a wire plus this many cells.
const AROUND_CELLS: f64 = 2.0;
/// Across a wire, in the direction of the larger spread, the variance of its cells is at most this share of the variance
/// along it. A stretch of a cylinder that is twice as long as it is wide has 0.19.
const ELONGATED: f64 = 0.25;
/// The direction of a strip, or of a wire nearly as thick as that distance, is measured within this many times the
/// distance.
const BROADER: usize = 2;
/// A stretch of a strip has a direction if the variance of its cells across is at most this share of the variance along
/// it: it is then at least 1.3 times as long as it is broad. A strip is also at least twice as broad as it is thick, see
/// [`ELONGATED`].
const DIRECTED: f64 = 0.6;
/// The thin cells of a part within a block of this many cells per side are measured as one: along a wire, little changes.
const BLOCK_CELLS: usize = 4;
/// Number of views that must show a wire between two backgrounds.
const VIEWS_MIN: usize = 3;
/// The same for a rectangle: twice the number of things that are fitted.
const RECTANGLE_VIEWS_MIN: usize = 6;
/// The views look from several sides if the directions in which they measure are spread at least as widely as those of
/// views 20 degrees above and below a flat strip. Of 1, the sum of both variances.
const SEVERAL_SIDES: f64 = 0.1;
/// A wire is round if the quartiles of its widths, over the views, differ by no more than this factor.
const ROUND: f64 = 1.3;
/// Error of an edge in a photo's mask, as the half-width of a 90 % interval, in pixels: masks have soft edges, and where
/// light is blended over a bright background, an edge moves.
const EDGE_PIXELS: f64 = 0.25;
/// A width is left out if it is off by more than this many times the median.
const OFF: f64 = 3.0;
/// Carving makes a side longer by no more than this many times the uncertainty of the surface: two at either end.
const GROWN: f64 = 4.0;
/// Half a right angle in steps of one degree: every way to turn a rectangle.
const TILT_MOST: i32 = 45;

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

/// The wires and strips among the solids, per cell. `is_solid` is per label, `chords` are per surface cell; `uncertainty`
/// is the possible error of the carved surface's position, scene units.
pub fn wires(
    cells: &Labelled,
    is_solid: &[bool],
    chords: &[Option<Chord>],
    silhouettes: &Silhouettes,
    uncertainty: f64,
) -> Vec<Wire> {
    let mut wires = vec![Wire::default(); cells.label.len()];
    if silhouettes.views.len() < VIEWS_MIN {
        return wires;
    }
    // From the edge of a strip, a ray inward is as long as the strip is broad. Without a ray, only the depth decides.
    let soft = SHEET_SLACK * uncertainty;
    let longest = (1 + BROADER) as f64 * soft;
    let is_thin = |i: usize| {
        is_solid.get(cells.label[i] as usize) == Some(&true)
            && f64::from(cells.surface.depth[i]) <= soft
            && chords[cells.surface.nearest[i] as usize].is_none_or(|chord| chord.length <= longest)
    };
    let mut thin: Vec<([usize; 3], u32, usize)> = parallel::flat_map_range(cells.label.len(), |i| {
        is_thin(i).then(|| (cells.grid.coords(i).map(|at| at / BLOCK_CELLS), cells.label[i], i))
    });
    parallel::sort_unstable_by(&mut thin, Ord::cmp);
    let blocks: Vec<_> = thin.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
    let rows = Rows::of(cells);
    let measured: Vec<Option<Wire>> = parallel::map(&blocks, |block| {
        let block: Vec<usize> = block.iter().map(|(_, _, i)| *i).collect();
        at_cell(&rows, central(cells, &block), silhouettes, uncertainty)
    });
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

fn at_cell(rows: &Rows, i: usize, silhouettes: &Silhouettes, uncertainty: f64) -> Option<Wire> {
    let grid = &rows.cells.grid;
    let (cell, soft) = (grid.cell, SHEET_SLACK * uncertainty);
    let reach = (soft / cell + AROUND_CELLS).ceil() as usize;
    let center = grid.center(grid.coords(i));
    let spread = rows.around(i, reach);
    if spread.variance(1) <= ELONGATED * spread.variance(2) {
        let widths = silhouettes.widths(center, spread.axis(), soft);
        if let Some(wire) = measured(&spread, widths, cell, uncertainty) {
            return Some(wire);
        }
    }
    let thickness = spread.thickness() * cell;
    let spread = rows.around(i, BROADER * reach);
    let is_wire = spread.variance(1) <= ELONGATED * spread.variance(2);
    let is_strip = thickness <= soft
        && spread.variance(1) <= DIRECTED * spread.variance(2)
        && spread.variance(0) <= ELONGATED * spread.variance(1);
    if !is_wire && !is_strip {
        return None;
    }
    // In the middle of the strip: at its rim, a cell may lie beyond the true edge.
    let widths = silhouettes.widths(center + spread.offset * cell, spread.axis(), carved_side(&spread, 1, cell) + soft);
    if is_wire && let Some(wire) = measured(&spread, widths.clone(), cell, uncertainty) {
        return Some(wire);
    }
    if !is_strip {
        return None;
    }
    Rectangle::of(&spread, widths, cell, uncertainty).and_then(|rectangle| rectangle.wire(&spread, cell))
}

/// Whether the directions of widths, all of them across an axis, differ enough to tell the shape of the cross-section.
fn are_from_several_sides(widths: &[Width]) -> bool {
    let products: Matrix3<f64> = widths.iter().map(|width| width.across * width.across.transpose()).sum();
    let mut variances: Vec<f64> = products.symmetric_eigenvalues().iter().copied().collect();
    variances.sort_by(f64::total_cmp);
    variances[1] >= SEVERAL_SIDES * widths.len() as f64
}

/// A round wire or a thin strip, whichever fits the widths better.
fn measured(spread: &Spread, widths: Vec<Width>, cell: f64, uncertainty: f64) -> Option<Wire> {
    if !are_from_several_sides(&widths) {
        return None;
    }
    let circle = Circle::of(&widths);
    let rectangle = Rectangle::of(spread, widths, cell, uncertainty);
    match (circle, rectangle) {
        (Some(circle), Some(rectangle)) if rectangle.variance < circle.variance => rectangle.wire(spread, cell),
        (Some(circle), _) => Wire::of(circle.section, spread.section() * cell * cell, circle.error),
        (None, rectangle) => rectangle?.wire(spread, cell),
    }
}

/// The length of a side of a carved cross-section, taken as a rectangle: the shorter (0) or the longer (1).
fn carved_side(spread: &Spread, rank: usize, cell: f64) -> f64 {
    (12.0 * spread.variance(rank)).sqrt() * cell
}

/// The error of a width due to its two edges, as the half-width of a 90 % interval.
fn error_of_edges(widths: &[Width]) -> f64 {
    let pixel = widths.iter().map(|width| width.pixel).sum::<f64>() / widths.len() as f64;
    SQRT_2 * EDGE_PIXELS * pixel
}

/// A round cross-section. Scene units.
struct Circle {
    section: f64,
    /// Relative error of the section, as the half-width of a 90 % interval.
    error: f64,
    /// Of the widths around the diameter.
    variance: f64,
}

impl Circle {
    fn of(widths: &[Width]) -> Option<Self> {
        if widths.len() < VIEWS_MIN {
            return None;
        }
        let mut lengths: Vec<f64> = widths.iter().map(|width| width.length).collect();
        lengths.sort_by(f64::total_cmp);
        let quantile = |share: f64| lengths[(share * (lengths.len() - 1) as f64).round() as usize];
        let [low, diameter, high] = [0.25, 0.5, 0.75].map(quantile);
        if high > ROUND * low {
            return None;
        }
        let of_widths = (high / low).ln().abs();
        let of_edges = error_of_edges(widths) / diameter;
        let squares: f64 = lengths.iter().map(|length| (length - diameter).powi(2)).sum();
        Some(Self {
            section: FRAC_PI_4 * diameter * diameter,
            error: 2.0 * of_widths.hypot(of_edges),
            variance: squares / (lengths.len() - 1) as f64,
        })
    }
}

/// A rectangular cross-section. Scene units.
struct Rectangle {
    /// The sides across the carved face and along it.
    sides: [f64; 2],
    /// Half-widths of 90 % intervals of the sides.
    errors: [f64; 2],
    /// Of the widths around those of the rectangle.
    variance: f64,
}

impl Rectangle {
    /// The rectangle that fits the widths best, without those that are far off, since something else may stand beside
    /// the strip in a few views.
    fn of(spread: &Spread, mut widths: Vec<Width>, cell: f64, uncertainty: f64) -> Option<Self> {
        let edges = error_of_edges(&widths);
        let first = Fit::of(&widths, spread)?;
        let off = |width: &Width| (width.length - first.width(width)).abs();
        let limit = (OFF * upper_median(widths.iter().map(off).collect())?).max(edges);
        widths.retain(|width| off(width) <= limit);
        let fit = Fit::of(&widths, spread)?;
        let variance = fit.residual / (widths.len() - 3) as f64;
        // The edges are as uncertain as that even if the widths agree by chance.
        let deviation = variance.sqrt().max(edges / NORMAL_90);
        let of_widths = fit.covariance(&widths)?.diagonal().map(|of_one| NORMAL_90 * of_one.sqrt() * deviation);
        let errors = [of_widths.x.hypot(edges), of_widths.y.hypot(edges)];
        let sides = [fit.thickness, fit.breadth];
        let is_carved = |rank: usize| {
            let grown = carved_side(spread, rank, cell) - sides[rank];
            -errors[rank] <= grown && grown <= GROWN * uncertainty
        };
        // The photos must tell the thickness better than carving does, which may err at both surfaces, and show what was
        // carved: not a part beside it, nor one of several strips side by side.
        let is_better = errors[0] < 2.0 * uncertainty && errors[0] < sides[0];
        (is_better && is_carved(0) && is_carved(1)).then_some(Self { sides, errors, variance })
    }

    fn wire(&self, spread: &Spread, cell: f64) -> Option<Wire> {
        let error = (self.errors[0] / self.sides[0]).hypot(self.errors[1] / self.sides[1]);
        Wire::of(self.sides[0] * self.sides[1], spread.section() * cell * cell, error)
    }
}

/// A least-squares fit: seen along a direction, a rectangle is as wide as the sum of its sides, each foreshortened.
struct Fit {
    /// The direction in which `thickness` is measured, and that of `breadth`.
    face: Vector3<f64>,
    side: Vector3<f64>,
    thickness: f64,
    breadth: f64,
    /// The sum of squares that is left.
    residual: f64,
}

impl Fit {
    /// The best fit over all tilts against the carved cross-section.
    fn of(widths: &[Width], spread: &Spread) -> Option<Self> {
        if widths.len() < RECTANGLE_VIEWS_MIN {
            return None;
        }
        let fits = (-TILT_MOST..=TILT_MOST).filter_map(|degrees| {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let [face, side] = [spread.direction(0), spread.direction(1)];
            Self::at(widths, face * cos + side * sin, side * cos - face * sin)
        });
        fits.min_by(|a, b| a.residual.total_cmp(&b.residual))
    }

    fn at(widths: &[Width], face: Vector3<f64>, side: Vector3<f64>) -> Option<Self> {
        let row = |width: &Width| Vector2::new(width.across.dot(&face).abs(), width.across.dot(&side).abs());
        let normal: Matrix2<f64> = widths.iter().map(|width| row(width) * row(width).transpose()).sum();
        let right: Vector2<f64> = widths.iter().map(|width| row(width) * width.length).sum();
        let sides = normal.try_inverse()? * right;
        let residual = widths.iter().map(|width| (width.length - row(width).dot(&sides)).powi(2)).sum();
        (sides.min() > 0.0).then_some(Self { face, side, thickness: sides.x, breadth: sides.y, residual })
    }

    /// The width of the rectangle in the direction of a width.
    fn width(&self, of: &Width) -> f64 {
        self.thickness * of.across.dot(&self.face).abs() + self.breadth * of.across.dot(&self.side).abs()
    }

    /// The covariance of thickness, breadth and tilt, for widths of variance 1; `None` if these do not determine them.
    fn covariance(&self, widths: &[Width]) -> Option<Matrix3<f64>> {
        let row = |width: &Width| {
            let [face, side] = [&self.face, &self.side].map(|normal| width.across.dot(normal));
            let turned = self.thickness * face.signum() * side - self.breadth * side.signum() * face;
            Vector3::new(face.abs(), side.abs(), turned)
        };
        let normal: Matrix3<f64> = widths.iter().map(|width| row(width) * row(width).transpose()).sum();
        normal.try_inverse()
    }
}
