//! The questions of all scenes in one submission to the Batch API: every scene is segmented, its open questions are
//! gathered, and the questions that were sent are noted in the batch's folder, each with its scene. Answers are
//! recorded where the scene itself would have recorded them, so that the next run of the batch finds them.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::files::json;
use crate::files::write;
use crate::pipeline::stages::questions::session_of;
use crate::pipeline::stages::subjects::FoundSubjects;
use crate::pipeline::{self, Pipeline, Plan, Stage};
use crate::query::ask::asker::Asker;
use crate::query::ask::cost::Cost;
use crate::query::batch_api::{
    self as api, Answered, Collected, JobRequest, Sent, SentQuestion, Submitted, check_submission,
};
use crate::query::client::{ApiKey, Client, ClientError};
use crate::query::recorded::Recording;
use crate::query::session::{self, QuerySession};
use crate::query::{self, AnswerSource, Queries, QueryError, Sha256Hex};
use crate::words::progress::Progress;
use crate::workdir;

use super::scheduler::Due;
use super::select::Selected;
use super::{Asked, Batch, BatchError, FailedScene, Ledger, News, State};

/// The questions of a batch's scenes.
pub struct BatchQuestions<'a> {
    batch: &'a Batch,
    client: Client,
    answers: AnswerSource,
    /// The budget of the submission.
    budget: query::ask::budget::Budget,
    /// Returns a scene's options, including those of its `gprop.toml`.
    options_of: &'a dyn Fn(&Path) -> Result<pipeline::Options>,
    /// Prevents other processes from sending or collecting the questions of this shard.
    _lock: Ledger,
}

impl<'a> BatchQuestions<'a> {
    /// The questions of `batch`, for the server that `options` name.
    ///
    /// # Errors
    /// If no server is named, or another process works on the shard.
    pub fn new(
        batch: &'a Batch,
        options: &pipeline::Options,
        options_of: &'a dyn Fn(&Path) -> Result<pipeline::Options>,
    ) -> Result<Self> {
        let (key, network) =
            (ApiKey::from_environment(&options.query).map_err(ClientError::from)?, options.setup.network());
        let client = Client::new(&options.query, key, network, Progress::HIDDEN)?.ok_or(ClientError::NoUrl)?;
        let budget = query::ask::budget::Budget::new(session::price(&options.query)?, options.query.max_usd);
        let lock = Ledger::open(&batch.home(), batch.shard())?;
        Ok(Self { batch, client, answers: options.query.answers, budget, options_of, _lock: lock })
    }

    /// Segments all scenes and sends the questions that are neither recorded nor in progress. The first question is
    /// asked at once: a wrong key or model then shows immediately and not a day later. The cost of all questions is
    /// added up beforehand. A question that several scenes have is sent once, and its answer is recorded for each.
    pub fn submit(&self) -> Result<(Sent, Vec<FailedScene>)> {
        api::check_may_send(self.answers)?;
        self.client.ready().map_err(QueryError::BatchApi)?;
        let mut submitted = self.submitted()?;
        let waiting = submitted.jobs.iter().map(|job| job.waiting.len()).sum();
        let (scenes, mut failures) = self.segmented()?;
        let mut taken = submitted.keys();
        let (pictures, now, later) = self.open(&scenes, taken.clone());
        let mut first = None;
        if pictures > 0 {
            check_submission(&now.plus(later), &self.budget, self.client.answerer())?;
            self.client.announce_submission(pictures, &now.plus(later));
            first = self.ask_first(&scenes, &taken)?;
            check_submission(&later, &self.budget, self.client.answerer())?;
        }
        // Noted with each job, so that a submission that is cut short leaves no scene without its answers.
        let shared = RefCell::new(Vec::<SentQuestion>::new());
        let gather = |scene: &&Selected| {
            let open = self.requests(scene, first.as_ref()).unwrap_or_else(|error| {
                failures.push(FailedScene { scene: scene.name.clone(), error: error.to_string() });
                Vec::new()
            });
            let is_new = |request: &JobRequest| taken.insert(request.question.key.clone());
            let (new, known): (Vec<JobRequest>, Vec<JobRequest>) = open.into_iter().partition(is_new);
            shared.borrow_mut().extend(known.into_iter().map(|request| request.question));
            new
        };
        let mut sent = 0;
        api::submit(&self.client, scenes.iter().flat_map(gather), |job| -> Result<()> {
            sent += job.waiting.len();
            submitted.jobs.push(job);
            submitted.share(shared.take());
            self.save(&submitted)
        })?;
        if submitted.share(shared.into_inner()) {
            self.save(&submitted)?;
        }
        Ok((Sent { sent, waiting }, failures))
    }

    /// Fetches the jobs that have ended and records their answers, each with its scene. Answers for a scene that cannot
    /// be opened remain to be collected.
    pub fn collect(&self) -> Result<(Collected, Vec<FailedScene>)> {
        let mut submitted = self.submitted()?;
        if submitted.jobs.is_empty() {
            return Err(QueryError::NothingSubmitted.into());
        }
        let mut collected = Collected { jobs_file: self.path(), ..Collected::default() };
        let mut failures = Vec::new();
        for job in submitted.jobs.clone() {
            let Some(ended) = collected.fetch(&self.client, &job)? else { continue };
            let mut by_scene: BTreeMap<String, Vec<(SentQuestion, Answered)>> = BTreeMap::new();
            for (waiting, answered) in ended.answered {
                by_scene.entry(waiting.owner.clone()).or_default().push((waiting, answered));
            }
            let mut left = Vec::new();
            for (scene, answered) in by_scene {
                let all: Vec<SentQuestion> = answered.iter().map(|(waiting, _)| waiting.clone()).collect();
                left.extend(self.record(&scene, answered, &mut collected).unwrap_or_else(|error| {
                    failures.push(FailedScene { scene, error: error.to_string() });
                    all
                }));
            }
            ended.failed.into_iter().for_each(|(_, reason)| collected.add_failed(&reason));
            submitted.keep_waiting(&job.id, left);
            self.save(&submitted)?;
        }
        Ok((collected, failures))
    }

