//! Materials as the solver needs them: checked, softened to what can be simulated, with Lame's constants.

use serde::Serialize;

use super::error::SimulateError;
use crate::materials::Law;
use crate::mpm::laws::snow::{self, Snow};
use crate::mpm::laws::{self, drucker_prager, von_mises};
use crate::vote::{FieldPart, Filled};

/// Materials with a larger Poisson's ratio are simulated with this one: towards 0.5 the bulk modulus, and with it the
/// number of time steps, grows without bound, while the shape hardly changes.
pub const POISSON_CAP: f64 = 0.45;

/// Young's modulus to which stiffer parts that deform are softened if their own would make the simulation very long.
pub const SOFT_PA: f64 = 2e7;

/// `--soften`: how the stiffness is lowered to the largest that is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Soften {
    /// Soften each stiffer material to that limit, so that all of these become equally soft; softer materials stay as they are
    #[default]
    Cap,
    /// Soften all materials by the factor that the stiffest needs, so that the ratios between them stay the same
    Common,
}

impl Soften {
    /// The factors on Young's moduli that bring the stiffest to `most_pa`; `None` is a material that does not count.
    pub fn factors(self, moduli_pa: &[Option<f64>], most_pa: f64) -> Vec<f64> {
        let stiffest_pa = moduli_pa.iter().flatten().copied().fold(0.0, f64::max);
        let factor = |modulus_pa: &Option<f64>| match (self, modulus_pa) {
            (_, None) => 1.0,
            (Self::Cap, Some(modulus_pa)) => (most_pa / modulus_pa).min(1.0),
            (Self::Common, Some(_)) => (most_pa / stiffest_pa).min(1.0),
        };
        moduli_pa.iter().map(factor).collect()
    }
}

/// The material of one label.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Material {
    pub name: String,
    /// Id of the part that it is the material of; that of the shell for a filling.
    pub part_id: u32,
    /// Name of the part.
    pub caption: String,
    pub density_kg_m3: f64,
    pub youngs_modulus_pa: f64,
    pub poisson_ratio: f64,
    /// The stress at which it is damaged.
    pub strength_pa: f64,
    pub law: Law,
    /// The label of the shell that it moves with if the shell is rigid, although it could deform by itself.
    pub moves_with: Option<u32>,
}

impl Material {
    /// The material of the filling of a `shell`; it moves with the shell's label `moves_with`, if any.
    pub fn of_filling(filled: &Filled, shell: &FieldPart, moves_with: Option<u32>) -> Self {
        let youngs_modulus_pa = filled.youngs_modulus_pa.mid;
        let strength_pa = match filled.law {
            Law::VonMises { yield_stress_pa }
            | Law::Foam { yield_stress_pa, .. }
            | Law::Plasticine { yield_stress_pa, .. } => yield_stress_pa,
            // The stress that damages it is unknown, and only its shell touches it.
            Law::Elastic | Law::DruckerPrager { .. } | Law::Snow { .. } | Law::Fluid => youngs_modulus_pa,
        };
        Self {
            name: filled.filling.clone(),
            part_id: shell.id,
            caption: format!("{} in {}", filled.filling, shell.caption),
            density_kg_m3: filled.density_kg_m3.mid,
            youngs_modulus_pa,
            poisson_ratio: filled.poisson_ratio.mid,
            strength_pa,
            law: filled.law,
            moves_with,
        }
    }

    /// E / (1 - nu^2), Pa.
    pub fn plane_modulus_pa(&self) -> f64 {
        self.youngs_modulus_pa / (1.0 - self.poisson_ratio.powi(2))
    }
}

impl From<&FieldPart> for Material {
    fn from(part: &FieldPart) -> Self {
        Self {
            name: part.material.clone(),
            part_id: part.id,
            caption: part.caption.clone(),
            density_kg_m3: part.density_kg_m3.mid,
            youngs_modulus_pa: part.youngs_modulus_pa.mid,
            poisson_ratio: part.poisson_ratio.mid,
            strength_pa: part.yield_strength_pa.mid,
            law: part.law,
            moves_with: None,
        }
    }
}

/// A material softened to allow longer time steps.
#[derive(Debug, Clone, PartialEq, Serialize, serde::Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Softened {
    pub material: String,
    /// Factor by which Young's modulus and strength were multiplied.
    pub factor: f64,
}

/// A material whose Poisson's ratio was lowered to [`POISSON_CAP`], 0.45.
#[derive(Debug, Clone, PartialEq, Serialize, serde::Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct PoissonCapped {
    pub material: String,
    pub from: f64,
    pub to: f64,
}

/// A material in the solver's terms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prepared {
    pub density_kg_m3: f64,
    pub mu_pa: f64,
    pub lambda_pa: f64,
    pub law: laws::Law,
    /// Initial value of the law's state.
    pub state: f64,
}

impl Prepared {
    /// Speed of pressure waves, the fastest waves: sqrt((lambda + 2 mu) / rho), m/s; for snow, at its hardest.
    pub fn wave_speed_m_s(&self) -> f64 {
        let hardest = if matches!(self.law, laws::Law::Snow(_)) { f64::from(snow::HARDEST) } else { 1.0 };
        (hardest * (self.lambda_pa + 2.0 * self.mu_pa) / self.density_kg_m3).sqrt()
    }
}

