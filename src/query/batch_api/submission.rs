//! The questions of a scene or picture that may go through the Batch API: what they cost, the requests that ask them, and
//! their answers, which become recordings.

use std::collections::{BTreeMap, BTreeSet};

use super::{Answered, Collected, JobRequest, SentQuestion};
use crate::query::answer::Unknown;
use crate::query::ask::asker::{AskError, Asker, Request};
use crate::query::ask::budget::Budget;
use crate::query::ask::cost::{Cost, Price};
use crate::query::ask::queries::Queries;
use crate::query::client::Client;
use crate::query::error::QueryError;
use crate::query::question::Question;
use crate::query::question::shown_subject::ShownSubject;
use crate::query::recorded::sha256::Sha256Hex;
use crate::query::recorded::{Answerer, Recording, Recordings, Who, key};
use crate::query::{Failure, Outcome};

/// Questions, the client that sends them, and where their answers are recorded.
pub struct Submission<'a> {
    pub client: &'a Client,
    pub queries: &'a Queries<'a>,
    pub recordings: &'a Recordings,
    /// The price of the model, if known.
    pub price: Option<&'a Price>,
}

/// Whether the key of a question is not in `taken`, to which it is then added.
fn not_in(taken: &mut BTreeSet<Sha256Hex>, answerer: &Answerer) -> impl FnMut(&ShownSubject, &Question) -> bool {
    move |subject, question| taken.insert(key(answerer, &subject.asked(question)))
}

impl Submission<'_> {
    /// The cost of asking the open questions that are not `taken`, to which they are added: the first `at_once` of them
    /// live, and the others through the Batch API.
    pub fn cost(&self, at_once: usize, taken: &mut BTreeSet<Sha256Hex>) -> (Cost, Cost) {
        let answerer = self.client.answerer();
        let due = not_in(taken, answerer);
        self.queries.submission_cost(self.recordings, answerer, self.price, at_once, due)
    }

    /// Asks the first open question that is not `taken`, to which it is added, at once. Returns the recorded answer, or why
    /// there is none; `None` if no question is open.
    ///
    /// # Errors
    /// If the server cannot answer it.
    pub fn ask_first(
        &self,
        budget: &Budget,
        taken: &mut BTreeSet<Sha256Hex>,
    ) -> Result<Option<Result<Recording, Failure>>, QueryError> {
        let answerer = self.client.answerer();
        let first = self.queries.ask_first(self.recordings, self.client, budget, not_in(taken, answerer))?;
        let Some((asked, outcome)) = first else { return Ok(None) };
        match outcome {
            Outcome::Failed(Failure::Endpoint { message }) => Err(QueryError::BatchApi(AskError::Failed(message))),
            Outcome::Failed(failure) => Ok(Some(Err(failure))),
            Outcome::Answered(_) => {
                let recorded = self.recordings.find(&asked, Who::Exactly(answerer), &|_| true);
                let (recording, _) = recorded.expect("an answer is recorded before it is returned");
                Ok(Some(Ok(recording)))
            }
        }
    }

    /// The open questions that are not `taken`, to which they are added, with the owner `owner`.
    pub fn requests(&self, owner: &str, taken: &mut BTreeSet<Sha256Hex>) -> Vec<JobRequest> {
        let answerer = self.client.answerer();
        let open = self.queries.unanswered(self.recordings, Some(answerer));
        let mut due = not_in(taken, answerer);
        let mut requests: BTreeMap<_, JobRequest> = BTreeMap::new();
        for (subject, question) in open.into_iter().filter(|(subject, question)| due(subject, question)) {
            let asked = subject.asked(question);
            let key = key(answerer, &asked);
            let payload = self.client.payload(Request { question, picture: &subject.jpeg, correction: None });
            let sent = SentQuestion { key: key.clone(), owner: owner.to_owned(), asked };
            requests.insert(key, JobRequest { question: sent, payload });
        }
        requests.into_values().collect()
    }

    /// Records the usable answers and counts all. Returns what must go on waiting, because it is none of these questions:
    /// it was asked with other prompts, materials or options, with which it can still be collected.
    pub fn record(
        &self,
        answered: Vec<(SentQuestion, Answered)>,
        collected: &mut Collected,
    ) -> Result<Vec<SentQuestion>, QueryError> {
        let mut left = Vec::new();
        for (waiting, Answered { text, served_model, usage }) in answered {
            match self.queries.check(&waiting.asked, &text, Unknown::TakeNearest) {
                None => {
                    collected.of_others += 1;
                    left.push(waiting);
                }
                Some(Err(problem)) => collected.add_failed(&problem.failure),
                Some(Ok(())) => {
                    let recording = Recording::new(self.client.answerer(), waiting.asked, text, served_model, usage);
                    self.recordings.insert(&recording)?;
                    collected.recorded += 1;
                }
            }
        }
        Ok(left)
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
