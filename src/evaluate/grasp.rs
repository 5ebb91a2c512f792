//! How often a gripping policy picks objects up without slip (PUR), without damage (NDR), and both (SR): the paper's
//! measures (section 4.1), over recorded outcomes or outcomes predicted from true properties.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::grasp::formulas::{Bearing, f_max, f_min};
use crate::grasp::gripper::GripperProfile;
use crate::grasp::options::MAX_CURVATURE_1_M;
use crate::output::one_line;
use crate::units::GRAVITY_M_S2;

/// The paper's fixed-force policies: normalised inputs of 15, 60 and 100, with a gripper that obeys 15 to 100. Given as
/// fractions of the enabled commands, for any gripper.
const FIXED: [(&str, f64); 3] = [("MinGF", 0.0), ("MidGF", 45.0 / 85.0), ("MaxGF", 1.0)];

/// An error in a table.
#[derive(Debug, thiserror::Error)]
pub enum OutcomesError {
    #[error("{path:?}: {message}; the header is {header}")]
    Table { path: PathBuf, message: String, header: &'static str },
    #[error("{path:?} has no rows")]
    Empty { path: PathBuf },
    #[error("{path:?} row {row}: {column} of {object:?} is {value}: give a number above 0")]
    Value { path: PathBuf, row: usize, object: String, column: &'static str, value: f64 },
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

/// An object's true properties (those of the part that bears the force, unless they are of the whole), and the force
/// that gprop would use.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrueObject {
    pub object: String,
    pub mass_kg: f64,
    pub friction: f64,
    pub strength_pa: f64,
    pub youngs_modulus_pa: f64,
    pub thickness_m: f64,
    pub f_star_n: f64,
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
}

/// Reads recorded outcomes.
///
/// # Errors
/// If the file cannot be read, is not such a table, or is empty.
pub fn outcomes(path: &Path) -> Result<Vec<Outcome>, OutcomesError> {
    read(path, "object,policy,picked_up,undamaged")
}

/// Reads the true properties of objects.
///
/// # Errors
/// If the file cannot be read, is not such a table or is empty, or a number in it is not above 0.
pub fn objects(path: &Path) -> Result<Vec<TrueObject>, OutcomesError> {
    let header = "object,mass_kg,friction,strength_pa,youngs_modulus_pa,thickness_m,f_star_n";
    let objects: Vec<TrueObject> = read(path, header)?;
    for (row, o) in objects.iter().enumerate() {
        let columns = [
            ("mass_kg", o.mass_kg),
            ("friction", o.friction),
            ("strength_pa", o.strength_pa),
            ("youngs_modulus_pa", o.youngs_modulus_pa),
            ("thickness_m", o.thickness_m),
            ("f_star_n", o.f_star_n),
        ];
        if let Some((column, value)) = columns.into_iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
            let (path, object) = (path.to_owned(), o.object.clone());
            return Err(OutcomesError::Value { path, row: row + 1, object, column, value });
        }
    }
    Ok(objects)
}

fn read<T: DeserializeOwned>(path: &Path, header: &'static str) -> Result<Vec<T>, OutcomesError> {
    let error = |e: csv::Error| OutcomesError::Table { path: path.to_owned(), message: e.to_string(), header };
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_path(path).map_err(error)?;
    let rows: Vec<T> = reader.deserialize().collect::<Result<_, _>>().map_err(error)?;
    if rows.is_empty() { Err(OutcomesError::Empty { path: path.to_owned() }) } else { Ok(rows) }
}

/// The outcome for each object, lifted straight up with gprop's force and with the three fixed ones: picked up if the
/// force is at least the true F_min, undamaged if it is at most the true F_max.
pub fn predict(objects: &[TrueObject], gripper: &GripperProfile) -> Vec<Outcome> {
    let [from, full] = gripper.enabled();
    let fixed = FIXED.map(|(name, share)| (name, Some(gripper.force_for(from + share * (full - from)))));
    let policies = fixed.into_iter().chain([("gprop", None)]);
    let outcome = |o: &TrueObject, policy: &str, force_n: f64| {
        let most = f_max(&Bearing {
            area_m2: gripper.finger_area_m2,
            strength_pa: o.strength_pa,
            youngs_modulus_pa: o.youngs_modulus_pa,
            thickness_m: o.thickness_m,
            max_curvature_1_m: MAX_CURVATURE_1_M,
        });
        Outcome {
            object: o.object.clone(),
            policy: policy.to_owned(),
            picked_up: force_n >= f_min(o.mass_kg, o.friction, 0.0, GRAVITY_M_S2),
            undamaged: force_n <= most.newtons,
        }
    };
    let of_policy = |(policy, force): (&'static str, Option<f64>)| {
        objects.iter().map(move |o| outcome(o, policy, force.unwrap_or(o.f_star_n)))
    };
    policies.flat_map(of_policy).collect()
}

impl Evaluation {
    /// The rates of every policy that occurs.
    pub fn of(outcomes: &[Outcome], predicted: bool) -> Self {
        let mut by_policy: BTreeMap<String, Vec<&Outcome>> = BTreeMap::new();
        for outcome in outcomes {
            by_policy.entry(outcome.policy.clone()).or_default().push(outcome);
        }
        let policies = by_policy.into_iter().map(|(policy, outcomes)| (policy, Rates::of(&outcomes))).collect();
        Self { predicted, policies }
    }

    /// A table for the terminal, in percent as in the paper.
    pub fn text(&self) -> String {
        let mut text = format!("{:<12} {:>7} {:>7} {:>7} {:>7}\n", "policy", "PUR %", "NDR %", "SR %", "grasps");
        for (policy, r) in &self.policies {
            let [pur, ndr, sr] = [r.pur, r.ndr, r.sr].map(|share| share * 100.0);
            let policy = one_line(policy);
            text += &format!("{policy:<12} {pur:>7.2} {ndr:>7.2} {sr:>7.2} {:>7}\n", r.count);
        }
        if self.predicted { text + "predicted from true properties, not seen on a robot" } else { text }
    }
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
