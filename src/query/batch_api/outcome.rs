//! What came of a submission: how much was sent, and how much was collected.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::{BatchApiJob, Ended, JobProgress};
use crate::query::ask::asker::AskError;
use crate::query::client::Client;
use crate::query::error::QueryError;
use crate::words::output::counted;
use crate::words::progress;

/// The result of `--batch-api submit`.
#[derive(Debug, Serialize)]
pub struct Sent {
    /// Questions sent by this call.
    pub sent: usize,
    /// Questions of earlier submissions that are not collected yet.
    pub waiting: usize,
}

impl fmt::Display for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} sent, {} of earlier submissions still waiting", counted(self.sent, "question"), self.waiting)
    }
}

/// The result of `--batch-api collect`.
#[derive(Debug, Default, Serialize)]
pub struct Collected {
    pub recorded: usize,
    /// Questions without a usable answer, by reason.
    pub failed: BTreeMap<String, usize>,
    /// Jobs in progress, with how many of their requests are done.
    pub running: usize,
    pub running_done: usize,
    pub running_total: usize,
    /// Questions that were sent to another model, or with other prompts, materials or options; they still wait.
    pub of_others: usize,
    /// The ids of the jobs whose status or results could not be fetched, with the reasons; their questions still wait.
    pub unfetched: BTreeMap<String, String>,
    /// The file in which the jobs are noted.
    #[serde(skip)]
    pub jobs_file: PathBuf,
}

impl Collected {
    /// The results of a job that has ended. Any other job is counted, and so is one that cannot be fetched: it must not keep
    /// the answers of the others back. It is not given up, because a server that is asked with another project's key or
    /// at another address does not know it either.
    ///
    /// # Errors
    /// If the server cannot be asked at all: a wrong key, no connection, or `--offline`.
    pub fn fetch(&mut self, client: &Client, job: &BatchApiJob) -> Result<Option<Ended>, QueryError> {
        match super::collect(client, job) {
            Ok(JobProgress::Ended(ended)) => return Ok(Some(ended)),
            Ok(JobProgress::OfOther) => self.of_others += job.waiting.len(),
            Ok(JobProgress::Running(counts)) => {
                self.running += 1;
                self.running_done += counts.completed + counts.failed;
                self.running_total += job.requests();
            }
            Err(AskError::Failed(reason)) => {
                progress::notice(&format!("job {} cannot be fetched: {reason}; its questions still wait", job.id));
                self.unfetched.insert(job.id.clone(), reason);
            }
            Err(error) => return Err(QueryError::BatchApi(error)),
        }
        Ok(None)
    }

    /// Counts a question without a usable answer.
    pub fn add_failed(&mut self, reason: &impl ToString) {
        *self.failed.entry(reason.to_string()).or_default() += 1;
    }

    /// Checks that everything that was submitted is recorded.
    ///
    /// # Errors
    /// [`QueryError::BatchApiPartial`], [`QueryError::BatchApiUnfetched`], [`QueryError::BatchApiOthers`] or
    /// [`QueryError::BatchApiRunning`] if it is not.
    pub fn require_all(&self) -> Result<(), QueryError> {
        let failed: usize = self.failed.values().sum();
        if failed > 0 {
            let reasons: Vec<String> = self.failed.iter().map(|(why, count)| format!("{why} ({count})")).collect();
            let total = self.recorded + failed;
            return Err(QueryError::BatchApiPartial { failed, total, reasons: reasons.join("; ") });
        }
        if !self.unfetched.is_empty() {
            let (jobs, file) = (self.unfetched.clone(), self.jobs_file.clone());
            return Err(QueryError::BatchApiUnfetched { jobs, file });
        }
        if self.of_others > 0 {
            return Err(QueryError::BatchApiOthers { questions: self.of_others });
        }
        if self.running > 0 {
            let Self { running, running_done: done, running_total: total, .. } = *self;
            return Err(QueryError::BatchApiRunning { running, done, total });
        }
        Ok(())
    }
}
