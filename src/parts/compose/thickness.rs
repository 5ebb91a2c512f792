//! Thickness of each part: the median, over its area, of the lengths of rays that go straight inward from its surface
//! until they leave the part.

use nalgebra::{Point3, Vector3};

use crate::parallel;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;
use crate::units::Estimate;

/// Ray steps per cell: ends are found to an eighth of a cell.
const STEPS_PER_CELL: f64 = 4.0;

/// A ray through a part.
#[derive(Debug, Clone, Copy)]
pub struct Chord {
    label: u32,
    /// Scene units.
    pub length: f64,
    /// Area of the surface cell it starts from, which is its weight.
    area: f64,
    /// Whether it ends at a seen surface, on which Gaussians lie.
    pub seen: bool,
    /// The surface cell at which it leaves the object; `None` if it ends at another part.
    pub exit: Option<u32>,
}

/// The ray from every cell of seen surface; `None` for other cells and cells without a normal.
pub fn chords(cells: &Labelled) -> Vec<Option<Chord>> {
    let count = cells.surface.cells.len();
    parallel::map_range(count, |s| if cells.seen[s] { chord(cells, s) } else { None })
}

/// Per label, the thickness between seen surfaces, scene units: median over area, quartiles as low and high. If no ray
/// ends at a seen surface, the rays to unseen ones are used. `None` if a part has no surface.
pub fn thickness(chords: &[Option<Chord>], label_count: usize) -> Vec<Option<Estimate>> {
    let mut of_label: Vec<[Vec<(f64, f64)>; 2]> = vec![Default::default(); label_count];
    for chord in chords.iter().flatten() {
        of_label[chord.label as usize][usize::from(chord.seen)].push((chord.length, chord.area));
    }
    let pick = |[unseen, seen]: [Vec<(f64, f64)>; 2]| quartiles(seen).or_else(|| quartiles(unseen));
    of_label.into_iter().map(pick).collect()
}

/// The ray from a surface cell straight inward; `None` if the cell has no normal.
pub fn chord(cells: &Labelled, s: usize) -> Option<Chord> {
    let surface = &cells.surface;
    let (start, inward) = (surface.points[s], -surface.normals[s]);
    if inward == Vector3::zeros() {
        return None;
    }
    let label = cells.label[surface.cells[s] as usize];
    let step = cells.grid.cell / STEPS_PER_CELL;
    let along = |steps: usize| -> Point3<f64> { start + inward * (steps as f64 * step) };
    let cell_after = |steps: usize| cells.grid.cell_at(along(steps));
    // The surface is up to a cell and a half away from the border of the cells, so the ray may start outside.
    let entry = (0..=8).find(|&n| cell_after(n).is_some_and(|i| cells.label[i] == label))?;
    let mut end = entry;
    let mut last = cell_after(entry)?;
    while let Some(cell) = cell_after(end + 1).filter(|&i| cells.label[i] == label) {
        last = cell;
        end += 1;
    }
    let leaves_object = cell_after(end + 1).is_none_or(|i| cells.label[i] == NONE);
    let exit = leaves_object.then_some(surface.nearest[last]);
    let seen = exit.is_some_and(|exit| cells.seen[exit as usize]);
    let length = (end as f64 + 0.5) * step;
    Some(Chord { label, length, area: surface.areas[s], seen, exit })
}

/// Quartiles of lengths weighted by area; `None` if there are none.
pub fn quartiles(mut chords: Vec<(f64, f64)>) -> Option<Estimate> {
    chords.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = chords.iter().map(|(_, area)| area).sum();
    let quantile = |share: f64| {
        let mut sum = 0.0;
        let reached = |(_, area): &&(f64, f64)| {
            sum += area;
            sum >= share * total
        };
        chords.iter().find(reached).map(|(length, _)| *length)
    };
    Some(Estimate::new(quantile(0.25)?, quantile(0.5)?, quantile(0.75)?))
}
