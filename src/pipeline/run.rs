//! Carries out a plan: which stages are due, which stored results can be reused, and the record of what was done.
//!
//! The only place that keeps keys and records. It calls the stages of the [table](super::stages) and knows nothing
//! about any of them.

use std::path::PathBuf;
use std::time::Instant;

use tracing::{info, warn};

use super::hasher::Hasher;
use super::plan::Plan;
use super::record::{FieldFlags, Left, RunRecord};
use super::stages::{Done, Job, OpenScene, Output, Stage, StageRecord};
use super::stored::with_portable_paths;
use crate::error::{Context, ErrorKind, Result};
use crate::files::json;
use crate::words::progress::StageNumber;
use crate::workdir::Artifact;

/// The stages of a scene: those that are planned, and those that are done.
pub struct Run {
    pub plan: Plan,
    command_line: CommandLine,
    record: RunRecord,
    /// The stages that this process has done or found already done.
    done: Vec<Stage>,
}

/// The flags that stand for the options of a pipeline; none if it was opened through the library.
#[derive(Debug, Clone, Default)]
pub struct CommandLine {
    /// All of them, with those of the configuration files: the report shows them as the command that made it.
    pub effective: Vec<String>,
    /// Those that were typed, for `run.json`.
    pub typed: FieldFlags,
    /// A stage whose options are for this time only: `run.json` keeps the flags that the last run left for it.
    pub once: Option<Stage>,
}

impl Run {
    pub fn new(open: &OpenScene, plan: Plan, command_line: CommandLine) -> Self {
        Self { plan, command_line, record: RunRecord::load(&open.work), done: Vec::new() }
    }

    /// The stages of the plan.
    pub fn stages(&self) -> impl Iterator<Item = Stage> + use<> {
        self.plan.stages()
    }

    /// Does the stages of the plan that neither an earlier run nor this one has done.
    pub fn carry_out(&mut self, open: &mut OpenScene) -> Result<()> {
        let stages: Vec<Stage> = self.stages().collect();
        for (index, &stage) in stages.iter().enumerate() {
            if !self.done.contains(&stage) {
                open.progress().check()?;
                open.number = Some(StageNumber { number: index + 1, of: stages.len() });
                if let Err(error) = self.step(open, stage) {
                    // Unlike any other failure, a missing answer is no fault of the stage's options.
                    let first = if error.kind() == ErrorKind::Answer { index } else { index + 1 };
                    self.keep_flags(open, &stages[first..])?;
                    return Err(error);
                }
                self.done.push(stage);
            }
        }
        Ok(())
    }

    /// Stores the flags that were typed for stages which have to wait, so that the next command does them as they were asked for.
    pub fn keep_flags(&mut self, open: &OpenScene, stages: &[Stage]) -> Result<()> {
        let before = self.record.flags.clone();
        for stage in stages.iter().filter(|stage| self.command_line.once != Some(**stage)) {
            self.record.keep_flags(*stage, &self.command_line.typed);
        }
        if self.record.flags != before && open.work.is_writable() {
            open.work.write_json(Artifact::Run, &self.record)?;
        }
        Ok(())
    }

    /// Looks at a stage anew, even if this run has done it.
    pub fn reconsider(&mut self, stage: Stage) {
        self.done.retain(|done| *done != stage);
    }

    /// Does a stage unless its results from an earlier run can be reused.
    pub fn step(&mut self, open: &OpenScene, stage: Stage) -> Result<()> {
        let key = self.key(open, stage)?;
        if let Some(good) = self.left(open, stage, &key) {
            info!(?stage, "still good");
            let record = StageRecord { reused: true, ..good.clone() };
            return self.put(open, record);
        }
        open.work.require_writable().with_context(|| format!("the {} stage has to be done", stage.name()))?;
        self.record.forget(stage, &open.work)?;
        open.forget_from(stage);
        open.progress().stage_begins(&stage.name());
        let start = Instant::now();
        let done = (stage.row().run)(open, &self.job(stage, &key))?;
        let record = self.record_of(open, stage, key, done, start)?;
        // Whoever ends the run when a stage is said to be done finds it done.
        self.put(open, record.clone())?;
        open.progress().stage_done(&stage.name(), record.seconds);
        record.warnings.iter().for_each(|warning| warn!("{warning}"));
        record.notes.iter().for_each(|note| info!("{note}"));
        Ok(())
    }

