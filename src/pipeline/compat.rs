//! Runs the public PhysGaussian solver on a scene: a configuration as it is, without gprop's parts, answers or materials;
//! or with the materials of the scene's field.

use std::path::{Path, PathBuf};

use crate::error::{Context, Result, UsageError};
use crate::files;
use crate::gaussians::Gaussians;
use crate::scene::splat::ply;
use crate::simulate::compat::config::Config;
use crate::simulate::compat::estimated::Estimated;
use crate::simulate::compat::particle::Particle;
use crate::simulate::compat::{self, CompatReport};
use crate::simulate::material::SOFT_PA;
use crate::simulate::states::{self, State};
use crate::words::progress::Progress;
use crate::workdir::{self, Artifact, WorkDir};

use super::stages::OpenScene;
use super::stages::simulate::{NOT_KEPT, remove_frames_from};
use crate::vote::MaterialField;

/// Folder in the work folder for such a run.
const FOLDER: &str = "physgaussian";

/// Runs the configuration in the file `config` on the Gaussians of `scene`, a folder or a PLY, and writes frames,
/// states and `simulation.json` into a folder in the work folder `out`; also returns that folder.
///
/// # Errors
/// If a file cannot be read or the run fails; files that were already written stay.
pub fn run(
    scene: &Path,
    options: &crate::scene::Options,
    config: &Path,
    out: &Path,
    progress: Progress,
) -> Result<(CompatReport, PathBuf)> {
    let config = configuration(config)?;
    carry_out(&gaussians(scene, options)?, &config, None, out, progress)
}

/// Like [`run()`], but upright as the exported cloud, and every Gaussian has the material that the field gives it; without `config`, the configuration is
/// the one that the export writes. The scene must be voted on.
pub fn run_on_field(open: &OpenScene, config: Option<&Path>) -> Result<(CompatReport, PathBuf)> {
    let (field, options) = (open.get::<MaterialField>()?, &open.options.simulate);
    let most_pa = options.max_stiffness.unwrap_or(SOFT_PA);
    let estimated = Estimated::new(&field.part_index, &field.parts, options.soften, most_pa);
    let config = match config {
        Some(path) => configuration(path)?,
        None => Config::from_map(estimated.configuration(estimated.main()))?,
    };
    carry_out(&open.scene.gaussians, &config, Some(&estimated), open.work.root(), open.progress())
}

fn configuration(path: &Path) -> Result<Config> {
    let text = files::read_to_string(path).map_err(|error| UsageError(format!("{path:?}: {error}")))?;
    Config::from_json(&text).with_context(|| format!("{path:?}"))
}

fn carry_out(
    gaussians: &Gaussians,
    config: &Config,
    estimated: Option<&Estimated>,
    out: &Path,
    progress: Progress,
) -> Result<(CompatReport, PathBuf)> {
    let out = out.join(FOLDER);
    workdir::refuse_link(&out, "--out")?;
    let work = WorkDir::open(&out)?;
    // Until this run ends, the report of an earlier one would not fit the frames.
    work.remove(Artifact::Simulation)?;
    let save = |frame: usize, particles: &[Particle], gaussians: &Gaussians| -> Result<()> {
        work.write_with(Artifact::Frame(frame), |out| ply::write(out, gaussians, &[]))?;
        let states: Vec<State> = particles.iter().map(State::from).collect();
        Ok(work.write_with(Artifact::States(frame), |out| states::write(out, &states))?)
    };
    let mut save = |frame: usize, particles: &[Particle], gaussians: &Gaussians| {
        save(frame, particles, gaussians).context(NOT_KEPT)
    };
    let report = compat::run(gaussians, config, estimated, &mut save, progress)?;
    remove_frames_from(&work, report.frames.len())?;
    work.write_json(Artifact::Simulation, &report)?;
    Ok((report, out))
}

fn gaussians(scene: &Path, options: &crate::scene::Options) -> Result<Gaussians> {
    if scene.is_file() {
        return Ok(ply::read(scene)?.gaussians);
    }
    Ok(crate::scene::load(scene, options)?.gaussians_as_read().clone())
}
