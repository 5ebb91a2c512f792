//! The part queries of all scenes in one submission to the Batch API: every scene is segmented, its open questions are
//! gathered, and what was sent is noted in the batch's folder, each question with its scene. Answers are recorded where the
//! scene would have recorded them itself, so that the next run of the batch finds them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::exit;
use crate::pipeline::desk::Desk;
use crate::pipeline::{self, Collected, Pipeline, Plan, Sent, Stage};
use crate::progress::Progress;
use crate::query::asker::Asker;
use crate::query::batch::{self as api, Answered, Submitted, Waiting};
use crate::query::client::{ApiKey, Client, ClientError};
use crate::query::cost::Cost;
use crate::query::{self, Queries, QueryError};
use crate::workdir;

use super::select::Selected;
use super::{Batch, BatchError, Ledger, Outcome, State};

/// The two halves of a submission.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum QuestionStep {
    /// Segment all scenes and send their open queries.
    Submit,
    /// Fetch and record what has been answered.
    Collect,
}

/// Scenes that a step could not be done for, with the reason.
pub type Failures = Vec<(String, String)>;

/// The questions of a batch's scenes.
pub struct Questions<'a> {
    batch: &'a Batch,
    client: Client,
    max_usd: Option<f64>,
    /// A scene's options, its `gprop.toml` included.
    options_of: &'a dyn Fn(&Path) -> Result<pipeline::Options>,
    /// No other process sends or collects the questions of this shard.
    _lock: Ledger,
}

impl<'a> Questions<'a> {
    /// The questions of `batch`, to be put to the endpoint of `options`.
    ///
    /// # Errors
    /// Where no endpoint is named, or another process works on the shard.
    pub fn new(
        batch: &'a Batch,
        options: &query::Options,
        options_of: &'a dyn Fn(&Path) -> Result<pipeline::Options>,
    ) -> Result<Self> {
        let client = Client::new(options, ApiKey::from_environment()?)?.ok_or(ClientError::NoUrl)?;
        let lock = Ledger::open(&batch.home(), batch.shard())?;
        Ok(Self { batch, client, max_usd: options.max_usd, options_of, _lock: lock })
    }

    /// Segments all scenes and sends what is neither recorded nor under way. The first question is asked at once: a wrong key
    /// or model shows now and not a day later. With a budget, the most that all may cost is added up before.
    pub fn submit(&self) -> Result<(Sent, Failures)> {
        let mut submitted = self.submitted()?;
        let waiting = submitted.batches.iter().map(|batch| batch.waiting.len()).sum();
        let (scenes, mut failures) = self.segmented()?;
        if let Some(max_usd) = self.max_usd {
            self.check_budget(&scenes, max_usd)?;
        }
        let under_way = submitted.clone();
        self.ask_first(&scenes, &under_way)?;
        let gather = |scene: &&Selected| {
            let gathered = self
                .with_desk(scene, |desk, queries| Ok(desk.requests(&self.client, queries, &under_way, &scene.name)));
            gathered.unwrap_or_else(|error| {
                failures.push((scene.name.clone(), exit::message(&error)));
                Vec::new()
            })
        };
        // Two scenes may ask the same; a batch takes each question once.
        let mut seen = BTreeSet::new();
        let requests = scenes.iter().flat_map(gather).filter(|request| seen.insert(request.waiting.key.clone()));
        let mut sent = 0;
        api::submit(&self.client, requests, |batch| -> Result<()> {
            sent += batch.waiting.len();
            submitted.batches.push(batch);
            self.save(&submitted)
        })?;
        Ok((Sent { sent, waiting }, failures))
    }

    /// Fetches the batches that have ended and records their answers, each with its scene. What was answered for a scene that
    /// cannot be opened now stays to be collected.
    pub fn collect(&self) -> Result<(Collected, Failures)> {
        let mut submitted = self.submitted()?;
        if submitted.batches.is_empty() {
            return Err(QueryError::NothingSubmitted.into());
        }
        let (mut collected, mut failures) = (Collected::default(), Failures::new());
        for batch in submitted.batches.clone() {
            let ended = match api::collect(&self.client, &batch).map_err(QueryError::Batch)? {
                api::Progress::Running { counts, .. } => {
                    collected.add_running(counts, batch.waiting.len());
                    continue;
                }
                api::Progress::Ended(ended) => ended,
            };
            let mut by_scene: BTreeMap<String, Vec<(Waiting, Answered)>> = BTreeMap::new();
            for (waiting, answered) in ended.answered {
                by_scene.entry(waiting.owner.clone()).or_default().push((waiting, answered));
            }
            let mut left = Vec::new();
            for (scene, answered) in by_scene {
                let kept: Vec<Waiting> = answered.iter().map(|(waiting, _)| waiting.clone()).collect();
                if let Err(error) = self.record(&scene, answered, &mut collected) {
                    failures.push((scene, exit::message(&error)));
                    left.extend(kept);
                }
            }
            ended.failed.into_iter().for_each(|(_, reason)| collected.add_failed(reason));
            submitted.batches.retain(|other| other.id != batch.id);
            if !left.is_empty() {
                submitted.batches.push(api::Batch { id: batch.id, waiting: left });
            }
            self.save(&submitted)?;
        }
        Ok((collected, failures))
    }

