//! A question about the object as a whole, which is asked once, before those about its parts.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::query::Failure;
use crate::query::answer::Problem;
use crate::query::question::Question;
use crate::query::question::shown_subject::ShownSubject;

/// The id of the whole object, which no segment or part has.
pub const WHOLE: u16 = 0;

/// What a question about the whole object is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// How long it is: `--scale estimate`.
    Size,
    /// What it is, and what its parts are made of: `--ask object`.
    Recognition,
    /// How heavy it is, from its photos alone: what a user gets without gprop.
    DirectGuess,
}

/// A question about the whole object, with its picture, whose answer is an `A`.
pub struct WholeQuestion<A> {
    pub purpose: Purpose,
    pub shown: ShownSubject,
    pub question: Question,
    interpret: Box<dyn Fn(Value) -> Result<A, Problem> + Send + Sync>,
}

/// A question about the whole object, whatever its answer is.
pub trait AnyWholeQuestion: Sync {
    fn purpose(&self) -> Purpose;

    /// The object, as the question shows it.
    fn shown(&self) -> &ShownSubject;

    fn question(&self) -> &Question;

    /// Checks a response to the question.
    ///
    /// # Errors
    /// The problem with the response.
    fn check(&self, response: &str) -> Result<(), Problem>;
}

/// The answer to a question about the whole object, or why there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WholeAnswer<A> {
    /// The view in which the object was shown, or the first of several.
    pub view: String,
    #[serde(flatten)]
    pub outcome: WholeOutcome<A>,
}

/// An answer, or why there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum WholeOutcome<A> {
    Answered(A),
    Failed(Failure),
}

impl<A> WholeQuestion<A> {
    /// The question whose answers `interpret` reads once they follow its schema.
    pub fn new(
        purpose: Purpose,
        shown: ShownSubject,
        question: Question,
        interpret: impl Fn(Value) -> Result<A, Problem> + Send + Sync + 'static,
    ) -> Self {
        Self { purpose, shown, question, interpret: Box::new(interpret) }
    }

    /// Reads a response to the question.
    ///
    /// # Errors
    /// The problem with the response.
    pub fn read(&self, response: &str) -> Result<A, Problem> {
        let value = self.question.schema.check(response).map_err(|problem| Problem::invalid(problem.to_string()))?;
        (self.interpret)(value)
    }
}

impl<A> AnyWholeQuestion for WholeQuestion<A> {
    fn purpose(&self) -> Purpose {
        self.purpose
    }

    fn shown(&self) -> &ShownSubject {
        &self.shown
    }

    fn question(&self) -> &Question {
        &self.question
    }

    fn check(&self, response: &str) -> Result<(), Problem> {
        self.read(response).map(drop)
    }
}

impl<A> std::fmt::Debug for WholeQuestion<A> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WholeQuestion").field("purpose", &self.purpose).field("shown", &self.shown).finish()
    }
}

impl<A> WholeOutcome<A> {
    /// The answer, if there is one.
    pub fn answered(&self) -> Option<&A> {
        match self {
            Self::Answered(answer) => Some(answer),
            Self::Failed(_) => None,
        }
    }
}
