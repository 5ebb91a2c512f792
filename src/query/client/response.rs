//! The meaning of a response: an answer, a refusal, or a failure that is transient or final.

use std::time::Duration;

use reqwest::{Response, StatusCode};
use serde::Deserialize;
use serde_json::Value;

use super::retry::Attempt;
use crate::query::ask::asker::{AskError, Reply, ReplyContent};
use crate::query::recorded::Usage;

/// Only the answer itself must have the API's form: it was paid for, whatever else the server writes.
#[derive(Deserialize)]
struct Completion {
    model: Option<Value>,
    choices: Vec<Choice>,
    usage: Option<Value>,
}

#[derive(Deserialize)]
struct Choice {
    message: Message,
    finish_reason: Option<Value>,
}

#[derive(Deserialize)]
struct Message {
    content: Option<Value>,
    refusal: Option<Value>,
}

/// More tokens than any model reads or writes in one request (the longest contexts are of 10 million): not a credible
/// count.
const MOST_TOKENS: u64 = 10_000_000;

/// The longest excerpt of a server's error text that is shown, in characters.
const MESSAGE_CHARACTERS: usize = 300;

/// Reads the response to one question with its status.
pub fn read(status: StatusCode, body: &str, retry_after: Option<Duration>) -> Result<Reply, Attempt> {
    if status == StatusCode::BAD_REQUEST && is_about(body, &["content_policy", "content_filter", "safety_violation"]) {
        let no_tokens = Some(Usage::default());
        return Ok(Reply { content: ReplyContent::Refusal(message(body)), usage: no_tokens, served_model: None });
    }
    if !status.is_success() {
        return Err(failure(status, body, retry_after));
    }
    match serde_json::from_str::<Completion>(body) {
        Ok(completion) => answer(completion),
        Err(_) if error_text(body).is_some() => {
            Err(Attempt::Passing { message: format!("the server reports: {}", message(body)), retry_after })
        }
        Err(error) => Err(Attempt::Passing {
            message: format!("the response is not a chat completion ({error}); does --lmm-url end in /v1?"),
            retry_after,
        }),
    }
}

/// The body of a response, of at most `most_bytes`.
pub async fn body(response: &mut Response, most_bytes: usize) -> Result<Vec<u8>, Attempt> {
    let too_long = || {
        let message = format!("the server's response is longer than {} MB and was not read", most_bytes / 1_000_000);
        Attempt::Final(AskError::Failed(message))
    };
    if response.content_length().is_some_and(|length| length > most_bytes as u64) {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    while let Some(chunk) = response.chunk().await.map_err(transport)? {
        if bytes.len() + chunk.len() > most_bytes {
            return Err(too_long());
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes)
}

/// The failure of a request that got no complete response.
pub fn transport(error: reqwest::Error) -> Attempt {
    let unreachable = error.is_connect();
    let timed_out = error.is_timeout();
    let mut message = error.without_url().to_string();
    if timed_out && !unreachable {
        message = format!("no response in time ({message}); raise --lmm-timeout-s to wait longer");
    }
    if unreachable {
        return Attempt::Unreachable { message: format!("cannot connect to --lmm-url: {message}") };
    }
    Attempt::Passing { message: format!("the connection failed: {message}"), retry_after: None }
}

fn answer(completion: Completion) -> Result<Reply, Attempt> {
    let Some(choice) = completion.choices.into_iter().next() else {
        return Err(Attempt::Passing { message: "the response contains no choices".into(), retry_after: None });
    };
    let reason = choice.finish_reason.as_ref().and_then(Value::as_str).unwrap_or("none given");
    let text = choice.message.content.map(text_of).unwrap_or_default();
    let content = if let Some(refusal) = choice.message.refusal.map(text_of).filter(|refusal| !refusal.is_empty()) {
        ReplyContent::Refusal(refusal)
    } else if reason == "content_filter" {
        ReplyContent::Refusal("the server's content filter stopped the answer".into())
    } else if text.trim().is_empty() {
        ReplyContent::Empty(format!(
            "the answer is empty (finish reason: {reason}); raise --lmm-max-tokens for a model that reasons at length"
        ))
    } else {
        ReplyContent::Text(text)
    };
    let served_model = completion.model.as_ref().and_then(Value::as_str).map(str::to_owned);
    Ok(Reply { content, usage: completion.usage.as_ref().and_then(usage), served_model })
}

/// The tokens that a server reports; `None` if these are not credible counts.
fn usage(counted: &Value) -> Option<Usage> {
    let tokens = |name| counted.get(name)?.as_u64().filter(|tokens| *tokens <= MOST_TOKENS);
    Some(Usage { input_tokens: tokens("prompt_tokens")?, output_tokens: tokens("completion_tokens")? })
}

/// The text of a message: a string, or a list of parts as some servers send it.
fn text_of(content: Value) -> String {
    match content {
        Value::String(text) => text,
        Value::Array(parts) => parts.iter().filter_map(|part| part["text"].as_str()).collect(),
        _ => String::new(),
    }
}

/// The failure that an unsuccessful status stands for.
pub fn failure(status: StatusCode, body: &str, retry_after: Option<Duration>) -> Attempt {
    let message = format!("status {}: {}", status.as_u16(), message(body));
    match status.as_u16() {
        401 | 403 => Attempt::Final(AskError::Fatal(format!("{message}; set OPENAI_API_KEY to a key for this server"))),
        402 => Attempt::Final(AskError::Fatal(message)),
        404 => Attempt::Final(AskError::Fatal(format!("{message}; check --lmm-url and --lmm-model"))),
        429 if is_about(body, &["insufficient_quota", "billing_hard_limit"]) => {
            Attempt::Final(AskError::Fatal(message))
        }
        // Sent by llama.cpp and its relatives for a schema that they cannot turn into a grammar.
        500 if is_about(body, &["response_format", "json_schema", "grammar"]) => Attempt::Unaccepted { message },
        400 | 415 | 422 | 501 => Attempt::Unaccepted { message },
        408 | 409 | 425 | 429 | 500.. => Attempt::Passing { message, retry_after },
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
    let text = error_text(body).unwrap_or_else(|| body.trim().to_owned());
    if text.is_empty() { "no explanation".into() } else { text.chars().take(MESSAGE_CHARACTERS).collect() }
}

/// The message of an error body, as OpenAI, Ollama and FastAPI servers write it.
fn error_text(body: &str) -> Option<String> {
    let body: Value = serde_json::from_str(body).ok()?;
    let error = body.get("error").or_else(|| body.get("detail")).or_else(|| body.get("message"))?;
    match error {
        Value::String(text) => Some(text.clone()),
        Value::Null => None,
        other => Some(other["message"].as_str().map_or_else(|| other.to_string(), str::to_owned)),
    }
}
