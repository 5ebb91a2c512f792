//! The vote on disk: `field.ply` for any splat viewer, and `labels.json` and `materials.json`, which explain its
//! numbers.

use std::borrow::Cow;
use std::path::Path;

use image::RgbImage;

use crate::error::Result;
use crate::gaussians::Gaussians;
use crate::pictures::figure::{self, Shown, ShownObject};
use crate::pictures::{field_colors, framing, thumbnail};
use crate::query::Answers;
use crate::scene::View;
use crate::scene::splat::ply;
use crate::segment::LabelMap;
use crate::vote::{self, FieldPart, MaterialField, VoteError, VotingView, field_ply, vote_on_parts};
use crate::words::output::counted;
use crate::words::part_name::part_name;
use crate::workdir::{self, Artifact, WorkDirError};

use super::subjects::FoundSubjects;
use super::{Done, Job, OpenScene, Row, Stage, Stored, never, recognise, shared_scale};
use crate::pictures::png;

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Segment, Stage::Consensus, Stage::Refine, Stage::Query],
    options: &["vote"],
    result: Artifact::Field,
    key: |open, inputs| {
        let mut hasher = inputs.with_json(&open.library.materials()).with_json(&open.library.fillings());
        // The figure has a scale bar.
        if let Some(scale) = shared_scale::of(open) {
            hasher = hasher.with_json(&scale);
        }
        Ok(hasher.with_json(&open.options.vote).hex())
    },
    is_stale: never,
    run,
};

fn run(open: &OpenScene, _: &Job) -> Result<Done> {
    let (work, gaussians) = (&open.work, &open.scene.gaussians);
    let (about, answers) = (FoundSubjects::of(open)?, open.get::<Answers>()?);
    let mut field = elect(open, &about, &voters(&open.views, &about.settled_maps(open, &answers)?), &answers)?;
    field.parts = vote::corrected(&field.parts, &open.options.vote.correct, &open.library).map_err(VoteError::from)?;
    // In the frame of the splat that it explains.
    let as_read = open.scene.gaussians_as_read();
    work.write_with(Artifact::Field, |out| ply::write(out, as_read, &field_ply::columns(&field)))?;
    work.write_json(Artifact::Labels, &field.parts)?;
    work.write_json(Artifact::Materials, &field_ply::materials(&field.parts, &open.library))?;
    let recolored = field_colors::recolored(as_read, &field_colors::material_colors(&field));
    work.write_with(Artifact::Recolored, |out| ply::write(out, &recolored, &[]))?;
    let mut written = vec![Artifact::Field, Artifact::Labels, Artifact::Materials, Artifact::Recolored];
    let fullest = open.keep(ShowsMost::of(open, &field));
    if let Some(view) = fullest.view(open) {
        work.write(Artifact::Figure, &png(&draw(open, Shown::Figure, view, &field)?)?)?;
        let small = thumbnail::draw(&view.camera, &open.photo(view)?, gaussians, &field)?;
        work.write(Artifact::Thumbnail, &small)?;
        written.extend([Artifact::Figure, Artifact::Thumbnail]);
    }
    let notes = field.parts.iter().filter_map(correction_note).chain(field.notes).collect();
    Ok(Done::writing(written).warning(field.warnings).noting(notes))
}

/// That a part is corrected, and what was answered.
fn correction_note(part: &FieldPart) -> Option<String> {
    let corrected = part.corrected.as_ref()?;
    Some(format!("part {} ({}) is {corrected}", part.id, part_name(&part.caption, &part.material)))
}

/// The field that results from these views and answers.
pub fn elect(
    open: &OpenScene,
    about: &FoundSubjects,
    views: &[VotingView],
    answers: &Answers,
) -> Result<MaterialField, VoteError> {
    let (gaussians, library, options) = (&open.scene.gaussians, &*open.library, &open.options.vote);
    match about {
        FoundSubjects::Segments(_) => vote::vote(gaussians, views, answers, library, options, open.progress()),
        FoundSubjects::Parts(found) => {
            vote_on_parts(gaussians, views, &found.answered(answers), library, options, open.progress())
        }
    }
}

pub fn draw(open: &OpenScene, shown: Shown, view: &View, field: &MaterialField) -> Result<RgbImage> {
    Ok(figure::draw(shown, &view.camera, &open.photo(view)?, object(open, field)?))
}

