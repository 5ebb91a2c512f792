//! A scene at a glance, small enough for a list of thousands: its photo and its materials, cropped to the object.

use image::imageops::{crop_imm, thumbnail};
use image::{DynamicImage, GenericImage, ImageResult, Rgb, RgbImage};

use crate::camera::{Camera, Intrinsics};
use crate::query::sheet::panel::{Area, bounding_box};
use crate::render::{Colors, RenderOptions, render};
use crate::scene::Photo;
use crate::scene::gaussians::Gaussians;
use crate::vote::MaterialField;

use super::{field_colors, jpeg};

/// Height and half the width of the picture, in pixels.
pub const SIDE: u32 = 96;
const PAPER: Rgb<u8> = Rgb([255; 3]);

/// The photo taken by `camera` beside the Gaussians in the colours of their materials, as JPEG.
///
/// # Errors
/// If the picture cannot be encoded.
pub fn draw(camera: &Camera, photo: &Photo, gaussians: &Gaussians, field: &MaterialField) -> ImageResult<Vec<u8>> {
    let (width, height) = photo.rgb.dimensions();
    let whole = Area { x0: 0, y0: 0, x1: width, y1: height };
    let area = bounding_box(&photo.foreground).map_or(whole, |object| object.with_margin(width, height));
    let longest = area.width().max(area.height());
    let fitted = |length: u32| (length * SIDE / longest).max(1);
    let (width, height) = (fitted(area.width()), fitted(area.height()));

    let cut = crop_imm(&photo.rgb, area.x0, area.y0, area.width(), area.height()).to_image();
    let seen = Intrinsics {
        width: area.width(),
        height: area.height(),
        cx: camera.intrinsics.cx - f64::from(area.x0),
        cy: camera.intrinsics.cy - f64::from(area.y0),
        ..camera.intrinsics
    };
    let small = Camera { intrinsics: seen.resized(width, height), ..camera.clone() };
    let colors = field_colors::material_colors(field);
    let options = RenderOptions { colors: Colors::Fixed(&colors), ..RenderOptions::default() };
    let materials = DynamicImage::ImageRgba8(render(gaussians, &small, &options).to_image([1.0; 3])).into_rgb8();

    let mut sheet = RgbImage::from_pixel(2 * SIDE, SIDE, PAPER);
    let (left, top) = ((SIDE - width) / 2, (SIDE - height) / 2);
    sheet.copy_from(&thumbnail(&cut, width, height), left, top)?;
    sheet.copy_from(&materials, SIDE + left, top)?;
    jpeg(&sheet, 2 * SIDE)
}
