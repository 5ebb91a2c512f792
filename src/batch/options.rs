//! The user's options for a batch.

use std::num::NonZeroUsize;

use crate::config::option_values::{Domain, above, from_to};
use crate::scene::dataset::Layout;

use super::{BatchError, Shard};

/// Each job is a separate process.
const MOST_JOBS: NonZeroUsize = NonZeroUsize::new(1024).expect("it is not zero");
const JOBS: Domain<NonZeroUsize> = from_to(NonZeroUsize::MIN, MOST_JOBS);
/// A petabyte: more than any machine has.
const MOST_GB: f64 = 1e6;
const GIGABYTES: Domain<f64> = above(0.0, MOST_GB);
/// Two years: a larger value is a mistake.
const MINUTES: Domain<f64> = above(0.0, 1e6);

/// Which scenes to run, how many at a time, and what to do with those that failed before.
#[derive(Debug, Clone, Default, clap::Args)]
#[command(next_help_heading = "Batch")]
pub struct Options {
    /// Layout of the data set [default: recognised from the folder]
    #[arg(long, value_enum)]
    pub layout: Option<Layout>,

    /// Run only the scenes of this split of the data set, or those that a text file names, one per line
    #[arg(long, value_name = "NAME|FILE")]
    pub split: Option<String>,

    /// Run only scenes whose name contains this text, or matches it if it has `*`, `?` or `[...]`
    #[arg(long, value_name = "TEXT|GLOB")]
    pub filter: Option<String>,

    /// Index, counted from 0, of the first scene to run among those that --split and --filter leave, sorted by name
    #[arg(long, value_name = "N", default_value_t)]
    pub start: usize,

    /// Index after that of the last scene to run, counted like --start [default: all]
    #[arg(long, value_name = "N")]
    pub end: Option<usize>,

    /// Run only shard I of N, with I from 0; the shards are of about equal size [default: from
    /// SLURM_ARRAY_TASK_ID and SLURM_ARRAY_TASK_COUNT, or JOB_COMPLETION_INDEX and JOB_COMPLETIONS, if they are set]
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,

    /// Number of scenes to run side by side [default: one for every four threads]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = jobs)]
    pub jobs: Option<NonZeroUsize>,

    /// Memory in GB (10^9 bytes) for all scenes together [default: four fifths of the free memory]
    #[arg(long, value_name = "GB", allow_negative_numbers = true, value_parser = gigabytes)]
    pub memory: Option<f64>,

    /// End a scene whose process takes longer than this many minutes, and count it as failed [default: no limit]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = MINUTES)]
    pub max_minutes: Option<f64>,

    /// Run failed scenes again
    #[arg(long)]
    pub retry_failed: bool,
}

fn jobs(text: &str) -> Result<NonZeroUsize, String> {
    let given = text.parse().ok().filter(|jobs| JOBS.contains(*jobs));
    given.ok_or_else(|| {
        format!("give a number of scenes from 1 to {MOST_JOBS}, or omit it to run one scene per four threads")
    })
}

fn gigabytes(text: &str) -> Result<f64, String> {
    let given = text.parse().ok().filter(|gigabytes| GIGABYTES.contains(*gigabytes));
    given.ok_or_else(|| {
        format!(
            "give a number of GB above 0, up to {MOST_GB}, such as 8 or 1.5, or omit it to use four fifths of the free \
             memory"
        )
    })
}

impl Options {
    /// The shard from the command line, else that of the cluster's job, else the whole data set.
    pub fn shard(&self) -> Result<Shard, BatchError> {
        match self.shard {
            Some(shard) => Ok(shard),
            None => Shard::from_environment(&|name| std::env::var(name).ok()),
        }
    }
}
