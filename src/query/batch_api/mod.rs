//! Questions through OpenAI's Batch API, at half the price and answered within a day.
//!
//! 1. [`JobRequest`]s are gathered from the [`Submission`]s of one scene or of many; questions that are already
//!    [sent](SentQuestion) are left out.
//! 2. [`submit`] sends them in as many jobs as the API's limits require, and reports each job as soon as it is
//!    accepted.
//! 3. [`collect`] asks for the state of a job and reads its results: all of them, or those that were ready before it
//!    expired.
//!
//! A request's `custom_id` is the key of the recording that its answer becomes, so each answer finds its place in
//! whatever order the answers come in and however often they are collected. Several scenes may wait for the answer to one
//! request; it is recorded for each of them.

mod http;
mod outcome;
mod response;
mod submission;

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::client::Client;
use super::error::QueryError;
use super::options::AnswerSource;
use super::recorded::{Answerer, QuestionId, key};
use crate::error::UsageError;
use crate::files::json;
use crate::query::ask::asker::{AskError, Asker};
use crate::query::recorded::sha256::Sha256Hex;
use crate::words::progress;

pub use http::{JobState, JobStatus, RequestCounts};
pub use outcome::{Collected, Sent};
pub use response::{AnswerLine, Answered, NotAnswered, lines};
pub use submission::{Submission, check_submission};

/// Most requests per job, and most bytes: the API's limits are 50,000 and 200 MB.
const MAX_REQUESTS: usize = 50_000;
const MAX_BYTES: usize = 190_000_000;

/// The two halves of a submission through the Batch API.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Step {
    /// Segment what is not segmented yet, and send the questions that are due.
    Submit,
    /// Fetch the answers and record them; needs the options given to `submit`.
    Collect,
}

/// One question to be sent in a job.
#[derive(Debug, Clone, PartialEq)]
pub struct JobRequest {
    pub question: SentQuestion,
    /// What is sent, in the form of Chat Completions.
    pub payload: Value,
}

/// A question of one scene that was sent and whose answer has not been collected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SentQuestion {
    /// Key of the recording that the answer becomes.
    pub key: Sha256Hex,
    /// The scene that the question belongs to if one submission holds the questions of many; empty if there is only one
    /// scene.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub owner: String,
    pub asked: QuestionId,
}

/// A job that was accepted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BatchApiJob {
    /// The server's name for it.
    pub id: String,
    pub waiting: Vec<SentQuestion>,
}

/// The jobs that were submitted and are not yet collected: the content of `batch_api.json`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Submitted {
    pub jobs: Vec<BatchApiJob>,
}

/// The results of a job that ended.
#[derive(Debug)]
pub struct Ended {
    /// The questions that were answered.
    pub answered: Vec<(SentQuestion, Answered)>,
    /// The questions that were not, each with the reason.
    pub failed: Vec<(SentQuestion, NotAnswered)>,
}

/// The progress of a job.
#[derive(Debug)]
pub enum JobProgress {
    /// Its questions were sent to another model or with other parameters, so its answers are not this client's to record.
    OfOther,
    Running(RequestCounts),
    Ended(Ended),
}

impl BatchApiJob {
    /// True if its questions were sent to this model with these parameters.
    fn is_for(&self, answerer: &Answerer) -> bool {
        self.waiting.iter().all(|waiting| waiting.key == key(answerer, &waiting.asked))
    }

    /// The number of requests, for each of which several scenes may wait.
    pub fn requests(&self) -> usize {
        self.waiting.iter().map(|waiting| &waiting.key).collect::<BTreeSet<_>>().len()
    }
}

impl Submitted {
    /// The keys of the questions whose answers are still to come.
    pub fn keys(&self) -> BTreeSet<Sha256Hex> {
        self.jobs.iter().flat_map(|job| &job.waiting).map(|waiting| waiting.key.clone()).collect()
    }

    /// Adds questions of scenes to the jobs that were sent the same question for other scenes. Returns whether that changed
    /// anything.
    pub fn share(&mut self, questions: Vec<SentQuestion>) -> bool {
        let known: BTreeSet<(&Sha256Hex, &str)> =
            self.jobs.iter().flat_map(|job| &job.waiting).map(|waiting| (&waiting.key, &*waiting.owner)).collect();
        let mut more: BTreeMap<Sha256Hex, Vec<SentQuestion>> = BTreeMap::new();
        for question in questions {
            if !known.contains(&(&question.key, &*question.owner)) {
                more.entry(question.key.clone()).or_default().push(question);
            }
        }
        let mut changed = false;
        for job in &mut self.jobs {
            let same: Vec<SentQuestion> =
                job.waiting.iter().filter_map(|waiting| more.remove(&waiting.key)).flatten().collect();
            changed |= !same.is_empty();
            job.waiting.extend(same);
        }
        changed
    }

