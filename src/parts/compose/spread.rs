//! How the cells of a part spread around a cell: a wire's along one direction, a sheet's along two. The variances give
//! the length of a stretch of wire or the area of a sheet; together with the number of cells, they give its
//! carved cross-section or thickness, whichever way it lies in the grid and however ragged carving left it.

use std::f64::consts::PI;

use nalgebra::{Matrix3, SymmetricEigen, U3, Vector3};

use crate::parts::assign::Labelled;

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

/// Of the cells of a row that have this label: their number, the sum of their places, and that of the squares of these. The first is at
/// `start`.
fn sums(row: &[u32], label: u32, start: i64) -> [i64; 3] {
    /// So short that no sum exceeds 32 bits, in which the compiler can vectorize the loop.
    const PIECE: usize = 1024;
    let mut sums = [0; 3];
    for (from, piece) in (start..).step_by(PIECE).zip(row.chunks(PIECE)) {
        let (mut n, mut x, mut xx) = (0_i32, 0_i32, 0_i32);
        for (dx, of) in (0..).zip(piece) {
            let own = i32::from(*of == label);
            (n, x, xx) = (n + own, x + own * dx, xx + own * dx * dx);
        }
        let [n, x, xx] = [n, x, xx].map(i64::from);
        sums = [sums[0] + n, sums[1] + x + from * n, sums[2] + xx + 2 * from * x + from * from * n];
    }
    sums
}

impl Spread {
    /// The cells of the part of cell `i` at most `reach` cells away from it.
    pub fn around(cells: &Labelled, i: usize, reach: usize) -> Self {
        let grid = &cells.grid;
        let at = grid.coords(i);
        let span =
            |axis: usize, reach: usize| at[axis].saturating_sub(reach)..(at[axis] + reach + 1).min(grid.dims[axis]);
        let offset = |axis: usize, place: usize| place as i64 - at[axis] as i64;
        let (mut count, mut sum, mut squares) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for z in span(2, reach) {
            for y in span(1, reach) {
                let (dy, dz) = (offset(1, y), offset(2, z));
                let Some(left) = (reach * reach).checked_sub((dy * dy + dz * dz) as usize) else { continue };
                let row = span(0, left.isqrt());
                let first = grid.index([row.start, y, z]);
                let [n, sum_x, sum_xx] =
                    sums(&cells.label[first..first + row.len()], cells.label[i], offset(0, row.start));
                let [n, x, xx, y, z] = [n, sum_x, sum_xx, dy, dz].map(|integer: i64| integer as f64);
                count += n;
                sum += Vector3::new(x, n * y, n * z);
                squares += Matrix3::new(xx, x * y, x * z, x * y, n * y * y, n * y * z, x * z, n * y * z, n * z * z);
            }
        }
        let mean = sum / count;
        let principal = (squares / count - mean * mean.transpose()).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| principal.eigenvalues[a].total_cmp(&principal.eigenvalues[b]));
        Self { count, offset: mean, principal, order }
    }

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
    use super::*;

    #[test]
    fn sums_of_long_rows_are_exact() {
        let row: Vec<u32> = (0..5000).map(|x| x * x % 7 % 3).collect();
        for start in [-2500, 3] {
            let own = || (start..).zip(&row).filter(|(_, label)| **label == 2).map(|(x, _)| x);
            let expected = [own().count() as i64, own().sum(), own().map(|x| x * x).sum()];
            assert_eq!(sums(&row, 2, start), expected);
        }
        assert_eq!(sums(&[], 2, 5), [0; 3]);
    }
}
