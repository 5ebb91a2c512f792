use gprop::mpm::Setting;
use gprop::mpm::boundary::{Boundary, Contact};
use gprop::mpm::laws::Law;
use gprop::mpm::particles::Particle;
use gprop::simulate::action::{self, Action, Effect};
use gprop::simulate::object::{Bodies, Object};
use gprop::simulate::rigid::body::Body;
use nalgebra::{Matrix3, Vector3};

use super::{Block, totals};

const GRAVITY: f64 = 9.8;
const GROUND_M: f64 = 0.5;
const STEEL_PA: f64 = 2e11;

/// An object of `particles`, the first `rigid` of which are one rigid body.
fn object(
    particles: &[Particle],
    rigid: usize,
    spacing_m: f32,
    gravity_m_s2: f64,
    boundaries: Vec<Boundary>,
    ground: Option<&Boundary>,
) -> Object {
    let body_of = (0..particles.len()).map(|id| (id < rigid).then_some(0)).collect();
    object_of(particles, body_of, spacing_m, gravity_m_s2, boundaries, ground)
}

/// An object of `particles`, each with the number of its rigid body.
fn object_of(
    particles: &[Particle],
    body_of: Vec<Option<u32>>,
    spacing_m: f32,
    gravity_m_s2: f64,
    boundaries: Vec<Boundary>,
    ground: Option<&Boundary>,
) -> Object {
    let setting = Setting {
        spacing_m,
        gravity_m_s2: [0.0, 0.0, -gravity_m_s2 as f32],
        boundaries,
        domain_m: [[-20.0; 3], [20.0; 3]],
        laws: vec![Law::FixedCorotated],
    };
    let bodies = Bodies {
        body_of,
        part_of: vec![0; particles.len()],
        is_solid: vec![true; particles.len()],
        plane_modulus_pa: vec![STEEL_PA],
    };
    Object::new(setting, particles.to_vec(), &bodies, ground)
}

fn plane(normal: [f32; 3], contact: Contact) -> Boundary {
    Boundary { point_m: [0.0, 0.0, GROUND_M as f32], normal, contact }
}

fn run(object: &mut Object, dt_s: f64, steps: usize) {
    for step in 0..steps {
        action::step(&[], object, step as f64 * dt_s, dt_s).unwrap();
    }
}

fn particles_of(object: &Object) -> Vec<Particle> {
    object.particles().iter().collect()
}

fn lowest_m(object: &Object) -> f64 {
    object.particles().iter().map(|p| f64::from(p.position_m[2])).fold(f64::INFINITY, f64::min)
}

/// A ball of particles on a lattice, and its radius: the distance of its farthest particle from its centre.
fn ball() -> (Vec<Particle>, f64) {
    let block = Block { low_m: [0.8, 0.8, 1.0], ..Block::default() };
    let middle = Vector3::new(1.0, 1.0, 1.2);
    let from_middle = |p: &Particle| (Vector3::from(p.position_m) - middle).norm();
    let ball: Vec<Particle> = block.particles().into_iter().filter(|p| from_middle(p) < 0.2).collect();
    let radius = ball.iter().map(from_middle).fold(0.0, f32::max);
    (ball, radius.into())
}

/// It falls by g t^2 / 2 (symplectic Euler adds g t dt / 2) until it is as far above the ground as it is low, and
/// stays there: it neither rebounds nor sinks.
#[test]
fn ball_drops_without_a_bounce() {
    let (ball, _) = ball();
    let ground = plane([0.0, 0.0, 1.0], Contact::Separate { friction: 0.4 });
    let mut object = object(&ball, ball.len(), 0.05, GRAVITY, vec![], Some(&ground));
    let (start, fall) = (totals(&ball).1.z, lowest_m(&object) - GROUND_M);
    let (dt, impact_s) = (1e-3, (2.0 * fall / GRAVITY).sqrt());
    let before = (impact_s / dt) as usize - 1;
    run(&mut object, dt, before);
    let t = before as f64 * dt;
    let fallen = start - totals(&particles_of(&object)).1.z;
    assert!((fallen - 0.5 * GRAVITY * t * (t + dt)).abs() < 1e-6, "fell {fallen} m in {t} s");
    for step in before..1500 {
        run(&mut object, dt, 1);
        let gap = lowest_m(&object) - GROUND_M;
        assert!(gap > -1e-6, "{gap} m below the ground after step {step}");
        assert!(step < before + 4 || gap < 1e-5, "{gap} m above the ground after step {step}");
    }
    let speed = object.bodies()[0].fastest_m_s();
    assert!(speed < 1e-6, "still moves at {speed} m/s");
}

