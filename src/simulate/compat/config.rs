//! The peer's JSON configuration: every key that it reads, under the peer's names (misspelt ones too), with its
//! defaults. An unknown key is an error here; the peer silently ignores it.
//!
//! Lengths are in the peer's box, a cube of side `grid_lim` with the object's middle at (1, 1, 1); the numbers have no
//! units.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::files::json;
use crate::simulate::SimulateError;

/// Keys for the camera of the peer's viewer, and one that its solver reads but never uses.
const WITHOUT_EFFECT: [&str; 12] = [
    "mpm_space_viewpoint_center",
    "mpm_space_vertical_upward_axis",
    "default_camera_index",
    "show_hint",
    "init_azimuthm",
    "init_elevation",
    "init_radius",
    "delta_a",
    "delta_e",
    "delta_r",
    "move_camera",
    "pic_damping",
];

/// Cells of the largest grid, each way: 2 GB of nodes.
const MOST_CELLS: usize = 512;

/// The peer's name for a constitutive law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LawName {
    Jelly,
    Metal,
    Sand,
    Foam,
    Snow,
    Plasticine,
}

/// A configuration.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    pub material: LawName,
    #[serde(rename = "E")]
    pub youngs_modulus: f32,
    #[serde(rename = "nu")]
    pub poisson_ratio: f32,
    pub density: f32,
    pub yield_stress: f32,
    /// Hardens if this is 1.
    pub hardening: f32,
    /// Hardening modulus as a multiple of 2 mu.
    pub xi: f32,
    pub softening: f32,
    /// Degrees.
    pub friction_angle: f32,
    pub plastic_viscosity: f32,
    /// Gravity. The peer's own default, a single number, makes it fail; the default here points down.
    pub g: [f32; 3],
    /// 0: APIC; up to 1: RPIC; below -0.001: PIC.
    pub rpic_damping: f32,
    /// Factor on all grid velocities after each substep, if less than 1.
    pub grid_v_damping_scale: f32,
    pub additional_material_params: Vec<MaterialBox>,
    pub boundary_conditions: Vec<Boundary>,
    pub n_grid: usize,
    pub grid_lim: f64,
    pub substep_dt: f64,
    pub frame_dt: f64,
    pub frame_num: usize,
    pub opacity_threshold: f64,
    pub rotation_degree: Vec<f64>,
    /// 0, 1, 2 for x, y, z.
    pub rotation_axis: Vec<usize>,
    /// Lowest and highest x, then y, then z of the simulated region, after the rotations.
    pub sim_area: Option<[f64; 6]>,
    /// Longest side of the object in the box.
    pub scale: f64,
    pub particle_filling: Option<Filling>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            material: LawName::Jelly,
            youngs_modulus: 1e5,
            poisson_ratio: 0.4,
            density: 200.0,
            yield_stress: 0.0,
            hardening: 0.0,
            xi: 0.0,
            softening: 0.1,
            friction_angle: 25.0,
            plastic_viscosity: 0.0,
            g: [0.0, 0.0, -9.8],
            rpic_damping: 0.0,
            grid_v_damping_scale: 1.1,
            additional_material_params: vec![],
            boundary_conditions: vec![],
            n_grid: 50,
            grid_lim: 2.0,
            substep_dt: 1e-4,
            frame_dt: 1e-2,
            frame_num: 100,
            opacity_threshold: 0.02,
            rotation_degree: vec![],
            rotation_axis: vec![],
            sim_area: None,
            scale: 1.0,
            particle_filling: None,
        }
    }
}

/// Another stiffness and density in the open box `point` +- `size`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialBox {
    pub point: [f32; 3],
    pub size: [f32; 3],
    #[serde(rename = "E")]
    pub youngs_modulus: f32,
    #[serde(rename = "nu")]
    pub poisson_ratio: f32,
    /// The configuration's if not given.
    pub density: Option<f32>,
}

/// How the inside is filled: see [`super::filling`].
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Filling {
    /// Four times the solver's if not given.
    pub n_grid: Option<usize>,
    pub density_threshold: f32,
    pub search_threshold: f32,
    pub max_particles_num: usize,
    /// The peer's spelling.
    pub max_partciels_per_cell: i32,
    pub search_exclude_direction: i32,
    pub ray_cast_direction: i32,
    /// Lowest and highest x, then y, then z of the filled region, in the box.
    pub boundary: Option<[f32; 6]>,
    pub smooth: bool,
    /// If true, the new particles are drawn as Gaussians too.
    pub visualize: bool,
}

impl Default for Filling {
    fn default() -> Self {
        Self {
            n_grid: None,
            density_threshold: 5.0,
            search_threshold: 3.0,
            max_particles_num: 2_000_000,
            max_partciels_per_cell: 1,
            search_exclude_direction: 5,
            ray_cast_direction: 4,
            boundary: None,
            smooth: false,
            visualize: false,
        }
    }
}

