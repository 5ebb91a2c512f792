//! The materials that gprop estimated, in the peer's terms: the one place that maps the material field to the peer's
//! numbers, for runs of the peer's solver and for the export of its configuration.
//!
//! The peer scales the simulated object until its longest side is `scale` (1 unless a configuration says otherwise) and
//! uses E, density and gravity as they are, whatever the object's size. gprop hands it SI numbers, so the object moves
//! like one whose longest side is 1 m. Young's modulus is reduced if the peer's explicit steps would take too long
//! ([`Soften`]), and with it everything that is a stress.
//!
//! The peer has one law per run; a law for each particle is gprop's extension. Two of gprop's laws have no counterpart: a
//! fluid becomes `jelly`, and sand loses its cohesion. The peer's `snow` bears no stress at all.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::config::{Config, LawName};
use super::law::{Law as PeerLaw, Strength};
use super::particle::Particle;
use crate::materials::Law;
use crate::mpm::laws::von_mises;
use crate::simulate::material::{POISSON_CAP, Soften};
use crate::vote::FieldPart;

/// Number of cells along each side of the grid, whose side is 2: the peer's default.
const GRID: u32 = 50;
const GRID_SIDE: f64 = 2.0;
/// Length of a step as a share of the time in which the fastest wave crosses a cell.
const CFL: f64 = 0.4;
const FRAME_S: f64 = 1e-2;

/// A material under the keys of the peer's configuration; a key that its law does not use is `None`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EstimatedMaterial {
    pub part: String,
    pub name: String,
    /// Factor by which Young's modulus and all stresses were multiplied; 1 if they are true.
    pub softened: f64,
    #[serde(rename = "material")]
    pub law: LawName,
    #[serde(rename = "E")]
    pub youngs_modulus: f64,
    #[serde(rename = "nu")]
    pub poisson_ratio: f64,
    pub density: f64,
    /// Of `metal` and `plasticine`, the largest norm of the deviatoric stress, sqrt(2/3) times the strength in tension;
    /// of `foam`, that strength.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yield_stress: Option<f64>,
    /// By how much the yield stress of `plasticine` falls per unit of plastic strain, in units of stress; it breaks when
    /// nothing is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub softening: Option<f64>,
    /// Degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub friction_angle: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plastic_viscosity: Option<f64>,
}

/// The materials of a scene's Gaussians.
#[derive(Debug, Clone)]
pub struct Estimated<'a> {
    /// Per Gaussian: index into `materials`.
    pub of_gaussian: &'a [u32],
    pub materials: Vec<EstimatedMaterial>,
}

impl<'a> Estimated<'a> {
    /// The materials of `parts`, softened so that none is stiffer than `most_pa`.
    pub fn new(of_gaussian: &'a [u32], parts: &[FieldPart], soften: Soften, most_pa: f64) -> Self {
        let mut is_used = vec![false; parts.len()];
        of_gaussian.iter().for_each(|&part| is_used[part as usize] = true);
        let modulus = |(part, is_used): (&FieldPart, &bool)| is_used.then_some(part.youngs_modulus_pa.mid);
        let moduli: Vec<Option<f64>> = parts.iter().zip(&is_used).map(modulus).collect();
        let factors = soften.factors(&moduli, most_pa);
        let materials = parts.iter().zip(factors).map(|(part, factor)| EstimatedMaterial::new(part, factor));
        Self { of_gaussian, materials: materials.collect() }
    }

    /// The material of a Gaussian.
    pub fn of(&self, gaussian: u32) -> &EstimatedMaterial {
        &self.materials[self.of_gaussian[gaussian as usize] as usize]
    }

    /// The law of each material.
    pub fn laws(&self, config: &Config) -> Vec<PeerLaw> {
        self.materials.iter().map(|material| PeerLaw::new(&material.in_configuration(config))).collect()
    }

    /// Particles at rest in these places of the box, each with the material of its Gaussian in `sources`.
    pub fn particles(
        &self,
        config: &Config,
        places: &[Vector3<f32>],
        volumes: &[f32],
        sources: &[u32],
    ) -> Vec<Particle> {
        let strength = |material: &EstimatedMaterial| {
            let own = material.in_configuration(config);
            (Strength::new(own.youngs_modulus, own.poisson_ratio, own.yield_stress), own.density)
        };
        let strengths: Vec<(Strength, f32)> = self.materials.iter().map(strength).collect();
        let particle = |((&place, &volume), &gaussian): ((&Vector3<f32>, &f32), &u32)| {
            let law = self.of_gaussian[gaussian as usize];
            let (strength, density) = strengths[law as usize];
            Particle { law, ..Particle::at_rest(place, volume, density * volume, strength) }
        };
        places.iter().zip(volumes).zip(sources).map(particle).collect()
    }

