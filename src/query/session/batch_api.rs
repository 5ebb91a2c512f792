//! The queries of a session through the Batch API: submitted first, collected later. Jobs in progress are noted in
//! `batch_api.json`.

use crate::error::Result;
use crate::query::ask::asker::Asker;
use crate::query::ask::budget::Budget;
use crate::query::batch_api::{self, Collected, Sent, Submission, Submitted, check_submission};
use crate::query::client::{Client, ClientError};
use crate::query::{Queries, QueryError};
use crate::workdir::Artifact;

use super::QuerySession;

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
        let submission = self.submission(client, &queries);
        let first = submission.requests("", &mut taken.clone());
        if first.is_empty() {
            return Ok(Sent { sent: 0, waiting });
        }
        let (now, later) = submission.cost(1, &mut taken.clone());
        let budget = Budget::new(self.price().cloned(), self.options.max_usd);
        check_submission(&now.plus(later), &budget, client.answerer())?;
        client.announce_submission(first.len(), &now.plus(later));
        let answered = submission.ask_first(&budget, &mut taken.clone())?;
        // With --answers live, it stays open although it is recorded.
        taken.extend(answered.and_then(Result::ok).map(|recording| recording.key));
        let requests = submission.requests("", &mut taken.clone());
        let sent = requests.len();
        let (_, later) = submission.cost(0, &mut taken);
        check_submission(&later, &budget, client.answerer())?;
        batch_api::submit(client, requests, |job| -> Result<()> {
            submitted.jobs.push(job);
            Ok(self.work.write_json(Artifact::BatchApiJobs, &submitted)?)
        })?;
        Ok(Sent { sent, waiting })
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
            let left = self.submission(client, &queries).record(ended.answered, &mut collected)?;
            ended.failed.into_iter().for_each(|(_, reason)| collected.add_failed(&reason));
            submitted.keep_waiting(&job.id, left);
            self.work.write_json(Artifact::BatchApiJobs, &submitted)?;
        }
        Ok(collected)
    }

    /// Questions of the session, to be sent by `client`.
    pub fn submission<'s>(&'s self, client: &'s Client, queries: &'s Queries) -> Submission<'s> {
        Submission { client, queries, recordings: &self.recordings, price: self.price() }
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
