//! The user's options for the vote.

use std::num::NonZeroUsize;

use serde::{Deserialize, Serialize};

use super::correction::Setting;
use crate::config::SceneKey;
use crate::config::option_values::{self, Domain, OptionError, from_to};

/// Number of seen neighbours that decide for an unseen Gaussian: enough that one stray does not decide, few enough to
/// stay local.
const DEFAULT_NEIGHBORS: NonZeroUsize = NonZeroUsize::new(8).expect("eight is not zero");
/// More Gaussians than this are not a neighbourhood but a part of the object.
const MOST_NEIGHBORS: NonZeroUsize = NonZeroUsize::new(1000).expect("a thousand is not zero");
const NEIGHBORS: Domain<NonZeroUsize> = from_to(NonZeroUsize::MIN, MOST_NEIGHBORS);

/// The keys that a scene may set: all of them, because they affect only this scene's result.
pub const SCENE_KEYS: &[SceneKey] =
    &[SceneKey::any("vote"), SceneKey::any("agree"), SceneKey::any("neighbors"), SceneKey::any("correct")];

/// How the views' segments become a material for every Gaussian.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default)]
#[command(next_help_heading = "Vote")]
pub struct Options {
    /// How a view votes on a Gaussian
    #[arg(long, value_enum, default_value_t = Rule::default())]
    pub vote: Rule,

    /// How views whose answers differ agree on a material; matters only with --ask segments
    #[arg(long, value_enum, default_value_t = Agreement::default())]
    pub agree: Agreement,

    /// Number of nearest seen Gaussians from which an unseen one takes its material
    #[arg(long, value_name = "K", default_value_t = DEFAULT_NEIGHBORS)]
    #[arg(value_parser = NEIGHBORS)]
    pub neighbors: NonZeroUsize,

    /// Correct a part, by its name or number: `head.material=steel`, `cup.wall=3mm` (`none` if solid), `can.filling=water`,
    /// `can.share=80%`, `head.density=7850kg/m3`, `head.caption=TEXT`; may be repeated
    #[arg(long, value_name = "PART.KEY=VALUE")]
    pub correct: Vec<Setting>,
}

impl Options {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        NEIGHBORS.check("--neighbors", self.neighbors)
    }
}

impl Default for Options {
    fn default() -> Self {
        option_values::defaults()
    }
}

/// `--vote`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// As in the paper: one vote per view, for the part or segment at the Gaussian's centre, if the Gaussian passes the depth test
    Frequency,
    /// A vote for the part or segment of every pixel, weighted by the Gaussian's contribution to the pixel's colour
    #[default]
    Contribution,
}

/// `--agree`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Agreement {
    /// All views of a 3D part agree on its material first, then Gaussians choose among 3D parts
    #[default]
    Part,
    /// As in the paper: each Gaussian takes the most frequent material of the views that see it
    Gaussian,
}
