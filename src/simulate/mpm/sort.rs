//! Sorting: particles into slabs, inside a slab by law, then by column and cell; and the grid that fits them.
//!
//! Counting sort, stable: the order depends on nothing but the particles. It is redone only when some particle may have
//! drifted by a cell, which at the CFL step takes tens of substeps.

use std::ops::Range;

use rayon::prelude::*;

use super::grid::{Columns, DRIFT, NOTHING, SLAB};
use super::lanes::LANES;
use super::particles::{Pack, Particle};
use super::stencil::base_cell;

/// Particles in the order in which the phases go through them, and their grid.
#[derive(Debug, Clone, Default)]
pub struct Sorted {
    pub packs: Vec<Pack>,
    /// Per slab, its packs.
    pub slabs: Vec<Range<usize>>,
    pub columns: Columns,
}

/// Particles as packs, in the order given; a new pack where the law changes.
pub fn packed(particles: &[Particle]) -> Vec<Pack> {
    let mut packs = Vec::with_capacity(particles.len().div_ceil(LANES));
    let mut start = 0;
    for run in particles.chunk_by(|a, b| a.law == b.law) {
        for chunk in run.chunks(LANES) {
            packs.push(Pack::gather((start as u32..).zip(chunk.iter().copied())));
            start += chunk.len();
        }
    }
    packs
}

/// Where a particle is before the sort, and where it belongs.
struct Entry {
    pack: u32,
    lane: u32,
    law: u32,
    /// First cell of its stencil, x y z.
    base: [i32; 3],
}

/// Sorts all particles and lays out their grid.
pub fn sorted(packs: &[Pack], laws: usize, cells_per_m: f32) -> Sorted {
    let entries: Vec<Entry> = packs
        .par_iter()
        .enumerate()
        .flat_map_iter(|(p, pack)| {
            (0..pack.live as usize).map(move |lane| Entry {
                pack: p as u32,
                lane: lane as u32,
                law: pack.law,
                base: [0, 1, 2].map(|a| base_cell(pack.position[a][lane], cells_per_m)),
            })
        })
        .collect();
    let axes = axes_by_extent(&entries);
    let columns = Columns::around(axes, entries.iter().map(|e| axes.map(|a| e.base[a])));
    let order = order(&entries, &columns, laws);
    let key = |e: &Entry| (columns.slab_of(e.base[axes[0]]), e.law);
    let groups: Vec<&[u32]> = order
        .chunk_by(|a, b| key(&entries[*a as usize]) == key(&entries[*b as usize]))
        .flat_map(|group| group.chunks(LANES))
        .collect();
    let mut slabs = vec![0..0; columns.slabs()];
    for (at, group) in groups.iter().enumerate() {
        let slab: &mut Range<usize> = &mut slabs[key(&entries[group[0] as usize]).0];
        *slab = if slab.start == slab.end { at..at + 1 } else { slab.start..at + 1 };
    }
    let packs = groups
        .par_iter()
        .map(|group| {
            Pack::gather(group.iter().map(|&at| {
                let entry = &entries[at as usize];
                let pack = &packs[entry.pack as usize];
                (pack.id[entry.lane as usize], pack.particle(entry.lane as usize))
            }))
        })
        .collect();
    Sorted { packs, slabs, columns }
}

/// x, y, z by falling extent of the particles: slabs along the longest, columns along the shortest.
fn axes_by_extent(entries: &[Entry]) -> [usize; 3] {
    let extent = |a: usize| {
        let range = entries.iter().fold(NOTHING, |r, e| r.start.min(e.base[a])..r.end.max(e.base[a]));
        range.end.saturating_sub(range.start)
    };
    let mut axes = [0, 1, 2];
    axes.sort_by_key(|&a| std::cmp::Reverse(extent(a)));
    axes
}

/// Indices of `entries` by slab, law, column and cell. Neighbours in this order mostly touch the same nodes, so that a node
/// goes from one to the next in the processor's store buffer.
fn order(entries: &[Entry], columns: &Columns, laws: usize) -> Vec<u32> {
    let [i, j, k] = columns.axes;
    let given: Vec<u32> = (0..entries.len() as u32).collect();
    let lowest = entries.iter().map(|e| e.base[k]).min().unwrap_or(0);
    let by_cell = counting_sort(&given, |at| (entries[at as usize].base[k] - lowest) as usize);
    let per_slab = SLAB * columns.count[1];
    counting_sort(&by_cell, |at| {
        let entry = &entries[at as usize];
        let within = (entry.base[i] - columns.first[0] - DRIFT) as usize % SLAB;
        let column = within * columns.count[1] + (entry.base[j] - columns.first[1]) as usize;
        (columns.slab_of(entry.base[i]) * laws + entry.law as usize) * per_slab + column
    })
}

/// `items` by rising key, equal keys in their given order.
fn counting_sort(items: &[u32], key: impl Fn(u32) -> usize) -> Vec<u32> {
    let highest = items.iter().map(|&item| key(item)).max().unwrap_or(0);
    let mut next = vec![0_u32; highest + 2];
    for &item in items {
        next[key(item) + 1] += 1;
    }
    for k in 1..next.len() {
        next[k] += next[k - 1];
    }
    let mut sorted = vec![0; items.len()];
    for &item in items {
        let at = &mut next[key(item)];
        sorted[*at as usize] = item;
        *at += 1;
    }
    sorted
}
