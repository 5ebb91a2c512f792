//! From labelled cells to material: solids, walls, voids and cores, and the low, middle and high volume of each part.
//!
//! Rules for the bounds of the volumes, all taken at once:
//! - a solid's surface may lie further in or out by the splat's own uncertainty, so its volume may be off by area times
//!   uncertainty;
//! - for solids whose other side is unseen, see [`unseen`];
//! - a shell's wall is between the answer's low and high thickness; for its hidden walls, see [`wall`];
//! - the core of a shell fills the space that the wall leaves, see [`cores`];
//! - every bound is widened by [`METHOD_SPREAD`] for errors that these rules do not cover.

mod contact;
mod cores;
pub mod thickness;
mod unseen;
mod wall;

use rayon::prelude::*;

use super::assign::Labelled;
use super::grid::surface::NONE;
use super::grid::{Interior, OUTSIDE, VOID};
use crate::units::{Estimate, Reading};
use thickness::{Chord, thickness};
use unseen::Doubt;
use wall::{AROUND_CORE, AROUND_VOID, WallDepths};

/// A ray through a shell goes through one wall, not two, if it is no longer than the wall plus this many uncertainties:
/// three on either side, the depth that carving tolerates.
const SHEET_SLACK: f64 = 6.0;

/// Error of a part's volume beyond what the other rules cover, as a standard deviation of its logarithm: surfaces
/// dented by reflections, seams slightly off, edges rounded by the splat. Measured on the twelve visible parts of the
/// four scenes with ground truth.
const METHOD_SPREAD: f64 = 0.15;

/// How a label's volume is filled: solid, or a shell with a wall thickness in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Construction {
    Solid,
    Wall(Estimate),
}

/// The object's inside, filled with material.
pub struct Composed {
    pub interior: Interior,
    /// Per label, scene units cubed.
    pub volumes: Vec<Estimate>,
    /// Per label, the solid within this shell, if any.
    pub cores: Vec<Option<u32>>,
    /// Solids that go through other solids, each with the solid that it goes through.
    pub passages: Vec<(u32, u32)>,
}

/// Fills the cells. `constructions` are per label, `chords` per surface cell; `uncertainty` is the possible error of
/// the surface's position, scene units.
pub fn compose(
    mut cells: Labelled,
    constructions: &[Construction],
    chords: &[Option<Chord>],
    uncertainty: f64,
) -> (Composed, Labelled) {
    let is_solid: Vec<bool> = constructions.iter().map(|c| *c == Construction::Solid).collect();
    let passages = cores::run_through(&mut cells, &is_solid);
    let doubt = unseen::doubts(&cells, &unseen::thin(&thickness(chords, constructions.len()), &is_solid));
    let wall_of = |label: u32| match constructions[label as usize] {
        Construction::Solid => Estimate::exactly(0.0),
        Construction::Wall(wall) => wall,
    };
    let sheet = |s: usize| {
        let wall = wall_of(cells.label[cells.surface.cells[s] as usize]).high;
        let soft = wall + SHEET_SLACK * uncertainty;
        chords[s].filter(|chord| chord.seen && chord.length <= soft).map(|chord| chord.length)
    };
    let walls = WallDepths::of(&cells, |l| !is_solid[l as usize], sheet);
    let is_void = |i: usize| f64::from(walls.seen[i]) > wall_of(cells.label[i]).mid;
    let is_material = |i: usize| doubt[i] < Doubt::Strong;
    let cores = cores::cores(&cells, &is_solid, is_void, is_material);
    let filling = Filling { cells: &cells, constructions, cores: &cores, doubt: &doubt, walls: &walls };

    let areas = areas(&cells, constructions.len());
    let [low, mid, high] = [Reading::Low, Reading::Mid, Reading::High].map(|r| filling.volumes(r));
    let volumes = (0..constructions.len()).map(|l| {
        let slack = if is_solid[l] { areas[l] * uncertainty } else { 0.0 };
        let (least, most) = (low[l].min(mid[l]).min(high[l]), low[l].max(mid[l]).max(high[l]));
        widened(Estimate::new((least - slack).max(0.0), mid[l], most + slack))
    });
    let composed = Composed {
        volumes: volumes.collect(),
        interior: filling.interior(),
        cores: cores.clone(),
        passages: passages.into_iter().map(|(peg, through, _)| (peg, through)).collect(),
    };
    (composed, cells)
}