/// Down a slope of the angle a it is slowed by g (mu cos a - sin a): it stops after v^2 / 2 of that, and stays.
#[test]
fn block_slides_to_rest_on_an_incline() {
    const FRICTION: f64 = 0.5;
    const SPEED: f64 = 1.5;
    let angle = 15_f64.to_radians();
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), angle);
    let (normal, downhill) = (turn * Vector3::z(), turn * Vector3::x());
    let ground = plane(normal.map(|x| x as f32).into(), Contact::Separate { friction: FRICTION as f32 });
    let flat = Block { low_m: [-0.2, -0.2, 0.0], size_m: [0.4, 0.4, 0.1], ..Block::default() };
    let mut particles = flat.particles();
    let foot = particles.iter().map(|p| p.position_m[2]).fold(f32::INFINITY, f32::min);
    for p in &mut particles {
        let place = Vector3::from(p.position_m.map(f64::from)) - Vector3::z() * f64::from(foot);
        let place = turn * place + Vector3::z() * GROUND_M;
        p.position_m = place.map(|x| x as f32).into();
        p.velocity_m_s = (downhill * SPEED).map(|v| v as f32).into();
    }
    let mut object = object(&particles, particles.len(), 0.05, GRAVITY, vec![], Some(&ground));
    let start = totals(&particles).1;
    let braking = GRAVITY * (FRICTION * angle.cos() - angle.sin());
    run(&mut object, 1e-3, (1.5 * SPEED / braking / 1e-3) as usize);
    let moved = totals(&particles_of(&object)).1 - start;
    let expected = SPEED * SPEED / (2.0 * braking);
    // Symplectic Euler loses v dt / 2, a thousandth; rounding of the particles' f32 positions is far less.
    assert!((moved.dot(&downhill) / expected - 1.0).abs() < 3e-3, "slid {} m, not {expected} m", moved.dot(&downhill));
    assert!(moved.dot(&normal).abs() < 1e-5 && moved.y.abs() < 1e-4, "left the slope by {moved}");
    let speed = object.bodies()[0].fastest_m_s();
    assert!(speed < 1e-6, "still slides at {speed} m/s");
}

/// About its middle axis a free box tumbles: its angular velocity changes, its angular momentum and energy do not.
#[test]
fn free_box_tumbles_with_its_momentum_and_energy() {
    let spinning = Block {
        size_m: [0.6, 0.4, 0.2],
        velocity_m_s: |x| {
            Vector3::new(0.8, 8.0, 0.8).cross(&(x - Vector3::new(1.1, 1.0, 0.9))) + Vector3::new(0.3, 0.2, -0.1)
        },
        ..Block::default()
    };
    let particles = spinning.particles();
    let mut object = object(&particles, particles.len(), 0.05, 0.0, vec![], None);
    let body = |object: &Object| {
        let body = &object.bodies()[0];
        (body.state().velocity_m_s * body.mass_kg(), body.state().angular_momentum, body.kinetic_j(), body.spin())
    };
    // About the centre of mass, from the particles alone.
    let spun = |object: &Object| -> Vector3<f64> {
        let particles = particles_of(object);
        let (mass, center, momentum) = totals(&particles);
        let moment_of = |p: &Particle| {
            let (x, v) = (Vector3::from(p.position_m.map(f64::from)), Vector3::from(p.velocity_m_s.map(f64::from)));
            f64::from(p.mass_kg) * (x - center).cross(&(v - momentum / mass))
        };
        particles.iter().map(moment_of).sum()
    };
    let (p, l, e, spin) = body(&object);
    let from_particles = spun(&object);
    let mut farthest = 0.0_f64;
    for _ in 0..1000 {
        run(&mut object, 1e-3, 1);
        farthest = farthest.max((body(&object).3 - spin).norm());
    }
    let (p_end, l_end, e_end, _) = body(&object);
    // Its part along the angular momentum cannot change.
    assert!(farthest > 0.2 * spin.norm(), "it should tumble, but its spin changed by {farthest} rad/s");
    assert!((p - p_end).norm() < 1e-4 * p.norm() && (l - l_end).norm() < 1e-4 * l.norm(), "{p_end} {l_end}");
    assert!((e_end / e - 1.0).abs() < 1e-4, "{e} J became {e_end} J");
    // The cubes of its particles turn as well: a^2 / 6 of their edge, half a percent of the box's inertia.
    let change = (spun(&object) - from_particles).norm() / from_particles.norm();
    assert!(change < 1e-2, "the particles' angular momentum changed by {change}");
}

