//! The outcomes of all scenes: a table for people, `summary.json` for programs, `summary.csv` for spreadsheets, and the masses in the form of
//! NeRF2Physics' predictions, `mass_predictions.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::files::json;
use crate::files::write;
use crate::report::ESTIMATED;
use crate::words::output::{counted, one_line};

use super::select::Selected;
use super::{Asked, BatchError, FailedScene, Outcome, State, table};

/// Names of the files.
const FILE: &str = "summary.json";
const TABLE: &str = "summary.csv";
const MASSES: &str = "mass_predictions.json";

/// The outcomes of the scenes of a batch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    pub scenes: usize,
    pub done: usize,
    pub failed: usize,
    /// Number of scenes that were not tried.
    pub skipped: usize,
    /// Scenes without an outcome.
    pub missing: Vec<String>,
    /// Sum over the last processes of all scenes.
    pub seconds: f64,
    /// Peak memory of the scene that used most.
    pub peak_memory_bytes: u64,
    /// The models that were named for the questions, sorted.
    pub models: Vec<String>,
    /// What all scenes have asked.
    pub asked: Asked,
    /// Sorted by scene.
    pub outcomes: Vec<Outcome>,
}

impl Summary {
    /// The summary of `scenes` with their known `outcomes`, and of the `skipped` scenes.
    pub(super) fn new<'a>(
        scenes: impl Iterator<Item = &'a Selected>,
        outcomes: impl Iterator<Item = &'a Outcome>,
        skipped: impl Iterator<Item = Outcome>,
    ) -> Self {
        let mut known: BTreeMap<&str, &Outcome> = outcomes.map(|outcome| (outcome.scene.as_str(), outcome)).collect();
        let (mut found, mut missing) = (Vec::new(), Vec::new());
        for scene in scenes {
            match known.remove(scene.name.as_str()) {
                Some(outcome) => found.push(outcome.clone()),
                None => missing.push(scene.name.clone()),
            }
        }
        found.extend(skipped);
        found.sort_by(|a, b| a.scene.cmp(&b.scene));
        let count = |state| found.iter().filter(|outcome| outcome.state == state).count();
        Self {
            scenes: found.len() + missing.len(),
            done: count(State::Done),
            failed: count(State::Failed),
            skipped: count(State::Skipped),
            missing,
            seconds: found.iter().map(|outcome| outcome.seconds).sum(),
            peak_memory_bytes: found.iter().map(|outcome| outcome.peak_memory_bytes).max().unwrap_or(0),
            models: found
                .iter()
                .filter_map(|outcome| outcome.model.clone())
                .collect::<BTreeSet<_>>()
                .into_iter()
                .collect(),
            asked: found.iter().fold(Asked::default(), |sum, outcome| sum.plus(outcome.asked)),
            outcomes: found,
        }
    }

    /// Writes it, its table and the masses into the batch's folder.
    pub(super) fn write(&self, folder: &Path) -> Result<(), BatchError> {
        write_json(folder.join(FILE), self)?;
        table::write(self, &folder.join(TABLE))?;
        write_json(folder.join(MASSES), &self.masses())
    }

    /// [low, high] in kilograms of each scene that has a mass, which is what NeRF2Physics' evaluation reads.
    fn masses(&self) -> BTreeMap<&str, [f64; 2]> {
        let mass = |outcome: &Outcome| outcome.results.mass_kg.map(|mass| [mass.low, mass.high]);
        self.outcomes.iter().filter_map(|outcome| Some((outcome.scene.as_str(), mass(outcome)?))).collect()
    }

    /// A header, one line per scene that has an outcome, and one for all.
    pub fn table(&self) -> String {
        let widest =
            self.outcomes.iter().map(|outcome| one_line(&outcome.scene).chars().count()).max().unwrap_or(0).max(5);
        let mut text =
            format!("{:<widest$}  {:<7}  {:>9}  {:>8}  {:>5}  mass in kg\n", "scene", "", "seconds", "MB", "parts");
        for outcome in &self.outcomes {
            let state = match outcome.state {
                State::Done => "done",
                State::Failed => "FAILED",
                State::Skipped => "skipped",
            };
            let parts = outcome.results.parts.map_or_else(String::new, |parts| parts.to_string());
            let last = match (&outcome.error, &outcome.results.mass_kg) {
                (Some(error), _) => one_line(error.lines().next().unwrap_or_default()).into_owned(),
                (None, Some(mass)) => {
                    let mark = if outcome.results.estimated_scale { ESTIMATED } else { "" };
                    format!("{:.3} ({:.3} to {:.3}){mark}", mass.mid, mass.low, mass.high)
                }
                (None, None) => String::new(),
            };
            let Outcome { scene, seconds, peak_memory_bytes, .. } = outcome;
            let scene = one_line(scene);
            let megabytes = peak_memory_bytes / 1_000_000;
            let line = format!("{scene:<widest$}  {state:<7}  {seconds:>9.1}  {megabytes:>8}  {parts:>5}  {last}");
            writeln!(text, "{}", line.trim_end()).expect("writing to a string cannot fail");
        }
        let Self { scenes, done, failed, missing, seconds, .. } = self;
        let missing = missing.len();
        let skipped = if self.skipped > 0 { format!(", {} skipped", self.skipped) } else { String::new() };
        let asked = if self.asked.requests > 0 { format!("; {}", self.asked) } else { String::new() };
        text + &format!(
            "{}: {done} done, {failed} failed, {missing} without a result{skipped}; {seconds:.0} seconds in total{asked}",
            counted(*scenes, "scene")
        )
    }

    /// Checks that every scene is done or skipped.
    ///
    /// # Errors
    /// [`BatchError::Incomplete`] with the scenes that are not.
    pub fn require_all(&self) -> Result<(), BatchError> {
        let failed = self.outcomes.iter().filter(|outcome| outcome.state == State::Failed);
        let lacks_answers = failed.clone().any(Outcome::lacks_answers);
        let failed: Vec<FailedScene> = failed.map(Outcome::as_failed).collect();
        if failed.is_empty() && self.missing.is_empty() {
            return Ok(());
        }
        Err(BatchError::Incomplete { scenes: self.scenes, failed, missing: self.missing.clone(), lacks_answers })
    }
}

fn write_json(path: PathBuf, value: &impl Serialize) -> Result<(), BatchError> {
    let written = write::file(&path, |out| {
        out.write_all(json::pretty(value)?.as_bytes())?;
        out.write_all(b"\n")
    });
    written.map_err(|source| BatchError::Io { path, source })
}
