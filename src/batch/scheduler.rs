//! Runs scenes side by side, within a memory budget.
//!
//! A scene is started if the [estimates](super::memory) of all running scenes leave room for its own. Estimates can be
//! wrong, so the memory that the processes use is sampled: if it exceeds the budget, the scene started last is killed
//! and waits until there is room for [more](GROWTH) than it used. A scene that exceeds the budget by itself fails, and
//! so does one that takes longer than `--max-minutes`.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::child::{Running, Task};
use super::memory::{self, Budget, Gauge};
use super::outcome::Ended;
use super::select::Selected;
use super::{Asked, BatchError, Outcome};

/// Up to this number, a scene's stages make good use of threads: views and prompts are processed in parallel.
pub const THREADS_A_SCENE: usize = 4;

const POLL: Duration = Duration::from_millis(20);
/// Interval at which the batch says how it stands.
const TELL: Duration = Duration::from_millis(250);
/// A scene that was killed while its memory was growing is assumed to need this many times the memory that it used.
const GROWTH: f64 = 1.5;

/// How scenes are run.
pub struct Scheduler {
    pub jobs: usize,
    pub budget: Budget,
    /// Limit for one scene's process.
    pub max_minutes: Option<f64>,
    pub task: Task,
}

/// A scene that is to be run.
#[derive(Debug, Clone, Copy)]
pub struct Due<'a> {
    pub scene: &'a Selected,
    /// What earlier processes of it have asked with this task.
    pub asked: Asked,
}

/// A scene that waits to be started, with its estimated need of memory.
struct Waiting<'a> {
    due: Due<'a>,
    need: u64,
}

/// What happens in a batch.
#[derive(Debug)]
pub enum News<'a> {
    /// So many scenes are to be run; those that need not be have asked this.
    Begins { due: usize, kept: usize, asked: Asked },
    /// A scene has ended.
    Ended(Box<Outcome>),
    /// How the batch stands, several times a second.
    Snapshot(Snapshot<'a>),
}

/// How a batch stands while it runs.
#[derive(Debug)]
pub struct Snapshot<'a> {
    pub running: Vec<RunningScene<'a>>,
    /// Number of scenes that wait to be started.
    pub waiting: usize,
}

/// A scene that is being run.
#[derive(Debug)]
pub struct RunningScene<'a> {
    pub name: &'a str,
    /// The stage that it does, by name.
    pub stage: Option<String>,
    /// What its processes have asked so far with this task.
    pub asked: Asked,
}

/// A running scene.
struct Worker<'a> {
    due: Due<'a>,
    need: u64,
    running: Running,
    /// Key of the scene when its process was started.
    key: String,
    held: u64,
    peak: u64,
}

impl Scheduler {
    /// Runs all of the scenes that are `due`, in order as far as the budget allows; `take` gets each outcome, and how the batch stands.
    pub fn run(
        &self,
        due: &[Due],
        key: &dyn Fn(&Selected) -> String,
        take: &mut dyn FnMut(News) -> Result<(), BatchError>,
    ) -> Result<(), BatchError> {
        let mut waiting: VecDeque<Waiting> = due.iter().map(|due| self.waiting(*due)).collect();
        let mut workers: Vec<Worker> = Vec::new();
        let mut gauge = Gauge::new();
        let mut told: Option<Instant> = None;
        while !waiting.is_empty() || !workers.is_empty() {
            while let Some(next) = self.next(&waiting, &workers).and_then(|index| waiting.remove(index)) {
                let Waiting { due, need } = next;
                // Before the process reads the files on which the key depends: they may change while it runs.
                let key = key(due.scene);
                let running = Running::start(due.scene, &self.task)?;
                workers.push(Worker { due, need, running, key, held: 0, peak: 0 });
            }
            std::thread::sleep(POLL);
            let ids: Vec<u32> = workers.iter().map(|worker| worker.running.id()).collect();
            for (worker, held) in workers.iter_mut().zip(gauge.read(&ids)) {
                worker.held = held;
                worker.peak = worker.peak.max(held);
            }
            if told.is_none_or(|told| told.elapsed() >= TELL) {
                let running = workers.iter_mut().map(Worker::snapshot).collect();
                take(News::Snapshot(Snapshot { running, waiting: waiting.len() }))?;
                told = Some(Instant::now());
            }
            let mut index = 0;
            while index < workers.len() {
                match self.outcome(&mut workers[index])? {
                    Some(outcome) => {
                        workers.remove(index);
                        take(News::Ended(Box::new(outcome)))?;
                    }
                    None => index += 1,
                }
            }
            if let Some(outcome) = self.relieve(&mut workers, &mut waiting)? {
                take(News::Ended(Box::new(outcome)))?;
            }
        }
        Ok(())
    }

