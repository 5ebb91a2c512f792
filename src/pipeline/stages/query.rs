//! Queries on disk: one sheet per question, recordings as they arrive, `answers.jsonl` when all are complete.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use crate::consensus::AskAbout;
use crate::error::Result;
use crate::query::session::{Answered, whole_sheet, write_sheets};
use crate::query::{
    Answer, AnswerSource, Answers, Failure, GuessQuestion, Match, ObjectAnswers, Outcome, PartQuestion, Purpose,
    SubjectAnswer, SubjectId, WholeAnswer, WholeOutcome, materials_in_words,
};
use crate::words::output::{agreeing, counted};
use crate::words::part_name::part_name;
use crate::workdir::{Artifact, WorkDir};

use super::questions::{self, about_scene, session_after};
use super::recognise::AnswerAboutWhole;
use super::recognized::Recognized;
use super::subjects::FoundSubjects;
use super::{Done, Job, OpenScene, Row, Stage, Stored};
use crate::pipeline::hasher::Hasher;

pub(super) const ROW: Row = Row {
    inputs: &[Stage::Scene, Stage::Segment, Stage::Consensus, Stage::Recognise, Stage::Refine],
    options: &["query", "materials"],
    result: Artifact::Answers,
    key: |open, inputs| questions::key(open, inputs, None),
    is_stale: |open, _| asks_anew(open),
    run,
};

fn run(open: &OpenScene, job: &Job) -> Result<Done> {
    let work = &open.work;
    let about = FoundSubjects::of(open)?;
    let session = session_after(open, &about, &open.options.query, open.budget.take())?;
    let known = open.get::<AnswerAboutWhole>()?.answer.clone();
    let answered = session.answer_parts(known, &|round| Ok(write_sheets(work, round)?));
    let Answered { mut answers, mut recognition } = answered.map_err(|error| about_scene(error, open))?;
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
            outputs.push(Artifact::Object);
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
    let digest = Hasher::new("answers").with(jsonl.as_bytes()).with_json(&recognition).hex();
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
    Ok(Done { digest: Some(digest), key: Some(questions::key(open, job.inputs.clone(), None)?), ..done })
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
    let in_vain = if question.in_vain { "; so it is taken for what lies around it" } else { "" };
    format!("view {view}, {subject} is asked about because {why}: {outcome}{in_vain}")
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

/// True if answers of an earlier run are not to be reused: either the model is to be asked regardless of recordings, or
/// it can be asked again the questions that it failed to answer.
fn asks_anew(open: &OpenScene) -> bool {
    let options = &open.options.query;
    let failed = || {
        read_answers(&open.work).is_ok_and(|answers| answers.failed().next().is_some())
            || open.get::<Recognized>().is_ok_and(|known| known.0.as_ref().is_some_and(ObjectAnswers::lacks_answers))
    };
    match options.answers {
        AnswerSource::Replay | AnswerSource::Partial => false,
        AnswerSource::Record => options.lmm_url.is_some() && failed(),
        AnswerSource::Live => true,
    }
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
