//! Against trajectories of the public PhysGaussian solver, kept beside the repository where it is developed. gprop's
//! transfer differs from the peer's (MLS instead of B-spline gradients in force and deformation), so the
//! trajectories agree as closely as two discretisations of one problem do, not to rounding.

use std::io::{Cursor, Read};

use gprop::mpm::boundary::{Boundary, Contact};
use gprop::mpm::laws::{Law, drucker_prager};
use gprop::mpm::particles::{IDENTITY, Particle};
use gprop::mpm::{Setting, Solver};
use gprop::simulate::material::lame;
use nalgebra::Vector3;
use serde_json::Value;

use super::{particles_of, totals};
use crate::support::shared;

/// A NumPy archive of little-endian arrays.
struct Npz(zip::ZipArchive<Cursor<Vec<u8>>>);

impl Npz {
    /// The reference `name`; `None`, with a message, if it is not there.
    fn reference(name: &str) -> Option<Self> {
        let bytes = std::fs::read(shared("follows_the_peer", &format!("reference/mpm/{name}"))?).unwrap();
        Some(Self(zip::ZipArchive::new(Cursor::new(bytes)).unwrap()))
    }

    /// The bytes of an array, after its header.
    fn data(&mut self, name: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.0.by_name(&format!("{name}.npy")).unwrap().read_to_end(&mut bytes).unwrap();
        let header = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        bytes.split_off(10 + header)
    }

    fn f32s(&mut self, name: &str) -> Vec<f32> {
        self.data(name).chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn f64s(&mut self, name: &str) -> Vec<f64> {
        self.data(name).chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
    }

    /// The run's description: a NumPy string is UTF-32.
    fn meta(&mut self) -> Value {
        let text: String = self
            .data("meta")
            .chunks_exact(4)
            .filter_map(|b| char::from_u32(u32::from_le_bytes(b.try_into().unwrap())))
            .filter(|c| *c != '\0')
            .collect();
        serde_json::from_str(&text).unwrap()
    }
}

/// Largest distance of the centres of mass, m, and difference of the kinetic energies over their maximum, over all
/// frames.
fn deviation(name: &str) -> Option<(f64, f64)> {
    let mut npz = Npz::reference(name)?;
    let meta = npz.meta();
    let number = |key: &str| meta["params"][key].as_f64().unwrap();
    let (mu, lambda) = lame(number("E"), number("nu"));
    let (law, state) = match meta["params"]["material"].as_str().unwrap() {
        "jelly" => (Law::FixedCorotated, 0.0),
        "metal" => (Law::VonMises { hardening: 0.0, softening: 0.0 }, number("yield_stress")),
        "sand" => (Law::DruckerPrager { apex_pa: 0.0 }, drucker_prager::alpha(number("friction_angle").to_radians())),
        other => panic!("no law for {other}"),
    };
    let (x0, v0, vol, mass) = (npz.f32s("x0"), npz.f32s("v0"), npz.f32s("vol"), npz.f32s("mass"));
    let particles: Vec<Particle> = (0..vol.len())
        .map(|i| Particle {
            position_m: x0[3 * i..3 * i + 3].try_into().unwrap(),
            compensation_m: [0.0; 3],
            velocity_m_s: v0[3 * i..3 * i + 3].try_into().unwrap(),
            affine: [0.0; 9],
            elastic: IDENTITY,
            deformation: IDENTITY,
            mass_kg: mass[i],
            volume_m3: vol[i],
            mu: mu as f32,
            lambda: lambda as f32,
            state: state as f32,
            law: 0,
        })
        .collect();
    let spacing_m = 2.0 / meta["n_grid"].as_f64().unwrap() as f32;
    let ground = meta["bcs"].as_array().unwrap().iter().filter(|bc| bc["type"] == "surface_collider").map(|bc| {
        // The peer stops nodes strictly below the plane.
        let height = bc["point"][2].as_f64().unwrap() as f32 - 0.01 * spacing_m;
        Boundary { point_m: [0.0, 0.0, height], normal: [0.0, 0.0, 1.0], contact: Contact::Sticky }
    });
    let setting = Setting {
        spacing_m,
        gravity_m_s2: [0, 1, 2].map(|a| meta["params"]["g"][a].as_f64().unwrap() as f32),
        boundaries: ground.collect(),
        domain_m: [[0.0; 3], [2.0; 3]],
        laws: vec![law],
    };
    let (com, ke) = (npz.f64s("com"), npz.f64s("ke"));
    let most = ke.iter().copied().fold(0.0, f64::max);
    let mut solver = Solver::new(setting, particles);
    let (mut apart, mut energy) = (0.0_f64, 0.0_f64);
    for frame in 1..ke.len() {
        for _ in 0..meta["substeps_per_frame"].as_u64().unwrap() {
            solver.step(meta["dt"].as_f64().unwrap() as f32).unwrap();
        }
        let particles = particles_of(&solver);
        apart = apart.max((totals(&particles).1 - Vector3::from_column_slice(&com[3 * frame..3 * frame + 3])).norm());
        let own: f64 = particles
            .iter()
            .map(|p| 0.5 * f64::from(p.mass_kg) * Vector3::from(p.velocity_m_s.map(f64::from)).norm_squared())
            .sum();
        energy = energy.max((own - ke[frame]).abs() / most);
    }
    println!("{name}: centre of mass within {apart:.2e} m, kinetic energy within {energy:.2e} of its maximum");
    Some((apart, energy))
}

#[test]
fn follows_the_peer() {
    for (name, com_m, ke) in [
        // Free motion differs least; if a body of 0.4 m hits the ground, by a tenth of a cell of 0.04 m.
        ("spin5k_g48_apic.npz", 1e-6, 1e-3),
        ("drop_cube10k_g48_jelly.npz", 5e-3, 5e-2),
        ("drop_cube10k_g48_metal.npz", 5e-3, 5e-2),
        ("drop_cube10k_g48_sand.npz", 5e-3, 5e-2),
        ("sandcol10k_g48.npz", 5e-3, 5e-2),
    ] {
        if let Some((apart, energy)) = deviation(name) {
            assert!(apart < com_m && energy < ke, "{name}: {apart} m, {energy}");
        }
    }
}
