//! Rigid bodies on the grid: their particles scatter mass and momentum with the others, and gather the impulse that the
//! others, gravity and the ground gave to their nodes.
//!
//! At a node that only one body reaches, nothing changes the body's own motion but gravity: APIC's transfer reproduces
//! a rigid motion exactly. So the only particles of a body that take part, as the solver's guests, are those that may
//! share a node with something else before the next sort. A guest of mass m that scattered the velocity v and gathered
//! v' and C' gives its body the impulse m (v' - v - g dt), and, besides the moment of that impulse, the angular impulse
//! m dx^2/4 (axial(C') - 2 omega) of the momentum that it spread over its nodes (Jiang et al. 2015). The nodes' other
//! particles lose what it gains, so momentum and angular momentum are conserved. As seen from the grid, each of its
//! particles is spread out by dx^2/4 along every axis, which its inertia includes ([`spread_m2`]).

use std::collections::HashMap;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::body::{Body, Member};
use crate::simulate::mpm::particles::Motion;
use crate::simulate::mpm::{DRIFT, Gathered, Solver};

/// A particle of a body that takes part in the grid's substeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guest {
    pub body: u32,
    pub member: u32,
}

impl Guest {
    pub fn of(self, bodies: &[Body]) -> &Member {
        &bodies[self.body as usize].members()[self.member as usize]
    }

    /// Its position and motion.
    pub fn moved(self, bodies: &[Body], moving: &[Moving]) -> ([f32; 3], Motion) {
        moving[self.body as usize].at(&self.of(bodies).place_m)
    }
}

/// Edge of the blocks of cells in which neighbours are looked up.
const BLOCK: i32 = 2;

/// Two stencils of three nodes overlap if their first cells are at most two apart; either may drift before the next
/// sort.
const REACH_BLOCKS: i32 = (2 + 2 * DRIFT) / BLOCK;

/// The cells and blocks in which the particles of one thing lie, or of several things.
#[derive(Clone, Copy, PartialEq)]
enum Owner {
    Deforming,
    Body(u32),
    Several,
}

impl Owner {
    fn and(self, other: Self) -> Self {
        if self == other { self } else { Self::Several }
    }
}

/// The addition to the square of a particle's distance from an axis: dx^2/4 from each of two directions.
pub fn spread_m2(spacing_m: f64) -> f64 {
    spacing_m * spacing_m / 2.0
}

/// The particles of `bodies` that may share a node with another body or with the solver's own particles.
pub fn guests(solver: &Solver, bodies: &[Body], spacing_m: f32) -> Vec<Guest> {
    let block = |cell: [i32; 3]| cell.map(|x| x.div_euclid(BLOCK));
    let mut owners: HashMap<[i32; 3], Owner> = HashMap::new();
    let mut add = |block, owner: Owner| {
        owners.entry(block).and_modify(|present| *present = present.and(owner)).or_insert(owner);
    };
    solver.cells().for_each(|cell| add(block(cell), Owner::Deforming));
    let blocks: Vec<Vec<[i32; 3]>> = bodies.iter().map(|body| body.cells(spacing_m).map(block).collect()).collect();
    for (number, blocks) in blocks.iter().enumerate() {
        blocks.iter().for_each(|block| add(*block, Owner::Body(number as u32)));
    }
    let mut known: HashMap<([i32; 3], u32), bool> = HashMap::new();
    let mut guests = Vec::new();
    for (body, blocks) in (0..).zip(&blocks) {
        let alone = Owner::Body(body);
        for (member, block) in (0..).zip(blocks) {
            let others = |near: [i32; 3]| owners.get(&near).is_some_and(|owner| *owner != alone);
            let meets = || neighbours(*block).any(others);
            if *known.entry((*block, body)).or_insert_with(meets) {
                guests.push(Guest { body, member });
            }
        }
    }
    guests
}

fn neighbours([x, y, z]: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    let along = |a: i32| a - REACH_BLOCKS..=a + REACH_BLOCKS;
    along(x).flat_map(move |x| along(y).flat_map(move |y| along(z).map(move |z| [x, y, z])))
}

/// The motion of a body, ready to be applied to its particles.
pub struct Moving {
    center_m: Vector3<f64>,
    turn: Rotation3<f64>,
    velocity_m_s: Vector3<f64>,
    spin: Vector3<f64>,
    gradient: Matrix3<f32>,
}

impl From<&Body> for Moving {
    fn from(body: &Body) -> Self {
        let (state, spin) = (body.state(), body.spin());
        Self {
            center_m: state.center_m,
            turn: state.rotation.to_rotation_matrix(),
            velocity_m_s: state.velocity_m_s,
            spin,
            gradient: spin.cross_matrix().map(|x| x as f32),
        }
    }
}

impl Moving {
    /// Position and motion of the particle at `place_m` in the body's frame.
    pub fn at(&self, place_m: &Vector3<f64>) -> ([f32; 3], Motion) {
        let arm = self.turn * place_m;
        let velocity = self.velocity_m_s + self.spin.cross(&arm);
        let motion = Motion { velocity_m_s: velocity.map(|v| v as f32).into(), gradient: self.gradient };
        ((self.center_m + arm).map(|x| x as f32).into(), motion)
    }
}

/// Impulse and angular impulse about the centre of mass.
pub type Impulse = [Vector3<f64>; 2];

/// The impulse that each of the `bodies`, which moved as `moving` says, received in the solver's last substep of `dt_s`,
/// beyond that of gravity.
pub fn impulses(
    solver: &Solver,
    (guests, bodies, moving): (&[Guest], &[Body], &[Moving]),
    gravity_m_s2: Vector3<f64>,
    spacing_m: f64,
    dt_s: f64,
) -> Vec<Impulse> {
    let nothing = || vec![[Vector3::zeros(); 2]; bodies.len()];
    let add = |sums: &mut Vec<Impulse>, guest: usize, found: Gathered| {
        let (place_m, body) = (guests[guest].of(bodies).place_m, guests[guest].body as usize);
        let (moving, sum) = (&moving[body], &mut sums[body]);
        let vector = |v: [f32; 3]| Vector3::from(v.map(f64::from));
        let (_, before) = moving.at(&place_m);
        let mass = f64::from(found.mass_kg);
        let push = mass * (vector(found.velocity_m_s) - vector(before.velocity_m_s) - gravity_m_s2 * dt_s);
        let turned = axial(&found.affine) - axial(&before.gradient);
        sum[0] += push;
        sum[1] += (moving.turn * place_m).cross(&push) + mass * spacing_m * spacing_m / 4.0 * turned;
    };
    let mut total = nothing();
    for sums in solver.sum_guests(nothing, add) {
        for (total, sum) in total.iter_mut().zip(sums) {
            total[0] += sum[0];
            total[1] += sum[1];
        }
    }
    total
}

/// Twice the angular velocity whose motion has the velocity gradient `m`.
fn axial(m: &Matrix3<f32>) -> Vector3<f64> {
    Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12).map(f64::from)
}
