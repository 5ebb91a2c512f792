//! From labelled cells to material: solids, walls, cores, fillings and voids, and the volume of each.
//!
//! A volume is known within bounds for three reasons, each varied by itself:
//! - the surface may lie further in or out by the splat's own uncertainty, so the volume of a solid or of a hollow may be
//!   off by area times uncertainty; beyond that, [`volume`] has spreads for errors that no rule covers;
//! - a shell's wall is between the answer's low and high thickness;
//! - for solids whose other side is unseen, see [`unseen`] and [`mirror`]; for the hidden walls of shells, see [`wall`].
//!
//! The volumes of a mesh are its own: see [`of_mesh`].
//!
//! The core of a shell fills the space that the wall leaves, see [`cores`]; so does a filling.

mod cavity;
mod contact;
mod cores;
mod mirror;
pub mod of_mesh;
pub mod sheet;
mod spread;
pub mod thickness;
mod unseen;
pub mod volume;
mod wall;
pub mod wire;

use super::assign::Labelled;
use super::grid::surface::NONE;
use super::grid::{FILLING, Interior, OUTSIDE, VOID};
use super::mass::moments::Moments;
use super::mass::unknowns::Effect;
use crate::parallel;
use crate::units::{Estimate, Reading};
use of_mesh::OfMesh;
use thickness::{Chord, thickness};
use unseen::Doubt;
use volume::{READINGS, SOLID_SPREAD, Volume, WALL_SPREAD};
use wall::{AROUND_CORE, AROUND_VOID, WallDepths};
use wire::Wire;

/// A ray through a shell goes through one wall, not two, if it is no longer than the wall plus this many uncertainties:
/// three on either side, the depth that carving tolerates. Carving thickens a wire by no more than that either.
const SHEET_SLACK: f64 = 6.0;

/// How a label's volume is filled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Construction {
    Solid,
    /// A wall of a thickness in scene units, and the share of the hollow behind it that a filling takes up.
    Wall {
        thickness: Estimate,
        filled: Option<Estimate>,
    },
}

impl Construction {
    /// Whether it gives all volumes that another one gives: how full the hollow is changes none of them.
    pub fn fills_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Wall { thickness, filled }, Self::Wall { thickness: of_other, filled: other }) => {
                thickness == of_other && filled.is_some() == other.is_some()
            }
            _ => self == other,
        }
    }
}

/// How well the surface of the cells is known.
pub struct Evidence {
    /// Possible error of the surface's position, scene units.
    pub uncertainty: f64,
    /// Per cell, the share of it that is material, if that was measured.
    pub wires: Vec<Wire>,
    /// Of the cells before one part goes through another.
    pub sheets: sheet::Measured,
    /// What the mesh says, if the object is one.
    pub mesh: Option<OfMesh>,
}

/// The object's inside, filled with material.
pub struct Composed {
    pub interior: Interior,
    /// Per label.
    pub volumes: Vec<Volume>,
    /// Per label, the moments of a wall so thin that the core in it takes all of its cells in `interior`.
    pub crowded_out: Vec<Option<Moments>>,
    /// Per label, the hollow behind the wall of a shell that holds a filling.
    pub hollows: Vec<Option<Hollow>>,
    /// Per label, the solid within this shell, if any.
    pub cores: Vec<Option<u32>>,
    /// Whether the object's unseen side is taken to be like the opposite one.
    pub is_mirrored: bool,
    /// Solids that go through other solids, each with the solid that it goes through.
    pub passages: Vec<(u32, u32)>,
}

/// A hollow that holds a filling.
#[derive(Debug, Clone, Copy)]
pub struct Hollow {
    pub volume: Volume,
    /// The moments of the hollow in the middle volume.
    pub moments: Moments,
}

