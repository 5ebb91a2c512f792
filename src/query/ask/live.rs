//! Asks the questions that are not recorded: each response is checked, corrected once if need be, and recorded before
//! anything else happens.

use std::path::PathBuf;

use super::asker::{AskError, Asker, Correction, Reply, ReplyContent, Request};
use super::budget::{Budget, NotSent, Spent};
use super::cost::Cost;
use super::queries::Queries;
use super::whole::{WholeOutcome, WholeQuestion};
use crate::files::json;
use crate::query::answer::{Problem, Unknown};
use crate::query::error::{InVain, QueryError};
use crate::query::options::AnswerSource;
use crate::query::question::shown_subject::ShownSubject;
use crate::query::question::{Question, Reading};
use crate::query::recorded::{QuestionId, QuestionLock, Recording, RecordingError, Recordings, Usage, key};
use crate::query::{Failure, Match, Outcome};
use crate::words::progress::{self, Progress};

/// Everything that asking needs.
pub struct Live<'a> {
    pub queries: &'a Queries<'a>,
    pub recordings: &'a Recordings,
    pub asker: &'a dyn Asker,
    pub budget: &'a Budget,
    pub progress: Progress<'a>,
}

/// Why asking stops for all questions.
#[derive(Debug)]
pub enum Stop {
    /// The next request might exceed the budget.
    Budget,
    /// The next request was not announced.
    Announced,
    /// Too many requests in a row brought no usable reply.
    InVain {
        last: Failure,
        /// The text of the last reply, if there was one.
        reply: Option<String>,
    },
    Endpoint(String),
    Error(QueryError),
}

impl Stop {
    /// True if an answer that was paid for could not be saved in its folder.
    pub fn is_unkept(&self) -> bool {
        matches!(self, Self::Error(QueryError::Unkept { .. }))
    }
}

/// So many requests in a row without a usable reply are enough to stop: the next would bring none either.
const MOST_IN_VAIN: usize = 5;

/// Reads a response.
type Read<'r, R> = dyn Fn(&str, Unknown) -> Result<R, Problem> + 'r;

/// A reply with its meaning, or with the reason why it cannot be used.
struct CheckedReply<R> {
    reading: Result<R, Problem>,
    reply: ModelReply,
}

/// The model's text, and the tokens of all requests that led to it.
struct ModelReply {
    text: String,
    served_model: Option<String>,
    usage: Option<Usage>,
}

impl<'a> Live<'a> {
    /// Asks about a subject, starting with `question`; `None` if the budget was closed because of another question in
    /// the meantime.
    pub fn answer(
        &self,
        subject: &ShownSubject,
        mut question: &'a Question,
        so_far: Match,
    ) -> Result<Option<Outcome>, Stop> {
        self.progress.check().map_err(|cancelled| Stop::Error(cancelled.into()))?;
        loop {
            let read = |response: &str, unknown| {
                self.queries.questions.read(question, response, self.queries.library, unknown)
            };
            let reading = match self.answer_one(subject, question, &read) {
                Ok(reading) => reading,
                Err(Halt::Question(failure)) => return Ok(Some(Outcome::Failed(failure))),
                Err(Halt::All(stop)) => return Err(stop),
                Err(Halt::Closed) => return Ok(None),
            };
            match reading {
                Reading::Next(next) => question = next,
                Reading::Answered(mut answer) => {
                    answer.matched = match so_far {
                        mask @ Match::Mask { .. } => mask,
                        Match::Exact | Match::Live => Match::Live,
                    };
                    return Ok(Some(Outcome::Answered(*answer)));
                }
            }
        }
    }

    /// Asks a question about the whole object.
    pub fn whole<A>(&self, whole: &WholeQuestion<A>) -> Result<WholeOutcome<A>, Stop> {
        match self.answer_one(&whole.shown, &whole.question, &|response: &str, _| whole.read(response)) {
            Ok(answer) => Ok(WholeOutcome::Answered(answer)),
            Err(Halt::Question(failure)) => Ok(WholeOutcome::Failed(failure)),
            Err(Halt::All(stop)) => Err(stop),
            Err(Halt::Closed) => Err(Stop::Budget),
        }
    }