/// Foam that cannot give sideways (nu = 0), under a plate that weighs on it, swings about the depth (m g / A + rho g H /
/// 2) H / E.
#[test]
fn plate_settles_on_foam_at_its_depth() {
    const STIFFNESS: f64 = 4e4;
    const HEIGHT: f64 = 0.8;
    let foam = Block {
        low_m: [0.8, 0.8, GROUND_M as f32],
        size_m: [0.4, 0.4, HEIGHT as f32],
        density_kg_m3: 50.0,
        youngs_modulus_pa: STIFFNESS,
        poisson_ratio: 0.0,
        ..Block::default()
    };
    let plate = Block {
        low_m: [0.8, 0.8, (GROUND_M + HEIGHT) as f32],
        size_m: [0.4, 0.4, 0.1],
        density_kg_m3: 2000.0,
        ..Block::default()
    };
    let mut particles = plate.particles();
    let rigid = particles.len();
    particles.extend(foam.particles());
    // On a layer of nodes, slightly above to allow for rounding.
    let floor = Boundary {
        point_m: [0.0, 0.0, GROUND_M as f32 + 5e-4],
        normal: [0.0, 0.0, 1.0],
        contact: Contact::Separate { friction: 0.0 },
    };
    let mut object = object(&particles, rigid, foam.spacing_m, GRAVITY, vec![floor], None);
    let start = object.bodies()[0].state().center_m.z;
    let dt = f64::from(foam.dt_s());
    // Its mean over a whole period is that of the equilibrium.
    let mass = object.bodies()[0].mass_kg() + foam.density_kg_m3 * 0.4 * 0.4 * HEIGHT / 3.0;
    let period = std::f64::consts::TAU * (mass * HEIGHT / (STIFFNESS * 0.16)).sqrt();
    let steps = (period / dt) as usize;
    let mut mean_depth = || {
        let depth = (0..steps).map(|_| {
            run(&mut object, dt, 1);
            start - object.bodies()[0].state().center_m.z
        });
        depth.sum::<f64>() / steps as f64
    };
    let pressure = 2000.0 * 0.1 * GRAVITY + foam.density_kg_m3 * GRAVITY * HEIGHT / 2.0;
    let expected = pressure * HEIGHT / STIFFNESS;
    // The nodes that plate and ground reach hold half a cell of foam on either side, which raises its stiffness by up to a
    // sixteenth, and the mean over a period that is estimated is off by about a hundredth.
    for period in 0..2 {
        let found = mean_depth();
        assert!(
            (found / expected - 1.0).abs() < 0.02,
            "pressed by {found} m in period {period}, expected {expected} m"
        );
    }
    let body = &object.bodies()[0];
    assert!(body.spin().norm() < 1e-2, "the plate tilts at {}", body.spin());
}

/// sum m (x cross v) of all particles, with the momentum that the grid spreads over each of them.
fn angular_momentum(object: &Object, spacing_m: f64) -> Vector3<f64> {
    let moment_of = |p: &Particle| {
        let (x, v) = (Vector3::from(p.position_m.map(f64::from)), Vector3::from(p.velocity_m_s.map(f64::from)));
        let c = Matrix3::from_row_slice(&p.affine.map(f64::from));
        let spin = Vector3::new(c.m32 - c.m23, c.m13 - c.m31, c.m21 - c.m12) * (spacing_m * spacing_m / 4.0);
        f64::from(p.mass_kg) * (x.cross(&v) + spin)
    };
    object.particles().iter().map(|p| moment_of(&p)).sum()
}

