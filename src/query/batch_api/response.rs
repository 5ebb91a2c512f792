//! The lines of a job's output and error files.

use serde::Deserialize;
use serde_json::Value;

use crate::files::json;
use crate::query::ask::asker::{AskError, ReplyContent};
use crate::query::client::read_completion;
use crate::query::recorded::Usage;

/// A model's answer from a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Answered {
    pub text: String,
    pub served_model: Option<String>,
    pub usage: Option<Usage>,
}

#[derive(Deserialize)]
struct Line {
    custom_id: String,
    response: Option<Response>,
    error: Option<Problem>,
}

#[derive(Deserialize)]
struct Response {
    status_code: u16,
    body: Value,
}

#[derive(Deserialize)]
struct Problem {
    code: Option<String>,
    message: Option<String>,
}

/// Why a question of a job has no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotAnswered {
    /// The server's message, or a note that it gave none.
    #[error("{0}")]
    Server(String),
    #[error("{0}")]
    Response(#[from] AskError),
    #[error("refused: {0}")]
    Refused(String),
    #[error("{0}")]
    Empty(String),
}

/// A line's `custom_id` and the answer, or why there is none.
pub type AnswerLine = (String, Result<Answered, NotAnswered>);

/// The lines of a job's output or error file. `without_key` cuts the key out of a text.
///
/// # Errors
/// If a line does not have the form that the Batch API writes.
pub fn lines(text: &str, without_key: &dyn Fn(&str) -> String) -> Result<Vec<AnswerLine>, AskError> {
    (1..)
        .zip(text.lines())
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(number, line)| {
            let line: Line = json::read(line.as_bytes()).map_err(|error| {
                AskError::Failed(format!("line {number} of the job's file is not what the Batch API writes: {error}"))
            })?;
            Ok((line.custom_id, answer(line.response, line.error, without_key)))
        })
        .collect()
}

fn answer(
    response: Option<Response>,
    problem: Option<Problem>,
    without_key: &dyn Fn(&str) -> String,
) -> Result<Answered, NotAnswered> {
    let Some(response) = response else {
        let words = problem.map(|problem| [problem.code, problem.message]);
        let words: Vec<String> = words.into_iter().flatten().flatten().collect();
        let words = if words.is_empty() { "no reason given".to_owned() } else { words.join(": ") };
        return Err(NotAnswered::Server(without_key(&words)));
    };
    let reply = read_completion(response.status_code, &response.body.to_string());
    let reply = reply.map_err(|error| error.with_text(without_key))?.with_texts(without_key);
    match reply.content {
        ReplyContent::Text(text) => Ok(Answered { text, served_model: reply.served_model, usage: reply.usage }),
        ReplyContent::Refusal(why) => Err(NotAnswered::Refused(why)),
        ReplyContent::Empty(why) => Err(NotAnswered::Empty(why)),
    }
}
