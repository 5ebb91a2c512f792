//! Sorting: particles into slabs, within a slab by law, then by column and cell; and the grid that fits them.
//!
//! A counting sort, stable in the particles' numbers: the order depends only on the numbers and the positions. It is
//! redone only when some particle may have drifted by a cell, which takes tens of substeps at the CFL step. The packs
//! are rearranged in place, one quantity after the other, so that sorting needs little more memory than they take.

use std::array::{from_fn, from_mut, from_ref};
use std::ops::Range;

use super::grid::{Columns, DRIFT, NOTHING, SLAB};
use super::particles::{Pack, Particle};
use super::stencil::base_cell;
use crate::parallel;
use crate::simd::LANES;

/// Particles in the order in which the phases process them, and their grid.
#[derive(Debug, Clone, Default)]
pub struct Sorted {
    pub packs: Vec<Pack>,
    /// Per slab, its packs.
    pub slabs: Vec<Range<usize>>,
    pub columns: Columns,
}

/// Particles as packs, each of one law, numbered in the given order. Particles that are packed are freed piece by
/// piece.
pub fn packed(first: usize, mut particles: Vec<Particle>) -> Vec<Pack> {
    const CHUNKS: usize = 8;
    let chunk = particles.len().div_ceil(CHUNKS).max(1);
    let mut packs = Vec::with_capacity(particles.len().div_ceil(LANES));
    while let Some(last) = particles.len().checked_sub(1) {
        let start = last / chunk * chunk;
        let mut ids: Vec<u32> = (start as u32..particles.len() as u32).collect();
        let law = |id: &u32| particles[*id as usize].law;
        ids.sort_by_key(law);
        for run in ids.chunk_by(|a, b| law(a) == law(b)) {
            let numbered = |&id: &u32| (first as u32 + id, particles[id as usize]);
            packs.extend(run.chunks(LANES).map(|ids| Pack::gather(ids.iter().map(numbered))));
        }
        particles.truncate(start);
        particles.shrink_to_fit();
    }
    packs
}

/// A particle's place before the sort, and the keys of its place after it.
#[derive(Clone, Copy, Default)]
struct Entry {
    /// Its pack, times [`LANES`], plus its lane.
    place: u32,
    /// First cell of its stencil, x y z.
    base: [i32; 3],
}

/// The particles of a pack after the sort.
struct Group {
    /// Index of its first particle in the new order.
    first: u32,
    live: u32,
    law: u32,
}

impl Sorted {
    /// Sorts all particles and builds their grid.
    pub fn sort(&mut self, laws: usize, cells_per_m: f32) {
        let packs = &self.packs;
        let mut entries = vec![Entry::default(); packs.iter().map(|pack| pack.live as usize).sum()];
        for (at, pack) in packs.iter().enumerate() {
            for lane in 0..pack.live as usize {
                let base = [0, 1, 2].map(|a| base_cell(pack.position[a][lane], cells_per_m));
                entries[pack.id[lane] as usize] = Entry { place: (at * LANES + lane) as u32, base };
            }
        }
        let axes = axes_by_extent(&entries);
        let columns = Columns::around(axes, entries.iter().map(|e| axes.map(|a| e.base[a])));
        let law = |e: &Entry| packs[e.place as usize / LANES].law;
        let mut order = order(&entries, &columns, laws, law);
        let key = |at: &u32| {
            let entry = &entries[*at as usize];
            (columns.slab_of(entry.base[axes[0]]), law(entry))
        };
        let mut groups: Vec<Group> = Vec::with_capacity(packs.len());
        let mut slabs = vec![0..0; columns.slabs()];
        let mut first = 0;
        for run in order.chunk_by(|a, b| key(a) == key(b)) {
            let (slab, law) = key(&run[0]);
            let before = groups.len();
            for chunk in run.chunks(LANES) {
                groups.push(Group { first, live: chunk.len() as u32, law });
                first += chunk.len() as u32;
            }
            let slab: &mut Range<usize> = &mut slabs[slab];
            *slab = if slab.end == 0 { before } else { slab.start }..groups.len();
        }
        for at in &mut order {
            *at = entries[*at as usize].place;
        }
        drop(entries);
        rearrange(&mut self.packs, &order, &groups);
        (self.slabs, self.columns) = (slabs, columns);
    }
}

