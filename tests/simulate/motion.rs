use nalgebra::{Matrix3, Vector3};

use super::{Block, particles_of, totals};
use gprop::mpm::boundary::{Boundary, Contact};
use gprop::mpm::particles::Particle;
use gprop::simulate::action::{self, Action, Effect};
use gprop::simulate::object::{Bodies, Object};

/// z(t) = z0 - g t^2 / 2; symplectic Euler adds g t dt / 2.
#[test]
fn falls_freely() {
    let block = Block::default();
    let mut solver = block.solver([0.0, 0.0, -9.8], vec![]);
    let start = totals(&particles_of(&solver)).1;
    let (dt, steps) = (block.dt_s(), 250);
    for _ in 0..steps {
        solver.step(dt).unwrap();
    }
    let t = f64::from(dt) * f64::from(steps);
    let end = totals(&particles_of(&solver)).1;
    let fallen = 0.5 * 9.8 * t * (t + f64::from(dt));
    assert!(fallen > 0.4, "the block should fall far, not {fallen} m");
    // f32 positions near 1 m are rounded to 6e-8 m in each of 250 steps.
    assert!((start - end - Vector3::new(0.0, 0.0, fallen)).norm() < 2e-5, "{start} to {end}, expected {fallen}");
    let stretch = particles_of(&solver).iter().flat_map(|p| p.elastic).fold(0.0_f32, |m, f| m.max(f.abs()));
    assert!(stretch < 1.0 + 1e-4, "free fall must not strain: {stretch}");
}

/// sum m (x cross v) plus the part in APIC's affine velocity: m dx^2 / 4 times the axial vector of C (Jiang et al.
/// 2015).
fn angular_momentum(particles: &[Particle], spacing_m: f64) -> Vector3<f64> {
    let inertia = spacing_m * spacing_m / 4.0;
    particles
        .iter()
        .map(|p| {
            let (x, v) = (Vector3::from(p.position_m.map(f64::from)), Vector3::from(p.velocity_m_s.map(f64::from)));
            let c = Matrix3::from_row_slice(&p.affine.map(f64::from));
            let spin = Vector3::new(c.m32 - c.m23, c.m13 - c.m31, c.m21 - c.m12) * inertia;
            f64::from(p.mass_kg) * (x.cross(&v) + spin)
        })
        .sum()
}

#[test]
fn keeps_momentum_and_angular_momentum_over_a_thousand_steps() {
    // Spinning about a skew axis and stretched, so that it oscillates as well; drifting as a whole.
    let block = Block {
        velocity_m_s: |x| {
            let from_center = x - Vector3::repeat(1.0);
            Vector3::new(2.0, -1.0, 3.0).cross(&from_center) + from_center * 0.5 + Vector3::new(0.3, 0.1, -0.2)
        },
        ..Block::default()
    };
    let mut solver = block.solver([0.0; 3], vec![]);
    let dx = f64::from(block.spacing_m);
    let before = particles_of(&solver);
    for _ in 0..1000 {
        solver.step(block.dt_s()).unwrap();
    }
    let after = particles_of(&solver);
    let (p, q) = (totals(&before).2, totals(&after).2);
    assert!((p - q).norm() < 1e-4 * p.norm(), "momentum {p} became {q}");
    let (l, m) = (angular_momentum(&before, dx), angular_momentum(&after, dx));
    assert!((l - m).norm() < 1e-3 * l.norm(), "angular momentum {l} became {m}");
    let turned = before.iter().zip(&after).filter(|(a, b)| {
        let moved = Vector3::from(a.position_m) - Vector3::from(b.position_m);
        moved.norm() > 0.1
    });
    assert!(turned.count() > before.len() / 2, "the block should have moved and turned");
}

