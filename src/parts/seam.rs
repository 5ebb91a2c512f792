//! Where two parts meet inside the object nobody sees. They are taken to meet in the surface of least area that spans
//! their visible seam: flat between a lid and a cup, across the neck between a head and a handle.
//!
//! Found by diffusing every label a little and giving each cell the strongest, again and again (threshold dynamics,
//! Merriman, Bence and Osher 1992, for several phases), first on coarse blocks of cells, so that seams can move far.

use rayon::prelude::*;

use super::surface::NONE;

/// Rounds on blocks of a side of so many cells. A round moves a seam of radius r by about 1/r blocks, a coarse block is
/// crossed by fewer; the finest round only smooths what the blocks left rough.
const SCHEDULE: [(usize, usize); 3] = [(4, 40), (2, 12), (1, 4)];
/// Half width of the box that diffuses, in blocks. Narrower boxes let seams stick to the grid.
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
        for _ in 0..rounds {
            if !blocks.diffuse_and_threshold() {
                break;
            }
        }
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

    /// One round; whether any label changed.
    fn diffuse_and_threshold(&mut self) -> bool {
        let heats: Vec<Vec<u32>> = (0..self.present.len() as u32)
            .into_par_iter()
            .map(|l| box_sums(self.dims, self.label.iter().map(|at| u32::from(*at == l)).collect()))
            .collect();
        let strongest = |i: usize| {
            let current = self.label[i];
            let best = (0..heats.len()).max_by_key(|&l| (heats[l][i], l as u32 == current)).unwrap_or(0);
            best as u32
        };
        let free = |i: &usize| self.label[*i] != NONE && !self.fixed[*i];
        let changes: Vec<(usize, u32)> = (0..self.label.len())
            .into_par_iter()
            .filter(free)
            .map(|i| (i, strongest(i)))
            .filter(|(i, l)| self.label[*i] != *l)
            .collect();
        for &(i, l) in &changes {
            self.label[i] = l;
        }
        !changes.is_empty()
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

/// Sums over boxes of `2 RADIUS + 1` blocks a side, one axis after another.
fn box_sums(dims: [usize; 3], mut values: Vec<u32>) -> Vec<u32> {
    let strides = [1, dims[0], dims[0] * dims[1]];
    for axis in 0..3 {
        let (stride, length) = (strides[axis], dims[axis]);
        let mut sums = vec![0; values.len()];
        for start in (0..values.len()).filter(|i| i / stride % length == 0) {
            let at = |step: usize| values[start + step * stride];
            let mut window: u32 = (0..RADIUS.min(length)).map(at).sum();
            for step in 0..length {
                window += if step + RADIUS < length { at(step + RADIUS) } else { 0 };
                window -= if step > RADIUS { at(step - RADIUS - 1) } else { 0 };
                sums[start + step * stride] = window;
            }
        }
        values = sums;
    }
    values
}
