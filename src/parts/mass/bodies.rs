//! The connected bodies of each part: four legs of a chair, two handles of a pot.
//!
//! A part may have small fragments where its wall is thin or its seam is ragged: fragments with less than [`BODY_SHARE`]
//! of the part are assigned to the part's largest body.

use crate::gaussians::Gaussians;
use crate::parallel;
use crate::parts::grid::surface::NONE;
use crate::parts::grid::{Grid, Interior};

/// A body has at least this share of its part's material.
const BODY_SHARE: f64 = 0.05;

/// A Gaussian belongs to a body if it is within this many cells of it: splats are soft.
const NEAR: usize = 3;

/// The bodies of all parts.
pub struct Bodies {
    /// Per cell: its body; [`NONE`] if it holds no material.
    pub of_cell: Vec<u32>,
    /// Per body: its label. Bodies of one label follow each other, in the order of their first cells.
    pub label: Vec<u32>,
}

impl Bodies {
    /// The bodies of the material in `interior`.
    pub fn of(interior: &Interior, label_count: usize) -> Self {
        let (fragments, of_cell) = fragments(interior);
        let mut whole = vec![0.0; label_count];
        let mut largest: Vec<Option<usize>> = vec![None; label_count];
        for (n, fragment) in fragments.iter().enumerate() {
            let label = fragment.label as usize;
            whole[label] += fragment.material;
            if largest[label].is_none_or(|other| fragment.material > fragments[other].material) {
                largest[label] = Some(n);
            }
        }
        let is_body = |n: usize| {
            let label = fragments[n].label as usize;
            largest[label] == Some(n) || fragments[n].material >= BODY_SHARE * whole[label]
        };
        let mut order: Vec<usize> = (0..fragments.len()).filter(|&n| is_body(n)).collect();
        order.sort_by_key(|&n| (fragments[n].label, n));
        let body_of_fragment: Vec<u32> = (0..fragments.len())
            .map(|n| if is_body(n) { n } else { largest[fragments[n].label as usize].unwrap_or(n) })
            .map(|n| order.iter().position(|&other| other == n).map_or(NONE, |body| body as u32))
            .collect();
        let of_cell = of_cell.into_iter().map(|n| if n == NONE { NONE } else { body_of_fragment[n as usize] });
        Self { of_cell: of_cell.collect(), label: order.iter().map(|&n| fragments[n].label).collect() }
    }

    /// For each body: its label, and its position among the bodies of that label.
    pub fn places(&self, label_count: usize) -> Vec<(usize, usize)> {
        let mut counts = vec![0; label_count];
        let place = |&label: &u32| {
            counts[label as usize] += 1;
            (label as usize, counts[label as usize] - 1)
        };
        self.label.iter().map(place).collect()
    }

    /// The number of Gaussians on each body: those of its label within [`NEAR`] of its cells. Gaussians near none count
    /// towards the first body of their label.
    pub fn gaussians(&self, gaussians: &Gaussians, part_index: &[u32], grid: &Grid) -> Vec<usize> {
        let first = |label: u32| self.label.iter().position(|&l| l == label).map(|body| body as u32);
        let alone = |label: u32| self.label.iter().filter(|&&l| l == label).count() < 2;
        let body_of = |i: usize| {
            let label = part_index[i];
            let cell = grid.cell_at(gaussians.center(i)).filter(|_| !alone(label));
            let is_of_label = |cell: &usize| self.label.get(self.of_cell[*cell] as usize) == Some(&label);
            let near = cell.and_then(|cell| (0..=NEAR).find_map(|reach| around(grid, cell, reach).find(is_of_label)));
            near.map_or_else(|| first(label), |cell| Some(self.of_cell[cell]))
        };
        let of_gaussian: Vec<Option<u32>> = parallel::map_range(part_index.len(), body_of);
        let mut counts = vec![0; self.label.len()];
        of_gaussian.into_iter().flatten().for_each(|body| counts[body as usize] += 1);
        counts
    }
}

/// A connected fragment of one label.
struct Fragment {
    label: u32,
    /// Volume of its material, in cells.
    material: f64,
}

/// The fragments in the order of their first cells, and the fragment of every cell.
fn fragments(interior: &Interior) -> (Vec<Fragment>, Vec<u32>) {
    let grid = &interior.grid;
    let mut of_cell = vec![NONE; grid.len()];
    let mut fragments = Vec::new();
    for (seed, label, _) in interior.filled() {
        if of_cell[seed] != NONE {
            continue;
        }
        let number = fragments.len() as u32;
        let mut fragment = Fragment { label, material: 0.0 };
        let mut open = vec![seed];
        of_cell[seed] = number;
        while let Some(cell) = open.pop() {
            fragment.material += f64::from(interior.fraction[cell]);
            for next in around(grid, cell, 1) {
                if of_cell[next] == NONE && interior.part[next] == label {
                    of_cell[next] = number;
                    open.push(next);
                }
            }
        }
        fragments.push(fragment);
    }
    (fragments, of_cell)
}

/// The cells at most `reach` away along every axis, itself included.
fn around(grid: &Grid, cell: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
    let (at, grid) = (grid.coords(cell), *grid);
    let span = |axis: usize| at[axis].saturating_sub(reach)..(at[axis] + reach + 1).min(grid.dims[axis]);
    let (xs, ys, zs) = (span(0), span(1), span(2));
    zs.flat_map(move |z| {
        let xs = xs.clone();
        ys.clone().flat_map(move |y| xs.clone().map(move |x| grid.index([x, y, z])))
    })
}
