//! The outcome of a stage, and its record in `run.json`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Stage;
use crate::parallel;
use crate::workdir::{Artifact, Checksum, Standing, WorkDir};

/// The result of doing a stage.
pub(crate) struct Done {
    /// The files it wrote.
    pub outputs: Vec<PathBuf>,
    /// Messages about what the user should check because the result may be wrong.
    pub warnings: Vec<String>,
    /// Messages about what the user may want to know.
    pub notes: Vec<String>,
    /// Hash of its results if its key does not determine them.
    pub digest: Option<String>,
    /// Its key if doing the stage changed that.
    pub key: Option<String>,
}

impl Done {
    /// A stage that wrote `outputs` and has no warnings.
    pub fn writing<'a>(outputs: impl IntoIterator<Item = Artifact<'a>>) -> Self {
        Self {
            outputs: outputs.into_iter().map(|artifact| artifact.path()).collect(),
            warnings: Vec::new(),
            notes: Vec::new(),
            digest: None,
            key: None,
        }
    }

    pub fn warning(self, warnings: Vec<String>) -> Self {
        Self { warnings, ..self }
    }

    pub fn noting(self, notes: Vec<String>) -> Self {
        Self { notes, ..self }
    }
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

impl StageRecord {
    /// Its files, and for each whether it is still as written.
    pub fn standing(&self, work: &WorkDir) -> Vec<(&Path, Standing)> {
        let standing_of = |output: &Output| work.standing(&output.path, &output.checksum);
        parallel::map(&self.outputs, |output| (output.path.as_path(), standing_of(output)))
    }
}
