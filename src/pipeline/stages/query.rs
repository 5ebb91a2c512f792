//! Queries on disk: one sheet per question, recordings as they arrive, `answers.jsonl` when all are complete.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::consensus::{self, AskAbout};
use crate::error::{Error, Result};
use crate::files::json;
use crate::query::ask::hints;
use crate::query::recorded::Answerer;
use crate::query::{
    Answer, AnswerSource, Answers, Bare, Failure, GuessQuestion, Hints, LabelSet, Match, ObjectAnswers, Options,
    Outcome, PartQuestion, Preview, Purpose, QueryError, Size, SubjectAnswer, SubjectId, WholeAnswer, WholeOutcome,
    materials_in_words,
};
use crate::scene::{ObjectChoice, ScaleChoice, Scene, View};
use crate::segment::LabelMap;
use crate::units::{MetricScale, Range};
use crate::words::output::{agreeing, counted};
use crate::words::part_name::part_name;
use crate::words::readable::significant;
use crate::words::shell;
use crate::workdir::{Artifact, WorkDir, WorkDirError};

use super::recognized::Recognized;
use super::scene;
use super::subjects::FoundSubjects;
use super::{Done, Job, OpenScene, Row, Stage, Stored, shared_scale};
use crate::pictures::framing;
use crate::pipeline::OBJECT;
use crate::pipeline::hasher::{Hasher, file_digest};
use crate::query::session::{
    self, Answered, Folders, QuerySession, QueryView, Subjects, WholeViews, whole_sheet, write_sheets,
};

/// The content of `size.json`.
#[derive(Serialize, Deserialize)]
struct SizeFile {
    #[serde(flatten)]
    answer: WholeAnswer<Size>,
    scale: Option<MetricScale>,
}

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Segment, Stage::Consensus],
    options: &["query", "materials"],
    result: Artifact::Answers,
    key,
    is_stale: |open, _| asks_anew(open),
    run,
};

fn key(open: &OpenScene, inputs: Hasher) -> Result<String> {
    let options = &open.options.query;
    // The content of these files and folders counts, not how their paths are written.
    let labels = options.labels.clone().filter(|labels| !matches!(labels, LabelSet::File(_)));
    let without_paths = Options { prompts: None, recordings: None, lmm_body: None, labels, ..options.clone() };
    let candidates = session::candidates(options, &open.library)?;
    let mut hasher = inputs
        .with_json(&without_paths)
        .with_json(&open.options.consensus)
        .with_json(&candidates.families())
        .with_json(&candidates.materials())
        .with_json(&open.library.fillings())
        .with_json(&session::prompts(options)?.sha256());
    if let Some(fields) = &options.lmm_body {
        hasher = hasher.with(&file_digest(fields).unwrap_or_default());
    }
    for folder in session::recording_folders(options, open.home_of_recordings()) {
        for path in recordings_in(&folder) {
            hasher = hasher
                .with(path.file_name().unwrap_or_default().as_encoded_bytes())
                .with(&file_digest(&path).unwrap_or_default());
        }
    }
    Ok(hasher.hex())
}

fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let work = &open.work;
    let about = FoundSubjects::of(open)?;
    let session = session_of(open, &about, &open.options.query)?;
    let answered =
        session.answer_with_size(&|round| Ok(write_sheets(work, round)?), |answer| size_file(&open.scene, answer));
    let Answered { mut answers, size: file, mut recognition } = answered.map_err(|error| about_scene(error, open))?;
    settle(answers.all.iter_mut().map(|answer| &mut answer.outcome));
    settle(questions_in(recognition.as_mut()).filter_map(|question| question.outcome.as_mut()));
    let jsonl = answers.to_jsonl();
    work.write(Artifact::Answers, jsonl.as_bytes())?;
    answers.require_any()?;
    let mut outputs = vec![Artifact::Answers];
    let mut warnings = failures(&answers);
    work.remove(Artifact::Object)?;
    match &recognition {
        Some(recognition) => {
            work.write_json(Artifact::Object, recognition)?;
            outputs.extend([Artifact::Object, whole_sheet(Purpose::Recognition, &recognition.view)]);
            match &recognition.outcome {
                WholeOutcome::Answered(answered) => {
                    let questions = answered.questions.iter();
                    outputs.extend(questions.map(|of| Artifact::Sheet(&of.view, of.subject.number())));
                    warnings.extend(answered.questions.iter().filter_map(failure_of));
                    let guess = answered.guess.as_ref();
                    outputs.extend(guess.map(|of| whole_sheet(Purpose::DirectGuess, &of.view)));
                    warnings.extend(guess.and_then(failure_to_guess));
                }
                WholeOutcome::Failed(failure) => warnings.push(format!(
                    "the model did not say what the object is, so its parts were asked about: {failure}"
                )),
            }
        }
        None => {
            let sheets = answers.all.iter().map(|answer| Artifact::Sheet(&answer.view, answer.subject.number()));
            outputs.extend(sheets);
        }
    }
    if let Some((file, warning)) = &file {
        work.write_json(Artifact::Size, file)?;
        warnings.push(warning.clone());
        outputs.extend([Artifact::Size, whole_sheet(Purpose::Size, &file.answer.view)]);
    }
    let digest = Hasher::new("answers").with(jsonl.as_bytes()).with_json(&file).with_json(&recognition).hex();
    let served = (open.options.consensus.ask == AskAbout::Object && recognition.is_none())
        .then(|| "what the object is has no recorded answer; those about its parts are used".to_owned());
    let followed = recognition.as_ref().and_then(|answer| answer.outcome.answered());
    let followed = followed.into_iter().flat_map(|answered| {
        answered.questions.iter().map(reason_of).chain(answered.guess.as_ref().and_then(left_unguessed))
    });
    let done = Done::writing(outputs)
        .warning(warnings)
        .noting(notes(&answers).into_iter().chain(served).chain(followed).collect());
    // Recordings are part of the key, and asking may have added some.
    Ok(Done { digest: Some(digest), key: Some(key(open, job.inputs.clone())?), ..done })
}

/// The error, with commands that name the scene if it names any.
fn about_scene(error: Error, open: &OpenScene) -> Error {
    match error.downcast::<QueryError>() {
        Ok(missing) => {
            let scene = shell::path(&open.path);
            let typed = match open.options.scene.object {
                ObjectChoice::One(number) => format!("{scene} --{OBJECT} {number}"),
                ObjectChoice::Auto | ObjectChoice::All => scene,
            };
            missing.about(&typed).into()
        }
        Err(other) => other,
    }
}

/// The questions about parts that followed the one about the object.
fn questions_in(recognition: Option<&mut WholeAnswer<ObjectAnswers>>) -> impl Iterator<Item = &mut PartQuestion> {
    let answered = recognition.and_then(|answer| match &mut answer.outcome {
        WholeOutcome::Answered(answered) => Some(answered),
        WholeOutcome::Failed(_) => None,
    });
    answered.into_iter().flat_map(|answered| &mut answered.questions)
}

/// What gets a question answered that has no recorded answer.
const ASK_OR_ANSWER: &str = "--lmm-url names a model to ask, or answer by hand (gprop query SCENE --export DIR)";

/// Why a question about a part followed, and what came of it.
fn reason_of(question: &PartQuestion) -> String {
    let PartQuestion { view, subject, why, .. } = question;
    let outcome = match &question.outcome {
        Some(Outcome::Answered(Answer { material, confidence, alternatives, .. })) => {
            format!("answered {}", materials_in_words(material, *confidence, alternatives))
        }
        Some(Outcome::Failed(_)) => "not answered".to_owned(),
        None => format!("no recorded answer, so the answer about the object stands; {ASK_OR_ANSWER}"),
    };
    format!("view {view}, {subject} is asked about because {why}: {outcome}")
}

fn failure_of(PartQuestion { view, subject, outcome, .. }: &PartQuestion) -> Option<String> {
    match outcome {
        Some(Outcome::Failed(failure)) => Some(format!("view {view}, {subject}: {failure}")),
        Some(Outcome::Answered(_)) | None => None,
    }
}

fn failure_to_guess(GuessQuestion { view, outcome }: &GuessQuestion) -> Option<String> {
    match outcome {
        Some(WholeOutcome::Failed(failure)) => {
            Some(format!("view {view}: the model did not say how heavy the object is: {failure}"))
        }
        Some(WholeOutcome::Answered(_)) | None => None,
    }
}

