//! The pictures that several stages draw: a photo's segments and materials, and the field as a camera sees it.
//!
//! [`palette`] and [`field_colors`] give parts, materials and Gaussians their colours, [`framing`] chooses the view and
//! crops it to the object, [`strokes`] draws on pictures, [`panels`] puts them side by side; [`figure`] shows the
//! field, [`property`] one property of it, [`segmented`] SAM's segments and the answers before the vote,
//! [`material_map`] the answers for one photo, [`thumbnail`] a scene at a glance, [`turntable`] the object from all
//! sides.

pub mod field_colors;
pub mod figure;
pub mod framing;
mod legends;
pub mod material_map;
pub mod palette;
pub(crate) mod panels;
pub mod plots;
pub mod property;
pub mod segmented;
pub(crate) mod strokes;
pub mod thumbnail;
pub mod turntable;

use std::collections::BTreeMap;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ImageResult, Rgb, RgbImage};

use crate::scene::Photo;
use crate::segment::LabelMap;

/// JPEG quality at which edges of segments still look sharp.
const QUALITY: u8 = 85;
/// Share of a segment's colour over the photo.
const TINT: f32 = 0.6;

/// The photo with every segment in the colour that `color` gives it.
pub fn tinted(photo: &Photo, map: &LabelMap, color: impl Fn(u16) -> [f32; 3]) -> RgbImage {
    let mut picture = photo.rgb.clone();
    for (pixel, &label) in picture.pixels_mut().zip(&map.labels) {
        if label > 0 {
            *pixel = mix(*pixel, color(label));
        }
    }
    picture
}

/// For every segment of `map`, the label of the Gaussians that most of its pixels show. `labels` are those of the
/// pixels, row by row.
pub fn labels_of_segments(map: &LabelMap, labels: &[Option<u32>]) -> BTreeMap<u16, u32> {
    let mut counts: BTreeMap<(u16, u32), usize> = BTreeMap::new();
    for (&segment, label) in map.labels.iter().zip(labels) {
        if let (1.., Some(label)) = (segment, label) {
            *counts.entry((segment, *label)).or_default() += 1;
        }
    }
    let mut found: BTreeMap<u16, (usize, u32)> = BTreeMap::new();
    for ((segment, label), count) in counts {
        let best = found.entry(segment).or_insert((count, label));
        if count > best.0 {
            *best = (count, label);
        }
    }
    found.into_iter().map(|(segment, (_, label))| (segment, label)).collect()
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

/// A picture as PNG.
///
/// # Errors
/// If the picture cannot be encoded.
pub fn png(picture: &RgbImage) -> ImageResult<Vec<u8>> {
    let mut bytes = Vec::new();
    picture.write_with_encoder(PngEncoder::new(&mut bytes))?;
    Ok(bytes)
}
