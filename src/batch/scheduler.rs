//! Runs scenes side by side, within a memory budget.
//!
//! A scene is started if the [estimates](super::memory) of all running scenes leave room for its own. Estimates can be
//! wrong, so the memory that the processes use is sampled: if it exceeds the budget, the scene started last is killed
//! and waits until there is room for [more](GROWTH) than it used. A scene that exceeds the budget by itself fails, and
//! so does one that takes longer than `--max-minutes`.

use std::collections::VecDeque;
use std::time::Duration;

use super::child::{Running, Task};
use super::memory::{self, Budget, Gauge};
use super::select::Selected;
use super::{BatchError, Outcome};

/// Up to this number, a scene's stages make good use of threads: views and prompts are processed in parallel.
pub const THREADS_A_SCENE: usize = 4;

const POLL: Duration = Duration::from_millis(20);
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

/// A scene that is to be run, with its estimated need of memory.
struct Waiting<'a> {
    scene: &'a Selected,
    need: u64,
}

/// A running scene.
struct Worker<'a> {
    scene: &'a Selected,
    need: u64,
    running: Running,
    /// Key of the scene when its process was started.
    key: String,
    held: u64,
    peak: u64,
}

impl Scheduler {
    /// Runs all of `scenes`, in order as far as the budget allows; `keep` is called with each outcome.
    pub fn run(
        &self,
        scenes: &[&Selected],
        key: &dyn Fn(&Selected) -> String,
        keep: &mut dyn FnMut(Outcome) -> Result<(), BatchError>,
    ) -> Result<(), BatchError> {
        let mut waiting: VecDeque<Waiting> = scenes
            .iter()
            .map(|scene| Waiting { scene, need: memory::need(scene, self.task.to, self.task.threads) })
            .collect();
        let mut workers: Vec<Worker> = Vec::new();
        let mut gauge = Gauge::new();
        while !waiting.is_empty() || !workers.is_empty() {
            while let Some(next) = self.next(&waiting, &workers).and_then(|index| waiting.remove(index)) {
                let Waiting { scene, need } = next;
                // Before the process reads the files on which the key depends: they may change while it runs.
                let key = key(scene);
                let running = Running::start(scene, &self.task)?;
                workers.push(Worker { scene, need, running, key, held: 0, peak: 0 });
            }
            std::thread::sleep(POLL);
            let ids: Vec<u32> = workers.iter().map(|worker| worker.running.id()).collect();
            for (worker, held) in workers.iter_mut().zip(gauge.read(&ids)) {
                worker.held = held;
                worker.peak = worker.peak.max(held);
            }
            let mut index = 0;
            while index < workers.len() {
                match self.outcome(&mut workers[index])? {
                    Some(outcome) => {
                        workers.remove(index);
                        keep(outcome)?;
                    }
                    None => index += 1,
                }
            }
            self.relieve(&mut workers, &mut waiting, keep)?;
        }
        Ok(())
    }

    /// The outcome of a scene that has ended, or that is killed here because it took too long.
    fn outcome(&self, worker: &mut Worker) -> Result<Option<Outcome>, BatchError> {
        let Worker { scene, running, key, peak, .. } = worker;
        if let Some(ended) = running.ended(*peak)? {
            return Ok(Some(Outcome::of(&scene.name, &scene.work, key.clone(), &ended)));
        }
        let Some(limit) = self.max_minutes.filter(|limit| running.age().as_secs_f64() > 60.0 * limit) else {
            return Ok(None);
        };
        let why = format!("took longer than --max-minutes {limit}");
        Ok(Some(Outcome::stopped(&scene.name, &scene.work, key.clone(), &running.kill(*peak)?, why)))
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

    /// Kills the scene started last if all together use more than the budget.
    fn relieve<'a>(
        &self,
        workers: &mut Vec<Worker<'a>>,
        waiting: &mut VecDeque<Waiting<'a>>,
        keep: &mut dyn FnMut(Outcome) -> Result<(), BatchError>,
    ) -> Result<(), BatchError> {
        let held: u64 = workers.iter().map(|worker| worker.held).sum();
        if held <= self.budget.bytes {
            return Ok(());
        }
        let Some(mut last) = workers.pop() else { return Ok(()) };
        let ended = last.running.kill(last.peak)?;
        if !workers.is_empty() {
            let need = last.need.max((last.peak as f64 * GROWTH) as u64);
            waiting.push_back(Waiting { scene: last.scene, need });
            return Ok(());
        }
        let gigabytes = |bytes: u64| bytes as f64 / memory::GIGABYTE;
        let why = format!(
            "it used {:.2} GB, more than the {:.2} GB that all scenes may use; give more with --memory, or try a smaller \
             --views, --volume-cells or --grid",
            gigabytes(last.peak),
            gigabytes(self.budget.bytes)
        );
        keep(Outcome::stopped(&last.scene.name, &last.scene.work, last.key, &ended, why))
    }
}