/// That nobody could be asked how heavy the object is.
fn left_unguessed(GuessQuestion { outcome, .. }: &GuessQuestion) -> Option<String> {
    let note = || {
        format!("how heavy the object is at a guess has no recorded answer, so its mass does without; {ASK_OR_ANSWER}")
    };
    outcome.is_none().then(note)
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

/// The answers to the questions about the chosen views.
impl Stored for Answers {
    const STAGE: Stage = Stage::Query;

    fn load(open: &OpenScene) -> Result<Self> {
        let answers = read_answers(&open.work)?;
        // The names of files are made of the views' names, and the work folder may come from anyone.
        let known: HashSet<&str> = open.views.iter().map(|view| &*view.name).collect();
        let unknown = answers.all.iter().find(|answer| !known.contains(&*answer.view));
        if let Some(SubjectAnswer { view, .. }) = unknown {
            let problem = format!("it has an answer about {view:?}, which is not among the chosen views");
            return Err(open.work.damaged(Artifact::Answers, problem).into());
        }
        Ok(answers)
    }
}

/// The queries of the chosen views, under `options`, which need not be the run's; the parts must have been found.
pub fn session_of<'a>(open: &'a OpenScene, about: &'a FoundSubjects, options: &'a Options) -> Result<QuerySession<'a>> {
    let views =
        open.views.iter().enumerate().map(|(number, view)| {
            Ok(QueryView { name: &view.name, photo: open.photo(view)?, maps: about.maps(number) })
        });
    let views: Vec<QueryView> = views.collect::<Result<_>>()?;
    let (subjects, ask_views) = about.subjects(open);
    let asks_size = open.options.scene.scale == ScaleChoice::Estimate;
    let fullest = fullest_view(open);
    let recognition = match open.options.consensus.ask {
        AskAbout::Object => {
            let maps: Vec<&LabelMap> = views.iter().filter_map(|view| view.maps.last()).map(AsRef::as_ref).collect();
            sides(open, fullest, &maps, MOST_SIDES)
        }
        AskAbout::Parts | AskAbout::Segments => Vec::new(),
    };
    let outer_size = outer_size(open)?;
    // Without a scale, nothing follows from what a thing may weigh.
    let asks_mass = !recognition.is_empty() && outer_size.is_some();
    let whole = WholeViews {
        size: fullest.filter(|_| asks_size),
        recognition,
        direct: if asks_mass { sides_of_guess(open, fullest) } else { Vec::new() },
        outer_size,
        bare: if open.scene.support.is_some() { Bare::First } else { Bare::No },
        hints: hints(open, options),
    };
    let regions = if whole.recognition.is_empty() { Vec::new() } else { about.regions(open)? };
    asking(open, options, Subjects { views, subjects, ask_views, about: about.about(), whole, regions })
}

/// The question for the mass of the object alone, as the photos show it.
pub fn direct_session<'a>(open: &'a OpenScene) -> Result<QuerySession<'a>> {
    let view = |view: &'a View| Ok(QueryView { name: &view.name, photo: open.photo(view)?, maps: Vec::new() });
    let views = open.views.iter().map(view).collect::<Result<_>>()?;
    let whole = WholeViews {
        direct: sides_of_guess(open, fullest_view(open)),
        outer_size: outer_size(open)?,
        ..WholeViews::default()
    };
    let subjects =
        Subjects { views, subjects: Vec::new(), ask_views: 1, about: AskAbout::Object, whole, regions: Vec::new() };
    asking(open, &open.options.query, subjects)
}

fn asking<'a>(open: &'a OpenScene, options: &'a Options, subjects: Subjects<'a>) -> Result<QuerySession<'a>> {
    let (home, network) = (open.home_of_recordings(), open.options.setup.network());
    session::check_recordings(options, home, &open.work, open.options.scene.read_scope(home))?;
    let folders = Folders { home, work: &open.work };
    QuerySession::new(options, subjects, &open.library, folders, network, open.progress())
}

/// Sides of the object in the question what it is: more would show each too small.
const MOST_SIDES: usize = 4;
/// Photos in the question for its mass alone: as many as people take to show a thing.
const SIDES_OF_GUESS: usize = 3;

