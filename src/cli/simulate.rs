//! `gprop simulate`: the stage, or a foreign configuration.

use crate::pipeline::{Stage, compat};
use crate::workdir::{Artifact, DEFAULT_NAME};

use super::{Compat, Global, SimulateArgs, print, scene};

/// Where a foreign configuration's run lies in the work folder.
const COMPAT_FOLDER: &str = "physgaussian";

pub fn run(global: &Global, args: &SimulateArgs) -> anyhow::Result<()> {
    let (Some(Compat::PhysGaussian), Some(config)) = (args.compat, &args.config) else {
        return scene::run(global, &args.scene, Stage::Simulate);
    };
    let folder = &args.scene.scene;
    let beside = if folder.is_file() { folder.with_extension("") } else { folder.clone() };
    let out = args.scene.out.clone().unwrap_or_else(|| beside.join(DEFAULT_NAME)).join(COMPAT_FOLDER);
    let report = compat::run(folder, config, &out, global.progress())?;
    print(global, &report, || out.join(Artifact::Simulation.path()).display().to_string())
}
