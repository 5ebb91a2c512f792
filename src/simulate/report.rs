//! The result of a simulation.

use serde::{Deserialize, Serialize};

use super::checkpoint::FrameSummary;
use super::material::{PoissonCapped, Softened};
use super::rigid::choice::Reason;
use crate::words::output::{agreeing, counted};

/// The simulation and its result. Written as `simulation.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct SimulationReport {
    /// The scenario: its name, or the name of its file.
    pub scenario: String,
    /// Number of particles: those of the Gaussians and those that fill the inside.
    pub particles: usize,
    /// Number of particles that fill the inside.
    pub fill_particles: usize,
    /// Number of steps taken after the free fall.
    pub substeps: u64,
    /// The longest step taken after the free fall.
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
    /// The parts that moved as rigid bodies.
    pub rigid: Vec<RigidReport>,
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

    /// Notes the peak pressures on rigid parts: the label of each, and the pressure.
    pub(super) fn note_pressures(&mut self, peaks: impl Iterator<Item = (u32, f64)>) {
        for (label, peak_pressure_pa) in peaks {
            for part in self.rigid.iter_mut().filter(|part| part.label == label) {
                (part.peak_pressure_pa, part.dents) = (peak_pressure_pa, peak_pressure_pa > part.strength_pa);
            }
        }
    }

    /// A note for people on the parts that are rigid only because the simulation would take too long; empty if there are
    /// none.
    pub(super) fn rigid_to_save_time(&self) -> String {
        let count = self.rigid.iter().filter(|part| part.because == Reason::TooSlow).count();
        if count == 0 {
            return String::new();
        }
        let (are, them) = (agreeing(count, "is", "are"), agreeing(count, "it", "them"));
        format!(" ({} {are} rigid to save time; `--rigid never` lets {them} deform)", counted(count, "part"))
    }

    /// Longest side of the object in its first pose, scene units.
    pub fn longest_side(&self) -> f64 {
        self.frames.first().map_or(1.0, |f| (0..3).map(|a| f.bounds[1][a] - f.bounds[0][a]).fold(0.0, f64::max))
    }
}

/// The particles of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
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

/// A part that moved as a rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct RigidReport {
    /// The part id; that of the shell for a filling.
    pub part_id: u32,
    /// Its label in the run.
    #[serde(skip)]
    pub(super) label: u32,
    pub part: String,
    pub material: String,
    /// The body's number: parts that are joined have the same.
    pub body: u32,
    /// Estimate of the largest strain in the scenario if it deformed.
    pub strain: f64,
    /// Why it is rigid.
    pub because: Reason,
    /// Highest pressure on the ground; 0 if it never touched it.
    pub peak_pressure_pa: f64,
    /// The stress at which its material is damaged.
    pub strength_pa: f64,
    /// Whether the pressure exceeds the strength.
    pub dents: bool,
}

/// The bound on the substep: dt <= cfl * spacing / (wave speed + speed).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct StepReport {
    pub cfl: f64,
    /// Material with the fastest pressure waves; `None` if nothing deforms.
    pub stiffest_material: Option<String>,
    /// Speed of its pressure waves; if nothing deforms, the speed after a fall from the height of the object's longest side.
    pub wave_speed_m_s: f64,
}
