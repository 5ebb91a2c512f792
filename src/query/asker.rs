//! Who answers questions: the client of a server, or in a test whoever plays it.

use super::cost::Cost;
use super::ledger::{Account, NotSent};
use super::question::Question;
use super::recorded::{Answerer, Usage};
use crate::setup::Offline;

/// A picture with a question.
#[derive(Debug, Clone, Copy)]
pub struct Ask<'a> {
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

/// What came back.
#[derive(Debug, Clone, PartialEq)]
pub struct Reply {
    pub content: ReplyContent,
    /// `None` where the server does not count, or not credibly.
    pub usage: Option<Usage>,
    /// The name that the server gives its model.
    pub served_model: Option<String>,
}

/// What a model replies to a question.
#[derive(Debug, Clone, PartialEq)]
pub enum ReplyContent {
    Text(String),
    /// It would not answer; why.
    Refusal(String),
    /// It used up its tokens without a word; in which way.
    Empty(String),
}

/// Why nothing came back.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AskError {
    /// This request failed, also when repeated; another may not.
    #[error("{0}")]
    Failed(String),
    /// No request can succeed: wrong key, no such model, nobody there.
    #[error("{0}")]
    Fatal(String),
    /// The ledger lets no further request be sent.
    #[error(transparent)]
    NotSent(#[from] NotSent),
    /// No connection may be opened.
    #[error(transparent)]
    Offline(#[from] Offline),
}

/// Answers one question at a time; called from several threads at once.
pub trait Asker: Sync {
    /// Under which name and settings answers are recorded.
    fn answerer(&self) -> &Answerer;

    /// How many questions may be under way at once.
    fn parallel(&self) -> usize;

    /// Whether anything can be asked at all.
    ///
    /// # Errors
    /// It cannot, and trying would be in vain.
    fn ready(&self) -> Result<(), AskError> {
        Ok(())
    }

    /// Tells the user, before the first request of a run, who is sent how many pictures at which cost.
    fn announce(&self, _pictures: usize, _cost: &Cost) {}

    /// Waits for the answer. Every request has its own entry in the account.
    fn ask(&self, ask: Ask, account: &Account) -> Result<Reply, AskError>;
}
