//! A subject as one view shows it: a segment, a part, or the whole object, with its picture.

use crate::query::question::Question;
use crate::query::question::sheet::Sheet;
use crate::query::recorded::sha256::Sha256Hex;
use crate::query::recorded::{Mask, QuestionId};
use crate::scene::Photo;

/// A subject as one view shows it, and the picture that is sent for it.
#[derive(Debug, Clone, PartialEq)]
pub struct ShownSubject {
    pub view: String,
    /// In the view's label map.
    pub id: u16,
    pub photo_sha256: Sha256Hex,
    pub mask: Mask,
    /// Of the photo inside the mask, on average.
    pub color: [u8; 3],
    /// The numbers of the regions on the sheet, in order; none unless it shows the whole object with its regions.
    pub regions: Vec<u16>,
    /// Hash of the sheet's pixels before JPEG.
    pub sheet_sha256: Sha256Hex,
    /// Width and height of the sheet.
    pub sheet_size: (u32, u32),
    /// The sheet as JPEG.
    pub jpeg: Vec<u8>,
}

impl ShownSubject {
    /// The subject that `mask` marks in the `photo` of this view, on its sheet.
    pub fn new(view: &str, id: u16, photo: &Photo, mask: Mask, sheet: &Sheet) -> Self {
        let photo_sha256 = Sha256Hex::of_picture(photo.rgb.dimensions(), photo.rgb.as_raw());
        Self::in_hashed(view, id, photo, photo_sha256, mask, sheet)
    }

    /// As [`Self::new`], for several subjects of a photo that is hashed once.
    pub fn in_hashed(view: &str, id: u16, photo: &Photo, photo_sha256: Sha256Hex, mask: Mask, sheet: &Sheet) -> Self {
        Self {
            view: view.to_owned(),
            id,
            photo_sha256,
            color: mask.mean_color(&photo.rgb),
            mask,
            regions: Vec::new(),
            sheet_sha256: sheet.pixels_sha256(),
            sheet_size: sheet.picture.dimensions(),
            jpeg: sheet.jpeg(),
        }
    }

    /// The identity of `question` when asked about this subject.
    pub fn asked(&self, question: &Question) -> QuestionId {
        QuestionId {
            view: self.view.clone(),
            photo_sha256: self.photo_sha256.clone(),
            mask: self.mask.clone(),
            prompt_sha256: question.prompt_sha256.clone(),
            schema_sha256: question.schema.sha256().clone(),
            sheet_sha256: self.sheet_sha256.clone(),
        }
    }
}
