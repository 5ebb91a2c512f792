//! The fields that `--lmm-body` adds to every request: what a server or model needs and gprop has no option for, such as
//! `think`, `reasoning_effort`, `chat_template_kwargs` or `num_ctx`.
//!
//! They change the answers, so they belong to the settings under which answers are recorded: as a hash, for a field may hold
//! something secret.

use std::path::Path;

use serde_json::{Map, Value};

use super::key::ApiKey;
use crate::files;
use crate::files::json;
use crate::query::recorded::sha256::Sha256Hex;

/// Fields of a request's body.
#[derive(Debug, Clone, Default)]
pub struct Fields(Map<String, Value>);

/// The fields that no file may set, each with what to do instead: they decide what is asked, what it may cost, or in which
/// form the answer comes.
const OF_GPROP: [(&str, &str); 11] = [
    ("model", "use --lmm-model"),
    ("messages", "use --prompts for other questions"),
    ("temperature", "use --lmm-temperature"),
    ("max_tokens", "use --lmm-max-tokens"),
    ("max_completion_tokens", "use --lmm-max-tokens"),
    ("max_output_tokens", "use --lmm-max-tokens"),
    ("n_predict", "use --lmm-max-tokens"),
    ("response_format", "gprop asks for the form that the server accepts"),
    ("stream", "gprop reads whole responses"),
    ("stream_options", "gprop reads whole responses"),
    ("n", "one answer to each question is enough"),
];

/// Why a file of fields cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FieldsProblem {
    #[error("it cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    #[error("it is not a JSON object, such as {{\"think\": false}}: {0}")]
    NoObject(#[from] serde_json::Error),
    #[error("{name:?} is set by gprop itself; leave it out: {instead}")]
    OfGprop { name: &'static str, instead: &'static str },
    #[error("it contains the server's key, which is sent in a header of its own; leave it out")]
    Key,
}

impl Fields {
    /// The fields in a JSON file.
    ///
    /// # Errors
    /// If it is not a JSON object, sets a field that gprop sets, or contains the key.
    pub fn read(path: &Path, key: Option<&ApiKey>) -> Result<Self, FieldsProblem> {
        let text = files::read_to_string(path)?;
        if key.is_some_and(|key| key.cut_from(&text) != text) {
            return Err(FieldsProblem::Key);
        }
        let fields: Map<String, Value> = json::read(text.as_bytes())?;
        match OF_GPROP.iter().find(|(name, _)| fields.contains_key(*name)) {
            Some(&(name, instead)) => Err(FieldsProblem::OfGprop { name, instead }),
            None => Ok(Self(fields)),
        }
    }

    /// Adds the fields to a request.
    pub fn add_to(&self, body: &mut Value) {
        self.0.iter().for_each(|(name, value)| body[name] = value.clone());
    }

    /// Adds the fields to the settings under which answers are recorded.
    pub fn note_in(&self, parameters: &mut Value) {
        if !self.0.is_empty() {
            parameters["body_sha256"] = Value::from(Sha256Hex::of(Value::from(self.0.clone()).to_string()).as_str());
        }
    }
}
