//! Errors of the queries as a whole. The failure of a single question is a [`super::Failure`].

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use super::recorded::{Miss, RecordingError};
use super::{Answers, Failure, Outcome, SubjectId};
use crate::config::option_values::OptionError;
use crate::query::ask::asker::AskError;
use crate::query::ask::budget::Spent;
use crate::query::ask::whole::Purpose;
use crate::query::question::prompt::PromptError;
use crate::words::output;
use crate::words::progress::Cancelled;

/// Why the query stage ends without answers.
#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    #[error("{0}")]
    Option(#[from] OptionError),
    #[error("view {view}: the label map has no pixel of {subject}; segment the scene again")]
    EmptySubject { view: String, subject: SubjectId },
    #[error("view {view}: the label map is {} x {} pixels, the photo {} x {}; segment the scene again", map.0, map.1, photo.0, photo.1)]
    SizeMismatch { view: String, map: (u32, u32), photo: (u32, u32) },
    #[error(transparent)]
    Prompt(#[from] PromptError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    #[error(
        "no recorded answer for {} of {}:{}\n{}",
        .missing.len(), output::counted(*.questions, "question"), listed(.missing),
        ways_to_answer(.scene.as_deref(), "", .missing.len() < *.questions)
    )]
    Missing {
        questions: usize,
        missing: Vec<MissingAnswer>,
        /// The scene, as it is typed in a shell; `None` if that is not known here.
        scene: Option<String>,
    },
    #[error("no usable recorded answer for {}", missing_whole(*.purpose, .view, *.miss, .scene.as_deref()))]
    MissingWhole {
        purpose: Purpose,
        view: String,
        miss: Miss,
        /// As for [`Self::Missing`].
        scene: Option<String>,
    },
    #[error(
        "--max-usd cannot be kept: no price is known for {model}; give it with --price IN,OUT in USD per million tokens (--price 0 if nothing is charged)"
    )]
    NoPrice { model: String },
    #[error(
        "{} would cost about {usd:.4} USD, more than {}",
        output::counted(*.requests, "request"), limit(*.max_usd, .spent)
    )]
    OverBudget { requests: usize, usd: f64, max_usd: f64, spent: Spent },
    #[error(
        "--max-usd {max_usd} is reached: {spent_usd:.4} USD spent, {} not answered; the answers so far are recorded. Raise \
         --max-usd to go on",
        output::counted(*.left, "question")
    )]
    BudgetSpent { max_usd: f64, spent_usd: f64, left: usize },
    #[error("{error}: {} {} no recorded answer, and no server was asked", output::counted(*.questions, "question"), output::agreeing(*.questions, "has", "have"))]
    NotReady { error: AskError, questions: usize },
    #[error("{source}; nothing more was asked. {}", where_kept(.folder, .spare.as_deref()))]
    Unkept {
        source: RecordingError,
        /// The folder in which recordings are normally written.
        folder: PathBuf,
        /// The folder of the recordings that could not be written there; `None` if their text was printed.
        spare: Option<PathBuf>,
    },
    #[error("{message}; {} {} not answered; the answers so far are recorded ({spent})", output::counted(*.left, "question"), output::agreeing(*.left, "is", "are"))]
    Endpoint { message: String, left: usize, spent: Spent },
    #[error(
        "all {requests} requests that were announced are sent; {} {} not answered; the answers so far are recorded ({spent}). \
         The same command goes on",
        output::counted(*.left, "question"), output::agreeing(*.left, "is", "are")
    )]
    Announced { requests: usize, left: usize, spent: Spent },
    #[error(transparent)]
    InVain(Box<InVain>),
    #[error("{}: {}", unanswered(*.questions), counted(.failures))]
    AllFailed {
        questions: usize,
        /// Each failure with the number of questions that it applies to, the most frequent first.
        failures: Vec<(Failure, usize)>,
    },
    #[error(
        "a submission to the Batch API cannot be stopped, and with the longest answers its {requests} requests may \
         cost {usd:.4} USD, more than is left of --max-usd {max_usd} (spent so far: {spent}); nothing was submitted"
    )]
    SubmissionOverBudget { requests: usize, usd: f64, max_usd: f64, spent: Spent },
    #[error("the Batch API: {0}")]
    BatchApi(AskError),
    #[error(
        "no Batch API job is waiting to be collected; `gprop query SCENE --batch-api submit`, or `gprop batch FOLDER --queries submit`, \
         sends one"
    )]
    NothingSubmitted,
    #[error(
        "Batch API jobs still running: {running}, with {done} of {} done; run the same command again later",
        output::counted(*.total, "request")
    )]
    BatchApiRunning { running: usize, done: usize, total: usize },
    #[error(
        "{} {} sent to another model, or with other prompts, materials or options, and still {}; collect with the options \
         with which they were submitted",
        output::counted(*.questions, "question"), output::agreeing(*.questions, "was", "were"),
        output::agreeing(*.questions, "waits", "wait")
    )]
    BatchApiOthers { questions: usize },
    #[error(
        "{failed} of {} {} not answered ({reasons}); the other answers are recorded. `submit` asks again about what \
         failed",
        output::counted(*.total, "question"), output::agreeing(*.failed, "was", "were")
    )]
    BatchApiPartial { failed: usize, total: usize, reasons: String },
    #[error(
        "{}. Their questions still wait: collect again later, with the key and the --lmm-url with which they were \
         submitted. Only if the server no longer has such a job, remove it from \"jobs\" in {file:?}, and `submit` asks its \
         questions again",
        unfetched(.jobs)
    )]
    BatchApiUnfetched {
        /// The reason by the id of the job.
        jobs: BTreeMap<String, String>,
        /// The file in which the jobs are noted.
        file: PathBuf,
    },
    #[error(
        "in {folder:?}, {} cannot be used{}:\n{lines}",
        output::counted(*.count, "answer"), if *.recorded > 0 { "; the others are recorded" } else { "" }
    )]
    Import { folder: PathBuf, count: usize, recorded: usize, lines: String },
}