    fn record_of(
        &self,
        open: &OpenScene,
        stage: Stage,
        key: String,
        done: Done,
        start: Instant,
    ) -> Result<StageRecord> {
        let key = done.key.unwrap_or(key);
        let output = |path: PathBuf| Ok(Output { checksum: open.work.checksum(&path)?, path });
        Ok(StageRecord {
            name: stage,
            seconds: start.elapsed().as_secs_f64(),
            reused: false,
            warnings: done.warnings,
            notes: done.notes,
            inputs: self.inputs_of(stage).map(|(input, digest)| (input, digest.to_owned())).collect(),
            digest: done.digest.unwrap_or_else(|| key.clone()),
            outputs: done.outputs.into_iter().map(output).collect::<Result<_>>()?,
            key,
        })
    }

    /// Stores the record of a stage that is done, its options, and the flags that were typed for them.
    fn put(&mut self, open: &OpenScene, record: StageRecord) -> Result<()> {
        let options = serde_json::to_value(with_portable_paths(&open.options, &open.folder))?;
        self.record.keep_options(record.name, &options);
        if self.command_line.once != Some(record.name) {
            self.record.keep_flags(record.name, &self.command_line.typed);
        }
        Ok(self.record.put(record, &open.work)?)
    }

    /// The stages of the plan whose results from an earlier run can be reused.
    pub fn reusable(&self, open: &OpenScene) -> Result<Vec<Stage>> {
        let mut found: Vec<Stage> = Vec::new();
        for stage in self.stages() {
            let has_inputs = self.reads_from(stage).all(|input| found.contains(&input));
            if has_inputs && self.left(open, stage, &self.key(open, stage)?).is_some() {
                found.push(stage);
            }
        }
        Ok(found)
    }

    /// The record of a stage that need not be done again; warns about files that were changed.
    fn left(&self, open: &OpenScene, stage: Stage, key: &str) -> Option<&StageRecord> {
        if self.plan.redoes(stage) || (stage.row().is_stale)(open, &self.job(stage, key)) {
            return None;
        }
        match self.record.left(stage, key, &open.work) {
            Left::Good(record) => Some(record),
            Left::Nothing => None,
            Left::Changed(paths) => {
                let remedy = format!("the {} stage has to be done again", stage.name());
                paths.into_iter().for_each(|path| open.work.warn_changed(path, &remedy));
                None
            }
        }
    }

    /// What a stage is told about this run.
    pub fn job<'a>(&'a self, stage: Stage, key: &'a str) -> Job<'a> {
        Job {
            inputs: self.hash_of_inputs(stage),
            key,
            anew: self.plan.redoes(stage),
            is_last: self.plan.to == stage,
            simulates: self.plan.includes(Stage::Simulate),
            records: &self.record.stages,
            flags: &self.command_line.effective,
        }
    }

    /// Hash of everything that a stage depends on; the stages that it reads from must be done.
    fn key(&self, open: &OpenScene, stage: Stage) -> Result<String> {
        (stage.row().key)(open, self.hash_of_inputs(stage))
    }

    /// A hasher that has taken in the digests of the stages that `stage` reads from.
    fn hash_of_inputs(&self, stage: Stage) -> Hasher {
        let name = json::compact(&stage).expect("a stage is a word");
        self.inputs_of(stage).fold(Hasher::new(&name), |hasher, (_, digest)| hasher.with(digest.as_bytes()))
    }

    /// The stages that `stage` reads from, which must be done, with their digests.
    fn inputs_of(&self, stage: Stage) -> impl Iterator<Item = (Stage, &str)> {
        self.reads_from(stage).map(|input| {
            let record = self.record.of(input).expect("stages run in order");
            (input, record.digest.as_str())
        })
    }

    /// The stages that `stage` reads from.
    fn reads_from(&self, stage: Stage) -> impl Iterator<Item = Stage> + use<> {
        let plan = self.plan;
        stage.row().inputs.iter().copied().filter(move |input| plan.includes(*input))
    }
}
