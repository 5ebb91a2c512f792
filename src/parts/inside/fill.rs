//! Filling: the skin that the Gaussians form, and what lies within it (after PhysGaussian, Xie et al. 2024, section on
//! internal filling).
//!
//! The density of a cell is the sum of opacity times fall-off of the Gaussians there. Dense cells are the object's
//! skin; any other cell is inside if the rays from it along the axes meet skin. PhysGaussian requires this of six rays
//! and lets the user exclude one; here five of six suffice, since photos seldom show an underside. This method needs no
//! cameras. It fails for open hollows (a cup counts as full) and counts the Gaussians' own width, about a cell, as
//! material.

use crate::gaussians::Gaussians;
use crate::parts::grid::Grid;
use crate::parts::grid::splat_cells::splat;

/// Number of rays along the axes, out of six, that must meet skin.
const RAYS_NEEDED: u8 = 5;

/// Gaussians thinner than this many cells are widened to this size: if a skin of single flat Gaussians lies midway
/// between two rows of cell centres, 0.61 of its density is left there; with a smaller value it leaks.
const LEAST_DEVIATION: f64 = 0.5;

/// The cells inside the object: skin of at least `threshold` density and what it encloses.
pub fn fill(gaussians: &Gaussians, kept: &[bool], grid: &Grid, threshold: f64) -> Vec<bool> {
    let blocks = splat(
        gaussians,
        kept,
        grid,
        LEAST_DEVIATION,
        |cells| vec![0f32; cells.len()],
        |density, place, _, value| density[place] += value as f32,
    );
    let skin: Vec<bool> = blocks.into_iter().flatten().map(|density| f64::from(density) >= threshold).collect();
    let met = rays_met(grid, &skin);
    skin.iter().zip(&met).map(|(skin, met)| *skin || *met >= RAYS_NEEDED).collect()
}

/// Per cell: how many of the six rays along the axes meet skin beyond it.
fn rays_met(grid: &Grid, skin: &[bool]) -> Vec<u8> {
    let mut met = vec![0; skin.len()];
    for (axis, stride) in grid.strides().into_iter().enumerate() {
        for start in (0..skin.len()).filter(|&i| grid.coords(i)[axis] == 0) {
            let line = |step: usize| start + step * stride;
            let mut count = |steps: &mut dyn Iterator<Item = usize>| {
                let mut seen = false;
                for i in steps.map(line) {
                    met[i] += u8::from(seen);
                    seen |= skin[i];
                }
            };
            count(&mut (0..grid.dims[axis]));
            count(&mut (0..grid.dims[axis]).rev());
        }
    }
    met
}
