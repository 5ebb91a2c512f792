//! `run.json`: what was done with which inputs, so that a rerun knows what is still good.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::workdir::{Artifact, FORMAT_VERSION, WorkDir, WorkDirError};

use super::Stage;

/// The content of `run.json`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct RunRecord {
    /// gprop's version.
    pub version: String,
    /// The options of the last run, stage by stage.
    pub options: serde_json::Value,
    /// The finished stages, in the order of the data flow.
    pub stages: Vec<StageRecord>,
}

/// One finished stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageRecord {
    pub name: Stage,
    /// How long it took when it was last done.
    pub seconds: f64,
    /// Whether the last run found it done.
    pub reused: bool,
    pub warnings: Vec<String>,
    /// Hash of everything it depends on: its options and the digests of its inputs.
    pub key: String,
    /// Hash of what it made, which the stages after it depend on.
    pub digest: String,
    /// The files it wrote, relative to the work folder, with their lengths in bytes.
    pub outputs: Vec<(PathBuf, u64)>,
}

impl RunRecord {
    /// The record of an earlier run; an empty one where there is none or an older gprop wrote it.
    pub fn load(work: &WorkDir) -> Self {
        work.read_json::<Self>(Artifact::Run)
            .ok()
            .filter(|record| record.version == version())
            .unwrap_or_else(|| Self { version: version(), ..Self::default() })
    }

    /// The stage's record where its key is `key` and every file it wrote is still there at its length.
    pub fn still_good(&self, stage: Stage, key: &str, work: &WorkDir) -> Option<&StageRecord> {
        let record = self.stages.iter().find(|record| record.name == stage && record.key == key)?;
        let intact = |(path, length): &(PathBuf, u64)| {
            std::fs::metadata(work.root().join(path)).is_ok_and(|meta| meta.len() == *length)
        };
        record.outputs.iter().all(intact).then_some(record)
    }

    /// Puts a stage's record in its place and saves.
    pub fn put(&mut self, record: StageRecord, work: &WorkDir) -> Result<(), WorkDirError> {
        self.stages.retain(|old| old.name != record.name);
        let place = self.stages.partition_point(|old| old.name < record.name);
        self.stages.insert(place, record);
        work.write_json(Artifact::Run, self)
    }

    /// Forgets a stage that is about to be done again, so that a killed run is not taken for a finished one.
    pub fn forget(&mut self, stage: Stage, work: &WorkDir) -> Result<(), WorkDirError> {
        let before = self.stages.len();
        self.stages.retain(|old| old.name != stage);
        if self.stages.len() == before { Ok(()) } else { work.write_json(Artifact::Run, self) }
    }
}

/// gprop's version with the format of its artifacts.
fn version() -> String {
    format!("{}+format.{FORMAT_VERSION}", env!("CARGO_PKG_VERSION"))
}

/// SHA-256 over labelled pieces, each with its length, so that no two lists of pieces give the same bytes.
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

/// Bytes in lower-case hexadecimal.
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