/// The contents of each cell, for any reading (low, middle or high).
struct Filling<'a> {
    cells: &'a Labelled,
    constructions: &'a [Construction],
    cores: &'a [Option<u32>],
    doubt: &'a [Doubt],
    walls: &'a WallDepths,
}

impl Filling<'_> {
    /// The share of cell `i` that its own part fills, and the share that the core of its part fills.
    fn shares(&self, i: usize, reading: Reading) -> (f64, f64) {
        let label = self.cells.label[i] as usize;
        match self.constructions[label] {
            Construction::Solid => {
                let beyond = match reading {
                    Reading::Low => Doubt::Slight,
                    Reading::Mid => Doubt::Strong,
                    Reading::High => Doubt::Empty,
                };
                (if self.doubt[i] < beyond { 1.0 } else { 0.0 }, 0.0)
            }
            Construction::Wall(wall) => {
                let hidden = if self.cores[label].is_some() { AROUND_CORE } else { AROUND_VOID };
                let (unseen, seam) = (reading.of(hidden.unseen), reading.of(hidden.seam));
                let own = self.walls.share(i, reading.of(wall), unseen, seam, self.cells.grid.cell);
                (own, if self.cores[label].is_some() { 1.0 - own } else { 0.0 })
            }
        }
    }

    /// Volume of every label.
    fn volumes(&self, reading: Reading) -> Vec<f64> {
        let grid = &self.cells.grid;
        let of_layer = |z: usize| {
            let mut shares = vec![0.0; self.constructions.len()];
            for i in (z * grid.layer()..(z + 1) * grid.layer()).filter(|&i| self.cells.label[i] != NONE) {
                let label = self.cells.label[i] as usize;
                let (own, core) = self.shares(i, reading);
                shares[label] += own;
                if let Some(peg) = self.cores[label] {
                    shares[peg as usize] += core;
                }
            }
            shares
        };
        let layers: Vec<Vec<f64>> = (0..grid.dims[2]).into_par_iter().map(of_layer).collect();
        let total = |l: usize| layers.iter().map(|layer| layer[l]).sum::<f64>() * grid.cell_volume();
        (0..self.constructions.len()).map(total).collect()
    }

    /// The middle reading cell by cell. A cell shared by a wall and its core goes entirely to the one that fills more
    /// of it.
    fn interior(&self) -> Interior {
        let cell = |i: usize| {
            let label = self.cells.label[i];
            if label == NONE {
                return (OUTSIDE, 0.0);
            }
            let (own, core) = self.shares(i, Reading::Mid);
            match self.cores[label as usize] {
                Some(peg) => (if own >= core { label } else { peg }, 1.0),
                None if own > 0.0 => (label, own as f32),
                None if self.constructions[label as usize] == Construction::Solid => (OUTSIDE, 0.0),
                None => (VOID, 0.0),
            }
        };
        let (part, fraction) = (0..self.cells.label.len()).into_par_iter().map(cell).unzip();
        Interior { grid: self.cells.grid, part, fraction }
    }
}

/// Moves the bounds out by [`METHOD_SPREAD`]. This error is independent of the known ones, so the squares of the
/// logarithms add up.
fn widened(volume: Estimate) -> Estimate {
    let out = |bound: f64| (bound / volume.mid).ln().hypot(METHOD_SPREAD).exp();
    if volume.mid > 0.0 {
        Estimate::new(volume.mid / out(volume.low), volume.mid, volume.mid * out(volume.high))
    } else {
        volume
    }
}

/// Outer area per label, scene units squared. Bodies that no view saw have no label.
fn areas(cells: &Labelled, labels: usize) -> Vec<f64> {
    let mut areas = vec![0.0; labels];
    for (&cell, area) in cells.surface.cells.iter().zip(&cells.surface.areas) {
        if let Some(sum) = areas.get_mut(cells.label[cell as usize] as usize) {
            *sum += area;
        }
    }
    areas
}