/// Fills the cells. `constructions` are per label, `chords` per surface cell.
pub fn compose(
    mut cells: Labelled,
    constructions: &[Construction],
    chords: &[Option<Chord>],
    evidence: &Evidence,
) -> (Composed, Labelled) {
    let Evidence { uncertainty, wires, sheets, mesh } = evidence;
    let is_solid: Vec<bool> = constructions.iter().map(|c| *c == Construction::Solid).collect();
    let passages = cores::run_through(&mut cells, &is_solid, wires);
    let mut doubt = vec![Doubt::None; cells.label.len()];
    let mut is_mirrored = false;
    if mesh.is_none() {
        doubt = unseen::doubts(&cells, &unseen::thin(&thickness(chords, constructions.len()), &is_solid));
        is_mirrored = mirror::doubt_unlike_the_seen_side(&cells, &is_solid, &mut doubt);
    }
    let wall_of = |label: u32| match constructions[label as usize] {
        Construction::Solid => Estimate::exactly(0.0),
        Construction::Wall { thickness, .. } => thickness,
    };
    let sheet = |s: usize| {
        let wall = wall_of(cells.label[cells.surface.cells[s] as usize]).high;
        let soft = wall + SHEET_SLACK * uncertainty;
        chords[s].filter(|chord| chord.seen && chord.length <= soft).map(|chord| chord.length)
    };
    // Where a part goes through another, the cells are no longer those that were measured.
    let of_passages = (!passages.is_empty()).then(|| sheet::Measured::nothing(cells.label.len()));
    let measured = of_passages.as_ref().unwrap_or(sheets);
    let walls = WallDepths::of(&cells, |l| !is_solid[l as usize], sheet, measured);
    let is_void = |i: usize| f64::from(walls.seen[i]) > wall_of(cells.label[i]).mid;
    let is_material = |i: usize| doubt[i] < Doubt::Strong;
    let mut cores = cores::cores(&cells, &is_solid, is_void, is_material);
    for (core, construction) in cores.iter_mut().zip(constructions) {
        // What fills it is known.
        *core = core.filter(|_| !matches!(construction, Construction::Wall { filled: Some(_), .. }));
    }
    let contents = Contents { cells: &cells, constructions, cores: &cores, doubt: &doubt, walls: &walls, evidence };

    let slacks = contents.slacks(*uncertainty);
    let (own, hollow) = contents.readings();
    let mut enclosed = vec![0.0; constructions.len()];
    cells.label.iter().filter(|label| **label != NONE).for_each(|&l| enclosed[l as usize] += cells.grid.cell_volume());
    let volumes = contents.of_material(&own, &slacks, &enclosed);
    let interior = contents.interior();
    let composed = Composed {
        crowded_out: contents.crowded_out(&interior),
        hollows: contents.hollows(&hollow, &volumes, &slacks, &enclosed),
        volumes,
        interior,
        cores: cores.clone(),
        is_mirrored,
        passages: passages.into_iter().collect(),
    };
    (composed, cells)
}

/// The contents of each cell, for any reading (low, middle or high) of the walls and of what no view sees.
struct Contents<'a> {
    cells: &'a Labelled,
    constructions: &'a [Construction],
    cores: &'a [Option<u32>],
    doubt: &'a [Doubt],
    walls: &'a WallDepths,
    evidence: &'a Evidence,
}

/// The volume of a part's material, or of the space behind its wall, in each of the [`READINGS`]: scene units cubed.
type Readings = [f64; READINGS.len()];

