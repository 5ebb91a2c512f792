//! Grasp forces on disk; `null` where the metric scale is unknown, for newtons need kilograms.

use anyhow::Result;

use crate::grasp::gripper::GripperProfile;
use crate::grasp::{self, GraspReport};
use crate::parts::PartsError;
use crate::workdir::Artifact;

use super::{Done, Pipeline, Stage};

impl Pipeline {
    pub(super) fn grasp_key(&self) -> String {
        self.key_after(Stage::Grasp, &[Stage::Vote, Stage::Parts]).with_json(&self.options.grasp).hex()
    }

    pub(super) fn do_grasp(&self) -> Result<Done> {
        let gripper = GripperProfile::load(&self.options.grasp.gripper)?;
        let Some(parts) = self.metric_parts()? else {
            self.work.write_json(Artifact::Grasp, &None::<GraspReport>)?;
            return Ok(Done::writing([Artifact::Grasp]).warning(vec![PartsError::ScaleUnknown.to_string()]));
        };
        let report = grasp::grasp(&parts, &self.field()?.labels, &gripper, &self.options.grasp)?;
        self.work.write_json(Artifact::Grasp, &report)?;
        Ok(Done::writing([Artifact::Grasp]).warning(report.warnings))
    }

    /// The forces.
    pub(super) fn grasp(&self) -> Result<Option<GraspReport>> {
        Ok(self.work.read_json(Artifact::Grasp)?)
    }
}