    /// Notes what is left of a job whose answers were fetched: these questions still wait, and without any, the job is
    /// done.
    pub fn keep_waiting(&mut self, id: &str, left: Vec<SentQuestion>) {
        self.jobs.retain_mut(|job| {
            if job.id == id {
                job.waiting.clone_from(&left);
            }
            !job.waiting.is_empty()
        });
    }
}

impl JobRequest {
    /// One line of the input file, with its line break.
    fn line(&self) -> String {
        let line = json!({
            "custom_id": self.question.key, "method": "POST", "url": "/v1/chat/completions", "body": self.payload,
        });
        format!("{line}\n")
    }
}

/// Checks that questions may be submitted if answers come from `answers`.
///
/// # Errors
/// If they come from recordings only.
pub fn check_may_send(answers: AnswerSource) -> Result<(), UsageError> {
    let from_recordings = match answers {
        AnswerSource::Replay => "replay",
        AnswerSource::Partial => "partial",
        AnswerSource::Record | AnswerSource::Live => return Ok(()),
    };
    Err(UsageError(format!(
        "--answers {from_recordings} sends nothing; leave it out to submit questions to the Batch API"
    )))
}

/// Sends the requests as they arrive, in jobs as large as the API allows; calls `accepted` for each job at once. Holds
/// no more than one job's requests in memory.
pub fn submit<E: From<QueryError>>(
    client: &Client,
    requests: impl IntoIterator<Item = JobRequest>,
    mut accepted: impl FnMut(BatchApiJob) -> Result<(), E>,
) -> Result<(), E> {
    let mut start = |lines: &str, waiting: Vec<SentQuestion>| {
        let id = client.start_batch_api_job(lines).map_err(QueryError::BatchApi)?.id;
        let job = BatchApiJob { id, waiting };
        accepted(job.clone()).inspect_err(|_| {
            let json = json::compact(&job).expect("a job is plain data");
            progress::notice(&format!(
                "this job was accepted, but could not be noted; to collect its answers, add it to \"jobs\" in the file named \
                 below:\n{json}"
            ));
        })
    };
    let mut lines = String::new();
    let mut waiting = Vec::new();
    for request in requests {
        let line = request.line();
        if waiting.len() == MAX_REQUESTS || (!waiting.is_empty() && lines.len() + line.len() > MAX_BYTES) {
            start(&lines, std::mem::take(&mut waiting))?;
            lines.clear();
        }
        lines.push_str(&line);
        waiting.push(request.question);
    }
    if waiting.is_empty() { Ok(()) } else { start(&lines, waiting) }
}

/// Asks for the state of a job and, if it has ended, fetches its results.
pub fn collect(client: &Client, job: &BatchApiJob) -> Result<JobProgress, AskError> {
    if !job.is_for(client.answerer()) {
        return Ok(JobProgress::OfOther);
    }
    let status = client.batch_api_job(&job.id)?;
    if !status.state.is_final() {
        return Ok(JobProgress::Running(status.request_counts.unwrap_or_default()));
    }
    let mut lines = BTreeMap::new();
    for file in [&status.error_file_id, &status.output_file_id].into_iter().flatten() {
        lines.extend(response::lines(&client.file(file)?, &|text| client.without_key(text))?);
    }
    let mut ended = Ended { answered: Vec::new(), failed: Vec::new() };
    for waiting in &job.waiting {
        let found = lines.get(waiting.key.as_str()).cloned();
        let why_none = || match status.problems() {
            none if none.is_empty() => format!("the job ended without an answer ({:?})", status.state),
            problems => client.without_key(&problems),
        };
        match found.unwrap_or_else(|| Err(NotAnswered::Server(why_none()))) {
            Ok(answered) => ended.answered.push((waiting.clone(), answered)),
            Err(reason) => ended.failed.push((waiting.clone(), reason)),
        }
    }
    Ok(JobProgress::Ended(ended))
}
