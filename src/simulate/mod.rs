//! The Material Point Method on the Gaussians: every Gaussian is a particle with its own density, stiffness and law,
//! the inside is filled with particles, and a scenario acts on the object: by default, it is dropped onto the ground.
//!
//! The phases, in order:
//! 1. [`filling`]: a volume for every Gaussian, particles for the inside;
//! 2. [`rigid::choice`]: the parts that move as rigid bodies;
//! 3. [`material`]: what deforms, softened if it would take too long;
//! 4. [`scenario`]: first pose, ground, domain;
//! 5. [`object`] in substeps of [`time_step`], frame by frame: [`mpm`](crate::mpm) for what deforms, [`rigid`] for the rest;
//! 6. `frames`: the Gaussians moved, turned and stretched; a [`checkpoint`] with each.

pub mod action;
pub mod animation;
pub mod checkpoint;
pub mod compat;
mod error;
pub mod filling;
mod frames;
pub mod material;
pub mod object;
mod options;
pub mod plot;
mod report;
pub mod rigid;
pub mod scenario;
pub mod script;
mod setup;
pub mod states;
pub mod time_step;

use crate::gaussians::Gaussians;
use crate::mpm::boundary::Boundary;
use crate::mpm::particles::Particle;
use crate::mpm::{Lost, Setting};
use crate::words::output::{agreeing, counted, thousands};
use crate::words::progress::Progress;
use action::Acting;
pub use checkpoint::FrameSummary;
use checkpoint::{Checkpoint, Record, Snapshot};
pub use error::SimulateError;
use filling::FillPoint;
pub use frames::Frame;
use frames::ToWorld;
use material::Material;
use object::{Bodies, Object};
pub use options::{Fillings, Ground, Options, SCENE_KEYS};
pub use report::{FilledReport, RigidReport, SimulationReport, StepReport};
use rigid::body::Body;
use setup::Setup;
pub use setup::{ASSUMED_LONGEST_SIDE_M, script_of, simulated};
use time_step::StepBound;

/// The input of a simulation.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    pub gaussians: &'a Gaussians,
    /// Per Gaussian: index into `materials`.
    pub labels: &'a [u32],
    pub materials: &'a [Material],
    /// The whole inside of the object, cell by cell, including near the surface. If empty, only Gaussians carry volume.
    pub interior: &'a [FillPoint],
    /// `None` if unknown: the longest side is then taken to be [`ASSUMED_LONGEST_SIDE_M`].
    pub meters_per_unit: Option<f64>,
}

