//! Compares masses with the true ones. The `mid` of gprop's estimate is scored, the number that people are shown.
//!
//! NeRF2Physics' JSON files are read without conversion and as its evaluation reads them: predictions `{"ID_MORE": [low,
//! high], ...}`, of which the mean is scored; truth `{"ID": kilograms, ...}`, whose key is the part of an id before its
//! first underscore.

mod causes;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use causes::TruePart;
pub use causes::{Causes, ComparedPart};

use super::EvaluateError;
use super::scores::{Pair, Scores};
use crate::files;
use crate::files::json;
use crate::numeric::median;
use crate::parts::Parts;
use crate::units::{Estimate, Range};

/// One object, predicted and true, in kilograms.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Weighed {
    pub id: String,
    /// `mid` is scored.
    pub predicted: Estimate,
    pub truth: f64,
    /// True if the interval contains the truth.
    pub covered: bool,
    /// The causes of the error, if the ground truth says where the parts are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub causes: Option<Causes>,
    /// The true parts, if the ground truth says where they are.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub true_parts: Vec<ComparedPart>,
    /// If the ground truth gives centre of mass and inertia.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub balance: Option<Balance>,
    /// Only if a scene's ground truth gives them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<WeighedPart>,
}

/// How far centre of mass and inertia are off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Balance {
    /// Distance of the centres of mass, as a share of the object's longest side.
    pub center_error: f64,
    /// The largest relative error of the three principal moments of inertia.
    pub inertia_error: f64,
}

/// A part as gprop found it, and the true part of the same name, if any.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WeighedPart {
    pub name: String,
    /// `None`, like the mass, if it has none.
    pub volume_m3: Option<Estimate>,
    pub mass_kg: Option<Estimate>,
    pub true_volume_m3: Option<f64>,
    pub true_mass_kg: Option<f64>,
}

/// All objects with their scores.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MassEvaluation {
    #[serde(flatten)]
    pub scores: Scores,
    /// Share of the objects whose interval contains the truth.
    pub coverage: f64,
    /// Median of high / low over the objects whose low end is above 0; `None` if there is no such object.
    pub median_width: Option<f64>,
    pub objects: Vec<Weighed>,
    /// What a model says of the same objects without gprop, if that was to be compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direct: Option<Box<MassEvaluation>>,
    /// Scenes of the data set whose weight is known, but which have no mass yet.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// Scenes of the data set whose weight is known, but which failed when a batch last ran them: what an earlier run found is
    /// not scored.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub failed: Vec<String>,
}

/// A prediction as numpy reads a row of two: a single number stands for both.
#[derive(Deserialize)]
#[serde(untagged)]
enum Prediction {
    Range(Range),
    Number(f64),
}

/// `ground_truth/parts.json` of a scene.
#[derive(Deserialize)]
struct SceneTruth {
    total_mass_kg: f64,
    parts: Vec<StatedPart>,
    #[serde(default)]
    bounding_box_m: Option<[[f64; 3]; 2]>,
    #[serde(default)]
    center_of_mass_m: Option<[f64; 3]>,
    #[serde(default)]
    inertia_at_com_kg_m2: Option<[[f64; 3]; 3]>,
}

/// A part of `ground_truth/parts.json`; unknown values are null.
#[derive(Deserialize)]
struct StatedPart {
    id: Option<u8>,
    name: String,
    volume_m3: Option<f64>,
    mass_kg: Option<f64>,
    #[serde(default)]
    form: String,
    thickness_m: Option<f64>,
    bounding_box_m: Option<[[f64; 3]; 2]>,
    visible: Option<bool>,
}

impl StatedPart {
    fn known(&self) -> Option<TruePart> {
        Some(TruePart {
            id: self.id,
            name: self.name.clone(),
            volume_m3: self.volume_m3?,
            mass_kg: self.mass_kg?,
            form: self.form.clone(),
            thickness_m: self.thickness_m,
            bounding_box_m: self.bounding_box_m,
            is_hidden: self.visible == Some(false),
        })
    }
}

