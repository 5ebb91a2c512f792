//! A chat completion: where servers put the answer, and what they say about it.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::query::ask::asker::{Reply, ReplyContent};
use crate::query::recorded::Usage;

/// More tokens than any model reads or writes in one request (the longest contexts are of 10 million): not a credible
/// count.
const MOST_TOKENS: u64 = 10_000_000;

/// The texts of a completion. Only the answer itself must have the API's form: it was paid for, whatever else the server
/// writes.
#[derive(Debug, Default)]
pub struct Completion {
    texts: Texts,
    finish_reason: Option<String>,
    usage: Option<Usage>,
    served_model: Option<String>,
}

/// The texts of a message, by their place in it.
#[derive(Debug, Default)]
struct Texts {
    content: String,
    /// Arguments of the calls of tools, by the number of the call.
    arguments: BTreeMap<u64, String>,
    reasoning_content: String,
    reasoning: String,
    refusal: String,
}

impl Completion {
    /// The completion in the documents of a body: one, or the chunks of a stream. `None` if there is no choice in them.
    pub fn of(documents: &[Value]) -> Option<Self> {
        let mut completion = Self::default();
        let mut is_there = false;
        for document in documents {
            let choice = &document["choices"][0];
            is_there |= choice.is_object();
            if choice["message"].is_object() {
                completion.texts = Texts::default();
            }
            [&choice["message"], &choice["delta"]].into_iter().for_each(|message| completion.texts.add(message));
            completion.texts.content += &text_of(&choice["text"]);
            let text = |value: &Value| value.as_str().map(str::to_owned);
            completion.finish_reason = text(&choice["finish_reason"]).or(completion.finish_reason);
            completion.served_model = completion.served_model.or_else(|| text(&document["model"]));
            completion.usage = usage(&document["usage"]).or(completion.usage);
        }
        is_there.then_some(completion)
    }

    /// The reply: the content, if there is JSON in it; otherwise a text that `fits` as an answer, wherever it stands.
    pub fn reply(self, fits: &impl Fn(&str) -> bool) -> Reply {
        let Self { texts, finish_reason, usage, served_model } = self;
        let reason = finish_reason.as_deref().unwrap_or("none given");
        let Texts { content, arguments, reasoning_content, reasoning, refusal } = texts;
        let elsewhere = arguments.into_values().chain([reasoning_content, reasoning]);
        let elsewhere: Vec<String> = elsewhere.filter(|text| !text.trim().is_empty()).collect();
        let content = if content.contains('{') && (fits(&content) || refusal.is_empty() && !is_filtered(reason)) {
            ReplyContent::Text(content)
        } else if let Some(answer) = elsewhere.iter().find(|text| fits(text)) {
            ReplyContent::Text(answer.clone())
        } else if !refusal.is_empty() {
            ReplyContent::Refusal(refusal)
        } else if is_filtered(reason) {
            ReplyContent::Refusal(format!("the server's content filter stopped the answer (finish reason: {reason})"))
        } else if content.trim().is_empty() {
            ReplyContent::Empty(why_empty(reason, !elsewhere.is_empty()))
        } else {
            ReplyContent::Text(content)
        };
        Reply { content, usage, served_model }
    }
}

impl Texts {
    fn add(&mut self, message: &Value) {
        self.content += &text_of(&message["content"]);
        self.reasoning_content += &text_of(&message["reasoning_content"]);
        self.reasoning += &text_of(&message["reasoning"]);
        self.refusal += &text_of(&message["refusal"]);
        // Mistral's models reason in parts of the content.
        let thoughts = message["content"].as_array().into_iter().flatten().filter(|part| is_thought(part));
        self.reasoning.extend(thoughts.map(|part| text_of(&part["thinking"]) + &text_of(&part["text"])));
        let calls = message["tool_calls"].as_array().into_iter().flatten();
        for (number, call) in (0..).zip(calls.chain([message])) {
            let function = call.get("function_call").unwrap_or(&call["function"]);
            let arguments = match &function["arguments"] {
                Value::String(text) => text.clone(),
                object @ Value::Object(_) => object.to_string(),
                _ => continue,
            };
            // Chunks of a stream number the call that they continue.
            *self.arguments.entry(call["index"].as_u64().unwrap_or(number)).or_default() += &arguments;
        }
    }
}

/// The text of a field: a string, or a list of parts as some servers send it. An object is the answer itself, already
/// decoded.
fn text_of(field: &Value) -> String {
    match field {
        Value::String(text) => text.clone(),
        Value::Array(parts) => {
            let spoken = parts.iter().filter(|part| !is_thought(part));
            spoken.filter_map(|part| part.as_str().or_else(|| part["text"].as_str())).collect()
        }
        object @ Value::Object(fields) => {
            fields.get("text").and_then(Value::as_str).map_or_else(|| object.to_string(), str::to_owned)
        }
        _ => String::new(),
    }
}

/// True for a part of a message that is reasoning.
fn is_thought(part: &Value) -> bool {
    matches!(part["type"].as_str(), Some("thinking" | "reasoning"))
}

fn is_filtered(finish_reason: &str) -> bool {
    matches!(finish_reason.to_lowercase().as_str(), "content_filter" | "safety" | "recitation" | "prohibited_content")
}

/// What an empty reply means and what helps, by its reason to end.
fn why_empty(finish_reason: &str, has_reasoned: bool) -> String {
    let advice = match finish_reason {
        "length" | "max_tokens" | "MAX_TOKENS" => {
            "the tokens were used up before the answer; raise --lmm-max-tokens for a model that reasons at length, or let it \
             reason less with --lmm-body"
        }
        "tool_calls" | "function_call" => {
            "the model calls a tool, with arguments that are not an answer; try another model"
        }
        _ if has_reasoned => {
            "the model reasons, but does not answer; switch its reasoning off with --lmm-body, or try another model"
        }
        _ => "the model writes nothing; it may not take pictures or JSON schemas; try another model",
    };
    format!("the answer is empty (finish reason: {finish_reason}): {advice}")
}

/// The tokens that a server reports; `None` if these are not credible counts.
fn usage(counted: &Value) -> Option<Usage> {
    let tokens = |name| counted.get(name)?.as_u64().filter(|tokens| *tokens <= MOST_TOKENS);
    Some(Usage { input_tokens: tokens("prompt_tokens")?, output_tokens: tokens("completion_tokens")? })
}
