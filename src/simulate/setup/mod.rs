//! Everything that is decided before the first substep: the object's [`Extent`], its parcels, the [`Scenario`], how
//! [stiff](stiffness) its parts are, their particles in the initial pose.

mod report;
mod stiffness;

use std::path::Path;

use nalgebra::Point3;

use super::Input;
use super::action::Action;
use super::error::SimulateError;
use super::filling::{self, Filled, Parcel};
use super::frames::ToWorld;
use super::material::{self, Material, Prepared};
use super::object::Bodies;
use super::options::Options;
use super::report::SimulationReport;
use super::rigid::choice::Load;
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
use stiffness::{Conditions, Settled};

/// Length in metres that is assumed for the longest side of an object of unknown scale.
pub const ASSUMED_LONGEST_SIDE_M: f64 = 0.5;

/// Default simulated time, in multiples of sqrt(longest side / g): an object k times as large falls, swings and tumbles
/// sqrt(k) times as long.
const FALLS: f64 = 4.8;

/// A run is stopped after this many times the substeps that fit in `--max-simulation-minutes`. The estimate before the run
/// leaves out how fast a scenario makes things move, so a run that was let in may take somewhat longer.
const OVERRUN: f64 = 2.0;

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
    let extent = Extent::of(input, options)?;
    let Extent { longest_m, spacing_m, meters_per_unit, .. } = extent;
    let (carried, filled) = fill(input, &extent)?;
    let Scenario { pose, steps, load, duration_s } = Scenario::of(options, longest_m)?;
    let conditions = Conditions { input, options, parcels: &filled.parcels, extent: &extent, load, duration_s };
    let settled = conditions.settle()?;
    if settled.minutes > options.max_simulation_minutes {
        return Err(SimulateError::TooLong { minutes: settled.minutes, max_minutes: options.max_simulation_minutes });
    }

    let is_solid = extent.solid(&filled.parcels);
    let solid = filled.parcels.iter().zip(&is_solid).filter(|(_, is_solid)| **is_solid);
    let solid_m: Vec<[f64; 3]> = solid.map(|(parcel, _)| parcel.position_m).collect();
    let drop = Drop::new(&extent.bounds_m, &solid_m, spacing_m, pose);
    let (start, laws) = resting(&filled.parcels, &settled.materials.prepared, &drop);
    let setting = Setting {
        spacing_m: spacing_m as f32,
        gravity_m_s2: [0.0, 0.0, -options.gravity as f32],
        boundaries: vec![drop.ground(options.contact())],
        domain_m: [[0.0; 3], [drop.domain_m as f32; 3]],
        laws,
    };
    let labels: Vec<u32> = filled.parcels.iter().map(|p| p.label).collect();
    let standing = Standing {
        particles: &start,
        is_solid: &is_solid,
        labels: &labels,
        names: &names_of_parts(input.materials),
        longest_m,
        gravity_m_s2: options.gravity,
        duration_s,
    };
    let actions = standing.actions(&steps)?;
    let bodies = Bodies {
        body_of: labels.iter().map(|&label| settled.choice.body_of[label as usize]).collect(),
        part_of: labels.clone(),
        is_solid,
        plane_modulus_pa: input.materials.iter().map(Material::plane_modulus_pa).collect(),
    };
    let report = report::before_run(&conditions, &settled, &filled, carried.len(), &start, drop.ground_z_m);
    Ok(Setup {
        setting,
        ground: drop.ground_of_bodies(options.contact()),
        bodies,
        start,
        carried,
        labels,
        bound: settled.bound,
        to_world: ToWorld { origin_m: drop.origin_m, meters_per_unit },
        duration_s,
        falls_until_s: falls_until_s(pose[0] * longest_m, spacing_m, options, &actions),
        minutes: settled.minutes,
        most_substeps: most_substeps(options, &settled, actions.len()),
        actions,
        report,
    })
}

/// The object's place and size.
struct Extent {
    meters_per_unit: f64,
    /// Without strays.
    bounds_m: Bounds,
    longest_m: f64,
    /// Of the grid.
    spacing_m: f64,
}

