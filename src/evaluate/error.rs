//! Why predictions could not be compared with the truth.

use std::path::PathBuf;

use crate::segment::LabelMapError;

/// An error in predictions or truth, with its place and the remedy.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    #[error("cannot read {path:?}{remedy}")]
    Read { path: PathBuf, source: std::io::Error, remedy: &'static str },
    #[error("{path:?} does not hold {expected}")]
    Json { path: PathBuf, expected: &'static str, source: serde_json::Error },
    #[error("{path:?} line {line}: {message}")]
    Row { path: PathBuf, line: u64, message: String },
    #[error("{path:?} has no rows; its columns are {columns}")]
    NoRows { path: PathBuf, columns: &'static str },
    #[error("{path:?}: the prediction for {id:?} is [{low}, {high}]; write the low end first")]
    Reversed { path: PathBuf, id: String, low: f64, high: f64 },
    #[error(
        "there is a prediction for {id:?}, but the truth has no {key:?}; an id is looked up by the text before its \
         first underscore"
    )]
    NoTruth { id: String, key: String },
    #[error("{what} of {id:?} is {value}: ratios and logarithms need numbers above 0")]
    NotPositive { what: &'static str, id: String, value: f64 },
    #[error("there is nothing to compare: {0}")]
    Nothing(&'static str),
    #[error("{path:?} holds no label maps: it needs one PNG per view, named like the view")]
    NoMaps { path: PathBuf },
    #[error("{path:?}: {source}")]
    Map { path: PathBuf, source: Box<LabelMapError> },
    #[error(
        "{path:?} has {} x {} pixels, view {view:?} has {} x {}: label the photo at its own size",
        map.0, map.1, picture.0, picture.1
    )]
    MapSize { path: PathBuf, map: (u32, u32), view: String, picture: (u32, u32) },
    #[error("{path:?} has no map of a view of {scene:?}; a map is named like its view, such as `{example}.png`")]
    NoView { path: PathBuf, scene: String, example: String },
    #[error("{path:?} proposes no place to grasp at; run `gprop grasp` on the scene, with a metric scale, to see why")]
    NoPlace { path: PathBuf },
    #[error("no view of {scene:?} with a map in {path:?} shows where the fingers press")]
    Unseen { scene: String, path: PathBuf },
    #[error("{path:?} names {name:?}, which is neither a label nor a material or family that has one{hint}")]
    Label { path: PathBuf, name: String, hint: String },
}
