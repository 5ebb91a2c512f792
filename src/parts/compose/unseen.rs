//! Estimates how far a solid reaches behind its seen surface if no view saw its other side.
//!
//! Carving leaves everything that no view looks through: the space under a chair's seat, between its aprons, stays
//! full. In such places a part is taken to have the thickness T that it has where both its sides were seen and it is
//! thin (T is the lower quartile: the median would include rays from rim to rim of a table top). So the cells of a
//! solid that lie deeper than T below every seen surface (or seam with another part) and are connected with an unseen
//! surface are left out of the middle volume. The actual depth is unknown: the low volume ends at T/2, the high one at
//! 3T/2, beyond which nothing remains.

use crate::parts::assign::Labelled;
use crate::parts::grid::surface::{NONE, distance_to};
use crate::units::Estimate;

/// The doubt about whether a cell is material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Doubt {
    /// In the low, middle and high volumes.
    None,
    /// In the middle and high volumes.
    Slight,
    /// In the high volume only.
    Strong,
    /// In none: removed.
    Empty,
}

/// Depths, in thicknesses of the part, beyond which a cell is in slight doubt, in strong doubt, or empty.
const DEPTHS: [(f64, Doubt); 3] = [(0.5, Doubt::Slight), (1.0, Doubt::Strong), (1.5, Doubt::Empty)];

/// The doubt of every cell of the solids. `thickness` is per label, scene units; `None` for labels that are to be left
/// unchanged.
pub fn doubts(cells: &Labelled, thickness: &[Option<f64>]) -> Vec<Doubt> {
    let depth = depth_below_seen(cells);
    let mut doubt = vec![Doubt::None; cells.label.len()];
    for (thicknesses, level) in DEPTHS {
        let deeper = |i: usize| {
            let part = cells.label[i];
            part != NONE && thickness[part as usize].is_some_and(|t| f64::from(depth[i]) > thicknesses * t)
        };
        for i in reached_from_unseen(cells, deeper) {
            doubt[i] = level;
        }
    }
    doubt
}

/// Per cell: distance to the nearest seen surface or seam between parts. If there is neither, all are equally deep.
fn depth_below_seen(cells: &Labelled) -> Vec<f32> {
    let surface = &cells.surface;
    let (mut seeds, mut points) = (Vec::new(), Vec::new());
    for s in (0..surface.cells.len()).filter(|&s| cells.seen[s]) {
        seeds.push(surface.cells[s]);
        points.push(surface.points[s]);
    }
    for i in (0..cells.label.len()).filter(|&i| cells.label[i] != NONE) {
        if let Some(other) = cells.grid.neighbours(i).find(|&n| cells.is_seam(i, n)) {
            let centers = [i, other].map(|c| cells.grid.center(cells.grid.coords(c)));
            seeds.push(i as u32);
            points.push(nalgebra::center(&centers[0], &centers[1]));
        }
    }
    let inside: Vec<bool> = cells.label.iter().map(|l| *l != NONE).collect();
    distance_to(&cells.grid, &inside, &seeds, &points).0
}

/// The cells for which `wanted` is true and that are connected, through such cells, with one on an unseen surface.
fn reached_from_unseen(cells: &Labelled, wanted: impl Fn(usize) -> bool) -> Vec<usize> {
    let surface = &cells.surface;
    let unseen = (0..surface.cells.len()).filter(|&s| !cells.seen[s]).map(|s| surface.cells[s] as usize);
    let mut open: Vec<usize> = unseen.filter(|&i| wanted(i)).collect();
    let mut reached = vec![false; cells.label.len()];
    open.iter().for_each(|&i| reached[i] = true);
    let mut all = Vec::new();
    while let Some(i) = open.pop() {
        all.push(i);
        for n in cells.grid.neighbours(i).filter(|&n| cells.label[n] == cells.label[i]) {
            if !reached[n] && wanted(n) {
                reached[n] = true;
                open.push(n);
            }
        }
    }
    all
}

/// The thickness of every solid, as [`doubts`] needs it: the lower quartile.
pub fn thin(thickness: &[Option<Estimate>], is_solid: &[bool]) -> Vec<Option<f64>> {
    thickness.iter().zip(is_solid).map(|(t, is_solid)| t.filter(|_| *is_solid).map(|t| t.low)).collect()
}