impl Contents<'_> {
    /// The share of cell `i` that its own part fills, and the rest behind the wall of a shell.
    fn shares(&self, i: usize, wall: Reading, unseen: Reading) -> (f64, f64) {
        let label = self.cells.label[i] as usize;
        match self.constructions[label] {
            Construction::Solid => {
                let beyond = match unseen {
                    Reading::Low => Doubt::Slight,
                    Reading::Mid => Doubt::Strong,
                    Reading::High => Doubt::Empty,
                };
                let share = self.evidence.wires[i].share;
                let whole = if share > 0.0 { f64::from(share) } else { 1.0 };
                (if self.doubt[i] < beyond { whole } else { 0.0 }, 0.0)
            }
            Construction::Wall { thickness, .. } => {
                let hidden = if self.cores[label].is_some() { AROUND_CORE } else { AROUND_VOID };
                let (thickness, cell) = (wall.of(thickness), self.cells.grid.cell);
                if let Some(mesh) = &self.evidence.mesh {
                    return mesh.wall_shares(i, thickness, cell);
                }
                let (open, seam) = (unseen.of(hidden.unseen), unseen.of(hidden.seam));
                let own = self.walls.share(i, thickness, open, seam, cell);
                (own, 1.0 - own)
            }
        }
    }

    /// Per label, the volume of its material and that of the hollow behind its wall that no core fills.
    fn readings(&self) -> (Vec<Readings>, Vec<Readings>) {
        let grid = &self.cells.grid;
        let labels = self.constructions.len();
        let of_layer = |z: usize| {
            let mut sums = vec![[0.0; READINGS.len()]; 2 * labels];
            for i in (z * grid.layer()..(z + 1) * grid.layer()).filter(|&i| self.cells.label[i] != NONE) {
                let label = self.cells.label[i] as usize;
                let behind = self.cores[label].map_or(labels + label, |peg| peg as usize);
                for (k, (wall, unseen)) in READINGS.into_iter().enumerate() {
                    let (own, rest) = self.shares(i, wall, unseen);
                    sums[label][k] += own;
                    sums[behind][k] += rest;
                }
            }
            sums
        };
        let layers: Vec<_> = parallel::map_range(grid.dims[2], of_layer);
        let total = |l: usize| -> Readings {
            std::array::from_fn(|k| layers.iter().map(|layer| layer[l][k]).sum::<f64>() * grid.cell_volume())
        };
        let (mut own, mut hollow): (Vec<Readings>, Vec<Readings>) =
            ((0..labels).map(total).collect(), (labels..2 * labels).map(total).collect());
        if let Some(mesh) = &self.evidence.mesh {
            for (l, construction) in self.constructions.iter().enumerate() {
                own[l] = match construction {
                    Construction::Solid => own[l].map(|of_cells| mesh.solid(of_cells)),
                    Construction::Wall { thickness, .. } => READINGS.map(|(wall, _)| mesh.wall(l, wall.of(*thickness))),
                };
                hollow[l] = own[l].map(|wall| mesh.behind(l, wall));
            }
        }
        (own, hollow)
    }

    /// Per label, the volume of its material, of which the readings are `own`.
    fn of_material(&self, own: &[Readings], slacks: &[f64], enclosed: &[f64]) -> Vec<Volume> {
        let is_solid = |l: usize| self.constructions[l] == Construction::Solid;
        let volume = |l: usize| match (&self.evidence.mesh, is_solid(l)) {
            (None, true) => Volume::of(own[l], slacks[l], SOLID_SPREAD),
            (None, false) => Volume::of(own[l], 0.0, WALL_SPREAD).within(enclosed[l]),
            (Some(mesh), true) => Volume::measured(own[l], mesh.volume_effect),
            (Some(mesh), false) => Volume::measured(own[l], Effect::NONE).within(mesh.most(l)),
        };
        let mut volumes: Vec<Volume> = (0..own.len()).map(volume).collect();
        for core in (0..volumes.len()).filter(|&l| is_solid(l)) {
            let sleeves = (0..volumes.len()).filter(|&l| self.cores[l] == Some(core as u32)).map(|l| &volumes[l]);
            volumes[core] = volumes[core].behind(sleeves);
        }
        volumes
    }

    /// Per label, the volume that the uncertainty of the surface may add or remove, scene units cubed: that of the outer
    /// area, and for wires, whose width the photos show, that of their cross-section. Bodies that no view saw have no
    /// label.
    fn slacks(&self, uncertainty: f64) -> Vec<f64> {
        let mut slacks = vec![0.0; self.constructions.len()];
        let of_solid = |label: u32| self.constructions.get(label as usize) == Some(&Construction::Solid);
        let wires = &self.evidence.wires;
        let is_wire = |cell: usize| wires[cell].share > 0.0 && of_solid(self.cells.label[cell]);
        for (&cell, area) in self.cells.surface.cells.iter().zip(&self.cells.surface.areas) {
            let label = self.cells.label[cell as usize];
            if let Some(slack) = slacks.get_mut(label as usize).filter(|_| !is_wire(cell as usize)) {
                *slack += area * uncertainty;
            }
        }
        for cell in (0..wires.len()).filter(|&cell| is_wire(cell)) {
            let Wire { share, error } = wires[cell];
            slacks[self.cells.label[cell] as usize] += f64::from(share * error) * self.cells.grid.cell_volume();
        }
        slacks
    }

    /// Per label, the hollow that holds a filling. The surface in front of it may lie further in or out by its
    /// uncertainty, as that of a solid. `walls` are per label.
    fn hollows(
        &self,
        readings: &[Readings],
        walls: &[Volume],
        slacks: &[f64],
        enclosed: &[f64],
    ) -> Vec<Option<Hollow>> {
        let is_filled = |l: usize| matches!(self.constructions[l], Construction::Wall { filled: Some(_), .. });
        if !(0..readings.len()).any(is_filled) {
            return vec![None; readings.len()];
        }
        let cells = self.cells.label.iter().enumerate().filter(|(_, l)| **l != NONE && is_filled(**l as usize));
        let shares = cells.map(|(i, l)| (i, *l as usize, self.shares(i, Reading::Mid, Reading::Mid).1));
        let moments = Moments::of(&self.cells.grid, shares, readings.len());
        let hollow = |(l, moments): (usize, Option<Moments>)| {
            let volume = match &self.evidence.mesh {
                Some(mesh) => Volume::measured(readings[l], mesh.volume_effect),
                None => Volume::of(readings[l], slacks[l], SOLID_SPREAD),
            };
            let volume = volume.behind(std::iter::once(&walls[l]));
            let volume = volume.within(enclosed[l]);
            Some(Hollow { volume, moments: moments? })
        };
        moments.into_iter().enumerate().map(hollow).collect()
    }

    /// The middle reading cell by cell. A cell shared by a wall and its core goes entirely to the one that fills more
    /// of it; one shared by a wall and a filling holds the wall.
    fn interior(&self) -> Interior {
        let cell = |i: usize| {
            let label = self.cells.label[i];
            if label == NONE {
                return (OUTSIDE, 0.0);
            }
            let (own, rest) = self.shares(i, Reading::Mid, Reading::Mid);
            match (self.cores[label as usize], self.constructions[label as usize]) {
                (Some(peg), _) => (if own >= rest { label } else { peg }, 1.0),
                (None, _) if own > 0.0 => (label, own.min(1.0) as f32),
                (None, Construction::Solid) => (OUTSIDE, 0.0),
                (None, Construction::Wall { filled: Some(share), .. }) => (FILLING + label, share.mid as f32),
                (None, Construction::Wall { filled: None, .. }) => (VOID, 0.0),
            }
        };
        let (part, fraction) = parallel::map_range(self.cells.label.len(), cell).into_iter().unzip();
        Interior { grid: self.cells.grid, part, fraction }
    }

    /// Per label, the moments of a wall around a core that has no cell of `interior`.
    fn crowded_out(&self, interior: &Interior) -> Vec<Option<Moments>> {
        let mut is_out: Vec<bool> = self.cores.iter().map(Option::is_some).collect();
        interior.filled().for_each(|(_, label, _)| is_out[label as usize] = false);
        if !is_out.contains(&true) {
            return vec![None; is_out.len()];
        }
        let cells = self.cells.label.iter().enumerate().filter(|(_, l)| **l != NONE && is_out[**l as usize]);
        let shares = cells.map(|(i, l)| (i, *l as usize, self.shares(i, Reading::Mid, Reading::Mid).0));
        Moments::of(&self.cells.grid, shares, is_out.len())
    }
}
