//! The Material Point Method on the Gaussians: every Gaussian a particle with its own density, stiffness and law, the
//! inside filled up, dropped onto the ground.
//!
//! In order:
//! 1. [`material`]: properties checked, too stiff ones softened;
//! 2. [`filling`]: a volume for every Gaussian, particles for the inside;
//! 3. [`scenario`]: first pose, ground, domain;
//! 4. [`mpm`] in substeps of [`time_step`], frame by frame;
//! 5. [`frames`]: the Gaussians moved, turned and stretched; a [`checkpoint`] with each.

pub mod animation;
pub mod boundary;
pub mod checkpoint;
mod error;
pub mod filling;
mod frames;
pub mod material;
pub mod mpm;
mod options;
pub mod scenario;
mod sh_rotation;
pub mod time_step;

use serde::{Deserialize, Serialize};

use crate::progress::Progress;
use crate::scene::gaussians::Gaussians;
use crate::scene::{Bounds, robust_bounds};
pub use checkpoint::FrameSummary;
use checkpoint::{Checkpoint, Record};
pub use error::SimulateError;
use filling::{Body, FillPoint};
pub use frames::Frame;
use frames::ToWorld;
use material::{Material, Materials, PoissonCapped, Softened};
use mpm::particles::Particle;
use mpm::{Lost, Setting, Solver};
pub use options::Options;
use scenario::Drop;
use time_step::StepBound;

/// Length in metres that the longest side of an object of unknown scale is taken to have.
pub const ASSUMED_LONGEST_SIDE_M: f64 = 0.5;

/// What is simulated.
#[derive(Debug, Clone, Copy)]
pub struct Input<'a> {
    pub gaussians: &'a Gaussians,
    /// Per Gaussian: index into `materials`.
    pub labels: &'a [u32],
    pub materials: &'a [Material],
    /// All of the object's inside, cell by cell, near the surface too. May be empty: then Gaussians alone carry volume.
    pub interior: &'a [FillPoint],
    /// `None` where unknown: the longest side is then taken to be [`ASSUMED_LONGEST_SIDE_M`].
    pub meters_per_unit: Option<f64>,
}

/// What came out, but for the frames. Written as `simulation.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SimulationReport {
    pub particles: usize,
    /// Of these, those that fill the inside.
    pub fill_particles: usize,
    pub substeps: u64,
    /// The shortest substep.
    pub dt_s: f64,
    /// How the substep came about.
    pub time_step: StepReport,
    pub mass_kg: f64,
    pub grid_spacing_m: f64,
    /// The scale used, and whether it is an assumption.
    pub meters_per_unit: f64,
    pub scale_assumed: bool,
    pub softened: Vec<Softened>,
    pub poisson_capped: Vec<PoissonCapped>,
    /// World z of the ground.
    pub ground_z_m: f64,
    pub frames: Vec<FrameSummary>,
    pub warnings: Vec<String>,
}

impl SimulationReport {
    /// All places the object passes: lowest and highest corner, world frame, scene units.
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

/// The bound on the substep: dt <= cfl * spacing / (wave speed + speed).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    pub cfl: f64,
    /// Whose pressure waves are the fastest.
    pub stiffest_material: String,
    pub wave_speed_m_s: f64,
}

/// Everything that is settled before the first substep.
struct Plan {
    setting: Setting,
    start: Vec<Particle>,
    labels: Vec<u32>,
    bound: StepBound,
    to_world: ToWorld,
    report: SimulationReport,
}

