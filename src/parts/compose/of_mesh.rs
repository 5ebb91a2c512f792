//! The volumes of a mesh: its own. The cells of the grid only divide them among the parts.
//!
//! - What a part that is solid fills is the share that is material of each of its cells, times the volume of the material in
//!   the whole mesh over that of all cells: together, the parts have the mesh's volume, and its interval.
//! - The wall of a shell that the mesh bounds only from outside has the volume area times thickness, with the area of the part's
//!   triangles and the thickness of the answer. Where the mesh has no surface, such as at an opening, it has no wall.
//! - If the mesh has both sides of a wall, the wall is what lies between them, whatever the answer says of its thickness.
//! - The same holds for a sheet, which bounds nothing.

use super::Construction;
use super::thickness::quartiles;
use crate::parts::assign::Labelled;
use crate::parts::grid::surface::NONE;
use crate::parts::inside::mesh::{MeshOnGrid, inside_below};
use crate::parts::mass::unknowns::Effect;
use crate::scene::mesh::solid::{Kind, Measured, SurfacePlace};
use crate::units::Estimate;

/// A mesh has both sides of a wall if what lies between them is at most this many times as thick as the thickest wall that the
/// answer allows. Answers about thicknesses that no picture shows, and the walls of scans, are off by a factor of two; what is
/// hollow is usually more than ten times as thick as its wall.
const BOTH_SIDES: f64 = 3.0;

/// How far the surface of a mesh is from that of the thing, as a share of the mesh's longest side: scans are no finer, whatever
/// their triangles. Among the scans for fitting (docs/parts.md), a wrench of 20 cm has 38 % less volume than its mass tells, which
/// is its area times 0.5 % of its length; no solid one is off by more.
const SURFACE_ERROR: f64 = 0.005;

/// What a mesh says of the parts into which its cells are divided.
pub struct OfMesh {
    /// Whether it bounds nothing.
    is_sheet: bool,
    /// Per cell, the area of the surface at it, scene units squared.
    area_at: Vec<f32>,
    /// The volume of the material over that of its cells.
    volume_factor: f64,
    /// Per label, the volume that the mesh encloses in its cells, scene units cubed.
    enclosed: Vec<f64>,
    /// The interval of that volume.
    pub volume_effect: Effect,
    /// Per label, the area of its surface, scene units squared.
    area: Vec<f64>,
    /// Per label, the thickness of the material behind its surface: median over area, quartiles as low and high; `None` if
    /// there is no material.
    thickness: Vec<Option<Estimate>>,
}

impl OfMesh {
    /// What the mesh says of `cells`, which are those of `on_grid`, with labels below `labels`.
    pub fn of(mesh: &Measured, on_grid: MeshOnGrid, cells: &Labelled, labels: usize) -> Self {
        let MeshOnGrid { cells: inside, share, area: area_at, places } = on_grid;
        let solid = &mesh.solid;
        let is_sheet = solid.kind == Kind::Sheet;
        let mut enclosed = vec![0.0; labels];
        for (label, share) in cells.label.iter().zip(&share).filter(|(label, _)| **label != NONE) {
            enclosed[*label as usize] += f64::from(*share) * cells.grid.cell_volume();
        }
        let of_place = solid.shell.area / places.len().max(1) as f64;
        let mut area = vec![0.0; labels];
        for (label, own) in cells.label.iter().zip(&area_at).filter(|(label, _)| **label != NONE) {
            area[*label as usize] += f64::from(*own);
        }
        // Where the mesh is open, what is near its border may have no inside below it.
        let found = ratio(solid.shell.area, area.iter().sum());
        area.iter_mut().for_each(|area| *area *= found);
        let mut depths: Vec<Vec<(f64, f64)>> = vec![Vec::new(); labels];
        for place in &places {
            let SurfacePlace { point, outward, thickness } = *place;
            let cell = inside_below(&cells.grid, &inside, point, outward.into_inner());
            let label = cell.map(|cell| cells.label[cell]).filter(|label| *label != NONE);
            if let (Some(label), Some(thickness)) = (label, thickness) {
                depths[label as usize].push((thickness, of_place));
            }
        }
        let volume_factor = ratio(solid.volume.mid, enclosed.iter().sum());
        Self {
            is_sheet,
            area_at,
            volume_factor,
            enclosed: enclosed.into_iter().map(|of_cells| of_cells * volume_factor).collect(),
            volume_effect: if is_sheet { Effect::NONE } else { volume_effect(mesh) },
            area,
            thickness: depths.into_iter().map(quartiles).collect(),
        }
    }

