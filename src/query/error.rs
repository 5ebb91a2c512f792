//! What can go wrong with the queries as a whole. What goes wrong with one part is a [`Failure`](super::Failure).

use std::path::PathBuf;

use super::prompt::PromptError;
use super::recorded::{Miss, RecordingError};

/// Why a stage of queries ends without answers.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    #[error("view {view}: the label map has no pixel of part {part}; segment the scene anew")]
    EmptyPart { view: String, part: u16 },
    #[error("view {view}: the label map is {map:?} pixels, the photo {photo:?}; segment the scene anew")]
    SizeMismatch { view: String, map: (u32, u32), photo: (u32, u32) },
    #[error(transparent)]
    Prompt(#[from] PromptError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(
        "no recorded answer for {} of {parts} parts: {}. Ask a model: --lmm-url URL --lmm-model NAME with the key in \
         OPENAI_API_KEY; or answer by hand or elsewhere: gprop query SCENE --export DIR, then --import DIR",
        .missing.len(), listed(.missing)
    )]
    Missing { parts: usize, missing: Vec<MissingPart> },
    #[error("--max-usd cannot be kept: no price is known for {model}; give a price table with --prices FILE")]
    NoPrice { model: String },
    #[error("{requests} requests would cost about {usd:.2} USD, more than --max-usd {max_usd}; nothing was sent")]
    OverBudget { requests: usize, usd: f64, max_usd: f64 },
    #[error(
        "--max-usd {max_usd} is reached: {spent_usd:.4} USD spent, {left} parts not asked; what was answered is \
         recorded. Raise --max-usd to go on"
    )]
    BudgetSpent { max_usd: f64, spent_usd: f64, left: usize },
    #[error("{message}; {left} parts are not answered, what was answered is recorded")]
    Endpoint { message: String, left: usize },
    #[error("{count} answers in {folder:?} cannot be used, the others are recorded:\n{lines}")]
    Import { folder: PathBuf, count: usize, lines: String },
    #[error("cannot save an answer: {0}")]
    Save(std::io::Error),
}

/// A part of which no answer is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingPart {
    pub view: String,
    pub part: u16,
    pub miss: Miss,
}

impl std::fmt::Display for MissingPart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "view {} part {} ({})", self.view, self.part, self.miss)
    }
}

/// As many as a person reads; the error's value has them all.
const LISTED: usize = 10;

fn listed(missing: &[MissingPart]) -> String {
    let mut words: Vec<String> = missing.iter().take(LISTED).map(MissingPart::to_string).collect();
    if missing.len() > LISTED {
        words.push(format!("and {} more", missing.len() - LISTED));
    }
    words.join(", ")
}
