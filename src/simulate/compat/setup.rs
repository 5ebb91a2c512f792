//! From a scene's Gaussians to particles in the peer's box.
//!
//! Gaussians of low opacity are dropped; the others are rotated, cropped to the simulated region, centred at (1, 1, 1)
//! and scaled so that the longest side is `scale`; the inside is filled; every particle gets its share of its cell's
//! volume.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::config::{Config, LawName};
use super::estimated::Estimated;
use super::filling::{self, Blob};
use super::particle::Particle;
use super::strength_at;
use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;
use crate::simulate::SimulateError;

/// From the world (scene units) to the box: rotated, moved to the origin, scaled, and moved to the box's middle.
#[derive(Debug, Clone, Copy)]
pub struct ToBox {
    pub rotation: Rotation3<f64>,
    /// Middle of the rotated object.
    middle: Vector3<f64>,
    /// Box lengths per scene unit.
    pub scale: f64,
}

impl ToBox {
    fn apply(&self, turned: &Vector3<f64>) -> Vector3<f64> {
        (turned - self.middle) * self.scale + Vector3::repeat(1.0)
    }

    /// The world position of a place in the box.
    pub fn undo(&self, place: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.inverse_transform_vector(&((place - Vector3::repeat(1.0)) / self.scale + self.middle))
    }
}

/// A scene in the peer's box.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Particles of Gaussians first, then those of the inside.
    pub particles: Vec<Particle>,
    /// For each of the first particles, the index of its Gaussian in `scene`.
    pub carried: Vec<u32>,
    /// The scene, plus a Gaussian for each particle of the inside if the configuration makes them visible: a copy of
    /// the nearest one that is simulated.
    pub scene: Gaussians,
    /// Number of particles of the inside.
    pub filled: usize,
    /// Per Gaussian of the scene: true if its opacity is high enough to be simulated. The peer drops the others from
    /// the scene.
    pub opaque: Vec<bool>,
    pub to_box: ToBox,
}

/// Sets up a scene, with the materials of `estimated` instead of the configuration's, if given.
///
/// # Errors
/// If there is nothing to simulate, a Gaussian has no finite position, the filling exceeds its limit, or the object
/// leaves the box.
pub fn set_up(gaussians: &Gaussians, config: &Config, estimated: Option<&Estimated>) -> Result<Setup, SimulateError> {
    let rotation = rotation(config);
    let mut opaque: Vec<bool> = (0..gaussians.len()).map(|i| gaussians.opacity(i) > config.opacity_threshold).collect();
    let chosen = chosen(gaussians, config, &rotation, &opaque)?;
    let to_box = to_box(rotation, &chosen, config)?;
    let mut places: Vec<Vector3<f32>> =
        chosen.iter().map(|(_, turned)| to_box.apply(turned).map(|x| x as f32)).collect();
    let mut carried: Vec<u32> = chosen.into_iter().map(|(i, _)| i).collect();
    let mut scene = gaussians.clone();
    let outside = places.len();
    // The Gaussian of each particle; of those of the inside, the nearest one.
    let mut sources = carried.clone();
    if let Some(filling) = &config.particle_filling {
        let blobs: Vec<Blob> =
            carried.iter().zip(&places).map(|(&i, &place)| blob(gaussians, i as usize, place, &to_box)).collect();
        let cells = filling.n_grid.unwrap_or(4 * config.n_grid);
        places.extend(filling::fill(&blobs, cells, (config.grid_lim / cells as f64) as f32, filling)?.added);
        if filling.visualize || estimated.is_some() {
            let nearest = Nearest::new(places[..outside].iter().map(|&p| p.into()));
            let source = |p: &Vector3<f32>| carried[nearest.find((*p).into(), 1)[0].1 as usize];
            sources.extend(places[outside..].iter().map(source));
        }
        if filling.visualize {
            let inside = &sources[outside..];
            carried.extend((scene.len() as u32..).take(inside.len()));
            scene.repeat(inside);
            opaque.resize(scene.len(), true);
        }
    }
    check_in_box(&places, config)?;
    let particles = particles(config, estimated, &places, &sources);
    Ok(Setup { filled: particles.len() - outside, particles, carried, scene, opaque, to_box })
}

