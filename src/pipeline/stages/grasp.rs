//! Grasps on disk; `null` if none was found for a report: for example because the metric scale is unknown, and forces in
//! newtons need masses in kilograms.

use std::sync::Arc;

use nalgebra::Vector3;

use crate::camera::Camera;
use crate::error::Result;
use crate::gaussians::Gaussians;
use crate::grasp::candidates::REPORTED;
use crate::grasp::surface::Surface;
use crate::grasp::{self, GraspError, GraspReport};
use crate::parts::{Parts, PartsError, without_floaters};
use crate::pictures::png;
use crate::vote::MaterialField;
use crate::words::output::counted;
use crate::workdir::{Artifact, WorkDir};

use super::parts::{self, metric_parts};
use super::{Done, Job, OpenScene, Row, Stage, Stored};

/// Describes the data of a place to grasp at. Changing this text makes the stage run again.
const CONTENTS: &[u8] = b"places with poses and materials";

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Vote, Stage::Parts],
    options: &["grasp"],
    result: Artifact::Grasp,
    key: |open, inputs| {
        // The profile counts, not the path of its file.
        let options = grasp::Options { gripper: String::new(), ..open.options.grasp.clone() };
        Ok(inputs.with(CONTENTS).with_json(&options).with_json(&open.gripper).hex())
    },
    // The user asks for a grasp, and an earlier run that did not need one found no place.
    is_stale: |open, job| is_asked_for(open, job) && found_no_place(open),
    run,
};

fn is_asked_for(open: &OpenScene, job: &Job) -> bool {
    job.is_last || open.options.grasp.names_a_place()
}

/// True if the stage was done without finding a place.
pub fn found_no_place(open: &OpenScene) -> bool {
    let is_missing = |report: &Grasped| report.0.as_ref().is_none_or(|report| report.candidates.is_empty());
    Grasped::load(open).is_ok_and(|report| is_missing(&report))
}

/// If the user asks for a grasp, a grasp that cannot be computed is an error; if it is only needed for a report, it is a
/// warning, unless an option or a file is wrong.
fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let is_asked_for = is_asked_for(open, job);
    let (Some(parts), Some(scale)) = (metric_parts(open)?, parts::scale(open)?) else {
        let error = PartsError::ScaleUnknown;
        return if is_asked_for { Err(error.into()) } else { without_grasp(&open.work, error.to_string()) };
    };
    let mut options = open.options.grasp.clone();
    options.auto |= is_asked_for && !options.names_a_place();
    let cameras = open.scene.cameras();
    let found = grasp(open, &parts, &cameras, scale.meters_per_unit, &options);
    let report = match found? {
        Err(error) if !is_asked_for && error.is_of_the_object() => return without_grasp(&open.work, error.to_string()),
        found => found?,
    };
    let side = open.gripper.finger_side_m();
    let picture = grasp::picture::picture(&open.scene.gaussians, &cameras, &report, side, scale.meters_per_unit);
    let mut outputs = vec![Artifact::Grasp];
    match picture {
        Some(picture) => {
            open.work.write(Artifact::GraspPicture, &png(&picture)?)?;
            outputs.push(Artifact::GraspPicture);
        }
        None => open.work.remove(Artifact::GraspPicture)?,
    }
    open.work.write_json(Artifact::Grasp, &report)?;
    Ok(Done::writing(outputs).warning(report.warnings).noting(report.notes))
}

/// The forces on the object and the places to grasp it at.
fn grasp(
    open: &OpenScene,
    parts: &Parts,
    cameras: &[Camera],
    meters_per_unit: f64,
    options: &grasp::Options,
) -> Result<Result<GraspReport, GraspError>> {
    let (gaussians, field) = (&open.scene.gaussians, open.get::<MaterialField>()?);
    let kept = without_floaters(gaussians, open.options.parts.min_body_share);
    let object = Gaussians { set_aside: kept.iter().map(|kept| !kept).collect(), ..gaussians.clone() };
    let surface = Surface::of(&object, &field.part_index, cameras, meters_per_unit);
    let in_world = grasp::Options { point: options.point.map(|point| in_world(open, point)), ..options.clone() };
    let found = grasp::grasp(parts, &field.parts, Some(&surface), meters_per_unit, &open.gripper, &in_world);
    // The error shows the point as the user typed it.
    Ok(found.map_err(|error| match (error, options.point) {
        (GraspError::PointTooFar { distance_mm, finger_mm, .. }, Some(point)) => {
            GraspError::PointTooFar { point, distance_mm, finger_mm }
        }
        (error, _) => error,
    }))
}

/// A point of the input's frame in the world's, in scene units.
fn in_world(open: &OpenScene, point: [f64; 3]) -> [f64; 3] {
    (open.scene.up.world_from_input() * Vector3::from(point)).into()
}

/// Writes that there is no grasp, with the reason as a warning.
fn without_grasp(work: &WorkDir, why: String) -> Result<Done> {
    work.write_json(Artifact::Grasp, &None::<GraspReport>)?;
    work.remove(Artifact::GraspPicture)?;
    Ok(Done::writing([Artifact::Grasp]).warning(vec![why]))
}

/// The stored forces.
pub struct Grasped(pub Option<Arc<GraspReport>>);

impl Stored for Grasped {
    const STAGE: Stage = Stage::Grasp;

    fn load(open: &OpenScene) -> Result<Self> {
        let report: Option<GraspReport> = open.work.read_json(Artifact::Grasp)?;
        let places = report.as_ref().map_or(0, |report| report.candidates.len());
        if places > REPORTED {
            let problem = format!("it has {} to grasp at, more than {REPORTED}", counted(places, "place"));
            return Err(open.work.damaged(Artifact::Grasp, problem).into());
        }
        Ok(Self(report.map(Arc::new)))
    }
}

/// The picture of the best places to grasp at, as PNG; `None` if there is no place.
pub(super) fn picture(work: &WorkDir) -> Result<Option<Vec<u8>>> {
    let drawn = work.size(Artifact::GraspPicture).is_some();
    Ok(if drawn { Some(work.read(Artifact::GraspPicture)?) } else { None })
}