pub fn object<'a>(open: &'a OpenScene, field: &'a MaterialField) -> Result<ShownObject<'a>> {
    let meters_per_unit = recognise::scale(open)?.map(|scale| scale.meters_per_unit);
    Ok(ShownObject { gaussians: &open.scene.gaussians, field, meters_per_unit })
}

/// The index of the chosen view that shows most of the object.
pub struct ShowsMost(Option<usize>);

impl ShowsMost {
    fn of(open: &OpenScene, field: &MaterialField) -> Self {
        let cameras = open.views.iter().map(|view| &view.camera);
        Self(framing::shows_most(cameras, &open.scene.gaussians, &field.part_index))
    }

    pub fn view<'a>(&self, open: &'a OpenScene) -> Option<&'a View> {
        self.0.map(|index| &open.views[index])
    }
}

impl Stored for ShowsMost {
    const STAGE: Stage = Stage::Vote;

    fn load(open: &OpenScene) -> Result<Self> {
        Ok(Self::of(open, &*open.get::<MaterialField>()?))
    }
}

impl Stored for MaterialField {
    const STAGE: Stage = Stage::Vote;

    fn load(open: &OpenScene) -> Result<Self> {
        let (_, field) = stored_field(open.work.root())?;
        require_all_gaussians(open, Artifact::Field, field.part_index.len())?;
        Ok(field)
    }
}

/// Fails unless a stored splat has as many Gaussians as the scene: the work folder may come from anyone.
pub(super) fn require_all_gaussians(open: &OpenScene, artifact: Artifact, found: usize) -> Result<(), WorkDirError> {
    let expected = open.scene.gaussians.len();
    if found == expected {
        return Ok(());
    }
    Err(open.work.damaged(artifact, format!("it has {} instead of {expected}", counted(found, "Gaussian"))))
}

/// The views with the label maps that they vote by.
pub fn voters<'a>(views: &'a [View], maps: &'a [Cow<LabelMap>]) -> Vec<VotingView<'a>> {
    let with_map = views.iter().zip(maps);
    with_map.map(|(view, map)| VotingView { name: &view.name, camera: &view.camera, map }).collect()
}

/// More parts than a vote gives: the work folder may come from anyone, and parts are compared with each other.
const MOST_PARTS: usize = 20_000;

/// The Gaussians, in the input's frame, and their material field in the work folder `root`, as the vote stage wrote them.
///
/// # Errors
/// If there is no field, or gprop did not write it.
pub fn stored_field(root: &Path) -> Result<(Gaussians, MaterialField)> {
    let [path, path_of_labels] = [Artifact::Field, Artifact::Labels].map(|artifact| root.join(artifact.path()));
    let parts: Vec<FieldPart> = workdir::read_json(&path_of_labels)?;
    let are_in_order =
        parts.first().is_none_or(|first| first.id > 0) && parts.is_sorted_by(|one, next| one.id < next.id);
    if parts.len() > MOST_PARTS || !are_in_order {
        let problem = format!("its labels are not numbered in order, from 1 on, or are more than {MOST_PARTS}");
        return Err(WorkDirError::Damaged { path: path_of_labels, problem }.into());
    }
    let gaussians = ply::read(&path)?.gaussians;
    let field = field_ply::read(&gaussians.extra, parts)
        .ok_or_else(|| WorkDirError::Damaged { path, problem: "it lacks the field's columns or labels".to_owned() })?;
    Ok((gaussians, field))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pipeline;

    #[test]
    fn a_picture_of_a_photo_without_alpha_is_cropped_to_the_object() {
        let hammer = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
        let folder = tempfile::tempdir().unwrap();
        let pipeline = Pipeline::builder(hammer).out(folder.path().join("out")).open().unwrap();
        let open = pipeline.opened();
        let count = open.scene.gaussians.len();
        let field = MaterialField::known(Vec::new(), vec![0; count]);
        let with_alpha = open.scene.views.iter().find(|view| view.name == "003").unwrap();
        let opaque = View { image: folder.path().join("003.png"), ..with_alpha.clone() };
        image::open(&with_alpha.image).unwrap().into_rgb8().save(&opaque.image).unwrap();
        let heights = [with_alpha, &opaque].map(|view| draw(open, Shown::Confidence, view, &field).unwrap().height());
        // The hammer lies across this photo, which is square: uncropped, the picture is hundreds of pixels higher. The
        // outlines given by alpha and by the Gaussians differ by a few pixels.
        assert!(heights[0].abs_diff(heights[1]) < 30, "{heights:?}");
    }
}