/// Up to `most` of the chosen views that show the object, divided as `maps` say, from all sides; `first`, the one that shows most
/// of it, comes first. None without that.
fn sides(open: &OpenScene, first: Option<usize>, maps: &[&LabelMap], most: usize) -> Vec<usize> {
    let cameras: Vec<&Camera> = open.views.iter().map(|view| &view.camera).collect();
    let center = open.scene.object_bounds().center();
    first.map_or_else(Vec::new, |first| consensus::sides::sides(&cameras, center, maps, first, most))
}

/// The views in the question for the mass of the object alone.
fn sides_of_guess(open: &OpenScene, first: Option<usize>) -> Vec<usize> {
    sides(open, first, &vec![&LabelMap::default(); open.views.len()], SIDES_OF_GUESS)
}

/// The outer size of the object in words, if the scale is known before anyone is asked: a model knows what such things weigh.
fn outer_size(open: &OpenScene) -> Result<Option<String>> {
    const CM_PER_M: f64 = 100.0;
    Ok(scene::scale(open)?.map(|scale| {
        let in_cm = |side| significant(side * scale.meters_per_unit * CM_PER_M);
        let [a, b, c] = open.scene.least_box().map(in_cm);
        format!("outer size {a} x {b} x {c} cm")
    }))
}

/// What the file of a mesh calls things, if the user wants the model to know.
fn hints(open: &OpenScene, options: &Options) -> Option<String> {
    let mesh = open.scene.mesh.as_ref().filter(|_| options.hints == Hints::Names)?;
    hints::paragraph(&mesh.names_in_file())
}

/// Estimates what a query would send, and its cost.
pub fn preview(open: &OpenScene) -> Result<Preview> {
    let about = FoundSubjects::of(open)?;
    let session = session_of(open, &about, &open.options.query)?;
    Ok(session.preview(&session.queries()?))
}

/// The index of the chosen view that shows most of the object, regardless of its parts.
pub fn fullest_view(open: &OpenScene) -> Option<usize> {
    let cameras = open.views.iter().map(|view| &view.camera);
    framing::shows_most(cameras, &open.scene.gaussians, &vec![0; open.scene.gaussians.len()])
}

/// True if answers of an earlier run are not to be reused: either the model is to be asked regardless of recordings, or
/// it can be asked again the questions that it failed to answer.
fn asks_anew(open: &OpenScene) -> bool {
    let options = &open.options.query;
    let no_size = || {
        let asked = open.options.scene.scale == ScaleChoice::Estimate;
        asked && estimated_scale(&open.work).is_ok_and(|scale| scale.is_none())
    };
    let failed = || {
        no_size()
            || read_answers(&open.work).is_ok_and(|answers| answers.failed().next().is_some())
            || open.get::<Recognized>().is_ok_and(|known| known.0.as_ref().is_some_and(ObjectAnswers::lacks_answers))
    };
    match options.answers {
        AnswerSource::Replay | AnswerSource::Partial => false,
        AnswerSource::Record => options.lmm_url.is_some() && failed(),
        AnswerSource::Live => true,
    }
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

fn read_answers(work: &WorkDir) -> Result<Answers> {
    let damaged = |problem: &dyn std::fmt::Display| work.damaged(Artifact::Answers, problem);
    let text = String::from_utf8(work.read(Artifact::Answers)?).map_err(|problem| damaged(&problem))?;
    Ok(Answers::from_jsonl(&text).map_err(|problem| damaged(&problem))?)
}

/// Makes answers what any later run finds: one that the model just gave counts as recorded for exactly this query. So a run that
/// was killed while asking ends in the same bytes as one that was not, and a rerun of either has nothing to redo.
fn settle<'a>(outcomes: impl Iterator<Item = &'a mut Outcome>) {
    for outcome in outcomes {
        if let Outcome::Answered(answer) = outcome
            && answer.matched == Match::Live
        {
            answer.matched = Match::Exact;
        }
    }
}

/// The recordings in a folder, sorted; none if it cannot be read.
fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut found: Vec<_> = entries.filter(|path| path.extension().is_some_and(|end| end == "json")).collect();
    found.sort();
    found
}

