//! Named sets of options.

use serde::{Deserialize, Serialize};

/// `--preset`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Find the parts first, then ask about them
    #[default]
    Parts,
    /// As in the paper, GaussianProperty: SAM's middle level from a 32 x 32 grid with one layer of crops, a question
    /// about every segment of every view, one vote per view at the centre of each Gaussian that passes the depth test,
    /// the most frequent material for each Gaussian, the same largest curvature for every material, and F* to press with
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
                "--max-curvature=0.5",
                "--force=paper",
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::consensus::AskAbout;
    use crate::segment::{GeneratorOptions, Level, PointPrompts};
    use crate::vote::{Agreement, Rule};

    #[test]
    fn the_papers_options_are_the_papers() {
        let paper = Preset::Paper.options();
        assert_eq!((paper.consensus.ask, paper.segment.level), (AskAbout::Segments, Some(Level::Middle)));
        assert_eq!(paper.segment.point_prompts, PointPrompts::Grid);
        assert_eq!((paper.segment.generator.points_per_side, paper.segment.generator.crop_layers), (32, 1));
        assert_eq!((paper.vote.vote, paper.vote.agree), (Rule::Frequency, Agreement::Gaussian));
        assert_eq!(paper.grasp.max_curvature, Some(crate::grasp::curvature::PAPER_1_M));
        assert_eq!(paper.grasp.force, crate::grasp::options::ForceRule::Paper);
        let default = Preset::Parts.options();
        assert_eq!((default.consensus.ask, default.segment.level), (AskAbout::Object, None));
    }

    #[test]
    fn the_method_lists_the_flags() {
        let page: Vec<&str> = include_str!("../../docs/method.md").split_whitespace().collect();
        let flags = Preset::Paper.flags().join(" ").replace('=', " ");
        assert!(page.join(" ").contains(&flags), "docs/method.md does not list {flags}");
    }

    /// As the help and docs/segment.md say.
    #[test]
    fn the_generators_defaults_are_the_papers_but_for_crop_layers() {
        let (paper, default) = (Preset::Paper.options().segment, Preset::Parts.options().segment);
        assert_eq!(default.generator.crop_layers, 0);
        assert_eq!(GeneratorOptions { crop_layers: 1, ..default.generator }, paper.generator);
        assert_eq!(default.selection, paper.selection);
    }
}