/// A soft block flies into a rigid one, off its centre, and pushes it away: what one loses, the other gains.
#[test]
fn soft_and_rigid_exchange_momentum() {
    let rigid = Block { size_m: [0.2, 0.4, 0.4], density_kg_m3: 3000.0, ..Block::default() };
    let soft = Block {
        low_m: [1.1, 0.9, 0.9],
        size_m: [0.3, 0.4, 0.4],
        velocity_m_s: |_| Vector3::new(-1.0, 0.2, 0.1),
        ..Block::default()
    };
    let mut particles = rigid.particles();
    let first = particles.len();
    particles.extend(soft.particles());
    let dx = f64::from(soft.spacing_m);
    let mut object = object(&particles, first, soft.spacing_m, 0.0, vec![], None);
    let momentum = |object: &Object| totals(&particles_of(object)).2;
    let (before, spun) = (momentum(&object), angular_momentum(&object, dx));
    run(&mut object, f64::from(soft.dt_s()), 800);
    let (after, spun_after) = (momentum(&object), angular_momentum(&object, dx));
    let body = &object.bodies()[0];
    let pushed = body.mass_kg() * body.state().velocity_m_s.norm() / before.norm();
    assert!(pushed > 0.3 && body.spin().norm() > 0.05, "hardly pushed: {pushed}, {}", body.spin());
    assert!((after - before).norm() < 1e-5 * before.norm(), "{before} became {after}");
    // The particles' own cubes and f32 rounding: below a thousandth.
    let change = (spun_after - spun).norm() / spun.norm();
    assert!(change < 1e-3, "angular momentum {spun} became {spun_after}");
}

/// A rigid block flies into another one, off its centre: what one loses, the other gains.
#[test]
fn rigid_bodies_exchange_momentum() {
    let still = Block { size_m: [0.2, 0.4, 0.4], density_kg_m3: 3000.0, ..Block::default() };
    let flying = Block {
        low_m: [1.2, 0.9, 0.9],
        size_m: [0.3, 0.4, 0.4],
        velocity_m_s: |_| Vector3::new(-1.0, 0.0, 0.0),
        ..Block::default()
    };
    let mut particles = still.particles();
    let first = particles.len();
    particles.extend(flying.particles());
    let body_of = (0..particles.len()).map(|id| Some(u32::from(id >= first))).collect();
    let mut object = object_of(&particles, body_of, still.spacing_m, 0.0, vec![], None);
    let momenta = |object: &Object| -> [Vector3<f64>; 2] {
        let linear = |body: &Body| body.state().velocity_m_s * body.mass_kg();
        let angular = |body: &Body| body.state().center_m.cross(&linear(body)) + body.state().angular_momentum;
        [object.bodies().iter().map(linear).sum(), object.bodies().iter().map(angular).sum()]
    };
    let before = momenta(&object);
    run(&mut object, 1e-3, 800);
    let after = momenta(&object);
    let hit = &object.bodies()[0];
    let pushed = hit.mass_kg() * hit.state().velocity_m_s.norm() / before[0].norm();
    assert!(pushed > 0.3 && hit.spin().norm() > 0.05, "hardly pushed: {pushed}, {}", hit.spin());
    for (before, after) in before.iter().zip(after) {
        assert!((after - before).norm() < 1e-9 * before.norm(), "{before} became {after}");
    }
}

/// A rigid slab between soft material and a second rigid body that flies into it, so that both touch it in the same
/// substeps: momentum stays, and no substep adds energy. The soft block is heavier than the slab, so that an impulse
/// that the slab did not share with it would show.
#[test]
fn body_between_soft_material_and_a_second_body_keeps_momentum() {
    let slab = Block { size_m: [0.1, 0.4, 0.4], density_kg_m3: 300.0, ..Block::default() };
    let flying = Block {
        low_m: [0.9, 0.9, 0.9],
        size_m: [0.2, 0.4, 0.4],
        density_kg_m3: 2000.0,
        velocity_m_s: |_| Vector3::new(-1.0, 0.2, 0.1),
        ..Block::default()
    };
    let soft = Block { low_m: [0.5, 0.8, 0.8], size_m: [0.3, 0.4, 0.4], ..Block::default() };
    let mut particles = slab.particles();
    let first = particles.len();
    particles.extend(flying.particles());
    let rigid = particles.len();
    particles.extend(soft.particles());
    let body_of = (0..particles.len()).map(|id| (id < rigid).then_some(u32::from(id >= first))).collect();
    let mut object = object_of(&particles, body_of, soft.spacing_m, 0.0, vec![], None);
    let momentum = |object: &Object| totals(&particles_of(object)).2;
    let energy_j = |object: &Object| {
        let particles = object.particles();
        particles.kinetic_j() + (0..particles.count()).map(|id| particles.elastic_j(id)).sum::<f64>()
    };
    let (before, started_j) = (momentum(&object), energy_j(&object));
    let mut last_j = started_j;
    for substep in 0..400 {
        run(&mut object, f64::from(soft.dt_s()), 1);
        let (after, now_j) = (momentum(&object), energy_j(&object));
        assert!((after - before).norm() < 1e-5 * before.norm(), "substep {substep}: {before} became {after}");
        assert!(now_j < last_j + 1e-5 * started_j, "substep {substep}: {last_j} J became {now_j} J");
        last_j = now_j;
    }
    let slab = &object.bodies()[0];
    assert!(slab.state().velocity_m_s.x < -0.2, "the slab was hardly hit: {}", slab.state().velocity_m_s);
}

