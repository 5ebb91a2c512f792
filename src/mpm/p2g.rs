//! Particles to grid: return map, stress, and the scatter of mass and momentum.
//!
//! MLS-MPM (Hu et al. 2018): node i receives mass w m and momentum w (m v + (m C - dt (4/dx^2) V0 tau) (x_i - x_p)),
//! with V0 the rest volume, tau the Kirchhoff stress and C APIC's affine velocity. The bracket is linear in the node's
//! place, so it is evaluated along a row of nodes by additions.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::ScopeFifo;

use super::grid::{Columns, NODE, SLAB};
use super::laws::{self, Law};
use super::matrix::{Mat3, dot};
use super::particles::{Pack, Row};
use super::sort::Sorted;
use super::stencil::Stencil;
use crate::simd::{LANES, Lanes, LanesKernel, run_lanes};

/// The values shared by all slabs.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    pub columns: &'a Columns,
    pub laws: &'a [Law],
    pub spacing_m: f32,
    pub dt_s: f32,
}

/// The planes of nodes of one slab: its particles touch these and those of the next slab.
struct Planes<'a> {
    nodes: &'a mut [f32],
    /// Number of nodes stored before `nodes`.
    before: usize,
}

/// One slab: its particles and the nodes to which they are added.
struct Slab<'a, 'n> {
    packs: &'a mut [Pack],
    planes: [&'a mut Planes<'n>; 2],
    /// Its first plane along the grid's first axis.
    first: i32,
    context: Context<'a>,
}

/// Clears the grid and adds all particles to it. Slabs of one parity share no node and run in parallel; an odd slab
/// follows as soon as its two neighbours are done. So every node sums its particles in the same order on any number of
/// threads.
pub fn scatter(sorted: &mut Sorted, nodes: &mut [f32], laws: &[Law], spacing_m: f32, dt_s: f32) {
    let Sorted { packs, slabs, columns } = sorted;
    let count = slabs.len();
    let order = Order {
        packs: cut(packs, (0..=count).map(|s| if s < count { slabs[s].len() } else { 0 })),
        planes: planes(columns, nodes, count),
        waits_for: (0..count).map(|s| AtomicUsize::new(if s + 1 < count { 2 } else { 1 })).collect(),
        context: Context { columns, laws, spacing_m, dt_s },
    };
    rayon::scope_fifo(|scope| {
        for slab in (0..count).step_by(2) {
            let order = &order;
            scope.spawn_fifo(move |scope| order.run(slab, scope));
        }
    });
}

/// The work for each slab. No lock is ever contended: the order guarantees it.
struct Order<'a> {
    packs: Vec<Mutex<&'a mut [Pack]>>,
    /// One more entry than slabs.
    planes: Vec<Mutex<Planes<'a>>>,
    /// Per slab, used for odd ones: the number of neighbours that are not done yet.
    waits_for: Vec<AtomicUsize>,
    context: Context<'a>,
}

impl Order<'_> {
    fn run<'s>(&'s self, slab: usize, scope: &ScopeFifo<'s>) {
        self.scatter(slab);
        if !slab.is_multiple_of(2) {
            return;
        }
        for odd in [slab.wrapping_sub(1), slab + 1] {
            let Some(waits_for) = self.waits_for.get(odd) else { continue };
            if waits_for.fetch_sub(1, Ordering::AcqRel) == 1 {
                scope.spawn_fifo(move |_| self.scatter(odd));
            }
        }
    }

    fn scatter(&self, slab: usize) {
        let locked = |planes: usize| self.planes[planes].lock().expect("no slab panicked");
        let (mut left, mut right) = (locked(slab), locked(slab + 1));
        // The even slabs run first, so they clear the planes.
        if slab.is_multiple_of(2) {
            left.nodes.fill(0.0);
        }
        if slab.is_multiple_of(2) || slab + 2 == self.planes.len() {
            right.nodes.fill(0.0);
        }
        let mut packs = self.packs[slab].lock().expect("no slab panicked");
        let first = self.context.columns.first[0] + (slab * SLAB) as i32;
        let planes = [&mut *left, &mut *right];
        run_lanes(Slab { packs: &mut packs, planes, first, context: self.context });
    }
}

/// The nodes, divided at every [`SLAB`]th plane.
fn planes<'a>(columns: &Columns, nodes: &'a mut [f32], slabs: usize) -> Vec<Mutex<Planes<'a>>> {
    let before = |planes: usize| columns.before_planes_of(planes);
    let slices = cut(nodes, (0..=slabs).map(|s| (before(s + 1) - before(s)) * NODE));
    let slice = |(s, nodes): (usize, Mutex<&'a mut [f32]>)| {
        Mutex::new(Planes { nodes: nodes.into_inner().expect("it was never locked"), before: before(s) })
    };
    slices.into_iter().enumerate().map(slice).collect()
}

/// Slices of the given lengths.
fn cut<T>(mut all: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<Mutex<&mut [T]>> {
    lengths
        .map(|length| {
            let (slice, rest) = std::mem::take(&mut all).split_at_mut(length);
            all = rest;
            Mutex::new(slice)
        })
        .collect()
}

impl LanesKernel for Slab<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        for pack in self.packs.iter_mut() {
            scatter_pack::<L>(pack, &mut self.planes, self.first, self.context);
        }
    }
}