impl Extent {
    fn of(input: &Input, options: &Options) -> Result<Self, SimulateError> {
        let bounds = robust_bounds(input.gaussians);
        let longest = bounds.size().max();
        if longest <= 0.0 {
            return Err(SimulateError::NoExtent);
        }
        let meters_per_unit = input.meters_per_unit.unwrap_or(ASSUMED_LONGEST_SIDE_M / longest);
        let longest_m = longest * meters_per_unit;
        Ok(Self {
            meters_per_unit,
            bounds_m: Bounds { min: bounds.min * meters_per_unit, max: bounds.max * meters_per_unit },
            longest_m,
            spacing_m: longest_m / f64::from(options.grid),
        })
    }

    /// Per parcel: whether it may touch the ground. It must lie inside the bounds, because strays beyond them would carry
    /// the whole object.
    fn solid(&self, parcels: &[Parcel]) -> Vec<bool> {
        let Bounds { min, max } = self.bounds_m;
        let within = |p: [f64; 3]| (0..3).all(|a| min[a] <= p[a] && p[a] <= max[a]);
        parcels.iter().map(|parcel| parcel.backed && within(parcel.position_m)).collect()
    }
}

/// The indices of the Gaussians that are simulated, and the parcels of the object, those of the Gaussians first.
fn fill(input: &Input, extent: &Extent) -> Result<(Vec<u32>, Filled), SimulateError> {
    let position_m = |i: u32| -> [f64; 3] { (input.gaussians.center(i as usize) * extent.meters_per_unit).into() };
    let simulated = simulated(input.gaussians);
    let carried: Vec<u32> = (0..).zip(simulated).filter_map(|(i, simulated)| simulated.then_some(i)).collect();
    let positions_m: Vec<[f64; 3]> = carried.iter().map(|&i| position_m(i)).collect();
    let labels: Vec<u32> = carried.iter().map(|&i| input.labels[i as usize]).collect();
    let filled = filling::fill(&positions_m, &labels, input.interior, extent.meters_per_unit, extent.spacing_m)?;
    Ok((carried, filled))
}

/// What happens to the object.
struct Scenario {
    /// Drop height in multiples of the longest side, and tilt in degrees.
    pose: [f64; 2],
    steps: Vec<Step>,
    load: Load,
    duration_s: f64,
}

impl Scenario {
    /// The scenario of the options for an object whose longest side is `longest_m`.
    fn of(options: &Options, longest_m: f64) -> Result<Self, SimulateError> {
        let script = script_of(options)?;
        let pose = match &script {
            Some(script) => [script.drop_height, script.tilt_deg],
            None => [options.drop_height, options.tilt_deg],
        };
        let anchors = options.anchor.iter().map(|part| Step { on: part.clone(), from: 0.0, to: 2.0, what: What::Hold });
        let steps: Vec<Step> = script.into_iter().flat_map(|script| script.steps).chain(anchors).collect();
        let load = Load::new(pose[0] * longest_m, options.gravity, longest_m, &steps);
        let duration_s = options.duration.unwrap_or_else(|| FALLS * (longest_m / GRAVITY_M_S2).sqrt());
        Ok(Self { pose, steps, load, duration_s })
    }
}

/// The number of substeps after which the run is stopped. A step also ends with each frame, and where one of the
/// `actions` begins or ends.
fn most_substeps(options: &Options, settled: &Settled, actions: usize) -> u64 {
    let ends = u64::from(options.frames) + 2 * actions as u64;
    let fitting = OVERRUN * options.max_simulation_minutes / settled.minutes_per_substep;
    ends.saturating_add(fitting as u64)
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

/// The particles at rest in the scenario's initial pose, and the laws that they refer to.
fn resting(parcels: &[Parcel], prepared: &[Prepared], drop: &Drop) -> (Vec<Particle>, Vec<Law>) {
    let mut laws = vec![];
    let particle = |parcel: &Parcel| particle(parcel, &prepared[parcel.label as usize], drop, &mut laws);
    (parcels.iter().map(particle).collect(), laws)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::material::SOFT_PA;
    use crate::simulate::rigid::choice;

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
