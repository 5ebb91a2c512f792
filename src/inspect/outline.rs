//! What the page needs so that a box around the object can be dragged: the splat's points, and photos with their cameras. All of it is
//! in the input's frame, which is that of `--object-box`.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::imageops::{FilterType, interpolate_bilinear, resize};
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Matrix3x4, Point3};
use serde::Serialize;

use super::{Extent, Inspection};
use crate::camera::{Camera, Intrinsics};
use crate::gaussians::{Gaussians, SH_C0};
use crate::numeric::evenly;
use crate::pictures;
use crate::scene::{Scene, SceneError, View};
use crate::words::html::jpeg_url;

/// Maximum number of photos on which the box is drawn.
const MOST_PHOTOS: usize = 4;
/// Longest side of such a photo in pixels.
const LONGEST_SIDE: u32 = 720;
/// Maximum number of points.
const MOST_POINTS: usize = 20_000;
/// Of a Gaussian that is shown as a point.
const LEAST_OPACITY: f64 = 0.3;
/// How far from the object points are shown, in sides of its box: enough to see what a box cuts off.
const REACH: f64 = 0.75;

/// The data of `outline.js`.
#[derive(Serialize)]
pub(super) struct Outline {
    /// Where the box begins: around what is taken as the object.
    #[serde(rename = "box")]
    start: Extent,
    /// x, y and z of each point as little-endian float32, base64.
    points: String,
    /// Red, green and blue of each point as bytes, base64.
    colors: String,
    photos: Vec<PinholePhoto>,
}

/// A photo without the lens's distortion.
#[derive(Serialize)]
struct PinholePhoto {
    name: String,
    /// A `data:` address.
    picture: String,
    /// Width and height in pixels.
    size: [u32; 2],
    /// fx and fy, pixels.
    focal: [f64; 2],
    /// cx and cy, pixels.
    center: [f64; 2],
    /// Row by row; x right, y down, z forward.
    camera_from_input: [[f64; 4]; 3],
}

impl Outline {
    /// # Errors
    /// [`SceneError`] if a photo can no longer be read.
    pub fn of(inspection: &Inspection, scene: &Scene, views: &[View]) -> Result<Self, SceneError> {
        let in_input = scene.in_input_frame();
        let cloud = in_input.whole_cloud();
        let shown = points_near(&cloud, &inspection.extent);
        let coordinates = shown.iter().flat_map(|i| cloud.positions[*i]).flat_map(f32::to_le_bytes);
        let byte = |channel: f32| (255.0 * (0.5 + SH_C0 * channel)).round() as u8;
        Ok(Self {
            start: inspection.extent,
            points: STANDARD.encode(coordinates.collect::<Vec<u8>>()),
            colors: STANDARD.encode(shown.iter().flat_map(|i| cloud.sh_dc[*i]).map(byte).collect::<Vec<u8>>()),
            photos: evenly(views, MOST_PHOTOS).map(|view| pinhole(scene, view)).collect::<Result<_, _>>()?,
        })
    }
}

/// Some of the visible Gaussians in and around a box, evenly.
fn points_near(cloud: &Gaussians, extent: &Extent) -> Vec<usize> {
    let longest = extent.size.iter().copied().fold(0.0, f64::max);
    let is_near = |i: &usize| {
        let center = cloud.center(*i);
        let on_axis = |axis: usize| {
            (extent.min[axis] - REACH * longest..=extent.max[axis] + REACH * longest).contains(&center[axis])
        };
        cloud.opacity(*i) >= LEAST_OPACITY && (0..3).all(on_axis)
    };
    let near: Vec<usize> = (0..cloud.len()).filter(is_near).collect();
    evenly(&near, MOST_POINTS).copied().collect()
}

fn pinhole(scene: &Scene, view: &View) -> Result<PinholePhoto, SceneError> {
    let photo = view.photo()?.rgb;
    let factor = f64::from(LONGEST_SIDE) / f64::from(photo.width().max(photo.height()));
    let [width, height] =
        [photo.width(), photo.height()].map(|side| ((f64::from(side) * factor.min(1.0)).round() as u32).max(1));
    let camera = scene.camera_in_input(&view.camera);
    let lens = camera.intrinsics.resized(width, height);
    let picture = without_distortion(resize(&photo, width, height, FilterType::Triangle), &lens);
    let pose: Matrix3x4<f64> = camera.camera_from_world.to_homogeneous().fixed_view::<3, 4>(0, 0).into_owned();
    Ok(PinholePhoto {
        name: view.name.clone(),
        picture: jpeg_url(&pictures::jpeg(&picture, LONGEST_SIDE).expect("memory takes a picture of this size")),
        size: [width, height],
        focal: [lens.fx, lens.fy],
        center: [lens.cx, lens.cy],
        camera_from_input: std::array::from_fn(|row| std::array::from_fn(|column| pose[(row, column)])),
    })
}

/// The picture as a pinhole camera of the same focal lengths takes it; black where the lens does not reach.
fn without_distortion(picture: RgbImage, lens: &Intrinsics) -> RgbImage {
    if lens.distortion.is_none() {
        return picture;
    }
    let camera = Camera { intrinsics: *lens, camera_from_world: Isometry3::identity() };
    RgbImage::from_fn(picture.width(), picture.height(), |x, y| {
        let ray = Point3::new((f64::from(x) + 0.5 - lens.cx) / lens.fx, (f64::from(y) + 0.5 - lens.cy) / lens.fy, 1.0);
        let seen = camera.pixel(ray);
        let color = seen.and_then(|at| interpolate_bilinear(&picture, at.x as f32 - 0.5, at.y as f32 - 0.5));
        color.unwrap_or(Rgb([0; 3]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Distortion;

    #[test]
    fn a_distorted_photo_becomes_that_of_a_pinhole_camera() {
        const SIDE: u32 = 100;
        let distortion = Distortion::fisheye([0.1, 0.0, 0.0, 0.0]);
        let lens = Intrinsics { width: SIDE, height: SIDE, fx: 60.0, fy: 60.0, cx: 50.0, cy: 50.0, distortion };
        let camera = Camera { intrinsics: lens, camera_from_world: Isometry3::identity() };
        let corner = Point3::new(0.6, -0.5, 1.0);
        let seen = camera.pixel(corner).unwrap();
        let dot = |x: u32, y: u32| {
            let near = (f64::from(x) + 0.5 - seen.x).abs() < 2.0 && (f64::from(y) + 0.5 - seen.y).abs() < 2.0;
            Rgb([if near { 255 } else { 0 }; 3])
        };
        let straight = without_distortion(RgbImage::from_fn(SIDE, SIDE, dot), &lens);
        let at = [lens.fx * corner.x + lens.cx, lens.fy * corner.y + lens.cy].map(|place| place as u32);
        assert!((f64::from(at[0]) - seen.x).abs() > 3.0, "the lens moves the dot");
        assert_eq!(straight.get_pixel(at[0], at[1])[0], 255);
        let bright = straight.enumerate_pixels().filter(|(_, _, pixel)| pixel[0] > 127);
        let off = bright.map(|(x, y, _)| x.abs_diff(at[0]).max(y.abs_diff(at[1]))).max();
        assert!(off.unwrap() <= 4, "{off:?}");
    }
}
