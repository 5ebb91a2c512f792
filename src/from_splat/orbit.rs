//! Views rendered from the splat, for scenes without photos: cameras spread over the sphere around the object.

use std::io;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{Rgba, RgbaImage};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::camera::{Camera, Distortion, Intrinsics};
use crate::scene::{Bounds, Scene, Upright, View};
use crate::vote::raster::{Render, RenderOptions, render};
use crate::workdir::write_atomic;

/// Side of the pictures in pixels.
const SIDE: u32 = 768;
/// Field of view in radians: little perspective, as product photos have.
const FIELD_OF_VIEW: f64 = 0.7;
/// How much of the picture's height the object's bounding sphere fills.
const FILLED: f64 = 0.9;

/// Gives the scene `count` views of the object from directions spread evenly over the sphere, each a picture with alpha in
/// `folder`, which is to be the folder of this splat and this count: a picture that is there is not rendered again.
///
/// # Errors
/// Where a picture cannot be written.
pub fn render_views(scene: &mut Scene, count: usize, folder: &Path) -> io::Result<()> {
    let cameras = orbit(&scene.object_bounds(), reach(scene), count);
    for (index, camera) in cameras.into_iter().enumerate() {
        let name = format!("{index:03}");
        let image = folder.join(format!("{name}.png"));
        if !image.is_file() {
            let picture = straight(&render(&scene.gaussians, &camera, &RenderOptions::default()));
            write_atomic(&image, |out| {
                let encoder = PngEncoder::new(out);
                picture.write_with_encoder(encoder).map_err(io::Error::other)
            })?;
        }
        scene.views.push(View { name, camera, image, upright: Upright::AsStored, mask: None });
    }
    scene.warnings.push(format!("there are no photos: {count} views were rendered from the splat itself"));
    Ok(())
}

/// How far the object's Gaussians reach beyond their centres: twice their usual standard deviation.
fn reach(scene: &Scene) -> f64 {
    let mut deviations: Vec<f64> = (0..scene.gaussians.len()).map(|i| scene.gaussians.scale(i).max()).collect();
    deviations.sort_by(f64::total_cmp);
    2.0 * deviations.get(deviations.len() / 2).copied().unwrap_or_default()
}

/// Cameras that look at the box, widened by `reach`, from all around, near enough for its bounding sphere to fill the picture.
pub fn orbit(bounds: &Bounds, reach: f64, count: usize) -> Vec<Camera> {
    let radius = 0.5 * bounds.diagonal() + reach;
    let distance = radius / (FILLED * (0.5 * FIELD_OF_VIEW).sin());
    let side = f64::from(SIDE);
    let focal = 0.5 * side / (0.5 * FIELD_OF_VIEW).tan();
    let (width, height, middle) = (SIDE, SIDE, 0.5 * side);
    let distortion = Distortion::None;
    let intrinsics = Intrinsics { width, height, fx: focal, fy: focal, cx: middle, cy: middle, distortion };
    let camera = |direction: Vector3<f64>| {
        let eye = bounds.center() + direction * distance;
        Camera { intrinsics, camera_from_world: looking(&eye, &bounds.center()) }
    };
    directions(count).into_iter().map(camera).collect()
}

/// Evenly spread unit vectors: a Fibonacci lattice (Gonzalez 2010).
fn directions(count: usize) -> Vec<Vector3<f64>> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let direction = |i: usize| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        let (sin, cos) = (golden_angle * i as f64).sin_cos();
        let across = (1.0 - z * z).sqrt();
        Vector3::new(across * cos, across * sin, z)
    };
    (0..count).map(direction).collect()
}

/// A camera at `eye` that looks at `target`, upright about the axis that it looks least along.
fn looking(eye: &Point3<f64>, target: &Point3<f64>) -> Isometry3<f64> {
    let forward = target - eye;
    let up = if forward.z.abs() > 0.95 * forward.norm() { Vector3::y() } else { Vector3::z() };
    // face_towards gives z forward and y towards `up`; OpenCV's y goes down.
    Isometry3::face_towards(eye, target, &-up).inverse()
}

/// Straight alpha from the rasteriser's premultiplied colours.
fn straight(render: &Render) -> RgbaImage {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    RgbaImage::from_fn(render.width, render.height, |x, y| {
        let pixel = (y * render.width + x) as usize;
        let alpha = render.alpha[pixel];
        let [r, g, b] = render.rgb[pixel].map(|value| if alpha > 0.0 { byte(value / alpha) } else { 255 });
        Rgba([r, g, b, byte(alpha)])
    })
}
