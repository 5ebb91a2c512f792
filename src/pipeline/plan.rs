//! The selection of stages for a run.

use super::stages::Stage;

/// The stages to do, and those to do again in any case.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Plan {
    /// The last stage to do. Earlier stages are done if it needs them.
    pub to: Stage,
    /// This stage and those after it are done again, regardless of earlier runs.
    pub from: Option<Stage>,
    /// This stage is left out, and no other reads from it.
    pub without: Option<Stage>,
}

impl Plan {
    /// Everything up to the stage `to`, reusing what earlier runs did.
    pub fn to(to: Stage) -> Self {
        Self { to, from: None, without: None }
    }

    /// The same, but the stage `from` and those after it are done again.
    pub fn from(self, from: Stage) -> Self {
        Self { from: Some(from), ..self }
    }

    /// The same, but without this stage.
    pub fn without(self, stage: Stage) -> Self {
        Self { without: Some(stage), ..self }
    }

    /// The stages that must be done, unless they already are, in order.
    pub fn stages(self) -> impl Iterator<Item = Stage> {
        let asked = move |stage| stage == self.to || self.to.needs(stage) || self.redoes(stage);
        Stage::all().iter().copied().filter(move |stage| *stage <= self.to && self.includes(*stage) && asked(*stage))
    }

    pub(super) fn includes(self, stage: Stage) -> bool {
        self.without != Some(stage)
    }

    pub(super) fn redoes(self, stage: Stage) -> bool {
        self.from.is_some_and(|from| from <= stage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stages(to: Stage, from: Option<Stage>) -> Vec<Stage> {
        Plan { from, ..Plan::to(to) }.stages().collect()
    }

    #[test]
    fn a_stage_takes_along_what_it_needs() {
        assert_eq!(stages(Stage::Report, None), Stage::all());
        assert_eq!(stages(Stage::Segment, None), [Stage::Scene, Stage::Segment]);
        assert_eq!(stages(Stage::Grasp, None), [&Stage::all()[..8], &[Stage::Grasp]].concat(), "no simulation");
        assert_eq!(stages(Stage::Grasp, Some(Stage::Simulate)), Stage::all()[..10], "asked for");
        let without = Plan::to(Stage::Report).without(Stage::Simulate);
        assert!(without.stages().eq(Stage::all().iter().copied().filter(|stage| *stage != Stage::Simulate)));
    }
}
