//! Where an object touches the support.

use std::collections::BTreeSet;

use nalgebra::{Matrix2, Point2};

use super::{Cluster, Region, cell};

/// Height of the Gaussians that tell where an object touches the support, in thicknesses of the surface.
const FOOT: f64 = 2.0;
/// Side of a cell of the foot.
const FOOT_CELL: f64 = 1.0 / 400.0;
/// Standard deviations of a Gaussian that the foot covers.
const FOOT_DEVIATIONS: f64 = 1.5;
/// Gaps in the rim of a foot that are closed have up to twice this many cells (20 mm if the cameras are a metre away); the rim is
/// as wide.
const RIM_CELLS: usize = 4;
/// Most cells that the foot of one Gaussian covers along each axis, so that the time is bounded.
const MOST_FOOT_CELLS: i64 = 32;

/// Where an object touches the support: cells covered by its lowest Gaussians, and all that they enclose.
pub(super) struct Foot {
    /// The cell at the corner.
    corner: [i64; 2],
    size: [usize; 2],
    /// Row by row.
    cells: Vec<Standpoint>,
}

/// What a place is to a foot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standpoint {
    Beside,
    /// On the foot, close to its border.
    Rim,
    /// On the rest of it.
    Foot,
}

impl Foot {
    pub fn of(region: &Region, cluster: &Cluster) -> Self {
        let surface = &region.surface;
        let is_low = |i: &&usize| region.places[i].height <= (1.0 + FOOT) * surface.thickness;
        let mut covered = BTreeSet::new();
        for &i in cluster.indices.iter().filter(is_low) {
            let spread =
                surface.axes.transpose() * region.gaussians.covariance(i) * surface.axes / surface.unit.powi(2);
            cover(&region.places[&i].along, &spread, &mut covered);
        }
        let margin = RIM_CELLS as i64 + 1;
        let ends = |axis: usize| {
            let (low, high) =
                covered.iter().fold((i64::MAX, i64::MIN), |(low, high), at| (low.min(at[axis]), high.max(at[axis])));
            if low > high { (0, 0) } else { (low - margin, (high - low + 1 + 2 * margin) as usize) }
        };
        let ((left, width), (low, height)) = (ends(0), ends(1));
        let (corner, size) = ([left, low], [width, height]);
        let mut solid = Mask { size, cells: vec![false; width * height] };
        covered.iter().for_each(|at| solid.cells[(at[1] - low) as usize * width + (at[0] - left) as usize] = true);
        (0..RIM_CELLS).for_each(|_| solid.grow(true));
        solid.fill();
        (0..RIM_CELLS).for_each(|_| solid.grow(false));
        let mut inner = solid.clone();
        (0..RIM_CELLS).for_each(|_| inner.grow(false));
        let standpoint = |(covered, inner): (&bool, &bool)| match (covered, inner) {
            (_, true) => Standpoint::Foot,
            (true, false) => Standpoint::Rim,
            (false, false) => Standpoint::Beside,
        };
        Self { corner, size, cells: solid.cells.iter().zip(&inner.cells).map(standpoint).collect() }
    }

    pub fn at(&self, along: &Point2<f64>) -> Standpoint {
        let [x, y] = cell(along, FOOT_CELL);
        let [x, y] = [x - self.corner[0], y - self.corner[1]].map(|from| usize::try_from(from).unwrap_or(usize::MAX));
        let [width, height] = self.size;
        if x < width && y < height { self.cells[y * width + x] } else { Standpoint::Beside }
    }
}

/// Cells of the support, row by row. Those at the border are not covered.
#[derive(Clone)]
struct Mask {
    size: [usize; 2],
    cells: Vec<bool>,
}

impl Mask {
    /// Gives each cell the value if one of the four beside it has it.
    fn grow(&mut self, value: bool) {
        let before = self.cells.clone();
        let [width, height] = self.size;
        for y in 1..height.saturating_sub(1) {
            for x in 1..width.saturating_sub(1) {
                let at = y * width + x;
                if [at - 1, at + 1, at - width, at + width].iter().any(|beside| before[*beside] == value) {
                    self.cells[at] = value;
                }
            }
        }
    }

    /// Covers the cells from which no way leads to the border past the covered ones.
    fn fill(&mut self) {
        let [width, height] = self.size;
        let mut outside = vec![false; self.cells.len()];
        let mut open: Vec<[usize; 2]> = if self.cells.is_empty() { Vec::new() } else { vec![[0, 0]] };
        while let Some([x, y]) = open.pop() {
            let at = y * width + x;
            if std::mem::replace(&mut outside[at], true) || self.cells[at] {
                continue;
            }
            if x > 0 {
                open.push([x - 1, y]);
            }
            if x + 1 < width {
                open.push([x + 1, y]);
            }
            if y > 0 {
                open.push([x, y - 1]);
            }
            if y + 1 < height {
                open.push([x, y + 1]);
            }
        }
        self.cells.iter_mut().zip(outside).for_each(|(covered, outside)| *covered |= !outside);
    }
}

/// Adds the cells whose centres lie within [`FOOT_DEVIATIONS`] of a Gaussian seen from above, and the cell of its own centre.
fn cover(center: &Point2<f64>, spread: &Matrix2<f64>, covered: &mut BTreeSet<[i64; 2]>) {
    let side = FOOT_CELL;
    let [x, y] = cell(center, side);
    covered.insert([x, y]);
    let Some(inverse) = spread.try_inverse() else { return };
    let reach = |axis: usize| {
        let cells = (FOOT_DEVIATIONS * spread[(axis, axis)].max(0.0).sqrt() / side).ceil();
        (cells as i64).min(MOST_FOOT_CELLS)
    };
    for i in x - reach(0)..=x + reach(0) {
        for j in y - reach(1)..=y + reach(1) {
            let from_center = Point2::new(i as f64 + 0.5, j as f64 + 0.5) * side - center;
            if (from_center.transpose() * inverse * from_center)[0] <= FOOT_DEVIATIONS.powi(2) {
                covered.insert([i, j]);
            }
        }
    }
}
