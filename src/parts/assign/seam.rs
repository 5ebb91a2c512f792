//! Finds where parts meet inside the object, which no view shows. Two parts are taken to meet in the surface of least
//! area that spans their visible seam: flat between a lid and a cup, across the neck between a head and a handle.
//!
//! That surface is found by repeatedly diffusing every label a little and sharpening the shares again. This is a phase
//! field, whose interfaces move by their curvature (threshold dynamics, Merriman, Bence and Osher 1992, for several
//! phases; shares are sharpened rather than cut to one label, since with a hard cut, interfaces that bend by less than
//! a cell stick to the grid). It starts with coarse blocks of cells, so that seams can move far. A label's shares are
//! stored only in the box where they are not zero: sharpening cuts their tails off within a few blocks.

use std::collections::BTreeMap;

use super::region::Region;
use crate::parallel;
use crate::parts::grid::Grid;
use crate::parts::grid::surface::NONE;

/// Side of a block in cells, and number of rounds with blocks of that side. With [`RADIUS`] 2 a round is a time step of
/// 1, and a flat disc of radius R blocks forms in a time of about R^2 / 6: the coarse rounds are enough for 60 cells.
/// The fine rounds smooth the rest.
const SCHEDULE: [(usize, usize); 3] = [(4, 40), (2, 16), (1, 4)];
/// Half width of the diffusing box filter, in blocks.
const RADIUS: usize = 2;

/// Moves the seams between the labels of the cells so that their area becomes least. `label` is [`NONE`] outside; cells
/// with `fixed` keep their label.
pub fn shorten(grid: &Grid, label: &mut [u32], fixed: &[bool]) {
    for (side, rounds) in SCHEDULE {
        let mut blocks = Blocks::gather(grid, label, fixed, side);
        blocks.relax(rounds);
        blocks.scatter(grid, label, fixed);
    }
}

/// The cells grouped into cubes of `side` cells per side.
struct Blocks {
    side: usize,
    grid: Grid,
    /// The label of most fixed cells, or if there are none, of most cells; ties go to the first.
    label: Vec<u32>,
    /// Whether the label comes from fixed cells.
    fixed: Vec<bool>,
}

impl Blocks {
    fn gather(cells: &Grid, label: &[u32], fixed: &[bool], side: usize) -> Self {
        let grid = cells.coarser(side);
        let of_block = |block: usize| {
            let first = grid.coords(block).map(|c| c * side);
            let region = Region { first, end: std::array::from_fn(|axis| (first[axis] + side).min(cells.dims[axis])) };
            let inside = region.rows(cells).flat_map(|(_, at)| at).filter(|&cell| label[cell] != NONE);
            let is_fixed = inside.clone().any(|cell| fixed[cell]);
            let mut votes = BTreeMap::new();
            inside
                .filter(|&cell| !is_fixed || fixed[cell])
                .for_each(|cell| *votes.entry(label[cell]).or_insert(0) += 1);
            let most = votes.into_iter().rev().max_by_key(|(_, count)| *count);
            (most.map_or(NONE, |(label, _)| label), is_fixed)
        };
        let (label, fixed) = parallel::map_range(grid.len(), of_block).into_iter().unzip();
        Self { side, grid, label, fixed }
    }

    /// Diffuses and sharpens the labels' shares, then gives each block the label with the largest.
    fn relax(&mut self, rounds: usize) {
        let mut shares = self.shares();
        for _ in 0..rounds {
            let mut blurred: Vec<Share> = parallel::map(&shares, |share| share.blurred(&self.grid));
            // Squares divided by their sum: a share of one half stays, larger ones grow. The division also corrects for
            // what diffused outside.
            let sums = self.sums_of_squares(&blurred);
            let sharpened = parallel::map_mut(&mut blurred, |_, share| share.sharpened(self, &sums));
            shares = sharpened.into_iter().flatten().collect();
        }
        let mut largest = vec![0f32; self.label.len()];
        for share in shares {
            for (own, at) in share.region.rows(&self.grid) {
                for (value, i) in share.values[own].iter().zip(at) {
                    if *value > largest[i] && !self.fixed[i] {
                        (largest[i], self.label[i]) = (*value, share.label);
                    }
                }
            }
        }
    }

