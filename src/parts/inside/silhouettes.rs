//! Widths of thin things, from the edges of the object in the photos.
//!
//! The masks of photos show an edge to a fraction of a pixel, while a splat blurs it over several. The width of a strip
//! between two backgrounds is the integral of the mask across it, which a blurred edge does not change.

use image::GrayImage;
use nalgebra::{Point2, Point3, Vector3};

use super::depth_view::DepthView;
use crate::camera::Camera;

/// Steps per pixel along a line across a strip.
const STEPS_PER_PIXEL: f64 = 2.0;
/// A pixel is background if the object covers less of it than this.
const COVERED_MIN: f64 = 0.02;
/// A strip is not measured from a view that looks along it at a smaller angle than this, given as a sine (27 degrees):
/// what is beside it in the picture is then far in front of it or behind it.
const ACROSS_MIN: f64 = 0.45;

/// The views whose photos tell the object from the background.
pub struct Silhouettes<'a> {
    pub views: Vec<Silhouette<'a>>,
}

/// The width of a strip in one photo.
#[derive(Debug, Clone, Copy)]
pub struct Width {
    /// Scene units.
    pub length: f64,
    /// The direction in which it was measured: unit, across the strip's axis and the line of sight.
    pub across: Vector3<f64>,
    /// The width of a pixel of the photo there, scene units.
    pub pixel: f64,
}

/// The object's outline in one photo.
pub struct Silhouette<'a> {
    /// The surface in the same view.
    pub depth: &'a DepthView,
    /// The photo's camera.
    pub camera: &'a Camera,
    /// The share of each pixel of the photo that the object covers, 0 to 255.
    pub coverage: &'a GrayImage,
}

impl Silhouettes<'_> {
    /// The widths of the strip around a point, across its axis, in the views that show the strip with background on
    /// both sides within `reach`. All lengths in scene units.
    pub fn widths(&self, point: Point3<f64>, axis: Vector3<f64>, reach: f64) -> Vec<Width> {
        self.views.iter().filter_map(|view| view.width(point, axis, reach)).collect()
    }
}

impl Silhouette<'_> {
    fn width(&self, point: Point3<f64>, axis: Vector3<f64>, reach: f64) -> Option<Width> {
        let sight = point - self.camera.center_in_world();
        let across = axis.cross(&sight);
        if across.norm() < ACROSS_MIN * axis.norm() * sight.norm() {
            return None;
        }
        // Something nearer may hide it.
        self.depth.surface_behind(point).filter(|behind| -behind <= reach)?;
        let pixel = sight.norm() / self.camera.intrinsics.fx.max(self.camera.intrinsics.fy);
        let step = pixel / STEPS_PER_PIXEL;
        let across = across.normalize();
        let steps = (reach / step).ceil() as i32;
        let mut covered = self.covered(point).filter(|covered| *covered >= 0.5)?;
        for side in [1, -1] {
            let mut ends = false;
            for n in 1..=steps {
                let here = self.covered(point + across * (f64::from(side * n) * step))?;
                covered += here;
                ends = here < COVERED_MIN;
                if ends {
                    break;
                }
            }
            if !ends {
                return None;
            }
        }
        Some(Width { length: covered * step, across, pixel })
    }

    /// The share of the light at a point's place in the photo that comes from the object, interpolated between pixels;
    /// `None` outside the photo.
    fn covered(&self, point: Point3<f64>) -> Option<f64> {
        let Point2 { coords } = self.camera.pixel(self.camera.point_in_camera(point))?;
        let (x, y) = (coords.x - 0.5, coords.y - 0.5);
        let (width, height) = self.coverage.dimensions();
        if !(x >= 0.0 && y >= 0.0 && x < f64::from(width - 1) && y < f64::from(height - 1)) {
            return None;
        }
        let (left, top) = (x.floor() as u32, y.floor() as u32);
        let (right, below) = (x.fract(), y.fract());
        let coverage_at = |dx: u32, dy: u32| f64::from(self.coverage.get_pixel(left + dx, top + dy).0[0]) / 255.0;
        let upper = coverage_at(0, 0) * (1.0 - right) + coverage_at(1, 0) * right;
        let lower = coverage_at(0, 1) * (1.0 - right) + coverage_at(1, 1) * right;
        Some(upper * (1.0 - below) + lower * below)
    }
}
