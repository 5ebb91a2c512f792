//! The peer's constitutive laws: from a trial deformation gradient to the elastic one, and the Kirchhoff stress.
//!
//! All are isotropic, so both are functions of the singular values of F = U S V^T. Every operation is in f32 and in the
//! peer's order: a stiff material's strain is only a few hundred rounding errors of F, so accumulated rounding shows in
//! its stress.

use nalgebra::{Matrix3, Vector3};

use super::config::{Config, LawName};
use super::svd::Svd;

type Vec3 = Vector3<f32>;
type Mat3 = Matrix3<f32>;

/// Stretches below this are raised to it before taking logarithms; the second value is for sand.
const LEAST_STRETCH: f32 = 0.01;
const LEAST_SAND_STRETCH: f32 = 1e-14;

/// The peer adds this to a strain's norm before dividing by it.
const NORM_OFFSET: f32 = 1e-6;

#[expect(clippy::approx_constant, reason = "the peer's pi has this many digits")]
const PI: f64 = 3.141_592_65;

/// A law with the constants that all particles share.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    name: LawName,
    hardens: bool,
    /// Hardening modulus as a multiple of 2 mu.
    xi: f32,
    softening: f32,
    /// Slope of the sand's cone.
    alpha: f32,
    viscosity: f32,
}

/// A particle's elastic constants and yield stress. Metal hardens; plasticine softens and breaks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strength {
    pub mu: f32,
    pub lambda: f32,
    pub yield_stress: f32,
}

impl Strength {
    /// A particle's strength from Young's modulus, Poisson's ratio and the yield stress.
    pub fn new(youngs_modulus: f32, poisson_ratio: f32, yield_stress: f32) -> Self {
        let (e, nu) = (youngs_modulus, poisson_ratio);
        Self { mu: e / (2.0 * (1.0 + nu)), lambda: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), yield_stress }
    }

    /// 2 mu eps + lambda tr(eps), for principal logarithmic strains.
    fn hencky(&self, eps: &Vec3) -> Vec3 {
        (eps * (2.0 * self.mu)).add_scalar(self.lambda * (eps.x + eps.y + eps.z))
    }
}

impl Law {
    /// The law of a configuration. As in the peer, sine and square root are in f32.
    pub fn new(config: &Config) -> Self {
        let sine = f64::from(((f64::from(config.friction_angle) / 180.0 * PI) as f32).sin());
        let root = f64::from((2.0_f32 / 3.0).sqrt());
        Self {
            name: config.material,
            hardens: config.hardening == 1.0,
            xi: config.xi,
            softening: config.softening,
            alpha: (root * 2.0 * sine / (3.0 - sine)) as f32,
            viscosity: config.plastic_viscosity,
        }
    }

    /// The elastic deformation that the return map makes of `trial`, and its Kirchhoff stress.
    pub fn respond(&self, trial: &Mat3, strength: &mut Strength, dt: f32) -> (Mat3, Mat3) {
        if self.name == LawName::Snow {
            return (*trial, Mat3::zeros());
        }
        let svd = Svd::of(trial);
        let returned = match self.name {
            LawName::Jelly | LawName::Snow => None,
            LawName::Metal | LawName::Plasticine => self.von_mises(&svd.s, strength),
            LawName::Foam => self.viscoplastic(&svd.s, strength, dt),
            LawName::Sand => self.drucker_prager(&svd.s, strength),
        };
        // The result of the return map is decomposed again.
        let (elastic, svd) = match returned {
            Some(s) => {
                let elastic = svd.with(&s);
                (elastic, Svd::of(&elastic))
            }
            None => (*trial, svd),
        };
        let stress = match self.name {
            LawName::Jelly | LawName::Plasticine | LawName::Snow => corotated(&elastic, &svd, strength),
            LawName::Metal | LawName::Foam => svd.with(&strength.hencky(&log_stretch(&svd.s))) * elastic.transpose(),
            LawName::Sand => {
                let (eps, per_s) = (svd.s.map(f32::ln), svd.s.map(|s| 1.0 / s));
                let trace = eps.x + eps.y + eps.z;
                let (mu, lambda) = (strength.mu, strength.lambda);
                let tau = eps.zip_map(&per_s, |eps, per_s| 2.0 * mu * eps * per_s + lambda * trace * per_s);
                svd.with(&tau) * elastic.transpose()
            }
        };
        (elastic, (stress + stress.transpose()) / 2.0)
    }

