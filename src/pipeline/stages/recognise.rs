//! The questions about the whole object on disk: how long it is, `size.json`, and what it is, `recognition.json`.

use serde::{Deserialize, Serialize};

use crate::consensus::AskAbout;
use crate::error::Result;
use crate::query::session::{AnsweredWhole, schemas_about_whole, whole_sheet, write_sheets};
use crate::query::{AnswerSource, Purpose, Recognition, Size, WholeAnswer, WholeOutcome};
use crate::scene::{ScaleChoice, Scene};
use crate::units::{MetricScale, Range};
use crate::workdir::{Artifact, WorkDir, WorkDirError};

use super::questions::{self, about_scene, session_of};
use super::subjects::FoundSubjects;
use super::{Done, Job, OpenScene, Row, Stage, Stored, scene, shared_scale};
use crate::pipeline::hasher::Hasher;

/// The content of `size.json`.
#[derive(Serialize, Deserialize)]
struct SizeFile {
    #[serde(flatten)]
    answer: WholeAnswer<Size>,
    scale: Option<MetricScale>,
}

/// What the object is, as far as that was asked: the content of `recognition.json`.
#[derive(Default, Serialize, Deserialize)]
pub struct AnswerAboutWhole {
    /// `None` if it was not asked, or if recorded answers about the parts serve.
    pub answer: Option<WholeAnswer<Recognition>>,
    /// By thing without a number, the place of which the answer speaks; `None` if it names none, or one beside the photo.
    places: Vec<Option<NamedPlace>>,
}

/// A place in a photo, in pixels from the upper left corner.
#[derive(Serialize, Deserialize)]
struct NamedPlace {
    view: String,
    at: [f64; 2],
}

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Segment, Stage::Consensus],
    // The query stage, which has the same, stores them.
    options: &[],
    result: Artifact::Recognition,
    key,
    is_stale: |open, _| asks_anew(open),
    run,
};

/// Questions about parts, and their recordings, come later.
fn key(open: &OpenScene, inputs: Hasher) -> Result<String> {
    if !is_asked(open) {
        return Ok(inputs.hex());
    }
    let inputs = inputs.with_json(&open.options.scene.scale);
    questions::key(open, inputs, Some(&schemas_about_whole(&open.options.query)?))
}

/// Whether anything is to be asked about the whole object.
fn is_asked(open: &OpenScene) -> bool {
    open.options.consensus.ask == AskAbout::Object || open.options.scene.scale == ScaleChoice::Estimate
}

fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let work = &open.work;
    if !is_asked(open) {
        work.write_json(Artifact::Recognition, &AnswerAboutWhole::default())?;
        return Ok(Done::writing([Artifact::Recognition]));
    }
    let about = FoundSubjects::unasked(open)?;
    let session = session_of(open, &about, &open.options.query)?;
    let answered =
        session.answer_whole(&|round| Ok(write_sheets(work, round)?), |answer| size_file(&open.scene, answer));
    let AnsweredWhole { size, recognition: answer } = answered.map_err(|error| about_scene(error, open))?;
    let known = answer.as_ref().and_then(|answer| answer.outcome.answered());
    let places = session.places_of(known.map_or(&[], |known| &known.unnumbered)).into_iter();
    let place = |(view, at): (usize, [f64; 2])| NamedPlace { view: open.views[view].name.clone(), at };
    let places = places.map(|named| named.map(place)).collect();
    let budget = session.into_budget();
    if job.is_last {
        budget.spent().tell("");
    }
    open.budget.leave(budget);
    let recognised = AnswerAboutWhole { answer, places };
    work.write_json(Artifact::Recognition, &recognised)?;
    let shown = recognised.answer.as_ref().map(|answer| whole_sheet(Purpose::Recognition, &answer.view));
    let mut outputs: Vec<Artifact> = std::iter::once(Artifact::Recognition).chain(shown).collect();
    let mut warnings = Vec::new();
    if let Some((file, warning)) = &size {
        work.write_json(Artifact::Size, file)?;
        warnings.push(warning.clone());
        outputs.extend([Artifact::Size, whole_sheet(Purpose::Size, &file.answer.view)]);
    }
    let digest =
        Hasher::new("recognition").with_json(&recognised).with_json(&size.as_ref().map(|(file, _)| file)).hex();
    // Recordings are part of the key, and asking may have added some.
    let key = key(open, job.inputs.clone())?;
    Ok(Done { digest: Some(digest), key: Some(key), ..Done::writing(outputs).warning(warnings) })
}