/// The names of all whose answers are recorded with the scene and may have been used, in order.
pub fn answered_by(open: &OpenScene) -> Vec<String> {
    let options = &open.options.query;
    let folders = session::recording_folders(options, open.home_of_recordings());
    let model_of = |path: PathBuf| json::read::<Answerer>(&fs::read(path).ok()?).ok().map(|answerer| answerer.model);
    let models: BTreeSet<String> =
        folders.iter().flat_map(|folder| recordings_in(folder)).filter_map(model_of).collect();
    let may_answer = |model: &String| options.lmm_model.as_ref().is_none_or(|asked| asked == model);
    models.into_iter().filter(may_answer).collect()
}

/// The questions without an answer.
fn failures(answers: &Answers) -> Vec<String> {
    // Other views' answers name a part; a segment's number means something else in every view.
    let mut names: BTreeMap<u16, String> = BTreeMap::new();
    for answer in &answers.all {
        if let (SubjectId::Part(id), Outcome::Answered(said)) = (answer.subject, &answer.outcome) {
            names.entry(id).or_insert_with(|| part_name(&said.caption, &said.material));
        }
    }
    let name = |subject: SubjectId| match subject {
        SubjectId::Part(id) => names.get(&id).map_or_else(String::new, |name| format!(" ({name})")),
        SubjectId::Segment(_) => String::new(),
    };
    let failure = |answer: &SubjectAnswer| match &answer.outcome {
        Outcome::Failed(Failure::Unanswered) => None,
        Outcome::Failed(failure) => {
            Some(format!("view {}, {}{}: {failure}", answer.view, answer.subject, name(answer.subject)))
        }
        Outcome::Answered(_) => None,
    };
    answers.all.iter().filter_map(failure).chain(left_open(answers)).collect()
}

/// The subjects that have no answer yet.
fn left_open(answers: &Answers) -> Option<String> {
    // The number of a segment means something else in every view.
    let is_of_view = |answer: &SubjectAnswer| matches!(answer.subject, SubjectId::Segment(_));
    let subject = |answer: &'_ SubjectAnswer| (is_of_view(answer).then(|| answer.view.clone()), answer.subject);
    let (open, others): (Vec<_>, Vec<_>) =
        answers.all.iter().partition(|answer| answer.outcome == Outcome::Failed(Failure::Unanswered));
    let others: BTreeSet<_> = others.into_iter().map(subject).collect();
    let open: BTreeSet<_> = open.into_iter().map(subject).filter(|of| !others.contains(of)).collect();
    let parts: Vec<String> =
        open.iter().filter(|(view, _)| view.is_none()).map(|(_, part)| part.number().to_string()).collect();
    let named = match parts.as_slice() {
        [] => counted(open.len(), "segment"),
        [part] => format!("part {part}"),
        parts => format!("parts {}", parts.join(", ")),
    };
    let consequence =
        "until then, what has no answer counts like the parts beside it; `gprop answer SCENE` asks for the rest";
    (!open.is_empty()).then(|| format!("not answered yet: {named}; {consequence}"))
}

/// Each correction or doubt once, with the number of answers that it applies to; and the number of answers that were
/// recorded for slightly different masks.
fn notes(answers: &Answers) -> Vec<String> {
    let mut notes = Vec::new();
    let mut overlaps: Vec<f64> = Vec::new();
    let mut flags: BTreeMap<&str, usize> = BTreeMap::new();
    for answer in &answers.all {
        if let Outcome::Answered(answer) = &answer.outcome {
            answer.flags.iter().for_each(|flag| *flags.entry(flag).or_default() += 1);
            if let Match::Mask { iou } = answer.matched {
                overlaps.push(iou);
            }
        }
    }
    notes.extend(flags.into_iter().map(|(flag, answers)| format!("{flag} (in {})", counted(answers, "answer"))));
    if let Some(least) = overlaps.iter().copied().min_by(f64::total_cmp) {
        let (count, all) = (overlaps.len(), answers.all.len());
        notes.push(format!(
            "{count} of {} {} given for an outline that differs a little from that of this run (they overlap by {:.0} % or more), \
             and counts all the same",
            counted(all, "answer"),
            agreeing(count, "was", "were"),
            (100.0 * least).floor(),
        ));
    }
    notes
}
