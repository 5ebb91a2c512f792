//! The vote on disk: `field.ply` for any splat viewer, and `labels.json` and `materials.json`, which explain its
//! numbers.

use std::path::Path;

use anyhow::Result;
use image::RgbImage;

use crate::error::UsageError;
use crate::pictures::figure::{self, Shown};
use crate::pictures::{field_colors, thumbnail};
use crate::query::Answers;
use crate::scene::gaussians::Gaussians;
use crate::scene::{View, ply};
use crate::vote::{MaterialField, ViewInput, field_ply, vote};
use crate::workdir::{self, Artifact, WorkDirError};

use super::{Done, Pipeline, Stage, get_or_load, png};

impl Pipeline {
    pub(super) fn vote_key(&self) -> String {
        self.key_after_inputs(Stage::Vote).with_json(&self.library.materials()).with_json(&self.options.vote).hex()
    }

    pub(super) fn do_vote(&self) -> Result<Done> {
        let gaussians = &self.scene.gaussians;
        let field = self.vote(&self.voters()?, self.stored_answers()?)?;
        self.work.write_with(Artifact::Field, |out| ply::write(out, gaussians, &field_ply::columns(&field)))?;
        self.work.write_json(Artifact::Labels, &field.labels)?;
        self.work.write_json(Artifact::Materials, &field_ply::materials(&field.labels, &self.library))?;
        let recolored = field_colors::recolored(gaussians, &field_colors::material_colors(&field));
        self.work.write_with(Artifact::Recolored, |out| ply::write(out, &recolored, &[]))?;
        let mut written = vec![Artifact::Field, Artifact::Labels, Artifact::Materials, Artifact::Recolored];
        if let Some(view) = self.views.first() {
            self.work.write(Artifact::Figure, &png(&self.draw(Shown::Figure, view, &field)?)?)?;
            let small = thumbnail::draw(&view.camera, &view.photo()?, gaussians, &field)?;
            self.work.write(Artifact::Thumbnail, &small)?;
            written.extend([Artifact::Figure, Artifact::Thumbnail]);
        }
        Ok(Done::writing(written).warning(field.warnings))
    }

    /// The field as seen by a view of the scene, even one that did not vote, as PNG; by default the first chosen view.
    /// The scene must be voted on.
    pub(crate) fn show(&self, shown: Shown, view: Option<&str>) -> Result<Vec<u8>> {
        let chosen = match view {
            None => self.views.first(),
            Some(name) => self.scene.views.iter().find(|view| view.name == name),
        };
        let chosen = chosen.ok_or_else(|| {
            let known: Vec<&str> = self.scene.views.iter().map(|view| view.name.as_str()).collect();
            UsageError(format!("the scene has no view {:?}; it has {}", view.unwrap_or_default(), known.join(", ")))
        })?;
        png(&self.draw(shown, chosen, self.stored_field()?)?)
    }

    fn draw(&self, shown: Shown, view: &View, field: &MaterialField) -> Result<RgbImage> {
        let place = self.views.iter().position(|chosen| chosen.name == view.name);
        let map = place.map(|place| Ok::<_, anyhow::Error>(&self.segmentation()?.views[place].map)).transpose()?;
        Ok(figure::draw(shown, &view.camera, &view.photo()?, map, &self.scene.gaussians, field))
    }

    /// The chosen views with their segments.
    pub(super) fn voters(&self) -> Result<Vec<ViewInput<'_>>> {
        let views = self.views.iter().zip(&self.segmentation()?.views);
        Ok(views
            .map(|(view, segments)| ViewInput { name: &view.name, camera: &view.camera, map: &segments.map })
            .collect())
    }

    /// The field that results from these views and answers.
    pub(super) fn vote(&self, views: &[ViewInput], answers: &Answers) -> Result<MaterialField> {
        Ok(vote(&self.scene.gaussians, views, answers, &self.library, &self.options.vote, self.progress)?)
    }

    /// The stored material field.
    pub(super) fn stored_field(&self) -> Result<&MaterialField> {
        get_or_load(&self.field, || Ok(stored_field(self.work.root())?.1))
    }
}

/// The Gaussians and their material field in the work folder `root`, as the vote stage wrote them.
///
/// # Errors
/// If there is no field, or gprop did not write it.
pub fn stored_field(root: &Path) -> Result<(Gaussians, MaterialField)> {
    let path = root.join(Artifact::Field.path());
    let labels = workdir::read_json(&root.join(Artifact::Labels.path()))?;
    let gaussians = ply::read(&path)?.gaussians;
    let field = field_ply::read(&gaussians.extra, labels)
        .ok_or_else(|| WorkDirError::Damaged { path, problem: "it lacks the field's columns or labels".to_owned() })?;
    Ok((gaussians, field))
}
