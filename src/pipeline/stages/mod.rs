//! The table of stages. A stage is one file here and one row of the table.
//!
//! The file of a stage has its [`Row`]: which stages it reads from, the [key](Row::key) that says when a stored result
//! can be reused, and the function that [does](Row::run) it. That function gathers typed values (the [scene](OpenScene)
//! with its options, and the [stored](Stored) results of earlier stages), calls the stage's own room, which knows
//! neither files nor other stages, and writes the result into the work folder.
//!
//! Stages do not know the pipeline: [`run`](super::run) calls them, and alone keeps keys and records.

pub mod consensus;
mod done;
pub mod grasp;
mod open;
pub mod parts;
pub mod query;
pub mod questions;
pub mod recognise;
mod recognized;
pub mod refine;
pub mod report;
pub mod scene;
pub mod segment;
pub mod shared_scale;
pub mod simulate;
pub mod subjects;
pub mod vote;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::hasher::Hasher;
use crate::error::Result;
use crate::workdir::Artifact;

pub(crate) use done::Done;
pub use done::{Output, StageRecord};
pub use open::{OpenScene, Tools};

/// Makes the stages from the table: the words that describe a stage in `--help`, its name, and the module whose `ROW`
/// it is.
macro_rules! table {
    ($($(#[$doc:meta])* $name:ident: $module:ident,)*) => {
        /// The stages, in the order of the data flow.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ValueEnum)]
        #[serde(rename_all = "snake_case")]
        pub enum Stage {
            $($(#[$doc])* $name,)*
        }

        impl Stage {
            /// Its row of the table.
            pub(crate) fn row(self) -> &'static Row {
                match self {
                    $(Self::$name => &$module::ROW,)*
                }
            }
        }
    };
}

table! {
    /// Read the splat, the cameras and the photos, and choose the views.
    Scene: scene,
    /// Cut the chosen views into segments with SAM.
    Segment: segment,
    /// Find the object's parts in 3D from the segments of all views.
    Consensus: consensus,
    /// Learn what the object is, from recorded answers or a model.
    Recognise: recognise,
    /// Look for what that names and no part shows.
    Refine: refine,
    /// Get the material of each part from recorded answers or a model.
    Query: query,
    /// Give every Gaussian a material by a vote of the views.
    Vote: vote,
    /// Compute volume, thickness and mass of the 3D parts.
    Parts: parts,
    /// Simulate the object and film it.
    Simulate: simulate,
    /// Find where and with what force a gripper can lift the object.
    Grasp: grasp,
    /// Write the report and its pictures.
    Report: report,
}

/// What the run has to know of a stage.
pub(crate) struct Row {
    /// The stages whose results it reads.
    pub inputs: &'static [Stage],
    /// The fields of [`Options`](super::Options) that are stored in `run.json` when it is done. It may read others too,
    /// which earlier stages store.
    pub options: &'static [&'static str],
    /// The file with its main result.
    pub result: Artifact<'static>,
    /// Hash of everything that it depends on. The hasher has taken in the results of the stages that it reads from.
    pub key: fn(&OpenScene, Hasher) -> Result<String>,
    /// True if a result that fits the key is nevertheless to be made again.
    pub is_stale: fn(&OpenScene, &Job) -> bool,
    /// Makes the result and writes it into the work folder.
    pub run: fn(&OpenScene, &Job) -> Result<Done>,
}

/// What a stage is told about the run of which it is a step.
pub(crate) struct Job<'a> {
    /// A hasher that has taken in the results of the stages that the stage reads from.
    pub inputs: Hasher,
    /// The stage's key.
    pub key: &'a str,
    /// True if nothing that an earlier run made may be reused.
    pub anew: bool,
    /// True if the user asks for this stage's result, not for that of a later one.
    pub is_last: bool,
    /// Whether runs and reports include the simulation.
    pub simulates: bool,
    /// The stages that are done, in this run or an earlier one.
    pub records: &'a [StageRecord],
    /// The flags that stand for the options.
    pub flags: &'a [String],
}

/// A result of a stage that later stages read from the work folder.
pub(crate) trait Stored: Send + Sync + Sized + 'static {
    /// The stage that makes it.
    const STAGE: Stage;

    /// Reads it.
    ///
    /// # Errors
    /// If the stage is not done, or its files are not what gprop wrote.
    fn load(open: &OpenScene) -> Result<Self>;
}

impl Stage {
    /// All stages in order.
    pub fn all() -> &'static [Self] {
        Self::value_variants()
    }

    /// True if it cannot be done before `other` is.
    pub(super) fn needs(self, other: Self) -> bool {
        self.row().inputs.iter().any(|input| *input == other || input.needs(other))
    }

    /// Its name, as typed on the command line and written in `run.json`.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// For [`Row::is_stale`]: a result that fits the key is as good as a new one.
fn never(_: &OpenScene, _: &Job) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_come_before() {
        for stage in Stage::all() {
            assert!(stage.row().inputs.iter().all(|input| input < stage), "{stage:?}");
        }
    }
}
