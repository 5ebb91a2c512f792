//! The user's options for the subjects of the questions to the model.

use std::num::NonZeroUsize;

use serde::{Deserialize, Serialize};

use crate::config::SceneKey;
use crate::config::option_values::{self, Domain, OptionError, from_to};

/// Three answers have a majority, and three directions show a part from most sides.
const ASK_VIEWS: NonZeroUsize = NonZeroUsize::new(3).expect("three is not zero");
/// More views than this show nothing new.
const MOST_ASK_VIEWS: NonZeroUsize = NonZeroUsize::new(1000).expect("a thousand is not zero");
const VIEWS: Domain<NonZeroUsize> = from_to(NonZeroUsize::MIN, MOST_ASK_VIEWS);

/// The keys that a scene may set: all of them, because they affect only this scene's result.
pub const SCENE_KEYS: &[SceneKey] = &[SceneKey::any("ask"), SceneKey::any("ask-views")];

/// The subjects of the questions to the model.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize, Deserialize)]
#[serde(default)]
#[command(next_help_heading = "Parts")]
pub struct Options {
    /// Whether to ask the model about the object, its parts or segments
    #[arg(long, value_enum, default_value_t = AskAbout::default())]
    pub ask: AskAbout,

    /// Number of views in which to ask about each part; if the answers disagree, more views follow. With --ask segments, it is
    /// every view
    #[arg(long, value_name = "N", default_value_t = ASK_VIEWS, value_parser = VIEWS)]
    pub ask_views: NonZeroUsize,
}

impl Options {
    /// Checks that every number is within its domain.
    ///
    /// # Errors
    /// [`OptionError`], which names the option.
    pub fn check(&self) -> Result<(), OptionError> {
        VIEWS.check("--ask-views", self.ask_views)
    }
}

impl Default for Options {
    fn default() -> Self {
        option_values::defaults()
    }
}

/// `--ask`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AskAbout {
    /// The object first: one question, with all of its parts numbered in one picture from several sides
    #[default]
    Object,
    /// The parts of the object, found in 3D from the segments of all views, each in the views that show it best
    Parts,
    /// As in the paper: every segment of every view
    Segments,
}