/// Two rods beside each other whose particles lie in the middle of a cell, so that both reach the nodes on one side with a
/// weight of zero: the nodes have no mass, and the rods stay at rest.
#[test]
fn bodies_meet_at_nodes_without_mass() {
    let any = Block::default().particles()[0];
    let places = [[1.5, 1.5, 1.5], [1.5, 1.5, 2.5], [1.5, 2.5, 1.5], [1.5, 2.5, 2.5]];
    let particles = places.map(|position_m| Particle { position_m, ..any });
    let body_of = vec![Some(0), Some(0), Some(1), Some(1)];
    let mut object = object_of(&particles, body_of, 1.0, 0.0, vec![], None);
    run(&mut object, 1e-3, 10);
    for (before, after) in particles.iter().zip(particles_of(&object)) {
        assert_eq!((before.position_m, before.velocity_m_s), (after.position_m, after.velocity_m_s));
    }
}

/// Actions on a body are those on its particles: a push above the centre of mass turns it, a held part holds the whole.
#[test]
fn actions_move_bodies() {
    let block = Block { size_m: [0.2, 0.2, 0.6], ..Block::default() };
    let particles = block.particles();
    let top: Vec<bool> = particles.iter().map(|p| p.position_m[2] > 1.2).collect();
    let share = top.iter().filter(|t| **t).count() as f64 / particles.len() as f64;
    let after = |mask: &[bool], effect: Effect| {
        let mut object = object(&particles, particles.len(), 0.05, GRAVITY, vec![], None);
        let action = Action { from_s: 0.0, to_s: 0.05, mask: mask.to_vec(), effect };
        let actions = action::on(&object, vec![action]);
        for step in 0..100 {
            action::step(&actions, &mut object, f64::from(step) * 1e-3, 1e-3).unwrap();
        }
        (object.bodies()[0].state().velocity_m_s, object.bodies()[0].spin())
    };
    let (velocity, spin) = after(&top, Effect::Accelerate([20.0, 0.0, 0.0]));
    assert!((velocity - Vector3::new(20.0 * 0.05 * share, 0.0, -GRAVITY * 0.1)).norm() < 1e-5, "{velocity}");
    assert!(spin.y > 1.0 && spin.x.abs() < 1e-4 && spin.z.abs() < 1e-4, "{spin}");
    // Held for half the time, it falls for the other half.
    let (velocity, spin) = after(&top, Effect::Move([0.0; 3]));
    assert!((velocity + Vector3::z() * (GRAVITY * 0.05)).norm() < 1e-6 && spin.norm() < 1e-9, "{velocity} {spin}");
    let all = vec![true; particles.len()];
    let (velocity, spin) = after(&all, Effect::Wind { velocity: [2.0, 0.0, 0.0], response_s: 0.1 });
    let expected = 2.0 * (1.0 - (-0.5_f64).exp());
    assert!((velocity.x - expected).abs() < 1e-5 && spin.norm() < 1e-5, "{velocity}, expected {expected}");
    // 50.5 periods in steps slightly longer than a period: from rest to a (1 - cos(2 pi f t)) / (2 pi f).
    let (velocity, spin) = after(&all, Effect::Shake { acceleration: [100.0, 0.0, 0.0], frequency_hz: 1010.0 });
    let expected = 2.0 * 100.0 / (std::f64::consts::TAU * 1010.0);
    assert!((velocity.x - expected).abs() < 1e-6 && spin.norm() < 1e-6, "{velocity}, expected {expected}");
    // A wind on its top alone turns it.
    assert!(after(&top, Effect::Wind { velocity: [2.0, 0.0, 0.0], response_s: 0.1 }).1.y > 0.5);
    let turned = after(&top, Effect::Turn { axis: 2, center: [0.9, 0.9, 0.0], rate: 3.0 }).1;
    assert!((turned - Vector3::z() * 3.0).norm() < 1e-5, "{turned}");
}

