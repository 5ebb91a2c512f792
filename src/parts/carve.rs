//! Carving: every view takes away the cells that it looks past or through (Kutulakos and Seitz 2000, with depth).
//!
//! A cell is outside where some view sees background in its place, or sees a surface clearly behind it. What no view
//! looks through stays. Fails on undersides and hollows that no view sees into (they stay filled), and on glass.

use rayon::prelude::*;

use super::grid::Grid;
use crate::camera::Camera;

/// What one view sees: planes of `width * height` of its camera, row by row.
pub struct DepthView<'a> {
    pub camera: &'a Camera,
    /// Share of the pixel's light that comes from Gaussians, 0 to 1.
    pub alpha: Vec<f32>,
    /// Planar depth of the surface, scene units; infinite where there is none.
    pub depth: Vec<f32>,
}

/// A pixel is the object's where at least this much of its light comes from Gaussians: the edge of a blurred step.
const ALPHA_MIN: f64 = 0.5;

/// Empties the cells of `inside` that a view looks past, or in front of a surface by more than `tolerance` (scene units).
pub fn carve(grid: &Grid, views: &[DepthView], tolerance: f64, inside: &mut [bool]) {
    inside.par_chunks_mut(grid.layer()).enumerate().for_each(|(z, layer)| {
        for (i, cell) in layer.iter_mut().enumerate().filter(|(_, cell)| **cell) {
            let point = grid.center([i % grid.dims[0], i / grid.dims[0], z]);
            *cell = !views.iter().any(|view| {
                let in_camera = view.camera.point_in_camera(point);
                let Some(pixel) = view.camera.pixel(in_camera) else { return false };
                view.looks_past(pixel.x, pixel.y, in_camera.z + tolerance)
            });
        }
    });
}

impl DepthView<'_> {
    /// Whether light through this place of the picture comes from behind `depth`. A place off the picture says nothing.
    fn looks_past(&self, x: f64, y: f64, depth: f64) -> bool {
        let (width, height) = (self.camera.intrinsics.width as usize, self.camera.intrinsics.height as usize);
        if !(x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64) {
            return false;
        }
        let (left, share_x) = between_centers(x, width);
        let (top, share_y) = between_centers(y, height);
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
            let weight = (if dx == 1 { share_x } else { 1.0 - share_x }) * (if dy == 1 { share_y } else { 1.0 - share_y });
            ((top + dy).min(height - 1) * width + (left + dx).min(width - 1), weight)
        });
        let alpha: f64 = corners.iter().map(|(pixel, weight)| weight * f64::from(self.alpha[*pixel])).sum();
        if alpha < ALPHA_MIN {
            return true;
        }
        corners.iter().all(|(pixel, _)| f64::from(self.depth[*pixel]) > depth && self.depth[*pixel].is_finite())
    }
}

/// The pixel whose centre is the last before `at`, and how far `at` is on the way to the next centre.
fn between_centers(at: f64, size: usize) -> (usize, f64) {
    let from_center = (at - 0.5).clamp(0.0, size as f64 - 1.0);
    let pixel = from_center.floor();
    (pixel as usize, from_center - pixel)
}
