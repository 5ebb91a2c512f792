//! The user's options for the questions.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use http::HeaderName;
use http::header::{CONTENT_LENGTH, CONTENT_TYPE, HOST};
use serde::{Deserialize, Serialize};

use crate::config::SceneKey;
use crate::config::option_values::{self, Domain, OptionError, from_to};
use crate::query::answer::labels::LabelSet;
use crate::query::ask::cost::UsdPerMtok;
pub use crate::query::question::sheet::Context;

/// Longest side of a sheet in pixels: three 512-pixel panels in a row, the tile size that vision models bill by.
const SHEET_SIZE: u32 = 1536;
/// The environment variable in which programs look for the key of a server with OpenAI's API.
pub const KEY_VARIABLE: &str = "OPENAI_API_KEY";
/// Tokens an answer may take: that about a part needs about 370, that about an object 300 to 2,500, depending on its pieces; the
/// rest is room for models that think aloud.
const MAX_TOKENS: u32 = 4000;
const PARALLEL: usize = 4;
/// A page of them is answered by hand in five minutes.
const MAX_QUESTIONS: usize = 8;
/// More parts than any object has.
const QUESTIONS: Domain<usize> = from_to(0, 1000);
const TIMEOUT_S: u64 = 120;
/// A server that asks for a longer wait is as good as down.
const WAIT_S: u64 = 300;
/// One day: a larger value is a mistake.
const MOST_S: u64 = 86_400;
const TIMEOUT: Domain<u64> = from_to(1, MOST_S);
const WAIT: Domain<u64> = from_to(0, MOST_S);
const RETRIES: u32 = 6;
/// The highest temperature that OpenAI's API takes; others take less.
const TEMPERATURE: Domain<f64> = from_to(0.0, 2.0);
/// No model writes this much at once.
const TOKENS: Domain<u32> = from_to(1, 1_000_000);
/// Each parallel request takes a thread and a connection.
const REQUESTS: Domain<usize> = from_to(1, 256);
/// With the pauses between them, this many retries take more than an hour.
const TRIES: Domain<u32> = from_to(0, 100);
const USD: Domain<f64> = from_to(0.0, f64::MAX);
/// Sides of a sheet in pixels.
const SIDE: Domain<u32> = from_to(256, 8192);

/// The keys that a scene may set: those that define what is asked about it, on which its recordings depend. Whether
/// anything is sent, to whom, with which prompts, at what cost, and where answers are written, is up to the user.
pub const SCENE_KEYS: &[SceneKey] = &[
    SceneKey::any("guidance"),
    SceneKey::any("context"),
    SceneKey::name_or_path("labels", LabelSet::is_name),
    SceneKey::any("sheet-size"),
];

/// Where answers come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum AnswerSource {
    /// From recordings only; a missing answer is an error.
    Replay,
    /// From recordings only; a part without an answer counts like those beside it, and the report says which do.
    Partial,
    /// From recordings; missing answers are requested and recorded.
    #[default]
    Record,
    /// Always requested, even if recorded; the new answers are recorded.
    Live,
}

impl AnswerSource {
    /// Whether a server may be asked.
    pub fn may_ask(self) -> bool {
        matches!(self, Self::Record | Self::Live)
    }
}

/// How a part or segment is asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Guidance {
    /// One question that goes step by step, as in the paper: caption, material out of all candidates, numbers.
    #[default]
    OneQuestion,
    /// Two shorter questions, which are gprop's own: the family, then a material of that family with its numbers.
    FamilyFirst,
}

/// What the model is told besides what pictures show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Hints {
    /// The outer size of the object, if it is known.
    #[default]
    None,
    /// Also what the author of a mesh called its materials and shapes, in the question about the whole object.
    Names,
}

/// Options of the questions to the large multimodal model.
#[derive(Debug, Clone, Args, Serialize, Deserialize)]
#[serde(default)]
#[command(next_help_heading = "Questions")]
pub struct Options {
    /// Where answers come from; nothing is sent without --lmm-url
    #[arg(long, value_enum, default_value_t)]
    pub answers: AnswerSource,

    /// How to ask about a part: in one question, or in two shorter ones
    #[arg(long, value_enum, default_value_t)]
    pub guidance: Guidance,

    /// Content of the picture: the object and the part in it (as in the paper), or the part alone (the paper's ablation)
    #[arg(long, value_enum, default_value_t)]
    pub context: Context,

    /// What the question about the whole object may tell besides its pictures
    #[arg(long, value_enum, default_value_t)]
    pub hints: Hints,

    /// Most questions about single parts that may follow the one about the object
    #[arg(long, value_name = "N", default_value_t = MAX_QUESTIONS, value_parser = QUESTIONS)]
    pub max_questions: usize,

    /// Materials to choose from: those that match a label of ABO's or MVImgNet's evaluation, or those that a text file
    /// names, one material, family or label per line [default: the whole library]
    #[arg(long, value_name = "abo|mvimgnet|FILE", value_parser = LabelSet::parse)]
    pub labels: Option<LabelSet>,

    /// Longest side of the picture sent with a question, in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = SHEET_SIZE)]
    #[arg(value_parser = SIDE)]
    pub sheet_size: u32,

    /// Folder with prompt templates and schemas that replace built-in ones of the same name
    #[arg(long, value_name = "DIR", value_parser = option_values::folder())]
    pub prompts: Option<PathBuf>,

