//! The exact place of a marker's edges and corners.
//!
//! Along each edge of the square, the light is read across the edge, from the black border to the white paper around
//! it. The edge is at the mean place of the change in light; for any symmetric blur, that is its true place. A straight line
//! through these places is fitted in the picture of an ideal pinhole camera, since a lens bends lines; neighbouring
//! lines meet in a corner. All of this is then repeated from the corners found, with profiles centred on the edge.

use nalgebra::{Point2, Vector2};

use super::plane::Plane;
use super::quads::Quad;
use crate::camera::Intrinsics;
use crate::numeric::upper_median;

/// How far a profile extends to either side of the edge, in cells, in each pass: the border is one cell wide, and so is the
/// least white margin around it. In the last passes, nothing beyond them must show through a blur. The quadrilateral is
/// off by up to half a cell at first; each pass reduces that by about a factor of ten.
const REACH_CELLS: [f64; 4] = [0.7, 0.7, 0.5, 0.5];
/// The least reach in pixels, for tiny cells: over a shorter distance, there is no profile to speak of.
const LEAST_REACH: f64 = 1.2;
/// Distance between the samples of a profile in pixels.
const STEP: f64 = 0.5;
/// The ends of an edge are left out, in cells: a blur makes corners round.
const ENDS_CELLS: f64 = 0.75;
/// The largest number of profiles per edge.
const MOST_PROFILES: f64 = 200.0;
/// The smallest number of profiles to which a line is fitted.
const FEWEST_PROFILES: usize = 6;
/// A profile whose contrast is less than this share of the edge's median is disturbed by something else.
const LEAST_CONTRAST: f64 = 0.4;
/// Places farther from the line than this many times the median distance are left out (a normal distribution has one in
/// 1,300 there).
const OUTLIER: f64 = 5.0;
/// A blurred or dirty edge scatters; if its places scatter by more than this, in cells, it is not straight.
const MOST_SCATTER_CELLS: f64 = 0.25;

/// Converts between the photo's pixels and those of a pinhole camera with the same focal length and centre.
pub(super) struct Lens(pub Intrinsics);

impl Lens {
    fn to(&self, at: Point2<f64>, map: impl Fn(f64, f64) -> Option<(f64, f64)>) -> Option<Point2<f64>> {
        let i = &self.0;
        if i.distortion.is_none() {
            return Some(at);
        }
        let (x, y) = map((at.x - i.cx) / i.fx, (at.y - i.cy) / i.fy)?;
        Some(Point2::new(i.fx * x + i.cx, i.fy * y + i.cy))
    }

    /// Where a pinhole camera would show what the photo shows at `pixel`.
    pub fn ideal(&self, pixel: Point2<f64>) -> Option<Point2<f64>> {
        self.to(pixel, |x, y| self.0.distortion.invert(x, y))
    }

    /// Where the photo shows what a pinhole camera would show at `ideal`.
    pub fn pixel(&self, ideal: Point2<f64>) -> Option<Point2<f64>> {
        let shown = |x, y| (!self.0.distortion.folds_back_at(x, y)).then(|| self.0.distortion.apply(x, y));
        self.to(ideal, shown)
    }
}

/// The corners of a square, and how sharp its edges are.
pub(super) struct Refined {
    pub quad: Quad,
    /// The share of the change from black to white that takes place within a quarter of a cell of the edge, for the
    /// softest edge.
    pub sharpness: f64,
}

/// The corners of the dark square with `cells` cells per side near `quad`; both in pixels of a pinhole camera.
pub(super) fn refine(plane: &Plane, lens: &Lens, mut quad: Quad, cells: usize) -> Option<Refined> {
    let mut sharpness = 0.0;
    for reach_cells in REACH_CELLS {
        sharpness = 1.0;
        let mut lines = Vec::with_capacity(4);
        for side in 0..4 {
            let corner = |offset: usize| quad[(side + offset) % 4];
            let across =
                Across { corners: [corner(0), corner(1)], opposite: [corner(2), corner(3)], cells: cells as f64 };
            let (line, of_edge) = edge(&across, reach_cells, plane, lens)?;
            lines.push(line);
            sharpness = f64::min(sharpness, of_edge);
        }
        for corner in 0..4 {
            quad[corner] = meet(&lines[(corner + 3) % 4], &lines[corner])?;
        }
    }
    is_convex(&quad).then_some(Refined { quad, sharpness })
}

/// A point and a direction.
struct Line {
    through: Point2<f64>,
    along: Vector2<f64>,
}

fn meet(a: &Line, b: &Line) -> Option<Point2<f64>> {
    let across = a.along.perp(&b.along);
    let at = (b.through - a.through).perp(&b.along) / across;
    at.is_finite().then(|| a.through + at * a.along)
}