/// Turned by ten radians, in steps of a hundredth of a radian: every particle is on its circle, and nothing is strained,
/// whether it deforms or is rigid. The axis is none of the principal axes of inertia, about which a free body would turn.
#[test]
fn turned_objects_stay_on_their_circle() {
    const RATE: f32 = 10.0;
    const CENTER: [f32; 3] = [0.7, 0.9, 0.0];
    let is_in_angle = |p: &Particle| p.position_m[2] < 0.9 || p.position_m[0] < 0.9;
    let angle: Vec<Particle> = Block::default().particles().into_iter().filter(is_in_angle).collect();
    let center = Vector3::from(CENTER.map(f64::from));
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 10.0);
    let effect = Effect::Turn { axis: 2, center: CENTER, rate: RATE };
    for rigid in [0, angle.len()] {
        let mut object = object(&angle, rigid, 0.05, 0.0, vec![], None);
        let action = Action { from_s: 0.0, to_s: f64::INFINITY, mask: vec![true; angle.len()], effect };
        let actions = action::on(&object, vec![action]);
        for step in 0..1000 {
            action::step(&actions, &mut object, f64::from(step) * 1e-3, 1e-3).unwrap();
        }
        for (before, after) in angle.iter().zip(particles_of(&object)) {
            let [from, to] = [before, &after].map(|p| Vector3::from(p.position_m.map(f64::from)) - center);
            // Along the tangents, the distance from the axis would grow by a twentieth.
            assert!((to - turn * from).norm() < 1e-5, "{rigid} rigid: {from} went to {to}");
            let f = Matrix3::from_row_slice(&after.elastic.map(f64::from));
            assert!((f - turn.matrix()).norm() < 1e-4, "{rigid} rigid: turned and strained by {f}");
        }
    }
}

/// A lasting load on a body at rest is a weight, however short the step: F = M (g + a). If the body has just landed at v,
/// F = v sqrt(k M) + M (g + a), with k = 2 sqrt(A / pi) E / (1 - nu^2).
#[test]
fn load_on_a_resting_body_is_not_an_impact() {
    const LOAD: f64 = 1000.0;
    // The centres of the lowest particles are 1 um below the ground.
    let flat = Block { low_m: [0.8, 0.8, GROUND_M as f32 - 0.0125 - 1e-6], ..Block::default() };
    let ground = plane([0.0, 0.0, 1.0], Contact::Separate { friction: 0.4 });
    let area_m2 = (0.4_f64 - 0.025).powi(2);
    for (speed, dt, steps) in [(0.0_f32, 1e-3, 20), (0.0, 1e-5, 20), (0.5, 1e-3, 20), (0.5, 1e-5, 20)] {
        let mut particles = flat.particles();
        particles.iter_mut().for_each(|p| p.velocity_m_s[2] = -speed);
        let mut object = object(&particles, particles.len(), 0.05, GRAVITY, vec![], Some(&ground));
        let effect = Effect::Accelerate([0.0, 0.0, -LOAD as f32]);
        let action = Action { from_s: 0.0, to_s: f64::INFINITY, mask: vec![true; particles.len()], effect };
        let actions = action::on(&object, vec![action]);
        for step in 0..steps {
            action::step(&actions, &mut object, f64::from(step) * dt, dt).unwrap();
        }
        let body = &object.bodies()[0];
        let stiffness = 2.0 * (area_m2 / std::f64::consts::PI).sqrt() * STEEL_PA;
        let impact_n = f64::from(speed) * (stiffness * body.mass_kg()).sqrt();
        let expected = (impact_n + body.mass_kg() * (GRAVITY + LOAD)) / area_m2;
        let found = body.faces()[0].peak_pressure_pa;
        // Sizes in f32, and the iteration's last change of the speed.
        assert!(
            (found / expected - 1.0).abs() < 1e-3,
            "{found} Pa in steps of {dt} s at {speed} m/s, not {expected} Pa"
        );
    }
}
