//! The peer's constitutive laws: from a trial deformation gradient to the elastic one, and the Kirchhoff stress.
//!
//! All are isotropic, so both are functions of the singular values of F = U S V^T.

use nalgebra::{Matrix3, Vector3};

use super::config::{Config, LawName};
use super::svd::Svd;

/// Stretches below this count as this much in logarithms.
const LEAST_STRETCH: f64 = 0.01;

/// The peer adds it to a strain's norm before it divides by it.
const NORM_OFFSET: f64 = 1e-6;

/// A law with the constants that all particles share.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    pub name: LawName,
    pub hardens: bool,
    /// Hardening modulus as a multiple of 2 mu.
    pub xi: f64,
    pub softening: f64,
    /// Slope of the sand's cone.
    pub alpha: f64,
    pub viscosity: f64,
}

/// What a particle resists with. Metal hardens, plasticine softens and breaks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strength {
    pub mu: f32,
    pub lambda: f32,
    pub yield_stress: f32,
}

impl Strength {
    /// From Young's modulus and Poisson's ratio.
    pub fn new(youngs_modulus: f32, poisson_ratio: f32, yield_stress: f32) -> Self {
        let (e, nu) = (youngs_modulus, poisson_ratio);
        Self { mu: e / (2.0 * (1.0 + nu)), lambda: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), yield_stress }
    }
}

impl Law {
    /// The law of a configuration.
    pub fn new(config: &Config) -> Self {
        let sine = f64::from(config.friction_angle).to_radians().sin();
        Self {
            name: config.material,
            hardens: config.hardening == 1.0,
            xi: config.xi.into(),
            softening: config.softening.into(),
            alpha: (2.0_f64 / 3.0).sqrt() * 2.0 * sine / (3.0 - sine),
            viscosity: config.plastic_viscosity.into(),
        }
    }

    /// The elastic deformation that `trial` is brought back to, and its Kirchhoff stress.
    pub fn respond(&self, trial: &Matrix3<f32>, strength: &mut Strength, dt: f64) -> (Matrix3<f32>, Matrix3<f32>) {
        if self.name == LawName::Snow {
            return (*trial, Matrix3::zeros());
        }
        let svd = Svd::of(trial);
        let s = svd.s.map(f64::from);
        let returned = match self.name {
            LawName::Jelly | LawName::Snow => None,
            LawName::Metal => self.von_mises(&s, strength),
            LawName::Plasticine => self.von_mises_with_damage(&s, strength),
            LawName::Foam => self.viscoplastic(&s, strength, dt),
            LawName::Sand => self.drucker_prager(&s, strength),
        };
        // What comes back from the return map is taken apart anew, as in the peer: the roundings of U and V add up to some
        // of a stiff material's stress.
        let (elastic, svd) = match returned {
            Some(s) => {
                let elastic = svd.with(&s.map(|x| x as f32));
                (elastic, Svd::of(&elastic))
            }
            None => (*trial, svd),
        };
        let stress = match self.name {
            LawName::Jelly | LawName::Plasticine | LawName::Snow => corotated(&elastic, &svd, strength),
            LawName::Metal | LawName::Foam => {
                let eps = svd.s.map(|s| s.max(LEAST_STRETCH as f32).ln());
                svd.with(&hencky(&eps, strength)) * elastic.transpose()
            }
            LawName::Sand => {
                let eps = svd.s.map(f32::ln);
                svd.with(&hencky(&eps, strength).component_div(&svd.s)) * elastic.transpose()
            }
        };
        (elastic, (stress + stress.transpose()) * 0.5)
    }

    /// Radial return to a yield stress that grows with the flow if the law hardens.
    fn von_mises(&self, s: &Vector3<f64>, strength: &mut Strength) -> Option<Vector3<f64>> {
        let (eps, flow, _) = radial_return(s, strength)?;
        self.harden(strength, flow);
        Some(eps.map(f64::exp))
    }

