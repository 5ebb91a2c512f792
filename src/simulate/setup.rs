//! Everything that is decided before the first substep.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Point3;

use super::Input;
use super::action::Action;
use super::error::SimulateError;
use super::filling::{self, Filled, Parcel};
use super::frames::ToWorld;
use super::material::{self, Material, Materials, Prepared, SOFT_PA, Softened};
use super::object::Bodies;
use super::options::Options;
use super::report::{FilledReport, RigidReport, SimulationReport, StepReport};
use super::rigid::choice::{self, Choice, Load};
use super::scenario::Drop;
use super::script::{self, Script, Standing, Step, What, names_of_parts};
use super::time_step::StepBound;
use crate::files;
use crate::gaussians::Gaussians;
use crate::mpm::Setting;
use crate::mpm::boundary::Boundary;
use crate::mpm::laws::Law;
use crate::mpm::particles::Particle;
use crate::scene::{Bounds, robust_bounds};
use crate::units::GRAVITY_M_S2;
use crate::words::output::{agreeing, counted};

/// Length in metres that is assumed for the longest side of an object of unknown scale.
pub const ASSUMED_LONGEST_SIDE_M: f64 = 0.5;

/// Default simulated time, in multiples of sqrt(longest side / g): an object k times as large falls, swings and tumbles
/// sqrt(k) times as long.
const FALLS: f64 = 4.8;

/// The speed of a slow core; the bench `simulate` shows how much faster a given machine is.
const PARTICLE_SUBSTEPS_PER_S: f64 = 3e6;

/// The cost of rigid bodies, in particles.
const RIGID_PARTICLES: usize = 300;

/// A run is stopped after this many times the substeps that fit in `--max-simulation-minutes`. The estimate before the run
/// leaves out how fast a scenario makes things move, so a run that was let in may take somewhat longer.
const OVERRUN: f64 = 2.0;

/// The limit on the expected time of a simulation in which everything that deforms has its true stiffness. If it would
/// take longer, parts whose deformation is hardly visible become rigid; if that is not enough, stiff parts are softened.
/// If the user gives a limit for the stiffness, stiffer parts are softened to that limit, and nothing else is changed. If
/// the user fixes the step, nothing is changed at all, because there would be as many steps.
const LONGEST_MINUTES: f64 = 1.0;

/// A Gaussian that is further than this outside the object's bounds, in multiples of the longest side, is not part of
/// the object.
const STRAY: f64 = 1.0;

/// Everything that is decided before the first substep.
pub struct Setup {
    pub setting: Setting,
    /// The ground as rigid bodies meet it.
    pub ground: Boundary,
    pub bodies: Bodies,
    /// Particles of Gaussians first, then those of the inside.
    pub start: Vec<Particle>,
    /// For each of the first particles, the index of its Gaussian.
    pub carried: Vec<u32>,
    /// The label of each particle.
    pub labels: Vec<u32>,
    pub bound: StepBound,
    pub to_world: ToWorld,
    pub duration_s: f64,
    /// Until then, nothing touches the object: it falls as it is.
    pub falls_until_s: f64,
    /// The scenario's actions during the run.
    pub actions: Vec<Action>,
    /// Expected duration of the run.
    pub minutes: f64,
    /// The run is stopped if it takes more substeps.
    pub most_substeps: u64,
    /// The report, without the results of the run.
    pub report: SimulationReport,
}

/// The conditions that decide how stiff the simulated parts are, and how long the simulation takes.
struct Conditions<'a> {
    input: &'a Input<'a>,
    options: &'a Options,
    parcels: &'a [Parcel],
    load: Load,
    spacing_m: f64,
    duration_s: f64,
}

/// Which parts are rigid, and how the others deform.
struct Settled {
    choice: Choice,
    materials: Materials,
    bound: StepBound,
    /// The label that deforms with the fastest waves.
    fastest: Option<usize>,
    minutes: f64,
    minutes_per_substep: f64,
}

