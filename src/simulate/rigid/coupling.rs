//! Rigid bodies on the grid: the nodes that their particles reach move with them.
//!
//! The particles of a body that may share a node with something else before the next sort are the solver's guests: they
//! hold nodes for the body, but scatter nothing, because a rigid motion needs no grid.
//!
//! At the nodes that a single body reaches, deforming material sticks to it: these nodes move as the body does. Body
//! and nodes are joined by conservation of momentum and angular momentum: if the body would move with the velocity
//! field U without them, a node of mass m that would move at v gives it the impulse m (v - U), and m adds to the
//! inertia that answers every impulse on the body. (If such nodes had a mean velocity of body and material instead,
//! material under a lasting pressure p would creep into a body of density rho at p dt / (rho dx).) At a node that
//! several bodies reach, they meet without sticking for good: the node has the mean velocity of all that is there by
//! mass, and gives each body the change in momentum of the body's own mass there, as an impulse, which the body shares
//! with the nodes that it carries. What a body gains at its nodes, the others lose.
//!
//! As seen from the grid, each particle of a body is spread out by dx^2/4 along every axis, which its inertia includes
//! ([`spread_m2`]).

use std::collections::{BTreeMap, HashMap};

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3, Vector6};

use super::body::{Body, Member};
use crate::mpm::particles::{LED_WEIGHT, Motion};
use crate::mpm::{DRIFT, Solver};

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

/// The owner of the particles in a block of cells.
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

/// The mass that bodies have at a node.
#[derive(Clone, Copy)]
struct Share {
    cell: [i32; 3],
    /// The first body that reaches it; `None` if none does.
    body: Option<u32>,
    /// That body's mass.
    mass_kg: f64,
    several: bool,
}

/// A node that bodies reach.
struct Carried {
    node: usize,
    cell: [i32; 3],
    with: With,
}

/// How a node that bodies reach moves.
enum With {
    /// With a body, at this place from its centre of mass.
    Body(u32, Vector3<f64>),
    /// At the mean velocity of several.
    Mean(Vector3<f64>),
}

/// The bodies and the nodes that they reach in a substep.
pub struct Joints {
    carried: Vec<Carried>,
    /// Per body: the change of velocity and angular velocity per impulse and angular impulse on body and nodes together.
    pub responses: Vec<Matrix6<f64>>,
    /// Per body: what its nodes give it beyond gravity.
    pub impulses: Vec<Impulse>,
}

/// The bodies as a substep finds them.
pub struct Meeting<'a> {
    pub bodies: &'a [Body],
    /// Their particles that hold nodes for them.
    pub guests: &'a [Guest],
    /// By body: the motion with which it began the substep.
    pub moving: &'a [Moving],
}

/// Joins the bodies with the nodes that their guests reach, halfway through a substep of `dt_s`. Gravity does not act on
/// bodies that are `led`.
pub fn join(
    solver: &Solver,
    Meeting { bodies, guests, moving }: Meeting,
    led: impl Fn(usize) -> bool,
    gravity_m_s2: Vector3<f64>,
    spacing_m: f64,
    dt_s: f64,
) -> Joints {
    let (shares, others) = shares(solver, guests, bodies);
    let free = |body: usize, arm: &Vector3<f64>| {
        let fallen = if led(body) { Vector3::zeros() } else { gravity_m_s2 * dt_s };
        moving[body].velocity_m_s + moving[body].spin.cross(arm) + fallen
    };
    let mut inertias: Vec<Matrix6<f64>> = bodies.iter().map(Body::inertia_in_simulation).collect();
    let mut impulses = vec![Vector6::zeros(); bodies.len()];
    let mut carried = Vec::new();
    for (node, share) in shares.iter().enumerate() {
        let Some(body) = share.body else { continue };
        let (velocity, mass) = solver.node(node);
        let (velocity, mass) = (Vector3::from(velocity.map(f64::from)), f64::from(mass));
        let arm = |body: u32| Vector3::from(share.cell.map(f64::from)) * spacing_m - moving[body as usize].center_m;
        let with = if share.several {
            let more = others.range((node, 0)..(node + 1, 0)).map(|((_, body), mass_kg)| (*body, *mass_kg));
            let all: Vec<(u32, f64)> = [(body, share.mass_kg)].into_iter().chain(more).collect();
            let heavy =
                |body: u32, mass_kg: f64| if led(body as usize) { f64::from(LED_WEIGHT) * mass_kg } else { mass_kg };
            let sum = all.iter().fold((velocity * mass, mass), |(momentum, sum), (body, mass_kg)| {
                let mass_kg = heavy(*body, *mass_kg);
                (momentum + free(*body as usize, &arm(*body)) * mass_kg, sum + mass_kg)
            });
            // All that reach the node do so with a weight of zero.
            if sum.1 == 0.0 {
                continue;
            }
            let mean = sum.0 / sum.1;
            for (body, mass_kg) in all {
                let push = (mean - free(body as usize, &arm(body))) * mass_kg;
                impulses[body as usize] += about_center(&arm(body), &push);
            }
            With::Mean(mean)
        } else if mass > 0.0 {
            let arm = arm(body);
            impulses[body as usize] += about_center(&arm, &((velocity - free(body as usize, &arm)) * mass));
            inertias[body as usize] += inertia_of_point(&arm, mass);
            With::Body(body, arm)
        } else {
            continue;
        };
        carried.push(Carried { node, cell: share.cell, with });
    }
    let invert = |m: &Matrix6<f64>| m.try_inverse().unwrap_or_else(Matrix6::zeros);
    let responses: Vec<Matrix6<f64>> = inertias.iter().map(invert).collect();
    let impulse = |(body, own): (usize, &Body)| {
        let all = own.inertia_in_simulation() * (responses[body] * impulses[body]);
        [all.fixed_rows::<3>(0).into(), all.fixed_rows::<3>(3).into()]
    };
    let impulses = bodies.iter().enumerate().map(impulse).collect();
    Joints { carried, responses, impulses }
}

