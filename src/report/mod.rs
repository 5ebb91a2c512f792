//! The whole result: `report.json` for programs, `report.html` for people, a few lines for the terminal.

mod charts;
mod cloud;
pub(crate) mod numbers;
mod page;
mod pictures;
pub(crate) mod style;
mod summary;

use serde::Serialize;

use crate::grasp::GraspReport;
use crate::parts::Parts;
use crate::query::{Answers, Match, Outcome};
use crate::simulate::SimulationReport;
use crate::units::MetricScale;
use crate::vote::FieldLabel;

pub use cloud::Cloud;
pub use page::page;
pub use pictures::{PictureError, Pictures, SheetPicture, ViewPictures};
pub use summary::summary;

/// Version of `report.json`'s form, which `docs/report.schema.json` describes: raised when a key changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// What `report.json` holds.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// gprop's version.
    pub version: &'static str,
    pub scene: SceneSummary,
    pub stages: Vec<StageTime>,
    pub answers: AnswerCounts,
    /// `None` where the metric scale is unknown.
    pub parts: Option<Parts>,
    /// The properties of each part, as the views agree on them.
    pub labels: Vec<FieldLabel>,
    /// How many Gaussians carry each label.
    pub gaussians_per_label: Vec<usize>,
    pub simulation: SimulationReport,
    /// `None` where the metric scale is unknown.
    pub grasp: Option<GraspReport>,
    pub warnings: Vec<Warning>,
    pub reproduction: Reproduction,
}

/// How to make the same result again.
#[derive(Debug, Clone, Serialize)]
pub struct Reproduction {
    /// The command line, with the options that were typed or stood in `gprop.toml`.
    pub command: String,
    /// The scene's files, apart from the photos and their masks, which the scene stage's digest covers.
    pub inputs: Vec<InputFile>,
}

/// A file of the scene.
#[derive(Debug, Clone, Serialize)]
pub struct InputFile {
    /// Relative to the scene folder where it lies in it.
    pub path: String,
    /// Of its bytes, in lower-case hexadecimal.
    pub sha256: String,
}

/// What was read.
#[derive(Debug, Clone, Serialize)]
pub struct SceneSummary {
    pub name: String,
    pub gaussians: usize,
    pub sh_degree: u8,
    pub scale: Option<MetricScale>,
    /// The chosen views.
    pub views: Vec<String>,
    /// Gaussians that some view sees; the others took the label of their neighbours.
    pub seen_gaussians: usize,
}

/// How long a stage took when it was last done.
#[derive(Debug, Clone, Serialize)]
pub struct StageTime {
    pub name: String,
    pub seconds: f64,
    pub reused: bool,
    /// SHA-256 of what it made or of all that it depends on: equal digests, equal results.
    pub digest: String,
}

/// Something the user should know.
#[derive(Debug, Clone, Serialize)]
pub struct Warning {
    pub stage: String,
    pub message: String,
}

/// Where the answers came from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct AnswerCounts {
    /// Recorded for exactly this query, in this run or before.
    pub exact: usize,
    /// Recorded for the same view with a mask that overlaps.
    pub by_mask: usize,
    /// Parts without an answer; they cast no votes.
    pub failed: usize,
}

impl AnswerCounts {
    /// Counts the answers by how each was found.
    pub fn of(answers: &Answers) -> Self {
        let mut counts = Self::default();
        for part in &answers.parts {
            match &part.outcome {
                Outcome::Failed(_) => counts.failed += 1,
                Outcome::Answered(answer) => match answer.matched {
                    // What is asked is recorded first.
                    Match::Exact | Match::Live => counts.exact += 1,
                    Match::Mask { .. } => counts.by_mask += 1,
                },
            }
        }
        counts
    }

    /// Parts that have an answer.
    pub fn answered(&self) -> usize {
        self.exact + self.by_mask
    }
}
