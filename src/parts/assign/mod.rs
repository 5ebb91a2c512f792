//! Assigns each inside cell to a part.
//!
//! On the surface the Gaussians decide: a cell gets the label with the largest sum of opacity times fall-off there,
//! with distances measured in each Gaussian's own metric. Surface that no view saw belongs to the same part as the seen
//! surface around it. Below the surface nothing is seen; [`seam`] carries the labels inward.

mod bodies;
mod region;
mod seam;

use super::grid::Grid;
use super::grid::splat_cells::splat;
use super::grid::surface::{NONE, Surface, distance_to};
use crate::gaussians::Gaussians;
pub use bodies::keep_to_bodies;

/// A surface cell with less summed opacity than this counts as unseen and takes its label from the seen surface around
/// it.
const WEIGHT_MIN: f32 = 0.05;

/// Gaussians thinner than this many cells are widened to this size, so that they reach the surface cells beside their
/// own.
const LEAST_DEVIATION: f64 = 0.5;

/// The object's inside, divided into parts.
#[derive(Clone)]
pub struct Labelled {
    pub grid: Grid,
    pub surface: Surface,
    /// Per cell: its label; [`NONE`] outside.
    pub label: Vec<u32>,
    /// Per surface cell: whether a view saw it and Gaussians lie on it.
    pub seen: Vec<bool>,
}

impl Labelled {
    /// True if two neighbouring cells are inside and belong to different parts.
    pub fn is_seam(&self, a: usize, b: usize) -> bool {
        self.label[a] != NONE && self.label[b] != NONE && self.label[a] != self.label[b]
    }
}

/// The labels of the Gaussians.
#[derive(Clone, Copy)]
pub struct Labels<'a> {
    pub of_gaussian: &'a [u32],
    /// Per Gaussian: whether it is of the object.
    pub kept: &'a [bool],
    /// All are below.
    pub count: usize,
}

/// Gives every cell within `surface` the label of the `gaussians` there; `in_view` tells for each surface cell whether a
/// view saw it.
pub fn assign(gaussians: &Gaussians, labels: Labels, grid: Grid, surface: Surface, in_view: &[bool]) -> Labelled {
    let on_surface = surface_labels(gaussians, labels, &grid, &surface);
    let seen: Vec<bool> = on_surface.iter().zip(in_view).map(|(l, in_view)| *l != NONE && *in_view).collect();
    let on_surface = along_surface(&grid, &surface, &on_surface, &seen);
    let mut label: Vec<u32> =
        surface.nearest.iter().map(|n| if *n == NONE { NONE } else { on_surface[*n as usize] }).collect();
    let mut fixed = vec![false; grid.len()];
    surface.cells.iter().zip(&on_surface).for_each(|(cell, label)| fixed[*cell as usize] = *label != NONE);
    seam::shorten(&grid, &mut label, &fixed);
    Labelled { grid, surface, label, seen }
}

/// The labels of seen surface cells, and for each other surface cell that of the seen one nearest along the surface:
/// the underside of a seat belongs to the seat, however near the cushion above it is. [`NONE`] on bodies that no view
/// saw.
fn along_surface(grid: &Grid, surface: &Surface, on_surface: &[u32], seen: &[bool]) -> Vec<u32> {
    let known: Vec<usize> = (0..seen.len()).filter(|&s| seen[s]).collect();
    let seeds: Vec<u32> = known.iter().map(|&s| surface.cells[s]).collect();
    let points: Vec<_> = known.iter().map(|&s| surface.points[s]).collect();
    let mut skin = vec![false; grid.len()];
    surface.cells.iter().for_each(|&cell| skin[cell as usize] = true);
    let (_, nearest) = distance_to(grid, &skin, &seeds, &points);
    let of_cell = |&cell: &u32| match nearest[cell as usize] {
        NONE => NONE,
        known_at => on_surface[known[known_at as usize]],
    };
    surface.cells.iter().map(of_cell).collect()
}

/// Per surface cell, the label with the most weight among the Gaussians there; [`NONE`] if there is too little.
fn surface_labels(gaussians: &Gaussians, labels: Labels, grid: &Grid, surface: &Surface) -> Vec<u32> {
    let Labels { of_gaussian, kept, count } = labels;
    let mut slot = vec![NONE; grid.len()];
    for (s, &cell) in surface.cells.iter().enumerate() {
        slot[cell as usize] = s as u32;
    }
    struct Block<'a> {
        slot: &'a [u32],
        first: u32,
        weight: Vec<f32>,
    }
    let new_block = |cells: std::ops::Range<usize>| {
        let first = surface.cells.partition_point(|&c| (c as usize) < cells.start);
        let end = surface.cells.partition_point(|&c| (c as usize) < cells.end);
        Block { slot: &slot[cells], first: first as u32, weight: vec![0.0; (end - first) * count] }
    };
    let blocks = splat(gaussians, kept, grid, LEAST_DEVIATION, new_block, |block, place, gaussian, value| {
        if block.slot[place] != NONE {
            let row = (block.slot[place] - block.first) as usize;
            block.weight[row * count + of_gaussian[gaussian] as usize] += value as f32;
        }
    });
    let winner = |weights: &[f32]| {
        let first_best = (0..weights.len()).rev().max_by(|&a, &b| weights[a].total_cmp(&weights[b]));
        first_best.filter(|&best| weights[best] >= WEIGHT_MIN).map_or(NONE, |best| best as u32)
    };
    blocks.iter().flat_map(|block| block.weight.chunks_exact(count).map(winner)).collect()
}
