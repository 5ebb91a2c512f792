//! How far the places around the object are from it.

use super::Solid;
use crate::numeric::hull::Hull;
use crate::parts::{Grid, OUTSIDE};

/// Per cell: distance to the nearest cell of the object, 0 within it, in scene units.
pub struct Clearance {
    grid: Grid,
    distance: Vec<f32>,
}

/// The space that a hull covers beyond the object.
#[derive(Debug, Clone, Copy)]
pub struct Overreach {
    /// The largest distance from the object, scene units, and the cell that has it.
    pub depth: f64,
    pub cell: usize,
}

impl Clearance {
    /// Two sweeps over the cells pass distances on to neighbours (Borgefors 1986): at most 13 % too long.
    pub fn of(solid: &Solid) -> Self {
        let grid = solid.grid;
        let mut distance: Vec<f32> =
            solid.part.iter().map(|part| if *part == OUTSIDE { f32::INFINITY } else { 0.0 }).collect();
        let [sx, sy, sz] = grid.strides().map(|stride| stride as isize);
        let before: Vec<(isize, f32)> = (0..27)
            .map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1])
            .map(|[x, y, z]| (x * sx + y * sy + z * sz, ((x * x + y * y + z * z) as f32).sqrt()))
            .filter(|(offset, _)| *offset < 0)
            .collect();
        let relax = |distance: &mut [f32], i: usize, sign: isize| {
            for (offset, length) in &before {
                let Some(beside) = i.checked_add_signed(sign * offset) else { continue };
                if let Some(known) = distance.get(beside) {
                    distance[i] = distance[i].min(known + length);
                }
            }
        };
        (0..distance.len()).for_each(|i| relax(&mut distance, i, 1));
        (0..distance.len()).rev().for_each(|i| relax(&mut distance, i, -1));
        let side = grid.cell as f32;
        distance.iter_mut().for_each(|d| *d *= side);
        Self { grid, distance }
    }

    /// The space that `hull` covers beyond the object.
    pub fn overreach(&self, hull: &Hull) -> Overreach {
        let planes = hull.bounds();
        let [low, high] = hull.extent();
        let mut overreach = Overreach { depth: 0.0, cell: 0 };
        let Some([xs, ys, zs]) = self.grid.cells_between(low, high) else { return overreach };
        for z in zs[0]..=zs[1] {
            for y in ys[0]..=ys[1] {
                let row = self.grid.center([0, y, z]);
                // Where the row is inside every plane.
                let (mut first, mut last) = (xs[0] as f64, xs[1] as f64);
                for (normal, distance) in &planes {
                    let slope = normal.x * self.grid.cell;
                    let left = distance - normal.dot(&row.coords);
                    if slope > 1e-12 {
                        last = last.min(left / slope);
                    } else if slope < -1e-12 {
                        first = first.max(left / slope);
                    } else if left < 0.0 {
                        last = -1.0;
                    }
                }
                let mut x = first.ceil();
                while x <= last {
                    let cell = self.grid.index([x as usize, y, z]);
                    let depth = f64::from(self.distance[cell]);
                    if depth > overreach.depth {
                        overreach = Overreach { depth, cell };
                    }
                    x += 1.0;
                }
            }
        }
        overreach
    }
}
