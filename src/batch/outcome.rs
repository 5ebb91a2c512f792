//! What became of a scene: a line of a shard's file.

use std::path::{Path, PathBuf};
use std::process::ExitStatus;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::units::Estimate;
use crate::workdir::{self, Artifact};

/// Whether a scene came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    Done,
    Failed,
}

/// What became of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub scene: String,
    pub state: State,
    /// The scene's work folder.
    pub work: PathBuf,
    /// The exit code of its gprop; none where that was killed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exit: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// From start to end of its last process.
    pub seconds: f64,
    /// Most resident memory seen, sampled; 0 where the system does not tell or it ended before the first look.
    pub peak_memory_bytes: u64,
    /// Warnings of all stages.
    pub warnings: usize,
    /// 3D parts, where the run went so far.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<Estimate>,
    /// What was asked of which scene, hashed.
    pub key: String,
}

/// What is left of a scene's process.
pub struct Ended {
    pub status: ExitStatus,
    pub stderr: String,
    pub seconds: f64,
    pub peak_memory_bytes: u64,
}

impl Outcome {
    /// The outcome of a scene whose process has ended by itself.
    pub fn of(scene: &str, work: &Path, key: String, ended: &Ended) -> Self {
        let done = ended.status.success();
        let run = workdir::read_json::<Value>(&work.join(Artifact::Run.path())).unwrap_or_default();
        let stages = run["stages"].as_array().map_or(&[][..], Vec::as_slice);
        let has_parts = done && stages.iter().any(|stage| stage["name"] == "parts");
        let parts: Option<Value> =
            has_parts.then(|| workdir::read_json(&work.join(Artifact::Parts.path())).ok()).flatten();
        let mass = parts.as_ref().map(|parts| parts["object"]["mass_kg"].clone());
        Self {
            scene: scene.to_owned(),
            state: if done { State::Done } else { State::Failed },
            work: work.to_owned(),
            exit: ended.status.code(),
            error: (!done).then(|| error_in(&ended.stderr, ended.status)),
            seconds: ended.seconds,
            peak_memory_bytes: ended.peak_memory_bytes,
            warnings: stages.iter().filter_map(|stage| Some(stage["warnings"].as_array()?.len())).sum(),
            parts: parts.as_ref().and_then(|parts| Some(parts["parts"].as_array()?.len())),
            mass_kg: mass.and_then(|mass| serde_json::from_value(mass).ok()),
            key,
        }
    }

    /// The outcome of a scene that had to be stopped, with the reason.
    pub fn stopped(scene: &str, work: &Path, key: String, ended: &Ended, why: String) -> Self {
        Self { error: Some(why), ..Self::of(scene, work, key, ended) }
    }
}

/// The error with which a gprop ended, as it printed it; how it ended where it could not print any more.
fn error_in(stderr: &str, status: ExitStatus) -> String {
    const MARK: &str = "error: ";
    let begins = |at: &usize| *at == 0 || stderr.as_bytes()[at - 1] == b'\n';
    let at = stderr.match_indices(MARK).map(|(at, _)| at).filter(begins).last();
    match at {
        Some(at) => stderr[at + MARK.len()..].trim().to_owned(),
        None => format!("its process ended without a word ({status})"),
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    #[test]
    fn the_last_error_counts_with_all_its_lines() {
        let status = ExitStatus::from_raw(3 << 8);
        let stderr = "WARN an error: in a warning\nerror: no recorded answer:\n  view 003\nAsk a model\n";
        assert_eq!(error_in(stderr, status), "no recorded answer:\n  view 003\nAsk a model");
        assert_eq!(error_in("", ExitStatus::from_raw(9)), "its process ended without a word (signal: 9 (SIGKILL))");
    }
}