/// A wave runs along a bar without lateral strain (nu = 0) at c = sqrt(E / rho); with free ends, its first mode has
/// the period 2 L / c.
#[test]
fn bar_swings_with_the_period_of_its_waves() {
    const LENGTH: f64 = 1.6;
    const LOW: f64 = 0.5;
    fn mode(x: f64) -> f64 {
        (std::f64::consts::PI * (x - LOW) / LENGTH).cos()
    }
    let block = Block {
        low_m: [LOW as f32, 0.9, 0.9],
        size_m: [LENGTH as f32, 0.2, 0.2],
        poisson_ratio: 0.0,
        velocity_m_s: |x| Vector3::new(0.05 * mode(x.x), 0.0, 0.0),
        ..Block::default()
    };
    let expected = 2.0 * LENGTH / (block.youngs_modulus_pa / block.density_kg_m3).sqrt();
    let mut solver = block.solver([0.0; 3], vec![]);
    let rest: Vec<f64> = block.particles().iter().map(|p| mode(f64::from(p.position_m[0]))).collect();
    let dt = block.dt_s();
    let mut crossings: Vec<f64> = Vec::new();
    let mut last = 1.0;
    for step in 1.. {
        solver.step(dt).unwrap();
        let particles = particles_of(&solver);
        let amplitude: f64 = particles.iter().zip(&rest).map(|(p, m)| f64::from(p.velocity_m_s[0]) * m).sum();
        let t = f64::from(dt) * f64::from(step);
        if amplitude * last < 0.0 {
            crossings.push(t - f64::from(dt) * amplitude / (amplitude - last));
        }
        last = amplitude;
        if crossings.len() == 3 || t > 3.0 * expected {
            break;
        }
    }
    let period = crossings[2] - crossings[0];
    // The outermost particles are half a spacing inside the bar's faces, and the grid rounds off the free ends by a
    // part of one of the 32 cells: the bar oscillates like one that is up to a cell longer.
    assert!((period / expected - 1.0).abs() < 0.03, "period {period} s, expected {expected} s");
}

/// Thrown obliquely onto smooth ground: parabolas between the bounces, no speed lost along the ground. A block without
/// lateral strain that falls flat rebounds by one wave up and down: with its initial speed, after 2 H / c (St. Venant).
#[test]
fn oblique_throw_bounces_with_its_speed() {
    const GRAVITY: f64 = 9.8;
    const SPEED: [f64; 2] = [1.0, -3.0];
    let block = Block {
        low_m: [0.8, 0.8, 0.7],
        youngs_modulus_pa: 1e6,
        poisson_ratio: 0.0,
        velocity_m_s: |_| Vector3::new(SPEED[0], 0.0, SPEED[1]),
        ..Block::default()
    };
    let ground =
        Boundary { point_m: [0.0, 0.0, 0.5], normal: [0.0, 0.0, 1.0], contact: Contact::Separate { friction: 0.0 } };
    let mut solver = block.solver([0.0, 0.0, -GRAVITY as f32], vec![ground]);
    let dt = f64::from(block.dt_s());
    // Time, place and velocity of the centre of mass.
    let mut course: Vec<(f64, Vector3<f64>, Vector3<f64>)> = Vec::new();
    for step in 0..(0.7 / dt) as usize {
        let (mass, place, momentum) = totals(&particles_of(&solver));
        course.push((step as f64 * dt, place, momentum / mass));
        solver.step(block.dt_s()).unwrap();
    }
    // In contact with the ground while its upward acceleration exceeds half of g.
    let pushed = |pair: &[(f64, Vector3<f64>, Vector3<f64>)]| (pair[1].2.z - pair[0].2.z) / dt > 0.5 * GRAVITY;
    let first = course.windows(2).position(pushed).unwrap();
    let last = first + course[first..].windows(2).position(|pair| !pushed(pair)).unwrap();
    let (landing, leaving) = (&course[first], &course[last]);
    let restitution = -leaving.2.z / landing.2.z;
    assert!(restitution > 0.9 && restitution <= 1.0, "restitution {restitution}");
    let (contact_s, expected_s) = (leaving.0 - landing.0, 2.0 * 0.4 / block.wave_speed_m_s());
    // On the grid, the ground acts about a cell before the block reaches it.
    let early_s = f64::from(block.spacing_m) / -landing.2.z;
    assert!(
        contact_s > 0.95 * expected_s && contact_s < expected_s + early_s,
        "in touch for {contact_s} s, expected {expected_s} s, and {early_s} s early"
    );
    let end = course.last().unwrap();
    assert!((end.2.x - SPEED[0]).abs() < 1e-3, "along the ground {} m/s", end.2.x);
    // Clear of the ground.
    let flight = &course[last + (0.05 / dt) as usize..];
    for (t, place, _) in flight {
        let t = t - flight[0].0;
        // Symplectic Euler adds g t dt / 2.
        let expected = flight[0].1 + flight[0].2 * t - Vector3::z() * (0.5 * GRAVITY * t * (t + dt));
        assert!((place - expected).norm() < 5e-4, "{place} is not on the parabola through {expected}");
    }
    assert!(end.0 - leaving.0 > 0.3, "it should fly on");
}