/// Runs the scenario and passes each frame to `on_frame` when it is complete, with the state that a later call needs to
/// resume right after it. Frames before the checkpoint are not passed again; the report holds all of them.
///
/// # Errors
/// [`SimulateError`] if the input cannot be simulated or a particle is lost. Errors of `on_frame` are returned
/// unchanged.
pub fn simulate<E: From<SimulateError>>(
    input: &Input,
    options: &Options,
    resume: Option<Checkpoint>,
    on_frame: &mut dyn FnMut(&Frame, &Snapshot) -> Result<(), E>,
    progress: Progress,
) -> Result<SimulationReport, E> {
    let setup = setup::set_up(input, options)?;
    progress.line(&announcement(&setup));
    let identity = identity(&setup, options);
    let Setup {
        setting,
        ground,
        bodies,
        start,
        carried,
        labels,
        bound,
        to_world,
        duration_s,
        falls_until_s,
        actions,
        most_substeps,
        mut report,
        ..
    } = setup;
    let time_of = |frame: usize| duration_s * frame as f64 / f64::from(options.frames - 1);
    let (mut record, mut object) = match resume {
        Some(checkpoint) => {
            checkpoint.require_identity(&identity)?;
            checkpoint.require_times(options.frames as usize, &time_of)?;
            resumed(checkpoint, start, setting, &bodies, &ground)?
        }
        None => {
            let record = Record { substeps: 0, longest_dt_s: 0.0, frames: vec![] };
            (record, Object::new(setting, start, &bodies, Some(&ground)))
        }
    };
    let actions = action::on(&object, actions);
    let bar = progress.bar("simulate", u64::from(options.frames));
    bar.set_position(record.frames.len() as u64);
    for index in record.frames.len()..options.frames as usize {
        if index > 0 {
            let span = [time_of(index - 1), time_of(index)];
            let started_s = fall(&mut object, falls_until_s, span);
            let material = |particle: usize| input.materials[labels[particle] as usize].name.clone();
            advance(&mut object, &bound, most_substeps, &actions, [started_s, span[1]], &mut record)
                .map_err(|failure| failure.into_error(index, material, to_world))?;
        }
        let particles = object.particles();
        let gaussians = frames::deformed(input.gaussians, &carried, &particles, to_world);
        record.frames.push(frames::summary(&particles, &gaussians, to_world, time_of(index)));
        let frame = Frame { index, summary: record.frames[index], gaussians };
        let snapshot = Snapshot { identity: &identity, record: &record, particles: &particles };
        on_frame(&frame, &snapshot)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    report.substeps = record.substeps;
    report.dt_s = record.longest_dt_s;
    report.frames = record.frames;
    report.note_pressures(object.bodies().iter().flat_map(Body::faces).map(|face| (face.part, face.peak_pressure_pa)));
    Ok(report)
}

/// How much there is to simulate, and how long it takes at most.
fn announcement(setup: &Setup) -> String {
    let deforming = setup.bodies.body_of.iter().filter(|body| body.is_none()).count();
    let deform = match deforming {
        0 => "none of which deforms".to_owned(),
        _ => format!("{} of which {}", thousands(deforming as u64), agreeing(deforming, "deforms", "deform")),
    };
    let minutes = setup.minutes;
    let at_most = if minutes < 1.0 { "a minute".to_owned() } else { counted(minutes.ceil() as usize, "minute") };
    format!(
        "simulate  {}, {deform}{}, for {:.2} s: at most {at_most}",
        counted(setup.start.len(), "particle"),
        setup.report.rigid_to_save_time(),
        setup.duration_s
    )
}

/// The identity of the run: a checkpoint of another one cannot be resumed.
fn identity(setup: &Setup, options: &Options) -> [u8; 32] {
    let Setup { setting, ground, bound, actions, duration_s, report, .. } = setup;
    let course =
        format!("{setting:?} {ground:?} {:?} {bound:?} {actions:?} {} {duration_s}", report.rigid, options.frames);
    checkpoint::identity(&setup.start, &course)
}

/// The object as a checkpoint holds it.
fn resumed(
    checkpoint: Checkpoint,
    mut start: Vec<Particle>,
    setting: Setting,
    bodies: &Bodies,
    ground: &Boundary,
) -> Result<(Record, Object), SimulateError> {
    // The solver looks up laws by their numbers, and builds a grid around all particles.
    let domain_m = setting.domain_m;
    let fits = |(start, now): (&&mut Particle, &Particle)| {
        let constants = |p: &Particle| [p.mass_kg, p.volume_m3].map(f32::to_bits);
        let is_same = start.law == now.law && constants(start) == constants(now);
        is_same && now.is_finite() && crate::mpm::is_within(domain_m, now.position_m)
    };
    let with_body = start.iter_mut().zip(&bodies.body_of);
    let deforming: Vec<&mut Particle> = with_body.filter(|(_, body)| body.is_none()).map(|(p, _)| p).collect();
    if deforming.len() != checkpoint.particles.len() || !deforming.iter().zip(&checkpoint.particles).all(fits) {
        return Err(SimulateError::Checkpoint("the state of its particles is damaged".to_owned()));
    }
    deforming.into_iter().zip(checkpoint.particles).for_each(|(particle, now)| *particle = now);
    let mut object = Object::new(setting, start, bodies, Some(ground));
    if !object.restore(&checkpoint.bodies) {
        return Err(SimulateError::Checkpoint("the state of its rigid bodies is damaged".to_owned()));
    }
    Ok((checkpoint.record, object))
}

/// Why a frame cannot be reached, and the time of the failure.
enum Failure {
    Lost {
        lost: Lost,
        t_s: f64,
    },
    /// Something moves so fast that a step which its speed allows is lost in rounding, or that there were too many steps.
    TooFast {
        speed_m_s: f64,
        t_s: f64,
    },
}

impl Failure {
    /// `material` returns the name of a particle's material.
    fn into_error(self, frame: usize, material: impl Fn(usize) -> String, to_world: ToWorld) -> SimulateError {
        let (Lost { particle, position_m, velocity_m_s }, t_s) = match self {
            Self::Lost { lost, t_s } => (lost, t_s),
            Self::TooFast { speed_m_s, t_s } => return SimulateError::TooFast { speed_m_s, t_s, frame },
        };
        let finite = position_m.iter().chain(&velocity_m_s).all(|v| v.is_finite());
        let (what, cause) = if finite {
            (
                "left the domain",
                "either the scenario takes it out of the domain, which extends eight times the longest side around the \
                 object (lower its speed or force, or --duration), or a time step that is too long for its material \
                 made it fly off (lower --cfl, or --fixed-step if it is given)",
            )
        } else {
            (
                "became NaN or infinite",
                "the time step is too long for its material; lower --cfl, or --fixed-step if it is given",
            )
        };
        let origin = to_world.origin_m;
        let position_m = [0, 1, 2].map(|a| position_m[a] + origin[a] as f32);
        let material = material(particle);
        SimulateError::Lost { particle, material, what, t_s, frame, position_m, velocity_m_s, cause }
    }
}

/// Lets the object fall freely, in one step, from the start of `span` until `until_s` or the end of `span`; returns the
/// time that it reaches.
fn fall(object: &mut Object, until_s: f64, [from_s, to_s]: [f64; 2]) -> f64 {
    let end_s = until_s.min(to_s);
    if end_s <= from_s {
        return from_s;
    }
    object.fall(end_s - from_s);
    end_s
}

/// Advances from the start of `span` to its end, if the run takes at most `most_substeps` in all. The object is renewed for
/// each frame because a resumed run starts with a new one.
fn advance(
    object: &mut Object,
    bound: &StepBound,
    most_substeps: u64,
    actions: &[Acting],
    [from_s, to_s]: [f64; 2],
    record: &mut Record,
) -> Result<(), Failure> {
    object.renew();
    let mut left_s = to_s - from_s;
    while left_s > 0.0 {
        let (t_s, change_s) = action::now_and_next_change_s(actions, to_s, left_s);
        let speed_m_s = object.fastest_m_s();
        let dt_s = bound.next_s(left_s, speed_m_s).min(change_s - t_s);
        let after_s = if dt_s < left_s { left_s - dt_s } else { 0.0 };
        if after_s == left_s || record.substeps >= most_substeps {
            return Err(Failure::TooFast { speed_m_s, t_s });
        }
        action::step(actions, object, t_s, dt_s).map_err(|lost| Failure::Lost { lost, t_s: to_s - after_s })?;
        left_s = after_s;
        record.substeps += 1;
        record.longest_dt_s = record.longest_dt_s.max(dt_s);
    }
    Ok(())
}
