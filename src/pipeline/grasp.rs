//! Grasps on disk; `null` if none was found for a report: for example because the metric scale is unknown, and forces in
//! newtons need masses in kilograms.

use anyhow::Result;

use crate::gaussians::Gaussians;
use crate::grasp::surface::Surface;
use crate::grasp::{self, GraspReport};
use crate::parts::{PartsError, without_floaters};
use crate::workdir::Artifact;

use super::{Done, Pipeline, Stage, png};

/// Describes the data of a place to grasp at. Changing this text makes the stage run again.
const CONTENTS: &[u8] = b"places with poses and materials";

impl Pipeline {
    pub(super) fn grasp_key(&self) -> String {
        // The profile counts, not the path of its file.
        let options = grasp::Options { gripper: String::new(), ..self.options.grasp.clone() };
        self.key_after_inputs(Stage::Grasp).with(CONTENTS).with_json(&options).with_json(&self.gripper).hex()
    }

    fn asks_for_a_place(&self) -> bool {
        self.plan.to == Stage::Grasp || self.options.grasp.names_a_place()
    }

    /// True if the user asks for a grasp, and an earlier run that did not need one found no place.
    pub(super) fn lacks_a_place(&self) -> bool {
        self.asks_for_a_place() && self.found_no_place()
    }

    /// True if the stage was done without finding a place.
    pub(super) fn found_no_place(&self) -> bool {
        let is_missing = |report: Option<GraspReport>| report.is_none_or(|report| report.candidates.is_empty());
        self.stored_grasp().is_ok_and(is_missing)
    }

    /// If the user asks for a grasp, a grasp that cannot be computed is an error; if it is only needed for a report, it
    /// is a warning, unless an option or a file is wrong.
    pub(super) fn do_grasp(&self) -> Result<Done> {
        let asked = self.asks_for_a_place();
        let (Some(parts), Some(scale)) = (self.stored_parts()?, self.metric_scale()?) else {
            let error = PartsError::ScaleUnknown;
            return if asked { Err(error.into()) } else { self.no_grasp(error.to_string()) };
        };
        let mut options = self.options.grasp.clone();
        options.auto |= asked && !options.names_a_place();
        let field = self.stored_field()?;
        let cameras = self.scene.cameras();
        let (gaussians, meters_per_unit) = (&self.scene.gaussians, scale.meters_per_unit);
        let kept = without_floaters(gaussians, self.options.parts.min_body_share);
        let object = Gaussians { set_aside: kept.iter().map(|kept| !kept).collect(), ..gaussians.clone() };
        let surface = Surface::of(&object, &field.part_label, &cameras, meters_per_unit);
        let found = grasp::grasp(&parts, &field.labels, Some(&surface), meters_per_unit, &self.gripper, &options);
        let report = match found {
            Err(error) if !asked && error.is_of_the_object() => return self.no_grasp(error.to_string()),
            found => found?,
        };
        let side = self.gripper.finger_side_m();
        let picture = grasp::picture::picture(gaussians, &cameras, &report, side, meters_per_unit);
        let mut outputs = vec![Artifact::Grasp];
        match picture {
            Some(picture) => {
                self.work.write(Artifact::GraspPicture, &png(&picture)?)?;
                outputs.push(Artifact::GraspPicture);
            }
            None => self.work.remove(Artifact::GraspPicture)?,
        }
        self.work.write_json(Artifact::Grasp, &report)?;
        Ok(Done::writing(outputs).warning(report.warnings).noting(report.notes))
    }

    /// Writes that there is no grasp, with the reason as a warning.
    fn no_grasp(&self, why: String) -> Result<Done> {
        self.work.write_json(Artifact::Grasp, &None::<GraspReport>)?;
        self.work.remove(Artifact::GraspPicture)?;
        Ok(Done::writing([Artifact::Grasp]).warning(vec![why]))
    }

    /// The stored forces.
    pub(super) fn stored_grasp(&self) -> Result<Option<GraspReport>> {
        Ok(self.work.read_json(Artifact::Grasp)?)
    }

    /// The picture of the best places to grasp at, as PNG; `None` if there is no place.
    pub(super) fn grasp_picture(&self) -> Result<Option<Vec<u8>>> {
        let drawn = self.work.size(Artifact::GraspPicture).is_some();
        Ok(if drawn { Some(self.work.read(Artifact::GraspPicture)?) } else { None })
    }
}
