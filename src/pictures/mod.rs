//! The pictures that several stages draw: a photo's segments and materials, and the field as a camera sees it.
//!
//! [`palette`] and [`field_colors`] give parts, materials and Gaussians their colours, [`panels`] puts pictures side by
//! side; [`figure`] shows the field, [`material_map`] the answers for one photo, [`thumbnail`] a scene at a glance.

pub mod field_colors;
pub mod figure;
pub mod material_map;
pub mod palette;
mod panels;
pub mod thumbnail;

use image::codecs::jpeg::JpegEncoder;
use image::{ImageResult, Rgb, RgbImage};

use crate::scene::Photo;
use crate::segment::LabelMap;

/// JPEG quality at which edges of segments still look sharp.
const QUALITY: u8 = 85;
/// Share of a segment's colour over the photo.
const TINT: f32 = 0.6;

/// The photo with every segment in a different colour.
pub fn tinted(photo: &Photo, map: &LabelMap) -> RgbImage {
    let mut picture = photo.rgb.clone();
    for (pixel, &label) in picture.pixels_mut().zip(&map.labels) {
        if label > 0 {
            *pixel = mix(*pixel, palette::color(u32::from(label) - 1));
        }
    }
    picture
}

fn mix(Rgb(under): Rgb<u8>, over: [f32; 3]) -> Rgb<u8> {
    Rgb(std::array::from_fn(|c| (f32::from(under[c]) * (1.0 - TINT) + 255.0 * over[c] * TINT).round() as u8))
}

/// A picture as JPEG, shrunk if its longest side is longer than `longest_side` pixels.
///
/// # Errors
/// If the picture cannot be encoded.
pub fn jpeg(picture: &RgbImage, longest_side: u32) -> ImageResult<Vec<u8>> {
    let longest = picture.width().max(picture.height());
    let fitted = (longest > longest_side).then(|| {
        let side = |length: u32| (length * longest_side / longest).max(1);
        image::imageops::thumbnail(picture, side(picture.width()), side(picture.height()))
    });
    let mut bytes = Vec::new();
    fitted.as_ref().unwrap_or(picture).write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, QUALITY))?;
    Ok(bytes)
}
