//! Grid to particles: velocity, APIC's affine velocity, the new position, and the deformation gradient.
//!
//! v = sum w v_i; C = (4/dx^2) sum w v_i (x_i - x_p)^T; x += dt v; F <- (I + dt C) F. C serves as the velocity
//! gradient, as in MLS-MPM. The sum x += dt v is compensated, as in
//! [`compensated_sum`](super::particles::compensated_sum).

use super::TASK;
use super::grid::{Columns, NODE};
use super::laws::Law;
use super::matrix::Mat3;
use super::p2g::{permuted, row_steps, row_weights};
use super::particles::Pack;
use super::sort::Sorted;
use super::stencil::Stencil;
use crate::parallel;
use crate::simd::{LANES, Lanes, LanesKernel, run_lanes};

/// Results of moving the particles.
#[derive(Debug, Clone, Copy)]
pub struct Moved {
    /// Largest component of any velocity, m/s.
    pub fastest_m_s: f32,
    /// First pack (in sorted order) with a particle that left the domain or is not finite.
    pub lost: Option<usize>,
}

/// The values shared by all packs.
#[derive(Clone, Copy)]
struct Context<'a> {
    columns: &'a Columns,
    nodes: &'a [f32],
    laws: &'a [Law],
    spacing_m: f32,
    dt_s: f32,
    /// Lowest and highest allowed position.
    domain_m: [[f32; 3]; 2],
}

/// Moves all particles with the grid's velocities.
pub fn gather(
    sorted: &mut Sorted,
    nodes: &[f32],
    laws: &[Law],
    spacing_m: f32,
    dt_s: f32,
    domain_m: [[f32; 3]; 2],
) -> Moved {
    let context = Context { columns: &sorted.columns, nodes, laws, spacing_m, dt_s, domain_m };
    let of_tasks = parallel::map_chunks_mut(&mut sorted.packs, TASK, |task, packs| {
        let moved = run_lanes(Task { packs, context });
        Moved { lost: moved.lost.map(|at| task * TASK + at), ..moved }
    });
    let none = Moved { fastest_m_s: 0.0, lost: None };
    of_tasks.into_iter().fold(none, |all, task| Moved {
        fastest_m_s: all.fastest_m_s.max(task.fastest_m_s),
        lost: all.lost.or(task.lost),
    })
}

/// The packs that one task moves.
struct Task<'a> {
    packs: &'a mut [Pack],
    context: Context<'a>,
}

impl LanesKernel for Task<'_> {
    type Output = Moved;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Moved {
        let mut fastest = L::splat(0.0);
        let mut lost = None;
        for (at, pack) in self.packs.iter_mut().enumerate() {
            let (speed, inside) = gather_pack::<L>(pack, self.context);
            fastest = fastest.max(speed);
            if !inside && lost.is_none() {
                lost = Some(at);
            }
        }
        let mut lanes = [0.0; LANES];
        fastest.store(&mut lanes);
        Moved { fastest_m_s: lanes.into_iter().fold(0.0, f32::max), lost }
    }
}