    fn record(&self, scene: &str, answered: Vec<(Waiting, Answered)>, collected: &mut Collected) -> Result<()> {
        let Some(scene) = self.batch.scenes().find(|known| known.name == scene) else {
            anyhow::bail!(BatchError::NotOfThisBatch);
        };
        self.with_desk(scene, |desk, queries| {
            for (waiting, answered) in answered {
                match desk.record(queries, &self.client, waiting, answered)? {
                    Ok(()) => collected.recorded += 1,
                    Err(reason) => collected.add_failed(reason),
                }
            }
            Ok(())
        })
    }

    /// The scenes that could be segmented, and the others.
    fn segmented(&self) -> Result<(Vec<&'a Selected>, Failures)> {
        let all: Vec<&Selected> = self.batch.scenes().collect();
        let mut failures = Failures::new();
        self.batch.crew(Stage::Segment)?.run(&all, &|_| String::new(), &mut |outcome| {
            let Outcome { scene, state, error, .. } = outcome;
            if state == State::Failed {
                failures.push((scene, error.unwrap_or_default()));
            }
            Ok(())
        })?;
        failures.sort();
        let failed = |scene: &&Selected| failures.iter().any(|(name, _)| *name == scene.name);
        Ok((all.into_iter().filter(|scene| !failed(scene)).collect(), failures))
    }

    /// Puts the first open question of the first scene that has one.
    fn ask_first(&self, scenes: &[&Selected], under_way: &Submitted) -> Result<()> {
        for scene in scenes {
            let asked = self.with_desk(scene, |desk, queries| {
                let open = !desk.requests(&self.client, queries, under_way, &scene.name).is_empty();
                Ok(open.then(|| desk.ask_first(&self.client, queries)))
            });
            // A scene that cannot be opened is told of when its questions are gathered.
            if let Ok(Some(answer)) = asked {
                return answer;
            }
        }
        Ok(())
    }

    /// Whether all open questions at their longest answers, one of them at the full price, stay within the budget.
    fn check_budget(&self, scenes: &[&Selected], max_usd: f64) -> Result<()> {
        let mut cost = Cost::default();
        for scene in scenes {
            let of_scene = self.with_desk(scene, |desk, queries| Ok(desk.plan(queries).cost));
            cost = cost.plus(of_scene.unwrap_or_default());
        }
        let most = |cost: &Cost| cost.most_usd.unwrap_or(f64::INFINITY);
        let requests = cost.requests;
        if requests == 0 {
            return Ok(());
        }
        let first = most(&cost) / requests as f64;
        let usd = most(&cost.by_batch()) + first;
        if usd.is_finite() && usd <= max_usd {
            return Ok(());
        }
        Err(match usd.is_finite() {
            true => QueryError::OverBudget { requests, usd, max_usd },
            false => QueryError::NoPrice { model: self.client.answerer().model.clone() },
        }
        .into())
    }

    /// Does something with the questions of a scene that is segmented.
    fn with_desk<T>(&self, scene: &Selected, work: impl FnOnce(&Desk, &Queries) -> Result<T>) -> Result<T> {
        let plan = Plan { to: Stage::Segment, from: None };
        let options = (self.options_of)(&scene.folder)?;
        let mut pipeline = Pipeline::open(&scene.folder, Some(&scene.work), options, plan, Progress::Hidden)?;
        pipeline.run()?;
        let desk = pipeline.desk()?;
        work(&desk, &desk.queries()?)
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
        let written = workdir::write_atomic(&path, |out| Ok(serde_json::to_writer(out, submitted)?));
        Ok(written.map_err(|source| BatchError::Io { path, source })?)
    }
}
