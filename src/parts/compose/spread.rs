//! How the cells of a part spread around a cell: a wire's along one direction, a sheet's along two. The variances give
//! the length of a stretch of wire or the area of a sheet; together with the number of cells, they give its
//! carved cross-section or thickness, whichever way it lies in the grid and however ragged carving left it.

use std::f64::consts::PI;

use nalgebra::{Matrix3, SymmetricEigen, U3, Vector3};

use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;

/// Variance of a cell's own extent along any direction, cells squared.
const OWN: f64 = 1.0 / 12.0;

/// The cells of one part around a cell. Lengths in cells.
pub struct Spread {
    count: f64,
    /// From the cell around which they are to their mean.
    pub offset: Vector3<f64>,
    principal: SymmetricEigen<f64, U3>,
    /// The axes in the order of rising variance.
    order: [usize; 3],
}

/// The cells of the parts, row by row along the grid's first axis, as stretches of one label: a row of a wall has two or three.
pub struct Rows<'a> {
    pub cells: &'a Labelled,
    stretches: Vec<Stretch>,
    /// By row, the index of its first stretch; at the end, the number of all.
    first: Vec<usize>,
}

/// Cells from `start` to before `end` of a row.
struct Stretch {
    start: i64,
    end: i64,
    label: u32,
}

impl<'a> Rows<'a> {
    pub fn of(cells: &'a Labelled) -> Self {
        let (mut stretches, mut first) = (Vec::new(), vec![0]);
        for row in cells.label.chunks(cells.grid.dims[0]) {
            let mut start = 0;
            for same in row.chunk_by(|a, b| a == b) {
                let end = start + same.len() as i64;
                if same[0] != NONE {
                    stretches.push(Stretch { start, end, label: same[0] });
                }
                start = end;
            }
            first.push(stretches.len());
        }
        Self { cells, stretches, first }
    }

    /// Of the cells of a row from `start` to before `end` that have this label: their number, the sum of their places, and that of the
    /// squares of these, which are counted from `origin`.
    fn sums(&self, row: usize, [start, end]: [i64; 2], origin: i64, label: u32) -> [i64; 3] {
        // The squares of the places below this one, from 0 on.
        let squares_below = |place: i64| (place - 1) * place * (2 * place - 1) / 6;
        let mut sums = [0; 3];
        for of in &self.stretches[self.first[row]..self.first[row + 1]] {
            let (from, to) = (of.start.max(start) - origin, of.end.min(end) - origin);
            if of.label == label && from < to {
                let n = to - from;
                sums[0] += n;
                sums[1] += n * (from + to - 1) / 2;
                sums[2] += squares_below(to) - squares_below(from);
            }
        }
        sums
    }

    /// The cells of the part of cell `i` at most `reach` cells away from it.
    pub fn around(&self, i: usize, reach: usize) -> Spread {
        let grid = &self.cells.grid;
        let (at, label) = (grid.coords(i), self.cells.label[i]);
        let span =
            |axis: usize, reach: usize| at[axis].saturating_sub(reach)..(at[axis] + reach + 1).min(grid.dims[axis]);
        let offset = |axis: usize, place: usize| place as i64 - at[axis] as i64;
        let (mut count, mut sum, mut squares) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for z in span(2, reach) {
            for y in span(1, reach) {
                let (dy, dz) = (offset(1, y), offset(2, z));
                let Some(left) = (reach * reach).checked_sub((dy * dy + dz * dz) as usize) else { continue };
                let row = span(0, left.isqrt());
                let row = [row.start as i64, row.end as i64];
                let sums = self.sums(y + grid.dims[1] * z, row, at[0] as i64, label);
                let [n, x, xx, y, z] = [sums[0], sums[1], sums[2], dy, dz].map(|integer: i64| integer as f64);
                count += n;
                sum += Vector3::new(x, n * y, n * z);
                squares += Matrix3::new(xx, x * y, x * z, x * y, n * y * y, n * y * z, x * z, n * y * z, n * z * z);
            }
        }
        let mean = sum / count;
        let principal = (squares / count - mean * mean.transpose()).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| principal.eigenvalues[a].total_cmp(&principal.eigenvalues[b]));
        Spread { count, offset: mean, principal, order }
    }
}

impl Spread {
    /// The direction in which they spread most.
    pub fn axis(&self) -> Vector3<f64> {
        self.direction(2)
    }

    /// The direction in which they spread least (0) to most (2), unit.
    pub fn direction(&self, rank: usize) -> Vector3<f64> {
        self.principal.eigenvectors.column(self.order[rank]).into_owned()
    }

    /// The variance along the direction in which they spread least (0) to most (2).
    pub fn variance(&self, rank: usize) -> f64 {
        self.principal.eigenvalues[self.order[rank]].max(0.0) + OWN
    }

    /// The thickness of a sheet: its cells over its area, which is that of the ellipse with the same variances. For half
    /// a disc, that area is 6 % too large, for a rectangle 5 %.
    pub fn thickness(&self) -> f64 {
        self.count / (4.0 * PI * (self.variance(1) * self.variance(2)).sqrt())
    }

    /// The cross-section of a wire: its cells over its length, which is that of the line with the same variance.
    pub fn section(&self) -> f64 {
        self.count / (12.0 * self.variance(2)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::parts::grid::Grid;
    use crate::parts::grid::surface::Surface;

    #[test]
    fn sums_of_a_row_are_those_of_its_cells() {
        let dims = [50, 2, 1];
        let grid = Grid { origin: Point3::origin(), cell: 1.0, dims };
        let label: Vec<u32> = (0..100).map(|x| [NONE, 1, 1, 2, 1][x * x % 7 % 5]).collect();
        let surface =
            Surface { cells: vec![], points: vec![], normals: vec![], areas: vec![], depth: vec![], nearest: vec![] };
        let cells = Labelled { grid, surface, label, seen: vec![] };
        let rows = Rows::of(&cells);
        for (row, of, [start, end]) in [(0, 1, [0, 50]), (1, 1, [3, 31]), (1, 2, [10, 50]), (0, 2, [7, 7])] {
            let origin = 20;
            let own = || (start..end).filter(|x| cells.label[50 * row + *x as usize] == of).map(|x| x - origin);
            let expected = [own().count() as i64, own().sum(), own().map(|x| x * x).sum()];
            assert_eq!(rows.sums(row, [start, end], origin, of), expected);
        }
    }
}
