//! How often a gripping policy picks objects up without slip (PUR), without damage (NDR), and both (SR): the paper's
//! measures (section 4.1), over recorded outcomes, or over outcomes that are [`predicted`] for the grasps that gprop
//! proposed, from the [`truth`] about the parts that they press on.

pub mod predicted;
pub mod truth;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::files::{self, TableError};
use crate::words::output::one_line;

use predicted::GraspedObject;

/// The header of recorded outcomes.
const HEADER: &str = "object,policy,picked_up,undamaged";

/// An error in a table.
#[derive(Debug, thiserror::Error)]
pub enum OutcomesError {
    #[error("{path:?}: {message}; the header is {HEADER}")]
    Table { path: PathBuf, message: String },
    #[error("{path:?} has no rows")]
    Empty { path: PathBuf },
}

/// How one grasp ended.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    pub object: String,
    pub policy: String,
    pub picked_up: bool,
    pub undamaged: bool,
}

/// Rates of one policy, 0 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Rates {
    /// Share picked up without slipping.
    pub pur: f64,
    /// Share not damaged.
    pub ndr: f64,
    /// Share for which both hold.
    pub sr: f64,
    pub count: usize,
}

/// The rates of every policy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// True if the outcomes were predicted rather than observed.
    pub predicted: bool,
    pub policies: BTreeMap<String, Rates>,
    /// Each object with its predicted outcomes; none for recorded ones.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<GraspedObject>,
}

/// Reads recorded outcomes.
///
/// # Errors
/// If the file cannot be read, is not such a table, or is empty.
pub fn outcomes(path: &Path) -> Result<Vec<Outcome>, OutcomesError> {
    let error = |problem: TableError| OutcomesError::Table { path: path.to_owned(), message: problem.to_string() };
    let rows: Vec<Outcome> = files::rows(path).map_err(error)?;
    if rows.is_empty() { Err(OutcomesError::Empty { path: path.to_owned() }) } else { Ok(rows) }
}

impl Evaluation {
    /// The rates of every policy in recorded outcomes.
    pub fn of_recorded(outcomes: &[Outcome]) -> Self {
        Self { predicted: false, policies: rates(outcomes), objects: Vec::new() }
    }

    /// The rates of gprop and of the three fixed forces on these objects.
    pub fn of_objects(objects: Vec<GraspedObject>) -> Self {
        let outcomes: Vec<Outcome> = objects.iter().flat_map(GraspedObject::outcomes).collect();
        Self { predicted: true, policies: rates(&outcomes), objects }
    }

    /// Tables for the terminal: by object, then the rates in percent as in the paper.
    pub fn text(&self) -> String {
        let mut text = predicted::table(&self.objects);
        text += &format!("{:<12} {:>7} {:>7} {:>7} {:>7}\n", "policy", "PUR %", "NDR %", "SR %", "grasps");
        for (policy, r) in &self.policies {
            let [pur, ndr, sr] = [r.pur, r.ndr, r.sr].map(|share| share * 100.0);
            let policy = one_line(policy);
            text += &format!("{policy:<12} {pur:>7.2} {ndr:>7.2} {sr:>7.2} {:>7}\n", r.count);
        }
        if self.predicted { text + predicted::NOTE } else { text }
    }
}

fn rates(outcomes: &[Outcome]) -> BTreeMap<String, Rates> {
    let mut by_policy: BTreeMap<String, Vec<&Outcome>> = BTreeMap::new();
    for outcome in outcomes {
        by_policy.entry(outcome.policy.clone()).or_default().push(outcome);
    }
    by_policy.into_iter().map(|(policy, outcomes)| (policy, Rates::of(&outcomes))).collect()
}

impl Rates {
    fn of(outcomes: &[&Outcome]) -> Self {
        let share =
            |holds: fn(&Outcome) -> bool| outcomes.iter().filter(|o| holds(o)).count() as f64 / outcomes.len() as f64;
        Self {
            pur: share(|o| o.picked_up),
            ndr: share(|o| o.undamaged),
            sr: share(|o| o.picked_up && o.undamaged),
            count: outcomes.len(),
        }
    }
}
