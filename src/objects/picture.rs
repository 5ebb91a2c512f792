//! A photo with the outlines and numbers of the objects.

use image::RgbImage;
use nalgebra::Point2;

use crate::error::Result;
use crate::pictures::framing::middles;
use crate::pictures::{jpeg, palette, strokes};
use crate::report::PictureError;
use crate::scene::{StandingObjects, View};

/// Longest side of the picture, in pixels.
const LONGEST_SIDE: u32 = 1600;
/// Width of an outline and radius of a number's disc, as shares of the photo's longest side.
const OUTLINE: f64 = 0.003;
const DISC: f64 = 0.018;

/// The photo of a view, as JPEG.
///
/// # Errors
/// If the photo cannot be read.
pub fn draw(found: &StandingObjects, view: &View) -> Result<Vec<u8>> {
    let mut picture = view.photo().map_err(PictureError::Photo)?.rgb;
    let labels = found.shown(&view.camera);
    let (width, longest) = (picture.width() as usize, f64::from(picture.width().max(picture.height())));
    outline(&mut picture, &labels, (OUTLINE * longest).round().max(1.0) as usize);
    for (number, middle) in (0..).zip(middles(&labels, width, found.count + 1)).skip(1) {
        let Some((x, y)) = middle else { continue };
        let at = Point2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        strokes::numbered(&mut picture, at, DISC * longest, palette::bytes(palette::part(number)), number);
    }
    Ok(jpeg(&picture, LONGEST_SIDE).map_err(PictureError::Encode)?)
}

/// Colours the pixels of each object from which another label is at most `reach` pixels away, to the right or below.
fn outline(picture: &mut RgbImage, labels: &[Option<u32>], reach: usize) {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let label_at = |x: usize, y: usize| labels[y.min(height - 1) * width + x.min(width - 1)];
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let (x, y) = (x as usize, y as usize);
        let here = label_at(x, y);
        let others = [label_at(x + reach, y), label_at(x, y + reach)];
        let border = others.iter().find(|other| **other != here);
        if let Some(number) = border.and_then(|border| here.or(*border)) {
            *pixel = palette::bytes(palette::part(number));
        }
    }
}
