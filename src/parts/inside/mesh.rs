//! The inside of a mesh on a grid. The mesh says itself what is material, so nothing is carved and everything is seen.
//!
//! 1. Places spread over the surface tell which cells it passes through, and how much of it passes through each;
//! 2. four places in each of those cells, and the middles of others, tell the share of each cell that is material;
//! 3. the inside are the cells of which at least half is, and those that hold some while none beside them is half full: what is
//!    thinner than a cell.
//!
//! Of a sheet, which bounds nothing, and of a wall that is thinner than a cell, the inside are the cells that it passes through.

use nalgebra::{Point3, Vector3};

use crate::parallel;
use crate::parts::grid::Grid;
use crate::scene::mesh::solid::{Kind, Measured, SurfacePlace};

/// Places for each square of the surface that is as large as the side of a cell: with eight, a cell that the surface passes
/// through by a quarter of that is hit.
const PLACES_PER_SQUARE: f64 = 8.0;
/// And all together, whatever the mesh.
const MOST_PLACES: usize = 4_000_000;
/// The inside below a place on the surface is looked for up to this many half cells away.
const HALF_CELLS_BELOW: usize = 4;
/// Places at which the thickness is looked for: a part with a hundredth of the surface has a hundred.
const THICKNESS_PLACES: usize = 10_000;
/// Blocks of so many cells along each side that no closed surface passes through are material or not as a whole.
const BLOCK_CELLS: usize = 4;
/// A cell of which this share is material is inside.
const HALF: f32 = 0.5;

/// The cells of a grid that a mesh fills.
pub struct MeshOnGrid {
    /// Per cell, whether it is inside.
    pub cells: Vec<bool>,
    /// Per cell, the share of it that is material.
    pub share: Vec<f32>,
    /// Per inside cell, the area of the surface in it or right above it, scene units squared.
    pub area: Vec<f32>,
    /// Places on the surface, each for the same area.
    pub places: Vec<SurfacePlace>,
}

/// A grid of about `cells` cells around a mesh.
pub fn grid_around_mesh(mesh: &Measured, cells: usize) -> Grid {
    let (low, high) = mesh.bounds();
    Grid::around(low, high, cells)
}

/// Fills the grid.
pub fn fill(mesh: &Measured, grid: &Grid) -> MeshOnGrid {
    let squares = mesh.solid.shell.area / grid.cell.powi(2);
    let count = ((PLACES_PER_SQUARE * squares).ceil() as usize).clamp(1, MOST_PLACES);
    let points = mesh.points(count);
    let of_point = (mesh.solid.shell.area / count as f64) as f32;
    let area = summed(grid, of_point, points.iter().filter_map(|(point, _)| grid.cell_at(*point)));
    let passed = || area.iter().map(|area| *area > 0.0).collect();
    let (cells, share) = match mesh.solid.kind {
        Kind::Sheet => (passed(), vec![0.0; grid.len()]),
        Kind::Wall { thickness } if thickness.mid < grid.cell => {
            // Each of its two sides has half of it.
            let per_area = (0.5 * thickness.mid / grid.cell_volume()) as f32;
            (passed(), area.iter().map(|area| area * per_area).collect())
        }
        Kind::Solid | Kind::Wall { .. } | Kind::Open => {
            let share = shares(mesh, grid, &area);
            (inside(grid, &share), share)
        }
    };
    let below = points.iter().filter_map(|(point, outward)| inside_below(grid, &cells, *point, *outward));
    let area = summed(grid, of_point, below);
    MeshOnGrid { cells, share, area, places: mesh.places(THICKNESS_PLACES) }
}

/// Per cell, `of_each` for each time that it is among `cells`.
fn summed(grid: &Grid, of_each: f32, cells: impl Iterator<Item = usize>) -> Vec<f32> {
    let mut sums = vec![0.0; grid.len()];
    cells.for_each(|cell| sums[cell] += of_each);
    sums
}

/// The inside cell at a place of the surface, or the nearest one below it.
pub fn inside_below(grid: &Grid, inside: &[bool], point: Point3<f64>, outward: Vector3<f64>) -> Option<usize> {
    let below = (0..=HALF_CELLS_BELOW).map(|n| point - outward * (0.5 * n as f64 * grid.cell));
    below.filter_map(|place| grid.cell_at(place)).find(|cell| inside[*cell])
}

/// Per cell, the share that is material.
fn shares(mesh: &Measured, grid: &Grid, area: &[f32]) -> Vec<f32> {
    let (is_material, (low, high)) = (mesh.is_material(), mesh.bounds());
    // Several open layers together may wind around places that lie beside all of them.
    let is_in_box = |place: Point3<f64>| (0..3).all(|axis| (low[axis]..=high[axis]).contains(&place[axis]));
    let whole = |middle: Point3<f64>| f32::from(u8::from(is_in_box(middle) && is_material(middle)));
    let blocks = grid.coarser(BLOCK_CELLS);
    let block_of = |cell: usize| blocks.index(grid.coords(cell).map(|at| at / BLOCK_CELLS));
    // What is open may end anywhere.
    let mut is_mixed = vec![!mesh.solid.topology.is_watertight(); blocks.len()];
    (0..area.len()).filter(|cell| area[*cell] > 0.0).for_each(|cell| is_mixed[block_of(cell)] = true);
    let of_block = |block: usize| if is_mixed[block] { 0.0 } else { whole(blocks.center(blocks.coords(block))) };
    let in_block: Vec<f32> = parallel::map_range(blocks.len(), of_block);
    let of_cell = |cell: usize| {
        let (block, center) = (block_of(cell), grid.center(grid.coords(cell)));
        match (is_mixed[block], area[cell] > 0.0) {
            (false, _) => in_block[block],
            (true, false) => whole(center),
            (true, true) => {
                let sampled = sampled_places(grid.coords(cell)).map(|offset| is_material(center + offset * grid.cell));
                sampled.iter().filter(|is_in| **is_in).count() as f32 / sampled.len() as f32
            }
        }
    };
    parallel::map_range(grid.len(), of_cell)
}

/// Places in a cell, from its middle, in cells: four along each axis, in another order along each, so that each is alone
/// in its layer; from cell to cell they move by a quarter of their distance, so that a face along the cells is met evenly.
fn sampled_places([x, y, z]: [usize; 3]) -> [Vector3<f64>; 4] {
    const ORDERS: [[usize; 4]; 3] = [[0, 1, 2, 3], [1, 3, 0, 2], [2, 0, 3, 1]];
    let moves = [y + 2 * z, z + 2 * x, x + 2 * y].map(|n| n % 4);
    std::array::from_fn(|n| {
        let along = |axis: usize| (ORDERS[axis][n] as f64 + (moves[axis] as f64 + 0.5) / 4.0) / 4.0 - 0.5;
        Vector3::new(along(0), along(1), along(2))
    })
}

/// The cells that count as inside. The grid has a margin of empty cells.
fn inside(grid: &Grid, share: &[f32]) -> Vec<bool> {
    let [across, along, up] = grid.strides();
    let around = |cell: usize| {
        let corner = cell - up - along - across;
        (0..27).map(move |n| corner + n % 3 * across + n / 3 % 3 * along + n / 9 * up)
    };
    let is_inside = |cell: usize| match share[cell] {
        own if own >= HALF => true,
        own => own > 0.0 && !around(cell).any(|other| share[other] >= HALF),
    };
    parallel::map_range(grid.len(), is_inside)
}