impl Conditions<'_> {
    /// The parts with their true stiffness, unless the user limits it, or it takes too long and the step is not fixed.
    fn settle(&self) -> Result<Settled, SimulateError> {
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
        let Self { input, options, parcels, load, spacing_m, duration_s } = *self;
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

/// Per Gaussian: whether it is simulated. Those that are set aside or lie far from the object stay in place.
pub fn simulated(gaussians: &Gaussians) -> Vec<bool> {
    let object = robust_bounds(gaussians);
    let farthest = STRAY * object.size().max();
    let near = |p: Point3<f64>| (0..3).all(|a| (object.min[a] - p[a]).max(p[a] - object.max[a]) <= farthest);
    (0..gaussians.len()).map(|i| !gaussians.is_set_aside(i) && near(gaussians.center(i))).collect()
}

/// Checks the input and sets up the run.
pub fn set_up(input: &Input, options: &Options) -> Result<Setup, SimulateError> {
    options.check()?;
    check(input)?;
    let object = robust_bounds(input.gaussians);
    let longest = object.size().max();
    if longest <= 0.0 {
        return Err(SimulateError::NoExtent);
    }
    let meters_per_unit = input.meters_per_unit.unwrap_or(ASSUMED_LONGEST_SIDE_M / longest);
    let object = Bounds { min: object.min * meters_per_unit, max: object.max * meters_per_unit };
    let longest_m = longest * meters_per_unit;
    let spacing_m = longest_m / f64::from(options.grid);

    let position_m = |i: u32| -> [f64; 3] { (input.gaussians.center(i as usize) * meters_per_unit).into() };
    let simulated = simulated(input.gaussians);
    let carried: Vec<u32> = (0..).zip(simulated).filter_map(|(i, simulated)| simulated.then_some(i)).collect();
    let positions_m: Vec<[f64; 3]> = carried.iter().map(|&i| position_m(i)).collect();
    let labels: Vec<u32> = carried.iter().map(|&i| input.labels[i as usize]).collect();
    let filled = filling::fill(&positions_m, &labels, input.interior, meters_per_unit, spacing_m)?;

    let script = script_of(options)?;
    let pose = match &script {
        Some(script) => [script.drop_height, script.tilt_deg],
        None => [options.drop_height, options.tilt_deg],
    };
    let anchors = options.anchor.iter().map(|part| Step { on: part.clone(), from: 0.0, to: 2.0, what: What::Hold });
    let steps: Vec<Step> = script.into_iter().flat_map(|script| script.steps).chain(anchors).collect();
    let load = Load::new(pose[0] * longest_m, options.gravity, longest_m, &steps);
    let duration_s = options.duration.unwrap_or_else(|| FALLS * (longest_m / GRAVITY_M_S2).sqrt());
    let conditions = Conditions { input, options, parcels: &filled.parcels, load, spacing_m, duration_s };
    let Settled { choice, materials, bound, fastest, minutes, minutes_per_substep } = conditions.settle()?;
    if minutes > options.max_simulation_minutes {
        return Err(SimulateError::TooLong { minutes, max_minutes: options.max_simulation_minutes });
    }

    // Where it may touch the ground: inside its bounds, because strays beyond them would carry the whole object.
    let within = |p: [f64; 3]| (0..3).all(|a| object.min[a] <= p[a] && p[a] <= object.max[a]);
    let is_solid: Vec<bool> = filled.parcels.iter().map(|parcel| parcel.backed && within(parcel.position_m)).collect();
    let solid = filled.parcels.iter().zip(&is_solid).filter(|(_, is_solid)| **is_solid);
    let solid_m: Vec<[f64; 3]> = solid.map(|(parcel, _)| parcel.position_m).collect();
    let drop = Drop::new(&object, &solid_m, spacing_m, pose);
    let mut laws = vec![];
    let prepared = &materials.prepared;
    let start: Vec<Particle> = filled
        .parcels
        .iter()
        .map(|parcel| particle(parcel, &prepared[parcel.label as usize], &drop, &mut laws))
        .collect();
    let setting = Setting {
        spacing_m: spacing_m as f32,
        gravity_m_s2: [0.0, 0.0, -options.gravity as f32],
        boundaries: vec![drop.ground(options.contact())],
        domain_m: [[0.0; 3], [drop.domain_m as f32; 3]],
        laws,
    };
    let labels: Vec<u32> = filled.parcels.iter().map(|p| p.label).collect();
    let strays = input.gaussians.len() - carried.len();
    let names = names_of_parts(input.materials);
    let standing = Standing {
        particles: &start,
        is_solid: &is_solid,
        labels: &labels,
        names: &names,
        longest_m,
        gravity_m_s2: options.gravity,
        duration_s,
    };
    let actions = standing.actions(&steps)?;
    // A step also ends with each frame, and where an action begins or ends.
    let ends = u64::from(options.frames) + 2 * actions.len() as u64;
    let fitting = OVERRUN * options.max_simulation_minutes / minutes_per_substep;
    let bodies = Bodies {
        body_of: labels.iter().map(|&label| choice.body_of[label as usize]).collect(),
        part_of: labels.clone(),
        is_solid,
        plane_modulus_pa: input.materials.iter().map(Material::plane_modulus_pa).collect(),
    };
    let mut warnings = warnings(input, longest_m, &filled.assumed_full, strays);
    if options.max_stiffness.is_none() {
        warnings.extend(materials.softened.iter().map(softened_warning));
    }
    let scenario = Path::new(&options.scenario).file_name().unwrap_or_default();
    let report = SimulationReport {
        scenario: scenario.to_string_lossy().into_owned(),
        particles: start.len(),
        fill_particles: start.len() - carried.len(),
        substeps: 0,
        dt_s: 0.0,
        time_step: StepReport {
            cfl: options.cfl,
            stiffest_material: fastest.map(|label| input.materials[label].name.clone()),
            wave_speed_m_s: bound.wave_speed_m_s,
        },
        mass_kg: start.iter().map(|p| f64::from(p.mass_kg)).sum(),
        filled: filled_report(input, &filled, carried.len()),
        gravity_m_s2: options.gravity,
        grid_spacing_m: spacing_m,
        meters_per_unit,
        scale_assumed: input.meters_per_unit.is_none(),
        rigid: rigid_report(input, &choice, &load),
        softened: materials.softened,
        poisson_capped: materials.poisson_capped,
        ground_z_m: drop.ground_z_m,
        frames: vec![],
        warnings,
    };
    Ok(Setup {
        setting,
        ground: drop.ground_of_bodies(options.contact()),
        bodies,
        start,
        carried,
        labels,
        bound,
        to_world: ToWorld { origin_m: drop.origin_m, meters_per_unit },
        duration_s,
        falls_until_s: falls_until_s(pose[0] * longest_m, spacing_m, options, &actions),
        actions,
        minutes,
        most_substeps: ends.saturating_add(fitting as u64),
        report,
    })
}

/// The time for which an object at rest at a height falls freely, s: until it is near the ground or an action begins.
fn falls_until_s(height_m: f64, spacing_m: f64, options: &Options, actions: &[Action]) -> f64 {
    /// A particle meets the plane that stops it, which lies below the ground, through nodes up to 1.5 cells away.
    const CLEAR_CELLS: f64 = 2.0;
    let clear_m = height_m - CLEAR_CELLS * spacing_m;
    if clear_m <= 0.0 || options.gravity <= 0.0 || options.fixed_step.is_some() {
        return 0.0;
    }
    let first_s = actions.iter().map(|action| action.from_s).fold(f64::INFINITY, f64::min);
    (2.0 * clear_m / options.gravity).sqrt().min(first_s)
}

/// The scenario's script; `None` for the drop without parameters, whose pose has its own options.
///
/// # Errors
/// [`SimulateError::Scenario`] if there is no such scenario, or its file cannot be read as one;
/// [`SimulateError::SetOfFile`] if a file is given with parameters.
pub fn script_of(options: &Options) -> Result<Option<Script>, SimulateError> {
    match options.scenario.as_str() {
        "drop" if options.set.is_empty() => Ok(None),
        "drop" => {
            // A parameter that is not set has the value of the option that stands for the same.
            let of_options = [format!("height={}", options.drop_height), format!("tilt={}", options.tilt_deg)];
            script::named("drop", &[&of_options[..], &options.set].concat()).map(Some)
        }
        name if script::is_name(name) => script::named(name, &options.set).map(Some),
        path if !options.set.is_empty() => Err(SimulateError::SetOfFile { path: path.to_owned() }),
        path => {
            let read = files::read_to_string(Path::new(path));
            let text = read.map_err(|error| SimulateError::Scenario(format!("`{path}`: {error}")))?;
            Script::from_toml(&text).map(Some)
        }
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

fn check(input: &Input) -> Result<(), SimulateError> {
    let gaussians = input.gaussians.len();
    if gaussians == 0 {
        return Err(SimulateError::NoParticles);
    }
    if input.labels.len() != gaussians {
        return Err(SimulateError::Mismatch { what: "number of labels", got: input.labels.len(), gaussians });
    }
    let labels = input.materials.len();
    if let Some(index) = input.labels.iter().position(|&l| l as usize >= labels) {
        return Err(SimulateError::Label { what: "Gaussian", index, label: input.labels[index], labels });
    }
    if let Some(index) = input.interior.iter().position(|p| p.label as usize >= labels) {
        return Err(SimulateError::Label { what: "interior point", index, label: input.interior[index].label, labels });
    }
    let no_place = |p: &[f32; 3]| p.iter().any(|x| !x.is_finite());
    input.materials.iter().try_for_each(material::check)?;
    match input.gaussians.positions.iter().position(no_place) {
        Some(index) => Err(SimulateError::Position {
            what: "Gaussian",
            index,
            position: input.gaussians.positions[index].map(f64::from),
        }),
        None => Ok(()),
    }
}

/// A resting particle in the scenario's initial pose.
fn particle(parcel: &Parcel, material: &Prepared, drop: &Drop, laws: &mut Vec<Law>) -> Particle {
    let law = laws.iter().position(|l| *l == material.law).unwrap_or_else(|| {
        laws.push(material.law);
        laws.len() - 1
    });
    let turn = drop.rotation.matrix().transpose();
    let turn: [f32; 9] = std::array::from_fn(|i| turn[i] as f32);
    Particle {
        position_m: drop.placed(parcel.position_m).map(|x| x as f32).into(),
        compensation_m: [0.0; 3],
        velocity_m_s: [0.0; 3],
        affine: [0.0; 9],
        elastic: turn,
        deformation: turn,
        mass_kg: (parcel.volume_m3 * material.density_kg_m3) as f32,
        volume_m3: parcel.volume_m3 as f32,
        mu: material.mu_pa as f32,
        lambda: material.lambda_pa as f32,
        state: material.state as f32,
        law: law as u32,
    }
}

/// The particles of every label in use; the first `carried` parcels are Gaussians.
fn filled_report(input: &Input, filled: &Filled, carried: usize) -> Vec<FilledReport> {
    let used: BTreeSet<u32> = filled.parcels.iter().map(|p| p.label).collect();
    let report_of = |label: u32| {
        let material = &input.materials[label as usize];
        let count = |parcels: &[Parcel]| parcels.iter().filter(|p| p.label == label).count();
        FilledReport {
            part: material.caption.clone(),
            material: material.name.clone(),
            gaussians: count(&filled.parcels[..carried]),
            fill_particles: count(&filled.parcels[carried..]),
            volume_m3: filled.parcels.iter().filter(|p| p.label == label).map(|p| p.volume_m3).sum(),
            skin: filled.assumed_full.contains(&label),
        }
    };
    used.into_iter().map(report_of).collect()
}

/// The rigid parts, before they touched anything.
fn rigid_report(input: &Input, choice: &Choice, load: &Load) -> Vec<RigidReport> {
    let report_of = |(label, body): (usize, &Option<u32>)| {
        let material = &input.materials[label];
        Some(RigidReport {
            part_id: material.part_id,
            label: label as u32,
            part: material.caption.clone(),
            material: material.name.clone(),
            body: (*body)?,
            strain: load.strain(material),
            because: choice.reasons[label]?,
            peak_pressure_pa: 0.0,
            strength_pa: material.strength_pa,
            dents: false,
        })
    };
    choice.body_of.iter().enumerate().filter_map(report_of).collect()
}

fn softened_warning(softened: &Softened) -> String {
    format!(
        "{} is softened by a factor of {:.1} in the simulation, which would take too long otherwise: it bends more than \
         the real object would; --max-stiffness sets the limit",
        softened.material,
        1.0 / softened.factor
    )
}

fn warnings(input: &Input, longest_m: f64, assumed_full: &[u32], strays: usize) -> Vec<String> {
    let mut warnings = Vec::new();
    if input.meters_per_unit.is_none() {
        warnings.push(format!(
            "the scale is unknown: the simulation takes the longest side to be {longest_m} m; give --scale or \
             --known-mass to simulate it at its true size"
        ));
    }
    if !assumed_full.is_empty() {
        let mut names: Vec<&str> = Vec::new();
        for &label in assumed_full {
            let name = input.materials[label as usize].name.as_str();
            if !names.contains(&name) {
                names.push(name);
            }
        }
        warnings.push(format!(
            "nothing is known about the inside of {}: only a skin one cell thick is simulated there",
            names.join(", ")
        ));
    }
    if strays > 0 {
        warnings.push(format!(
            "{} {}",
            counted(strays, "Gaussian"),
            agreeing(
                strays,
                "lies far from the object or was set aside: it is not simulated and stays in place",
                "lie far from the object or were set aside: they are not simulated and stay in place",
            ),
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_that_is_not_set_is_that_of_the_option() {
        let options = Options { drop_height: 0.1, tilt_deg: 7.0, set: vec!["tilt=5".to_owned()], ..Options::default() };
        let script = script_of(&options).unwrap().unwrap();
        assert_eq!((script.drop_height, script.tilt_deg), (0.1, 5.0));
    }

    /// The setup of a cube of a metre, as dense as steel.
    fn cube(youngs_modulus_pa: f64, options: &Options) -> Setup {
        let steel = Material {
            name: "steel".to_owned(),
            part_id: 1,
            caption: "cube".to_owned(),
            density_kg_m3: 7850.0,
            youngs_modulus_pa,
            poisson_ratio: 0.3,
            strength_pa: 2.5e8,
            law: crate::materials::Law::Elastic,
            moves_with: None,
        };
        let corners = (0..8).map(|n| [(n & 1) as f32, (n >> 1 & 1) as f32, (n >> 2) as f32]);
        let gaussians =
            Gaussians { positions: corners.collect(), opacity_logits: vec![3.0; 8], ..Gaussians::default() };
        let input = Input {
            gaussians: &gaussians,
            labels: &[0; 8],
            materials: &[steel],
            interior: &[],
            meters_per_unit: Some(1.0),
        };
        set_up(&input, options).unwrap()
    }

    /// A cube of steel that deforms, for a time that takes far more than a minute either way: softening would not shorten a
    /// run whose step is fixed.
    #[test]
    fn a_fixed_step_softens_nothing() {
        let softened = |fixed_step: Option<f64>, duration: f64, max_stiffness: Option<f64>| -> Vec<f64> {
            let rigid = vec![choice::NEVER.to_owned()];
            let duration = Some(duration);
            let options = Options { fixed_step, duration, max_stiffness, rigid, ..Options::default() };
            let setup = cube(2e11, &options);
            setup.report.softened.iter().map(|softened| softened.factor).collect()
        };
        assert_eq!(softened(None, 3000.0, None), [SOFT_PA / 2e11]);
        assert!(softened(Some(1e-9), 1.0, None).is_empty());
        assert_eq!(softened(Some(1e-9), 1.0, Some(1e9)), [1e9 / 2e11]);
    }

    /// Dropped from half a metre, the cube strains by 3.13 m/s sqrt(7850 kg/m3 / E): 0.28 % with 1e10 Pa, hardly visible.
    #[test]
    fn a_fixed_step_makes_nothing_rigid_to_save_time() {
        let report = |fixed_step: Option<f64>, duration: f64| {
            cube(1e10, &Options { fixed_step, duration: Some(duration), ..Options::default() }).report
        };
        let slow = report(None, 3000.0);
        assert_eq!(slow.rigid.iter().map(|part| part.because).collect::<Vec<_>>(), [choice::Reason::TooSlow]);
        let note = slow.rigid_to_save_time();
        assert_eq!(note, " (1 part is rigid to save time; `--rigid never` lets it deform)");
        let fixed = report(Some(1e-9), 1.0);
        assert!(fixed.rigid.is_empty() && fixed.rigid_to_save_time().is_empty());
    }
}