/// Drops the object and hands `on_frame` each frame as it is done, with a checkpoint from which a later call resumes
/// right after it. Frames before the checkpoint are not handed out again; the report holds all.
///
/// # Errors
/// [`SimulateError`]: input that cannot be simulated, a particle that is lost, a frame that `on_frame` refuses.
pub fn simulate(
    input: &Input,
    options: &Options,
    resume: Option<Checkpoint>,
    on_frame: &mut dyn FnMut(&Frame, &Checkpoint) -> anyhow::Result<()>,
    progress: Progress,
) -> Result<SimulationReport, SimulateError> {
    let Plan { setting, start, labels, bound, to_world, mut report } = plan(input, options)?;
    let identity =
        checkpoint::identity(&start, &format!("{setting:?} {bound:?} {} {}", options.frames, options.duration));
    let mut state = match resume {
        Some(checkpoint) if checkpoint.identity == identity => checkpoint,
        Some(_) => return Err(SimulateError::Checkpoint("it belongs to another scene or other options".to_owned())),
        None => Checkpoint {
            identity,
            record: Record { substeps: 0, shortest_dt_s: None, frames: vec![] },
            particles: start,
        },
    };
    let bar = progress.bar("simulate", u64::from(options.frames));
    bar.set_position(state.frames() as u64);
    let time_of = |frame: usize| options.duration * frame as f64 / f64::from(options.frames - 1);
    for index in state.frames()..options.frames as usize {
        if index > 0 {
            let span = [time_of(index - 1), time_of(index)];
            let advanced = advance(&setting, &state.particles, &bound, span, &mut state.record);
            state.particles = advanced.map_err(|failure| {
                let label = labels[failure.lost.particle] as usize;
                failure.into_error(index, input.materials[label].name.clone(), to_world)
            })?;
        }
        let gaussians = frames::deformed(input.gaussians, &state.particles, to_world);
        state.record.frames.push(frames::summary(&state.particles, &gaussians, to_world, time_of(index)));
        let frame = Frame { index, summary: state.record.frames[index], gaussians };
        on_frame(&frame, &state).map_err(SimulateError::Frame)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    report.substeps = state.record.substeps;
    report.dt_s = state.record.shortest_dt_s.unwrap_or(0.0);
    report.frames = state.record.frames;
    Ok(report)
}

/// A lost particle and when.
struct Failure {
    lost: Lost,
    t_s: f64,
}

impl Failure {
    fn into_error(self, frame: usize, material: String, to_world: ToWorld) -> SimulateError {
        let Lost { particle, position_m, velocity_m_s } = self.lost;
        let finite = position_m.iter().chain(&velocity_m_s).all(|v| v.is_finite());
        let (what, cause) = match finite {
            false => ("is no number any more", "the time step is too long for its material; lower --cfl"),
            true => (
                "left the domain",
                "it was thrown off, by a time step too long for its material (lower --cfl) or by Gaussians far from \
                 the object",
            ),
        };
        let origin = to_world.origin_m;
        let position_m = [0, 1, 2].map(|a| position_m[a] + origin[a] as f32);
        SimulateError::Lost { particle, material, what, t_s: self.t_s, frame, position_m, velocity_m_s, cause }
    }
}

/// Particles at the end of `span`, from those at its start. The solver is made anew for each frame, so that a resumed
/// run finds the particles in the same order.
fn advance(
    setting: &Setting,
    particles: &[Particle],
    bound: &StepBound,
    [from_s, to_s]: [f64; 2],
    record: &mut Record,
) -> Result<Vec<Particle>, Failure> {
    let mut solver = Solver::new(setting.clone(), particles);
    let mut left_s = to_s - from_s;
    while left_s > 0.0 {
        let dt_s = bound.next_s(left_s, f64::from(solver.fastest_m_s()));
        left_s = if dt_s < left_s { left_s - dt_s } else { 0.0 };
        solver.step(dt_s as f32).map_err(|lost| Failure { lost, t_s: to_s - left_s })?;
        record.substeps += 1;
        record.shortest_dt_s = Some(record.shortest_dt_s.map_or(dt_s, |shortest| shortest.min(dt_s)));
    }
    Ok(solver.particles())
}

fn plan(input: &Input, options: &Options) -> Result<Plan, SimulateError> {
    check(input)?;
    let Materials { prepared, softened, poisson_capped } = Materials::prepare(input.materials, options.max_stiffness)?;
    let object = robust_bounds(input.gaussians);
    let longest = object.size().max();
    if longest <= 0.0 {
        return Err(SimulateError::NoExtent);
    }
    let meters_per_unit = input.meters_per_unit.unwrap_or(ASSUMED_LONGEST_SIDE_M / longest);
    let object = Bounds { min: object.min * meters_per_unit, max: object.max * meters_per_unit };
    let spacing_m = longest * meters_per_unit / f64::from(options.grid);
    let positions_m: Vec<[f64; 3]> =
        (0..input.gaussians.len()).map(|i| (input.gaussians.center(i) * meters_per_unit).into()).collect();
    let filled = filling::fill(&positions_m, input.labels, input.interior, meters_per_unit, spacing_m)?;
    let all_m: Vec<[f64; 3]> = filled.bodies.iter().map(|b| b.position_m).collect();
    let drop = Drop::new(&object, &all_m, options);
    let mut laws = vec![];
    let start: Vec<Particle> =
        filled.bodies.iter().map(|body| particle(body, &prepared[body.label as usize], &drop, &mut laws)).collect();
    let setting = Setting {
        spacing_m: spacing_m as f32,
        gravity_m_s2: [0.0, 0.0, -options.gravity as f32],
        boundaries: vec![drop.ground(spacing_m, options.ground_friction)],
        domain_m: [[0.0; 3], [drop.domain_m as f32; 3]],
        laws,
    };
    let outside = |p: &Particle| p.position_m.iter().any(|&x| !(x > 0.0 && x < drop.domain_m as f32));
    if let Some(particle) = start.iter().position(outside) {
        return Err(SimulateError::Domain { particle, position_m: start[particle].position_m });
    }
    let used: std::collections::BTreeSet<u32> = filled.bodies.iter().map(|b| b.label).collect();
    let speed = |label: &u32| prepared[*label as usize].wave_speed_m_s();
    let stiffest =
        used.iter().copied().max_by(|a, b| speed(a).total_cmp(&speed(b))).ok_or(SimulateError::NoParticles)?;
    let bound = StepBound { cfl: options.cfl, spacing_m, wave_speed_m_s: speed(&stiffest) };
    let report = SimulationReport {
        particles: start.len(),
        fill_particles: start.len() - input.gaussians.len(),
        substeps: 0,
        dt_s: 0.0,
        time_step: StepReport {
            cfl: options.cfl,
            stiffest_material: input.materials[stiffest as usize].name.clone(),
            wave_speed_m_s: bound.wave_speed_m_s,
        },
        mass_kg: start.iter().map(|p| f64::from(p.mass_kg)).sum(),
        grid_spacing_m: spacing_m,
        meters_per_unit,
        scale_assumed: input.meters_per_unit.is_none(),
        softened,
        poisson_capped,
        ground_z_m: drop.ground_z_m,
        frames: vec![],
        warnings: warnings(input, longest * meters_per_unit, &filled.assumed_full),
    };
    let to_world = ToWorld { origin_m: drop.origin_m, meters_per_unit };
    Ok(Plan { setting, start, labels: filled.bodies.iter().map(|b| b.label).collect(), bound, to_world, report })
}

fn check(input: &Input) -> Result<(), SimulateError> {
    let gaussians = input.gaussians.len();
    if gaussians == 0 {
        return Err(SimulateError::NoParticles);
    }
    if input.labels.len() != gaussians {
        return Err(SimulateError::Mismatch { what: "number of labels", got: input.labels.len(), gaussians });
    }
    let labels = input.materials.len();
    if let Some(gaussian) = input.labels.iter().position(|&l| l as usize >= labels) {
        return Err(SimulateError::Label { gaussian, label: input.labels[gaussian], labels });
    }
    if let Some(point) = input.interior.iter().position(|p| p.label as usize >= labels) {
        return Err(SimulateError::Label { gaussian: point, label: input.interior[point].label, labels });
    }
    let no_place = |p: &[f32; 3]| p.iter().any(|x| !x.is_finite());
    match input.gaussians.positions.iter().position(no_place) {
        Some(index) => Err(SimulateError::Position {
            what: "Gaussian",
            index,
            position: input.gaussians.positions[index].map(f64::from),
        }),
        None => Ok(()),
    }
}

/// A resting particle in the scenario's first pose.
fn particle(body: &Body, material: &material::Prepared, drop: &Drop, laws: &mut Vec<mpm::laws::Law>) -> Particle {
    let law = laws.iter().position(|l| *l == material.law).unwrap_or_else(|| {
        laws.push(material.law);
        laws.len() - 1
    });
    let turn = drop.rotation.matrix().transpose();
    let turn: [f32; 9] = std::array::from_fn(|i| turn[i] as f32);
    Particle {
        position_m: drop.placed(body.position_m).map(|x| x as f32).into(),
        velocity_m_s: [0.0; 3],
        affine: [0.0; 9],
        elastic: turn,
        deformation: turn,
        mass_kg: (body.volume_m3 * material.density_kg_m3) as f32,
        volume_m3: body.volume_m3 as f32,
        mu: material.mu_pa as f32,
        lambda: material.lambda_pa as f32,
        state: material.state as f32,
        law: law as u32,
    }
}

fn warnings(input: &Input, longest_m: f64, assumed_full: &[u32]) -> Vec<String> {
    let mut warnings = Vec::new();
    if input.meters_per_unit.is_none() {
        warnings.push(format!(
            "the scale is unknown: the simulation takes the longest side to be {longest_m} m; give --scale to simulate it \
             at its true size"
        ));
    }
    if !assumed_full.is_empty() {
        let names: Vec<&str> = assumed_full.iter().map(|&l| input.materials[l as usize].name.as_str()).collect();
        warnings.push(format!(
            "nothing is known of the inside of {}: it is simulated as a skin one cell thick",
            names.join(", ")
        ));
    }
    warnings
}
