//! Parts of every chosen view: SAM's automatic masks, one level of them, painted into a label map.

use serde::{Deserialize, Serialize};

/// The part of every pixel of one view: 0 background, parts from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelMap {
    pub width: u32,
    pub height: u32,
    /// Row by row from the upper left corner.
    pub labels: Vec<u16>,
}

/// One part of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartMask {
    /// Its value in the label map.
    pub id: u16,
    /// Pixels it kept in the label map.
    pub area: u32,
    /// x, y, width, height in pixels.
    pub bbox: [u32; 4],
    pub predicted_iou: f32,
    pub stability_score: f32,
    pub level: Level,
}

/// Which of SAM's three nested masks of a prompt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    Small,
    /// The paper's choice: parts, neither details nor the whole.
    #[default]
    Middle,
    Large,
}

/// The parts of one view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewSegments {
    /// Name of the view.
    pub view: String,
    pub map: LabelMap,
    /// By rising id.
    pub parts: Vec<PartMask>,
}

/// The parts of all chosen views, in the order of the views.
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    pub views: Vec<ViewSegments>,
}
