//! Sheets: walls seen from both sides, thinner than the soft surface of a splat and mostly thinner than a cell.
//!
//! Carving leaves a sheet a few cells thick, so its cells do not tell its thickness, which the answer gives, but they do
//! tell its area. Each cell holds the share of the wall in the carved thickness around it, so the sum over all cells is
//! area times wall, however thick the carved sheet is.
//!
//! The carved thickness is that of the cells around, see [`spread`](super::spread), not the length of a line through
//! the cell: in a layer one or two cells thick, such lengths are mostly noise from the grid, and any roughness would
//! count as area.

use std::sync::atomic::{AtomicU64, Ordering};

use super::spread::Rows;
use crate::parallel;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;

/// The cells around are those within the length of the ray through the sheet plus this many cells: a disc whose width is
/// at least twice its thickness spreads clearly less across than along.
const AROUND_CELLS: f64 = 2.0;

/// The carved thickness around each cell as far as it was measured. It depends on the labels of the cells alone, so an
/// object that is built in several forms is measured once.
pub struct Measured(Vec<AtomicU64>);

impl Measured {
    /// Nothing yet, of so many cells.
    pub fn nothing(cells: usize) -> Self {
        Self((0..cells).map(|_| AtomicU64::new(0)).collect())
    }

    /// That of the cells at most `reach` cells away from cell `i`, scene units.
    fn around(&self, rows: &Rows, i: usize, reach: u32) -> f32 {
        // A cell holds one reach and its thickness together, so whoever reads them finds what belongs together.
        let known = self.0[i].load(Ordering::Relaxed);
        if known >> 32 == u64::from(reach) {
            return f32::from_bits(known as u32);
        }
        let thickness = (rows.around(i, reach as usize).thickness() * rows.cells.grid.cell) as f32;
        self.0[i].store(u64::from(reach) << 32 | u64::from(thickness.to_bits()), Ordering::Relaxed);
        thickness
    }

    /// For each cell that belongs to a sheet, the carved thickness of the sheet around it, scene units; 0 for the others.
    /// `ray` gives the length of a ray through the sheet near a cell; `None` if there is none.
    pub fn thickness(&self, cells: &Labelled, ray: impl Fn(usize) -> Option<f64> + Sync) -> Vec<f32> {
        let rows = Rows::of(cells);
        let of_cell = |i: usize| {
            let Some(ray) = (cells.label[i] != NONE).then(|| ray(i)).flatten() else { return 0.0 };
            let reach = (ray / cells.grid.cell + AROUND_CELLS).ceil() as u32;
            self.around(&rows, i, reach)
        };
        parallel::map_range(cells.label.len(), of_cell)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::parts::grid::Grid;
    use crate::parts::grid::surface::Surface;

    #[test]
    fn what_was_measured_before_is_what_would_be_measured_now() {
        let grid = Grid { origin: Point3::origin(), cell: 0.5, dims: [30, 30, 4] };
        let label: Vec<u32> = (0..grid.len()).map(|i| if grid.coords(i)[2] < 2 { 0 } else { NONE }).collect();
        let surface =
            Surface { cells: vec![], points: vec![], normals: vec![], areas: vec![], depth: vec![], nearest: vec![] };
        let cells = Labelled { grid, surface, label, seen: vec![] };
        let measured = Measured::nothing(cells.label.len());
        let near = |i: usize| (!i.is_multiple_of(3)).then_some(1.0);
        let far = |i: usize| (!i.is_multiple_of(2)).then_some(3.0);
        // The second time each is known; the third time, some are known for another reach, and some not at all.
        for ray in [&near as &(dyn Fn(usize) -> Option<f64> + Sync), &near, &far, &near] {
            let fresh = Measured::nothing(cells.label.len()).thickness(&cells, ray);
            assert_eq!(measured.thickness(&cells, ray), fresh);
            let middle = cells.grid.index([15, 16, 0]);
            assert!(ray(middle).is_none() == (fresh[middle] == 0.0));
        }
    }
}
