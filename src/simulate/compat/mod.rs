//! `--compat physgaussian`: reproduces runs of the public PhysGaussian solver, here called the peer (Xie et al.,
//! *PhysGaussian: Physics-Integrated 3D Gaussians for Generative Dynamics*, 2024; its solver `mpm_solver_warp`).
//!
//! This is a simple solver, separate from the fast one in [`crate::mpm`]: it does exactly what the peer does, including
//! its defects, in the peer's order and precision. The phases:
//! 1. [`config`]: the peer's JSON file, all of its keys;
//!    or [`estimated`]: the materials that gprop found, Gaussian by Gaussian;
//! 2. `setup`: Gaussians selected, turned and scaled into the peer's box; [`filling`], volumes;
//! 3. [`solver`]: substeps on a dense grid with the [`law`]s and [`condition`]s of the peer;
//! 4. [`run()`]: frames of Gaussians.

pub mod condition;
pub mod config;
mod eigen;
pub mod estimated;
pub mod filling;
pub mod law;
pub mod particle;
mod run;
mod setup;
mod smoothing;
pub mod solver;
mod svd;

use nalgebra::Vector3;

use config::Config;
use law::Strength;
pub use run::{CompatFrame, CompatReport, run};

/// Strength and density at `position` in the box: those of the last material box that contains it, else the
/// configuration's.
pub fn strength_at(config: &Config, position: &Vector3<f32>) -> (Strength, f32) {
    let (mut e, mut nu, mut density) = (config.youngs_modulus, config.poisson_ratio, config.density);
    for other in &config.additional_material_params {
        let within =
            |a: usize| position[a] > other.point[a] - other.size[a] && position[a] < other.point[a] + other.size[a];
        if (0..3).all(within) {
            (e, nu, density) = (other.youngs_modulus, other.poisson_ratio, other.density.unwrap_or(config.density));
        }
    }
    (Strength::new(e, nu, config.yield_stress), density)
}
