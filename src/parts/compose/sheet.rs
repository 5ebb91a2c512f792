//! Sheets: walls seen from both sides, thinner than the soft surface of a splat and mostly thinner than a cell.
//!
//! Carving leaves a sheet a few cells thick, so its cells do not tell its thickness, which the answer gives, but they do
//! tell its area. Each cell holds the share of the wall in the carved thickness around it, so the sum over all cells is
//! area times wall, however thick the carved sheet is.
//!
//! The carved thickness is that of the cells around, see [`spread`](super::spread), not the length of a line through
//! the cell: in a layer one or two cells thick, such lengths are mostly noise from the grid, and any roughness would
//! count as area.

use super::spread::Rows;
use crate::parallel;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;

/// The cells around are those within the length of the ray through the sheet plus this many cells: a disc whose width is
/// at least twice its thickness spreads clearly less across than along.
const AROUND_CELLS: f64 = 2.0;

/// For each cell that belongs to a sheet, the carved thickness of the sheet around it, scene units; 0 for the others.
/// `ray` gives the length of a ray through the sheet near a cell; `None` if there is none.
pub fn thickness(cells: &Labelled, ray: impl Fn(usize) -> Option<f64> + Sync) -> Vec<f32> {
    let rows = Rows::of(cells);
    let of_cell = |i: usize| {
        let Some(ray) = (cells.label[i] != NONE).then(|| ray(i)).flatten() else { return 0.0 };
        let reach = (ray / cells.grid.cell + AROUND_CELLS).ceil() as usize;
        (rows.around(i, reach).thickness() * cells.grid.cell) as f32
    };
    parallel::map_range(cells.label.len(), of_cell)
}