    /// The error of a run that stopped with `left` questions unanswered.
    pub fn error(&self, stop: Stop, left: usize) -> QueryError {
        let spent = self.budget.spent();
        match stop {
            Stop::Error(error) => error,
            Stop::Endpoint(message) => QueryError::Endpoint { message, left, spent },
            Stop::Announced => QueryError::Announced { requests: self.budget.sent(), left, spent },
            Stop::InVain { last, reply } => {
                let (requests, tried) = (self.budget.in_vain(), self.asker.tried());
                QueryError::InVain(Box::new(InVain { requests, last, reply, tried, left, spent }))
            }
            Stop::Budget => QueryError::BudgetSpent {
                max_usd: self.queries.options.max_usd.unwrap_or(f64::INFINITY),
                spent_usd: spent.usd.unwrap_or(0.0),
                left,
            },
        }
    }

    /// The recorded answer to one question: recorded by another gprop process while this one waited for it, or asked
    /// live. `read` reads a response to it.
    fn answer_one<R>(&self, subject: &ShownSubject, question: &Question, read: &Read<R>) -> Result<R, Halt> {
        let asked = subject.asked(question);
        let _lock = self.lock(subject, &asked)?;
        if let Some(reading) = self.answered_meanwhile(&asked, read)? {
            return Ok(reading);
        }
        let checked = self.ask_and_correct(subject, question, read).map_err(|halt| self.unless_in_vain(halt, None))?;
        let ModelReply { text, served_model, usage } = checked.reply;
        let reading =
            checked.reading.map_err(|problem| self.unless_in_vain(Halt::Question(problem.failure), Some(&text)))?;
        self.budget.note_usable_reply();
        self.record(&Recording::new(self.asker.answerer(), asked, text, served_model, usage))?;
        Ok(reading)
    }

    /// Waits until no other gprop process is asking this question.
    fn lock(&self, subject: &ShownSubject, asked: &QuestionId) -> Result<QuestionLock, Halt> {
        let key = key(self.asker.answerer(), asked);
        let mut is_told = false;
        while !self.budget.is_closed() {
            match self.recordings.lock_question(&key) {
                Ok(Some(lock)) => return Ok(lock),
                Ok(None) if !is_told => {
                    let view = &subject.view;
                    self.progress.line(&format!(
                        "view {view}: waiting for another gprop process that is asking the same question"
                    ));
                    is_told = true;
                }
                Ok(None) => {}
                Err(error) => return Err(self.stop(error)),
            }
        }
        Err(Halt::Closed)
    }

    fn answered_meanwhile<R>(&self, asked: &QuestionId, read: &Read<R>) -> Result<Option<R>, Halt> {
        if self.queries.options.answers == AnswerSource::Live {
            return Ok(None);
        }
        let key = key(self.asker.answerer(), asked);
        let recording = self.recordings.written_meanwhile(&key).map_err(|error| self.stop(error))?;
        Ok(recording.and_then(|recording| read(&recording.response, Unknown::TakeNearest).ok()))
    }

    /// Saves an answer that was paid for. If it cannot be written to its folder, it is saved in the spare one or
    /// printed, and nothing more is asked.
    fn record(&self, recording: &Recording) -> Result<(), Halt> {
        let Err(error) = self.recordings.insert(recording) else { return Ok(()) };
        self.budget.close();
        let spare = self.recordings.set_aside(recording).map(PathBuf::from);
        if spare.is_none() {
            let json = json::compact(recording).expect("a recording is plain data");
            progress::notice(&format!("this answer could not be written; save it as {}.json:\n{json}", recording.key));
        }
        let folder = self.recordings.folder().to_owned();
        Err(Halt::All(Stop::Error(QueryError::Unkept { source: error, folder, spare })))
    }

