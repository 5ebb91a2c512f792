//! One particle in the peer's box.

use nalgebra::{Matrix3, Vector3};

use super::law::Strength;

type Vec3 = Vector3<f32>;
type Mat3 = Matrix3<f32>;

/// One particle in the peer's box.
#[derive(Debug, Clone, PartialEq)]
pub struct Particle {
    pub position: Vec3,
    pub velocity: Vec3,
    pub affine: Mat3,
    /// Deformation gradient before the return map.
    pub trial: Mat3,
    /// Deformation gradient after the return map.
    pub elastic: Mat3,
    pub stress: Mat3,
    pub volume: f32,
    pub mass: f32,
    pub strength: Strength,
    /// Index into the solver's laws; the peer has one.
    pub law: u32,
}

impl Particle {
    pub fn at_rest(position: Vec3, volume: f32, mass: f32, strength: Strength) -> Self {
        Self {
            position,
            velocity: Vec3::zeros(),
            affine: Mat3::zeros(),
            trial: Mat3::identity(),
            elastic: Mat3::zeros(),
            stress: Mat3::zeros(),
            volume,
            mass,
            strength,
            law: 0,
        }
    }
}
