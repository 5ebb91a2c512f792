//! The inspection as one self-contained page, with photo and splat side by side, the foreground outlined and up drawn as an
//! arrow. A box around the object can be dragged ([`outline`](super::outline)).

use image::{DynamicImage, GrayImage, Rgb, RgbImage};
use minijinja::value::Serde;
use minijinja::{Value, context};
use nalgebra::{Point3, Vector3};

use super::compare::as_the_splat_shows;
use super::outline::Outline;
use super::{Inspection, text};
use crate::camera::Camera;
use crate::from_splat::photo_with_foreground;
use crate::pictures::{self, strokes};
use crate::render::{RenderOptions, render};
use crate::report::style;
use crate::scene::{Scene, SceneError, View};
use crate::words::html::jpeg_url;
use crate::words::output::one_line;

/// Longest side of a picture in pixels: three fit side by side on a screen.
const LONGEST_SIDE: u32 = 480;
/// Maximum number of views shown.
const MOST_VIEWS: usize = 16;
const OUTLINE: Rgb<u8> = Rgb([230, 0, 120]);
const UP: Rgb<u8> = Rgb([0, 110, 230]);
/// Width of the arrow on a picture whose longer side is [`LONGEST_SIDE`], in pixels.
const ARROW_PX: f64 = 4.0;

/// Draws the page.
///
/// # Errors
/// [`SceneError`] if a photo can no longer be read.
pub fn to_html(inspection: &Inspection, scene: &Scene, views: &[View]) -> Result<String, SceneError> {
    let cloud = scene.whole_cloud();
    let step = views.len().div_ceil(MOST_VIEWS).max(1);
    let mut rows = Vec::new();
    for (view, fit) in views.iter().zip(&inspection.views).step_by(step) {
        let photo = photo_with_foreground(scene, view)?;
        let splat = render(&cloud, &view.camera, &RenderOptions::default()).to_image([1.0; 3]);
        let splat = DynamicImage::ImageRgba8(splat).into_rgb8();
        let mut shown = outlined(&photo.rgb, &photo.foreground);
        draw_up(&mut shown, scene, &view.camera);
        let photo = as_the_splat_shows(scene, photo);
        rows.push(context! {
            name => &fit.name,
            psnr => format!("{:.2}", fit.psnr_db),
            iou => fit.mask_iou.map(|iou| format!("{iou:.3}")),
            photo => picture(&shown),
            splat => picture(&splat),
            difference => picture(&difference(&photo.rgb, &splat)),
        });
    }
    let line = |(name, value): (&str, String)| if name.is_empty() { value } else { format!("{name}: {value}") };
    let verdict: Vec<String> = text::verdict(inspection).into_iter().map(line).collect();
    let data = context! {
        name => one_line(&inspection.name),
        text => text::to_text(inspection),
        verdict,
        aligned => inspection.aligned,
        foreground => inspection.foreground.map(text::foreground),
        rows,
        outline => Value::from(Serde(Outline::of(inspection, scene, views)?)),
        outline_script => Value::from_safe_string(include_str!("outline.js").to_owned()),
    };
    Ok(style::engine().render_str(include_str!("page.html.j2"), data).expect("the template is a constant"))
}

/// A picture's address.
fn picture(picture: &RgbImage) -> Value {
    let jpeg = pictures::jpeg(picture, LONGEST_SIDE).expect("memory takes a picture of this size");
    Value::from_safe_string(jpeg_url(&jpeg))
}

/// The photo with the border of its foreground outlined, wide enough to be visible when the picture is shrunk.
fn outlined(photo: &RgbImage, foreground: &GrayImage) -> RgbImage {
    let reach = (photo.width().max(photo.height()) / LONGEST_SIDE).max(1);
    let mut picture = photo.clone();
    let (width, height) = photo.dimensions();
    let foreground_at = |x: u32, y: u32| foreground.get_pixel(x.min(width - 1), y.min(height - 1))[0];
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let inside = foreground_at(x, y);
        if inside != foreground_at(x + reach, y) || inside != foreground_at(x, y + reach) {
            *pixel = OUTLINE;
        }
    }
    picture
}

/// Draws an arrow from the middle of the object's base upwards, as long as the object's box is along its diagonal.
fn draw_up(photo: &mut RgbImage, scene: &Scene, camera: &Camera) {
    let bounds = scene.object_bounds();
    let center = bounds.center();
    let base = Point3::new(center.x, center.y, bounds.min.z);
    let ends = [base, base + Vector3::z() * bounds.diagonal()];
    if let [Some(from), Some(tip)] = ends.map(|end| camera.pixel(camera.point_in_camera(end))) {
        let shrunk = f64::from(photo.width().max(photo.height())) / f64::from(LONGEST_SIDE);
        strokes::arrow(photo, from, tip, ARROW_PX * shrunk.max(1.0), UP);
    }
}

/// The difference of the two pictures, black where they are equal.
fn difference(photo: &RgbImage, splat: &RgbImage) -> RgbImage {
    RgbImage::from_fn(photo.width(), photo.height(), |x, y| {
        let (a, b) = (photo.get_pixel(x, y), splat.get_pixel(x, y));
        Rgb(std::array::from_fn(|channel| a[channel].abs_diff(b[channel])))
    })
}