    /// Radial return to a yield stress that falls with the flow; at zero the particle breaks and resists no more.
    fn von_mises_with_damage(&self, s: &Vector3<f64>, strength: &mut Strength) -> Option<Vector3<f64>> {
        if strength.yield_stress <= 0.0 {
            return None;
        }
        let (eps, flow, size) = radial_return(s, strength)?;
        let lost = self.softening * flow * size / (size + NORM_OFFSET);
        strength.yield_stress = (f64::from(strength.yield_stress) - lost) as f32;
        if strength.yield_stress <= 0.0 {
            strength.mu = 0.0;
            strength.lambda = 0.0;
        }
        self.harden(strength, flow);
        Some(eps.map(f64::exp))
    }

    fn harden(&self, strength: &mut Strength, flow: f64) {
        if self.hardens {
            let grown = 2.0 * f64::from(strength.mu) * self.xi * flow;
            strength.yield_stress = (f64::from(strength.yield_stress) + grown) as f32;
        }
    }

    fn viscoplastic(&self, s: &Vector3<f64>, strength: &Strength, dt: f64) -> Option<Vector3<f64>> {
        let mu = f64::from(strength.mu);
        let clamped = s.map(|s| s.max(LEAST_STRETCH));
        let eps = clamped.map(f64::ln);
        let deviator = eps.add_scalar(-eps.mean());
        let size = 2.0 * mu * deviator.norm();
        let excess = size - (2.0_f64 / 3.0).sqrt() * f64::from(strength.yield_stress);
        if excess <= 0.0 {
            return None;
        }
        let mu_hat = mu * clamped.norm_squared() / 3.0;
        let kept = (size - excess / (1.0 + self.viscosity / (2.0 * mu_hat * dt))) / size;
        Some((deviator * kept).add_scalar(eps.mean()).map(f64::exp))
    }

    fn drucker_prager(&self, s: &Vector3<f64>, strength: &Strength) -> Option<Vector3<f64>> {
        let (mu, lambda) = (f64::from(strength.mu), f64::from(strength.lambda));
        let eps = s.map(|s| s.abs().max(1e-14).ln());
        let trace = eps.sum();
        let deviator = eps.add_scalar(-trace / 3.0);
        let size = deviator.norm();
        let flow = size + (3.0 * lambda + 2.0 * mu) / (2.0 * mu) * trace * self.alpha;
        if flow <= 0.0 {
            None
        } else if trace > 0.0 {
            Some(Vector3::repeat(1.0))
        } else {
            Some((eps - deviator * (flow / size)).map(f64::exp))
        }
    }
}

/// 2 mu (F - R) F^T + lambda J (J - 1) I, term by term as the peer rounds it.
fn corotated(f: &Matrix3<f32>, svd: &Svd, strength: &Strength) -> Matrix3<f32> {
    let j = f.determinant();
    (f - svd.u * svd.v.transpose()) * f.transpose() * (2.0 * strength.mu)
        + Matrix3::identity() * (strength.lambda * j * (j - 1.0))
}

/// 2 mu eps + lambda tr(eps), of principal logarithmic strains.
fn hencky(eps: &Vector3<f32>, strength: &Strength) -> Vector3<f32> {
    (eps * (2.0 * strength.mu)).add_scalar(strength.lambda * eps.sum())
}

/// Logarithmic strains brought back to the yield surface, the flow, and the norm of the deviator before; `None` within.
fn radial_return(s: &Vector3<f64>, strength: &Strength) -> Option<(Vector3<f64>, f64, f64)> {
    let (mu, yield_stress) = (f64::from(strength.mu), f64::from(strength.yield_stress));
    let eps = s.map(|s| s.max(LEAST_STRETCH).ln());
    let deviator = eps.add_scalar(-eps.mean());
    let size = deviator.norm();
    if 2.0 * mu * size <= yield_stress {
        return None;
    }
    let flow = size + NORM_OFFSET - yield_stress / (2.0 * mu);
    Some((eps - deviator * (flow / (size + NORM_OFFSET)), flow, size))
}
