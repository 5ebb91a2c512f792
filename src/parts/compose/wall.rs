//! Shells: a wall of known thickness along the surface, with nothing, a filling or another part behind it.
//!
//! A wall may be far thinner than a cell, so cells hold shares: the fraction of a cell that lies within the wall's
//! thickness of the surface, with the cell treated as a layer of its own width at its depth. Summed over cells, this
//! gives area times thickness for thin walls, and the true volume of the wall, including curvature, for thick ones.
//!
//! A wall seen from both sides, such as a lampshade's, is a sheet: it is as thick as the rays through it are long, or
//! thinner, since a splat is soft. It is counted once, not once from each side: see [`sheet`]. Faces toward a cavity that
//! the views see in part have no wall of their own: see [`cavity`].
//!
//! Along surfaces that no view saw, and along seams with other parts, a shell may be closed or open (a cup is open
//! under its lid, but closed on its coaster). The low volume assumes that it is open there, the high one closed, and
//! the middle one half closed.

use super::{cavity, sheet};
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::{NONE, distance_to};
use crate::units::Estimate;

/// The share of its hidden walls that a shell has, 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hidden {
    /// Along surfaces that no view saw.
    pub unseen: Estimate,
    /// Along seams with other parts.
    pub seam: Estimate,
}

/// A shell around a void may be open or closed where no view sees it.
pub const AROUND_VOID: Hidden = Hidden { unseen: Estimate::new(0.0, 0.5, 1.0), seam: Estimate::new(0.0, 0.5, 1.0) };
/// A shell around another part goes all the way round, and is open where that part enters.
pub const AROUND_CORE: Hidden = Hidden { unseen: Estimate::exactly(1.0), seam: Estimate::exactly(0.0) };

/// For every cell of a shell, its depth below seen and hidden walls, scene units; infinite where there are none.
pub struct WallDepths {
    pub seen: Vec<f32>,
    pub unseen: Vec<f32>,
    pub seam: Vec<f32>,
    /// Carved thickness of the sheet that the cell belongs to, scene units; 0 if it belongs to none.
    sheet: Vec<f32>,
}

impl WallDepths {
    /// Computes the depths in the cells of labels for which `is_shell` is true; they are infinite elsewhere. `sheet`
    /// gives, for a surface cell, the length of the ray through it if its wall is a sheet; `measured` is of these cells.
    pub fn of(
        cells: &Labelled,
        is_shell: impl Fn(u32) -> bool + Sync,
        sheet: impl Fn(usize) -> Option<f64>,
        measured: &sheet::Measured,
    ) -> Self {
        let mask: Vec<bool> = cells.label.iter().map(|&l| l != NONE && is_shell(l)).collect();
        let surface = &cells.surface;
        let (mut seen, mut unseen, mut seam) = (Seeds::default(), Seeds::default(), Seeds::default());
        let mut sheets = Vec::new();
        let in_cavity = cavity::faces(cells, &is_shell);
        let has_wall = |s: &usize| mask[surface.cells[*s] as usize] && !in_cavity[*s];
        for s in (0..surface.cells.len()).filter(has_wall) {
            let seeds = if cells.seen[s] { &mut seen } else { &mut unseen };
            seeds.push(surface.cells[s], surface.points[s]);
            if cells.seen[s] {
                sheets.push(sheet(s).unwrap_or(0.0) as f32);
            }
        }
        for i in (0..mask.len()).filter(|&i| mask[i]) {
            if let Some(other) = cells.grid.neighbours(i).find(|&n| cells.is_seam(i, n)) {
                let centers = [i, other].map(|c| cells.grid.center(cells.grid.coords(c)));
                seam.push(i as u32, nalgebra::center(&centers[0], &centers[1]));
            }
        }
        let (seen, nearest) = seen.depths(cells, &mask);
        // Cells that lie deeper than the ray is long belong to a hollow.
        let ray = |i: usize| match nearest[i] {
            NONE => None,
            seed => Some(f64::from(sheets[seed as usize])).filter(|ray| f64::from(seen[i]) <= *ray && *ray > 0.0),
        };
        let sheet = measured.thickness(cells, ray);
        Self { seen, unseen: unseen.depths(cells, &mask).0, seam: seam.depths(cells, &mask).0, sheet }
    }

    /// Share of cell `i` that is wall of this thickness, if the shares `unseen` and `seam` of the hidden walls exist.
    /// `cell` is its width.
    pub fn share(&self, i: usize, thickness: f64, unseen: f64, seam: f64, cell: f64) -> f64 {
        let below = |depths: &[f32]| within(f64::from(depths[i]), thickness, cell);
        if self.sheet[i] > 0.0 {
            return (thickness / f64::from(self.sheet[i])).min(1.0);
        }
        below(&self.seen).max(unseen * below(&self.unseen)).max(seam * below(&self.seam))
    }
}

#[derive(Default)]
struct Seeds {
    cells: Vec<u32>,
    points: Vec<nalgebra::Point3<f64>>,
}

impl Seeds {
    fn push(&mut self, cell: u32, point: nalgebra::Point3<f64>) {
        self.cells.push(cell);
        self.points.push(point);
    }

    /// Per cell, the distance to the nearest seed (infinite if there is none) and the index of that seed.
    fn depths(&self, cells: &Labelled, mask: &[bool]) -> (Vec<f32>, Vec<u32>) {
        let (mut depth, nearest) = distance_to(&cells.grid, mask, &self.cells, &self.points);
        for (depth, nearest) in depth.iter_mut().zip(&nearest) {
            if *nearest == NONE {
                *depth = f32::INFINITY;
            }
        }
        (depth, nearest)
    }
}

/// Share of a layer of width `cell` around `depth` that lies between 0 and `thickness`. The portion of the layer that
/// sticks out of the surface is folded back in, since the cells that hold it are not inside; the shares over all depths
/// then sum to `thickness`.
fn within(depth: f64, thickness: f64, cell: f64) -> f64 {
    let (low, high) = (depth - 0.5 * cell, depth + 0.5 * cell);
    let upright = (high.min(thickness) - low.max(0.0)).max(0.0);
    let folded = (-low).min(thickness).max(0.0);
    ((upright + folded) / cell).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::within;

    #[test]
    fn shares_over_all_depths_sum_to_the_thickness() {
        for thickness in [0.1, 0.5, 1.0, 3.7] {
            let step = 1e-3;
            let sum: f64 = (0..10_000).map(|n| within((f64::from(n) + 0.5) * step, thickness, 1.0) * step).sum();
            // The midpoint rule on a piecewise linear function, kinks off by at most one step.
            assert!((sum - thickness).abs() < 2e-3, "{sum} is not {thickness}");
        }
    }
}
