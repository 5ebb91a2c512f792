//! The vote on disk: `field.ply` for any splat viewer, `labels.json` and `materials.json` for what its numbers mean.

use anyhow::{Context, Result};

use crate::scene::ply;
use crate::vote::{MaterialField, ViewInput, field_ply, vote};
use crate::workdir::Artifact;

use super::{Done, Pipeline, Stage, get_or_load};

impl Pipeline {
    pub(super) fn vote_key(&self) -> String {
        self.key_after(Stage::Vote, &[Stage::Scene, Stage::Segment, Stage::Query])
            .with_json(&self.library.materials())
            .with_json(&self.options.vote)
            .hex()
    }

    pub(super) fn do_vote(&self) -> Result<Done> {
        let segmentation = self.segmentation()?;
        let views = self.views.iter().zip(&segmentation.views);
        let views: Vec<_> = views
            .map(|(view, segments)| ViewInput { name: &view.name, camera: &view.camera, map: &segments.map })
            .collect();
        let gaussians = &self.scene.gaussians;
        let answers = self.answers()?;
        let field = vote(gaussians, &views, answers, &self.library, &self.options.vote, self.progress)?;

        self.work.write_with(Artifact::Field, |out| ply::write(out, gaussians, &field_ply::columns(&field)))?;
        self.work.write_json(Artifact::Labels, &field.labels)?;
        self.work.write_json(Artifact::Materials, &field_ply::materials(&field.labels, &self.library))?;
        let warnings = field.warnings;
        Ok(Done::writing([Artifact::Field, Artifact::Labels, Artifact::Materials]).warning(warnings))
    }

    /// The part of every Gaussian.
    pub(super) fn field(&self) -> Result<&MaterialField> {
        get_or_load(&self.field, || {
            let path = self.work.path(Artifact::Field);
            let labels = self.work.read_json(Artifact::Labels)?;
            let loaded = ply::read(&path)?;
            field_ply::read(&loaded.gaussians.extra, labels)
                .with_context(|| format!("{path:?} does not hold what gprop wrote; run again with --from vote"))
        })
    }
}
