//! The outcome of a scene: a line of a shard's file.

use std::path::{Path, PathBuf};
use std::process::ExitStatus;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::config::serialize_path;
use crate::error::ErrorKind;
use crate::parts::{Part, Parts};
use crate::pipeline::{RunRecord, Stage, StageRecord};
use crate::units::Estimate;
use crate::vote::FieldPart;
use crate::workdir::{self, Artifact};

use super::Asked;
use super::error::FailedScene;

/// How a scene ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    Done,
    Failed,
    /// Not tried: its name cannot be written to the batch's files.
    Skipped,
}

/// The outcome of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub scene: String,
    pub state: State,
    /// The scene's work folder.
    #[serde(serialize_with = "serialize_path")]
    pub work: PathBuf,
    /// The exit code of its gprop process; `None` if that was killed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exit: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// From start to end of its last process.
    pub seconds: f64,
    /// Largest resident memory seen by sampling; 0 if the system does not report it or the scene ended before the first
    /// sample.
    pub peak_memory_bytes: u64,
    /// Warnings of all stages that were done after those that they read from.
    pub warnings: usize,
    /// The model that was named for its questions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// What its processes have asked with this task.
    #[serde(default)]
    pub asked: Asked,
    #[serde(flatten)]
    pub results: Results,
    /// Hash of the task and the scene.
    pub key: String,
}

/// The results of a done scene, as far as its run went.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Results {
    /// Number of 3D parts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<Estimate>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_m3: Option<Estimate>,
    /// True if mass and volume follow from a scale that a model estimated; missing otherwise.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub estimated_scale: bool,
    /// By decreasing mass; in the order of parts if masses are unknown.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<String>,
    /// Number of Gaussians of the object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaussians: Option<usize>,
    /// Number of chosen views.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub views: Option<usize>,
}

/// How a scene's process ended.
pub struct Ended {
    pub status: ExitStatus,
    pub stderr: String,
    pub seconds: f64,
    pub peak_memory_bytes: u64,
    pub asked: Asked,
}

impl Outcome {
    /// The outcome of a scene whose process ended by itself.
    pub fn of(scene: &str, work: &Path, key: String, ended: &Ended) -> Self {
        let done = ended.status.success();
        let run: RunRecord = workdir::read_json(&work.join(Artifact::Run.path())).unwrap_or_default();
        let stages = run.current();
        Self {
            scene: scene.to_owned(),
            state: if done { State::Done } else { State::Failed },
            work: work.to_owned(),
            exit: ended.status.code(),
            error: (!done).then(|| error_in(&ended.stderr, ended.status)),
            seconds: ended.seconds,
            peak_memory_bytes: ended.peak_memory_bytes,
            warnings: stages.iter().map(|stage| stage.warnings.len()).sum(),
            model: run.options.get("query").and_then(|query| Some(query["lmm_model"].as_str()?.to_owned())),
            asked: ended.asked,
            results: if done { Results::read(work, &stages) } else { Results::default() },
            key,
        }
    }

    /// The outcome of a scene whose folder has a name that is not UTF-8; `scene` is the name in printable form.
    pub fn skipped(scene: &str) -> Self {
        Self {
            scene: scene.to_owned(),
            state: State::Skipped,
            work: PathBuf::new(),
            exit: None,
            error: Some("the folder's name is not UTF-8; rename it and run again".to_owned()),
            seconds: 0.0,
            peak_memory_bytes: 0,
            warnings: 0,
            model: None,
            asked: Asked::default(),
            results: Results::default(),
            key: String::new(),
        }
    }

    /// The outcome of a scene that had to be stopped, with the reason. One that was done by then stays done.
    pub fn stopped(scene: &str, work: &Path, key: String, ended: &Ended, why: String) -> Self {
        let outcome = Self::of(scene, work, key, ended);
        match outcome.state {
            State::Done => outcome,
            State::Failed | State::Skipped => Self { error: Some(why), ..outcome },
        }
    }