/// So many requests in a row brought no usable reply that no more were sent.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct InVain {
    /// How many.
    pub requests: usize,
    pub last: Failure,
    /// The text of the last reply, if there was one.
    pub reply: Option<String>,
    /// The ways in which an answer was asked for, in words.
    pub tried: Vec<&'static str>,
    /// The questions that are left.
    pub left: usize,
    pub spent: Spent,
}

/// The longest excerpt of a reply that is shown, in characters.
const SHOWN_CHARACTERS: usize = 200;

impl fmt::Display for InVain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { requests, last, reply, tried, left, spent } = self;
        let last = last.to_string();
        // A server's own sentence may end in a full stop, or without one.
        let last = last.trim_end_matches('.');
        write!(f, "{requests} requests in a row brought no usable reply, so no more were sent. The last: {last}")?;
        if let Some(reply) = reply {
            let shown: String = reply.chars().take(SHOWN_CHARACTERS).collect();
            let dots = if shown.len() < reply.len() { "..." } else { "" };
            write!(f, "; the reply reads {shown:?}{dots}")?;
        }
        if !tried.is_empty() {
            write!(f, ". Tried: {}", tried.join(", "))?;
        }
        let (questions, are) = (output::counted(*left, "question"), output::agreeing(*left, "is", "are"));
        write!(
            f,
            ". {questions} {are} not answered; the answers so far are recorded ({spent}). docs/models.md says which models \
             and options suit"
        )
    }
}

/// A question without a recorded answer.
#[derive(Debug, Clone, PartialEq)]
pub struct MissingAnswer {
    pub view: String,
    /// The id of its subject in the view's label map.
    pub subject: u16,
    pub miss: Miss,
}

impl Answers {
    /// Checks that there is at least one answer to continue with.
    ///
    /// # Errors
    /// [`QueryError::AllFailed`] if there are questions and none of them is answered.
    pub fn require_any(&self) -> Result<(), QueryError> {
        let mut failures: Vec<(Failure, usize)> = Vec::new();
        for answer in &self.all {
            let Outcome::Failed(failure) = &answer.outcome else { return Ok(()) };
            match failures.iter_mut().find(|(known, _)| known == failure) {
                Some((_, questions)) => *questions += 1,
                None => failures.push((failure.clone(), 1)),
            }
        }
        if failures.is_empty() {
            return Ok(());
        }
        failures.sort_by_key(|(_, questions)| std::cmp::Reverse(*questions));
        Err(QueryError::AllFailed { questions: self.all.len(), failures })
    }
}

