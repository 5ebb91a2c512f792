//! A mask: a picture beside a photo that tells where the object is.

use std::path::{Path, PathBuf};

use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgb, RgbImage};

use super::mask_color::MaskColor;
use super::mask_lying::Lying;
use super::{Limit, Upright, alpha_of, decode, is_white, open, same_shape};
use crate::scene::SceneError;

/// A mask file, and how it is read.
#[derive(Debug, Clone, PartialEq)]
pub struct Mask {
    pub path: PathBuf,
    pub color: MaskColor,
    /// How it has to be turned, after any EXIF orientation of its own, to lie like its photo.
    pub orientation: Orientation,
    pub(super) lying: Lying,
}

impl Mask {
    /// The usual kind: white on the object, and lying like its photo.
    pub fn new(path: PathBuf) -> Self {
        Self { path, color: MaskColor::default(), orientation: Orientation::NoTransforms, lying: Lying::LIKE_THE_PHOTO }
    }

    /// The share of each pixel that the object covers, 0 to 255; resized to the photo if necessary.
    ///
    /// # Errors
    /// As for a photo, and if the mask is not a picture of this shape, for instance because it lies on its side, or if its
    /// values are 0 and 1 although white is expected: all of them would count as black.
    pub(super) fn coverage(&self, upright: Upright, limit: Limit, photo: (u32, u32)) -> Result<GrayImage, SceneError> {
        let mut stored = Stored::read(&self.path, upright, limit)?;
        stored.turn(self.orientation);
        let found = stored.colors.dimensions();
        if !same_shape(found, photo) {
            return Err(SceneError::MaskShape { path: self.path.clone(), photo, found });
        }
        if matches!(self.color, MaskColor::White) && stored.colors.as_raw().iter().max() == Some(&1) {
            return Err(SceneError::MaskOfOnes { path: self.path.clone() });
        }
        let share = |pixel: &Rgb<u8>| self.color.share(pixel.0, stored.is_lossy);
        let (width, height) = found;
        let mask = GrayImage::from_fn(width, height, |x, y| Luma([share(stored.colors.get_pixel(x, y))]));
        Ok(if found == photo {
            mask
        } else {
            image::imageops::resize(&mask, photo.0, photo.1, image::imageops::FilterType::Triangle)
        })
    }
}

/// A decoded mask, before it is known which of its values are the object's.
#[derive(Debug, Clone)]
pub(super) struct Stored {
    /// Its alpha as greys, if it has one that is not opaque everywhere, else its colours. The values of a mask of 16 bits with
    /// none above 255 are kept, since they are the numbers of objects; other masks of 16 bits are scaled.
    pub colors: RgbImage,
    pub is_lossy: bool,
}

impl Stored {
    pub fn read(path: &Path, upright: Upright, limit: Limit) -> Result<Self, SceneError> {
        let is_lossy = matches!(open(path)?.format(), Some(ImageFormat::Jpeg | ImageFormat::WebP));
        let picture = decode(path, upright, limit)?;
        let alpha = picture.color().has_alpha().then(|| alpha_of(&picture.to_rgba8())).filter(|alpha| !is_white(alpha));
        let of_ids = || {
            let deep = picture.as_luma16().filter(|deep| deep.as_raw().iter().all(|value| *value < 256))?;
            let bytes = deep.as_raw().iter().map(|value| *value as u8).collect();
            GrayImage::from_raw(deep.width(), deep.height(), bytes)
        };
        let grey = alpha.or_else(of_ids);
        let colors = grey.map_or_else(|| picture.to_rgb8(), |grey| DynamicImage::from(grey).into_rgb8());
        Ok(Self { colors, is_lossy })
    }

    pub fn turn(&mut self, orientation: Orientation) {
        if orientation != Orientation::NoTransforms {
            let mut picture = DynamicImage::from(std::mem::take(&mut self.colors));
            picture.apply_orientation(orientation);
            self.colors = picture.into_rgb8();
        }
    }
}