    /// The construction of a label, given that of its answer: if the mesh has both sides of its wall, all that lies between
    /// them is material.
    pub fn construction(&self, label: usize, answered: Construction) -> Construction {
        match answered {
            Construction::Wall { thickness, .. } if self.has_both_sides(label, thickness) => Construction::Solid,
            answered => answered,
        }
    }

    /// Whether the mesh has both sides of a label's wall, of this thickness by its answer.
    fn has_both_sides(&self, label: usize, wall: Estimate) -> bool {
        !self.is_sheet() && self.thickness[label].is_some_and(|between| between.mid <= BOTH_SIDES * wall.high)
    }

    /// A label's thickness, given that of its cells: no cell is thinner than itself, and a ray through the mesh does not stop
    /// at the next part.
    pub fn thickness(&self, label: usize, of_cells: Option<Estimate>) -> Option<Estimate> {
        match (self.thickness[label], of_cells) {
            (Some(own), Some(of_cells)) if of_cells.mid < own.mid => Some(of_cells),
            (own, of_cells) => own.or(of_cells),
        }
    }

    /// The volume of a solid, given that of its cells.
    pub fn solid(&self, of_cells: f64) -> f64 {
        of_cells * self.volume_factor
    }

    /// The volume of a label's wall of this thickness.
    pub fn wall(&self, label: usize, thickness: f64) -> f64 {
        (self.area[label] * thickness).min(self.most(label))
    }

    /// What a wall that takes up `wall` leaves of what the mesh encloses in a label's cells.
    pub fn behind(&self, label: usize, wall: f64) -> f64 {
        (self.enclosed[label] - wall).max(0.0)
    }

    /// The most that a wall of a label can fill.
    pub fn most(&self, label: usize) -> f64 {
        if self.is_sheet() { f64::INFINITY } else { self.enclosed[label] }
    }

    /// Whether the mesh bounds nothing.
    pub fn is_sheet(&self) -> bool {
        self.is_sheet
    }

    /// The shares of a cell that are wall of this thickness, and behind it. `cell` is its width.
    pub fn wall_shares(&self, i: usize, thickness: f64, cell: f64) -> (f64, f64) {
        let wall = f64::from(self.area_at[i]) * thickness / cell.powi(3);
        (wall, if self.is_sheet { 0.0 } else { (1.0 - wall).max(0.0) })
    }
}

/// The interval of a mesh's volume: by what is open or crosses itself, and by [`SURFACE_ERROR`].
fn volume_effect(mesh: &Measured) -> Effect {
    let (low, high) = mesh.bounds();
    let (volume, slack) = (mesh.solid.volume.mid, mesh.solid.shell.area * SURFACE_ERROR * (high - low).max());
    // The same factor up and down: a wall thinner than the error is not gone.
    let surface = if volume > 0.0 { (slack / volume).ln_1p() } else { 0.0 };
    let Effect { low, high } = Effect::of(mesh.solid.volume);
    Effect { low: -low.hypot(surface), high: high.hypot(surface) }
}

/// A ratio of what the mesh has to what its cells have; 1 if either has nothing.
fn ratio(of_mesh: f64, of_cells: f64) -> f64 {
    if of_mesh > 0.0 && of_cells > 0.0 { of_mesh / of_cells } else { 1.0 }
}