    /// Stops all asking because of `error`.
    fn stop(&self, error: RecordingError) -> Halt {
        self.budget.close();
        Halt::All(Stop::Error(error.into()))
    }

    /// Stops all asking if a failure, with this reply, is one of many in a row.
    fn unless_in_vain(&self, halt: Halt, reply: Option<&str>) -> Halt {
        match halt {
            Halt::Question(last) if self.budget.in_vain() >= MOST_IN_VAIN => {
                Halt::All(Stop::InVain { last, reply: reply.map(str::to_owned) })
            }
            halt => halt,
        }
    }

    /// Asks one question; a response that cannot be used is sent back once with the reason.
    fn ask_and_correct<R>(
        &self,
        subject: &ShownSubject,
        question: &Question,
        read: &Read<R>,
    ) -> Result<CheckedReply<R>, Halt> {
        let first = self.ask(subject, question, None)?;
        let problem = match read(&first.text, Unknown::Refuse) {
            Ok(reading) => return Ok(CheckedReply { reading: Ok(reading), reply: first }),
            Err(problem) => problem,
        };
        let prompt = self.queries.prompts.correction(&problem.reason).map_err(|e| Halt::All(Stop::Error(e.into())))?;
        // It was paid for, and may be better than nothing.
        let of_first = read(&first.text, Unknown::TakeNearest);
        if of_first.is_err() && self.budget.in_vain() >= MOST_IN_VAIN {
            return Ok(CheckedReply { reading: of_first, reply: first });
        }
        let correction = Correction { response: &first.text, prompt: &prompt };
        let second = match self.ask(subject, question, Some(correction)) {
            Err(_) if of_first.is_ok() => return Ok(CheckedReply { reading: of_first, reply: first }),
            second => second?,
        };
        let usage = first.usage.zip(second.usage).map(|(a, b)| a.plus(b)).or(first.usage).or(second.usage);
        let of_second = read(&second.text, Unknown::TakeNearest);
        let (reading, reply) =
            if of_second.is_err() && of_first.is_ok() { (of_first, first) } else { (of_second, second) };
        Ok(CheckedReply { reading, reply: ModelReply { usage, ..reply } })
    }

    fn ask(
        &self,
        subject: &ShownSubject,
        question: &Question,
        correction: Option<Correction>,
    ) -> Result<ModelReply, Halt> {
        let (response, prompt) = correction.map_or(("", ""), |correction| (correction.response, correction.prompt));
        let texts = [question.prompt.as_str(), response, prompt];
        let tokens = self.queries.options.lmm_max_tokens;
        let cost = Cost::of_request(&texts, subject.sheet_size, question.usual_tokens, tokens, self.budget.price());
        let request = Request { question, picture: &subject.jpeg, correction };
        let reply = self.asker.ask(request, &self.budget.account(cost));
        let Spent { requests, usage: Usage { input_tokens, output_tokens }, usd, .. } = self.budget.spent();
        self.progress.asked(requests, input_tokens, output_tokens, usd);
        let Reply { content, usage, served_model } = reply.map_err(|error| match error {
            AskError::Failed(message) => Halt::Question(Failure::Endpoint { message }),
            AskError::Fatal(message) => Halt::All(Stop::Endpoint(message)),
            AskError::Offline(offline) => Halt::All(Stop::Endpoint(offline.to_string())),
            AskError::NotSent(NotSent::Budget) => Halt::All(Stop::Budget),
            AskError::NotSent(NotSent::Announced) => Halt::All(Stop::Announced),
            AskError::NotSent(NotSent::Closed) => Halt::Closed,
        })?;
        match content {
            ReplyContent::Text(text) => Ok(ModelReply { text, served_model, usage }),
            ReplyContent::Refusal(message) => Err(Halt::Question(Failure::Refused { message })),
            ReplyContent::Empty(message) => Err(Halt::Question(Failure::Invalid { message })),
        }
    }
}

/// Why a question has no reply.
enum Halt {
    Question(Failure),
    All(Stop),
    /// The budget permits no further request.
    Closed,
}