impl QueryError {
    /// The error with commands that name the scene, given as it is typed in a shell.
    #[must_use]
    pub fn about(mut self, of: &str) -> Self {
        if let Self::Missing { scene, .. } | Self::MissingWhole { scene, .. } = &mut self {
            *scene = Some(of.to_owned());
        }
        self
    }
}

/// The ways to the answers that are missing, with the `option` that asks for them, or "". With `some`, others are there.
fn ways_to_answer(scene: Option<&str>, option: &str, some: bool) -> String {
    let of = format!("{}{}{option}", scene.unwrap_or("SCENE"), if option.is_empty() { "" } else { " " });
    let so_far = if some { "; or go on with the answers so far: --answers partial" } else { "" };
    format!(
        "Answer by hand: gprop answer {of}; or ask a model: --lmm-url URL --lmm-model NAME with the key in OPENAI_API_KEY{so_far}; \
         or answer elsewhere: gprop query {of} --export DIR, then gprop query {of} --import DIR, and the same --out if you gave one"
    )
}

/// What a question about the whole object is about, and what to do if its answer is missing.
fn missing_whole(purpose: Purpose, view: &str, miss: Miss, scene: Option<&str>) -> String {
    let (what, option, or_else) = match purpose {
        Purpose::Size => ("the length of the object", "--scale estimate", "; or give another --scale"),
        Purpose::Recognition => ("what the object is", "--ask object", "; or ask about its parts alone: --ask parts"),
        Purpose::DirectGuess => ("how heavy the object is", "--direct", ""),
    };
    format!(
        "{what} ({miss}), which {option} asks for in view {view}\n{}{or_else}",
        ways_to_answer(scene, option, false)
    )
}

/// Number of failures in the message; the error value holds all of them.
const SHOWN_FAILURES: usize = 3;

fn counted(failures: &[(Failure, usize)]) -> String {
    let mut words: Vec<String> = failures
        .iter()
        .take(SHOWN_FAILURES)
        .map(|(failure, questions)| format!("{failure} ({})", output::counted(*questions, "question")))
        .collect();
    if failures.len() > SHOWN_FAILURES {
        words.push(format!("and {} more; see answers.jsonl", failures.len() - SHOWN_FAILURES));
    }
    words.join("; ")
}

fn where_kept(folder: &Path, spare: Option<&Path>) -> String {
    match spare {
        Some(spare) => format!(
            "The answers that could not be written there are kept in {spare:?}; a run with the same work folder uses \
             them. Make room and move them to {folder:?}"
        ),
        None => {
            format!("The answers that could not be written are printed above; make room and save them in {folder:?}")
        }
    }
}

fn unfetched(jobs: &BTreeMap<String, String>) -> String {
    let jobs: Vec<String> = jobs.iter().map(|(id, reason)| format!("job {id}: {reason}")).collect();
    format!("Batch API jobs that cannot be fetched: {}", jobs.join("; "))
}

/// The limit that requests would exceed, and what happened before.
fn limit(max_usd: f64, spent: &Spent) -> String {
    if spent.requests == 0 {
        return format!("--max-usd {max_usd}; nothing was sent");
    }
    format!(
        "is left of --max-usd {max_usd} (spent so far: {spent}); the answers so far are recorded. Raise --max-usd to go on"
    )
}

fn unanswered(questions: usize) -> String {
    match questions {
        1 => "the only question was not answered".into(),
        more => format!("none of the {} was answered", output::counted(more, "question")),
    }
}

/// Every missing answer, grouped by view and reason.
fn listed(missing: &[MissingAnswer]) -> String {
    let mut lines: Vec<(&str, String, Vec<String>)> = Vec::new();
    for answer in missing {
        let reason = answer.miss.to_string();
        match lines.iter_mut().find(|(view, known, _)| *view == answer.view && *known == reason) {
            Some((_, _, ids)) => ids.push(answer.subject.to_string()),
            None => lines.push((&answer.view, reason, vec![answer.subject.to_string()])),
        }
    }
    let line = |(view, reason, ids): (&str, String, Vec<String>)| {
        let word = if ids.len() == 1 { "region" } else { "regions" };
        format!("\n  view {view}, {word} {} ({reason})", ids.join(", "))
    };
    lines.into_iter().map(line).collect()
}
