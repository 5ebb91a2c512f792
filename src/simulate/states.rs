//! The particles of a frame for other programs: a NumPy archive with the arrays that PhysGaussian keeps in its HDF5 files,
//! `x` (n, 3), `v` (n, 3), `f_tensor` (n, 3, 3; the elastic deformation gradient) and `C` (n, 3, 3; the affine velocity),
//! and `mass` and `volume` (n). Frame and units are the solver's: metres in the simulation's box.

use std::io::{self, Cursor};

use super::compat::solver::Particle as CompatParticle;
use super::mpm::particles::Particle;
use crate::npz;

/// The arrays, row-major.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct States {
    x: Vec<f32>,
    v: Vec<f32>,
    f_tensor: Vec<f32>,
    c: Vec<f32>,
    mass: Vec<f32>,
    volume: Vec<f32>,
}

impl States {
    /// Those of the default solver.
    pub fn of(particles: &[Particle]) -> Self {
        let mut states = Self::default();
        for p in particles {
            states.x.extend(p.position_m);
            states.v.extend(p.velocity_m_s);
            states.f_tensor.extend(p.elastic);
            states.c.extend(p.affine);
            states.mass.push(p.mass_kg);
            states.volume.push(p.volume_m3);
        }
        states
    }

    /// Those of the solver that follows the peer.
    pub fn of_compat(particles: &[CompatParticle]) -> Self {
        let mut states = Self::default();
        for p in particles {
            states.x.extend(p.position.iter());
            states.v.extend(p.velocity.iter());
            // nalgebra keeps columns together.
            states.f_tensor.extend(p.elastic.transpose().iter());
            states.c.extend(p.affine.transpose().iter());
            states.mass.push(p.mass);
            states.volume.push(p.volume);
        }
        states
    }

    /// As the bytes of an NPZ file.
    ///
    /// # Errors
    /// What the encoder reports.
    pub fn to_npz(&self) -> io::Result<Vec<u8>> {
        let n = self.mass.len() as u64;
        let mut bytes = Cursor::new(Vec::new());
        npz::write(
            &mut bytes,
            &[
                ("x", &[n, 3], &self.x),
                ("v", &[n, 3], &self.v),
                ("f_tensor", &[n, 3, 3], &self.f_tensor),
                ("C", &[n, 3, 3], &self.c),
                ("mass", &[n], &self.mass),
                ("volume", &[n], &self.volume),
            ],
        )?;
        Ok(bytes.into_inner())
    }
}
