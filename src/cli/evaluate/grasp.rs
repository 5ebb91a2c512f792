//! `gprop evaluate grasp`: rates of recorded outcomes, or of outcomes predicted for the grasps that runs proposed.

use std::path::{Path, PathBuf};

use crate::error::{Result, UsageError};
use crate::evaluate::EvaluateError;
use crate::evaluate::grasp::predicted::GraspedObject;
use crate::evaluate::grasp::{self as rates, Evaluation, truth};
use crate::grasp::GraspReport;
use crate::grasp::gripper::GripperProfile;
use crate::pipeline::Stage;
use crate::pipeline::stored::StoredRun;
use crate::scene::{self, SceneError};
use crate::workdir::{self, Artifact};

use super::super::{Global, print};
use super::{check_truth, one_scene_only};

/// Rates of recorded outcomes.
pub fn evaluate_recorded(global: &Global, outcomes: &Path) -> Result<()> {
    let found = Evaluation::of_recorded(&rates::outcomes(outcomes)?);
    print(global, &found, || found.text())
}

/// Rates of outcomes predicted for the grasps that runs proposed.
pub fn evaluate(
    global: &Global,
    scenes: &[PathBuf],
    out: Option<&Path>,
    allow_read: &[PathBuf],
    gripper: &str,
) -> Result<()> {
    one_scene_only(scenes.len(), out)?;
    let gripper = GripperProfile::load(gripper)?;
    let objects = scenes.iter().map(|scene| grasped(scene, out, allow_read, &gripper));
    let found = Evaluation::of_objects(objects.collect::<Result<_>>()?);
    print(global, &found, || found.text())
}

/// The grasp that a run proposed, judged by the scene's ground truth.
fn grasped(
    folder: &Path,
    out: Option<&Path>,
    allow_read: &[PathBuf],
    gripper: &GripperProfile,
) -> Result<GraspedObject> {
    let stored = StoredRun::open(folder, out, &[Stage::Grasp])?;
    let path = stored.path(Artifact::Grasp);
    let report: Option<GraspReport> = workdir::read_json(&path)?;
    let options = stored.options(folder, out.is_some(), allow_read)?;
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
    check_truth(&truth, &options.scene.read_scope(folder))?;
    let mut scene = scene::load(folder, &options.scene).map_err(SceneError::without_flag)?;
    if scene.scale.is_none() {
        scene.scale = stored.found_scale()?;
    }
    let library = options.materials.library()?;
    let truth = truth::of(place, &scene, &truth, &library)?;
    Ok(GraspedObject::new(&scene.name, report, truth, gripper))
}