impl Joints {
    /// Those of bodies that share no node with anything.
    pub fn none(bodies: &[Body]) -> Self {
        let responses = bodies.iter().map(Body::response_in_simulation).collect();
        Self { carried: vec![], responses, impulses: vec![[Vector3::zeros(); 2]; bodies.len()] }
    }

    /// Moves the nodes with the bodies, at the bodies' new velocities.
    pub fn carry(&self, solver: &mut Solver, bodies: &[Body]) {
        let motions: Vec<_> = bodies.iter().map(|body| (body.state().velocity_m_s, body.spin())).collect();
        for Carried { node, cell, with } in &self.carried {
            let velocity = match with {
                With::Body(body, arm) => motions[*body as usize].0 + motions[*body as usize].1.cross(arm),
                With::Mean(velocity) => *velocity,
            };
            solver.set_node(*node, *cell, velocity.map(|v| v as f32).into());
        }
    }
}

/// Per node: the mass of the first body that reaches it; and the masses of the others, by node and body.
fn shares(solver: &Solver, guests: &[Guest], bodies: &[Body]) -> (Vec<Share>, BTreeMap<(usize, u32), f64>) {
    let nothing = Share { cell: [0; 3], body: None, mass_kg: 0.0, several: false };
    let (mut shares, mut others) = (vec![nothing; solver.nodes()], BTreeMap::new());
    solver.reach(|guest, reached| {
        let (share, guest) = (&mut shares[reached.node], guests[guest]);
        let mass_kg = f64::from(reached.weight) * f64::from(guest.of(bodies).start.mass_kg);
        share.cell = reached.cell;
        if *share.body.get_or_insert(guest.body) == guest.body {
            share.mass_kg += mass_kg;
        } else {
            share.several = true;
            *others.entry((reached.node, guest.body)).or_insert(0.0) += mass_kg;
        }
    });
    (shares, others)
}

/// An impulse at `arm` and its moment.
pub fn about_center(arm: &Vector3<f64>, impulse: &Vector3<f64>) -> Vector6<f64> {
    let moment = arm.cross(impulse);
    Vector6::new(impulse.x, impulse.y, impulse.z, moment.x, moment.y, moment.z)
}

/// Momentum and angular momentum of a mass at `arm` per velocity and angular velocity.
fn inertia_of_point(arm: &Vector3<f64>, mass_kg: f64) -> Matrix6<f64> {
    let cross = arm.cross_matrix() * mass_kg;
    let mut inertia = Matrix6::zeros();
    inertia.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(mass_kg);
    inertia.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross);
    inertia.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
    inertia.fixed_view_mut::<3, 3>(3, 3).copy_from(&(-arm.cross_matrix() * cross));
    inertia
}
