//! What the user may choose about a scene.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use super::choose::DEFAULT_VIEWS;
use crate::units::{MetricScale, ScaleSource};

/// Which views to use, and how long a scene unit is.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize)]
#[command(next_help_heading = "Scene")]
pub struct Options {
    /// How many views to use, chosen spread over all directions
    #[arg(long, value_name = "N", default_value_t = DEFAULT_VIEWS, overrides_with = "view_list")]
    pub views: std::num::NonZeroUsize,

    /// Use just these views instead of --views: the photos' file names without extension, separated by commas
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', overrides_with = "views")]
    pub view_list: Vec<String>,

    /// How long a scene unit is: `metric` (metres), a factor in metres per scene unit, or `auto`: what the scene itself
    /// states, and unknown where it states nothing, as a transforms.json does
    #[arg(long, value_name = "auto|metric|F", default_value_t = ScaleChoice::Auto)]
    pub scale: ScaleChoice,
}

impl Default for Options {
    fn default() -> Self {
        Self { views: DEFAULT_VIEWS, view_list: Vec::new(), scale: ScaleChoice::Auto }
    }
}

/// `--scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ScaleChoice {
    /// As the scene states; unknown where it does not.
    Auto,
    /// The scene is in metres.
    Metric,
    /// Metres per scene unit.
    Factor(f64),
}

impl ScaleChoice {
    /// The scale this choice amounts to in a scene that states none.
    pub fn metric_scale(self) -> Option<MetricScale> {
        match self {
            Self::Auto => None,
            Self::Metric => Some(MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric }),
            Self::Factor(meters_per_unit) => Some(MetricScale { meters_per_unit, source: ScaleSource::Factor }),
        }
    }
}

impl FromStr for ScaleChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "auto" => Ok(Self::Auto),
            "metric" => Ok(Self::Metric),
            _ => match text.parse() {
                Ok(factor) if f64::is_normal(factor) && factor > 0.0 => Ok(Self::Factor(factor)),
                _ => Err("neither `auto`, `metric` nor a positive number of metres per scene unit".to_owned()),
            },
        }
    }
}

impl fmt::Display for ScaleChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Metric => f.write_str("metric"),
            Self::Factor(factor) => write!(f, "{factor}"),
        }
    }
}

/// Written as it is typed.
impl Serialize for ScaleChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
