//! Errors of a simulation.

use thiserror::Error;

use crate::config::option_values::OptionError;
use crate::words::output::counted;

/// Why a simulation could not start or continue.
#[derive(Debug, Error)]
pub enum SimulateError {
    #[error("{0}")]
    Option(#[from] OptionError),
    #[error("there is nothing to simulate: the scene has no Gaussians")]
    NoParticles,
    #[error("{what}: {got} for {gaussians} Gaussians")]
    Mismatch { what: &'static str, got: usize, gaussians: usize },
    #[error("{what} {index} has the label {label}, but there are only {labels} labels")]
    Label { what: &'static str, index: usize, label: u32, labels: usize },
    #[error("{what} {index} has the position {position:?}, which is not finite: remove it from the scene")]
    Position { what: &'static str, index: usize, position: [f64; 3] },
    #[error("interior point {index} has a volume of {volume}; a volume must be positive and finite")]
    Volume { index: usize, volume: f64 },
    #[error(
        "the density of `{material}` is {density_kg_m3} kg/m3; it must be positive: correct the answer for this part"
    )]
    Density { material: String, density_kg_m3: f64 },
    #[error(
        "Young's modulus of `{material}` is {youngs_modulus_pa} Pa; it must be positive: correct the answer for this part"
    )]
    Stiffness { material: String, youngs_modulus_pa: f64 },
    #[error(
        "Poisson's ratio of `{material}` is {poisson_ratio}; it must be at least 0 and less than 0.5, at which a \
         material is incompressible: correct the answer for this part (0.49 for rubber)"
    )]
    Poisson { material: String, poisson_ratio: f64 },
    #[error("the {what} of `{material}` is {value}; it must be positive: correct the answer for this part")]
    Strength { material: String, what: &'static str, value: f64 },
    #[error("all Gaussians lie at one point: the object has no size")]
    NoExtent,
    #[error(
        "particle {particle} ({material}) {what} at t = {t_s:.6} s, frame {frame} (position {position_m:?} m, velocity \
         {velocity_m_s:?} m/s): {cause}. Earlier frames are kept"
    )]
    Lost {
        particle: usize,
        material: String,
        what: &'static str,
        t_s: f64,
        frame: usize,
        position_m: [f32; 3],
        velocity_m_s: [f32; 3],
        cause: &'static str,
    },
    #[error(
        "at t = {t_s:.6} s, before frame {frame}, something moves at {speed_m_s:.1e} m/s: the time steps that this speed \
         allows are so short that the simulation would take more than twice --max-simulation-minutes; lower the scenario's \
         speed, rate or force, or raise --max-simulation-minutes. Earlier frames are kept"
    )]
    TooFast { speed_m_s: f64, t_s: f64, frame: usize },
    #[error(
        "cannot resume from the checkpoint: {0}; delete simulation/checkpoint.bin in the work folder to start from the first \
         frame"
    )]
    Checkpoint(String),
    #[error("cannot use the PhysGaussian configuration: {0}")]
    Configuration(String),
    #[error("--rigid: there is no part `{part}`: give one of `{names}`, or auto, or never")]
    Rigid { part: String, names: String },
    #[error("--rigid {word} has to be given alone: leave out the other values of --rigid, or `{word}`")]
    RigidAlone { word: String },
    #[error("--scenario cannot be run: {0}")]
    Scenario(String),
    #[error("--set changes the parameters of a named scenario, and `{path}` is a file: edit the file instead")]
    SetOfFile { path: String },
    /// Of a scenario or of `--anchor`.
    #[error("there is no part `{part}`: give one of `{names}`, or all, top, bottom, low_end or high_end")]
    Part { part: String, names: String },
    #[error(
        "the simulation would take about {}, more than --max-simulation-minutes {max_minutes}: lower --grid, --duration or \
         --max-stiffness, or raise --max-simulation-minutes",
        counted(minutes.ceil() as usize, "minute")
    )]
    TooLong { minutes: f64, max_minutes: f64 },
}
