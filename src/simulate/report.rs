//! The result of a simulation.

use serde::{Deserialize, Serialize};

use super::checkpoint::FrameSummary;
use super::material::{PoissonCapped, Softened};

/// The simulation and its result. Written as `simulation.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SimulationReport {
    /// Number of particles: those of the Gaussians and those that fill the inside.
    pub particles: usize,
    /// Number of particles that fill the inside.
    pub fill_particles: usize,
    pub substeps: u64,
    /// The longest substep.
    pub dt_s: f64,
    /// The bound on the substep.
    pub time_step: StepReport,
    pub mass_kg: f64,
    /// The particles of each part, in the order of the labels.
    pub filled: Vec<FilledReport>,
    pub gravity_m_s2: f64,
    pub grid_spacing_m: f64,
    pub meters_per_unit: f64,
    /// Whether `meters_per_unit` is an assumption.
    pub scale_assumed: bool,
    /// Materials that were softened to allow longer time steps.
    pub softened: Vec<Softened>,
    /// Materials whose Poisson's ratio was lowered.
    pub poisson_capped: Vec<PoissonCapped>,
    /// World z of the ground.
    pub ground_z_m: f64,
    pub frames: Vec<FrameSummary>,
    /// Warnings.
    pub warnings: Vec<String>,
}

impl SimulationReport {
    /// The bounds of everywhere the object goes: lowest and highest corner, world frame, scene units.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let lows = |a: usize| self.frames.iter().map(move |f| f.bounds[0][a]);
        let highs = |a: usize| self.frames.iter().map(move |f| f.bounds[1][a]);
        [
            [0, 1, 2].map(|a| lows(a).fold(f64::INFINITY, f64::min)),
            [0, 1, 2].map(|a| highs(a).fold(f64::NEG_INFINITY, f64::max)),
        ]
    }

    /// Longest side of the object in its first pose, scene units.
    pub fn longest_side(&self) -> f64 {
        self.frames.first().map_or(1.0, |f| (0..3).map(|a| f.bounds[1][a] - f.bounds[0][a]).fold(0.0, f64::max))
    }
}

/// The particles of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FilledReport {
    pub part: String,
    pub material: String,
    /// Particles that carry a Gaussian.
    pub gaussians: usize,
    /// Particles of its inside, where it has no Gaussian.
    pub fill_particles: usize,
    pub volume_m3: f64,
    /// Whether it is simulated as a skin one cell thick, because its inside is unknown.
    pub skin: bool,
}

/// The bound on the substep: dt <= cfl * spacing / (wave speed + speed).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StepReport {
    pub cfl: f64,
    /// Whose pressure waves are the fastest.
    pub stiffest_material: String,
    pub wave_speed_m_s: f64,
}
