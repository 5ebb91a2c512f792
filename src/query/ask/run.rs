//! The stage: answers from recordings first, then from the asker, several questions at once.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use serde::Serialize;

use super::asker::Asker;
use super::budget::{Budget, Spent};
use super::cost::{Cost, Price};
use super::live::{Live, Stop};
use super::queries::Queries;
use super::replay::{self, Replayed};
use super::whole::{AnyWholeQuestion, WholeAnswer, WholeOutcome, WholeQuestion};
use crate::parallel;
use crate::query::answer::Problem;
use crate::query::error::{MissingAnswer, QueryError};
use crate::query::options::AnswerSource;
use crate::query::question::Question;
use crate::query::question::shown_subject::ShownSubject;
use crate::query::recorded::sha256::Sha256Hex;
use crate::query::recorded::{Answerer, Miss, QuestionId, Recordings};
use crate::query::{Answers, Failure, Match, Outcome, SubjectAnswer, SubjectId};
use crate::words::progress::Progress;

/// The estimate before anything is sent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Preview {
    /// Questions whose answers are recorded and those that are then due.
    pub questions: usize,
    /// Questions whose answer is recorded.
    pub recorded: usize,
    /// The most questions that there may be in all, if answers disagree and parts consist of several materials.
    pub at_most: usize,
    /// Cost of asking those that are due.
    pub cost: Cost,
}

/// The text that follows "questions: ".
impl std::fmt::Display for Preview {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { questions, recorded, at_most, cost } = self;
        let more = if at_most > questions {
            format!(" (at most {at_most} if answers disagree or name several materials)")
        } else {
            String::new()
        };
        write!(f, "{questions}{more}, {recorded} recorded; to ask: {cost}")
    }
}

/// All answers, and what they cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    pub answers: Answers,
    pub spent: Spent,
}

/// A subject that must be asked about, by its index among the subjects.
struct Open<'a> {
    index: usize,
    question: &'a Question,
    so_far: Match,
    miss: Miss,
    /// Why the recorded answer cannot be used, if there is one.
    problem: Option<Problem>,
}

/// The subjects by what the recordings hold for them.
struct Sorted<'a> {
    answered: Vec<(usize, Outcome)>,
    open: Vec<Open<'a>>,
}

impl Sorted<'_> {
    /// Counts the subjects whose recorded answers cannot be used as failed: nobody is asked again.
    fn fail_unusable(&mut self) {
        let open = std::mem::take(&mut self.open);
        let (unusable, open): (Vec<Open>, Vec<Open>) = open.into_iter().partition(|open| open.problem.is_some());
        self.open = open;
        let failed = |open: Open| Some((open.index, replay::unusable(open.problem?)));
        self.answered.extend(unusable.into_iter().filter_map(failed));
    }

    /// Counts the subjects without a recorded answer as not answered yet.
    fn leave_open(&mut self) {
        let open = std::mem::take(&mut self.open);
        self.answered.extend(open.into_iter().map(|open| (open.index, Outcome::Failed(Failure::Unanswered))));
    }
}

