//! `run.json`: which stages were done with which inputs, so that a rerun knows what it can reuse.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::workdir::{self, Artifact, Checksum, FORMAT_VERSION, Standing, WorkDir, WorkDirError, hexadecimal};

use super::{Plan, Stage};

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

/// One finished stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageRecord {
    pub name: Stage,
    /// How long the stage took when it was last done.
    pub seconds: f64,
    /// True if the last run found it already done.
    pub reused: bool,
    pub warnings: Vec<String>,
    #[serde(default)]
    pub notes: Vec<String>,
    /// Hash of everything it depends on: its options and the digests of its inputs.
    pub key: String,
    /// The digests of its inputs when it was done.
    pub inputs: Vec<(Stage, String)>,
    /// Hash of its results, on which the stages after it depend.
    pub digest: String,
    /// The files it wrote.
    pub outputs: Vec<Output>,
}

/// A file that a stage wrote.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Output {
    /// Relative to the work folder.
    pub path: PathBuf,
    #[serde(flatten)]
    pub checksum: Checksum,
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
        match standing.iter().all(|(_, standing)| *standing == Standing::Whole) {
            true => Left::Good(record),
            false if changed.is_empty() => Left::Nothing,
            false => Left::Changed(changed),
        }
    }

    /// Stores the options of a stage that has just been done; `all` has the options of all stages.
    pub fn keep_options(&mut self, stage: Stage, all: &Value) {
        for field in stage.stored_fields() {
            self.options.insert((*field).to_owned(), all[*field].clone());
        }
    }

    /// Stores the flags that were typed for the options of a stage; `all` has the flags of all stages.
    pub fn keep_flags(&mut self, stage: Stage, all: &FieldFlags) {
        for field in stage.stored_fields() {
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
    let fields = plan.stages().flat_map(Stage::stored_fields);
    fields.flat_map(|field| flags.remove(*field).unwrap_or_default()).collect()
}

impl StageRecord {
    /// Its files, and for each whether it is still as written.
    pub fn standing(&self, work: &WorkDir) -> Vec<(&Path, Standing)> {
        let of = |output: &Output| work.standing(&output.path, &output.checksum);
        self.outputs.par_iter().map(|output| (output.path.as_path(), of(output))).collect()
    }
}

/// gprop's version with the format of its artifacts.
pub fn version() -> String {
    format!("{}+format.{FORMAT_VERSION}", env!("CARGO_PKG_VERSION"))
}

/// SHA-256 over labelled pieces, each with its length, so that no two lists of pieces hash the same bytes.
#[derive(Clone)]
pub struct Hasher(Sha256);

impl Hasher {
    /// A hash that begins with gprop's version and format.
    pub fn new(what: &str) -> Self {
        Self(Sha256::new()).with(version().as_bytes()).with(what.as_bytes())
    }

    /// Adds bytes.
    pub fn with(mut self, bytes: &[u8]) -> Self {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// Adds a value as its JSON.
    pub fn with_json(self, value: &impl Serialize) -> Self {
        let json = serde_json::to_vec(value).expect("options and results are plain data");
        self.with(&json)
    }

    /// The hash in lower-case hexadecimal.
    pub fn hex(self) -> String {
        hexadecimal(&self.0.finalize())
    }
}
