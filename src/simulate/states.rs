//! The particles of a frame for other programs: a NumPy archive with the arrays that PhysGaussian writes to its HDF5
//! files, `x` (n, 3), `v` (n, 3), `f_tensor` (n, 3, 3; the elastic deformation gradient) and `C` (n, 3, 3; the affine
//! velocity), and `mass` and `volume` (n). Coordinates and units are the solver's: metres in the simulation's box.

use std::io::{self, Write};

use super::compat::particle::Particle as CompatParticle;
use crate::files::npz::NpzWriter;
use crate::mpm::particles::Particle;

/// The state of one particle; matrices row by row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    x: [f32; 3],
    v: [f32; 3],
    f_tensor: [f32; 9],
    c: [f32; 9],
    mass: f32,
    volume: f32,
}

impl From<Particle> for State {
    fn from(p: Particle) -> Self {
        let Particle { position_m: x, velocity_m_s: v, elastic: f_tensor, affine: c, .. } = p;
        Self { x, v, f_tensor, c, mass: p.mass_kg, volume: p.volume_m3 }
    }
}

impl From<&CompatParticle> for State {
    fn from(p: &CompatParticle) -> Self {
        let rows = |m: &nalgebra::Matrix3<f32>| -> [f32; 9] { std::array::from_fn(|i| m[(i / 3, i % 3)]) };
        let (f_tensor, c) = (rows(&p.elastic), rows(&p.affine));
        Self { x: p.position.into(), v: p.velocity.into(), f_tensor, c, mass: p.mass, volume: p.volume }
    }
}

/// Writes an NPZ file of the particles.
///
/// # Errors
/// If writing fails.
pub fn write(out: impl Write, states: &[State]) -> io::Result<()> {
    let n = states.len() as u64;
    let states = || states.iter();
    let mut npz = NpzWriter::new(out);
    npz.array("x", &[n, 3], states().flat_map(|s| s.x))?;
    npz.array("v", &[n, 3], states().flat_map(|s| s.v))?;
    npz.array("f_tensor", &[n, 3, 3], states().flat_map(|s| s.f_tensor))?;
    npz.array("C", &[n, 3, 3], states().flat_map(|s| s.c))?;
    npz.array("mass", &[n], states().map(|s| s.mass))?;
    npz.array("volume", &[n], states().map(|s| s.volume))?;
    npz.finish()
}
