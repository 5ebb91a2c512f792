//! Parts on disk: in metres and kilograms where the scale is known, else in scene units without masses.

use anyhow::Result;
use serde::Serialize;

use crate::parts::{self, Parts, PartsResult, Shape};
use crate::workdir::Artifact;

use super::{Done, Pipeline, Stage, get_or_load};

/// The content of `parts.json` if the metric scale is unknown.
#[derive(Serialize)]
struct UnscaledFile<'a> {
    /// What is missing and how to give it.
    scale: String,
    object: Option<()>,
    parts: [(); 0],
    /// In scene units.
    shapes: &'a [Shape],
}

impl Pipeline {
    pub(super) fn parts_key(&self) -> String {
        self.key_after_inputs(Stage::Parts).with_json(&self.options.parts).hex()
    }

    pub(super) fn do_parts(&self) -> Result<Done> {
        let result = self.parts()?;
        let mut warnings = result.warnings.clone();
        match result.metric() {
            Ok(parts) => self.work.write_json(Artifact::Parts, parts)?,
            Err(error) => {
                let file = UnscaledFile { scale: error.to_string(), object: None, parts: [], shapes: &result.shapes };
                self.work.write_json(Artifact::Parts, &file)?;
                warnings.push(error.to_string());
            }
        }
        Ok(Done::writing([Artifact::Parts]).warning(warnings))
    }

    /// The parts and the object's inside: computed anew where an earlier run wrote `parts.json` but a later stage needs
    /// the inside too.
    pub(super) fn parts(&self) -> Result<&PartsResult> {
        get_or_load(&self.parts, || {
            let cameras = self.scene.cameras();
            let (gaussians, scale) = (&self.scene.gaussians, self.scene.scale.as_ref());
            Ok(parts::parts(gaussians, self.field()?, &cameras, scale, &self.options.parts, self.progress)?)
        })
    }

    /// The parts in metres and kilograms; `None` where the scale is unknown.
    pub(super) fn metric_parts(&self) -> Result<Option<Parts>> {
        if self.scene.scale.is_none() {
            return Ok(None);
        }
        Ok(Some(self.work.read_json(Artifact::Parts)?))
    }
}
