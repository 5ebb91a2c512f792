//! Named sets of options.

use serde::{Deserialize, Serialize};

/// `--preset`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Parts first, then questions about them
    #[default]
    Parts,
    /// The paper to the letter: SAM's middle level from a 32 x 32 grid with one layer of crops, a question about every segment of
    /// every view, one vote per view at the Gaussian's centre if it passes the depth test, and every Gaussian by itself
    Paper,
}

impl Preset {
    /// The flags that it stands for. Those of the configuration files and of the command line take precedence.
    pub fn flags(self) -> &'static [&'static str] {
        match self {
            Self::Parts => &[],
            Self::Paper => &[
                "--ask=segments",
                "--level=middle",
                "--point-prompts=grid",
                "--points-per-side=32",
                "--crop-layers=1",
                "--vote=frequency",
                "--agree=gaussian",
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::consensus::Asked;
    use crate::segment::{Level, PointPrompts};
    use crate::vote::{Agreement, Rule};

    #[test]
    fn the_papers_options_are_the_papers() {
        let paper = Preset::Paper.options();
        assert_eq!((paper.consensus.ask, paper.segment.level), (Asked::Segments, Some(Level::Middle)));
        assert_eq!(paper.segment.point_prompts, PointPrompts::Grid);
        assert_eq!((paper.segment.generator.points_per_side, paper.segment.generator.crop_layers), (32, 1));
        assert_eq!((paper.vote.vote, paper.vote.agree), (Rule::Frequency, Agreement::Gaussian));
        let default = Preset::Parts.options();
        assert_eq!((default.consensus.ask, default.segment.level), (Asked::Parts, None));
    }
}