/// Moves a pack; returns its fastest velocity component per lane, and true if all positions are numbers inside the
/// domain.
#[inline(always)]
fn gather_pack<L: Lanes>(pack: &mut Pack, context: Context) -> (L, bool) {
    let Context { columns, spacing_m, dt_s, domain_m, .. } = context;
    let stencils = Stencil::<L>::of(&pack.position, 1.0 / spacing_m);
    let sums = sums::<L>(&stencils, context.nodes, columns, pack.live as usize);
    let velocity = [sums[0], sums[1], sums[2]];
    let mut affine = Mat3([velocity; 3]);
    let scale = L::splat(4.0 / spacing_m);
    for (position, &a) in columns.axes.iter().enumerate() {
        for r in 0..3 {
            let moment = sums[4 * (position + 1) + r];
            affine.0[r][a] = scale * (moment - stencils[a].offset * velocity[r]);
        }
    }
    let dt = L::splat(dt_s);
    let mut speed = L::splat(0.0);
    let mut inside = true;
    for a in 0..3 {
        velocity[a].store(&mut pack.velocity[a]);
        let position = L::load(&pack.position[a]);
        let by = dt.mul_add(velocity[a], L::load(&pack.compensation[a]));
        let moved = position + by;
        (by - (moved - position)).store(&mut pack.compensation[a]);
        moved.store(&mut pack.position[a]);
        // Not (low < x) also holds if x is NaN.
        let within = L::select(L::splat(domain_m[0][a]).less(moved), L::splat(1.0), L::splat(0.0));
        let within = L::select(moved.less(L::splat(domain_m[1][a])), within, L::splat(0.0));
        inside &= !L::any(within.less(L::splat(0.5)));
        speed = speed.max(velocity[a].abs());
    }
    affine.store(&mut pack.affine);
    affine.step(dt, Mat3::load(&pack.elastic)).store(&mut pack.elastic);
    if context.laws[pack.law as usize].is_plastic() {
        affine.step(dt, Mat3::load(&pack.deformation)).store(&mut pack.deformation);
    }
    (speed, inside)
}

/// Sixteen sums per particle, four components (x, y, z and mass) each: of w v_i, and of w v_i times the node's number
/// (0, 1, 2) along each of the grid's axes.
#[inline(always)]
fn sums<L: Lanes>(stencils: &[Stencil<L>; 3], nodes: &[f32], columns: &Columns, live: usize) -> [L; 16] {
    let [si, sj, sk] = permuted(stencils, columns.axes);
    let (ci, cj, ck) = (si.cells(), sj.cells(), sk.cells());
    let (wi, wj, wk) = (si.weights(), sj.weights(), sk.weights());
    let steps = row_steps::<L>();
    let zero = L::splat(0.0);
    let (mut value_and_i, mut j_and_k) = ([zero; LANES], [zero; LANES]);
    for p in 0..live {
        let weight = row_weights::<L>(&wk, p);
        let moment = [steps[0] * weight[0], steps[1] * weight[1]];
        let mut column = (ci[p] - columns.first[0]) as usize * columns.count[1] + (cj[p] - columns.first[1]) as usize;
        let (mut sum, mut sum_i, mut sum_j, mut sum_k) = (zero, zero, zero, zero);
        for (i, wi) in wi.iter().enumerate() {
            let (mut plane, mut plane_j, mut plane_k) = (zero, zero, zero);
            let bases: &[i32] = &columns.base[column..column + 3];
            for j in 0..3 {
                let first = (bases[j] + ck[p]) as usize * NODE;
                let row = &nodes[first..first + 2 * LANES];
                let halves = row.as_chunks::<LANES>().0;
                let (low, high) = (L::load(&halves[0]), L::load(&halves[1]));
                let value = low.mul_add(weight[0], high * weight[1]);
                let value_k = low.mul_add(moment[0], high * moment[1]);
                let w = L::splat(wj[j][p]);
                plane = w.mul_add(value, plane);
                plane_k = w.mul_add(value_k, plane_k);
                if j > 0 {
                    plane_j = (w * L::splat(j as f32)).mul_add(value, plane_j);
                }
            }
            let w = L::splat(wi[p]);
            sum = w.mul_add(plane, sum);
            sum_j = w.mul_add(plane_j, sum_j);
            sum_k = w.mul_add(plane_k, sum_k);
            if i > 0 {
                sum_i = (w * L::splat(i as f32)).mul_add(plane, sum_i);
            }
            column += columns.count[1];
        }
        value_and_i[p] = L::fold(sum, sum_i);
        j_and_k[p] = L::fold(sum_j, sum_k);
    }
    let (a, b) = (L::transpose(value_and_i), L::transpose(j_and_k));
    [a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]
}