impl Queries<'_> {
    /// How much is recorded, and what asking about the rest would cost. `answerer` is the one that would be asked.
    pub fn preview(&self, recordings: &Recordings, answerer: Option<&Answerer>, price: Option<&Price>) -> Preview {
        let sorted = self.sort(recordings, answerer);
        let open = self.open_whole(recordings, answerer);
        let cost = open.iter().map(|whole| self.cost_of_whole(*whole, price));
        let questions = self.subjects.len() + self.whole.len();
        Preview {
            questions,
            recorded: sorted.answered.len() + self.whole.len() - open.len(),
            at_most: questions,
            cost: cost.fold(self.cost_of(&sorted.open, price), Cost::plus),
        }
    }

    /// The outcome of every subject that is recorded, in their order. `answerer` is the one that would be asked.
    pub fn recorded(&self, recordings: &Recordings, answerer: Option<&Answerer>) -> Vec<Option<Outcome>> {
        let mut outcomes: Vec<Option<Outcome>> = vec![None; self.subjects.len()];
        for (index, outcome) in self.sort(recordings, answerer).answered {
            outcomes[index] = Some(outcome);
        }
        outcomes
    }

    /// The subjects that are not recorded, each with the question to be asked next; then the whole object, with each of its
    /// questions that is not recorded. `answerer` is the one that would be asked.
    pub fn unanswered(&self, recordings: &Recordings, answerer: Option<&Answerer>) -> Vec<(&ShownSubject, &Question)> {
        let sorted = self.sort(recordings, answerer);
        let subjects = sorted.open.into_iter().map(|open| (&self.subjects[open.index], open.question));
        let whole = self.open_whole(recordings, answerer).into_iter().map(|whole| (whole.shown(), whole.question()));
        subjects.chain(whole).collect()
    }

    /// The questions about the whole object that are not recorded.
    fn open_whole(&self, recordings: &Recordings, answerer: Option<&Answerer>) -> Vec<&dyn AnyWholeQuestion> {
        let who = replay::who(answerer, self.options);
        let is_open = |whole: &&dyn AnyWholeQuestion| {
            let is_readable = |response: &str| whole.check(response).is_ok();
            self.options.answers == AnswerSource::Live
                || recordings.find(&whole.shown().asked(whole.question()), who, &is_readable).is_err()
        };
        self.whole.iter().copied().filter(is_open).collect()
    }

    /// The recorded answer to a question about the whole object, or why there is none. `answerer` is the one that would be
    /// asked.
    pub fn recorded_whole<A>(
        &self,
        whole: &WholeQuestion<A>,
        recordings: &Recordings,
        answerer: Option<&Answerer>,
    ) -> Result<A, Miss> {
        match self.options.answers {
            AnswerSource::Live => Err(Miss::Live),
            _ => replay::replay_whole(whole, recordings, replay::who(answerer, self.options)),
        }
    }

    /// The answer to a question about the whole object: recorded, or asked now and recorded.
    ///
    /// # Errors
    /// As for [`Self::run`], but [`QueryError::MissingWhole`] if it is not recorded and there is no asker.
    pub fn ask_whole<A>(
        &self,
        whole: &WholeQuestion<A>,
        recordings: &Recordings,
        asker: Option<&dyn Asker>,
        budget: &Budget,
        progress: Progress,
    ) -> Result<WholeAnswer<A>, QueryError> {
        let view = whole.shown.view.clone();
        let asker = asker.filter(|_| self.options.answers.may_ask());
        let outcome = match (self.recorded_whole(whole, recordings, asker.map(Asker::answerer)), asker) {
            (Ok(answer), _) => WholeOutcome::Answered(answer),
            (Err(miss), None) => {
                return Err(QueryError::MissingWhole { purpose: whole.purpose, view, miss, scene: None });
            }
            (Err(_), Some(asker)) => {
                check_ready(asker, 1)?;
                let cost = self.cost_of_whole(whole, budget.price());
                check_budget(&cost, asker.answerer(), budget)?;
                recordings.check_writable()?;
                announce(asker, 1, &cost, budget);
                let live = Live { queries: self, recordings, asker, budget, progress };
                live.whole(whole).map_err(|stop| live.error(stop, 1))?
            }
        };
        Ok(WholeAnswer { view, outcome })
    }

    /// Asks about the first subject that is not recorded and whose question is `due`, and returns that question with the
    /// outcome; `None` if there is none. Nothing is announced.
    pub fn ask_first(
        &self,
        recordings: &Recordings,
        asker: &dyn Asker,
        budget: &Budget,
        mut due: impl FnMut(&ShownSubject, &Question) -> bool,
    ) -> Result<Option<(QuestionId, Outcome)>, QueryError> {
        let sorted = self.sort(recordings, Some(asker.answerer()));
        let is_due = |open: &Open| due(&self.subjects[open.index], open.question);
        let Some(at) = sorted.open.iter().position(is_due) else { return Ok(None) };
        let first = &sorted.open[at];
        let mut answer = None;
        check_ready(asker, sorted.open.len())?;
        recordings.check_writable()?;
        budget.announce(asker.most_requests(self.questions.longest_chain().len()));
        let live = Live { queries: self, recordings, asker, budget, progress: Progress::HIDDEN };
        ask_all(&live, std::slice::from_ref(first), &mut |_, outcome| answer = Some(outcome))?;
        Ok(answer.map(|outcome| (self.subjects[first.index].asked(first.question), outcome)))
    }

    /// The recordings that answer any subject, whoever answered: all others are unused by these views and options.
    pub fn used(&self, recordings: &Recordings) -> BTreeSet<Sha256Hex> {
        let of_subjects =
            self.subjects.iter().flat_map(|subject| self.questions.all().map(|question| subject.asked(question)));
        let of_whole = self.whole.iter().map(|whole| whole.shown().asked(whole.question()));
        let asked: Vec<QuestionId> = of_subjects.chain(of_whole).collect();
        parallel::flat_map(&asked, |asked| recordings.serving(asked)).into_iter().collect()
    }

    /// Answers every subject: from `recordings`, and from `asker` if they have no answer.
    ///
    /// The result has the answers in the order of the subjects. A subject that could not be answered is a typed failure
    /// among the answers and is not recorded. Requests are entered in `budget`, which holds the budget and may have entries
    /// of earlier runs.
    ///
    /// # Errors
    /// [`QueryError::Missing`] if an answer is not recorded and there is no asker. An error if the budget does not
    /// suffice, if the server cannot answer at all, or if a recording cannot be saved.
    pub fn run(
        &self,
        recordings: &Recordings,
        asker: Option<&dyn Asker>,
        budget: &Budget,
        progress: Progress,
    ) -> Result<Run, QueryError> {
        let asker = asker.filter(|_| self.options.answers.may_ask());
        let mut sorted = self.sort(recordings, asker.map(Asker::answerer));
        if asker.is_none() {
            sorted.fail_unusable();
        }
        if self.options.answers == AnswerSource::Partial {
            sorted.leave_open();
        }
        let bar = progress.bar("query", self.subjects.len() as u64);
        let mut outcomes: Vec<Option<SubjectAnswer>> = vec![None; self.subjects.len()];
        let mut keep = |index: usize, outcome: Outcome| {
            let subject = &self.subjects[index];
            bar.inc(1);
            outcomes[index] = Some(SubjectAnswer {
                view: subject.view.clone(),
                subject: SubjectId::of(self.about, subject.id),
                outcome,
            });
        };

        match asker {
            _ if sorted.open.is_empty() => {}
            None => return Err(self.missing(&sorted.open)),
            Some(asker) => {
                check_ready(asker, sorted.open.len())?;
                let cost = self.cost_of(&sorted.open, budget.price());
                check_budget(&cost, asker.answerer(), budget)?;
                recordings.check_writable()?;
                announce(asker, sorted.open.len(), &cost, budget);
            }
        }
        for (index, outcome) in sorted.answered {
            keep(index, outcome);
        }
        if let Some(asker) = asker {
            let live = Live { queries: self, recordings, asker, budget, progress };
            ask_all(&live, &sorted.open, &mut keep)?;
        }
        bar.finish_and_clear();
        Ok(Run { answers: Answers::new(outcomes.into_iter().flatten().collect()), spent: budget.spent() })
    }

    fn sort(&self, recordings: &Recordings, answerer: Option<&Answerer>) -> Sorted<'_> {
        let who = replay::who(answerer, self.options);
        let replay = |subject: &ShownSubject| match self.options.answers {
            AnswerSource::Live => {
                Replayed::Missing { question: self.questions.first(), miss: Miss::Live, so_far: Match::Exact }
            }
            AnswerSource::Replay | AnswerSource::Partial | AnswerSource::Record => {
                replay::replay(self, subject, recordings, who)
            }
        };
        let replayed: Vec<Replayed> = parallel::map(&self.subjects, replay);
        let mut sorted = Sorted { answered: Vec::new(), open: Vec::new() };
        for (index, replayed) in replayed.into_iter().enumerate() {
            match replayed {
                Replayed::Answered(outcome) => sorted.answered.push((index, *outcome)),
                Replayed::Missing { question, miss, so_far } => {
                    sorted.open.push(Open { index, question, so_far, miss, problem: None });
                }
                Replayed::Unusable { question, problem, so_far } => {
                    sorted.open.push(Open { index, question, so_far, miss: Miss::Unusable, problem: Some(problem) });
                }
            }
        }
        sorted
    }

    /// The cost of the open questions and of those that may follow them.
    fn cost_of(&self, open: &[Open], price: Option<&Price>) -> Cost {
        let chain = self.questions.longest_chain();
        let with_next = open.iter().flat_map(|open| {
            let is_first = std::ptr::eq(open.question, chain[0]);
            let next = if is_first { &chain[1..] } else { &[] };
            std::iter::once(open.question).chain(next.iter().copied()).map(|next| (&self.subjects[open.index], next))
        });
        self.cost(with_next, price)
    }

    /// The cost of asking about the open subjects whose questions are `due`: about the first `at_once` of them live, and
    /// about the others through the Batch API.
    pub fn submission_cost(
        &self,
        recordings: &Recordings,
        answerer: &Answerer,
        price: Option<&Price>,
        at_once: usize,
        mut due: impl FnMut(&ShownSubject, &Question) -> bool,
    ) -> (Cost, Cost) {
        let open = self.unanswered(recordings, Some(answerer));
        let is_due = |(subject, question): &(&ShownSubject, &Question)| due(subject, question);
        let due: Vec<(&ShownSubject, &Question)> = open.into_iter().filter(is_due).collect();
        let (now, later) = due.split_at(at_once.min(due.len()));
        let cost = |due: &[(&ShownSubject, &Question)]| self.cost(due.iter().copied(), price);
        (cost(now), cost(later).by_batch_api())
    }

    fn missing(&self, open: &[Open]) -> QueryError {
        let missing = open.iter().map(|open| {
            let subject = &self.subjects[open.index];
            MissingAnswer { view: subject.view.clone(), subject: subject.id, miss: open.miss }
        });
        QueryError::Missing { questions: self.subjects.len(), missing: missing.collect(), scene: None }
    }
}

