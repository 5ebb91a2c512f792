//! Recorded answers: one JSON file each, found by what was asked or, failing that, by view and mask.
//!
//! A recording's key is the SHA-256 of model, parameters, prompt, schema and the sheet's pixels before JPEG.
//! Floating-point differences between processors may move a mask by a few pixels, and with it the sheet. So a recording
//! also keeps the hash of its view's photo and the subject's mask, and if no key matches, the recording of the same
//! view, prompt, schema and model with the best mask overlap is used ([`MASK_IOU`]). A recording never contains an API
//! key or a header.

mod lock;
mod mask;
pub(in crate::query) mod sha256;
mod store;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::query::recorded::sha256::Sha256Hex;
pub use lock::QuestionLock;
pub use mask::Mask;
pub use store::{Miss, RecordingError, Recordings, Who};

/// Lowest overlap at which a recording of another mask is used. Below it, the mask may well be another subject's.
pub const MASK_IOU: f64 = 0.9;

/// A question, independent of who answers it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct QuestionId {
    /// Name of the view, for display.
    pub view: String,
    /// SHA-256 of the view's decoded photo, composited over white.
    pub photo_sha256: Sha256Hex,
    pub mask: Mask,
    /// SHA-256 of the prompt's text.
    pub prompt_sha256: Sha256Hex,
    /// SHA-256 of the schema's compact JSON.
    pub schema_sha256: Sha256Hex,
    /// SHA-256 of the sheet's pixels before JPEG.
    pub sheet_sha256: Sha256Hex,
}

impl QuestionId {
    /// Identifies the question, whoever answers it.
    pub fn content_sha256(&self) -> Sha256Hex {
        Sha256Hex::of_fields(&[
            self.prompt_sha256.as_str().as_bytes(),
            self.schema_sha256.as_str().as_bytes(),
            self.sheet_sha256.as_str().as_bytes(),
        ])
    }

    /// True if [`Self::content_sha256`] is the same. Compared without hashing: every question is looked for among all
    /// recordings.
    fn is_same_question(&self, other: &Self) -> bool {
        self.sheet_sha256 == other.sheet_sha256 && self.has_same_prompt(other)
    }

    /// True if prompt and schema are the same, whatever the picture.
    fn has_same_prompt(&self, other: &Self) -> bool {
        self.prompt_sha256 == other.prompt_sha256 && self.schema_sha256 == other.schema_sha256
    }
}

/// The model or person that answers, with its settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answerer {
    pub model: String,
    /// All settings that are sent and may change the answer, by name; null for answers that came by `--import`, unless a
    /// person gave them.
    pub parameters: Value,
}

/// The parameter of answers that a person gave.
const BY_HAND: &str = "by_hand";

impl Answerer {
    /// The person of this name.
    pub fn person(name: String) -> Self {
        Self { model: name, parameters: json!({ BY_HAND: true }) }
    }
}

/// Tokens that a request used, as the server reports them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Usage {
    pub input_tokens: u64,
    pub output_tokens: u64,
}

impl Usage {
    /// The sum of both.
    pub fn plus(self, other: Self) -> Self {
        Self {
            input_tokens: self.input_tokens.saturating_add(other.input_tokens),
            output_tokens: self.output_tokens.saturating_add(other.output_tokens),
        }
    }
}

/// One recorded answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    /// Version of this layout.
    pub format: u32,
    pub key: Sha256Hex,
    pub model: String,
    /// The name that the server gave its model, if any.
    pub served_model: Option<String>,
    pub parameters: Value,
    pub asked: QuestionId,
    /// The model's response, word for word.
    pub response: String,
    /// The sum over all requests that led to this answer.
    pub usage: Option<Usage>,
    /// Seconds since 1970-01-01 UTC.
    pub recorded_at_unix_s: u64,
}

/// Version of [`Recording`]'s layout.
pub const FORMAT: u32 = 1;

impl Recording {
    /// True if a person gave the answer.
    pub fn is_by_hand(&self) -> bool {
        self.parameters.get(BY_HAND) == Some(&Value::Bool(true))
    }

    /// A recording of `response` with the current time.
    pub fn new(
        answerer: &Answerer,
        asked: QuestionId,
        response: String,
        served_model: Option<String>,
        usage: Option<Usage>,
    ) -> Self {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        Self {
            format: FORMAT,
            key: key(answerer, &asked),
            model: answerer.model.clone(),
            served_model,
            parameters: answerer.parameters.clone(),
            asked,
            response,
            usage,
            recorded_at_unix_s: now.map_or(0, |elapsed| elapsed.as_secs()),
        }
    }
}

/// The key of an answer to `asked` by `answerer`.
pub fn key(answerer: &Answerer, asked: &QuestionId) -> Sha256Hex {
    Sha256Hex::of_fields(&[
        answerer.model.as_bytes(),
        answerer.parameters.to_string().as_bytes(),
        asked.prompt_sha256.as_str().as_bytes(),
        asked.schema_sha256.as_str().as_bytes(),
        asked.sheet_sha256.as_str().as_bytes(),
    ])
}
