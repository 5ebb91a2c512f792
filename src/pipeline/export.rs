//! The parts in the formats of other programs.

use std::path::{Path, PathBuf};

use anyhow::Result;
use tracing::warn;

use crate::export::{self, Format, Model};
use crate::grasp::GraspError;
use crate::grasp::candidates::Candidate;

use super::{Pipeline, Stage};

impl Pipeline {
    /// Writes the object into `folder` once the parts are done, and returns the paths of the files.
    pub(crate) fn export(&mut self, formats: &[Format], folder: &Path) -> Result<Vec<PathBuf>> {
        let grasps =
            if formats.iter().any(|format| format.has_grasps()) { self.places_to_grasp()? } else { Vec::new() };
        let parts = self.stored_parts()?;
        let splat = self.scene.files.first().and_then(|path| path.file_name());
        let source = splat.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let cameras = self.scene.cameras();
        let scale = self.metric_scale()?;
        let field = self.weighed_field()?;
        let model = Model {
            name: &self.scene.name,
            gaussians: &self.scene.gaussians,
            field: &field,
            interior: self.interior()?,
            scale: scale.as_ref(),
            parts: parts.as_ref(),
            cameras: &cameras,
            grasps: &grasps,
            source: &source,
            inputs: &self.scene.files,
        };
        Ok(export::export(&model, formats, folder)?)
    }

    /// Where to grasp the object, best first. An object that cannot be grasped can still be exported.
    fn places_to_grasp(&mut self) -> Result<Vec<Candidate>> {
        if self.stored_parts()?.is_none() {
            return Ok(Vec::new());
        }
        let done = self.step(Stage::Grasp).and_then(|()| self.stored_grasp());
        match done {
            Ok(Some(report)) => Ok(report.candidates),
            Ok(None) => {
                warn!("the export names no place to grasp at; `gprop grasp` says why");
                Ok(Vec::new())
            }
            Err(error) if error.is::<GraspError>() || !self.work.is_writable() => {
                warn!("the export names no place to grasp at: {error:#}");
                Ok(Vec::new())
            }
            Err(error) => Err(error),
        }
    }
}