/// Every object of a file of predictions with its truth.
pub fn from_json(predictions: &Path, truth: &Path) -> Result<Vec<Weighed>, EvaluateError> {
    let predicted: serde_json::Map<String, serde_json::Value> = read_json(predictions, "predictions by id", "")?;
    let truths: BTreeMap<String, f64> = read_json(truth, "kilograms by id", "")?;
    let mut objects = Vec::with_capacity(predicted.len());
    for (id, value) in predicted {
        let expected = "[low, high] in kilograms for every id";
        let path = predictions.to_owned();
        let range = match serde_json::from_value(value) {
            Ok(Prediction::Range(range)) => range,
            Ok(Prediction::Number(value)) => Range::exactly(value),
            Err(source) => return Err(EvaluateError::Json { path, expected, source }),
        };
        let Range { low, high } = range;
        if low > high {
            return Err(EvaluateError::Reversed { path, id, low, high });
        }
        let key = id.split('_').next().unwrap_or_default();
        let truth = truths.get(key).ok_or_else(|| EvaluateError::NoTruth { id: id.clone(), key: key.to_owned() })?;
        objects.push(weighed(id, Estimate::new(range.low, range.mid(), range.high), *truth, Vec::new()));
    }
    Ok(objects)
}

/// The object of a scene folder: `parts` is the `parts.json` that the parts stage wrote; `shown` is, by found part, the
/// `id` of the true part that it mostly shows, as far as that is known.
pub fn from_scene(id: &str, parts: &Path, truth: &Path, shown: &BTreeMap<u32, u8>) -> Result<Weighed, EvaluateError> {
    let measured = measured(parts)?;
    let truth: SceneTruth =
        read_json(truth, "true parts", "; for a scene without them, give --predictions and --truth")?;
    let part = |part: &crate::parts::Part| {
        let known = truth.parts.iter().find(|known| known.name == part.caption);
        WeighedPart {
            name: part.caption.clone(),
            volume_m3: part.volume_m3,
            mass_kg: part.mass_kg,
            true_volume_m3: known.and_then(|known| known.volume_m3),
            true_mass_kg: known.and_then(|known| known.mass_kg),
        }
    };
    let parts = measured.parts.iter().map(part).collect();
    let known: Option<Vec<TruePart>> = truth.parts.iter().map(StatedPart::known).collect();
    let (causes, true_parts) = known.and_then(|known| causes::compare(&known, shown, &measured)).unzip();
    let balance = balance(&truth, &measured);
    let true_parts = true_parts.unwrap_or_default();
    let weighed = weighed(id.to_owned(), measured.object.mass_kg, truth.total_mass_kg, parts);
    Ok(Weighed { causes, true_parts, balance, ..weighed })
}

fn balance(truth: &SceneTruth, measured: &Parts) -> Option<Balance> {
    let [low, high] = truth.bounding_box_m?;
    let longest = (0..3).map(|a| high[a] - low[a]).fold(0.0, f64::max);
    let found = &measured.object;
    let off = Vector3::from(found.center_of_mass_m) - Vector3::from(truth.center_of_mass_m?);
    let principal = |inertia: [[f64; 3]; 3]| {
        let matrix = Matrix3::from_fn(|r, c| inertia[r][c]);
        let mut moments: [f64; 3] = matrix.symmetric_eigenvalues().into();
        moments.sort_by(f64::total_cmp);
        moments
    };
    let (found, truth) = (principal(found.inertia_kg_m2), principal(truth.inertia_at_com_kg_m2?));
    let errors = found.iter().zip(truth).map(|(found, truth)| (found / truth - 1.0).abs());
    Some(Balance { center_error: off.norm() / longest, inertia_error: errors.fold(0.0, f64::max) })
}

