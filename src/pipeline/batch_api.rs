//! The queries of a session through the Batch API: submitted first, collected later. Jobs in progress are noted in
//! `batch_api.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::PathBuf;

use anyhow::Result;
use serde::Serialize;

use crate::query::answer::Unknown;
use crate::query::ask::asker::{Ask, AskError, Asker};
use crate::query::ask::budget::Budget;
use crate::query::ask::cost::Cost;
use crate::query::batch_api::{self, Answered, BatchApiJob, Ended, JobProgress, Request, Submitted, Waiting};
use crate::query::client::{Client, ClientError};
use crate::query::question::Question;
use crate::query::recorded::{Answerer, Recording, Who, key};
use crate::query::{Failure, Outcome, Queries, QueryError, SegmentQuery, Sha256Hex};
use crate::words::output::counted;
use crate::words::progress;
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
    /// The ids of the jobs whose status or results could not be fetched, with the reasons; their questions still wait.
    pub unfetched: BTreeMap<String, String>,
    /// The file in which the jobs are noted.
    #[serde(skip)]
    pub jobs_file: PathBuf,
}

/// Whether the key of a question is not in `taken`, to which it is then added.
fn not_in(taken: &mut BTreeSet<Sha256Hex>, answerer: &Answerer) -> impl FnMut(&SegmentQuery, &Question) -> bool {
    move |segment, question| taken.insert(key(answerer, &segment.asked(question)))
}

impl QuerySession<'_> {
    /// Sends the questions that are neither recorded nor in progress. The first question is asked at once: a wrong key
    /// or model then shows immediately and not a day later, and the other requests take the form that the server
    /// accepts.
    pub fn submit(&self) -> Result<Sent> {
        batch_api::check_may_send(self.options.answers)?;
        let client = self.batch_api_client()?;
        client.ready().map_err(QueryError::BatchApi)?;
        let queries = self.queries()?;
        let mut submitted = self.submitted()?;
        let waiting = submitted.jobs.iter().map(|job| job.waiting.len()).sum();
        let mut taken = submitted.keys();
        let first = self.requests(client, &queries, "", &mut taken.clone());
        if first.is_empty() {
            return Ok(Sent { sent: 0, waiting });
        }
        let (now, later) = self.submission_cost(client, &queries, 1, &mut taken.clone());
        let budget = Budget::new(self.price().cloned(), self.options.max_usd);
        check_submission(&now.plus(later), &budget, client.answerer())?;
        client.announce_submission(first.len(), &now.plus(later));
        let answered = self.ask_first(client, &queries, &budget, &mut taken.clone())?;
        // With --answers live, it stays open although it is recorded.
        taken.extend(answered.and_then(Result::ok).map(|recording| recording.key));
        let requests = self.requests(client, &queries, "", &mut taken.clone());
        let sent = requests.len();
        let (_, later) = self.submission_cost(client, &queries, 0, &mut taken);
        check_submission(&later, &budget, client.answerer())?;
        batch_api::submit(client, requests, |job| -> Result<()> {
            submitted.jobs.push(job);
            Ok(self.work.write_json(Artifact::BatchApiJobs, &submitted)?)
        })?;
        Ok(Sent { sent, waiting })
    }

    /// The cost of asking the open questions that are not `taken`, to which they are added: the first `at_once` of them
    /// live, and the others through the Batch API.
    pub fn submission_cost(
        &self,
        client: &Client,
        queries: &Queries,
        at_once: usize,
        taken: &mut BTreeSet<Sha256Hex>,
    ) -> (Cost, Cost) {
        let due = not_in(taken, client.answerer());
        queries.submission_cost(&self.recordings, client.answerer(), self.price(), at_once, due)
    }

    /// Asks the first open question that is not `taken`, to which it is added, at once. Returns the recorded answer, or why
    /// there is none; `None` if no question is open.
    ///
    /// # Errors
    /// If the server cannot answer it.
    pub fn ask_first(
        &self,
        client: &Client,
        queries: &Queries,
        budget: &Budget,
        taken: &mut BTreeSet<Sha256Hex>,
    ) -> Result<Option<Result<Recording, Failure>>> {
        let first = queries.ask_first(&self.recordings, client, budget, not_in(taken, client.answerer()))?;
        let Some((asked, outcome)) = first else { return Ok(None) };
        match outcome {
            Outcome::Failed(Failure::Endpoint { message }) => {
                Err(QueryError::BatchApi(AskError::Failed(message)).into())
            }
            Outcome::Failed(failure) => Ok(Some(Err(failure))),
            Outcome::Answered(_) => {
                let recorded = self.recordings.find(&asked, Who::Exactly(client.answerer()), &|_| true);
                let (recording, _) = recorded.expect("an answer is recorded before it is returned");
                Ok(Some(Ok(recording)))
            }
        }
    }

    /// The open questions that are not `taken`, to which they are added, with the owner `owner`.
    pub fn requests(
        &self,
        client: &Client,
        queries: &Queries,
        owner: &str,
        taken: &mut BTreeSet<Sha256Hex>,
    ) -> Vec<Request> {
        let open = queries.unanswered(&self.recordings, Some(client.answerer()));
        let mut due = not_in(taken, client.answerer());
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
        let jobs_file = self.work.path(Artifact::BatchApiJobs);
        let mut collected = Collected { jobs_file, ..Collected::default() };
        for job in submitted.jobs.clone() {
            let Some(ended) = collected.fetch(client, &job)? else { continue };
            let left = self.record(&queries, client, ended.answered, &mut collected)?;
            ended.failed.into_iter().for_each(|(_, reason)| collected.add_failed(&reason));
            submitted.keep_waiting(&job.id, left);
            self.work.write_json(Artifact::BatchApiJobs, &submitted)?;
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
    /// The results of a job that has ended. Any other job is counted, and so is one that cannot be fetched: it must not keep
    /// the answers of the others back. It is not given up, because a server that is asked with another project's key or
    /// at another address does not know it either.
    ///
    /// # Errors
    /// If the server cannot be asked at all: a wrong key, no connection, or `--offline`.
    pub fn fetch(&mut self, client: &Client, job: &BatchApiJob) -> Result<Option<Ended>, QueryError> {
        match batch_api::collect(client, job) {
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
