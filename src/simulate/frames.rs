//! Frames: the Gaussians at the particles' positions, rotated and stretched with the matter around them.
//!
//! A Gaussian's covariance becomes F Sigma F^T with the particle's whole deformation gradient F, plastic stretch and
//! the scenario's tilt included, and is stored again as scale and rotation; its spherical harmonics are rotated by the
//! rotation of F's polar decomposition (after Xie et al., *PhysGaussian*, 2024).

use std::ops::Range;

use nalgebra::{Matrix3, Rotation3, SVD, UnitQuaternion, Vector3};

use super::checkpoint::FrameSummary;
use super::object::Particles;
use crate::gaussians::{Gaussians, wxyz};
use crate::parallel;
use crate::render::sh_rotation::ShRotation;
use crate::scene::robust_bounds;

/// One moment of the simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Counted from 0, the start.
    pub index: usize,
    pub summary: FrameSummary,
    /// World frame and scene units of the input.
    pub gaussians: Gaussians,
}

/// From the simulation's frame to the world's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToWorld {
    /// World position of the simulation's origin, m.
    pub origin_m: Vector3<f64>,
    pub meters_per_unit: f64,
}

/// Centre of mass and energies of all particles at `t_s`, and the bounds of their `gaussians`.
pub fn summary(particles: &Particles, gaussians: &Gaussians, to_world: ToWorld, t_s: f64) -> FrameSummary {
    let (mut mass, mut moment) = (0.0, Vector3::zeros());
    for p in particles.iter() {
        let m = f64::from(p.mass_kg);
        mass += m;
        moment += m * Vector3::from(p.position_m.map(f64::from));
    }
    let elastic: Vec<f64> = parallel::map_range(particles.count(), |id| particles.elastic_j(id));
    let bounds = robust_bounds(gaussians);
    FrameSummary {
        t_s,
        center_of_mass_m: (moment / mass + to_world.origin_m).into(),
        kinetic_energy_j: particles.kinetic_j(),
        elastic_energy_j: elastic.iter().sum(),
        bounds: [bounds.min.into(), bounds.max.into()],
    }
}

/// The Gaussians, moved and deformed with `particles`: particle k is Gaussian `carried[k]`. Other Gaussians are
/// unchanged.
pub fn deformed(gaussians: &Gaussians, carried: &[u32], particles: &Particles, to_world: ToWorld) -> Gaussians {
    /// Gaussians computed before they are stored: their spherical harmonics are most of a scene's memory.
    const AT_ONCE: usize = 1 << 14;
    /// Neighbours that may share a deformation, as those of a rigid body do.
    const RUN: usize = 1 << 8;
    let moved = |ids: Range<usize>| {
        let mut last: Option<([f32; 9], Deformation)> = None;
        ids.map(|id| {
            let i = carried[id];
            let particle = particles.get(id);
            let world_m = Vector3::from(particle.position_m.map(f64::from)) + to_world.origin_m;
            let deformation = match last.take() {
                Some((of, deformation)) if of == particle.deformation => deformation,
                _ => {
                    Deformation::new(gaussians.sh_degree, Matrix3::from_row_slice(&particle.deformation.map(f64::from)))
                }
            };
            let moved = Moved::new(gaussians, i as usize, world_m / to_world.meters_per_unit, &deformation);
            last = Some((particle.deformation, deformation));
            (i, moved)
        })
        .collect::<Vec<_>>()
    };
    let mut out = gaussians.clone();
    for first in (0..carried.len()).step_by(AT_ONCE) {
        let end = carried.len().min(first + AT_ONCE);
        let runs = parallel::map_range((end - first).div_ceil(RUN), |run| {
            let from = first + run * RUN;
            moved(from..end.min(from + RUN))
        });
        for (i, moved) in runs.into_iter().flatten() {
            moved.store(&mut out, i as usize);
        }
    }
    out
}

/// What the matter around a Gaussian does to it.
pub struct Deformation {
    /// The deformation gradient.
    f: Matrix3<f64>,
    /// The rotation that it is, if it changes no shape.
    turn: Option<UnitQuaternion<f64>>,
    harmonics: ShRotation,
}

impl Deformation {
    /// The deformation of Gaussians of this degree with the deformation gradient `f`.
    pub fn new(sh_degree: u8, f: Matrix3<f64>) -> Self {
        /// The largest strain that is rounding: deformation gradients are stored in single precision.
        const ROUNDING: f64 = 1e-6;
        let rotation = polar_rotation(&f);
        let is_turn = (rotation.matrix() - f).amax() < ROUNDING;
        let turn = is_turn.then(|| UnitQuaternion::from_rotation_matrix(&rotation));
        Self { f, turn, harmonics: ShRotation::new(sh_degree, &rotation) }
    }
}

/// The attributes of a Gaussian that change.
pub struct Moved {
    position: [f32; 3],
    log_scale: [f32; 3],
    rotation: [f32; 4],
    sh_rest: Vec<f32>,
}

impl Moved {
    /// Gaussian `i` moved to `position` (world frame, scene units) with this deformation.
    pub fn new(gaussians: &Gaussians, i: usize, position: Vector3<f64>, deformation: &Deformation) -> Self {
        let Deformation { f, turn, harmonics } = deformation;
        let own = gaussians.rotation(i);
        let (log_scale, rotation) = match turn {
            Some(turn) => (gaussians.log_scales[i], wxyz(&(turn * own))),
            None => scale_and_rotation(&(f * own.to_rotation_matrix() * Matrix3::from_diagonal(&gaussians.scale(i)))),
        };
        let mut sh_rest = gaussians.sh_rest_of(i).to_vec();
        harmonics.rotate(&mut sh_rest);
        Self { position: position.map(|x| x as f32).into(), log_scale, rotation, sh_rest }
    }

    /// Stores the result in Gaussian `i`.
    pub fn store(&self, gaussians: &mut Gaussians, i: usize) {
        let rest = 3 * gaussians.sh_rest_per_channel();
        gaussians.positions[i] = self.position;
        gaussians.log_scales[i] = self.log_scale;
        gaussians.rotations[i] = self.rotation;
        gaussians.sh_rest[i * rest..(i + 1) * rest].copy_from_slice(&self.sh_rest);
    }
}

/// Log scales and quaternion (w x y z) of the Gaussian with covariance A A^T.
fn scale_and_rotation(axes: &Matrix3<f64>) -> ([f32; 3], [f32; 4]) {
    let svd = SVD::new_unordered(*axes, true, false);
    let mut turn = svd.u.expect("asked for");
    if turn.determinant() < 0.0 {
        turn.column_mut(0).neg_mut();
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    // A Gaussian pressed flat keeps a thickness whose logarithm is finite.
    let scales = svd.singular_values.map(|s| s.max(f64::from(f32::MIN_POSITIVE)).ln() as f32);
    (scales.into(), wxyz(&q))
}

/// The rotation R of F = R S; if F is inverted, the nearest proper rotation.
fn polar_rotation(f: &Matrix3<f64>) -> Rotation3<f64> {
    let svd = f.svd(true, true);
    let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    Rotation3::from_matrix_unchecked(u * flip * v_t)
}
