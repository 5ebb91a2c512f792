//! Errors of a batch as a whole.

use std::path::PathBuf;

use thiserror::Error;

use crate::words::output::{agreeing, counted, one_line};
use crate::workdir::lock::Holder;

/// Why a batch cannot be run, or did not finish all scenes.
#[derive(Debug, Error)]
pub enum BatchError {
    #[error("--split {given}: {problem}")]
    Split { given: String, problem: String },
    #[error("--filter {given}: {problem}")]
    Filter { given: String, problem: String },
    #[error("none of the {} is left after --split, --filter, --start and --end", counted(*.listed, "scene"))]
    NothingSelected { listed: usize },
    #[error(
        "with --out, no scene may be called `{scene}`, because the batch keeps its own files in {folder:?} and many file \
         systems do not distinguish upper and lower case; rename the scene's folder, or leave out --out"
    )]
    Reserved { scene: String, folder: PathBuf },
    #[error("{given}: {problem}")]
    Shard { given: String, problem: String },
    #[error("cannot determine how much memory is free; set the limit for the batch with --memory GB")]
    UnknownMemory,
    #[error(
        "another gprop {holder} shard {shard} of {folder:?}; wait for it to end or choose another folder with --out"
    )]
    Locked { shard: String, folder: PathBuf, holder: Holder },
    #[error("cannot use {path:?}: {source}; make room or choose another folder with --out")]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{path:?} line {line} is not a line that gprop wrote: {source}; delete the file and run again")]
    Line { path: PathBuf, line: usize, source: serde_json::Error },
    #[error("there is nothing to merge in {folder:?}; run the shards first, with the same --out")]
    NothingToMerge { folder: PathBuf },
    #[error(
        "{folder:?} has results of different numbers of shards: {divisions}; delete the files that are out of date"
    )]
    MixedShards { folder: PathBuf, divisions: String },
    #[error("cannot start the process for a scene: {0}")]
    Start(std::io::Error),
    #[error("cannot wait for the process of a scene or end it: {0}")]
    Process(std::io::Error),
    #[error(
        "is not among the scenes chosen by these options; collect with the same --split, --filter, --start, --end and \
         --shard"
    )]
    NotOfThisBatch,
    /// Some scenes failed or are not done: exit code 6.
    #[error(
        "{} of {} {} not done:{}{}",
        .failed.len() + .missing.len(), counted(*.scenes, "scene"), agreeing(.failed.len() + .missing.len(), "is", "are"),
        listed(.failed, .missing), if *.lacks_answers { ANSWERS } else { "" }
    )]
    Incomplete {
        scenes: usize,
        failed: Vec<FailedScene>,
        missing: Vec<String>,
        /// True if some failed because nobody was asked.
        lacks_answers: bool,
    },
}

/// A scene that failed.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct FailedScene {
    pub scene: String,
    pub error: String,
}

/// What to do about scenes without an answer.
const ANSWERS: &str = "\nName a model for the answers with --lmm-url and --lmm-model, or give them by hand with `gprop answer`; then run \
                       the same command again";

/// One line per scene.
fn listed(failed: &[FailedScene], missing: &[String]) -> String {
    let first_line = |text: &str| one_line(text.lines().next().unwrap_or_default()).into_owned();
    let failed = failed.iter().map(|of| format!("\n  {}: {}", one_line(&of.scene), first_line(&of.error)));
    let unknown = "it has no result; its shard has not finished";
    let missing = missing.iter().map(|name| format!("\n  {}: {unknown}", one_line(name)));
    failed.chain(missing).collect()
}
