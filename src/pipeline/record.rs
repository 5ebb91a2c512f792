//! `run.json`: which stages were done with which inputs, so that a rerun knows what it can reuse.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::workdir::{self, Artifact, Standing, WorkDir, WorkDirError};

use super::hasher::version;
use super::plan::Plan;
use super::stages::{Stage, StageRecord};

/// Flags of a command line, by the field of [`Options`](super::Options) to which they belong.
pub type FieldFlags = BTreeMap<String, Vec<String>>;

/// The content of `run.json`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct RunRecord {
    /// gprop's version.
    pub version: String,
    /// The options of each stage, as they were when the stage was last done. Paths that determine what was
    /// read are stored like those of the flags.
    pub options: serde_json::Map<String, Value>,
    /// The flags that were typed for these options, as far as a later command may take them from here. A path inside
    /// the scene's folder is relative to it, any other is absolute.
    #[serde(default)]
    pub flags: FieldFlags,
    /// The finished stages, in the order of the data flow.
    pub stages: Vec<StageRecord>,
}

/// The results of a stage that an earlier run left.
pub enum Left<'a> {
    /// The results that this run would produce.
    Good(&'a StageRecord),
    /// Nothing that can be reused.
    Nothing,
    /// The results that this run would produce, except that the content of these files has changed.
    Changed(Vec<&'a Path>),
}

impl RunRecord {
    /// The record of an earlier run; empty if there is none or another version of gprop wrote it.
    pub fn load(work: &WorkDir) -> Self {
        work.read_json::<Self>(Artifact::Run)
            .ok()
            .filter(|record| record.version == version())
            .unwrap_or_else(|| Self { version: version(), ..Self::default() })
    }

    /// The record of a stage that is done.
    pub fn of(&self, stage: Stage) -> Option<&StageRecord> {
        self.stages.iter().find(|record| record.name == stage)
    }

    /// The records of the stages that were done after all stages that they read from, in the order of the data flow.
    pub fn current(&self) -> Vec<&StageRecord> {
        let mut current: Vec<&StageRecord> = Vec::new();
        for record in Stage::all().iter().filter_map(|stage| self.of(*stage)) {
            let is_current = |(input, digest): &(Stage, String)| {
                current.iter().any(|earlier| earlier.name == *input && earlier.digest == *digest)
            };
            if record.inputs.iter().all(is_current) {
                current.push(record);
            }
        }
        current
    }

    /// The results left by a stage whose current key is `key`.
    pub fn left(&self, stage: Stage, key: &str, work: &WorkDir) -> Left<'_> {
        let Some(record) = self.of(stage).filter(|record| record.key == key) else { return Left::Nothing };
        let standing: Vec<_> = record.standing(work);
        let changed: Vec<&Path> =
            standing.iter().filter_map(|(path, standing)| (*standing == Standing::Changed).then_some(*path)).collect();
        if standing.iter().all(|(_, standing)| *standing == Standing::Whole) {
            Left::Good(record)
        } else if changed.is_empty() {
            Left::Nothing
        } else {
            Left::Changed(changed)
        }
    }

    /// Stores the options of a stage that has just been done; `all` has the options of all stages.
    pub fn keep_options(&mut self, stage: Stage, all: &Value) {
        for field in stage.row().options {
            self.options.insert((*field).to_owned(), all[*field].clone());
        }
    }

    /// Stores the flags that were typed for the options of a stage; `all` has the flags of all stages.
    pub fn keep_flags(&mut self, stage: Stage, all: &FieldFlags) {
        for field in stage.row().options {
            match all.get(*field) {
                Some(typed) => self.flags.insert((*field).to_owned(), typed.clone()),
                None => self.flags.remove(*field),
            };
        }
    }

    /// Inserts a stage's record at its place and saves. In a read-only folder, only the note that this run reused the
    /// stage is lost.
    pub fn put(&mut self, record: StageRecord, work: &WorkDir) -> Result<(), WorkDirError> {
        self.stages.retain(|old| old.name != record.name);
        let place = self.stages.partition_point(|old| old.name < record.name);
        self.stages.insert(place, record);
        if work.is_writable() { work.write_json(Artifact::Run, self) } else { Ok(()) }
    }

    /// Removes the record of a stage that is about to be done again, so that a killed run is not taken for a finished
    /// one.
    pub fn forget(&mut self, stage: Stage, work: &WorkDir) -> Result<(), WorkDirError> {
        let before = self.stages.len();
        self.stages.retain(|old| old.name != stage);
        if self.stages.len() == before { Ok(()) } else { work.write_json(Artifact::Run, self) }
    }
}

/// The part of `run.json` from which a later command goes on. Any version of gprop may have written it.
#[derive(Default, Deserialize)]
struct Typed {
    #[serde(default)]
    flags: FieldFlags,
}

/// The flags that were typed for the stages of `plan` when they were last done in the work folder `root`. They are read
/// from `run.json` unchecked, and that file may come from anyone. None if there is no `run.json` that can be read: opening
/// the work folder reports that.
pub fn flags_of_last_run(root: &Path, plan: Plan) -> Vec<String> {
    let path = root.join(Artifact::Run.path());
    if workdir::refuse_link(&path, "--out").is_err() {
        return Vec::new();
    }
    let Typed { mut flags } = workdir::read_json(&path).unwrap_or_default();
    let fields = plan.stages().flat_map(|stage| stage.row().options);
    fields.flat_map(|field| flags.remove(*field).unwrap_or_default()).collect()
}
