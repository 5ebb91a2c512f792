//! The cubic cells into which the space around the object is divided, and the part that fills each.

mod interior;
pub mod splat_cells;
pub mod surface;

use nalgebra::{Point3, Vector3};

pub use interior::{FILLING, Interior, OUTSIDE, VOID};

/// Empty cells kept around the object, so that its outside is connected and filters need no edge cases.
const MARGIN: usize = 3;
/// A box's shortest side is treated as at least this share of its longest.
const LEAST_SIDE: f64 = 1e-3;
/// Extent in scene units of a box around a single point: less than the distance between any two f32 positions, but
/// enough that the product of three such extents is not zero.
const LEAST_EXTENT: f64 = 1e-50;

/// Cubic cells aligned with the world's axes; x varies fastest, then y, then z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// The corner of cell (0,0,0) with the least coordinates, world frame, scene units.
    pub origin: Point3<f64>,
    /// Side of a cell, scene units.
    pub cell: f64,
    pub dims: [usize; 3],
}

impl Grid {
    /// A grid of about `cells` cells over the box from `low` to `high`, with a margin around it. A box without extent
    /// in some direction is widened a little, so that the cell size is never zero.
    pub fn around(low: Point3<f64>, high: Point3<f64>, cells: usize) -> Self {
        let extent = high - low;
        let least = extent.max().max(LEAST_EXTENT) * LEAST_SIDE;
        let extent = extent.map(|e| e.max(least));
        let cell = (extent.x * extent.y * extent.z / cells as f64).cbrt();
        let counts = extent.map(|e| (e / cell).ceil().max(1.0));
        let slack = (counts * cell - extent) / 2.0;
        Self {
            origin: low - slack - Vector3::repeat(MARGIN as f64 * cell),
            cell,
            dims: [counts.x, counts.y, counts.z].map(|n| n as usize + 2 * MARGIN),
        }
    }

    /// An upper bound on the number of cells of any grid [`around`](Self::around) a box, including its margin. A side
    /// of `n` cells becomes one of fewer than `n + 1 + 2 MARGIN`. The logarithm of the product of three such sides is
    /// convex in the logarithms of the `n`, so that it is largest for a box at the limit of flatness or of thinness.
    pub fn most_cells(cells: usize) -> usize {
        let sides = |n: [f64; 3]| n.iter().map(|n| n + 1.0 + 2.0 * MARGIN as f64).product::<f64>();
        let (cube, flat) = ((cells as f64).cbrt(), LEAST_SIDE.cbrt());
        let (long, short) = (cube / flat, cube * flat * flat);
        let plate = sides([long, long, short]);
        let (long, short) = (cube / (flat * flat), cube * flat);
        let rod = sides([long, short, short]);
        plate.max(rod) as usize
    }

    /// The grid whose cells are cubes of `side` of this grid's cells per side; the last ones extend beyond this grid.
    pub fn coarser(&self, side: usize) -> Self {
        Self { cell: self.cell * side as f64, dims: self.dims.map(|d| d.div_ceil(side)), ..*self }
    }

    pub fn len(&self) -> usize {
        self.dims.iter().product()
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Cells of one z layer.
    pub fn layer(&self) -> usize {
        self.dims[0] * self.dims[1]
    }

    /// The distance between neighbours along each axis in an array of cells.
    pub fn strides(&self) -> [usize; 3] {
        [1, self.dims[0], self.layer()]
    }

    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    pub fn coords(&self, index: usize) -> [usize; 3] {
        [index % self.dims[0], index / self.dims[0] % self.dims[1], index / self.layer()]
    }

    /// Centre of a cell, world frame, scene units.
    pub fn center(&self, coords: [usize; 3]) -> Point3<f64> {
        self.origin + Vector3::from(coords.map(|c| (c as f64 + 0.5) * self.cell))
    }

    /// The middle of the grid, world frame, scene units.
    pub fn middle(&self) -> Point3<f64> {
        self.origin + Vector3::from(self.dims.map(|d| 0.5 * d as f64 * self.cell))
    }

    /// Volume of a cell, scene units cubed.
    pub fn cell_volume(&self) -> f64 {
        self.cell.powi(3)
    }

    /// The cell that holds a point; `None` outside the grid.
    pub fn cell_at(&self, point: Point3<f64>) -> Option<usize> {
        let position = (point - self.origin) / self.cell;
        let mut coords = [0; 3];
        for axis in 0..3 {
            let c = position[axis].floor();
            if !(c >= 0.0 && c < self.dims[axis] as f64) {
                return None;
            }
            coords[axis] = c as usize;
        }
        Some(self.index(coords))
    }

    /// First and last cell along each axis whose centres lie between `low` and `high`; `None` if there are none.
    pub fn cells_between(&self, low: Point3<f64>, high: Point3<f64>) -> Option<[[usize; 2]; 3]> {
        let mut spans = [[0; 2]; 3];
        for axis in 0..3 {
            let first = ((low[axis] - self.origin[axis]) / self.cell - 0.5).ceil().max(0.0);
            let last = ((high[axis] - self.origin[axis]) / self.cell - 0.5).floor().min(self.dims[axis] as f64 - 1.0);
            if first.is_nan() || last.is_nan() || first > last {
                return None;
            }
            spans[axis] = [first as usize, last as usize];
        }
        Some(spans)
    }

    /// The six neighbours of a cell that exist.
    pub fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let (coords, dims, strides) = (self.coords(index), self.dims, self.strides());
        (0..3).flat_map(move |axis| {
            let below = (coords[axis] > 0).then(|| index - strides[axis]);
            let above = (coords[axis] + 1 < dims[axis]).then(|| index + strides[axis]);
            below.into_iter().chain(above)
        })
    }
}