/// Steps and speed of the tiny steps: each move, 1e-7 m, is less than half the rounding of an f32 position at 3 m, 2.4e-7 m.
const TINY_STEPS: usize = 5000;
const TINY_STEP_S: f64 = 1e-6;
const SLOW_M_S: f32 = 0.1;

/// A short bar along x, far from the origin.
fn far_bar() -> Block {
    Block { low_m: [3.0; 3], size_m: [0.2, 0.05, 0.05], ..Block::default() }
}

/// How far the bar moves in all tiny steps.
const WAY_M: f64 = SLOW_M_S as f64 * TINY_STEP_S * TINY_STEPS as f64;

/// Checks that `after` lies `expected_m` from `before` along x, up to a share of `tolerance`.
fn check_moved(before: &Particle, after: &Particle, expected_m: f64, tolerance: f64) {
    let moved_m = f64::from(after.position_m[0]) - f64::from(before.position_m[0]);
    assert!((moved_m / expected_m - 1.0).abs() < tolerance, "moved by {moved_m} m, expected {expected_m} m");
}

#[test]
fn slow_particles_drift_in_tiny_steps() {
    let bar = Block { velocity_m_s: |_| Vector3::new(SLOW_M_S.into(), 0.0, 0.0), ..far_bar() };
    let mut solver = bar.solver([0.0; 3], vec![]);
    let before = particles_of(&solver);
    for _ in 0..TINY_STEPS {
        solver.step(TINY_STEP_S as f32).unwrap();
    }
    // Rounding changes a velocity by a few 1e-7 of itself in every transfer, and by about a thousandth in all of them.
    for (before, after) in before.iter().zip(&particles_of(&solver)) {
        check_moved(before, after, WAY_M, 5e-3);
    }
}

#[test]
fn led_ends_of_a_bar_move_in_tiny_steps() {
    let bar = far_bar();
    let particles = bar.particles();
    let is_low: Vec<bool> = particles.iter().map(|p| p.position_m[0] < 3.05).collect();
    let is_high: Vec<bool> = particles.iter().map(|p| p.position_m[0] > 3.15).collect();
    let pull = |mask: &[bool], speed_m_s: f32| Action {
        from_s: 0.0,
        to_s: f64::INFINITY,
        mask: mask.to_vec(),
        effect: Effect::Move([speed_m_s, 0.0, 0.0]),
    };
    let mut object = Object::new(bar.setting([0.0; 3], vec![]), particles.clone(), &Bodies::default(), None);
    let pulls = action::on(&object, vec![pull(&is_low, -SLOW_M_S), pull(&is_high, SLOW_M_S)]);
    for step in 0..TINY_STEPS {
        action::step(&pulls, &mut object, step as f64 * TINY_STEP_S, TINY_STEP_S).unwrap();
    }
    let after: Vec<Particle> = object.particles().iter().collect();
    // Rounding of the last position: 1.2e-7 m of 5e-4 m.
    for (id, (before, after)) in particles.iter().zip(&after).enumerate() {
        if is_low[id] {
            check_moved(before, after, -WAY_M, 1e-3);
        } else if is_high[id] {
            check_moved(before, after, WAY_M, 1e-3);
        }
    }
    assert_eq!((is_low.iter().filter(|low| **low).count(), is_high.iter().filter(|high| **high).count()), (8, 8));
}
