//! Segments of every chosen view: SAM's automatic masks of all three levels as a tree, or those of one level, painted into a
//! label map.
//!
//! The modules, in the order in which the data pass through them:
//! 1. [`segmenter`]: crops the photo to the foreground and a margin around it;
//! 2. [`prompts`], [`adaptive`]: a grid of points, and the choice of those worth prompting;
//! 3. [`preprocess`], [`resize`]: the picture as SAM's encoder expects it;
//! 4. [`sam`] (the only user of `ort`): one embedding per picture, three nested masks per prompt;
//! 5. [`upsample`]: from logits to a mask at picture size and its stability;
//! 6. [`automatic`], [`nms`], [`regions`]: the good masks, without duplicates, small holes and islands;
//! 7. [`tree`]: masks of all levels, nested; or [`cull`], [`paint`]: the choice of masks of one level; and the label map;
//! 8. [`views`]: all of this for many views in parallel;
//! 9. [`formats`]: label maps in the formats of other programs, written and read.

mod adaptive;
pub mod automatic;
mod candidate;
pub mod cull;
mod error;
pub mod formats;
mod label_map;
pub mod mask;
pub mod nms;
mod observer;
mod options;
pub mod paint;
pub mod preprocess;
pub mod prompts;
pub mod regions;
pub mod resize;
pub mod sam;
mod segmenter;
pub mod tree;
pub mod upsample;
mod views;

use serde::{Deserialize, Serialize};

pub use candidate::Candidate;
pub use error::SegmentError;
pub use label_map::LabelMapError;
pub use observer::Observer;
pub use options::{DecoderRuntime, GeneratorOptions, Options, PointPrompts, SCENE_KEYS, SelectionOptions};
pub use segmenter::Segmenter;
pub use views::segment_views;

/// The segment of every pixel of one view: 0 background, segments from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelMap {
    pub width: u32,
    pub height: u32,
    /// Row by row from the upper left corner.
    pub labels: Vec<u16>,
}

/// One segment of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Its value in the label map.
    pub id: u16,
    /// Number of its pixels in the label map, with those of the segments that lie in it.
    pub area: u32,
    /// x, y, width, height in pixels, around the same pixels.
    pub bbox: [u32; 4],
    /// SAM's own estimate of the mask's IoU; 0 for the rest of the object, which SAM's masks do not cover.
    pub predicted_iou: f32,
    /// As [`upsample::ScoredMask::stability`]; 0 for the rest of the object, which SAM's masks do not cover.
    pub stability_score: f32,
    pub level: Level,
    /// The segment in which it lies, which has a lower id; 0 if it lies in none.
    #[serde(default, skip_serializing_if = "is_none")]
    pub parent: u16,
}

/// True for 0, the id that stands for no segment.
fn is_none(id: &u16) -> bool {
    *id == 0
}

impl Segment {
    /// True if this is not one of SAM's masks but the rest of the object, which they do not cover.
    pub fn is_rest(&self) -> bool {
        self.predicted_iou == 0.0 && self.stability_score == 0.0
    }
}

/// Which of SAM's three nested masks of a prompt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// The smallest mask: often only a detail of a part.
    Small,
    /// The paper's choice: neither details nor the whole object.
    #[default]
    Middle,
    /// The largest mask: often the whole object.
    Large,
}

/// The segments of one view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewSegments {
    /// Name of the view.
    pub view: String,
    /// The smallest segment that covers each pixel.
    pub map: LabelMap,
    /// By ascending id.
    pub segments: Vec<Segment>,
}

impl ViewSegments {
    /// The segment that `id` lies in; 0 if it lies in none, and for 0.
    pub fn parent(&self, id: u16) -> u16 {
        usize::from(id).checked_sub(1).map_or(0, |index| self.segments[index].parent)
    }

    /// A warning about the view for the user, if there is one.
    pub fn warning(&self) -> Option<String> {
        match self.segments.as_slice() {
            [] => Some(format!("view {} has no foreground and therefore no segments", self.view)),
            [only] if only.is_rest() => {
                Some(format!("SAM found no segments in view {}; using the whole object as one segment", self.view))
            }
            _ => None,
        }
    }
}

/// The segments of all chosen views, in the order of the views.
#[derive(Debug, Clone, PartialEq)]
pub struct Segmentation {
    pub views: Vec<ViewSegments>,
}