/// The size of the object with the scale that follows from it, and what the user should know about that scale.
fn size_file(scene: &Scene, answer: WholeAnswer<Size>) -> Result<(SizeFile, String)> {
    let size = match &answer.outcome {
        WholeOutcome::Answered(size) => size,
        WholeOutcome::Failed(failure) => {
            let warning = format!("view {}: the model did not say how long the object is: {failure}", answer.view);
            return Ok((SizeFile { answer, scale: None }, warning));
        }
    };
    let (scale, unusual) = scene.estimated_scale(&size.object, size.longest_side_m)?;
    let Range { low, high } = size.longest_side_m;
    let warning = format!(
        "the metric scale is {}; its interval alone makes masses uncertain by a factor of {:.1}. Measure a length \
         (--scale) or weigh the object (--known-mass)",
        scale.provenance,
        (high / low).powi(3)
    );
    let warning = [Some(warning), unusual].into_iter().flatten().collect::<Vec<_>>().join("; ");
    Ok((SizeFile { answer, scale: Some(scale) }, warning))
}

/// The metric scale: the one that follows from other objects of the capture or from the size that the model estimated, or else the
/// scene's.
pub(super) fn scale(open: &OpenScene) -> Result<Option<MetricScale>, WorkDirError> {
    if let Some(shared) = shared_scale::of(open) {
        return Ok(Some(shared));
    }
    match open.options.scene.scale {
        ScaleChoice::Estimate => estimated_scale(&open.work),
        _ => scene::scale(open),
    }
}

/// The scale in `size.json`; `None` if the model did not say how long the object is.
pub fn estimated_scale(work: &WorkDir) -> Result<Option<MetricScale>, WorkDirError> {
    Ok(work.read_json::<SizeFile>(Artifact::Size)?.scale)
}

/// True if answers of an earlier run are not to be reused: either the model is to be asked regardless of recordings, or it can be
/// asked again what it failed to answer.
fn asks_anew(open: &OpenScene) -> bool {
    let Ok(known) = open.get::<AnswerAboutWhole>() else { return false };
    let no_size = || {
        let asked = open.options.scene.scale == ScaleChoice::Estimate;
        asked && estimated_scale(&open.work).is_ok_and(|scale| scale.is_none())
    };
    let has_failed = || no_size() || (open.options.consensus.ask == AskAbout::Object && known.known().is_none());
    let options = &open.options.query;
    match options.answers {
        AnswerSource::Replay | AnswerSource::Partial => false,
        AnswerSource::Record => options.lmm_url.is_some() && has_failed(),
        AnswerSource::Live => true,
    }
}

impl AnswerAboutWhole {
    /// What the object is, if that was answered.
    pub fn known(&self) -> Option<&Recognition> {
        self.answer.as_ref().and_then(|answer| answer.outcome.answered())
    }

    /// The index of the view, and the place in it in pixels, of which the answer speaks when it names this thing without a number.
    pub fn place_of(&self, thing: usize, open: &OpenScene) -> Option<(usize, [f64; 2])> {
        let NamedPlace { view, at } = self.places.get(thing)?.as_ref()?;
        let view = open.views.iter().position(|of| of.name == *view)?;
        let size = &open.views[view].camera.intrinsics;
        let is_inside = at.iter().zip([size.width, size.height]).all(|(at, side)| (0.0..f64::from(side)).contains(at));
        is_inside.then_some((view, *at))
    }
}

impl Stored for AnswerAboutWhole {
    const STAGE: Stage = Stage::Recognise;

    fn load(open: &OpenScene) -> Result<Self> {
        let known: Self = open.work.read_json(Artifact::Recognition)?;
        let problem = known.known().and_then(Recognition::problem);
        let problem = problem.map(|problem| open.work.damaged(Artifact::Recognition, problem));
        problem.map_or(Ok(known), |problem| Err(problem.into()))
    }
}