    /// The initial shares by label: each block belongs wholly to its label.
    fn shares(&self) -> Vec<Share> {
        let mut regions: BTreeMap<u32, Region> = BTreeMap::new();
        for (i, &label) in self.label.iter().enumerate().filter(|(_, label)| **label != NONE) {
            let at = self.grid.coords(i);
            regions.entry(label).or_insert_with(|| Region::of(at)).include(at);
        }
        let share = |(label, region): (u32, Region)| {
            let share_of = |i: usize| f32::from(u8::from(self.label[i] == label));
            Share { label, region, values: region.rows(&self.grid).flat_map(|(_, at)| at.map(share_of)).collect() }
        };
        regions.into_iter().map(share).collect()
    }

    fn sums_of_squares(&self, blurred: &[Share]) -> Vec<f32> {
        let mut sums = vec![0f32; self.label.len()];
        let layer = self.grid.layer();
        parallel::for_each_chunk_mut(&mut sums, layer, |z, sums| {
            for share in blurred {
                for start in share.region.starts_of_layer(z) {
                    let (own, at) = share.region.row(start, &self.grid);
                    let row = &mut sums[at.start - z * layer..at.end - z * layer];
                    row.iter_mut().zip(&share.values[own]).for_each(|(sum, value)| *sum += value * value);
                }
            }
        });
        sums
    }

    fn scatter(&self, cells: &Grid, label: &mut [u32], fixed: &[bool]) {
        parallel::for_each_mut(label, |cell, label| {
            if *label != NONE && !fixed[cell] {
                *label = self.label[self.grid.index(cells.coords(cell).map(|c| c / self.side))];
            }
        });
    }
}

/// One label's share of each block; zero beyond the region.
struct Share {
    label: u32,
    region: Region,
    values: Vec<f32>,
}

impl Share {
    fn blurred(&self, grid: &Grid) -> Self {
        let region = self.region.grown(RADIUS, grid);
        let values = box_sums(region.dims(), &self.on(region));
        Self { label: self.label, region, values }
    }

    /// Sharpens a blurred share and restricts it to the blocks where it is not zero; `None` if there are none.
    fn sharpened(&mut self, blocks: &Blocks, sums: &[f32]) -> Option<Self> {
        let mut needed: Option<Region> = None;
        for (own, at) in self.region.rows(&blocks.grid) {
            for (value, i) in self.values[own].iter_mut().zip(at) {
                *value = match blocks.label[i] {
                    NONE => 0.0,
                    label if blocks.fixed[i] => f32::from(u8::from(label == self.label)),
                    _ => *value * *value / sums[i],
                };
                if *value > 0.0 {
                    let at = blocks.grid.coords(i);
                    needed.get_or_insert(Region::of(at)).include(at);
                }
            }
        }
        needed.map(|region| Self { label: self.label, region, values: self.on(region) })
    }

    /// The values on another region: cropped, or padded with zeros.
    fn on(&self, region: Region) -> Vec<f32> {
        let mut values = vec![0.0; region.dims().iter().product()];
        let common = self.region.common(region);
        let width = common.dims()[0];
        for start in common.starts() {
            let row = &self.values[self.region.offset(start)..][..width];
            values[region.offset(start)..][..width].copy_from_slice(row);
        }
        values
    }
}

/// Sums over boxes of `2 RADIUS + 1` blocks per side, one axis after another; values beyond the grid are zero.
fn box_sums(dims: [usize; 3], values: &[f32]) -> Vec<f32> {
    let window = |at: usize, length: usize| at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(length);
    let mut along_x = vec![0f32; values.len()];
    parallel::for_each_chunk_mut(&mut along_x, dims[0], |line, sums| {
        let row = &values[line * dims[0]..][..dims[0]];
        for (x, sum) in sums.iter_mut().enumerate() {
            *sum = row[window(x, dims[0])].iter().sum();
        }
    });
    let mut values = along_x;
    for (stride, length) in [(dims[0], dims[1]), (dims[0] * dims[1], dims[2])] {
        let mut sums = vec![0f32; values.len()];
        parallel::for_each_chunk_mut(&mut sums, stride, |line, sums| {
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
