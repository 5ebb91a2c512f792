//! A mask that SAM returns for a prompt.

use super::Level;
use super::mask::{Mask, Rect};

/// A mask with a smaller share of its area on the foreground belongs to the background.
const LEAST_SHARE_ON_FOREGROUND: f64 = 0.5;

/// The mask of one prompt at one level.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The mask at the picture's size.
    pub mask: Mask,
    /// Bounding box of the mask.
    pub bounds: Rect,
    pub predicted_iou: f32,
    pub stability: f32,
    pub level: Level,
    /// The crop it was found in, in pixels of the segmented region (not of the photo).
    pub crop: Rect,
}

impl Candidate {
    /// True if the mask belongs to the foreground, on which it has `area` pixels.
    pub fn is_on_foreground(&self, area: u64) -> bool {
        area as f64 >= LEAST_SHARE_ON_FOREGROUND * self.mask.area() as f64
    }
}