    /// The configuration of a drop under gravity into the box's lower half, with the material `main` for everything.
    pub fn configuration(&self, main: usize) -> Map<String, Value> {
        let is_used = |label: usize| self.of_gaussian.iter().any(|&of| of as usize == label);
        let used = (0..self.materials.len()).filter(|&label| label == main || is_used(label));
        let step_s = used.map(|label| self.materials[label].longest_step_s()).fold(FRAME_S, f64::min);
        let others = json!({
            "g": [0.0, 0.0, -crate::units::GRAVITY_M_S2],
            "n_grid": GRID,
            "grid_lim": GRID_SIDE,
            "substep_dt": FRAME_S / (FRAME_S / step_s).ceil(),
            "frame_dt": FRAME_S,
            "frame_num": 100,
            "opacity_threshold": 0.02,
            "rotation_degree": [],
            "rotation_axis": [],
            "boundary_conditions": [{ "type": "bounding_box" }],
            "mpm_space_vertical_upward_axis": [0, 0, 1],
            "mpm_space_viewpoint_center": [1, 1, 1],
            "default_camera_index": 0,
        });
        let mut keys = self.materials[main].keys();
        keys.extend(others.as_object().cloned().unwrap_or_default());
        keys
    }

    /// The index of the material with the most Gaussians, the first among equals.
    pub fn main(&self) -> usize {
        let mut count = vec![0_usize; self.materials.len()];
        self.of_gaussian.iter().for_each(|&label| count[label as usize] += 1);
        (0..count.len()).rev().max_by_key(|&label| count[label]).unwrap_or(0)
    }
}

impl EstimatedMaterial {
    fn new(part: &FieldPart, softened: f64) -> Self {
        let (mut yield_stress, mut softening, mut friction_angle, mut plastic_viscosity) = (None, None, None, None);
        let law = match part.law {
            Law::Elastic | Law::Fluid => LawName::Jelly,
            Law::VonMises { yield_stress_pa } => {
                yield_stress = Some(von_mises::yield_radius(yield_stress_pa) * softened);
                LawName::Metal
            }
            Law::DruckerPrager { friction_angle_rad, cohesion_pa: _ } => {
                friction_angle = Some(friction_angle_rad.to_degrees());
                LawName::Sand
            }
            Law::Foam { yield_stress_pa, viscosity_pa_s } => {
                yield_stress = Some(yield_stress_pa * softened);
                plastic_viscosity = Some(viscosity_pa_s * softened);
                LawName::Foam
            }
            Law::Snow { .. } => LawName::Snow,
            Law::Plasticine { yield_stress_pa, softening: of_itself } => {
                let radius = von_mises::yield_radius(yield_stress_pa) * softened;
                (yield_stress, softening) = (Some(radius), Some(of_itself * radius));
                LawName::Plasticine
            }
        };
        Self {
            part: part.caption.clone(),
            name: part.material.clone(),
            softened,
            law,
            youngs_modulus: part.youngs_modulus_pa.mid * softened,
            poisson_ratio: part.poisson_ratio.mid.min(POISSON_CAP),
            density: part.density_kg_m3.mid,
            yield_stress,
            softening,
            friction_angle,
            plastic_viscosity,
        }
    }

    /// Its keys of the peer's configuration.
    pub fn keys(&self) -> Map<String, Value> {
        let value = serde_json::to_value(self).expect("names and numbers can be written");
        let mut keys = value.as_object().cloned().unwrap_or_default();
        keys.retain(|key, _| !["part", "name", "softened"].contains(&key.as_str()));
        keys
    }

    /// `config` with this material for everything. What the material's law does not use, and what the field does not
    /// know (`hardening`, `xi`), stays.
    pub fn in_configuration(&self, config: &Config) -> Config {
        let or = |own: Option<f64>, given: f32| own.map_or(given, |own| own as f32);
        Config {
            material: self.law,
            youngs_modulus: self.youngs_modulus as f32,
            poisson_ratio: self.poisson_ratio as f32,
            density: self.density as f32,
            yield_stress: or(self.yield_stress, config.yield_stress),
            softening: or(self.softening, config.softening),
            friction_angle: or(self.friction_angle, config.friction_angle),
            plastic_viscosity: or(self.plastic_viscosity, config.plastic_viscosity),
            ..config.clone()
        }
    }

    /// The longest step that the pressure wave, c^2 = E (1 - nu) / ((1 + nu) (1 - 2 nu) rho), allows.
    fn longest_step_s(&self) -> f64 {
        let (e, nu) = (self.youngs_modulus, self.poisson_ratio);
        let modulus = e * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
        CFL * GRID_SIDE / f64::from(GRID) / (modulus / self.density).sqrt()
    }
}