/// Rearranges into packs the particles at `places`, divided into `groups`.
fn rearrange(packs: &mut Vec<Pack>, places: &[u32], groups: &[Group]) {
    let most = packs.len().max(groups.len());
    packs.reserve_exact(most - packs.len());
    packs.resize_with(most, Pack::empty);
    move_rows(packs, places, groups, |p| &p.position, |p| &mut p.position);
    move_rows(packs, places, groups, |p| &p.compensation, |p| &mut p.compensation);
    move_rows(packs, places, groups, |p| &p.velocity, |p| &mut p.velocity);
    move_rows(packs, places, groups, |p| &p.affine, |p| &mut p.affine);
    move_rows(packs, places, groups, |p| &p.elastic, |p| &mut p.elastic);
    move_rows(packs, places, groups, |p| &p.deformation, |p| &mut p.deformation);
    move_rows(packs, places, groups, |p| from_ref(&p.mass), |p| from_mut(&mut p.mass));
    move_rows(packs, places, groups, |p| from_ref(&p.volume), |p| from_mut(&mut p.volume));
    move_rows(packs, places, groups, |p| from_ref(&p.mu), |p| from_mut(&mut p.mu));
    move_rows(packs, places, groups, |p| from_ref(&p.lambda), |p| from_mut(&mut p.lambda));
    move_rows(packs, places, groups, |p| from_ref(&p.state), |p| from_mut(&mut p.state));
    move_rows(packs, places, groups, |p| from_ref(&p.id), |p| from_mut(&mut p.id));
    packs.truncate(groups.len());
    parallel::for_each_mut(packs, |n, pack| {
        let group = &groups[n];
        (pack.live, pack.law) = (group.live, group.law);
        pack.pad();
    });
}

/// [`rearrange`] for the `N` rows that `rows` and `rows_mut` return.
fn move_rows<T: Copy + Send + Sync, const N: usize>(
    packs: &mut [Pack],
    places: &[u32],
    groups: &[Group],
    rows: fn(&Pack) -> &[[T; LANES]; N],
    rows_mut: fn(&mut Pack) -> &mut [[T; LANES]; N],
) {
    let value = |&place: &u32| -> [T; N] {
        let rows = rows(&packs[place as usize / LANES]);
        from_fn(|r| rows[r][place as usize % LANES])
    };
    let values: Vec<[T; N]> = parallel::map(places, value);
    // There may be more packs than groups.
    parallel::for_each_mut(&mut packs[..groups.len()], |n, pack| {
        let group = &groups[n];
        let rows = rows_mut(pack);
        for (lane, value) in values[group.first as usize..][..group.live as usize].iter().enumerate() {
            for (row, value) in rows.iter_mut().zip(value) {
                row[lane] = *value;
            }
        }
    });
}

/// x, y, z by decreasing extent of the particles: slabs along the longest, columns along the shortest.
fn axes_by_extent(entries: &[Entry]) -> [usize; 3] {
    let extent = |a: usize| {
        let range = entries.iter().fold(NOTHING, |r, e| r.start.min(e.base[a])..r.end.max(e.base[a]));
        range.end.saturating_sub(range.start)
    };
    let mut axes = [0, 1, 2];
    axes.sort_by_key(|&a| std::cmp::Reverse(extent(a)));
    axes
}

/// Indices of `entries` by slab, law, column and cell. Neighbours in this order mostly touch the same nodes, so that a
/// node is passed from one to the next in the processor's store buffer.
fn order(entries: &[Entry], columns: &Columns, laws: usize, law: impl Fn(&Entry) -> u32) -> Vec<u32> {
    let [i, j, k] = columns.axes;
    let given: Vec<u32> = (0..entries.len() as u32).collect();
    let lowest = entries.iter().map(|e| e.base[k]).min().unwrap_or(0);
    let by_cell = counting_sort(&given, |at| (entries[at as usize].base[k] - lowest) as usize);
    let per_slab = SLAB * columns.count[1];
    counting_sort(&by_cell, |at| {
        let entry = &entries[at as usize];
        let within = (entry.base[i] - columns.first[0] - DRIFT) as usize % SLAB;
        let column = within * columns.count[1] + (entry.base[j] - columns.first[1]) as usize;
        (columns.slab_of(entry.base[i]) * laws + law(entry) as usize) * per_slab + column
    })
}

/// `items` by increasing key; equal keys keep their order.
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