    /// Folder to write new recordings to and to read recordings from [default: the scene's recorded/]
    #[arg(long, value_name = "DIR", value_parser = option_values::new_folder())]
    pub recordings: Option<PathBuf>,

    /// Base URL of an OpenAI-compatible server, such as http://localhost:11434/v1; docs/models.md has more
    #[arg(long, value_name = "URL")]
    #[serde(skip)]
    pub lmm_url: Option<String>,

    /// Name of the model on that server; without --lmm-url, use only recordings of this model and of people
    #[arg(long, value_name = "NAME")]
    pub lmm_model: Option<String>,

    /// Environment variable that holds the key of that server [default: OPENAI_API_KEY]
    #[arg(long, value_name = "VARIABLE")]
    #[serde(skip)]
    pub lmm_key_env: Option<String>,

    /// Header in which the key is sent by itself, such as api-key [default: Authorization, after the word Bearer]
    #[arg(long, value_name = "HEADER", value_parser = header)]
    #[serde(skip)]
    pub lmm_key_header: Option<HeaderName>,

    /// Sampling temperature; 0 is the most deterministic
    #[arg(long, value_name = "T", default_value_t = 0.0, value_parser = TEMPERATURE)]
    pub lmm_temperature: f64,

    /// Maximum number of tokens per answer, including those of the model's reasoning
    #[arg(long, value_name = "N", default_value_t = MAX_TOKENS, value_parser = TOKENS)]
    pub lmm_max_tokens: u32,

    /// JSON file with fields to add to every request, such as {"think": false} or {"reasoning_effort": "low"}
    #[arg(long, value_name = "FILE", value_parser = option_values::file())]
    pub lmm_body: Option<PathBuf>,

    /// Number of parallel requests
    #[arg(long, value_name = "N", default_value_t = PARALLEL, value_parser = REQUESTS)]
    #[serde(skip)]
    pub lmm_parallel: usize,

    /// Seconds that one request may take, from connecting to the last byte of its response
    #[arg(long, value_name = "SECONDS", default_value_t = TIMEOUT_S, value_parser = TIMEOUT)]
    #[serde(skip)]
    pub lmm_timeout_s: u64,

    /// Total seconds that a request may wait if the server asks it to (Retry-After); the request fails if the server asks
    /// for more
    #[arg(long, value_name = "SECONDS", default_value_t = WAIT_S, value_parser = WAIT)]
    #[serde(skip)]
    pub lmm_wait_s: u64,

    /// Number of retries after a dropped connection, a time-out, or status 408, 409, 425, 429 or 5xx
    #[arg(long, value_name = "N", default_value_t = RETRIES, value_parser = TRIES)]
    #[serde(skip)]
    pub lmm_retries: u32,

    /// Stop before the bill could exceed this many US dollars (in a batch, an equal share for each scene); failed requests
    /// count if they may have been billed
    #[arg(long, value_name = "USD", allow_negative_numbers = true, value_parser = usd)]
    #[serde(skip)]
    pub max_usd: Option<f64>,

    /// Price of the model in US dollars per million tokens, read and written: 0 if it costs nothing, or two numbers, such as
    /// 0.30,2.50 [default: that of the price table; nothing for a model on this machine that the table does not have]
    #[arg(long, value_name = "USD[,USD]", value_parser = UsdPerMtok::parse)]
    #[serde(skip)]
    pub price: Option<UsdPerMtok>,

    /// Price table that replaces the built-in one (CSV with the columns of prompts/prices.csv)
    #[arg(long, value_name = "FILE", value_parser = option_values::file())]
    #[serde(skip)]
    pub prices: Option<PathBuf>,
}

impl Options {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        QUESTIONS.check("--max-questions", self.max_questions)?;
        SIDE.check("--sheet-size", self.sheet_size)?;
        TEMPERATURE.check("--lmm-temperature", self.lmm_temperature)?;
        TOKENS.check("--lmm-max-tokens", self.lmm_max_tokens)?;
        REQUESTS.check("--lmm-parallel", self.lmm_parallel)?;
        TIMEOUT.check("--lmm-timeout-s", self.lmm_timeout_s)?;
        WAIT.check("--lmm-wait-s", self.lmm_wait_s)?;
        TRIES.check("--lmm-retries", self.lmm_retries)?;
        USD.check("--max-usd", self.max_usd)
    }
}

impl Default for Options {
    fn default() -> Self {
        option_values::defaults()
    }
}

impl Options {
    /// The name of the environment variable that holds the server's key.
    pub fn key_variable(&self) -> &str {
        self.lmm_key_env.as_deref().unwrap_or(KEY_VARIABLE)
    }
}

fn header(text: &str) -> Result<HeaderName, String> {
    let name = text.parse().map_err(|_| "not the name of a header, such as api-key".to_owned())?;
    if [CONTENT_LENGTH, CONTENT_TYPE, HOST].contains(&name) {
        return Err("this header has a meaning of its own; give that in which the server expects its key".to_owned());
    }
    Ok(name)
}

fn usd(text: &str) -> Result<f64, String> {
    let given = text.parse().ok().filter(|usd| USD.contains(*usd));
    given.ok_or_else(|| "not an amount of US dollars; give 0 or more, such as 2 or 0.50".to_owned())
}
