//! The queries of a session through the Batch API: submitted first, collected later. Jobs in progress are noted in
//! `batch_api.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use anyhow::Result;
use serde::Serialize;

use crate::output::counted;
use crate::query::answer::Unknown;
use crate::query::asker::{Ask, AskError, Asker};
use crate::query::batch_api::{self, Answered, JobProgress, Request, Submitted, Waiting};
use crate::query::budget::Budget;
use crate::query::client::{Client, ClientError, RequestCounts};
use crate::query::cost::Cost;
use crate::query::question::Question;
use crate::query::recorded::{Answerer, Recording, key};
use crate::query::{Failure, Outcome, Queries, QueryError, SegmentQuery};
use crate::workdir::Artifact;

use super::query_session::QuerySession;

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
}

/// Whether a question is not in `submitted`, and is met for the first time.
fn not_in(submitted: &Submitted, answerer: &Answerer) -> impl FnMut(&SegmentQuery, &Question) -> bool {
    let mut met = BTreeSet::new();
    move |segment, question| {
        let key = key(answerer, &segment.asked(question));
        !submitted.awaits(&key) && met.insert(key)
    }
}

impl QuerySession<'_> {
    /// Sends the questions that are neither recorded nor in progress. The first question is asked at once: a wrong key
    /// or model then shows immediately and not a day later, and the other requests take the form that the server
    /// accepts.
    pub fn submit(&self) -> Result<Sent> {
        let client = self.batch_api_client()?;
        client.ready().map_err(QueryError::BatchApi)?;
        let queries = self.queries()?;
        let mut submitted = self.submitted()?;
        let waiting = submitted.jobs.iter().map(|job| job.waiting.len()).sum();
        let first = self.requests(client, &queries, &submitted, "");
        if first.is_empty() {
            return Ok(Sent { sent: 0, waiting });
        }
        let (now, later) = self.submission_cost(client, &queries, &submitted, 1);
        let budget = Budget::new(self.price().cloned(), self.options.max_usd);
        check_submission(&now.plus(later), &budget, client.answerer())?;
        client.announce_submission(first.len(), &now.plus(later));
        self.ask_first(client, &queries, &submitted, &budget)?;
        let requests = self.requests(client, &queries, &submitted, "");
        let sent = requests.len();
        let (_, later) = self.submission_cost(client, &queries, &submitted, 0);
        check_submission(&later, &budget, client.answerer())?;
        batch_api::submit(client, requests, |job| -> Result<()> {
            submitted.jobs.push(job);
            Ok(self.work.write_json(Artifact::BatchApiJobs, &submitted)?)
        })?;
        Ok(Sent { sent, waiting })
    }

    /// The cost of asking the open questions that are not already in `submitted`: the first `at_once` of them live, and
    /// the others through the Batch API.
    pub fn submission_cost(
        &self,
        client: &Client,
        queries: &Queries,
        submitted: &Submitted,
        at_once: usize,
    ) -> (Cost, Cost) {
        let due = not_in(submitted, client.answerer());
        queries.submission_cost(&self.recordings, client.answerer(), self.price(), at_once, due)
    }

    /// Asks the first open question that is not already in `submitted` at once.
    ///
    /// # Errors
    /// If the server cannot answer it.
    pub fn ask_first(&self, client: &Client, queries: &Queries, submitted: &Submitted, budget: &Budget) -> Result<()> {
        match queries.ask_first(&self.recordings, client, budget, not_in(submitted, client.answerer()))? {
            Some(Outcome::Failed(Failure::Endpoint { message })) => {
                Err(QueryError::BatchApi(AskError::Failed(message)).into())
            }
            _ => Ok(()),
        }
    }

    /// The open questions that are not already in `submitted`, with the owner `owner`.
    pub fn requests(&self, client: &Client, queries: &Queries, submitted: &Submitted, owner: &str) -> Vec<Request> {
        let open = queries.unanswered(&self.recordings, Some(client.answerer()));
        let mut due = not_in(submitted, client.answerer());
        let mut requests: BTreeMap<_, Request> = BTreeMap::new();
        for (segment, question) in open.into_iter().filter(|(segment, question)| due(segment, question)) {
            let asked = segment.asked(question);
            let key = key(client.answerer(), &asked);
            let body = client.body(Ask { question, picture: &segment.jpeg, correction: None });
            let waiting = Waiting { key: key.clone(), owner: owner.to_owned(), asked };
            requests.insert(key, Request { waiting, body });
        }
        requests.into_values().collect()
    }

    /// Fetches the jobs that have ended and records their answers.
    pub fn collect(&self) -> Result<Collected> {
        let (client, queries) = (self.batch_api_client()?, self.queries()?);
        let mut submitted = self.submitted()?;
        if submitted.jobs.is_empty() {
            return Err(QueryError::NothingSubmitted.into());
        }
        let mut collected = Collected::default();
        for job in submitted.jobs.clone() {
            match batch_api::collect(client, &job).map_err(QueryError::BatchApi)? {
                JobProgress::OfOther => collected.of_others += job.waiting.len(),
                JobProgress::Running(counts) => collected.add_running(counts, job.waiting.len()),
                JobProgress::Ended(ended) => {
                    let left = self.record(&queries, client, ended.answered, &mut collected)?;
                    ended.failed.into_iter().for_each(|(_, reason)| collected.add_failed(&reason));
                    submitted.keep_waiting(&job.id, left);
                    self.work.write_json(Artifact::BatchApiJobs, &submitted)?;
                }
            }
        }
        Ok(collected)
    }

    /// Records the usable answers and counts all. Returns what must go on waiting, because it is none of `queries`: it was
    /// asked with other prompts, materials or options, with which it can still be collected.
    pub fn record(
        &self,
        queries: &Queries,
        client: &Client,
        answered: Vec<(Waiting, Answered)>,
        collected: &mut Collected,
    ) -> Result<Vec<Waiting>> {
        let mut left = Vec::new();
        for (waiting, Answered { text, served_model, usage }) in answered {
            match queries.check(&waiting.asked, &text, Unknown::TakeNearest) {
                None => {
                    collected.of_others += 1;
                    left.push(waiting);
                }
                Some(Err(problem)) => collected.add_failed(&problem.failure),
                Some(Ok(())) => {
                    let recording = Recording::new(client.answerer(), waiting.asked, text, served_model, usage);
                    self.recordings.insert(&recording)?;
                    collected.recorded += 1;
                }
            }
        }
        Ok(left)
    }

    fn submitted(&self) -> Result<Submitted> {
        match self.work.size(Artifact::BatchApiJobs) {
            Some(_) => Ok(self.work.read_json(Artifact::BatchApiJobs)?),
            None => Ok(Submitted::default()),
        }
    }

    fn batch_api_client(&self) -> Result<&Client> {
        Ok(self.client.as_ref().ok_or(ClientError::NoUrl)?)
    }
}