fn is_convex(quad: &Quad) -> bool {
    (0..4).all(|i| (quad[(i + 1) % 4] - quad[i]).perp(&(quad[(i + 2) % 4] - quad[(i + 1) % 4])) > 0.0)
}

/// An edge between two corners, the corners of the opposite edge, and the number of cells between the two edges.
struct Across {
    corners: [Point2<f64>; 2],
    opposite: [Point2<f64>; 2],
    cells: f64,
}

/// The line on which an edge lies, and its sharpness.
fn edge(across: &Across, reach_cells: f64, plane: &Plane, lens: &Lens) -> Option<(Line, f64)> {
    let Across { corners: [a, b], opposite, cells } = *across;
    let length = (b - a).norm();
    let along = (b - a).try_normalize(f64::EPSILON)?;
    // Corners are clockwise as seen, so the left-hand side of the way from one to the next is outside.
    let outward = Vector2::new(along.y, -along.x);
    let depth = -0.5 * opposite.iter().map(|corner| (corner - a).dot(&outward)).sum::<f64>();
    let cell = depth / cells;
    if !(cell > 0.0 && length > 0.0) {
        return None;
    }
    let reach = (reach_cells * cell).max(LEAST_REACH);
    let ends = ENDS_CELLS / cells;
    let count = (length * (1.0 - 2.0 * ends)).clamp(FEWEST_PROFILES as f64, MOST_PROFILES).round() as usize;
    let mut found = Vec::with_capacity(count);
    for n in 0..count {
        let share = ends + (1.0 - 2.0 * ends) * (n as f64 + 0.5) / count as f64;
        let middle = a + share * length * along;
        if let Some(profile) = profile(plane, lens, middle, outward, reach) {
            found.push((share - 0.5, profile));
        }
    }
    let usual = upper_median(found.iter().map(|(_, profile)| profile.contrast).collect())?;
    found.retain(|(_, profile)| profile.contrast >= LEAST_CONTRAST * usual && profile.offset.abs() < reach);
    let sharpness = upper_median(found.iter().map(|(_, profile)| profile.sharpness).collect())?;
    let mut found: Vec<(f64, f64)> = found.into_iter().map(|(share, profile)| (share, profile.offset)).collect();
    let (mut line, mut scatter) = fit(&found)?;
    found.retain(|(share, offset)| (line.0 + line.1 * share - offset).abs() <= OUTLIER * scatter.max(f64::EPSILON));
    (line, scatter) = fit(&found)?;
    if scatter > MOST_SCATTER_CELLS * cell.max(1.0) {
        return None;
    }
    let point_at = |share: f64| a + (share + 0.5) * length * along + (line.0 + line.1 * share) * outward;
    Some((Line { through: point_at(0.0), along: point_at(0.5) - point_at(-0.5) }, sharpness))
}

/// The picture across an edge.
struct Profile {
    /// Distance of the edge from where it was expected, outwards.
    offset: f64,
    contrast: f64,
    sharpness: f64,
}

/// The picture across the edge at `middle` in the direction `outward`.
fn profile(plane: &Plane, lens: &Lens, middle: Point2<f64>, outward: Vector2<f64>, reach: f64) -> Option<Profile> {
    let steps = (reach / STEP).ceil();
    let mut values = Vec::with_capacity(2 * steps as usize + 1);
    for n in -(steps as i32)..=steps as i32 {
        let offset = reach * f64::from(n) / steps;
        values.push((offset, plane.light(lens.pixel(middle + offset * outward)?)?));
    }
    let contrast = values.last()?.1 - values.first()?.1;
    let change = |pair: &[(f64, f64)]| (pair[1].1 - pair[0].1) * 0.5 * (pair[0].0 + pair[1].0);
    let offset = values.windows(2).map(change).sum::<f64>() / contrast;
    let quarter = values.len() / 4;
    let sharpness = (values[values.len() - 1 - quarter].1 - values[quarter].1) / contrast;
    (contrast > 0.0).then_some(Profile { offset, contrast, sharpness })
}

/// The straight line `.0 + .1 * share` nearest to the offsets, and the median distance from it.
fn fit(places: &[(f64, f64)]) -> Option<((f64, f64), f64)> {
    if places.len() < FEWEST_PROFILES {
        return None;
    }
    let count = places.len() as f64;
    let mean = |value_of: &dyn Fn(&(f64, f64)) -> f64| places.iter().map(value_of).sum::<f64>() / count;
    let (x, y) = (mean(&|place| place.0), mean(&|place| place.1));
    let slope = mean(&|place| (place.0 - x) * (place.1 - y)) / mean(&|place| (place.0 - x).powi(2));
    let line = (y - slope * x, slope);
    let scatter = upper_median(places.iter().map(|place| (line.0 + line.1 * place.0 - place.1).abs()).collect())?;
    slope.is_finite().then_some((line, scatter))
}
