//! What can go wrong with the queries as a whole. What goes wrong with one part is a [`super::Failure`].

use std::path::{Path, PathBuf};

use super::asker::AskError;
use super::ledger::Spent;
use super::prompt::PromptError;
use super::recorded::{Miss, RecordingError};
use super::{Answers, Failure, Outcome};

/// Why a stage of queries ends without answers.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    #[error("view {view}: the label map has no pixel of part {part}; segment the scene again")]
    EmptyPart { view: String, part: u16 },
    #[error("view {view}: the label map is {map:?} pixels, the photo {photo:?}; segment the scene again")]
    SizeMismatch { view: String, map: (u32, u32), photo: (u32, u32) },
    #[error(transparent)]
    Prompt(#[from] PromptError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(
        "no recorded answer for {} of {parts} parts:{}\nAsk a model: --lmm-url URL --lmm-model NAME with the key in \
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
    #[error("{error}: {parts} parts have no recorded answer, and no server was asked about them")]
    NotReady { error: AskError, parts: usize },
    #[error("{source}; nothing more was asked. {}", where_kept(.folder, .spare.as_deref()))]
    Unkept {
        source: RecordingError,
        /// Where recordings belong.
        folder: PathBuf,
        /// Where those are that could not be written there; `None` if their text was printed.
        spare: Option<PathBuf>,
    },
    #[error("{message}; {left} parts are not answered, what was answered is recorded ({spent})")]
    Endpoint { message: String, left: usize, spent: Spent },
    #[error("none of {parts} parts is answered: {}", counted(.failures))]
    AllFailed {
        parts: usize,
        /// Each failure with the number of parts that it holds for, the most frequent first.
        failures: Vec<(Failure, usize)>,
    },
    #[error(
        "a submission to the Batch API cannot be stopped, and at the longest answers its {requests} requests may cost \
         {usd:.4} USD more than --max-usd {max_usd} leaves after {spent}; nothing was submitted"
    )]
    SubmissionOverBudget { requests: usize, usd: f64, max_usd: f64, spent: Spent },
    #[error("the Batch API: {0}")]
    BatchApi(AskError),
    #[error("no Batch API job is waiting to be collected; gprop query SCENE --batch-api submit sends one")]
    NothingSubmitted,
    #[error(
        "Batch API jobs still running: {running}, with {done} of their {total} requests done; run --batch-api collect again \
         later"
    )]
    BatchApiRunning { running: usize, done: usize, total: usize },
    #[error(
        "{failed} of {total} questions were not answered, the other answers are recorded: {reasons}. --batch-api submit \
         asks them again"
    )]
    BatchApiPartial { failed: usize, total: usize, reasons: String },
    #[error("{count} answers in {folder:?} cannot be used, the others are recorded:\n{lines}")]
    Import { folder: PathBuf, count: usize, lines: String },
    #[error("cannot save an answer: {0}")]
    Save(std::io::Error),
}

impl From<AskError> for QueryError {
    fn from(error: AskError) -> Self {
        Self::BatchApi(error)
    }
}

/// A part of which no answer is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingPart {
    pub view: String,
    pub part: u16,
    pub miss: Miss,
}

impl Answers {
    /// Whether there is anything to go on with.
    ///
    /// # Errors
    /// [`QueryError::AllFailed`] where there are parts and none of them is answered.
    pub fn require_any(&self) -> Result<(), QueryError> {
        let mut failures: Vec<(Failure, usize)> = Vec::new();
        for part in &self.parts {
            let Outcome::Failed(failure) = &part.outcome else { return Ok(()) };
            match failures.iter_mut().find(|(known, _)| known == failure) {
                Some((_, parts)) => *parts += 1,
                None => failures.push((failure.clone(), 1)),
            }
        }
        if failures.is_empty() {
            return Ok(());
        }
        failures.sort_by_key(|(_, parts)| std::cmp::Reverse(*parts));
        Err(QueryError::AllFailed { parts: self.parts.len(), failures })
    }
}

/// As many failures as a person reads; the error's value has them all.
const SHOWN_FAILURES: usize = 3;

fn counted(failures: &[(Failure, usize)]) -> String {
    let mut words: Vec<String> =
        failures.iter().take(SHOWN_FAILURES).map(|(failure, parts)| format!("{failure} ({parts} of them)")).collect();
    if failures.len() > SHOWN_FAILURES {
        words.push(format!("and {} other reasons; see answers.jsonl", failures.len() - SHOWN_FAILURES));
    }
    words.join("; ")
}

fn where_kept(folder: &Path, spare: Option<&Path>) -> String {
    match spare {
        Some(spare) => format!(
            "What was answered and could not be written there is kept in {spare:?}; a run with the same work folder uses \
             it. Make room and move it to {folder:?}"
        ),
        None => format!("What was answered is printed above; make room and save it in {folder:?}"),
    }
}

/// Every missing part, those of one view with one reason together.
fn listed(missing: &[MissingPart]) -> String {
    let mut lines: Vec<(&str, String, Vec<String>)> = Vec::new();
    for part in missing {
        let reason = part.miss.to_string();
        match lines.iter_mut().find(|(view, known, _)| *view == part.view && *known == reason) {
            Some((_, _, parts)) => parts.push(part.part.to_string()),
            None => lines.push((&part.view, reason, vec![part.part.to_string()])),
        }
    }
    let line = |(view, reason, parts): (&str, String, Vec<String>)| {
        let parts_word = if parts.len() == 1 { "part" } else { "parts" };
        format!("\n  view {view} {parts_word} {} ({reason})", parts.join(", "))
    };
    lines.into_iter().map(line).collect()
}
