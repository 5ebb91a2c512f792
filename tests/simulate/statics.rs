use gprop::mpm::boundary::{Boundary, Contact};
use gprop::mpm::laws::{Law, drucker_prager};
use gprop::mpm::particles::Particle;
use gprop::simulate::action::{self, Action, Effect};
use gprop::simulate::object::{Bodies, Object};
use nalgebra::{Matrix3, Vector3};

use super::{Block, particles_of};

/// A beam of length L and thickness h, clamped at one end under its weight, oscillates about Timoshenko's deflection
/// 3 rho g L^4 / (2 E h^2) + rho g L^2 / (2 kappa G), kappa = 5/6, with the period 2 pi / 3.516 sqrt(12 rho L^4 / (E
/// h^2)).
#[test]
fn cantilever_swings_about_its_deflection() {
    const LENGTH: f64 = 1.0;
    const THICKNESS: f64 = 0.2;
    const CLAMPED: f64 = 0.2;
    const GRAVITY: f64 = 1.0;
    let block = Block {
        low_m: [0.8, 1.0, 1.0],
        size_m: [(CLAMPED + LENGTH) as f32, 0.1, THICKNESS as f32],
        spacing_m: 0.025,
        youngs_modulus_pa: 1e6,
        poisson_ratio: 0.0,
        ..Block::default()
    };
    let particles = block.particles();
    let clamped_to = 0.8 + CLAMPED as f32;
    let mask = particles.iter().map(|p| p.position_m[0] < clamped_to).collect();
    let clamp = Action { from_s: 0.0, to_s: f64::INFINITY, mask, effect: Effect::Move([0.0; 3]) };
    let tip: Vec<usize> =
        (0..particles.len()).filter(|&i| particles[i].position_m[0] > clamped_to + LENGTH as f32 - 0.02).collect();
    let height = |particles: &[Particle]| {
        tip.iter().map(|&i| f64::from(particles[i].position_m[2])).sum::<f64>() / tip.len() as f64
    };
    let (density, stiffness) = (block.density_kg_m3, block.youngs_modulus_pa);
    let bending = 1.5 * density * GRAVITY * LENGTH.powi(4) / (stiffness * THICKNESS * THICKNESS);
    let shear = density * GRAVITY * LENGTH * LENGTH / (2.0 * 5.0 / 6.0 * stiffness / 2.0);
    let period =
        std::f64::consts::TAU / 3.516 * (12.0 * density * LENGTH.powi(4) / (stiffness * THICKNESS.powi(2))).sqrt();

    let setting = block.setting([0.0, 0.0, -GRAVITY as f32], vec![]);
    let mut object = Object::new(setting, particles.clone(), &Bodies::default(), None);
    let clamp = action::on(&object, vec![clamp]);
    let (start, dt) = (height(&particles), f64::from(block.dt_s()));
    let (mut lowest, mut lowest_at) = (start, 0.0);
    for step in 0..(0.8 * period / dt) as usize {
        action::step(&clamp, &mut object, step as f64 * dt, dt).unwrap();
        if step % 10 == 0 {
            let now = height(&object.particles().iter().collect::<Vec<_>>());
            if now < lowest {
                (lowest, lowest_at) = (now, (step + 1) as f64 * dt);
            }
        }
    }
    let end: Vec<Particle> = object.particles().iter().collect();
    let crept = particles
        .iter()
        .zip(&end)
        .filter(|(p, _)| p.position_m[0] < clamped_to - 0.05)
        .map(|(p, q)| (Vector3::from(p.position_m) - Vector3::from(q.position_m)).norm());
    assert!(crept.fold(0.0, f32::max) < 1e-5, "what is held must stay");
    // Released at rest, it swings equally far beyond its deflection. Nodes up to 1.5 cells from held particles are held
    // too: the beam is about one of its 40 cells shorter, which is a tenth less in the fourth power.
    let (found, expected) = ((start - lowest) / 2.0, bending + shear);
    assert!((found / expected - 0.95).abs() < 0.1, "deflection {found} m, expected {expected} m");
    assert!((2.0 * lowest_at / period - 0.97).abs() < 0.08, "period {} s, expected {period} s", 2.0 * lowest_at);
}

fn wall(point_m: [f32; 3], normal: [f32; 3], contact: Contact) -> Boundary {
    Boundary { point_m, normal, contact }
}

