use gprop::mpm::eigen::{Stretches, rotation};
use gprop::mpm::laws::energy::elastic_j;
use gprop::mpm::laws::exp;
use gprop::mpm::laws::snow::Snow;
use gprop::mpm::laws::{Law, drucker_prager, stress, von_mises};
use gprop::mpm::matrix::{Mat3, Sym3};
use gprop::mpm::particles::{IDENTITY, Pack, Particle};
use gprop::simd::{LANES, Plain, Vector, ln};
use gprop::simulate::material::lame;
use nalgebra::{Matrix3, SVD};
use proptest::prelude::*;

const E: f64 = 1e6;
const NU: f64 = 0.3;

/// Kirchhoff stress of the matter in `pack`, lane 0, after its return map.
fn tau(pack: &mut Pack, law: Law) -> Matrix3<f64> {
    let Sym3 { xx, yy, zz, xy, xz, yz } = stress::<Plain>(pack, &[law], 1e-4);
    let first = |lanes: Plain| {
        let mut row = [0.0; LANES];
        lanes.store(&mut row);
        f64::from(row[0])
    };
    let [xx, yy, zz, xy, xz, yz] = [xx, yy, zz, xy, xz, yz].map(first);
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

fn pack(elastic: [f32; 9], state: f64) -> Pack {
    let (mu, lambda) = lame(E, NU);
    let particle = Particle {
        position_m: [1.0; 3],
        compensation_m: [0.0; 3],
        velocity_m_s: [0.0; 3],
        affine: [0.0; 9],
        elastic,
        deformation: elastic,
        mass_kg: 1.0,
        volume_m3: 1.0,
        mu: mu as f32,
        lambda: lambda as f32,
        state: state as f32,
        law: 0,
    };
    Pack::gather([(0, particle)].into_iter())
}

fn diagonal(x: f64, y: f64, z: f64) -> [f32; 9] {
    [x as f32, 0.0, 0.0, 0.0, y as f32, 0.0, 0.0, 0.0, z as f32]
}

/// Small strain: sigma = 2 mu eps + lambda tr(eps) for every elastic law; large pure rotation: none.
#[test]
fn small_strains_follow_hooke() {
    let (mu, lambda) = lame(E, NU);
    let eps = [2e-3, -1e-3, 5e-4];
    let expected = |i: usize| 2.0 * mu * eps[i] + lambda * eps.iter().sum::<f64>();
    for law in [Law::FixedCorotated, Law::VonMises { hardening: 0.0, softening: 0.0 }] {
        let tau = tau(&mut pack(diagonal(1.0 + eps[0], 1.0 + eps[1], 1.0 + eps[2]), 1e9), law);
        for i in 0..3 {
            // Errors of second order in the strain, and of f32.
            assert!((tau[(i, i)] - expected(i)).abs() < 0.01 * 2.0 * mu * 2e-3, "{law:?}: {tau}");
        }
    }
    let turned = [0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6];
    assert!(tau(&mut pack(turned, 1e9), Law::FixedCorotated).norm() < 1e-5 * E);
}

/// Pulled along x with free sides, the stress rises as E ln(stretch) to the yield stress and stays there.
#[test]
fn von_mises_holds_its_yield_stress_in_tension() {
    const YIELD: f64 = 5e3;
    let law = Law::VonMises { hardening: 0.0, softening: 0.0 };
    let mut matter = pack(IDENTITY, von_mises::yield_radius(YIELD));
    let mut stretch = 1.0_f64;
    for step in 1..=100 {
        let pull = 1.0002_f64;
        stretch *= pull;
        // The sides move so that they are free of stress.
        let loaded = |side: f64| {
            let mut trial = matter.clone();
            for (row, factor) in [(0, pull), (4, side), (8, side)] {
                trial.elastic[row][0] *= factor as f32;
            }
            let tau = tau(&mut trial, law);
            (trial, tau)
        };
        let (mut thin, mut thick) = (1.0 - 2e-4, 1.0 + 2e-4);
        for _ in 0..40 {
            let middle = 0.5 * (thin + thick);
            if loaded(middle).1[(1, 1)] > 0.0 { thick = middle } else { thin = middle }
        }
        let (after, tau) = loaded(0.5 * (thin + thick));
        matter = after;
        let expected = (E * stretch.ln()).min(YIELD);
        // One f32 rounding of F is 6e-8 of E here, the sides' search as much.
        assert!((tau[(0, 0)] - expected).abs() < 0.02 * YIELD, "step {step}: {} Pa, expected {expected}", tau[(0, 0)]);
    }
    assert!(E * stretch.ln() > 3.0 * YIELD, "the pull should go far beyond yield");
}

/// Sheared under pressure, sand slides on the cone |dev tau| = 3 alpha p of its friction angle; pulled, it
/// bears no stress; compressed evenly, it is elastic.
#[test]
fn sand_slides_on_its_cone_and_bears_no_tension() {
    let (mu, lambda) = lame(E, NU);
    let alpha = drucker_prager::alpha(30.0_f64.to_radians());
    let pulled = tau(&mut pack(diagonal(1.02, 1.0, 1.0), alpha), Law::DruckerPrager { apex_pa: 0.0 });
    assert!(pulled.norm() < 1e-5 * E, "{pulled}");
    let sheared = tau(&mut pack(diagonal(1.03, 0.96, 0.99), alpha), Law::DruckerPrager { apex_pa: 0.0 });
    let pressure = -sheared.trace() / 3.0;
    let deviator = (sheared + Matrix3::identity() * pressure).norm();
    // |dev eps| = -alpha tr(eps) (3 lambda + 2 mu) / (2 mu), with tr(tau) = (3 lambda + 2 mu) tr(eps).
    assert!((deviator - alpha * 3.0 * pressure).abs() < 1e-3 * deviator, "{deviator} at {pressure} Pa");
    let squeezed = tau(&mut pack(diagonal(0.98, 0.98, 0.98), alpha), Law::DruckerPrager { apex_pa: 0.0 });
    let expected = (3.0 * lambda + 2.0 * mu) * 0.98_f64.ln();
    assert!((squeezed[(0, 0)] - expected).abs() < 1e-3 * expected.abs(), "{squeezed}");
}

/// At a constant stretch, the stress of foam relaxes to its yield stress: the more viscous, the slower.
#[test]
fn foam_relaxes_to_its_yield_stress() {
    const YIELD: f64 = 5e3;
    let stretched = diagonal(1.02, 0.99, 0.99);
    let size = |t: Matrix3<f64>| (t - Matrix3::identity() * (t.trace() / 3.0)).norm();
    let after = |viscosity_pa_s: f32, steps: usize| {
        let mut matter = pack(stretched, von_mises::yield_radius(YIELD));
        (0..steps).map(|_| size(tau(&mut matter, Law::Foam { viscosity_pa_s }))).last().unwrap()
    };
    let radius = von_mises::yield_radius(YIELD);
    assert!((after(0.0, 1) - radius).abs() < 2e-2 * radius, "{}", after(0.0, 1));
    // excess / (1 + eta / (2 mu dt)) per step: with eta = 2 mu dt about half of it is left after one.
    let (mu, _) = lame(E, NU);
    let viscosity = (2.0 * mu * 1e-4) as f32;
    let start = size(tau(&mut pack(stretched, 1e12), Law::Foam { viscosity_pa_s: 0.0 }));
    let left = (after(viscosity, 1) - radius) / (start - radius);
    assert!((left - 0.5).abs() < 0.02, "{left}");
    assert!((after(viscosity, 30) - radius).abs() < 2e-2 * radius);
}

/// Kneaded clay bears less and less; without softening it would bear the same.
#[test]
fn plasticine_softens_as_it_flows() {
    const YIELD: f64 = 5e3;
    let (mu, _) = lame(E, NU);
    let radius = von_mises::yield_radius(YIELD);
    let mut matter = pack(diagonal(1.1, 1.0 / 1.1, 1.0), radius);
    let flow = (2.0_f64).sqrt() * 1.1_f64.ln() - radius / (2.0 * mu);
    tau(&mut matter, Law::VonMises { hardening: 0.0, softening: 3.0 });
    let kept = f64::from(matter.state[0]) / radius;
    assert!((kept - 1.0 / (1.0 + 3.0 * flow)).abs() < 1e-3, "{kept}");
}

/// Snow keeps its elastic stretch within its bounds, hardens if packed, softens if torn, and keeps its stress in both
/// cases.
#[test]
fn snow_yields_at_its_bounds_and_hardens_when_packed() {
    let law = Law::Snow(Snow { theta_c: 0.025, theta_s: 0.0075, xi: 10.0 });
    let mut small = pack(diagonal(1.001, 1.0, 1.0), 1.0);
    let stress = tau(&mut small, law)[(0, 0)];
    let (mu, lambda) = lame(E, NU);
    assert!((stress / ((2.0 * mu + lambda) * 1e-3) - 1.0).abs() < 0.01, "{stress}");
    let mut packed = pack(diagonal(0.9, 1.0, 1.0), 1.0);
    let packed_stress = tau(&mut packed, law)[(0, 0)];
    assert!((f64::from(packed.elastic[0][0]) - 0.975).abs() < 1e-4, "{}", packed.elastic[0][0]);
    assert!((f64::from(packed.state[0]) - 0.9 / 0.975).abs() < 1e-4, "{}", packed.state[0]);
    let harder = (10.0 * (1.0 - 0.9 / 0.975_f64)).exp();
    let expected = harder * (2.0 * mu * -0.025 * 0.975 + lambda * 0.975 * -0.025);
    assert!((packed_stress / expected - 1.0).abs() < 0.01, "{packed_stress} {expected}");
    let mut torn = pack(diagonal(1.1, 1.0, 1.0), 1.0);
    let torn_stress = tau(&mut torn, law)[(0, 0)];
    assert!(torn.state[0] > 1.05 && torn_stress > 0.0 && torn_stress < 0.0075 * (2.0 * mu + lambda), "{torn_stress}");
}

/// With cohesion, sand bears the tension c cot(phi) in every direction, and no more.
#[test]
fn cohesion_bears_tension_up_to_the_apex() {
    let phi = 30.0_f64.to_radians();
    let apex = drucker_prager::apex(2e3, phi);
    let law = Law::DruckerPrager { apex_pa: apex as f32 };
    let pulled = tau(&mut pack(diagonal(1.02, 1.02, 1.02), drucker_prager::alpha(phi)), law);
    assert!((pulled - Matrix3::identity() * apex).norm() < 2e-2 * apex, "{pulled} {apex}");
    let slight = 0.5 * apex / (lame(E, NU).1 * 3.0 + lame(E, NU).0 * 2.0);
    let held = tau(&mut pack(diagonal(1.0 + slight, 1.0 + slight, 1.0 + slight), drucker_prager::alpha(phi)), law);
    assert!((held[(0, 0)] / (0.5 * apex) - 1.0).abs() < 0.02, "{held}");
}

/// A fluid's pressure is K times its compression, whatever its shape; pulled apart, it bears no tension.
#[test]
fn fluid_bears_pressure_alone() {
    let (_, bulk) = lame(E, NU);
    let sheared = tau(&mut pack(diagonal(1.25, 0.8, 0.999), 0.0), Law::Fluid);
    let expected = -bulk / 7.0 * (0.999_f64.powi(-7) - 1.0) * 0.999;
    assert!((sheared - Matrix3::identity() * expected).norm() < 5e-3 * expected.abs(), "{sheared} {expected}");
    assert!(tau(&mut pack(diagonal(1.1, 1.0, 1.0), 0.0), Law::Fluid).norm() < 1e-5 * bulk);
}

/// The stress is the derivative of the energy, tau = d(psi)/dF F^T, in every direction of F.
#[test]
fn stress_is_the_slope_of_the_energy() {
    let f = Matrix3::new(0.95, 0.04, -0.03, -0.02, 0.97, 0.05, 0.01, -0.06, 0.94);
    let rows = |f: &Matrix3<f64>| -> [f32; 9] { std::array::from_fn(|i| f[(i / 3, i % 3)] as f32) };
    let snow = Law::Snow(Snow { theta_c: 0.5, theta_s: 0.5, xi: 10.0 });
    for (law, state) in [
        (Law::FixedCorotated, 0.0),
        (Law::VonMises { hardening: 0.0, softening: 0.0 }, 1e9),
        (Law::DruckerPrager { apex_pa: 1e9 }, 10.0),
        (Law::Foam { viscosity_pa_s: 1.0 }, 1e9),
        (snow, 0.95),
        (Law::Fluid, 0.0),
        (Law::Rigid, 0.0),
    ] {
        let energy = |f: &Matrix3<f64>| elastic_j(law, &pack(rows(f), state).particle(0));
        let tau = tau(&mut pack(rows(&f), state), law);
        // F is rounded to 1e-7 of itself: the slope over 2e-3 is good to about 1e-4 of the stiffness, times the strain.
        const STEP: f64 = 1e-3;
        for i in 0..3 {
            for j in 0..3 {
                let mut change = Matrix3::zeros();
                change[(i, j)] = STEP;
                // F + dF with dF = e_i e_j^T F changes psi by tau_ij.
                let slope = (energy(&(f + change * f)) - energy(&(f - change * f))) / (2.0 * STEP);
                assert!((slope - tau[(i, j)]).abs() < 2e-3 * E * 0.1, "{law:?} {i} {j}: {slope}, not {}", tau[(i, j)]);
            }
        }
        // This match does not compile if a law is missing.
        match law {
            Law::FixedCorotated | Law::VonMises { .. } | Law::DruckerPrager { .. } => {}
            Law::Foam { .. } | Law::Snow(_) | Law::Fluid | Law::Rigid => {}
        }
        // At rest there is none.
        assert!(energy(&Matrix3::identity()).abs() < 1e-9, "{law:?}");
    }
}

fn lanes_of(m: &Matrix3<f64>) -> Mat3<Plain> {
    let mut out = Mat3([[Plain::splat(0.0); 3]; 3]);
    for r in 0..3 {
        for c in 0..3 {
            out.0[r][c] = Plain::splat(m[(r, c)] as f32);
        }
    }
    out
}

fn value(lanes: Plain) -> f64 {
    let mut row = [0.0; LANES];
    lanes.store(&mut row);
    f64::from(row[0])
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Against nalgebra's SVD in f64, for moderate deformations, including rotated and inverted ones.
    #[test]
    fn stretches_and_rotation_agree_with_an_svd(entries in prop::array::uniform9(-1.5_f64..1.5)) {
        let f = Matrix3::from_row_slice(&entries);
        let SVD { u, v_t, singular_values } = f.svd(true, true);
        let (u, v_t) = (u.unwrap(), v_t.unwrap());
        prop_assume!(singular_values.min() > 0.05);
        // If two stretches nearly cancel in the signed sum, the rotation itself is ill-defined.
        let sign = f.determinant().signum();
        prop_assume!(sign > 0.0 || singular_values[1] - singular_values.min() > 0.1);
        let stretches = Stretches::of(&lanes_of(&f));
        let mut found = stretches.stretch.map(value);
        found.sort_by(|a, b| b.abs().total_cmp(&a.abs()));
        let expected = [singular_values[0], singular_values[1], singular_values[2] * sign];
        for i in 0..3 {
            // Computed from F F^T, the smallest stretch loses digits in proportion to how much smaller than the largest
            // it is.
            prop_assert!((found[i] - expected[i]).abs() < 2e-5 * singular_values.max() / singular_values.min(), "{found:?} {expected:?}");
        }
        let r = rotation(&lanes_of(&f));
        let flip = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, (u * v_t).determinant()));
        let nearest = u * flip * v_t;
        for i in 0..3 {
            for j in 0..3 {
                prop_assert!((value(r.0[i][j]) - nearest[(i, j)]).abs() < 2e-3, "{} {}", value(r.0[i][j]), nearest[(i, j)]);
            }
        }
    }

    #[test]
    fn logarithm_and_exponential_are_those_of_the_library(x in 1e-4_f32..1e4, y in -20.0_f32..20.0) {
        let (log, power) = (value(ln(Plain::splat(x))), value(exp(Plain::splat(y))));
        prop_assert!((log - f64::from(x).ln()).abs() < 1e-6 * (1.0 + f64::from(x).ln().abs()), "ln {x} = {log}");
        prop_assert!((power / f64::from(y).exp() - 1.0).abs() < 1e-6, "exp {y} = {power}");
    }
}
