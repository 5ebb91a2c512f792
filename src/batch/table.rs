//! `summary.csv`: one row per scene, for a spreadsheet or a data frame.

use std::io;
use std::path::Path;

use crate::files::write;
use crate::units::Estimate;
use crate::words::output::one_line;

use super::{BatchError, Outcome, State, Summary};

const HEADER: [&str; 24] = [
    "scene",
    "state",
    "mass_kg",
    "mass_low_kg",
    "mass_high_kg",
    "volume_m3",
    "volume_low_m3",
    "volume_high_m3",
    "estimated_scale",
    "materials",
    "parts",
    "gaussians",
    "views",
    "warnings",
    "model",
    "requests",
    "input_tokens",
    "output_tokens",
    "usd",
    "seconds",
    "peak_memory_bytes",
    "exit",
    "error",
    "work",
];

/// Writes a row for each scene, sorted by name. What is unknown is an empty cell.
pub fn write(summary: &Summary, path: &Path) -> Result<(), BatchError> {
    let known = summary.outcomes.iter().map(|outcome| (outcome.scene.as_str(), row(outcome)));
    let missing = summary.missing.iter().map(|name| (name.as_str(), row_of_missing(name)));
    let mut rows: Vec<_> = known.chain(missing).collect();
    rows.sort_by_key(|(name, _)| *name);
    let written = write::file(path, |out| {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(HEADER).map_err(io::Error::from)?;
        rows.iter().try_for_each(|(_, row)| csv.write_record(row)).map_err(io::Error::from)?;
        csv.flush()
    });
    written.map_err(|source| BatchError::Io { path: path.to_owned(), source })
}

fn row_of_missing(name: &str) -> Vec<String> {
    let mut row = vec![String::new(); HEADER.len()];
    (row[0], row[1]) = (name.to_owned(), "missing".to_owned());
    row
}

fn row(outcome: &Outcome) -> Vec<String> {
    let Outcome { scene, state, results, asked, .. } = outcome;
    let state = match state {
        State::Done => "done",
        State::Failed => "failed",
        State::Skipped => "skipped",
    };
    let estimate = |of: Option<Estimate>| [of.map(|of| of.mid), of.map(|of| of.low), of.map(|of| of.high)].map(cell);
    let mut row = vec![scene.clone(), state.to_owned()];
    row.extend(estimate(results.mass_kg));
    row.extend(estimate(results.volume_m3));
    row.extend([results.estimated_scale.to_string(), results.materials.join("; ")]);
    row.extend([results.parts, results.gaussians, results.views].map(cell));
    row.extend([outcome.warnings.to_string(), cell(outcome.model.as_deref())]);
    row.extend([asked.requests.to_string(), asked.input_tokens.to_string(), asked.output_tokens.to_string()]);
    row.extend([cell(asked.usd), outcome.seconds.to_string(), outcome.peak_memory_bytes.to_string()]);
    row.extend([cell(outcome.exit), cell(outcome.error.as_deref().map(one_line))]);
    row.push(outcome.work.to_string_lossy().into_owned());
    row
}

fn cell(value: Option<impl ToString>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}
