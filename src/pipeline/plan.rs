//! The stages, the stages that each reads from, and the selection of stages for a run.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// The stages, in the order of the data flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Read the splat, the cameras and the photos, and choose the views.
    Scene,
    /// Cut the chosen views into segments with SAM.
    Segment,
    /// Find the object's parts in 3D from the segments of all views.
    Consensus,
    /// Get the material of each part from recorded answers or a model.
    Query,
    /// Give every Gaussian a material by a vote of the views.
    Vote,
    /// Compute volume, thickness and mass of the 3D parts.
    Parts,
    /// Simulate the object and film it.
    Simulate,
    /// Find where and with what force a gripper can lift the object.
    Grasp,
    /// Write the report and its pictures.
    Report,
}

impl Stage {
    /// All stages in order.
    pub fn all() -> &'static [Self] {
        Self::value_variants()
    }

    /// The stages whose results it reads.
    pub(super) fn inputs(self) -> &'static [Self] {
        match self {
            Self::Scene => &[],
            Self::Segment => &[Self::Scene],
            Self::Consensus => &[Self::Scene, Self::Segment],
            Self::Query => &[Self::Scene, Self::Segment, Self::Consensus],
            Self::Vote => &[Self::Scene, Self::Segment, Self::Consensus, Self::Query],
            Self::Parts => &[Self::Scene, Self::Vote],
            Self::Simulate | Self::Grasp => &[Self::Scene, Self::Vote, Self::Parts],
            Self::Report => &[
                Self::Scene,
                Self::Segment,
                Self::Consensus,
                Self::Query,
                Self::Vote,
                Self::Parts,
                Self::Simulate,
                Self::Grasp,
            ],
        }
    }

    /// True if it cannot be done before `other` is.
    fn needs(self, other: Self) -> bool {
        self.inputs().iter().any(|input| *input == other || input.needs(other))
    }

    /// The fields of [`Options`](super::Options) that are stored in `run.json` when this stage is done. The stage may read
    /// others too, which earlier stages store.
    pub(super) fn stored_fields(self) -> &'static [&'static str] {
        match self {
            Self::Scene => &["scene"],
            Self::Segment => &["segment", "setup"],
            Self::Consensus => &["consensus"],
            Self::Query => &["query", "materials"],
            Self::Vote => &["vote"],
            Self::Parts => &["parts"],
            Self::Simulate => &["simulate"],
            Self::Grasp => &["grasp"],
            Self::Report => &[],
        }
    }

    /// Its name, as typed on the command line and written in `run.json`.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// The stages to do, and those to do again in any case.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// The last stage to do. Earlier stages are done if it needs them.
    pub to: Stage,
    /// This stage and those after it are done again, regardless of earlier runs.
    pub from: Option<Stage>,
}

impl Plan {
    /// The stages that must be done, unless they already are, in order.
    pub fn stages(self) -> impl Iterator<Item = Stage> {
        let asked = move |stage| stage == self.to || self.to.needs(stage) || self.redoes(stage);
        Stage::all().iter().copied().filter(move |stage| *stage <= self.to && asked(*stage))
    }

    pub(super) fn redoes(self, stage: Stage) -> bool {
        self.from.is_some_and(|from| from <= stage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stages(to: Stage, from: Option<Stage>) -> Vec<Stage> {
        Plan { to, from }.stages().collect()
    }

    #[test]
    fn a_stage_takes_along_what_it_needs() {
        assert_eq!(stages(Stage::Report, None), Stage::all());
        assert_eq!(stages(Stage::Segment, None), [Stage::Scene, Stage::Segment]);
        assert_eq!(stages(Stage::Grasp, None), [&Stage::all()[..6], &[Stage::Grasp]].concat(), "no simulation");
        assert_eq!(stages(Stage::Grasp, Some(Stage::Simulate)), Stage::all()[..8], "asked for");
    }

    #[test]
    fn inputs_come_before() {
        for stage in Stage::all() {
            assert!(stage.inputs().iter().all(|input| input < stage), "{stage:?}");
        }
    }
}