/// The Gaussians that are simulated, by index, with their centres turned by the configuration's rotations.
///
/// # Errors
/// If there are none, or the position of an opaque one is not finite.
fn chosen(
    gaussians: &Gaussians,
    config: &Config,
    rotation: &Rotation3<f64>,
    opaque: &[bool],
) -> Result<Vec<(u32, Vector3<f64>)>, SimulateError> {
    let in_area = |p: &Vector3<f64>| {
        config.sim_area.is_none_or(|area| (0..3).all(|a| area[2 * a] < p[a] && p[a] < area[2 * a + 1]))
    };
    let mut chosen = Vec::new();
    for i in (0..gaussians.len()).filter(|&i| opaque[i]) {
        let turned = rotation * gaussians.center(i).coords;
        if turned.iter().any(|x| !x.is_finite()) {
            let position = gaussians.positions[i].map(f64::from);
            return Err(SimulateError::Position { what: "Gaussian", index: i, position });
        }
        if in_area(&turned) {
            chosen.push((i as u32, turned));
        }
    }
    if gaussians.is_empty() {
        return Err(SimulateError::NoParticles);
    }
    if chosen.is_empty() {
        let problem = "no Gaussian of the scene lies in `sim_area` and has an opacity above `opacity_threshold`";
        return Err(SimulateError::Configuration(problem.to_owned()));
    }
    Ok(chosen)
}

/// The map that brings the longest side of the chosen Gaussians to the configuration's scale.
fn to_box(rotation: Rotation3<f64>, chosen: &[(u32, Vector3<f64>)], config: &Config) -> Result<ToBox, SimulateError> {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for (_, turned) in chosen {
        (low, high) = (low.inf(turned), high.sup(turned));
    }
    let longest = (high - low).max();
    if longest <= 0.0 {
        return Err(SimulateError::NoExtent);
    }
    Ok(ToBox { rotation, middle: (low + high) / 2.0, scale: config.scale / longest })
}

fn check_in_box(places: &[Vector3<f32>], config: &Config) -> Result<(), SimulateError> {
    let side = config.grid_lim as f32;
    match places.iter().position(|p| p.iter().any(|x| !(0.0..side).contains(x))) {
        Some(index) => Err(SimulateError::Configuration(format!(
            "particle {index} lies at {:?}, outside the box with a side of {side}: lower `scale`",
            places[index].as_slice()
        ))),
        None => Ok(()),
    }
}

/// Particles at rest; `sources` are the Gaussians from which each takes its material, if that is estimated.
fn particles(
    config: &Config,
    estimated: Option<&Estimated>,
    places: &[Vector3<f32>],
    sources: &[u32],
) -> Vec<Particle> {
    let dx = (config.grid_lim / config.n_grid as f64) as f32;
    match estimated {
        None => {
            let volumes = filling::volumes(places, config.n_grid, dx, config.material == LawName::Sand);
            let particle = |(place, volume): (&Vector3<f32>, f32)| {
                let (strength, density) = strength_at(config, place);
                Particle::at_rest(*place, volume, density * volume, strength)
            };
            places.iter().zip(volumes).map(particle).collect()
        }
        Some(estimated) => {
            let is_sand = |&i: &u32| estimated.of(i).law == LawName::Sand;
            let volumes = filling::volumes(places, config.n_grid, dx, sources.iter().all(is_sand));
            estimated.particles(config, places, &volumes, sources)
        }
    }
}

/// The configuration's rotations, applied one after the other.
fn rotation(config: &Config) -> Rotation3<f64> {
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let turns = config.rotation_degree.iter().zip(&config.rotation_axis);
    turns.fold(Rotation3::identity(), |all, (degrees, &axis)| {
        Rotation3::from_axis_angle(&axes[axis], degrees.to_radians()) * all
    })
}

fn blob(gaussians: &Gaussians, i: usize, position: Vector3<f32>, to_box: &ToBox) -> Blob {
    let turn = to_box.rotation.matrix();
    let c: Matrix3<f64> = turn * gaussians.covariance(i) * turn.transpose() * to_box.scale.powi(2);
    let covariance = [c.m11, c.m12, c.m13, c.m22, c.m23, c.m33].map(|x| x as f32);
    Blob { position, opacity: gaussians.opacity(i) as f32, covariance }
}
