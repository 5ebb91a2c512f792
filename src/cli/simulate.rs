//! `gprop simulate`: runs the stage, or another program's solver.

use std::path::{Path, PathBuf};

use crate::error::{Result, UsageError};
use crate::pipeline::{Stage, compat};
use crate::simulate::script::{KNOWN, Known};
use crate::workdir::{self, Artifact, WorkDirError};

use super::{Compat, Global, SimulateArgs, print, scene, shown};

pub fn run(global: &Global, args: &SimulateArgs) -> Result<()> {
    let Some(folder) = args.scene.as_ref().filter(|_| !args.list) else {
        return list(global);
    };
    let (report, out) = match (args.compat, &args.config) {
        (Some(Compat::PhysGaussian), config) if args.field => {
            if folder.is_file() {
                let problem = format!("--field takes the materials of a scene: give its folder instead of {folder:?}");
                return Err(UsageError(problem).into());
            }
            if args.work.dry_run {
                return scene::run(global, folder, &args.work, Stage::Vote);
            }
            let mut pipeline = scene::open(global, folder, &args.work, Stage::Vote, true)?;
            pipeline.run()?;
            compat::run_on_field(pipeline.opened(), config.as_deref())?
        }
        (Some(Compat::PhysGaussian), Some(_)) if args.work.dry_run => {
            let problem =
                "--dry-run: without --field, --compat physgaussian has no stages to list; leave --dry-run out";
            return Err(UsageError(problem.to_owned()).into());
        }
        (Some(Compat::PhysGaussian), Some(_)) if args.work.from.is_some() => {
            let problem = "--from: without --field, --compat physgaussian has no stages to redo; leave --from out";
            return Err(UsageError(problem.to_owned()).into());
        }
        (Some(Compat::PhysGaussian), Some(config)) => {
            let out = work_folder(folder, args.work.out.as_deref())?;
            compat::run(folder, &args.work.options.scene, config, &out, global.progress())?
        }
        _ => return scene::run(global, folder, &args.work, Stage::Simulate),
    };
    print(global, &report, || shown(&out.join(Artifact::Simulation.path())))
}

/// The work folder of a scene's folder or of a PLY. By default, that of a PLY is in a folder named like the file.
fn work_folder(scene: &Path, out: Option<&Path>) -> Result<PathBuf, WorkDirError> {
    let beside = if scene.is_file() { scene.with_extension("") } else { scene.to_owned() };
    workdir::named_or(out, beside.join(workdir::DEFAULT_NAME))
}

/// The scenarios with their parameters.
fn list(global: &Global) -> Result<()> {
    let parameters = |k: &Known| -> serde_json::Map<String, serde_json::Value> {
        k.parameters.iter().map(|(key, value, _)| ((*key).to_owned(), (*value).into())).collect()
    };
    let value: Vec<_> = KNOWN
        .iter()
        .map(|k| serde_json::json!({ "name": k.name, "what": k.what, "parameters": parameters(k) }))
        .collect();
    print(global, &value, || {
        let mut text = String::new();
        for k in &KNOWN {
            text += &format!("{:<8} {}\n", k.name, k.what);
            for (key, value, what) in k.parameters {
                text += &format!("           --set {key}={value}   {what}\n");
            }
        }
        text
    })
}
