//! The subject of one question: a segment or part of a view, or the whole object in it, with its picture.

use crate::query::question::Question;
use crate::query::recorded::sha256::Sha256Hex;
use crate::query::recorded::{Asked, Mask};

/// A segment and the picture that is sent for it.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentQuery {
    pub view: String,
    pub segment: u16,
    pub photo_sha256: Sha256Hex,
    pub mask: Mask,
    /// Hash of the sheet's pixels before JPEG.
    pub sheet_sha256: Sha256Hex,
    /// Width and height of the sheet.
    pub sheet_size: (u32, u32),
    /// The sheet as JPEG.
    pub jpeg: Vec<u8>,
}

impl SegmentQuery {
    /// The identity of `question` when asked about this segment.
    pub fn asked(&self, question: &Question) -> Asked {
        Asked {
            view: self.view.clone(),
            photo_sha256: self.photo_sha256.clone(),
            mask: self.mask.clone(),
            prompt_sha256: question.prompt_sha256.clone(),
            schema_sha256: question.schema.sha256().clone(),
            sheet_sha256: self.sheet_sha256.clone(),
        }
    }
}
