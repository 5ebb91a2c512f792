//! The queries of a desk by the Batch API: submitted now, collected later. What is under way is noted in `batch.json`.

use std::collections::BTreeMap;

use anyhow::Result;
use serde::Serialize;

use crate::query::answer::Unknown;
use crate::query::asker::{Ask, AskError, Asker};
use crate::query::batch::{self, Answered, Progress, Request, Submitted, Waiting};
use crate::query::client::{BatchCounts, Client, ClientError};
use crate::query::recorded::{Recording, key};
use crate::query::{Failure, Outcome, Queries, QueryError};
use crate::workdir::Artifact;

use super::desk::Desk;

/// What `--batch submit` did.
#[derive(Debug, Serialize)]
pub struct Sent {
    /// Questions sent now.
    pub sent: usize,
    /// Questions of earlier submissions that are not collected yet.
    pub waiting: usize,
}

/// What `--batch collect` did.
#[derive(Debug, Default, Serialize)]
pub struct Collected {
    pub recorded: usize,
    /// Questions that were not answered, or not usably, by reason.
    pub failed: BTreeMap<String, usize>,
    /// Batches that are still worked on, with how many of their requests are done.
    pub running: usize,
    pub running_done: usize,
    pub running_total: usize,
}

impl Desk<'_> {
    /// Sends what is neither recorded nor under way. The first question is asked at once: a wrong key or model shows now
    /// and not a day later, and the others are put as the server takes them.
    pub fn submit(&self) -> Result<Sent> {
        let (client, queries) = (self.batch_client()?, self.queries()?);
        let mut submitted = self.submitted()?;
        let waiting = submitted.batches.iter().map(|batch| batch.waiting.len()).sum();
        let first = self.requests(client, &queries, &submitted, "");
        if first.is_empty() {
            return Ok(Sent { sent: 0, waiting });
        }
        queries.check_batch_budget(&self.recordings, client.answerer(), self.price(), first.len())?;
        self.ask_first(client, &queries)?;
        let requests = self.requests(client, &queries, &submitted, "");
        let sent = requests.len();
        batch::submit(client, requests, |batch| -> Result<()> {
            submitted.batches.push(batch);
            Ok(self.work.write_json(Artifact::Batch, &submitted)?)
        })?;
        Ok(Sent { sent, waiting })
    }

    /// Asks the first open question at once.
    ///
    /// # Errors
    /// Where the endpoint cannot answer it.
    pub fn ask_first(&self, client: &Client, queries: &Queries) -> Result<()> {
        match queries.ask_first(&self.recordings, client, self.price())? {
            Some(Outcome::Failed(Failure::Endpoint { message })) => {
                Err(QueryError::Batch(AskError::Failed(message)).into())
            }
            _ => Ok(()),
        }
    }

    /// The open questions that `submitted` does not wait for, as `owner`'s.
    pub fn requests(&self, client: &Client, queries: &Queries, submitted: &Submitted, owner: &str) -> Vec<Request> {
        let open = queries.unanswered(&self.recordings, Some(client.answerer()));
        let mut requests: BTreeMap<_, Request> = BTreeMap::new();
        for (part, question) in open {
            let asked = part.asked(question);
            let key = key(client.answerer(), &asked);
            if !submitted.awaits(&key) {
                let body = client.body(Ask { question, picture: &part.jpeg, correction: None });
                let waiting = Waiting { key: key.clone(), owner: owner.to_owned(), asked };
                requests.entry(key).or_insert(Request { waiting, body });
            }
        }
        requests.into_values().collect()
    }

    /// Fetches the batches that have ended, and records their answers.
    pub fn collect(&self) -> Result<Collected> {
        let (client, queries) = (self.batch_client()?, self.queries()?);
        let mut submitted = self.submitted()?;
        if submitted.batches.is_empty() {
            return Err(QueryError::NothingSubmitted.into());
        }
        let mut collected = Collected::default();
        for batch in submitted.batches.clone() {
            match batch::collect(client, &batch).map_err(QueryError::Batch)? {
                Progress::Running { counts, .. } => collected.add_running(counts, batch.waiting.len()),
                Progress::Ended(ended) => {
                    for (waiting, answered) in ended.answered {
                        match self.record(&queries, client, waiting, answered)? {
                            Ok(()) => collected.recorded += 1,
                            Err(reason) => collected.add_failed(reason),
                        }
                    }
                    ended.failed.into_iter().for_each(|(_, reason)| collected.add_failed(reason));
                    submitted.batches.retain(|other| other.id != batch.id);
                    self.work.write_json(Artifact::Batch, &submitted)?;
                }
            }
        }
        Ok(collected)
    }

    /// Records an answer, or says why it is none.
    pub fn record(
        &self,
        queries: &Queries,
        client: &Client,
        waiting: Waiting,
        answered: Answered,
    ) -> Result<Result<(), String>> {
        let Some(question) = queries.questions.find(&waiting.asked) else {
            return Ok(Err("it was asked with other prompts, another library or other options than now".into()));
        };
        let read = queries.questions.read(question, &answered.text, &self.library, Unknown::TakeNearest);
        if let Err(problem) = read {
            return Ok(Err(problem.failure.to_string()));
        }
        let Answered { text, served_model, usage } = answered;
        self.recordings.insert(Recording::new(client.answerer(), waiting.asked, text, served_model, usage))?;
        Ok(Ok(()))
    }

    fn submitted(&self) -> Result<Submitted> {
        match self.work.size(Artifact::Batch) {
            Some(_) => Ok(self.work.read_json(Artifact::Batch)?),
            None => Ok(Submitted::default()),
        }
    }

    fn batch_client(&self) -> Result<&Client> {
        Ok(self.client.as_ref().ok_or(ClientError::NoUrl)?)
    }
}

impl Collected {
    /// Counts a batch of `total` questions that is still worked on.
    pub fn add_running(&mut self, counts: BatchCounts, total: usize) {
        self.running += 1;
        self.running_done += counts.completed + counts.failed;
        self.running_total += total;
    }

    /// Counts a question that was not answered usably.
    pub fn add_failed(&mut self, reason: String) {
        *self.failed.entry(reason).or_default() += 1;
    }

    /// Whether everything that was submitted is recorded now.
    ///
    /// # Errors
    /// [`QueryError::BatchRunning`] or [`QueryError::BatchPartial`] where it is not.
    pub fn require_all(&self) -> Result<(), QueryError> {
        let failed: usize = self.failed.values().sum();
        if failed > 0 {
            let reasons: Vec<String> = self.failed.iter().map(|(why, count)| format!("{why} ({count})")).collect();
            let total = self.recorded + failed;
            return Err(QueryError::BatchPartial { failed, total, reasons: reasons.join("; ") });
        }
        if self.running > 0 {
            let Self { running, running_done: done, running_total: total, .. } = *self;
            return Err(QueryError::BatchRunning { running, done, total });
        }
        Ok(())
    }
}