/// The pressure of water in a box without friction oscillates about rho g times the depth.
#[test]
fn fluid_bears_its_weight() {
    const GRAVITY: f64 = 9.8;
    let block = Block { youngs_modulus_pa: 1e6, law: Law::Fluid, ..Block::default() };
    let [low, high] = [0.8_f32, 1.2];
    // On layers of nodes, slightly inside to allow for rounding.
    let gap = -0.001 * block.spacing_m;
    let walls = vec![
        wall([low - gap, 0.0, 0.0], [1.0, 0.0, 0.0], Contact::Slip),
        wall([high + gap, 0.0, 0.0], [-1.0, 0.0, 0.0], Contact::Slip),
        wall([0.0, low - gap, 0.0], [0.0, 1.0, 0.0], Contact::Slip),
        wall([0.0, high + gap, 0.0], [0.0, -1.0, 0.0], Contact::Slip),
        wall([0.0, 0.0, low - gap], [0.0, 0.0, 1.0], Contact::Slip),
    ];
    let mut solver = block.solver([0.0, 0.0, -GRAVITY as f32], walls);
    let (_, bulk_pa) = gprop::simulate::material::lame(block.youngs_modulus_pa, block.poisson_ratio);
    // The period of its lowest acoustic mode, 4 H / c.
    let period = 4.0 * 0.4 / (bulk_pa / block.density_kg_m3).sqrt();
    let dt = f64::from(block.dt_s());
    let steps_of = |periods: f64| (periods * period / dt) as usize;
    // Sums over time per particle: height and pressure.
    let mut sums = vec![[0.0; 2]; block.particles().len()];
    let (from, to) = (steps_of(4.0), steps_of(12.0));
    for step in 0..to {
        solver.step(block.dt_s()).unwrap();
        if step >= from {
            for (sum, p) in sums.iter_mut().zip(particles_of(&solver)) {
                let j = Matrix3::from_row_slice(&p.elastic).map(f64::from).determinant();
                sum[0] += f64::from(p.position_m[2]);
                sum[1] += bulk_pa / 7.0 * (j.powi(-7) - 1.0);
            }
        }
    }
    let count = (to - from) as f64;
    let points: Vec<[f64; 2]> = sums.iter().map(|[z, p]| [z / count, p / count]).collect();
    // Pressure against height, away from floor and surface, by least squares.
    let points: Vec<[f64; 2]> = points.into_iter().filter(|[z, _]| (0.9..1.1).contains(z)).collect();
    let mean = |a: usize| points.iter().map(|p| p[a]).sum::<f64>() / points.len() as f64;
    let [z, p] = [mean(0), mean(1)];
    let covariance: f64 = points.iter().map(|q| (q[0] - z) * (q[1] - p)).sum();
    let slope = covariance / points.iter().map(|q| (q[0] - z).powi(2)).sum::<f64>();
    let expected = -block.density_kg_m3 * GRAVITY;
    assert!((slope / expected - 1.0).abs() < 0.05, "{slope} Pa/m, expected {expected}");
    let surface = z - p / slope;
    assert!((surface - f64::from(high)).abs() < f64::from(block.spacing_m), "no pressure at {surface} m");
}

/// A long heap of sand, `slope_deg` steep on both sides, on rough ground between smooth walls: the slope in
/// degrees, after `seconds`, of a line through the middle half of its surface.
fn slope_after(slope_deg: f64, friction_deg: f64, seconds: f64) -> f64 {
    const GROUND: f32 = 0.5;
    let rise = slope_deg.to_radians().tan();
    let half = (0.5_f64 / rise).min(0.9) as f32;
    let block = Block {
        low_m: [2.0 - half, 0.9, GROUND + 0.0125],
        size_m: [2.0 * half, 0.2, 0.6],
        spacing_m: 0.05,
        density_kg_m3: 1500.0,
        youngs_modulus_pa: 1e6,
        law: Law::DruckerPrager { apex_pa: 0.0 },
        state: drucker_prager::alpha(friction_deg.to_radians()),
        ..Block::default()
    };
    let top = |x: f32| f64::from(GROUND) + f64::from(half - (x - 2.0).abs()) * rise;
    let heap: Vec<Particle> =
        block.particles().into_iter().filter(|p| f64::from(p.position_m[2]) < top(p.position_m[0])).collect();
    let planes = vec![
        wall([0.0, 0.9 - 0.0125, 0.0], [0.0, 1.0, 0.0], Contact::Slip),
        wall([0.0, 1.1 + 0.0125, 0.0], [0.0, -1.0, 0.0], Contact::Slip),
        wall([0.0, 0.0, GROUND], [0.0, 0.0, 1.0], Contact::Sticky),
    ];
    let mut solver = block.solver_of(&heap, [0.0, 0.0, -9.8], planes);
    for _ in 0..(seconds / f64::from(block.dt_s())) as usize {
        solver.step(block.dt_s()).unwrap();
    }
    let particles = particles_of(&solver);
    // The highest particle of each column half a cell wide.
    let mut surface = std::collections::BTreeMap::<i32, f32>::new();
    for p in &particles {
        let column = ((p.position_m[0] - 2.0).abs() / 0.025) as i32;
        let highest = surface.entry(column).or_insert(0.0);
        *highest = highest.max(p.position_m[2]);
    }
    let points: Vec<[f64; 2]> = surface.into_iter().map(|(i, z)| [(f64::from(i) + 0.5) * 0.025, z.into()]).collect();
    let middle = &points[points.len() / 8..points.len() * 5 / 8];
    let mean = |a: usize| middle.iter().map(|p| p[a]).sum::<f64>() / middle.len() as f64;
    let [x, z] = [mean(0), mean(1)];
    let fall = middle.iter().map(|p| (p[0] - x) * (p[1] - z)).sum::<f64>()
        / middle.iter().map(|p| (p[0] - x).powi(2)).sum::<f64>();
    (-fall).atan().to_degrees()
}

/// A heap that is less steep than its friction angle stays; a steeper one slides until it is less steep.
#[test]
fn sand_keeps_its_angle_of_repose() {
    let gentle = slope_after(20.0, 35.0, 1.5);
    let steep = slope_after(60.0, 35.0, 1.5);
    let smooth = slope_after(60.0, 15.0, 1.5);
    assert!((gentle - 20.0).abs() < 3.0, "{gentle} degrees");
    assert!(steep < 35.0 && steep > 20.0, "{steep} degrees");
    assert!(smooth < 15.0 && smooth < steep, "{smooth} degrees");
}
