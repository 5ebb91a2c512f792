//! A picture of the splat from the front and above, for libraries of assets.

use image::{DynamicImage, RgbImage};
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::camera::{Camera, Distortion, Intrinsics};
use crate::export::{Model, Rigid};
use crate::render::{RenderOptions, render};

/// Pixels on each side.
const SIDE: u32 = 256;
/// From the object to the camera, z up.
const FROM: [f64; 3] = [0.8, -1.0, 0.7];
/// Distance of the camera in radii of the object, and the share of the picture that the radius fills.
const DISTANCE: f64 = 5.0;
const FILLED: f64 = 0.48;

pub fn draw(model: &Model, rigid: &Rigid) -> RgbImage {
    let meters = model.scale.map_or(1.0, |scale| scale.meters_per_unit);
    let (low, high) = rigid.extent();
    let (middle, radius) =
        ((nalgebra::center(&low, &high) + rigid.placement.origin) / meters, 0.5 * (high - low).norm() / meters);
    let camera = camera(middle, radius);
    let drawn = render(model.gaussians, &camera, &RenderOptions { near: 0.01 * radius, ..RenderOptions::default() });
    DynamicImage::ImageRgba8(drawn.to_image([1.0; 3])).into_rgb8()
}

fn camera(middle: Point3<f64>, radius: f64) -> Camera {
    let backward = Vector3::from(FROM).normalize();
    let right = Vector3::z().cross(&backward).normalize();
    // The camera looks along z, and its y points down.
    let rows =
        nalgebra::Matrix3::from_rows(&[right.transpose(), -backward.cross(&right).transpose(), -backward.transpose()]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    let center = middle + backward * (DISTANCE * radius);
    let focal = f64::from(SIDE) * FILLED * DISTANCE;
    let half = 0.5 * f64::from(SIDE);
    let intrinsics = Intrinsics {
        width: SIDE,
        height: SIDE,
        fx: focal,
        fy: focal,
        cx: half,
        cy: half,
        distortion: Distortion::default(),
    };
    Camera { intrinsics, camera_from_world: Isometry3::from_parts(Translation3::from(-(turn * center.coords)), turn) }
}