/// The object of a data set that states its weight.
pub fn from_weight(id: &str, parts: &Path, weight_kg: f64) -> Result<Weighed, EvaluateError> {
    Ok(weighed(id.to_owned(), measured(parts)?.object.mass_kg, weight_kg, Vec::new()))
}

/// The same object with another prediction of its mass.
pub fn guessed(object: &Weighed, mass_kg: Estimate) -> Weighed {
    weighed(object.id.clone(), mass_kg, object.truth, Vec::new())
}

/// A line of a table of weights.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WeightLine {
    name: String,
    mass_kg: f64,
}

/// Kilograms by name: a CSV with the columns name and mass_kg.
///
/// # Errors
/// If the file cannot be read, or a line is not of this form.
pub fn read_weights(path: &Path) -> Result<BTreeMap<String, f64>, EvaluateError> {
    let remedy = "; give a CSV with the columns name,mass_kg";
    let text = files::read_to_string(path);
    let text = text.map_err(|source| EvaluateError::Read { path: path.to_owned(), source, remedy })?;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let row = |(line, row): (u64, Result<WeightLine, csv::Error>)| {
        let message = |error: csv::Error| format!("{error}; the columns are name,mass_kg");
        row.map(|WeightLine { name, mass_kg }| (name, mass_kg)).map_err(|error| EvaluateError::Row {
            path: path.to_owned(),
            line,
            message: message(error),
        })
    };
    // The first line has the names of the columns.
    (2..).zip(reader.deserialize()).map(row).collect()
}

fn measured(parts: &Path) -> Result<Parts, EvaluateError> {
    read_json(parts, "parts in kilograms", "; run `gprop run` on the scene first")
}

fn weighed(id: String, predicted: Estimate, truth: f64, parts: Vec<WeighedPart>) -> Weighed {
    let covered = predicted.low <= truth && truth <= predicted.high;
    Weighed { id, predicted, truth, covered, causes: None, true_parts: Vec::new(), balance: None, parts }
}

/// Scores all objects.
pub fn evaluate(objects: Vec<Weighed>) -> Result<MassEvaluation, EvaluateError> {
    let mut pairs = Vec::with_capacity(objects.len());
    for object in &objects {
        let pair = Pair { predicted: object.predicted.mid, truth: object.truth };
        for (what, value) in [("the prediction", pair.predicted), ("the truth", pair.truth)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(EvaluateError::NotPositive { what, id: object.id.clone(), value });
            }
        }
        pairs.push(pair);
    }
    let scores = Scores::of(&pairs).ok_or(EvaluateError::Nothing("the predictions are empty"))?;
    let covered = objects.iter().filter(|object| object.covered).count();
    let coverage = covered as f64 / objects.len() as f64;
    let bounded = objects.iter().map(|object| object.predicted).filter(|mass| mass.low > 0.0);
    let median_width = median(bounded.map(|mass| mass.high / mass.low).collect());
    Ok(MassEvaluation {
        scores,
        coverage,
        median_width,
        objects,
        direct: None,
        missing: Vec::new(),
        failed: Vec::new(),
    })
}

fn read_json<T: DeserializeOwned>(
    path: &Path,
    expected: &'static str,
    remedy: &'static str,
) -> Result<T, EvaluateError> {
    let text = files::read_to_string(path);
    let text = text.map_err(|source| EvaluateError::Read { path: path.to_owned(), source, remedy })?;
    json::read(text.as_bytes()).map_err(|source| EvaluateError::Json { path: path.to_owned(), expected, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_unknown_mass_has_no_causes() {
        let stated = |mass: &str| format!(r#"{{ "name": "head", "volume_m3": 1e-4, "mass_kg": {mass} }}"#);
        let read = |mass: &str| serde_json::from_str::<StatedPart>(&stated(mass)).unwrap().known();
        assert!(read("null").is_none());
        assert_eq!(read("0.4").unwrap().mass_kg, 0.4);
    }
}
