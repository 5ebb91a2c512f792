//! Runs a configuration of the public PhysGaussian solver on a scene, without gprop's parts, answers or materials.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use crate::error::UsageError;
use crate::progress::Progress;
use crate::scene::gaussians::Gaussians;
use crate::scene::ply;
use crate::simulate::compat::config::Config;
use crate::simulate::compat::particle::Particle;
use crate::simulate::compat::{self, CompatReport};
use crate::simulate::states;
use crate::workdir::{Artifact, WorkDir};

use super::simulate::NOT_KEPT;

/// Runs the configuration in the file `config` on the Gaussians of `scene`, a folder or a PLY, and writes frames,
/// states and `simulation.json` into `out`.
///
/// # Errors
/// If a file cannot be read or the run fails; files that were already written stay.
pub fn run(
    scene: &Path,
    options: &crate::scene::Options,
    config: &Path,
    out: &Path,
    progress: Progress,
) -> Result<CompatReport> {
    let text = fs::read_to_string(config).map_err(|error| UsageError(format!("{config:?}: {error}")))?;
    let config = Config::from_json(&text).with_context(|| format!("{config:?}"))?;
    let gaussians = gaussians(scene, options)?;
    let work = WorkDir::open(out)?;
    let save = |frame: usize, particles: &[Particle], gaussians: &Gaussians| -> Result<()> {
        work.write_with(Artifact::Frame(frame), |out| ply::write(out, gaussians, &[]))?;
        let state = |i: usize| (&particles[i]).into();
        Ok(work.write_with(Artifact::States(frame), |out| states::write(out, particles.len(), state))?)
    };
    let mut save = |frame: usize, particles: &[Particle], gaussians: &Gaussians| {
        save(frame, particles, gaussians).context(NOT_KEPT)
    };
    let report = compat::run(&gaussians, &config, &mut save, progress)?;
    work.write_json(Artifact::Simulation, &report)?;
    Ok(report)
}

fn gaussians(scene: &Path, options: &crate::scene::Options) -> Result<Gaussians> {
    if scene.is_file() {
        return Ok(ply::read(scene)?.gaussians);
    }
    Ok(crate::scene::load(scene, options)?.gaussians)
}
