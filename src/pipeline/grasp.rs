//! Grasp forces on disk; `null` where the metric scale is unknown, for newtons need kilograms.

use anyhow::Result;

use crate::grasp::{self, GraspReport};
use crate::workdir::Artifact;

use super::{Done, Pipeline, Stage};

impl Pipeline {
    pub(super) fn grasp_key(&self) -> String {
        self.key_after(Stage::Grasp, &[Stage::Vote, Stage::Parts]).with_json(&self.options.grasp).hex()
    }

    pub(super) fn do_grasp(&self, _key: &str) -> Result<Done> {
        let gripper = grasp::gripper::GripperProfile::named_or_file(&self.options.grasp.gripper)?;
        let report = grasp::grasp(self.parts()?, &self.field()?.labels, &gripper, &self.options.grasp)?;
        self.work.write_json(Artifact::Grasp, &report)?;
        Ok(Done::writing([Artifact::Grasp]).warning(report.warnings))
    }

    /// The forces.
    pub(super) fn grasp(&self) -> Result<Option<GraspReport>> {
        Ok(self.work.read_json(Artifact::Grasp)?)
    }
}
