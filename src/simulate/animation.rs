//! The simulation as a moving picture: each frame drawn by the project's rasteriser over a chequered ground with the
//! object's shadow, from a camera that sees the whole motion.

mod camera;
mod ground;

use image::codecs::gif::{GifEncoder, Repeat};
use image::{Delay, DynamicImage, Frame, RgbImage};

use super::SimulationReport;
use crate::progress::Progress;
use crate::scene::gaussians::Gaussians;
use crate::vote::raster::{self, RenderOptions};
use camera::camera_around;
use ground::Ground;

/// Size of the picture in pixels.
const SIZE: [u32; 2] = [480, 360];

/// How long a frame is shown. The motion is slowed down: a fall of half a second is over too soon to be watched.
const FRAME_MS: u32 = 70;

/// How long the last frame stays before the motion starts again.
const LAST_FRAME_MS: u32 = 1000;

/// One picture a frame, in their order. `load` gives the Gaussians of a frame by its index.
///
/// # Errors
/// What `load` reports.
pub fn pictures(
    report: &SimulationReport,
    load: &mut dyn FnMut(usize) -> anyhow::Result<Gaussians>,
    progress: Progress,
) -> anyhow::Result<Vec<RgbImage>> {
    let scene_units = 1.0 / report.meters_per_unit;
    let ground_z = report.ground_z_m * scene_units;
    let camera = camera_around(report, SIZE);
    let bar = progress.bar("animate", report.frames.len() as u64);
    let mut pictures = Vec::with_capacity(report.frames.len());
    for index in 0..report.frames.len() {
        let gaussians = load(index)?;
        let render = raster::render(&gaussians, &camera, &RenderOptions::default());
        let ground = Ground::new(ground_z, report, &gaussians);
        pictures.push(over(&render, &ground.picture(&camera)));
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(pictures)
}

/// An endless animated GIF of equally large pictures.
///
/// # Errors
/// What the encoder reports.
pub fn gif(pictures: &[RgbImage]) -> image::ImageResult<Vec<u8>> {
    /// Of 1 (best palette) to 30 (fastest): the sample of pixels that NeuQuant learns a frame's palette from.
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

/// The object over the ground.
fn over(render: &raster::Render, ground: &[[f32; 3]]) -> RgbImage {
    RgbImage::from_fn(render.width, render.height, |x, y| {
        let pixel = (y * render.width + x) as usize;
        let rest = 1.0 - render.alpha[pixel];
        let light: [f32; 3] = std::array::from_fn(|c| render.rgb[pixel][c] + rest * ground[pixel][c]);
        image::Rgb(light.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8))
    })
}
