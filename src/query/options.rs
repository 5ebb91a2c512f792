//! What the user may set about the queries.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};

use super::labels::LabelSet;
pub use super::sheet::Context;

/// Longest side of a sheet in pixels: three 512-pixel panels in a row, the tile size that vision models bill by.
const SHEET_SIZE: u32 = 1536;
/// Tokens an answer may take: thirteen fields need about 250; the rest is room for models that think aloud.
const MAX_TOKENS: u32 = 2000;
const PARALLEL: usize = 4;
const TIMEOUT_S: u64 = 120;
const RETRIES: u32 = 6;

/// Where answers come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum AnswerSource {
    /// From recordings only; what is missing is an error.
    Replay,
    /// From recordings; what is missing is asked and recorded.
    #[default]
    Record,
    /// Asked anew, whatever is recorded, and recorded.
    Live,
}

/// How a part is asked about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Guidance {
    /// One request with every material of the library to choose from.
    #[default]
    Single,
    /// First the family, then a second request with that family's materials only.
    Gradual,
}

/// Options of the queries to the large multimodal model.
#[derive(Debug, Clone, Args, Serialize)]
#[command(next_help_heading = "Part queries")]
pub struct Options {
    /// Where answers come from; nothing is sent without --lmm-url
    #[arg(long, value_enum, default_value_t)]
    pub answers: AnswerSource,

    /// One request a part, or family first and then only that family's materials (two requests, fewer tokens)
    #[arg(long, value_enum, default_value_t)]
    pub guidance: Guidance,

    /// What the picture shows: object and part (the paper's way) or the part alone (its ablation)
    #[arg(long, value_enum, default_value_t)]
    pub context: Context,

    /// Materials to choose among: those that mean a label of ABO's or MVImgNet's evaluation, or those that a text file
    /// names, one a line (a material, a family or a label) [default: the whole library]
    #[arg(long, value_name = "abo|mvimgnet|FILE")]
    pub labels: Option<LabelSet>,

    /// Longest side of the picture sent for a part, in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = SHEET_SIZE)]
    #[arg(value_parser = clap::value_parser!(u32).range(256..=8192))]
    pub sheet_size: u32,

    /// Folder with prompt templates and schemas that replace the built-in ones of the same name
    #[arg(long, value_name = "DIR")]
    pub prompts: Option<PathBuf>,

    /// Folder where new recordings go and from which they are read too [default: the scene's recorded/]
    #[arg(long, value_name = "DIR")]
    pub recordings: Option<PathBuf>,

    /// Base URL of an OpenAI-compatible server, such as http://localhost:11434/v1; the key is read from OPENAI_API_KEY
    #[arg(long, value_name = "URL")]
    #[serde(skip)]
    pub lmm_url: Option<String>,

    /// Name of the model there; without --lmm-url, use recordings of this model only
    #[arg(long, value_name = "NAME")]
    pub lmm_model: Option<String>,

    /// Sampling temperature; 0 asks for the model's first choice
    #[arg(long, value_name = "T", default_value_t = 0.0)]
    pub lmm_temperature: f64,

    /// Most tokens an answer may take
    #[arg(long, value_name = "N", default_value_t = MAX_TOKENS)]
    pub lmm_max_tokens: u32,

    /// Requests under way at the same time
    #[arg(long, value_name = "N", default_value_t = PARALLEL)]
    #[serde(skip)]
    pub lmm_parallel: usize,

    /// Seconds to wait for one response
    #[arg(long, value_name = "SECONDS", default_value_t = TIMEOUT_S)]
    #[serde(skip)]
    pub lmm_timeout_s: u64,

    /// How often a request is repeated after a dropped connection, a time-out, or status 408, 409, 429 or 5xx
    #[arg(long, value_name = "N", default_value_t = RETRIES)]
    #[serde(skip)]
    pub lmm_retries: u32,

    /// Stop before the endpoint's bill may pass this many US dollars
    #[arg(long, value_name = "USD")]
    #[serde(skip)]
    pub max_usd: Option<f64>,

    /// Price table to use instead of the built-in one (CSV, columns as prompts/prices.csv)
    #[arg(long, value_name = "FILE")]
    #[serde(skip)]
    pub prices: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            answers: AnswerSource::default(),
            guidance: Guidance::default(),
            context: Context::default(),
            labels: None,
            sheet_size: SHEET_SIZE,
            prompts: None,
            recordings: None,
            lmm_url: None,
            lmm_model: None,
            lmm_temperature: 0.0,
            lmm_max_tokens: MAX_TOKENS,
            lmm_parallel: PARALLEL,
            lmm_timeout_s: TIMEOUT_S,
            lmm_retries: RETRIES,
            max_usd: None,
            prices: None,
        }
    }
}
