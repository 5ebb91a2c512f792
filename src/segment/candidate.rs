//! A mask that SAM returns for a prompt.

use super::Level;
use super::mask::{Mask, Rect};

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
    /// The prompt, pixels of the picture.
    pub point: [f64; 2],
    /// The crop it was found in.
    pub crop: Rect,
}
