//! Quadratic B-splines: the three nodes per axis that a particle touches, and their weights.

use super::particles::Row;
use crate::simd::{LANES, Lanes};

/// The nodes that a pack's particles touch along one axis.
#[derive(Clone, Copy)]
pub struct Stencil<L> {
    /// Index of the first of the three nodes.
    pub base: L,
    /// Particle position minus that node, in cells: 0.5 to 1.5.
    pub offset: L,
    pub weight: [L; 3],
}

impl<L: Lanes> Stencil<L> {
    /// The stencils of particles at `position`, in metres.
    #[inline(always)]
    fn at(position: &Row, cells_per_m: f32) -> Self {
        let x = L::load(position) * L::splat(cells_per_m);
        let half = L::splat(0.5);
        let base = (x - half).floor();
        let offset = x - base;
        let (a, b, c) = (L::splat(1.5) - offset, offset - L::splat(1.0), offset - half);
        Self { base, offset, weight: [half * a * a, L::splat(0.75) - b * b, half * c * c] }
    }

    /// The stencils along x, y, z.
    #[inline(always)]
    pub fn of(position: &[Row; 3], cells_per_m: f32) -> [Self; 3] {
        let [x, y, z] = position;
        [Self::at(x, cells_per_m), Self::at(y, cells_per_m), Self::at(z, cells_per_m)]
    }

    /// The weights as rows in memory.
    #[inline(always)]
    pub fn weights(&self) -> [Row; 3] {
        let mut rows = [[0.0; LANES]; 3];
        for (row, weight) in rows.iter_mut().zip(self.weight) {
            weight.store(row);
        }
        rows
    }

    /// `base` as integers.
    #[inline(always)]
    pub fn cells(&self) -> [i32; LANES] {
        self.base.to_whole()
    }
}

/// First node of the stencil of one coordinate; the same rounding as `Stencil::at`.
pub fn base_cell(position_m: f32, cells_per_m: f32) -> i32 {
    (position_m * cells_per_m - 0.5).floor() as i32
}
