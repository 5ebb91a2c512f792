//! What the user may choose about the vote.

use std::num::NonZeroUsize;

use serde::Serialize;

/// Seen neighbours that an unseen Gaussian asks: enough that one stray does not decide, few enough to stay local.
const DEFAULT_NEIGHBORS: NonZeroUsize = NonZeroUsize::new(8).expect("eight is not zero");

/// How the views' parts become a material for every Gaussian.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize)]
#[command(next_help_heading = "Vote")]
pub struct Options {
    /// What a view's vote for a Gaussian is
    #[arg(long, value_enum, default_value_t = Rule::default())]
    pub vote: Rule,

    /// Who settles on a material where the views' answers differ
    #[arg(long, value_enum, default_value_t = Agreement::default())]
    pub agree: Agreement,

    /// How many of the nearest seen Gaussians an unseen one takes its material from (count; own choice)
    #[arg(long, value_name = "K", default_value_t = DEFAULT_NEIGHBORS)]
    pub neighbors: NonZeroUsize,
}

impl Default for Options {
    fn default() -> Self {
        Self { vote: Rule::default(), agree: Agreement::default(), neighbors: DEFAULT_NEIGHBORS }
    }
}

/// `--vote`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The paper's: one vote a view, for the part at the Gaussian's centre, if the depth test says that it is seen there
    Frequency,
    /// A vote for the part of every pixel, as large as what the Gaussian adds to the pixel's light
    #[default]
    Contribution,
}

/// `--agree`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Agreement {
    /// All views of a 3D part agree on its material first, then Gaussians choose among 3D parts
    #[default]
    Part,
    /// The paper's: each Gaussian takes the most frequent material of the views that see it
    Gaussian,
}