/// All prepared materials, with the changes made to them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Materials {
    /// In the given order.
    pub prepared: Vec<Prepared>,
    pub softened: Vec<Softened>,
    pub poisson_capped: Vec<PoissonCapped>,
}

impl Materials {
    /// Softens the `materials` that `deform` to `max_stiffness_pa`. Strength is scaled like stiffness, so the yield
    /// strain stays the same.
    pub fn prepare(
        materials: &[Material],
        deform: impl Fn(usize) -> bool,
        soften: Soften,
        max_stiffness_pa: f64,
    ) -> Self {
        let mut all = Self::default();
        let modulus = |(label, material): (usize, &Material)| deform(label).then_some(material.youngs_modulus_pa);
        let moduli: Vec<Option<f64>> = materials.iter().enumerate().map(modulus).collect();
        let factors = soften.factors(&moduli, max_stiffness_pa);
        for (label, (material, factor)) in materials.iter().zip(factors).enumerate() {
            let name = || material.name.clone();
            if factor < 1.0 && all.softened.iter().all(|s| s.material != material.name || s.factor != factor) {
                all.softened.push(Softened { material: name(), factor });
            }
            let nu = material.poisson_ratio.min(POISSON_CAP);
            if deform(label)
                && nu < material.poisson_ratio
                && all.poisson_capped.iter().all(|c| c.material != material.name)
            {
                all.poisson_capped.push(PoissonCapped { material: name(), from: material.poisson_ratio, to: nu });
            }
            let (mu_pa, lambda_pa) = lame(material.youngs_modulus_pa * factor, nu);
            let (law, state) = solver_law(material.law, factor);
            all.prepared.push(Prepared { density_kg_m3: material.density_kg_m3, mu_pa, lambda_pa, law, state });
        }
        all
    }
}

/// The solver's law for a material's law, and the initial value of its state. Every strength and viscosity is scaled by
/// `factor` like the stiffness, so that the material yields at the same strains and flows at the same rates.
fn solver_law(law: Law, factor: f64) -> (laws::Law, f64) {
    let radius = |yield_stress_pa: f64| von_mises::yield_radius(yield_stress_pa * factor);
    match law {
        Law::Elastic => (laws::Law::FixedCorotated, 0.0),
        Law::Fluid => (laws::Law::Fluid, 0.0),
        Law::VonMises { yield_stress_pa } => {
            (laws::Law::VonMises { hardening: 0.0, softening: 0.0 }, radius(yield_stress_pa))
        }
        Law::Plasticine { yield_stress_pa, softening } => {
            (laws::Law::VonMises { hardening: 0.0, softening: softening as f32 }, radius(yield_stress_pa))
        }
        Law::Foam { yield_stress_pa, viscosity_pa_s } => {
            (laws::Law::Foam { viscosity_pa_s: (viscosity_pa_s * factor) as f32 }, radius(yield_stress_pa))
        }
        Law::DruckerPrager { friction_angle_rad, cohesion_pa } => {
            let apex_pa = (drucker_prager::apex(cohesion_pa, friction_angle_rad) * factor) as f32;
            (laws::Law::DruckerPrager { apex_pa }, drucker_prager::alpha(friction_angle_rad))
        }
        Law::Snow { theta_c, theta_s, hardening } => {
            let [theta_c, theta_s, xi] = [theta_c, theta_s, hardening].map(|v| v as f32);
            (laws::Law::Snow(Snow { theta_c, theta_s, xi }), 1.0)
        }
    }
}

/// Lame's constants (mu, lambda) from Young's modulus and Poisson's ratio.
pub fn lame(youngs_modulus_pa: f64, poisson_ratio: f64) -> (f64, f64) {
    let (e, nu) = (youngs_modulus_pa, poisson_ratio);
    (e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))
}

/// # Errors
/// If a property has a value that no material can have.
pub fn check(material: &Material) -> Result<(), SimulateError> {
    let positive = |v: f64| v.is_finite() && v > 0.0;
    let name = || material.name.clone();
    let Material { density_kg_m3, youngs_modulus_pa, poisson_ratio, .. } = *material;
    if !positive(density_kg_m3) {
        return Err(SimulateError::Density { material: name(), density_kg_m3 });
    }
    if !positive(youngs_modulus_pa) {
        return Err(SimulateError::Stiffness { material: name(), youngs_modulus_pa });
    }
    if !(0.0..0.5).contains(&poisson_ratio) {
        return Err(SimulateError::Poisson { material: name(), poisson_ratio });
    }
    let strength = match material.law {
        Law::VonMises { yield_stress_pa }
        | Law::Foam { yield_stress_pa, .. }
        | Law::Plasticine { yield_stress_pa, .. } => Some(("strength", yield_stress_pa)),
        Law::DruckerPrager { friction_angle_rad, .. } => Some(("friction angle", friction_angle_rad)),
        Law::Elastic | Law::Snow { .. } | Law::Fluid => None,
    };
    match strength.filter(|&(_, value)| !positive(value)) {
        Some((what, value)) => Err(SimulateError::Strength { material: name(), what, value }),
        None => Ok(()),
    }
}