/// A boundary condition. Sizes are half extents.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case", deny_unknown_fields)]
pub enum Boundary {
    BoundingBox {},
    Cuboid {
        point: [f32; 3],
        size: [f32; 3],
        velocity: [f32; 3],
        #[serde(default)]
        start_time: f64,
        #[serde(default = "forever")]
        end_time: f64,
        #[serde(default)]
        reset: i32,
    },
    SurfaceCollider {
        point: [f32; 3],
        normal: [f32; 3],
        surface: Surface,
        friction: f32,
        start_time: f64,
        end_time: f64,
    },
    ParticleImpulse {
        force: [f32; 3],
        #[serde(default = "one")]
        num_dt: u32,
        #[serde(default)]
        start_time: f64,
        #[serde(default = "ones")]
        point: [f32; 3],
        #[serde(default = "ones")]
        size: [f32; 3],
    },
    EnforceParticleTranslation {
        point: [f32; 3],
        size: [f32; 3],
        velocity: [f32; 3],
        start_time: f64,
        end_time: f64,
    },
    EnforceParticleVelocityRotation {
        point: [f32; 3],
        normal: [f32; 3],
        half_height_and_radius: [f32; 2],
        rotation_scale: f32,
        translation_scale: f32,
        start_time: f64,
        end_time: f64,
    },
    ReleaseParticlesSequentially {
        normal: [f32; 3],
        start_position: f64,
        end_position: f64,
        /// The peer uses 50, whatever this value is.
        #[serde(rename = "num_layers")]
        _num_layers: u32,
        start_time: f64,
        end_time: f64,
    },
}

/// The kind of a surface collider.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    Sticky,
    Slip,
    Cut,
    Separate,
}

fn forever() -> f64 {
    1e3
}

fn one() -> u32 {
    1
}

fn ones() -> [f32; 3] {
    [1.0; 3]
}

impl Config {
    /// Reads a configuration file.
    ///
    /// # Errors
    /// [`SimulateError::Configuration`] for invalid JSON, a key that the peer does not know, or an invalid value.
    pub fn from_json(text: &str) -> Result<Self, SimulateError> {
        let bad = |error: serde_json::Error| SimulateError::Configuration(error.to_string());
        Self::from_map(json::read(text.as_bytes()).map_err(bad)?)
    }

    /// A configuration from its keys.
    ///
    /// # Errors
    /// As [`Config::from_json`].
    pub fn from_map(mut keys: Map<String, Value>) -> Result<Self, SimulateError> {
        keys.retain(|key, _| !WITHOUT_EFFECT.contains(&key.as_str()));
        let config: Self = serde_json::from_value(Value::Object(keys))
            .map_err(|error| SimulateError::Configuration(error.to_string()))?;
        match config.fault() {
            Some(fault) => Err(SimulateError::Configuration(fault)),
            None => Ok(config),
        }
    }

    /// Substeps per frame: the peer truncates the quotient, so a frame can be one substep short.
    pub fn substeps_per_frame(&self) -> usize {
        (self.frame_dt / self.substep_dt) as usize
    }

    /// The first invalid value.
    fn fault(&self) -> Option<String> {
        let nu = |nu: f32| (0.0..0.5).contains(&nu);
        let positive = |v: f64| v.is_finite() && v > 0.0;
        if !nu(self.poisson_ratio) || self.additional_material_params.iter().any(|b| !nu(b.poisson_ratio)) {
            return Some("`nu` must be at least 0 and less than 0.5, at which a material is incompressible".to_owned());
        }
        let moduli = self.additional_material_params.iter().map(|b| b.youngs_modulus);
        if moduli.chain([self.youngs_modulus]).any(|e| !positive(e.into())) {
            return Some("`E` must be positive".to_owned());
        }
        let densities = self.additional_material_params.iter().filter_map(|b| b.density);
        if densities.chain([self.density]).any(|d| !positive(d.into())) {
            return Some("`density` must be positive".to_owned());
        }
        if !(8..=MOST_CELLS).contains(&self.n_grid) {
            return Some(format!("`n_grid` must be from 8 to {MOST_CELLS}"));
        }
        let times = [("substep_dt", self.substep_dt), ("frame_dt", self.frame_dt)];
        for (key, value) in times.into_iter().chain([("grid_lim", self.grid_lim), ("scale", self.scale)]) {
            if !positive(value) {
                return Some(format!("`{key}` must be positive"));
            }
        }
        if self.substeps_per_frame() == 0 {
            return Some("`substep_dt` must not be longer than `frame_dt`".to_owned());
        }
        if self.rotation_degree.len() != self.rotation_axis.len() || self.rotation_axis.iter().any(|&a| a > 2) {
            return Some("`rotation_axis` must hold 0, 1 or 2 for each of `rotation_degree`".to_owned());
        }
        let filling_cells = self.particle_filling.as_ref().and_then(|f| f.n_grid).unwrap_or(4 * self.n_grid);
        if self.particle_filling.is_some() && !(1..=4 * MOST_CELLS).contains(&filling_cells) {
            return Some(format!("`particle_filling.n_grid` must be from 1 to {}", 4 * MOST_CELLS));
        }
        self.boundary_conditions.iter().find_map(Boundary::fault)
    }
}

impl Boundary {
    fn fault(&self) -> Option<String> {
        match self {
            Self::SurfaceCollider { surface: Surface::Sticky, friction, .. } if *friction != 0.0 => {
                Some("`friction` of a sticky surface must be 0".to_owned())
            }
            Self::SurfaceCollider { normal, .. }
            | Self::EnforceParticleVelocityRotation { normal, .. }
            | Self::ReleaseParticlesSequentially { normal, .. }
                if normal.iter().all(|n| *n == 0.0) =>
            {
                Some("a `normal` must not be zero".to_owned())
            }
            _ => None,
        }
    }
}
