//! Carving: every view removes the cells that it looks past or through (Kutulakos and Seitz 2000, with depth).
//!
//! A cell is outside if some view sees background in its place, or if views see a surface clearly behind it. Cells that
//! no view looks through stay, if they are within any picture. This fails for undersides and hollows that no view sees
//! into (they stay filled), and for glass.

use nalgebra::{Point2, Point3, Vector3};

use super::depth_view::DepthView;
use crate::parallel;
use crate::parts::grid::Grid;

/// A pixel belongs to the object if at least this share of its light comes from Gaussians: the edge of a blurred step.
const ALPHA_MIN: f64 = 0.5;

/// A surface must be seen behind a cell by this many views: the depth in a single one is too easily wrong, because a
/// splat is soft.
const VIEWS_MIN: usize = 2;

/// Empties the cells of `inside` that a view looks past, or that views see in front of a surface by more than
/// `tolerance` (scene units), and those that are in no picture.
pub fn carve(grid: &Grid, views: &[DepthView], tolerance: f64, inside: &mut [bool]) {
    let views_min = VIEWS_MIN.min(views.len());
    parallel::for_each_chunk_mut(inside, grid.layer(), |z, layer| {
        for (i, cell) in layer.iter_mut().enumerate().filter(|(_, cell)| **cell) {
            let point = grid.center([i % grid.dims[0], i / grid.dims[0], z]);
            let (mut in_front, mut in_picture) = (0, false);
            for view in views {
                match view.sees_at(point, tolerance) {
                    Seen::Background => in_front = views_min,
                    Seen::SurfaceBehind => in_front += 1,
                    Seen::Inside => in_picture = true,
                    Seen::OffPicture => {}
                }
                if in_front >= views_min {
                    break;
                }
            }
            *cell = in_front < views_min && in_picture;
        }
    });
}

/// A surface is seen only if a view looks at it within this angle of its normal, given as a cosine: a place that is
/// only grazed is as often the edge of a hidden region as a surface.
const FACING: f64 = 0.2;
/// A surface is seen only if the surface in the view is within this many tolerances of it.
const TOLERANCES: f64 = 3.0;

/// True if some view sees this place of the surface, whose outward unit normal is `normal`. `tolerance` in scene units.
pub fn is_seen(views: &[DepthView], point: Point3<f64>, normal: Vector3<f64>, tolerance: f64) -> bool {
    views.iter().any(|view| {
        let behind = facing(view, point, normal).and_then(|_| view.surface_behind(point));
        behind.is_some_and(|behind| behind.abs() <= TOLERANCES * tolerance)
    })
}

/// The cosine between a place's normal and the direction to the view's camera; `None` if the view grazes the place or
/// sees its back.
pub fn facing(view: &DepthView, point: Point3<f64>, normal: Vector3<f64>) -> Option<f64> {
    let toward_eye = view.camera.center_in_world() - point;
    let cosine = normal.dot(&toward_eye) / toward_eye.norm();
    (cosine >= FACING).then_some(cosine)
}

/// The contents of a view at a place.
enum Seen {
    /// No object along the whole ray.
    Background,
    /// A surface, clearly behind the place.
    SurfaceBehind,
    /// The place is on or behind a surface.
    Inside,
    OffPicture,
}

impl DepthView {
    /// How far behind a point, along the ray through it, the view sees a surface, scene units; negative if the surface
    /// is in front of the point. `None` if the point is outside the picture or there is no surface.
    pub fn surface_behind(&self, point: Point3<f64>) -> Option<f64> {
        let in_camera = self.camera.point_in_camera(point);
        let pixel = self.camera.pixel(in_camera)?;
        let (width, height) = (self.camera.intrinsics.width, self.camera.intrinsics.height);
        let on_picture = (0.0..f64::from(width)).contains(&pixel.x) && (0.0..f64::from(height)).contains(&pixel.y);
        let depth = on_picture.then(|| self.depth[pixel.y as usize * width as usize + pixel.x as usize])?;
        let behind = (f64::from(depth) - in_camera.z) * in_camera.coords.norm() / in_camera.z;
        behind.is_finite().then_some(behind)
    }

    fn sees_at(&self, point: Point3<f64>, tolerance: f64) -> Seen {
        let in_camera = self.camera.point_in_camera(point);
        let Some(Point2 { coords }) = self.camera.pixel(in_camera) else { return Seen::OffPicture };
        let (x, y) = (coords.x, coords.y);
        let (width, height) = (self.camera.intrinsics.width as usize, self.camera.intrinsics.height as usize);
        if !(x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64) {
            return Seen::OffPicture;
        }
        let (left, share_x) = between_centers(x, width);
        let (top, share_y) = between_centers(y, height);
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
            let weight =
                (if dx == 1 { share_x } else { 1.0 - share_x }) * (if dy == 1 { share_y } else { 1.0 - share_y });
            ((top + dy).min(height - 1) * width + (left + dx).min(width - 1), weight)
        });
        let alpha: f64 = corners.iter().map(|(pixel, weight)| weight * f64::from(self.alpha[*pixel])).sum();
        if alpha < ALPHA_MIN {
            return Seen::Background;
        }
        let clear = in_camera.z + tolerance;
        let is_behind = |pixel: usize| self.depth[pixel].is_finite() && f64::from(self.depth[pixel]) > clear;
        if corners.iter().all(|(pixel, _)| is_behind(*pixel)) { Seen::SurfaceBehind } else { Seen::Inside }
    }
}

/// The pixel with the last centre before `at`, and the fraction of the way from there to the next centre.
fn between_centers(at: f64, size: usize) -> (usize, f64) {
    let from_center = (at - 0.5).clamp(0.0, size as f64 - 1.0);
    let pixel = from_center.floor();
    (pixel as usize, from_center - pixel)
}