    fn waiting<'a>(&self, due: Due<'a>) -> Waiting<'a> {
        Waiting { due, need: memory::need(due.scene.splat_bytes, self.task.to, self.task.threads) }
    }

    /// The outcome of a scene that has ended, or that is killed here because it took too long.
    fn outcome(&self, worker: &mut Worker) -> Result<Option<Outcome>, BatchError> {
        if let Some(ended) = worker.running.ended(worker.peak)? {
            return Ok(Some(worker.outcome(ended, None)));
        }
        let Some(limit) = self.max_minutes.filter(|limit| worker.running.age().as_secs_f64() > 60.0 * limit) else {
            return Ok(None);
        };
        let ended = worker.running.kill(worker.peak)?;
        Ok(Some(worker.outcome(ended, Some(format!("took longer than --max-minutes {limit}")))))
    }

    /// The first scene that fits beside the running ones; if none is running, the first of all, whatever it needs.
    fn next(&self, waiting: &VecDeque<Waiting>, workers: &[Worker]) -> Option<usize> {
        if workers.len() >= self.jobs {
            return None;
        }
        let taken: u64 = workers.iter().map(|worker| worker.need.max(worker.peak)).sum();
        let fits = waiting.iter().position(|waiting| taken + waiting.need <= self.budget.bytes);
        fits.or((workers.is_empty() && !waiting.is_empty()).then_some(0))
    }

    /// Kills the scene started last if all together use more than the budget; returns its outcome if it cannot run again.
    fn relieve<'a>(
        &self,
        workers: &mut Vec<Worker<'a>>,
        waiting: &mut VecDeque<Waiting<'a>>,
    ) -> Result<Option<Outcome>, BatchError> {
        let held: u64 = workers.iter().map(|worker| worker.held).sum();
        if held <= self.budget.bytes {
            return Ok(None);
        }
        let Some(mut last) = workers.pop() else { return Ok(None) };
        let ended = last.running.kill(last.peak)?;
        if !workers.is_empty() {
            let need = last.need.max((last.peak as f64 * GROWTH) as u64);
            let asked = last.due.asked.plus(ended.asked);
            waiting.push_back(Waiting { due: Due { asked, ..last.due }, need });
            return Ok(None);
        }
        let gigabytes = |bytes: u64| bytes as f64 / memory::GIGABYTE;
        let why = format!(
            "it used {:.2} GB, more than the {:.2} GB that all scenes may use; give more with --memory, or try a smaller \
             --views, --volume-cells or --grid",
            gigabytes(last.peak),
            gigabytes(self.budget.bytes)
        );
        Ok(Some(last.outcome(ended, Some(why))))
    }
}

impl Worker<'_> {
    fn snapshot(&mut self) -> RunningScene<'_> {
        let Due { scene, asked } = self.due;
        let status = self.running.status();
        RunningScene { name: &scene.name, stage: status.stage.clone(), asked: status.asked.plus(asked) }
    }

    /// The outcome of its process, which ended by itself or was stopped for a reason.
    fn outcome(&self, ended: Ended, stopped: Option<String>) -> Outcome {
        let Due { scene: Selected { name, work, .. }, asked } = self.due;
        let ended = Ended { asked: ended.asked.plus(asked), ..ended };
        match stopped {
            None => Outcome::of(name, work, self.key.clone(), &ended),
            Some(why) => Outcome::stopped(name, work, self.key.clone(), &ended, why),
        }
    }
}
