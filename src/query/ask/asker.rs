//! The interface of whatever answers questions: the client of a server, or a stand-in in a test.

use super::budget::{Account, NotSent};
use super::cost::Cost;
use crate::query::question::Question;
use crate::query::recorded::{Answerer, Usage};
use crate::setup::Offline;

/// A question on its way to the model, with its picture.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    pub question: &'a Question,
    /// JPEG.
    pub picture: &'a [u8],
    /// Set when an earlier response could not be used.
    pub correction: Option<Correction<'a>>,
}

/// A response that could not be used, and the prompt to correct it.
#[derive(Debug, Clone, Copy)]
pub struct Correction<'a> {
    pub response: &'a str,
    pub prompt: &'a str,
}

/// The response to a question.
#[derive(Debug, Clone, PartialEq)]
pub struct Reply {
    pub content: ReplyContent,
    /// `None` if the server reports no usage or an implausible one.
    pub usage: Option<Usage>,
    /// The name that the server gives its model.
    pub served_model: Option<String>,
}

impl Reply {
    /// The reply with `edit` applied to every text of the server.
    pub fn with_texts(self, edit: impl Fn(&str) -> String) -> Self {
        let content = match self.content {
            ReplyContent::Text(text) => ReplyContent::Text(edit(&text)),
            ReplyContent::Refusal(text) => ReplyContent::Refusal(edit(&text)),
            ReplyContent::Empty(text) => ReplyContent::Empty(edit(&text)),
        };
        Self { content, served_model: self.served_model.as_deref().map(edit), ..self }
    }
}

/// A model's reply to a question.
#[derive(Debug, Clone, PartialEq)]
pub enum ReplyContent {
    Text(String),
    /// The model refused to answer, with its reason.
    Refusal(String),
    /// There is no answer in it; the text says why, and what helps.
    Empty(String),
}

/// Why there is no reply.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AskError {
    /// This request failed, even after retries; another may succeed.
    #[error("{0}")]
    Failed(String),
    /// No request can succeed: wrong key, unknown model, unreachable server.
    #[error("{0}")]
    Fatal(String),
    /// The budget does not permit another request.
    #[error(transparent)]
    NotSent(#[from] NotSent),
    /// No connection may be opened.
    #[error(transparent)]
    Offline(#[from] Offline),
}

impl AskError {
    /// The error with `edit` applied to the text of the server.
    pub fn with_text(self, edit: impl Fn(&str) -> String) -> Self {
        match self {
            Self::Failed(message) => Self::Failed(edit(&message)),
            Self::Fatal(message) => Self::Fatal(edit(&message)),
            error @ (Self::NotSent(_) | Self::Offline(_)) => error,
        }
    }
}

/// Answers one question at a time; called from several threads at once.
pub trait Asker: Sync {
    /// The name and settings under which answers are recorded.
    fn answerer(&self) -> &Answerer;

    /// How many questions may be in progress at the same time.
    fn parallel(&self) -> usize;

    /// Checks that questions can be asked at all.
    ///
    /// # Errors
    /// If they cannot, so that every request would fail.
    fn ready(&self) -> Result<(), AskError> {
        Ok(())
    }

    /// The most requests that this many questions may take, if replies have to be corrected or requests repeated.
    fn most_requests(&self, questions: usize) -> usize {
        2 * questions
    }

    /// Tells the user, before the first request of a round, where the pictures are sent, how many there are, how many
    /// requests there will be at most, and what they cost if each brings a usable reply.
    fn announce(&self, _pictures: usize, _most_requests: usize, _cost: &Cost) {}

    /// What was tried so far to get usable replies, for people.
    fn tried(&self) -> Vec<&'static str> {
        Vec::new()
    }

    /// Waits for the answer. Every request has its own entry in the account.
    fn ask(&self, request: Request, account: &Account) -> Result<Reply, AskError>;
}