/// Checks that asking for `cost` stays within the budget.
fn check_budget(cost: &Cost, answerer: &Answerer, budget: &Budget) -> Result<(), QueryError> {
    let Some(max_usd) = budget.max_usd() else { return Ok(()) };
    match cost.usd {
        None => Err(QueryError::NoPrice { model: answerer.model.clone() }),
        Some(usd) => {
            let spent = budget.spent();
            if usd + spent.usd.unwrap_or(0.0) > max_usd {
                return Err(QueryError::OverBudget { requests: cost.requests, usd, max_usd, spent });
            }
            Ok(())
        }
    }
}

/// Tells how many requests there will be at most, and sees to it.
fn announce(asker: &dyn Asker, pictures: usize, cost: &Cost, budget: &Budget) {
    let most = asker.most_requests(cost.requests);
    budget.announce(most);
    asker.announce(pictures, most, cost);
}

/// Checks that the asker can be asked `questions` open questions.
fn check_ready(asker: &dyn Asker, questions: usize) -> Result<(), QueryError> {
    asker.ready().map_err(|error| QueryError::NotReady { error, questions })
}

/// What came of asking about several subjects.
#[derive(Default)]
struct Asking {
    answered: usize,
    failures: Vec<Failure>,
    stop: Option<Stop>,
}

