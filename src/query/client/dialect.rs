//! The form of a request: as strict as the server accepts.
//!
//! Structured answers are asked for in three ways, one after the other: with a JSON schema that the server enforces
//! (OpenAI, vLLM, recent Ollama and llama.cpp), as any JSON object (DashScope, older servers), or only in the prompt's
//! text. Whatever the server promises, the answer is checked here.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::fields::Fields;
use crate::query::ask::asker::Request;

/// What all requests have in common.
#[derive(Debug)]
pub struct Settings {
    pub model: String,
    pub temperature: f64,
    /// Most tokens of an answer, with those of the reasoning that leads to it.
    pub max_tokens: u32,
    pub fields: Fields,
}

/// The features of the API that a server accepts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Dialect {
    format: Format,
    limit: Limit,
    temperature: Temperature,
    detail: Detail,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Format {
    #[default]
    JsonSchema,
    JsonObject,
    Text,
}

/// The fields that limit an answer's tokens. By itself, `max_tokens` leaves reasoning unlimited at some servers
/// (Volcengine), and `max_completion_tokens` is unknown to others, which then set no limit (llama-cpp-python, older
/// llama.cpp).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Limit {
    #[default]
    Both,
    /// OpenAI and Volcengine refuse both together, and OpenAI's reasoning models refuse `max_tokens`.
    MaxCompletionTokens,
    /// Some servers refuse every field that they do not know (Mistral).
    MaxTokens,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Temperature {
    #[default]
    Sent,
    /// OpenAI's reasoning models accept no temperature.
    Unsent,
}

/// OpenAI's option for the resolution of a picture. Most other servers ignore it, a few refuse it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Detail {
    #[default]
    High,
    Unsent,
}

/// How many plainer formats there are than the first.
pub const PLAINER_FORMATS: usize = 2;
/// The most requests that find out which other parameters are refused: two names of the limit, the second of which is tried with
/// every format again, the temperature, the detail.
pub const OTHER_PARAMETERS: usize = 6;

/// DashScope refuses `json_object` unless this word is somewhere in the messages.
const JSON: &str = "JSON";
const SAY_JSON: &str = "Answer in JSON.";

impl Dialect {
    /// How it asks for a structured answer, for people.
    pub fn format(self) -> &'static str {
        match self.format {
            Format::JsonSchema => "with a JSON schema",
            Format::JsonObject => "as any JSON object",
            Format::Text => "as JSON, in the prompt alone",
        }
    }

    /// The strictest form that the server at `host` may accept: OpenAI and Azure are known not to take both limits.
    pub fn of_host(host: &str) -> Self {
        let is_openai = host == "api.openai.com" || host.ends_with(".openai.azure.com");
        let limit = if is_openai { Limit::MaxCompletionTokens } else { Limit::Both };
        Self { limit, ..Self::default() }
    }

    /// What is sent for the request. The text comes before the picture: it is the same for all subjects, and servers that cache
    /// the beginning of earlier requests process it once.
    pub fn payload(self, settings: &Settings, request: Request) -> Value {
        let Settings { model, temperature, max_tokens, fields } = settings;
        let picture = format!("data:image/jpeg;base64,{}", STANDARD.encode(request.picture));
        let mut content = vec![json!({ "type": "text", "text": request.question.prompt })];
        if self.format == Format::JsonObject && !request.question.prompt.contains(JSON) {
            content.push(json!({ "type": "text", "text": SAY_JSON }));
        }
        let mut image_url = json!({ "url": picture });
        if self.detail == Detail::High {
            image_url["detail"] = json!("high");
        }
        content.push(json!({ "type": "image_url", "image_url": image_url }));
        let mut messages = vec![json!({ "role": "user", "content": content })];
        if let Some(correction) = request.correction {
            messages.push(json!({ "role": "assistant", "content": correction.response }));
            messages.push(json!({ "role": "user", "content": correction.prompt }));
        }
        let mut payload = json!({ "model": model, "messages": messages, "stream": false });
        if self.limit != Limit::MaxCompletionTokens {
            payload["max_tokens"] = json!(max_tokens);
        }
        if self.limit != Limit::MaxTokens {
            payload["max_completion_tokens"] = json!(max_tokens);
        }
        if self.temperature == Temperature::Sent {
            payload["temperature"] = json!(temperature);
        }
        match self.format {
            Format::JsonSchema => {
                let schema = json!({ "name": "answer", "strict": true, "schema": request.question.schema.value() });
                payload["response_format"] = json!({ "type": "json_schema", "json_schema": schema });
            }
            Format::JsonObject => payload["response_format"] = json!({ "type": "json_object" }),
            Format::Text => {}
        }
        fields.add_to(&mut payload);
        payload
    }

    /// The next plainer dialect after a server refused this one with `message`; `None` if there is none.
    pub fn after_refusal(self, message: &str) -> Option<Self> {
        let message = message.to_lowercase();
        if self.limit == Limit::Both && message.contains("max_tokens") {
            return Some(Self { limit: Limit::MaxCompletionTokens, ..self });
        }
        if self.limit != Limit::MaxTokens && message.contains("max_completion_tokens") {
            return Some(Self { limit: Limit::MaxTokens, ..self });
        }
        if self.temperature == Temperature::Sent && message.contains("temperature") {
            return Some(Self { temperature: Temperature::Unsent, ..self });
        }
        if self.detail == Detail::High && message.contains("detail") {
            return Some(Self { detail: Detail::Unsent, ..self });
        }
        // A server that does not say what it refuses may know only one of the limits.
        let one_limit = || Self { limit: Limit::MaxTokens, format: Format::default(), ..self };
        self.plainer().or_else(|| (self.limit == Limit::Both).then(one_limit))
    }

    /// The next plainer way to ask for a structured answer; `None` if there is none.
    pub fn plainer(self) -> Option<Self> {
        let format = match self.format {
            Format::JsonSchema => Format::JsonObject,
            Format::JsonObject => Format::Text,
            Format::Text => return None,
        };
        Some(Self { format, ..self })
    }
}
