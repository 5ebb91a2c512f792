//! Who answers questions: the client of a server, or in a test whoever plays it.

use super::question::Question;
use super::recorded::{Answerer, Usage};

/// A picture with a question.
#[derive(Debug, Clone, Copy)]
pub struct Ask<'a> {
    pub question: &'a Question,
    /// JPEG.
    pub picture: &'a [u8],
    /// Set when an earlier response could not be used.
    pub correction: Option<Correction<'a>>,
}

/// A response that could not be used, and what is said to it.
#[derive(Debug, Clone, Copy)]
pub struct Correction<'a> {
    pub response: &'a str,
    pub prompt: &'a str,
}

/// What came back, and was paid for.
#[derive(Debug, Clone, PartialEq)]
pub struct Reply {
    pub said: Said,
    /// `None` where the server does not count.
    pub usage: Option<Usage>,
    /// The name that the server gives its model.
    pub served_model: Option<String>,
}

/// What a model says to a question.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    Text(String),
    /// It would not answer; why.
    Refusal(String),
    /// It used up its tokens without a word; in which way.
    Nothing(String),
}

/// Why nothing came back.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AskError {
    /// This request failed, also when repeated; another may not.
    #[error("{0}")]
    Failed(String),
    /// No request can succeed: wrong key, no such model, nobody there.
    #[error("{0}")]
    Hopeless(String),
}

/// Answers one question at a time; called from several threads at once.
pub trait Asker: Sync {
    /// Under which name and settings answers are recorded.
    fn answerer(&self) -> &Answerer;

    /// How many questions may be under way at once.
    fn parallel(&self) -> usize;

    /// Waits for the answer.
    fn ask(&self, ask: Ask) -> Result<Reply, AskError>;
}