#[inline(always)]
fn scatter_pack<L: Lanes>(pack: &mut Pack, planes: &mut [&mut Planes; 2], first_plane: i32, context: Context) {
    let Context { columns, spacing_m, dt_s, .. } = context;
    let stencils = Stencil::<L>::of(&pack.position, 1.0 / spacing_m);
    let linear = momentum::<L>(pack, &stencils, context.laws, spacing_m, dt_s, columns.axes);
    let [si, sj, sk] = permuted(&stencils, columns.axes);
    let (ci, cj, ck) = (si.cells(), sj.cells(), sk.cells());
    let mut weights_ij = [[0.0; LANES]; 9];
    for i in 0..3 {
        for j in 0..3 {
            (si.weight[i] * sj.weight[j]).store(&mut weights_ij[3 * i + j]);
        }
    }
    let weights_k = sk.weights();
    let steps = row_steps::<L>();
    for p in 0..pack.live as usize {
        let [constant, along_i, along_j, along_k] = linear.of(p);
        let weight = row_weights::<L>(&weights_k, p);
        let slope = [along_k * (steps[0] * weight[0]), along_k * (steps[1] * weight[1])];
        let mut column = (ci[p] - columns.first[0]) as usize * columns.count[1] + (cj[p] - columns.first[1]) as usize;
        let mut at_i = constant;
        for i in 0..3 {
            let mut at_j = at_i;
            let bases: &[i32] = &columns.base[column..column + 3];
            let Planes { nodes, before } = &mut *planes[usize::from(ci[p] + i as i32 - first_plane >= SLAB as i32)];
            for j in 0..3 {
                let first = (bases[j] + ck[p] - *before as i32) as usize * NODE;
                let row = &mut nodes[first..first + 2 * LANES];
                let weight_ij = L::splat(weights_ij[3 * i + j][p]);
                for (half, row) in row.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                    let value = at_j.mul_add(weight[half], slope[half]);
                    weight_ij.mul_add(value, L::load(row)).store(row);
                }
                at_j = at_j + along_j;
            }
            at_i = at_i + along_i;
            column += columns.count[1];
        }
    }
}

/// Weights along a column of particle `p`: those of its first and second node, each repeated for four floats; then that
/// of its third node, and zero for the fourth node of the row.
#[inline(always)]
pub fn row_weights<L: Lanes>(weights_k: &[Row; 3], p: usize) -> [L; 2] {
    let (a, b, c) = (weights_k[0][p], weights_k[1][p], weights_k[2][p]);
    [L::load(&[a, a, a, a, b, b, b, b]), L::load(&[c, c, c, c, 0.0, 0.0, 0.0, 0.0])]
}

/// Number of the node within the row, for each of its four floats.
#[inline(always)]
pub fn row_steps<L: Lanes>() -> [L; 2] {
    [L::load(&[0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]), L::load(&[2.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0])]
}

/// The stencils along the grid's axes.
#[inline(always)]
pub fn permuted<L: Lanes>(stencils: &[Stencil<L>; 3], axes: [usize; 3]) -> [Stencil<L>; 3] {
    [stencils[axes[0]], stencils[axes[1]], stencils[axes[2]]]
}

/// Mass and momentum as a linear function of the node: the value at the stencil's first node, and its change per node
/// along each of the grid's axes. Four floats each: x, y, z and mass.
struct Linear<L> {
    /// Per particle: the value, then the change along i.
    value_and_i: [L; LANES],
    /// Per particle: the change along j, then along k.
    j_and_k: [L; LANES],
}

impl<L: Lanes> Linear<L> {
    /// The values of particle `p`, each repeated twice.
    #[inline(always)]
    fn of(&self, p: usize) -> [L; 4] {
        let (a, b) = (self.value_and_i[p], self.j_and_k[p]);
        [a.twice_low(), a.twice_high(), b.twice_low(), b.twice_high()]
    }
}

#[inline(always)]
fn momentum<L: Lanes>(
    pack: &mut Pack,
    stencils: &[Stencil<L>; 3],
    laws: &[Law],
    spacing_m: f32,
    dt_s: f32,
    axes: [usize; 3],
) -> Linear<L> {
    let tau = laws::stress::<L>(pack, laws, dt_s).to_matrix();
    let mass = L::load(&pack.mass);
    let affine = Mat3::<L>::load(&pack.affine);
    // Everything per node instead of per metre: times dx.
    let inertia = mass * L::splat(spacing_m);
    let force = L::load(&pack.volume) * L::splat(-4.0 * dt_s / spacing_m);
    let mut per_node = affine;
    for r in 0..3 {
        for c in 0..3 {
            per_node.0[r][c] = affine.0[r][c].mul_add(inertia, tau.0[r][c] * force);
        }
    }
    let zero = L::splat(0.0);
    let offset = [stencils[0].offset, stencils[1].offset, stencils[2].offset];
    let mut value = [zero, zero, zero];
    for (r, value) in value.iter_mut().enumerate() {
        *value = mass.mul_add(L::load(&pack.velocity[r]), -dot(&offset, &per_node.0[r]));
    }
    let m = &per_node.0;
    let [i, j, k] = axes;
    Linear {
        value_and_i: L::transpose([value[0], value[1], value[2], mass, m[0][i], m[1][i], m[2][i], zero]),
        j_and_k: L::transpose([m[0][j], m[1][j], m[2][j], zero, m[0][k], m[1][k], m[2][k], zero]),
    }
}
