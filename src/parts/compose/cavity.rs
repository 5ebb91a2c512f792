//! Cavities of shells that no view looks all the way into: the inside of a lampshade, seen through its upper opening.
//!
//! Carving ends where the views end, so such a cavity comes out too narrow: between the outer wall and the last lines
//! of sight, space remains that looks like material with a second wall around it. But a line that leads from a cavity
//! of a shell to its outside crosses one wall. So a face toward a cavity has no wall of its own if an outer face that a
//! view saw lies behind it, through the same part: the wall is there.

use nalgebra::Vector3;

use super::thickness::chord;
use crate::numeric::sphere_directions;
use crate::parallel;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;

/// Directions in which a face looks around, half of them outward. So few suffice, because cavities are wide.
const DIRECTIONS: usize = 32;
/// A face looks into a cavity if it sees its own part in at least this share of the directions in front of it, each
/// weighted by the cosine to its normal. Within a tube as long as wide it is 0.6 or more; in the bend of a banana, half
/// a ring as thick as its hole is wide, 0.3.
const ENCLOSED: f64 = 0.4;
/// A line of sight starts this many cells above the face: the surface is up to a cell and a half from its cells.
const START_CELLS: f64 = 2.5;

/// Per surface cell, whether it is a face of a shell toward a cavity, with the shell's outer wall behind it.
pub fn faces(cells: &Labelled, is_shell: impl Fn(u32) -> bool + Sync) -> Vec<bool> {
    let surface = &cells.surface;
    let directions: Vec<Vector3<f64>> = sphere_directions(DIRECTIONS).collect();
    let looks_in = |s: usize| {
        let label = cells.label[surface.cells[s] as usize];
        label != NONE && is_shell(label) && enclosed(cells, s, label, &directions) >= ENCLOSED
    };
    let enclosed: Vec<bool> = parallel::map_range(surface.cells.len(), looks_in);
    let outer_wall_behind = |s: usize| {
        let exit = chord(cells, s).and_then(|chord| chord.exit);
        exit.is_some_and(|exit| cells.seen[exit as usize] && !enclosed[exit as usize])
    };
    parallel::map_range(surface.cells.len(), |s| enclosed[s] && outer_wall_behind(s))
}

/// The share of the directions in front of a face in which it sees its own part, weighted by the cosine to its normal.
fn enclosed(cells: &Labelled, s: usize, label: u32, directions: &[Vector3<f64>]) -> f64 {
    let (normal, cell) = (cells.surface.normals[s], cells.grid.cell);
    let start = cells.surface.points[s] + normal * (START_CELLS * cell);
    let sees_own = |direction: &Vector3<f64>| {
        let places = (0..).map(|steps| cells.grid.cell_at(start + direction * (f64::from(steps) * cell)));
        places.map_while(|place| place).any(|place| cells.label[place] == label)
    };
    let (mut own, mut all) = (0.0, 0.0);
    for direction in directions {
        let cosine = direction.dot(&normal);
        if cosine > 0.0 {
            all += cosine;
            own += if sees_own(direction) { cosine } else { 0.0 };
        }
    }
    if all > 0.0 { own / all } else { 0.0 }
}
