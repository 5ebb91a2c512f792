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
pub use segmenter::{Segmenter, Shown};
pub use views::segment_views;

/// The segment of every pixel of one view: 0 background, segments from 1.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
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

    /// The flat segments of one level for the picture at another size.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let map = self.map.resized(width, height);
        let scores: Vec<(f32, f32)> =
            self.segments.iter().map(|segment| (segment.predicted_iou, segment.stability_score)).collect();
        let level = self.segments.first().map_or_else(Level::default, |segment| segment.level);
        Self { view: self.view.clone(), segments: paint::segment_list(&map, &scores, level), map }
    }

    /// A warning about the view for the user, if there is one.
    pub fn warning(&self) -> Option<String> {
        match self.segments.as_slice() {
            [] => Some(format!("view {} has no foreground and therefore no segments", self.view)),
            [only] if only.is_rest() => Some(format!(
                "SAM found no segments in view {}; using the whole object as one segment, so this view separates no parts. \
                     If several views do this, try --level small, or check the photo and its mask with `gprop inspect`",
                self.view
            )),
            _ => None,
        }
    }
}

/// The segments of all chosen views, in the order of the views.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Segmentation {
    pub views: Vec<ViewSegments>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes and areas are those of the map, not scaled ones, which would grow by rounding.
    #[test]
    fn segments_at_another_size_fit_their_map_and_return_unchanged() {
        let labels = (0..100).map(|index| u16::from((3..6).contains(&(index % 10)) && (2..9).contains(&(index / 10))));
        let map = LabelMap { width: 10, height: 10, labels: labels.collect() };
        let segments = paint::segment_list(&map, &[(0.9, 0.8)], Level::Small);
        let small = ViewSegments { view: "view".into(), map, segments };
        let large = small.resized(35, 31);
        let on = |x: u32, y: u32| large.map.at(x, y) == 1;
        let columns: Vec<u32> = (0..35).filter(|&x| (0..31).any(|y| on(x, y))).collect();
        let rows: Vec<u32> = (0..31).filter(|&y| (0..35).any(|x| on(x, y))).collect();
        let [segment] = large.segments.as_slice() else { panic!("{:?}", large.segments) };
        assert_eq!(segment.bbox, [columns[0], rows[0], columns.len() as u32, rows.len() as u32]);
        assert_eq!(segment.area as usize, columns.len() * rows.len());
        assert_eq!(large.resized(10, 10), small);
    }
}