    /// Returns what must go on waiting.
    fn record(
        &self,
        scene: &str,
        answered: Vec<(SentQuestion, Answered)>,
        collected: &mut Collected,
    ) -> Result<Vec<SentQuestion>> {
        let Some(scene) = self.batch.scenes().find(|known| known.name == scene) else {
            return Err(BatchError::NotOfThisBatch.into());
        };
        self.with_session(scene, |session, queries| {
            Ok(session.submission(&self.client, queries).record(answered, collected)?)
        })
    }

    /// The scenes that could be segmented, and the failures.
    fn segmented(&self) -> Result<(Vec<&'a Selected>, Vec<FailedScene>)> {
        let all: Vec<&Selected> = self.batch.scenes().collect();
        let mut failures = Vec::new();
        let due: Vec<Due> = all.iter().map(|scene| Due { scene, asked: Asked::default() }).collect();
        self.batch.scheduler(Stage::Segment)?.run(&due, &|_| String::new(), &mut |news| {
            if let News::Ended(outcome) = news
                && outcome.state == State::Failed
            {
                failures.push(outcome.as_failed());
            }
            Ok(())
        })?;
        failures.sort();
        let failed = |scene: &&Selected| failures.iter().any(|of| of.scene == scene.name);
        Ok((all.into_iter().filter(|scene| !failed(scene)).collect(), failures))
    }

    /// Asks the first open question of the first scene that has one. Returns the answer if there is one.
    fn ask_first(&self, scenes: &[&Selected], taken: &BTreeSet<Sha256Hex>) -> Result<Option<Recording>> {
        for scene in scenes {
            let asked = self.with_session(scene, |session, queries| {
                Ok(session.submission(&self.client, queries).ask_first(&self.budget, &mut taken.clone()))
            });
            // A scene that cannot be opened is reported when its questions are gathered.
            if let Ok(asked) = asked
                && let Some(answer) = asked?
            {
                return Ok(answer.ok());
            }
        }
        Ok(None)
    }

    /// The open questions of a scene. If it has the `first` question of all, the answer to that is recorded instead.
    fn requests(&self, scene: &Selected, first: Option<&Recording>) -> Result<Vec<JobRequest>> {
        self.with_session(scene, |session, queries| {
            let submission = session.submission(&self.client, queries);
            let requests = submission.requests(&scene.name, &mut BTreeSet::new());
            let is_first = |request: &JobRequest| first.is_some_and(|first| first.key == request.question.key);
            let (answered, open): (Vec<JobRequest>, Vec<JobRequest>) = requests.into_iter().partition(is_first);
            let with_answer = |(request, first): (JobRequest, &Recording)| {
                let Recording { response: text, served_model, usage, .. } = first.clone();
                (request.question, Answered { text, served_model, usage })
            };
            let answered = answered.into_iter().zip(first).map(with_answer).collect();
            submission.record(answered, &mut Collected::default())?;
            Ok(open)
        })
    }

    /// The number of questions that are neither answered nor `taken`, the cost of asking the first of them live, and the
    /// cost of the others through the Batch API. A scene that cannot be opened is reported when its questions are gathered.
    fn open(&self, scenes: &[&Selected], mut taken: BTreeSet<Sha256Hex>) -> (usize, Cost, Cost) {
        let (before, mut now, mut later) = (taken.len(), Cost::default(), Cost::default());
        for scene in scenes {
            let at_once = usize::from(taken.len() == before);
            let of_scene = self.with_session(scene, |session, queries| {
                Ok(session.submission(&self.client, queries).cost(at_once, &mut taken))
            });
            if let Ok((now_of_scene, later_of_scene)) = of_scene {
                now = now.plus(now_of_scene);
                later = later.plus(later_of_scene);
            }
        }
        (taken.len() - before, now, later)
    }

    /// Applies `work` to the questions of a scene that is segmented.
    fn with_session<T>(&self, scene: &Selected, work: impl FnOnce(&QuerySession, &Queries) -> Result<T>) -> Result<T> {
        let plan = Plan::to(Stage::Consensus);
        let options = (self.options_of)(&scene.folder)?;
        let builder = Pipeline::builder(&scene.folder).options(options).plan(plan);
        let builder = match scene.named_work() {
            Some(work) => builder.out(work),
            None => builder,
        };
        let mut pipeline = builder.open()?;
        pipeline.run()?;
        let open = pipeline.opened();
        let about = FoundSubjects::of(open)?;
        let session = session_of(open, &about, &open.options.query)?;
        work(&session, &session.queries()?)
    }

    fn path(&self) -> PathBuf {
        let super::Shard { index, of } = self.batch.shard();
        self.batch.home().join(format!("queries-{index}-of-{of}.json"))
    }

    fn submitted(&self) -> Result<Submitted> {
        let path = self.path();
        Ok(if path.exists() { workdir::read_json(&path)? } else { Submitted::default() })
    }

    fn save(&self, submitted: &Submitted) -> Result<()> {
        let path = self.path();
        let written = write::file(&path, |out| out.write_all(json::compact(submitted)?.as_bytes()));
        Ok(written.map_err(|source| BatchError::Io { path, source })?)
    }
}
