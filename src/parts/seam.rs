//! Where two parts meet inside the object nobody sees. They are taken to meet in the surface of least area that spans
//! their visible seam: flat between a lid and a cup, across the neck between a head and a handle.
//!
//! Found by diffusing every label a little and sharpening the shares again, over and over: a phase field, whose interfaces
//! move by their curvature (threshold dynamics, Merriman, Bence and Osher 1992, for several phases; shares are sharpened
//! rather than cut to one label, since a hard cut lets interfaces that bend less than a cell stick to the grid). Coarse
//! blocks of cells first, so that seams can move far.

use rayon::prelude::*;

use super::surface::NONE;

/// Side of a block in cells, and rounds at that side. A round is a step of time 1 for [`RADIUS`] 2, and a flat disc of
/// radius R blocks forms in about R^2 / 6: the coarse rounds are enough for 60 cells. The fine ones smooth what is left.
const SCHEDULE: [(usize, usize); 3] = [(4, 40), (2, 16), (1, 4)];
/// Half width of the box that diffuses, in blocks.
const RADIUS: usize = 2;

/// Moves the seams between the labels of a grid of cells to least area. `label` is [`NONE`] outside; cells with `fixed`
/// keep their label.
pub fn shorten(dims: [usize; 3], label: &mut [u32], fixed: &[bool], label_count: usize) {
    let mut present = vec![false; label_count];
    label.iter().filter(|l| **l != NONE).for_each(|l| present[*l as usize] = true);
    let present: Vec<u32> = (0..label_count as u32).filter(|l| present[*l as usize]).collect();
    if present.len() < 2 {
        return;
    }
    for (side, rounds) in SCHEDULE {
        let mut blocks = Blocks::gather(dims, label, fixed, side, &present);
        blocks.relax(rounds);
        blocks.scatter(dims, label, fixed);
    }
}

/// The cells in cubes of `side` cells; labels by position in `present`.
struct Blocks<'a> {
    side: usize,
    dims: [usize; 3],
    present: &'a [u32],
    label: Vec<u32>,
    fixed: Vec<bool>,
}

impl<'a> Blocks<'a> {
    fn gather(cell_dims: [usize; 3], label: &[u32], fixed: &[bool], side: usize, present: &'a [u32]) -> Self {
        let dims = cell_dims.map(|d| d.div_ceil(side));
        let count = dims.iter().product();
        let mut votes = vec![0u16; count * present.len()];
        let mut fixed_votes = votes.clone();
        for (i, &l) in label.iter().enumerate().filter(|(_, l)| **l != NONE) {
            let known = present.binary_search(&l).expect("every label is among the present");
            let vote = block_of(cell_dims, dims, side, i) * present.len() + known;
            votes[vote] += 1;
            fixed_votes[vote] += u16::from(fixed[i]);
        }
        let pick = |votes: &[u16]| {
            let best = (0..votes.len()).rev().max_by_key(|&l| votes[l]).filter(|&l| votes[l] > 0);
            best.map_or(NONE, |l| l as u32)
        };
        let (mut of_block, mut is_fixed) = (vec![NONE; count], vec![false; count]);
        for (block, all) in votes.chunks_exact(present.len()).enumerate() {
            let seen = pick(&fixed_votes[block * present.len()..][..present.len()]);
            is_fixed[block] = seen != NONE;
            of_block[block] = if seen == NONE { pick(all) } else { seen };
        }
        Self { side, dims, present, label: of_block, fixed: is_fixed }
    }

    /// Diffuses and sharpens the labels' shares, then gives each block the label with the largest.
    fn relax(&mut self, rounds: usize) {
        let is = |l: usize| self.label.iter().map(|at| f32::from(u8::from(*at == l as u32))).collect::<Vec<f32>>();
        let mut shares: Vec<Vec<f32>> = (0..self.present.len()).map(is).collect();
        let free: Vec<usize> = (0..self.label.len()).filter(|&i| self.label[i] != NONE && !self.fixed[i]).collect();
        for _ in 0..rounds {
            let blurred: Vec<Vec<f32>> = shares.par_iter().map(|share| box_sums(self.dims, share)).collect();
            // Squares over their sum: a share of one half stays, larger ones grow. The sum also takes the outside out.
            let sums: Vec<f32> = free.par_iter().map(|&i| blurred.iter().map(|b| b[i] * b[i]).sum()).collect();
            shares.par_iter_mut().zip(&blurred).for_each(|(share, blurred)| {
                for (&i, sum) in free.iter().zip(&sums) {
                    share[i] = blurred[i] * blurred[i] / sum;
                }
            });
        }
        for i in free {
            let largest = (0..shares.len()).rev().max_by(|&a, &b| shares[a][i].total_cmp(&shares[b][i]));
            self.label[i] = largest.map_or(NONE, |l| l as u32);
        }
    }

    fn scatter(&self, cell_dims: [usize; 3], label: &mut [u32], fixed: &[bool]) {
        label.par_iter_mut().enumerate().for_each(|(i, l)| {
            if *l != NONE && !fixed[i] {
                *l = self.present[self.label[block_of(cell_dims, self.dims, self.side, i)] as usize];
            }
        });
    }
}

fn block_of(cell_dims: [usize; 3], dims: [usize; 3], side: usize, cell: usize) -> usize {
    let [w, h, _] = cell_dims;
    let [x, y, z] = [cell % w, cell / w % h, cell / (w * h)].map(|c| c / side);
    (z * dims[1] + y) * dims[0] + x
}

/// Sums over boxes of `2 RADIUS + 1` blocks a side, one axis after another; nothing lies beyond the grid.
fn box_sums(dims: [usize; 3], values: &[f32]) -> Vec<f32> {
    let window = |at: usize, length: usize| at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(length);
    let mut along_x = vec![0f32; values.len()];
    along_x.par_chunks_mut(dims[0]).zip(values.par_chunks(dims[0])).for_each(|(sums, row)| {
        for (x, sum) in sums.iter_mut().enumerate() {
            *sum = row[window(x, dims[0])].iter().sum();
        }
    });
    let mut values = along_x;
    for (stride, length) in [(dims[0], dims[1]), (dims[0] * dims[1], dims[2])] {
        let mut sums = vec![0f32; values.len()];
        sums.par_chunks_mut(stride).enumerate().for_each(|(line, sums)| {
            let (start, at) = (line / length * length, line % length);
            for other in window(at, length) {
                let row = &values[(start + other) * stride..][..stride];
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
            }
        });
        values = sums;
    }
    values
}
