//! Runs a configuration on a scene, frame by frame.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::config::Config;
use super::estimated::{Estimated, EstimatedMaterial};
use super::particle::Particle;
use super::setup::{Setup, set_up};
use super::solver::{Lost, Solver};
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::simulate::SimulateError;
use crate::simulate::frames::{Deformation, Moved};
use crate::words::progress::Progress;

/// A frame in numbers, in the peer's box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CompatFrame {
    pub t_s: f64,
    pub center_of_mass_m: [f64; 3],
    pub kinetic_energy_j: f64,
}

/// The result of a run. The box's lengths stand for metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompatReport {
    pub particles: usize,
    /// Number of these particles that the filling added.
    pub fill_particles: usize,
    pub substeps: u64,
    pub dt_s: f64,
    /// The materials of the field, if they replaced the configuration's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<EstimatedMaterial>,
    pub frames: Vec<CompatFrame>,
}

/// Called with each frame: its number, its particles in the box, its Gaussians.
pub type OnFrame<'a, E> = dyn FnMut(usize, &[Particle], &Gaussians) -> Result<(), E> + 'a;

/// Runs `config` on a scene and passes each frame to `on_frame`: its number, its particles in the box, and the scene
/// without the Gaussians that the configuration drops. Frame 0 is the start. The materials are those of `estimated`, if
/// given, instead of the configuration's and its boxes'.
///
/// # Errors
/// [`SimulateError`] if the scene cannot be set up or a particle is lost. Errors of `on_frame` are returned unchanged.
pub fn run<E: From<SimulateError>>(
    gaussians: &Gaussians,
    config: &Config,
    estimated: Option<&Estimated>,
    on_frame: &mut OnFrame<E>,
    progress: Progress,
) -> Result<CompatReport, E> {
    let setup = set_up(gaussians, config, estimated)?;
    let mut solver = match estimated {
        None => Solver::new(config, setup.particles.clone()),
        Some(estimated) => Solver::with_laws(config, estimated.laws(config), setup.particles.clone()),
    };
    let substeps = config.substeps_per_frame();
    let bar = progress.bar("simulate", config.frame_num as u64);
    let mut report = CompatReport {
        particles: solver.particles.len(),
        fill_particles: setup.filled,
        substeps: 0,
        dt_s: config.substep_dt,
        materials: estimated.map_or_else(Vec::new, |estimated| estimated.materials.clone()),
        frames: vec![],
    };
    for frame in 0..=config.frame_num {
        if frame > 0 {
            let stepped = (0..substeps).try_for_each(|_| solver.step(config.substep_dt));
            // A step only finds particles that the steps before it lost.
            let checked = stepped.and_then(|()| solver.check());
            checked.map_err(|lost| left_the_box(&solver, &report.materials, lost, frame))?;
            report.substeps += substeps as u64;
            bar.inc(1);
        }
        report.frames.push(summary(&solver.particles, report.substeps as f64 * config.substep_dt));
        on_frame(frame, &solver.particles, &moved(&setup, &solver.particles))?;
    }
    bar.finish_and_clear();
    Ok(report)
}

fn left_the_box(
    solver: &Solver,
    materials: &[EstimatedMaterial],
    Lost { particle, time }: Lost,
    frame: usize,
) -> SimulateError {
    let p = &solver.particles[particle];
    let finite = p.position.iter().chain(&p.velocity).chain(&p.trial).all(|x| x.is_finite());
    SimulateError::Lost {
        particle,
        material: materials
            .get(p.law as usize)
            .map_or_else(|| "the configuration's material".to_owned(), |material| material.name.clone()),
        what: if finite { "left the box" } else { "became NaN or infinite" },
        t_s: time,
        frame,
        position_m: p.position.into(),
        velocity_m_s: p.velocity.into(),
        cause: if finite {
            "nothing keeps it inside; add a `bounding_box` or lower `scale`"
        } else {
            "the time step is too long for its material; lower `substep_dt`"
        },
    }
}

fn summary(particles: &[Particle], t_s: f64) -> CompatFrame {
    let (mut mass, mut moment, mut energy) = (0.0, Vector3::zeros(), 0.0);
    for p in particles {
        let m = f64::from(p.mass);
        mass += m;
        moment += p.position.map(f64::from) * m;
        energy += 0.5 * m * p.velocity.map(f64::from).norm_squared();
    }
    CompatFrame { t_s, center_of_mass_m: (moment / mass).into(), kinetic_energy_j: energy }
}

/// The scene moved with its particles: the covariance comes from the trial deformation, as in the peer (so plastic flow
/// does not change the shape); colours are rotated with it in the world's frame (the peer does this in the box's).
fn moved(setup: &Setup, particles: &[Particle]) -> Gaussians {
    let turn = setup.to_box.rotation.matrix();
    let moved = parallel::map_range(setup.carried.len(), |n| {
        let (i, particle) = (setup.carried[n] as usize, &particles[n]);
        let in_world = setup.to_box.undo(&particle.position.map(f64::from));
        let deformation: Matrix3<f64> = turn.transpose() * particle.trial.map(f64::from) * turn;
        Moved::new(&setup.scene, i, in_world, &Deformation::new(setup.scene.sh_degree, deformation))
    });
    let mut out = setup.scene.clone();
    for (&i, moved) in setup.carried.iter().zip(moved) {
        moved.store(&mut out, i as usize);
    }
    out.retain(&setup.opaque);
    out
}
