//! Which way up a mask lies that has no EXIF orientation, beside a photo that has one: like the photo as it is stored, or like
//! the photo turned upright.

use std::path::Path;

use image::metadata::Orientation;

use super::{Upright, header, same_shape, swaps_sides};
use crate::scene::SceneError;

/// Which ways a mask can lie beside its photo, by its shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fits {
    /// Only as it is: it has the photo's orientation, or the photo has none, or only this way it has the photo's shape.
    AsIs,
    /// Only turned as the photo is.
    Turned,
    Both,
}

/// How a mask lies beside its photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Lying {
    pub fits: Fits,
    /// What makes a mask that lies the other way lie like the photo.
    pub turn: Orientation,
}

impl Lying {
    pub const LIKE_THE_PHOTO: Self = Self { fits: Fits::AsIs, turn: Orientation::NoTransforms };

    /// Compares the headers of a photo and its mask; `size` is that of the photo as it is used.
    pub fn of(photo: Orientation, upright: Upright, mask: &Path, size: (u32, u32)) -> Result<Self, SceneError> {
        if photo == Orientation::NoTransforms {
            return Ok(Self::LIKE_THE_PHOTO);
        }
        let of_mask = header(mask)?;
        if of_mask.is_turned() {
            return Ok(Self::LIKE_THE_PHOTO);
        }
        // Beside a photo that is used turned, a mask may lie like the photo as it is stored, and the other way round.
        let turn = match upright {
            Upright::Turned => photo,
            Upright::AsStored => inverse(photo),
        };
        let stored = of_mask.size(Upright::AsStored);
        let turned = if swaps_sides(turn) { (stored.1, stored.0) } else { stored };
        let fits = match (same_shape(stored, size), same_shape(turned, size)) {
            (true, true) => Fits::Both,
            (false, true) => Fits::Turned,
            _ => Fits::AsIs,
        };
        Ok(Self { fits, turn })
    }

    /// The orientation as far as the shape tells.
    pub fn by_shape(&self) -> Orientation {
        if self.fits == Fits::Turned { self.turn } else { Orientation::NoTransforms }
    }
}

/// What undoes an orientation: all but the quarter turns undo themselves.
fn inverse(orientation: Orientation) -> Orientation {
    match orientation {
        Orientation::Rotate90 => Orientation::Rotate270,
        Orientation::Rotate270 => Orientation::Rotate90,
        other => other,
    }
}
