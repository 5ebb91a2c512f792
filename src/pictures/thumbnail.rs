//! A scene at a glance, small enough for a list of thousands: its photo and its materials, cropped to the object.

use image::{GenericImage, ImageResult, Rgb, RgbImage};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::scene::Photo;
use crate::vote::MaterialField;

use super::framing::Framing;
use super::{field_colors, jpeg};

/// Height and half the width of the picture, in pixels.
pub const SIDE: u32 = 96;
const PAPER: Rgb<u8> = Rgb([255; 3]);

/// The photo taken by `camera` beside the Gaussians in the colours of their materials, as JPEG.
///
/// # Errors
/// If the picture cannot be encoded.
pub fn draw(camera: &Camera, photo: &Photo, gaussians: &Gaussians, field: &MaterialField) -> ImageResult<Vec<u8>> {
    let framing = Framing::new(camera, photo, SIDE, 0.0);
    let (width, height) = framing.size();
    let (left, top) = ((SIDE - width) / 2, (SIDE - height) / 2);
    let mut sheet = RgbImage::from_pixel(2 * SIDE, SIDE, PAPER);
    sheet.copy_from(&framing.photo(photo), left, top)?;
    sheet.copy_from(&framing.colored(gaussians, &field_colors::material_colors(field)), SIDE + left, top)?;
    jpeg(&sheet, 2 * SIDE)
}
