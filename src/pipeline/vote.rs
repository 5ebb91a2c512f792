//! The vote on disk: `field.ply` for any splat viewer, and `labels.json` and `materials.json`, which explain its
//! numbers.

use std::borrow::Cow;
use std::path::Path;

use anyhow::Result;
use image::RgbImage;

use crate::from_splat::photo_with_foreground;
use crate::gaussians::Gaussians;
use crate::pictures::figure::{self, Object, Shown};
use crate::pictures::{field_colors, framing, thumbnail};
use crate::query::Answers;
use crate::scene::View;
use crate::scene::splat::ply;
use crate::segment::LabelMap;
use crate::vote::{FieldLabel, MaterialField, ViewInput, field_ply, vote, vote_on_parts};
use crate::words::output::counted;
use crate::workdir::{self, Artifact, WorkDirError};

use super::{Done, Pipeline, Stage, get_or_load, png};

impl Pipeline {
    pub(super) fn vote_key(&self) -> String {
        self.key_after_inputs(Stage::Vote)
            .with_json(&self.library.materials())
            .with_json(&self.library.fillings())
            .with_json(&self.options.vote)
            .hex()
    }

    pub(super) fn do_vote(&self) -> Result<Done> {
        let gaussians = &self.scene.gaussians;
        let answers = self.stored_answers()?;
        let field = self.vote(&voters(&self.views, &self.settled_maps(answers)?), answers)?;
        self.work.write_with(Artifact::Field, |out| ply::write(out, gaussians, &field_ply::columns(&field)))?;
        self.work.write_json(Artifact::Labels, &field.labels)?;
        self.work.write_json(Artifact::Materials, &field_ply::materials(&field.labels, &self.library))?;
        let recolored = field_colors::recolored(gaussians, &field_colors::material_colors(&field));
        self.work.write_with(Artifact::Recolored, |out| ply::write(out, &recolored, &[]))?;
        let mut written = vec![Artifact::Field, Artifact::Labels, Artifact::Materials, Artifact::Recolored];
        if let Some(view) = self.showing_view(&field) {
            self.work.write(Artifact::Figure, &png(&self.draw(Shown::Figure, view, &field)?)?)?;
            let small = thumbnail::draw(&view.camera, &photo_with_foreground(&self.scene, view)?, gaussians, &field)?;
            self.work.write(Artifact::Thumbnail, &small)?;
            written.extend([Artifact::Figure, Artifact::Thumbnail]);
        }
        Ok(Done::writing(written).warning(field.warnings).noting(field.notes))
    }

    pub(super) fn draw(&self, shown: Shown, view: &View, field: &MaterialField) -> Result<RgbImage> {
        let photo = photo_with_foreground(&self.scene, view)?;
        Ok(figure::draw(shown, &view.camera, &photo, self.object(field)))
    }

    pub(super) fn object<'a>(&'a self, field: &'a MaterialField) -> Object<'a> {
        let meters_per_unit = self.scene.scale.as_ref().map(|scale| scale.meters_per_unit);
        Object { gaussians: &self.scene.gaussians, field, meters_per_unit }
    }

    /// The chosen view that shows most of the object.
    pub(super) fn showing_view(&self, field: &MaterialField) -> Option<&View> {
        let cameras = self.views.iter().map(|view| &view.camera);
        let index = self.showing.get_or_init(|| framing::shows_most(cameras, &self.scene.gaussians, &field.part_label));
        index.map(|index| &self.views[index])
    }

    /// The field that results from these views and answers.
    pub(super) fn vote(&self, views: &[ViewInput], answers: &Answers) -> Result<MaterialField> {
        let (gaussians, library, options) = (&self.scene.gaussians, &*self.library, &self.options.vote);
        Ok(match self.found_parts()? {
            None => vote(gaussians, views, answers, library, options, self.progress)?,
            Some(found) => vote_on_parts(gaussians, views, &found.answered(answers), library, options, self.progress)?,
        })
    }

    /// The stored material field.
    pub(super) fn stored_field(&self) -> Result<&MaterialField> {
        get_or_load(&self.field, || {
            let (_, field) = stored_field(self.work.root())?;
            self.require_all_gaussians(Artifact::Field, field.part_label.len())?;
            Ok(field)
        })
    }

    /// Fails unless a stored splat has as many Gaussians as the scene: the work folder may come from anyone.
    pub(super) fn require_all_gaussians(&self, artifact: Artifact, found: usize) -> Result<(), WorkDirError> {
        let expected = self.scene.gaussians.len();
        match found == expected {
            true => Ok(()),
            false => {
                let problem = format!("it has {} instead of {expected}", counted(found, "Gaussian"));
                Err(self.work.damaged(artifact, problem))
            }
        }
    }
}

/// The views with the label maps that they vote by.
pub(super) fn voters<'a>(views: &'a [View], maps: &'a [Cow<LabelMap>]) -> Vec<ViewInput<'a>> {
    let with_map = views.iter().zip(maps);
    with_map.map(|(view, map)| ViewInput { name: &view.name, camera: &view.camera, map }).collect()
}

/// The Gaussians and their material field in the work folder `root`, as the vote stage wrote them.
///
/// # Errors
/// If there is no field, or gprop did not write it.
pub fn stored_field(root: &Path) -> Result<(Gaussians, MaterialField)> {
    let [path, path_of_labels] = [Artifact::Field, Artifact::Labels].map(|artifact| root.join(artifact.path()));
    let labels: Vec<FieldLabel> = workdir::read_json(&path_of_labels)?;
    if !(labels.first().is_none_or(|first| first.id > 0) && labels.is_sorted_by(|one, next| one.id < next.id)) {
        let problem = "its labels are not numbered in order, from 1 on".to_owned();
        return Err(WorkDirError::Damaged { path: path_of_labels, problem }.into());
    }
    let gaussians = ply::read(&path)?.gaussians;
    let field = field_ply::read(&gaussians.extra, labels)
        .ok_or_else(|| WorkDirError::Damaged { path, problem: "it lacks the field's columns or labels".to_owned() })?;
    Ok((gaussians, field))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_of_a_photo_without_alpha_is_cropped_to_the_object() {
        let hammer = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
        let folder = tempfile::tempdir().unwrap();
        let pipeline = Pipeline::builder(hammer).out(folder.path().join("out")).open().unwrap();
        let count = pipeline.scene.gaussians.len();
        let field = MaterialField {
            labels: Vec::new(),
            part_label: vec![0; count],
            confidence: vec![1.0; count],
            votes: vec![1.0; count],
            views: vec![1; count],
            warnings: Vec::new(),
            notes: Vec::new(),
        };
        let with_alpha = pipeline.scene.views.iter().find(|view| view.name == "003").unwrap();
        let opaque = View { image: folder.path().join("003.png"), ..with_alpha.clone() };
        image::open(&with_alpha.image).unwrap().into_rgb8().save(&opaque.image).unwrap();
        let heights =
            [with_alpha, &opaque].map(|view| pipeline.draw(Shown::Confidence, view, &field).unwrap().height());
        // The hammer lies across this photo, which is square: uncropped, the picture is hundreds of pixels higher. The
        // outlines given by alpha and by the Gaussians differ by a few pixels.
        assert!(heights[0].abs_diff(heights[1]) < 30, "{heights:?}");
    }
}
