//! How stiff the simulated parts are: which are rigid, and which are softened, so that the simulation does not take too
//! long.

use std::collections::BTreeSet;

use super::Extent;
use crate::simulate::Input;
use crate::simulate::error::SimulateError;
use crate::simulate::filling::Parcel;
use crate::simulate::material::{Materials, Prepared, SOFT_PA};
use crate::simulate::options::Options;
use crate::simulate::rigid::choice::{self, Choice, Load};
use crate::simulate::time_step::StepBound;

/// The speed of a slow core; the bench `simulate` shows how much faster a given machine is.
const PARTICLE_SUBSTEPS_PER_S: f64 = 3e6;

/// The cost of rigid bodies, in particles.
const RIGID_PARTICLES: usize = 300;

/// The limit on the expected time of a simulation in which everything that deforms has its true stiffness. If it would
/// take longer, parts whose deformation is hardly visible become rigid; if that is not enough, stiff parts are softened.
/// If the user gives a limit for the stiffness, stiffer parts are softened to that limit, and nothing else is changed. If
/// the user fixes the step, nothing is changed at all, because there would be as many steps.
const LONGEST_MINUTES: f64 = 1.0;

/// The conditions that decide how stiff the simulated parts are, and how long the simulation takes.
pub(super) struct Conditions<'a> {
    pub input: &'a Input<'a>,
    pub options: &'a Options,
    pub parcels: &'a [Parcel],
    pub load: Load,
    pub extent: &'a Extent,
    pub duration_s: f64,
}

/// Which parts are rigid, and how the others deform.
pub(super) struct Settled {
    pub choice: Choice,
    pub materials: Materials,
    pub bound: StepBound,
    /// The label that deforms with the fastest waves.
    pub fastest: Option<usize>,
    pub minutes: f64,
    pub minutes_per_substep: f64,
}

impl Conditions<'_> {
    /// The parts with their true stiffness, unless the user limits it, or it takes too long and the step is not fixed.
    pub fn settle(&self) -> Result<Settled, SimulateError> {
        let most_pa = self.options.max_stiffness;
        let settled = self.with(most_pa.unwrap_or(f64::INFINITY), choice::INVISIBLE)?;
        if most_pa.is_some() || self.options.fixed_step.is_some() || settled.minutes <= LONGEST_MINUTES {
            return Ok(settled);
        }
        let settled = self.with(f64::INFINITY, choice::HARDLY_VISIBLE)?;
        if settled.minutes <= LONGEST_MINUTES {
            return Ok(settled);
        }
        self.with(SOFT_PA, choice::HARDLY_VISIBLE)
    }

    /// The parts that deform, softened to `most_pa`; parts that strain by less than `visible` are rigid.
    fn with(&self, most_pa: f64, visible: f64) -> Result<Settled, SimulateError> {
        let Self { input, options, parcels, load, duration_s, .. } = *self;
        let spacing_m = self.extent.spacing_m;
        let choice = choice::choose(&options.rigid, &load, input.materials, parcels, spacing_m, visible)?;
        let used = in_use(parcels);
        let deforms = |label: usize| choice.body_of[label].is_none() && used.contains(&label);
        let materials = Materials::prepare(input.materials, deforms, options.soften, most_pa);
        let fastest = with_fastest_waves(parcels, &choice, &materials.prepared);
        let wave_speed_m_s = match fastest {
            Some(label) => materials.prepared[label].wave_speed_m_s(),
            None => (2.0 * options.gravity.abs() * load.longest_m).sqrt(),
        };
        let bound = StepBound { cfl: options.cfl, spacing_m, wave_speed_m_s, fixed_s: options.fixed_step };
        let substeps = duration_s / options.fixed_step.unwrap_or_else(|| bound.longest_s(load.impact_m_s));
        let particles = if fastest.is_some() { parcels.len() } else { RIGID_PARTICLES };
        let minutes_per_substep = particles as f64 / PARTICLE_SUBSTEPS_PER_S / 60.0;
        let minutes = substeps * minutes_per_substep;
        Ok(Settled { choice, materials, bound, fastest, minutes, minutes_per_substep })
    }
}

/// The label that deforms with the fastest waves.
fn with_fastest_waves(parcels: &[Parcel], choice: &Choice, prepared: &[Prepared]) -> Option<usize> {
    let speed = |label: usize| prepared[label].wave_speed_m_s();
    in_use(parcels)
        .into_iter()
        .filter(|&label| choice.body_of[label].is_none())
        .max_by(|&a, &b| speed(a).total_cmp(&speed(b)))
}

/// The labels with volume.
fn in_use(parcels: &[Parcel]) -> BTreeSet<usize> {
    parcels.iter().filter(|parcel| parcel.volume_m3 > 0.0).map(|parcel| parcel.label as usize).collect()
}
