//! Compares hardness at points with a durometer's readings: the protocol of GaussianProperty's supplement (C.1).
//!
//! A point is a pixel of a view with a reading on Shore A or D. Both scales are put on one axis, A from 0 to 100 and D
//! from 100 to 200. Only the scores, and the colours of `gprop show --what hardness`, use this axis, because the scales
//! are not comparable as numbers.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::EvaluateError;
use super::scores::{Pair, Scores};
use crate::camera::Camera;
use crate::files;
use crate::gaussians::Gaussians;
use crate::render::{RenderOptions, render_labels};
use crate::units::{ShoreHardness, ShoreScale};
use crate::vote::MaterialField;

/// A row of the file of readings.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Reading {
    /// The scene's folder, relative to the file's.
    pub scene: PathBuf,
    pub view: String,
    /// Pixels from the photo's upper left corner.
    pub x: f64,
    pub y: f64,
    pub shore: ShoreScale,
    /// Above 0, up to 100, on its scale.
    pub hardness: f64,
}

/// A reading with the field's value at the same point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    #[serde(flatten)]
    pub reading: Reading,
    pub predicted: Result<ShoreHardness, Missing>,
}

/// Why the field has no value at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Missing {
    /// The view does not show the object there.
    OffTheObject,
    /// The material there has no Shore hardness.
    NoHardness,
}

/// All points with their scores.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HardnessEvaluation {
    #[serde(flatten)]
    pub scores: Scores,
    /// Number of points at which the field has no value; they are not in the scores.
    pub missing: usize,
    pub points: Vec<Measured>,
}

/// The readings of a CSV file with the columns `scene,view,x,y,shore,hardness`, each with its line; at least one.
pub fn read_points(path: &Path) -> Result<Vec<(u64, Reading)>, EvaluateError> {
    let unreadable = |source| EvaluateError::Read { path: path.to_owned(), source, remedy: "" };
    let text = files::read(path).map_err(unreadable)?;
    let error = |error: csv::Error| {
        let (line, problem) = files::table_problem(&text, &error);
        EvaluateError::Row { path: path.to_owned(), line, message: format!("{problem}; columns: {COLUMNS}") }
    };
    let mut reader = files::table(&text);
    let headers = reader.headers().map_err(error)?.clone();
    let mut readings = Vec::new();
    for row in reader.records() {
        let row = row.map_err(error)?;
        let line = row.position().map_or(1, |position| files::line_at(&text, position));
        let reading: Reading = row.deserialize(Some(&headers)).map_err(error)?;
        if !(reading.hardness > 0.0 && reading.hardness <= 100.0) {
            let message = format!("hardness is {}: Shore scales run from above 0 to 100", reading.hardness);
            return Err(EvaluateError::Row { path: path.to_owned(), line, message });
        }
        readings.push((line, reading));
    }
    if readings.is_empty() {
        return Err(EvaluateError::NoRows { path: path.to_owned(), columns: COLUMNS });
    }
    Ok(readings)
}

const COLUMNS: &str = "scene,view,x,y,shore,hardness";

/// The field's values at positions (pixels) of one view.
pub fn field_at(
    gaussians: &Gaussians,
    field: &MaterialField,
    camera: &Camera,
    places: &[(f64, f64)],
) -> Vec<Result<ShoreHardness, Missing>> {
    let drawn = render_labels(gaussians, camera, &field.part_index, &RenderOptions::default());
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let predicted_at = |&(x, y): &(f64, f64)| {
        let on_picture = (0.0..f64::from(width)).contains(&x) && (0.0..f64::from(height)).contains(&y);
        let pixel = on_picture.then(|| y as usize * width as usize + x as usize);
        let label = pixel.and_then(|pixel| drawn[pixel]).ok_or(Missing::OffTheObject)?;
        field.parts[label as usize].hardness.ok_or(Missing::NoHardness)
    };
    places.iter().map(predicted_at).collect()
}

/// Scores all points at which the field has a value: the middle of its range against the reading.
pub fn evaluate(points: Vec<Measured>) -> Result<HardnessEvaluation, EvaluateError> {
    let pair = |point: &Measured| {
        let predicted = point.predicted.ok()?;
        let truth = on_joint_axis(point.reading.shore, point.reading.hardness);
        Some(Pair { predicted: on_joint_axis(predicted.scale, predicted.range.mid()), truth })
    };
    let pairs: Vec<Pair> = points.iter().filter_map(pair).collect();
    let scores = Scores::of(&pairs).ok_or(EvaluateError::Nothing("the field has no hardness at any point"))?;
    Ok(HardnessEvaluation { scores, missing: points.len() - pairs.len(), points })
}

/// Shore A from 0 to 100, Shore D from 100 to 200.
fn on_joint_axis(scale: ShoreScale, hardness: f64) -> f64 {
    match scale {
        ShoreScale::A => hardness,
        ShoreScale::D => 100.0 + hardness,
    }
}
