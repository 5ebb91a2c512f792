//! Answers from recordings.

use super::queries::Queries;
use super::whole::WholeQuestion;
use crate::query::answer::{Problem, Unknown};
use crate::query::options::{AnswerSource, Options};
use crate::query::question::shown_subject::ShownSubject;
use crate::query::question::{Question, Reading};
use crate::query::recorded::{Answerer, Miss, Recordings, Who};
use crate::query::{Failure, Match, Outcome};

/// The result of replaying the questions about a subject.
pub enum Replayed<'a> {
    Answered(Box<Outcome>),
    /// The question that has no recording, and how the ones before it were found.
    Missing {
        question: &'a Question,
        miss: Miss,
        so_far: Match,
    },
    /// There is a recording, but it is not a valid answer.
    Unusable {
        question: &'a Question,
        problem: Problem,
        so_far: Match,
    },
}

/// Whose recordings may be used: those of the model that would be asked; without one, those of the model that the user
/// names, or anyone's.
pub fn who<'a>(answerer: Option<&'a Answerer>, options: &'a Options) -> Who<'a> {
    match (options.answers, answerer) {
        (AnswerSource::Record | AnswerSource::Live, Some(answerer)) => Who::Exactly(answerer),
        _ => options.lmm_model.as_deref().map_or(Who::Anybody, Who::Model),
    }
}

/// Follows a subject's questions through the recordings as far as possible.
pub fn replay<'a>(queries: &'a Queries, subject: &ShownSubject, recordings: &Recordings, who: Who) -> Replayed<'a> {
    let mut question = queries.questions.first();
    let mut so_far = Match::Exact;
    loop {
        let read = |response: &str| queries.questions.read(question, response, queries.library, Unknown::TakeNearest);
        let found = recordings.find(&subject.asked(question), who, &|response| read(response).is_ok());
        let (recording, matched) = match found {
            Ok(found) => found,
            Err(miss) => return Replayed::Missing { question, miss, so_far },
        };
        so_far = weaker(so_far, matched);
        match read(&recording.response) {
            Ok(Reading::Answered(mut answer)) => {
                answer.matched = so_far;
                return Replayed::Answered(Box::new(Outcome::Answered(*answer)));
            }
            Ok(Reading::Next(next)) => question = next,
            Err(problem) => return Replayed::Unusable { question, problem, so_far },
        }
    }
}

/// The recorded answer to a question about the whole object, or why there is none.
pub fn replay_whole<A>(whole: &WholeQuestion<A>, recordings: &Recordings, who: Who) -> Result<A, Miss> {
    let is_readable = |response: &str| whole.read(response).is_ok();
    let (recording, _) = recordings.find(&whole.shown.asked(&whole.question), who, &is_readable)?;
    whole.read(&recording.response).map_err(|_| Miss::Unusable)
}

/// A failure that names the recording as its cause.
pub fn unusable(problem: Problem) -> Outcome {
    Outcome::Failed(match problem.failure {
        Failure::Invalid { message } => Failure::Invalid { message: format!("the recorded answer: {message}") },
        other => other,
    })
}

fn weaker(a: Match, b: Match) -> Match {
    match (a, b) {
        (Match::Mask { iou: a }, Match::Mask { iou: b }) => Match::Mask { iou: a.min(b) },
        (mask @ Match::Mask { .. }, _) | (_, mask @ Match::Mask { .. }) => mask,
        (Match::Live, _) | (_, Match::Live) => Match::Live,
        (Match::Exact, Match::Exact) => Match::Exact,
    }
}
