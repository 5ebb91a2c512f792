//! The simulation as an animation: each frame is drawn by the project's rasteriser over a chequered ground with the
//! object's shadow, from a camera that sees the whole motion.

mod camera;
mod ground;
mod movie;

use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, DynamicImage, Frame, RgbImage};

use super::SimulationReport;
use crate::camera::{Camera, Distortion};
use crate::progress::Progress;
use crate::render::{self, RenderOptions};
use crate::scene::gaussians::Gaussians;
use crate::values::from_to;
use camera::cameras_around;
use ground::Ground;
pub use movie::mp4;
use serde::Serialize;

/// Size of the picture in pixels.
const SIZE: [u32; 2] = [480, 360];

/// How long a frame is shown. The motion is slowed down: a fall of half a second is too short to follow.
const FRAME_MS: u32 = 70;

/// How long the last frame stays before the animation starts again.
const LAST_FRAME_MS: u32 = 1000;

/// The viewpoint of the animation.
#[derive(Debug, Clone, PartialEq, clap::Args, Serialize)]
pub struct Viewpoint {
    /// Film with the camera of this photo, given by its name [default: a camera that sees the whole motion]
    #[arg(long, value_name = "VIEW", conflicts_with_all = ["azimuth_deg", "turntable"])]
    pub film_from: Option<String>,

    /// Film from this direction, in degrees from +x towards +y [default: the side that shows most of the object's length]
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = from_to(-360.0, 360.0))]
    pub azimuth_deg: Option<f64>,

    /// Angle by which the camera looks down, in degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 22.0, allow_negative_numbers = true)]
    #[arg(value_parser = from_to(-90.0, 90.0))]
    pub elevation_deg: f64,

    /// Circle once around the object while it moves
    #[arg(long)]
    pub turntable: bool,
}

/// The cameras that film `report`: one, or one per frame. `photo` is the one that [`Viewpoint::film_from`] names.
pub fn cameras(report: &SimulationReport, viewpoint: &Viewpoint, photo: Option<&Camera>) -> Vec<Camera> {
    let Some(photo) = photo else { return cameras_around(report, viewpoint, SIZE) };
    let i = photo.intrinsics;
    let factor = (f64::from(SIZE[0]) / f64::from(i.width)).min(f64::from(SIZE[1]) / f64::from(i.height));
    // Even, as video encoders require.
    let side = |pixels: u32| ((f64::from(pixels) * factor / 2.0).round() as u32).max(1) * 2;
    let mut intrinsics = i.resized(side(i.width), side(i.height));
    intrinsics.distortion = Distortion::default();
    vec![Camera { intrinsics, ..*photo }]
}

/// One picture per frame, in order, with `cameras` in turn. `load` returns the Gaussians of a frame by its index.
///
/// # Errors
/// The errors of `load`.
pub fn pictures<E>(
    report: &SimulationReport,
    cameras: &[Camera],
    load: &mut dyn FnMut(usize) -> Result<Gaussians, E>,
    progress: Progress,
) -> Result<Vec<RgbImage>, E> {
    let scene_units = 1.0 / report.meters_per_unit;
    let ground_z = report.ground_z_m * scene_units;
    let bar = progress.bar("animate", report.frames.len() as u64);
    let mut pictures = Vec::with_capacity(report.frames.len());
    for index in 0..report.frames.len() {
        let gaussians = load(index)?;
        let camera = &cameras[index % cameras.len()];
        let render = render::render(&gaussians, camera, &RenderOptions::default());
        let ground = Ground::new(ground_z, report, &gaussians);
        pictures.push(over(&render, &ground.picture(camera)));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(pictures)
}

/// An endless animated GIF of equally large pictures.
///
/// # Errors
/// If the encoder fails.
pub fn gif(pictures: &[RgbImage]) -> image::ImageResult<Vec<u8>> {
    /// From 1 (best palette) to 30 (fastest): how densely NeuQuant samples the pixels from which it learns a frame's
    /// palette.
    const SPEED: i32 = 10;
    let mut bytes = Vec::new();
    let mut encoder = GifEncoder::new_with_speed(&mut bytes, SPEED);
    encoder.set_repeat(Repeat::Infinite)?;
    for (index, picture) in pictures.iter().enumerate() {
        let shown_ms = if index + 1 == pictures.len() { LAST_FRAME_MS } else { FRAME_MS };
        let picture = DynamicImage::ImageRgb8(picture.clone()).into_rgba8();
        encoder.encode_frame(Frame::from_parts(picture, 0, 0, Delay::from_numer_denom_ms(shown_ms, 1)))?;
    }
    drop(encoder);
    Ok(bytes)
}

/// Composites the object over the ground.
fn over(render: &render::Render, ground: &[[f32; 3]]) -> RgbImage {
    RgbImage::from_fn(render.width, render.height, |x, y| {
        let pixel = (y * render.width + x) as usize;
        let rest = 1.0 - render.alpha[pixel];
        let light: [f32; 3] = std::array::from_fn(|c| render.rgb[pixel][c] + rest * ground[pixel][c]);
        image::Rgb(light.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8))
    })
}