    /// Radial return of the stretches `s`; `None` within the yield surface. Metal's yield stress grows with the flow if
    /// the law hardens; plasticine's falls with it, and at zero the particle breaks and has no more strength.
    fn von_mises(&self, s: &Vec3, strength: &mut Strength) -> Option<Vec3> {
        let softens = self.name == LawName::Plasticine;
        let eps = log_stretch(s);
        let mean = (eps.x + eps.y + eps.z) / 3.0;
        let tau = strength.hencky(&eps);
        let pressure = (tau.x + tau.y + tau.z) / 3.0;
        let within = tau.add_scalar(-pressure).norm() <= strength.yield_stress;
        if within || (softens && strength.yield_stress <= 0.0) {
            return None;
        }
        let deviator = eps.add_scalar(-mean);
        let size = deviator.norm() + NORM_OFFSET;
        let flow = size - strength.yield_stress / (2.0 * strength.mu);
        let plastic = deviator * (flow / size);
        if softens {
            strength.yield_stress -= self.softening * plastic.norm();
            if strength.yield_stress <= 0.0 {
                strength.mu = 0.0;
                strength.lambda = 0.0;
            }
        }
        if self.hardens {
            strength.yield_stress += 2.0 * strength.mu * self.xi * flow;
        }
        Some((eps - plastic).map(f32::exp))
    }

    fn viscoplastic(&self, s: &Vec3, strength: &Strength, dt: f32) -> Option<Vec3> {
        let mu = strength.mu;
        let s = s.map(|s| s.max(LEAST_STRETCH));
        let eps = s.map(f32::ln);
        let mean = (eps.x + eps.y + eps.z) / 3.0;
        let stress = eps.add_scalar(-mean) * (2.0 * mu);
        let size = stress.norm();
        let excess = size - (2.0_f32 / 3.0).sqrt() * strength.yield_stress;
        if excess <= 0.0 {
            return None;
        }
        let mu_hat = mu * (s.x * s.x + s.y * s.y + s.z * s.z) / 3.0;
        let kept = size - excess / (1.0 + self.viscosity / (2.0 * mu_hat * dt));
        let eps = (stress * (kept / size)) * (1.0 / (2.0 * mu));
        Some(eps.add_scalar(mean).map(f32::exp))
    }

    fn drucker_prager(&self, s: &Vec3, strength: &Strength) -> Option<Vec3> {
        let (mu, lambda) = (strength.mu, strength.lambda);
        let eps = s.map(|s| s.abs().max(LEAST_SAND_STRETCH).ln());
        let trace = eps.x + eps.y + eps.z;
        let deviator = eps.add_scalar(-(trace / 3.0));
        let size = deviator.norm();
        let flow = size + (3.0 * lambda + 2.0 * mu) / (2.0 * mu) * trace * self.alpha;
        if flow <= 0.0 {
            None
        } else if trace > 0.0 {
            Some(Vec3::repeat(1.0))
        } else {
            Some((eps - deviator * (flow / size)).map(f32::exp))
        }
    }
}

fn log_stretch(s: &Vec3) -> Vec3 {
    s.map(|s| s.max(LEAST_STRETCH).ln())
}

/// 2 mu (F - R) F^T + lambda J (J - 1) I.
fn corotated(f: &Mat3, svd: &Svd, strength: &Strength) -> Mat3 {
    let j = f.determinant();
    (f - svd.u * svd.v.transpose()) * (2.0 * strength.mu) * f.transpose()
        + Mat3::identity() * (strength.lambda * j * (j - 1.0))
}