/// Checks that a submission, which cannot be stopped, stays within the budget even if all answers have the maximum
/// length.
pub fn check_submission(cost: &Cost, budget: &Budget, answerer: &Answerer) -> Result<(), QueryError> {
    let Some(max_usd) = budget.max_usd().filter(|_| budget.might_pass(cost.most_usd)) else { return Ok(()) };
    Err(match cost.most_usd {
        None => QueryError::NoPrice { model: answerer.model.clone() },
        Some(usd) => QueryError::SubmissionOverBudget { requests: cost.requests, usd, max_usd, spent: budget.spent() },
    })
}

impl Collected {
    /// Counts a job of `total` questions that is still in progress.
    pub fn add_running(&mut self, counts: RequestCounts, total: usize) {
        self.running += 1;
        self.running_done += counts.completed + counts.failed;
        self.running_total += total;
    }

    /// Counts a question without a usable answer.
    pub fn add_failed(&mut self, reason: &impl ToString) {
        *self.failed.entry(reason.to_string()).or_default() += 1;
    }

    /// Checks that everything that was submitted is recorded.
    ///
    /// # Errors
    /// [`QueryError::BatchApiPartial`], [`QueryError::BatchApiOthers`] or [`QueryError::BatchApiRunning`] if it is not.
    pub fn require_all(&self) -> Result<(), QueryError> {
        let failed: usize = self.failed.values().sum();
        if failed > 0 {
            let reasons: Vec<String> = self.failed.iter().map(|(why, count)| format!("{why} ({count})")).collect();
            let total = self.recorded + failed;
            return Err(QueryError::BatchApiPartial { failed, total, reasons: reasons.join("; ") });
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
