//! Compares a run of `--compat physgaussian` with a trajectory of the public solver.
//!
//! The reference is an NPZ: particles at the start (`x0`, `v0`, `vol`, `mass`), `meta` with the solver's parameters,
//! boundary conditions and steps as JSON, and statistics of the public solver's run frame by frame.

use std::time::Instant;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::files::json;
use crate::files::npz::{Npz, NpzError};
use crate::simulate::SimulateError;
use crate::simulate::compat::config::Config;
use crate::simulate::compat::particle::Particle;
use crate::simulate::compat::solver::{Lost, Solver};
use crate::simulate::compat::strength_at;
use crate::words::progress::Progress;

/// Why a comparison could not be made.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    #[error("the reference cannot be read")]
    Npz(#[from] NpzError),
    #[error("cannot read the reference's `meta`")]
    Meta(#[from] serde_json::Error),
    #[error("the reference's array `{array}` has {found} numbers, not {expected}")]
    Length { array: &'static str, found: usize, expected: usize },
    #[error("the reference's settings cannot be run")]
    Setting(#[from] SimulateError),
    #[error("particle {} is lost at t = {} s: it left the grid or became NaN or infinite", .0.particle, .0.time)]
    Lost(Lost),
}

/// The largest differences over all frames. A faithful solver stays within the tolerances of [`Comparison::rows`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    pub particles: usize,
    pub substeps: usize,
    /// Distance between the centres of mass.
    pub com_max_m: f64,
    /// Difference of the kinetic energies, relative to the reference's largest.
    pub ke_rel_max: f64,
    /// Distance between a sampled particle and its reference.
    pub position_max_m: f64,
    /// Mean of |F - I| over all particles (Frobenius), F before the return map; relative to the reference's largest.
    pub fi_rel_max: f64,
    /// The largest |F - I| of any particle; relative as above.
    pub largest_fi_rel_max: f64,
    /// Smallest and largest yield stress, relative to the reference's largest.
    pub yield_rel_max: f64,
    /// Particle substeps per second, wall clock.
    pub substeps_per_s: f64,
}

impl Comparison {
    /// Measure, value, tolerance.
    pub fn rows(&self) -> [(&'static str, f64, f64); 6] {
        [
            ("centre of mass, m", self.com_max_m, 1e-5),
            ("kinetic energy / its maximum", self.ke_rel_max, 1e-3),
            ("sampled positions, m", self.position_max_m, 1e-4),
            ("mean |F-I| / its maximum", self.fi_rel_max, 1e-3),
            ("largest |F-I| / its maximum", self.largest_fi_rel_max, 1e-3),
            ("yield stress / its maximum", self.yield_rel_max, 1e-3),
        ]
    }

    /// True if every difference is within its tolerance. A NaN is not.
    pub fn within(&self) -> bool {
        self.rows().iter().all(|(_, value, tolerance)| value <= tolerance)
    }
}

impl std::fmt::Display for Comparison {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        writeln!(f, "{:<32} {:>10} {:>10}", "largest difference", "found", "tolerance")?;
        for (what, value, tolerance) in self.rows() {
            let verdict = if value <= tolerance { "" } else { "  exceeded" };
            writeln!(f, "{what:<32} {value:>10.2e} {tolerance:>10.0e}{verdict}")?;
        }
        let verdict = if self.within() { "reproduced" } else { "not reproduced" };
        let (particles, substeps) = (self.particles, self.substeps);
        write!(f, "{verdict}: {particles} particles, {substeps} substeps, {:.2e} per second", self.substeps_per_s)
    }
}

#[derive(Deserialize)]
struct Meta {
    params: Map<String, Value>,
    bcs: Value,
    dt: f64,
    n_grid: usize,
    grid_lim: f64,
    n_frames: usize,
    substeps_per_frame: usize,
}

/// Runs the reference's configuration and compares it frame by frame.
///
/// # Errors
/// [`SimulationError`] if the reference cannot be read or a particle is lost.
pub fn compare(npz: &mut Npz, progress: Progress) -> Result<Comparison, SimulationError> {
    let meta: Meta = json::read(npz.text("meta")?.as_bytes())?;
    let config = config(&meta)?;
    let particles = particles(npz, &config)?;
    let reference = Reference::read(npz, particles.len(), meta.n_frames.saturating_add(1))?;
    let mut solver = Solver::new(&config, particles);
    let bar = progress.bar("simulate", meta.n_frames as u64);
    let start = Instant::now();
    let mut worst = Worst::default();
    for frame in 0..=meta.n_frames {
        if frame > 0 {
            for _ in 0..meta.substeps_per_frame {
                solver.step(meta.dt).map_err(SimulationError::Lost)?;
            }
            bar.inc(1);
        }
        worst.add(&reference, frame, &solver.particles);
    }
    bar.finish_and_clear();
    let substeps = meta.n_frames * meta.substeps_per_frame;
    Ok(Comparison {
        particles: solver.particles.len(),
        substeps,
        com_max_m: worst.com,
        ke_rel_max: worst.energy,
        position_max_m: worst.position,
        fi_rel_max: worst.mean_fi,
        largest_fi_rel_max: worst.largest_fi,
        yield_rel_max: worst.yields,
        substeps_per_s: (substeps * solver.particles.len()) as f64 / start.elapsed().as_secs_f64(),
    })
}

fn config(meta: &Meta) -> Result<Config, SimulationError> {
    let mut keys = meta.params.clone();
    keys.insert("boundary_conditions".to_owned(), meta.bcs.clone());
    keys.insert("n_grid".to_owned(), meta.n_grid.into());
    keys.insert("grid_lim".to_owned(), meta.grid_lim.into());
    keys.insert("substep_dt".to_owned(), meta.dt.into());
    keys.insert("frame_dt".to_owned(), (meta.dt * meta.substeps_per_frame as f64).into());
    Ok(Config::from_map(keys)?)
}

fn particles(npz: &mut Npz, config: &Config) -> Result<Vec<Particle>, SimulationError> {
    let (volume, mass) = (npz.f32s("vol")?, npz.f32s("mass")?);
    let count = volume.len();
    let (x0, v0) = (npz.f32s("x0")?, npz.f32s("v0")?);
    for (array, found, expected) in
        [("mass", mass.len(), count), ("x0", x0.len(), 3 * count), ("v0", v0.len(), 3 * count)]
    {
        if found != expected {
            return Err(SimulationError::Length { array, found, expected });
        }
    }
    let particle = |i: usize| {
        let position = Vector3::from_column_slice(&x0[3 * i..3 * i + 3]);
        let velocity = Vector3::from_column_slice(&v0[3 * i..3 * i + 3]);
        let strength = strength_at(config, &position).0;
        let mut particle = Particle::at_rest(position, volume[i], mass[i], strength);
        particle.velocity = velocity;
        particle
    };
    Ok((0..count).map(particle).collect())
}

/// The statistics of the public solver's run.
struct Reference {
    com: Vec<f64>,
    energy: Vec<f64>,
    samples: Vec<i64>,
    positions: Vec<f32>,
    mean_fi: Vec<f64>,
    largest_fi: Vec<f64>,
    least_yield: Vec<f64>,
    largest_yield: Vec<f64>,
}

impl Reference {
    fn read(npz: &mut Npz, particles: usize, frames: usize) -> Result<Self, SimulationError> {
        let reference = Self {
            com: npz.f64s("com")?,
            energy: npz.f64s("ke")?,
            samples: npz.i64s("sample_idx")?,
            positions: npz.f32s("sx")?,
            mean_fi: npz.f64s("mean_FI")?,
            largest_fi: npz.f64s("max_FI")?,
            least_yield: widened(npz.f32s("ymin")?),
            largest_yield: widened(npz.f32s("ymax")?),
        };
        let samples = reference.samples.len();
        for (array, found, expected) in [
            ("com", reference.com.len(), frames.saturating_mul(3)),
            ("ke", reference.energy.len(), frames),
            ("sx", reference.positions.len(), frames.saturating_mul(3 * samples)),
            ("mean_FI", reference.mean_fi.len(), frames),
            ("max_FI", reference.largest_fi.len(), frames),
            ("ymin", reference.least_yield.len(), frames),
            ("ymax", reference.largest_yield.len(), frames),
        ] {
            if found != expected {
                return Err(SimulationError::Length { array, found, expected });
            }
        }
        let past = reference.samples.iter().filter(|i| !(0..particles as i64).contains(i)).count();
        match past {
            0 => Ok(reference),
            _ => Err(SimulationError::Length { array: "sample_idx", found: samples, expected: samples - past }),
        }
    }
}

/// The largest differences so far.
#[derive(Default)]
struct Worst {
    com: f64,
    energy: f64,
    position: f64,
    mean_fi: f64,
    largest_fi: f64,
    yields: f64,
}

impl Worst {
    fn add(&mut self, reference: &Reference, frame: usize, particles: &[Particle]) {
        let (mut mass, mut moment, mut energy) = (0.0, Vector3::zeros(), 0.0);
        let (mut sum_fi, mut largest_fi) = (0.0, 0.0_f64);
        let (mut least_yield, mut largest_yield) = (f32::INFINITY, f32::NEG_INFINITY);
        for p in particles {
            let m = f64::from(p.mass);
            mass += m;
            moment += p.position.map(f64::from) * m;
            energy += 0.5 * m * p.velocity.map(f64::from).norm_squared();
            let fi = (p.trial.map(f64::from) - Matrix3::identity()).norm();
            sum_fi += fi;
            largest_fi = largest_fi.max(fi);
            least_yield = least_yield.min(p.strength.yield_stress);
            largest_yield = largest_yield.max(p.strength.yield_stress);
        }
        let com = Vector3::from_column_slice(&reference.com[3 * frame..3 * frame + 3]);
        raise(&mut self.com, (moment / mass - com).norm());
        raise(&mut self.energy, relative(energy, &reference.energy, frame));
        let places = reference.positions[3 * frame * reference.samples.len()..].chunks_exact(3);
        for (&i, place) in reference.samples.iter().zip(places) {
            let apart = particles[i as usize].position - Vector3::from_column_slice(place);
            raise(&mut self.position, f64::from(apart.norm()));
        }
        raise(&mut self.mean_fi, relative(sum_fi / particles.len() as f64, &reference.mean_fi, frame));
        raise(&mut self.largest_fi, relative(largest_fi, &reference.largest_fi, frame));
        raise(&mut self.yields, relative(least_yield.into(), &reference.least_yield, frame));
        raise(&mut self.yields, relative(largest_yield.into(), &reference.largest_yield, frame));
    }
}

/// Keeps the larger value; a NaN is kept forever.
pub(super) fn raise(worst: &mut f64, value: f64) {
    if value.is_nan() || value > *worst {
        *worst = value;
    }
}

/// Difference from `series[frame]`, relative to the largest value of the series.
fn relative(value: f64, series: &[f64], frame: usize) -> f64 {
    let most = series.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let apart = (value - series[frame]).abs();
    if apart == 0.0 { 0.0 } else { apart / most }
}

fn widened(values: Vec<f32>) -> Vec<f64> {
    values.into_iter().map(f64::from).collect()
}
