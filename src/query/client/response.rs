//! The meaning of a response: an answer, a refusal, or a failure that is transient or final.

use reqwest::header::HeaderMap;
use reqwest::{Response, StatusCode};
use serde_json::Value;

use super::body::{documents, is_error, sentence};
use super::completion::Completion;
use super::connection::Route;
use super::retry::Attempt;
use super::wait;
use crate::files::json;
use crate::query::ask::asker::{AskError, Reply, ReplyContent};
use crate::query::recorded::Usage;

/// The longest excerpt of a server's error text that is shown, in characters.
const MESSAGE_CHARACTERS: usize = 300;

/// A whole response, without the key.
pub struct Received {
    pub status: StatusCode,
    pub headers: HeaderMap,
    pub body: String,
}

/// Reads the response to one question. `fits` is true for a text that answers it.
pub fn read(received: &Received, fits: impl Fn(&str) -> bool) -> Result<Reply, Attempt> {
    let Received { status, body, .. } = received;
    if *status == StatusCode::BAD_REQUEST && is_about(body, &["content_policy", "content_filter", "safety_violation"]) {
        let no_tokens = Some(Usage::default());
        return Ok(Reply { content: ReplyContent::Refusal(message(body)), usage: no_tokens, served_model: None });
    }
    if !status.is_success() {
        return Err(failure(received));
    }
    let documents = documents(body);
    let reply = Completion::of(&documents).map(|completion| completion.reply(&fits));
    let error = documents.iter().find_map(error_in);
    match (reply, error) {
        (Some(reply), None) => Ok(reply),
        // An answer is an answer, whatever the server reports after it.
        (Some(reply), Some(_)) if matches!(&reply.content, ReplyContent::Text(text) if fits(text)) => Ok(reply),
        (_, Some(error)) => Err(reported(received, error)),
        (None, None) => Err(Attempt::Unreadable { message: no_completion(body, &documents) }),
    }
}

/// The error that a document reports in the place of an answer.
fn error_in(document: &Value) -> Option<&Value> {
    let of_choice = &document["choices"][0]["error"];
    if is_error(document) || document["error"].is_object() {
        return Some(document);
    }
    of_choice.is_object().then_some(of_choice)
}

/// The failure that a server reports with a status of success. OpenRouter names the status that it would have.
fn reported(received: &Received, error: &Value) -> Attempt {
    let code = error["code"].as_u64().or_else(|| error["error"]["code"].as_u64());
    let status = code.and_then(|code| StatusCode::from_u16(u16::try_from(code).ok()?).ok());
    let Received { headers, .. } = received;
    let body = error.to_string();
    match status.filter(|status| status.as_u16() >= 400) {
        Some(status) => failure(&Received { status, headers: headers.clone(), body }),
        None => Attempt::Passing {
            message: format!("the server reports: {}", message(&body)),
            retry_after: wait::asked(received.status, headers, &body),
        },
    }
}

fn no_completion(body: &str, documents: &[Value]) -> String {
    let found = match documents {
        [] if body.trim().is_empty() => "it is empty".to_owned(),
        [] => match json::read::<Value>(body.as_bytes()) {
            Err(error) => error.to_string(),
            Ok(_) => "it is an empty list".to_owned(),
        },
        _ => "it contains no choices".to_owned(),
    };
    format!("the response is not a chat completion ({found}); does --lmm-url end in /v1?")
}

/// The body of a response, of at most `most_bytes`.
pub async fn body(response: &mut Response, most_bytes: usize, route: &Route) -> Result<Vec<u8>, Attempt> {
    let too_long = || {
        let message = format!("the server's response is longer than {} MB and was not read", most_bytes / 1_000_000);
        Attempt::Final(AskError::Failed(message))
    };
    if response.content_length().is_some_and(|length| length > most_bytes as u64) {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    while let Some(chunk) = response.chunk().await.map_err(|error| route.failure(&error))? {
        if bytes.len() + chunk.len() > most_bytes {
            return Err(too_long());
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes)
}

/// The failure that an unsuccessful status stands for.
pub fn failure(received: &Received) -> Attempt {
    let Received { status, headers, body } = received;
    let message = format!("status {}: {}", status.as_u16(), message(body));
    match status.as_u16() {
        401 | 403 => Attempt::KeyRefused { message },
        402 => Attempt::Final(AskError::Fatal(message)),
        404 => Attempt::Final(AskError::Fatal(format!("{message}; check --lmm-url and --lmm-model"))),
        429 if is_about(body, &["insufficient_quota", "billing_hard_limit"]) => {
            Attempt::Final(AskError::Fatal(message))
        }
        429 if wait::is_per_day(body) => Attempt::Final(AskError::Fatal(format!(
            "{message}; a quota per day is used up: run the same command again when the server renews it"
        ))),
        // Sent by llama.cpp and its relatives for a schema that they cannot turn into a grammar.
        500 if is_about(body, &["response_format", "json_schema", "grammar"]) => Attempt::Unaccepted { message },
        400 | 415 | 422 | 501 => Attempt::Unaccepted { message },
        408 | 409 | 425 | 429 | 500.. => Attempt::Passing { message, retry_after: wait::asked(*status, headers, body) },
        300..400 => {
            Attempt::Final(AskError::Fatal(format!("{message}; the server redirects elsewhere; check --lmm-url")))
        }
        _ => Attempt::Final(AskError::Failed(message)),
    }
}

fn is_about(body: &str, words: &[&str]) -> bool {
    words.iter().any(|word| body.contains(word))
}

fn message(body: &str) -> String {
    let sentence = sentence(body).unwrap_or_else(|| "no explanation".into());
    sentence.chars().take(MESSAGE_CHARACTERS).collect()
}