    /// The scene as one that failed.
    pub fn as_failed(&self) -> FailedScene {
        FailedScene { scene: self.scene.clone(), error: self.error.clone().unwrap_or_default() }
    }

    /// True if it failed because answers are missing and nobody was asked for them.
    pub fn lacks_answers(&self) -> bool {
        self.exit == Some(ErrorKind::Answer.exit_code().into()) && self.asked.requests == 0
    }
}

impl Results {
    /// Reads the results that the `stages` left in the work folder; results that cannot be read are unknown.
    fn read(work: &Path, stages: &[&StageRecord]) -> Self {
        let did = |stage: Stage| stages.iter().any(|record| record.name == stage);
        let views: Value = workdir::read_json(&work.join(Artifact::Views.path())).unwrap_or_default();
        let mut results = Self {
            gaussians: views["gaussians"].as_u64().map(|count| count as usize),
            views: views["views"].as_array().map(Vec::len),
            ..Self::default()
        };
        let voted = || workdir::read_json::<Vec<FieldPart>>(&work.join(Artifact::Labels.path())).ok();
        if let Some(voted) = did(Stage::Vote).then(voted).flatten() {
            results.parts = Some(voted.len());
            results.materials = distinct(voted.into_iter().map(|part| part.material));
        }
        // Without a metric scale the file has another format.
        let parts = || workdir::read_json::<Parts>(&work.join(Artifact::Parts.path())).ok();
        if let Some(mut parts) = did(Stage::Parts).then(parts).flatten() {
            results.parts = Some(parts.parts.len());
            results.mass_kg = Some(parts.object.mass_kg);
            results.volume_m3 = Some(parts.object.volume_m3);
            results.estimated_scale = parts.estimated_scale.is_some();
            let mass = |part: &Part| part.mass_kg.map_or(0.0, |mass| mass.mid);
            parts.parts.sort_by(|a, b| mass(b).total_cmp(&mass(a)));
            results.materials = distinct(parts.parts.into_iter().map(|part| part.material));
        }
        results
    }
}

/// The distinct names, in order of their first occurrence.
fn distinct(names: impl Iterator<Item = String>) -> Vec<String> {
    let mut found = Vec::new();
    for name in names {
        if !found.contains(&name) {
            found.push(name);
        }
    }
    found
}

/// The error that a gprop process printed at its end; its exit status if it could not print one.
fn error_in(stderr: &str, status: ExitStatus) -> String {
    const MARK: &str = "error: ";
    let begins = |at: &usize| *at == 0 || stderr.as_bytes()[at - 1] == b'\n';
    let at = stderr.match_indices(MARK).map(|(at, _)| at).filter(begins).last();
    match at {
        Some(at) => stderr[at + MARK.len()..].trim().to_owned(),
        None => format!("its process ended without an error message ({status})"),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;

    use super::*;

    #[test]
    fn a_scene_that_ended_by_itself_before_it_was_killed_is_done() {
        let stopped = |status: i32| {
            let status = ExitStatus::from_raw(status);
            let ended =
                Ended { status, stderr: String::new(), seconds: 1.0, peak_memory_bytes: 1, asked: Asked::default() };
            let outcome = Outcome::stopped("a", Path::new("no such folder"), String::new(), &ended, "slow".to_owned());
            (outcome.state, outcome.error)
        };
        assert_eq!(stopped(0), (State::Done, None));
        assert_eq!(stopped(9), (State::Failed, Some("slow".to_owned())));
    }

    #[test]
    fn the_last_error_counts_with_all_its_lines() {
        let status = ExitStatus::from_raw(3 << 8);
        let stderr = "WARN an error: in a warning\nerror: no recorded answer:\n  view 003\nAsk a model\n";
        assert_eq!(error_in(stderr, status), "no recorded answer:\n  view 003\nAsk a model");
        assert_eq!(
            error_in("", ExitStatus::from_raw(9)),
            "its process ended without an error message (signal: 9 (SIGKILL))"
        );
    }
}