impl Asking {
    /// Passes on an outcome. Of the reasons to stop, the first is reported, but a paid answer that could not be saved takes
    /// precedence.
    fn take(&mut self, live: &Live, told: Told, keep: &mut dyn FnMut(usize, Outcome)) {
        match told.outcome {
            Ok(Some(outcome)) => {
                match &outcome {
                    Outcome::Answered(_) => self.answered += 1,
                    Outcome::Failed(failure) => self.failures.push(failure.clone()),
                }
                keep(told.index, outcome);
            }
            Ok(None) => {}
            Err(reason) => {
                live.budget.close();
                if self.stop.as_ref().is_none_or(|stop: &Stop| reason.is_unkept() && !stop.is_unkept()) {
                    self.stop = Some(reason);
                }
            }
        }
    }

    /// The reason to stop: one that was found on the way, or that all of several questions failed alike. Those that follow
    /// would fail too. Refusals are about what a picture shows, and tell nothing about the next.
    fn reason_to_stop(self) -> Option<Stop> {
        let failed_alike = || {
            let (first, others) = self.failures.split_first()?;
            let is_refused = matches!(first, Failure::Refused { .. });
            let are_all = self.answered == 0 && !others.is_empty() && others.iter().all(|other| other == first);
            (are_all && !is_refused).then(|| Stop::InVain { last: first.clone(), reply: None })
        };
        self.stop.or_else(failed_alike)
    }
}

/// What came of asking about the open subject of this index.
struct Told {
    index: usize,
    outcome: Result<Option<Outcome>, Stop>,
}

impl Told {
    fn of(live: &Live, open: &Open) -> Self {
        let outcome = live.answer(&live.queries.subjects[open.index], open.question, open.so_far);
        Self { index: open.index, outcome }
    }
}

/// Asks about all open subjects; `keep` gets each outcome on this thread as it arrives. Until the server has given a usable
/// reply, one question is asked at a time: the form of request that a server accepts, and that it is of no use, are found
/// out once and not by every thread.
fn ask_all(live: &Live, open: &[Open], keep: &mut dyn FnMut(usize, Outcome)) -> Result<(), QueryError> {
    let mut asking = Asking::default();
    let mut rest = open;
    while !live.budget.is_proven()
        && !live.budget.is_closed()
        && let Some((first, others)) = rest.split_first()
    {
        asking.take(live, Told::of(live, first), keep);
        rest = others;
    }
    ask_in_parallel(live, rest, &mut asking, keep);
    let left = open.len() - asking.answered;
    asking.reason_to_stop().map_or(Ok(()), |stop| Err(live.error(stop, left)))
}

/// Asks with as many threads as the asker allows.
fn ask_in_parallel(live: &Live, open: &[Open], asking: &mut Asking, keep: &mut dyn FnMut(usize, Outcome)) {
    let (next, (sender, receiver)) = (AtomicUsize::new(0), mpsc::channel());
    std::thread::scope(|scope| {
        for _ in 0..live.asker.parallel().max(1).min(open.len()) {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                while !live.budget.is_closed()
                    && let Some(open) = open.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    if sender.send(Told::of(live, open)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        receiver.into_iter().for_each(|told| asking.take(live, told, keep));
    });
}
