//! The elastic energy from which the laws' stresses derive, tau = d(psi)/dF F^T: for reports, one particle at a time,
//! in f64.

use nalgebra::{Matrix3, Vector3};

use super::{Law, fluid, hencky};
use crate::mpm::particles::Particle;

/// Elastic energy of a particle by its law, J.
pub fn elastic_j(law: Law, particle: &Particle) -> f64 {
    let f = Matrix3::from_row_slice(&particle.elastic.map(f64::from));
    let (mu, lambda) = (f64::from(particle.mu), f64::from(particle.lambda));
    let psi = match law {
        Law::Rigid => 0.0,
        Law::FixedCorotated => corotated(&f, mu, lambda),
        Law::Snow(snow) => snow.hardening(particle.state.into()) * corotated(&f, mu, lambda),
        Law::VonMises { .. } | Law::DruckerPrager { .. } | Law::Foam { .. } => {
            let eps = f.singular_values().map(|s| s.max(hencky::LEAST_STRETCH.into()).ln());
            mu * eps.norm_squared() + 0.5 * lambda * eps.sum().powi(2)
        }
        // The work against p = K / gamma (J^-gamma - 1) when the volume ratio goes from 1 to J.
        Law::Fluid => {
            let (gamma, j) = (f64::from(fluid::GAMMA), f.determinant().clamp(fluid::LEAST_RATIO.into(), 1.0));
            lambda / gamma * ((j.powf(1.0 - gamma) - 1.0) / (gamma - 1.0) + j - 1.0)
        }
    };
    f64::from(particle.volume_m3) * psi
}

/// mu |F - R|^2 + lambda / 2 (J - 1)^2.
fn corotated(f: &Matrix3<f64>, mu: f64, lambda: f64) -> f64 {
    let j = f.determinant();
    let mut stretches = f.singular_values();
    stretches.z *= j.signum();
    mu * (stretches - Vector3::repeat(1.0)).norm_squared() + 0.5 * lambda * (j - 1.0).powi(2)
}
