//! `gprop simulate`: runs the stage, or another program's solver.

use crate::error::UsageError;
use crate::pipeline::{Stage, compat};
use crate::simulate::script::{KNOWN, Known};
use crate::workdir::{Artifact, DEFAULT_NAME};

use super::{Compat, Global, SimulateArgs, print, scene, shown};

pub fn run(global: &Global, args: &SimulateArgs) -> anyhow::Result<()> {
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
            let mut pipeline = scene::open(global, folder, &args.work, (Stage::Vote, true))?;
            pipeline.run()?;
            pipeline.run_compat(config.as_deref())?
        }
        (Some(Compat::PhysGaussian), Some(_)) if args.work.dry_run => {
            let problem =
                "--dry-run: without --field, --compat physgaussian has no stages to list; leave --dry-run out";
            return Err(UsageError(problem.to_owned()).into());
        }
        (Some(Compat::PhysGaussian), Some(config)) => {
            let beside = if folder.is_file() { folder.with_extension("") } else { folder.clone() };
            let out = args.work.out.clone().unwrap_or_else(|| beside.join(DEFAULT_NAME));
            compat::run(folder, &args.work.options.scene, config, &out, global.progress())?
        }
        _ => return scene::run(global, folder, &args.work, Stage::Simulate),
    };
    print(global, &report, || shown(&out.join(Artifact::Simulation.path())))
}

/// The scenarios with their parameters.
fn list(global: &Global) -> anyhow::Result<()> {
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
