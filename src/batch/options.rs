//! What the user may choose about a batch.

use std::ffi::OsString;
use std::num::NonZeroUsize;

use crate::scene::dataset::Layout;

use super::{BatchError, Shard};

/// Which scenes, how many at a time, and what to do with those that failed before.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Batch")]
pub struct Options {
    /// How the scenes lie [default: what the folder looks like]
    #[arg(long, value_enum)]
    pub layout: Option<Layout>,

    /// Only the scenes of this split of the data set, or those that a text file names, one a line
    #[arg(long, value_name = "NAME|FILE")]
    pub split: Option<String>,

    /// Only scenes whose name holds this text, or fits it where it has `*`, `?` or `[...]`
    #[arg(long, value_name = "TEXT|GLOB")]
    pub filter: Option<String>,

    /// First of the scenes that are left, by name, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub start: usize,

    /// The scene before which to end, counted as --start [default: all]
    #[arg(long, value_name = "N")]
    pub end: Option<usize>,

    /// Part I of N of these scenes, counted from 0; the parts are of about equal size. Taken from SLURM_ARRAY_TASK_ID and
    /// SLURM_ARRAY_TASK_COUNT, or JOB_COMPLETION_INDEX and JOB_COMPLETIONS, where it is not given
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,

    /// Scenes side by side [default: one for every four threads]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = jobs)]
    pub jobs: Option<NonZeroUsize>,

    /// Memory in GB (10^9 bytes) that all scenes together may use [default: four fifths of what is free]
    #[arg(long, value_name = "GB", allow_negative_numbers = true, value_parser = gigabytes)]
    pub memory: Option<f64>,

    /// Try the scenes again that failed
    #[arg(long)]
    pub retry_failed: bool,
}

fn jobs(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().map_err(|_| {
        "is no number of scenes; give 1 or more, or leave it out for one for every four threads".to_owned()
    })
}

fn gigabytes(text: &str) -> Result<f64, String> {
    let given = text.parse().ok().filter(|gigabytes: &f64| gigabytes.is_finite() && *gigabytes > 0.0);
    given.ok_or_else(|| {
        "is no amount above 0; give GB such as 8 or 1.5, or leave it out for four fifths of what is free".to_owned()
    })
}

impl Options {
    /// The shard that was typed, else that of the cluster's job, else the whole.
    pub fn shard(&self) -> Result<Shard, BatchError> {
        match self.shard {
            Some(shard) => Ok(shard),
            None => Shard::from_environment(&|name| std::env::var(name).ok()),
        }
    }

    /// The budget among the typed `flags`.
    pub(super) fn max_usd_of(&self, flags: &[OsString]) -> Option<f64> {
        let last = flags.iter().rev().find_map(|flag| flag.to_str()?.strip_prefix("--max-usd="));
        last.and_then(|usd| usd.parse().ok())
    }
}
