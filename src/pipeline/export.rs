//! The parts in the formats of other programs.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::export::{self, Format, Model};

use super::Pipeline;

impl Pipeline {
    /// Writes the object into `folder` once the parts are done, and returns the paths of the files.
    pub(crate) fn export(&self, format: Format, folder: &Path) -> Result<Vec<PathBuf>> {
        let (parts, scale) = (self.stored_parts()?, self.metric_scale()?);
        let model = Model {
            name: &self.scene.name,
            gaussians: &self.scene.gaussians,
            field: self.stored_field()?,
            interior: self.interior()?,
            scale: scale.as_ref(),
            parts: parts.as_ref(),
        };
        Ok(export::export(&model, format, folder)?)
    }
}
