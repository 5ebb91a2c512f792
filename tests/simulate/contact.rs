use nalgebra::Vector3;

use super::{Block, particles_of, totals};
use gprop::mpm::boundary::{Boundary, Contact};

const GROUND_M: f32 = 0.5;
const GRAVITY: f32 = 9.8;

fn ground(contact: Contact) -> Vec<Boundary> {
    vec![Boundary { point_m: [0.0, 0.0, GROUND_M], normal: [0.0, 0.0, 1.0], contact }]
}

/// A block close to the ground.
fn block(velocity_m_s: fn(Vector3<f64>) -> Vector3<f64>) -> Block {
    Block { low_m: [0.8, 0.8, GROUND_M + 0.06], youngs_modulus_pa: 1e6, velocity_m_s, ..Block::default() }
}

/// Coulomb: a block that slides at v comes to rest after v / (mu g) seconds and v^2 / (2 mu g) metres.
#[test]
fn friction_stops_a_sliding_block_after_coulombs_distance() {
    const FRICTION: f64 = 0.3;
    const SPEED: f64 = 1.5;
    let block = block(|_| Vector3::new(SPEED, 0.0, 0.0));
    let mut solver = block.solver([0.0, 0.0, -GRAVITY], ground(Contact::Separate { friction: FRICTION as f32 }));
    let start = totals(&particles_of(&solver)).1;
    let stops_after = SPEED / (FRICTION * f64::from(GRAVITY));
    let steps = (1.5 * stops_after / f64::from(block.dt_s())) as usize;
    for _ in 0..steps {
        solver.step(block.dt_s()).unwrap();
    }
    let particles = particles_of(&solver);
    let (mass, end, momentum) = totals(&particles);
    let expected = SPEED * SPEED / (2.0 * FRICTION * f64::from(GRAVITY));
    let slid = end.x - start.x;
    // The block bounces a little when it is set down and tips forward while it brakes.
    assert!((slid / expected - 1.0).abs() < 0.05, "slid {slid} m, expected {expected} m");
    // Its base is at rest; the block above it still sways from the shear with which it was stopped.
    assert!((momentum.x / mass).abs() < 0.02 * SPEED, "still slides at {} m/s", momentum.x / mass);
}

/// Without friction it keeps its speed; on a sticky ground it does not slide at all.
#[test]
fn slip_keeps_and_sticky_takes_the_speed() {
    let block = block(|_| Vector3::new(1.0, 0.0, 0.0));
    let speed_after = |contact| {
        let mut solver = block.solver([0.0, 0.0, -GRAVITY], ground(contact));
        for _ in 0..600 {
            solver.step(block.dt_s()).unwrap();
        }
        let (mass, _, momentum) = totals(&particles_of(&solver));
        momentum.x / mass
    };
    let slipping = speed_after(Contact::Separate { friction: 0.0 });
    assert!((slipping - 1.0).abs() < 1e-3, "{slipping} m/s");
    let held = speed_after(Contact::Sticky);
    assert!(held.abs() < 0.5, "{held} m/s");
}

/// A block released near the ground comes to rest on it, with its face as far above the plane as the stage places the
/// plane below the ground.
#[test]
fn rests_on_the_ground() {
    let block = block(|_| Vector3::zeros());
    let mut solver = block.solver([0.0, 0.0, -GRAVITY], ground(Contact::Separate { friction: 0.4 }));
    let lowest = |solver: &gprop::mpm::Solver| {
        particles_of(solver).iter().map(|p| p.position_m[2]).fold(f32::INFINITY, f32::min)
    };
    for _ in 0..4000 {
        solver.step(block.dt_s()).unwrap();
    }
    // The lowest particles lie half a particle spacing inside the face.
    let face_cells = (lowest(&solver) - GROUND_M) / block.spacing_m - 0.25;
    let expected = gprop::simulate::scenario::CONTACT_DEPTH_CELLS as f32;
    assert!((face_cells - expected).abs() < 0.1, "{face_cells} cells above the plane, expected {expected}");
    let fastest = particles_of(&solver).iter().flat_map(|p| p.velocity_m_s).fold(0.0_f32, |m, v| m.max(v.abs()));
    assert!(fastest < 0.05, "still moves at {fastest} m/s");
}
