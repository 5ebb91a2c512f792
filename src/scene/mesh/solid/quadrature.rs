//! Integrals over the space around a surface, of functions that jump at it, on an octree that is refined there.
//!
//! No number is random: the cells are the same in every run, and their axes are turned against the mesh's.

use crate::parallel;
use nalgebra::{Point3, Vector3};

use super::moments::Moments;
use super::tree::extent;

/// Number of integrals that are computed together.
pub const INTEGRALS: usize = 3;
/// Cells are halved while the last ones have no more samples than this.
const SAMPLES: usize = 150_000;
/// All cells are halved this often, and none more often than that.
const LEAST_DEPTH: u32 = 3;
const MOST_DEPTH: u32 = 11;
/// Samples of a cell that is not halved any further: one in the middle of each eighth.
const EIGHTHS: usize = 8;

/// What is integrated, at one point.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    pub values: [f64; INTEGRALS],
    /// A smooth function away from the surface, at certain `levels` of which the values jump; levels is empty if they jump at the
    /// surface only.
    pub field: f64,
}

/// Integrals with the densities that the values give.
#[derive(Debug, Clone, Copy)]
pub struct Integrals {
    pub moments: [Moments; INTEGRALS],
    /// Possible errors of the volumes: two standard deviations if the samples were random.
    pub errors: [f64; INTEGRALS],
}

#[derive(Debug, Clone)]
struct Cell {
    center: Point3<f64>,
    /// The triangles that may pass through it.
    triangles: Vec<u32>,
}

/// Integrates over the box of the triangles.
pub fn integrate(
    corners: &[[Point3<f64>; 3]],
    sample: impl Fn(Point3<f64>) -> Sample + Sync,
    levels: &[f64],
) -> Integrals {
    let (low, high) = extent(corners.iter().flatten());
    let mut side = (high - low).max();
    let root = Cell { center: nalgebra::center(&low, &high), triangles: (0..corners.len() as u32).collect() };
    let (mut cells, mut depth) = (vec![root], 0);
    let mut total = Integrals { moments: [Moments::ZERO; INTEGRALS], errors: [0.0; INTEGRALS] };
    while depth < MOST_DEPTH && (depth < LEAST_DEPTH || cells.len() * EIGHTHS * 4 <= SAMPLES) {
        (side, depth) = (0.5 * side, depth + 1);
        let halve = |cell: &Cell| halved(cell, side, corners, &sample, levels, depth < LEAST_DEPTH);
        let parts: Vec<(Vec<Cell>, [Moments; INTEGRALS])> = parallel::map(&cells, halve);
        cells = Vec::with_capacity(parts.len());
        for (mixed, whole) in parts {
            cells.extend(mixed);
            total.add(whole);
        }
    }
    let ends: Vec<_> = parallel::map(&cells, |cell| eighths(cell, side, &sample));
    for (moments, variances) in ends {
        total.add(moments);
        (0..INTEGRALS).for_each(|k| total.errors[k] += variances[k]);
    }
    total.errors = total.errors.map(|variance| 2.0 * variance.sqrt());
    total
}

impl Integrals {
    fn add(&mut self, moments: [Moments; INTEGRALS]) {
        (0..INTEGRALS).for_each(|k| self.moments[k] = self.moments[k] + moments[k]);
    }
}

/// The eighths of a cell, with sides of `side`: those in which the values jump, and the integrals over the others.
fn halved(
    cell: &Cell,
    side: f64,
    corners: &[[Point3<f64>; 3]],
    sample: &(impl Fn(Point3<f64>) -> Sample + Sync),
    levels: &[f64],
    always: bool,
) -> (Vec<Cell>, [Moments; INTEGRALS]) {
    let mut mixed = Vec::new();
    let mut free = Vec::new();
    for center in centers(cell.center, side) {
        let passing = |n: &u32| passes(&corners[*n as usize], center, 0.5 * side);
        let triangles: Vec<u32> = cell.triangles.iter().copied().filter(passing).collect();
        if triangles.is_empty() && !always {
            free.push((center, sample(center)));
        } else {
            mixed.push(Cell { center, triangles });
        }
    }
    let fields = || free.iter().map(|(_, sample)| sample.field);
    let change = fields().fold(f64::NEG_INFINITY, f64::max) - fields().fold(f64::INFINITY, f64::min);
    let mut whole = [Moments::ZERO; INTEGRALS];
    for (center, sample) in &free {
        if levels.iter().any(|level| (sample.field - level).abs() <= change) {
            mixed.push(Cell { center: *center, triangles: Vec::new() });
        } else {
            let cube = Moments::of_cube(*center, side);
            (0..INTEGRALS).for_each(|k| whole[k] = whole[k] + cube * sample.values[k]);
        }
    }
    (mixed, whole)
}

/// The integrals over a cell from samples of its eighths, and the variances of their volumes.
fn eighths(
    cell: &Cell,
    side: f64,
    sample: &(impl Fn(Point3<f64>) -> Sample + Sync),
) -> ([Moments; INTEGRALS], [f64; INTEGRALS]) {
    let mut sums = [Moments::ZERO; INTEGRALS];
    let mut squares = [0.0; INTEGRALS];
    let volume = (0.5 * side).powi(3);
    for center in centers(cell.center, 0.5 * side) {
        let values = sample(center).values;
        let cube = Moments::of_cube(center, 0.5 * side);
        for k in 0..INTEGRALS {
            sums[k] = sums[k] + cube * values[k];
            squares[k] += (values[k] * volume).powi(2);
        }
    }
    let variance = |k: usize| (squares[k] - sums[k].volume.powi(2) / EIGHTHS as f64).max(0.0);
    (sums, std::array::from_fn(variance))
}

/// The centres of the eighths of the cell around `center`, with sides of `side`.
fn centers(center: Point3<f64>, side: f64) -> impl Iterator<Item = Point3<f64>> {
    let toward = move |bit: usize| if bit == 0 { -0.5 * side } else { 0.5 * side };
    (0..EIGHTHS).map(move |n| center + Vector3::new(toward(n & 1), toward(n >> 1 & 1), toward(n >> 2 & 1)))
}

/// Whether a triangle may pass through a cube: neither its box nor its plane lies clear of it.
fn passes(corners: &[Point3<f64>; 3], center: Point3<f64>, half: f64) -> bool {
    let offsets = corners.map(|corner| corner - center);
    let is_clear = |axis: usize| {
        let [a, b, c] = offsets.map(|offset| offset[axis]);
        a.min(b).min(c) > half || a.max(b).max(c) < -half
    };
    if (0..3).any(is_clear) {
        return false;
    }
    let [a, b, c] = offsets;
    let normal = (b - a).cross(&(c - a));
    normal.dot(&a).abs() <= half * normal.abs().sum() * (1.0 + 1e-9)
}
