//! `gprop evaluate grasp`: rates of recorded outcomes, or of outcomes predicted for the grasps that runs proposed.

use std::path::{Path, PathBuf};

use crate::error::UsageError;
use crate::evaluate::EvaluateError;
use crate::evaluate::grasp::predicted::GraspedObject;
use crate::evaluate::grasp::{self as rates, Evaluation, truth};
use crate::grasp::GraspReport;
use crate::grasp::gripper::GripperProfile;
use crate::pipeline::Stage;
use crate::pipeline::stored::Stored;
use crate::scene;
use crate::workdir::{self, Artifact};

use super::super::{Global, options_of, print};
use super::{check_truth, one_scene_only};

pub fn evaluate(
    global: &Global,
    scenes: &[PathBuf],
    out: Option<&Path>,
    outcomes: Option<&Path>,
    gripper: &str,
) -> anyhow::Result<()> {
    let found = match outcomes {
        Some(path) => Evaluation::of_recorded(&rates::outcomes(path)?),
        None => {
            one_scene_only(scenes.len(), out)?;
            let gripper = GripperProfile::load(gripper)?;
            let objects = scenes.iter().map(|scene| grasped(scene, out, &gripper));
            Evaluation::of_objects(objects.collect::<anyhow::Result<_>>()?)
        }
    };
    print(global, &found, || found.text())
}

/// The grasp that a run proposed, judged by the scene's ground truth.
fn grasped(folder: &Path, out: Option<&Path>, gripper: &GripperProfile) -> anyhow::Result<GraspedObject> {
    let stored = Stored::open(folder, out, &[Stage::Grasp])?;
    let path = stored.path(Artifact::Grasp);
    let report: Option<GraspReport> = workdir::read_json(&path)?;
    let options = stored.options(folder, out.is_some())?;
    let place = report.as_ref().and_then(|report| report.candidates.first());
    let (Some(report), Some(place)) = (&report, place) else { return Err(EvaluateError::NoPlace { path }.into()) };
    if report.gripper != gripper.name {
        let (theirs, ours) = (&report.gripper, &gripper.name);
        return Err(UsageError(format!(
            "{path:?} is for the gripper {theirs:?}, not {ours:?}; give --gripper the gripper of that run"
        ))
        .into());
    }
    let truth = folder.join("ground_truth");
    check_truth(&truth, &options_of(folder, &[])?.scene.read_scope(folder))?;
    let mut scene = scene::load(folder, &options.scene)?;
    if scene.scale.is_none() {
        scene.scale = stored.found_scale()?;
    }
    let library = options.materials.library()?;
    let truth = truth::of(place, &scene, &truth, &library)?;
    Ok(GraspedObject::new(&scene.name, report, truth, gripper))
}
