//! The surface that fingers can touch: points with outward normals, from the Gaussians that some view sees.
//!
//! A normal has two sources. The depth map of every view that sees the Gaussian gives one by finite differences, which
//! is surely outward but rough; the Gaussian itself, if it is flat, gives its shortest axis, which is exact except for
//! its sign. The point is on the near side of the Gaussian, whose centre lies below the surface by about one standard
//! deviation.

use nalgebra::{Point3, Vector3};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::render::depth_test::DepthTest;
use crate::render::{Projected, Render, RenderOptions};

/// A Gaussian fainter than this is not a surface.
const OPACITY_MIN: f64 = 0.3;
/// More views did not see more of the scenes on which grasps were tested.
const VIEWS_MAX: usize = 40;
/// Depth is differentiated over this many pixels to either side.
const REACH_PX: i64 = 2;
/// Neighbours whose difference in depth exceeds this multiple of their lateral distance are not on one surface (80
/// degrees).
const STEEP: f64 = 5.7;
/// A Gaussian's own axis is used if it is within 60 degrees of the normal from depth.
const AGREES: f64 = 0.5;

/// The surface in metres, in the scaled world frame.
pub struct Surface {
    pub points: Vec<SurfacePoint>,
    /// Centres of all opaque Gaussians, m: what a finger must not run into.
    pub obstacles: Vec<Point3<f64>>,
}

/// A point on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    pub position: Point3<f64>,
    /// Outward unit normal.
    pub normal: Vector3<f64>,
    /// Label of the part: its index in the list of labels.
    pub part: u32,
}

impl Surface {
    /// The surface that `cameras` see. There is one of `labels` per Gaussian; `meters_per_unit` is the scene's scale.
    pub fn of(gaussians: &Gaussians, labels: &[u32], cameras: &[Camera], meters_per_unit: f64) -> Self {
        let opaque: Vec<usize> = (0..gaussians.len()).filter(|&i| gaussians.opacity(i) >= OPACITY_MIN).collect();
        let from_depth = normals_from_depth(gaussians, cameras);
        let point = |&i: &usize| {
            let normal = refined(gaussians, i, from_depth[i].try_normalize(0.0)?);
            let deviation = normal.dot(&(gaussians.covariance(i) * normal)).sqrt();
            let position = (gaussians.center(i) + normal * deviation) * meters_per_unit;
            Some(SurfacePoint { position, normal, part: labels[i] })
        };
        Self {
            points: parallel::flat_map(&opaque, point),
            obstacles: opaque.iter().map(|&i| gaussians.center(i) * meters_per_unit).collect(),
        }
    }

    /// Distance of a point from the object, m; 0 within it. `None` if no surface is seen.
    pub fn distance_m(&self, point: Point3<f64>) -> Option<f64> {
        let distance = |p: &SurfacePoint| (point - p.position).norm();
        let nearest = self.points.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        let is_before = (point - nearest.position).dot(&nearest.normal) > 0.0;
        // If a surface was seen from one side only, a point behind it may still lie outside.
        let all = |holds: &dyn Fn(&SurfacePoint) -> bool| self.points.iter().all(holds);
        let is_beyond = (0..3).any(|a| all(&|p| p.position[a] < point[a]) || all(&|p| point[a] < p.position[a]));
        Some(if is_before || is_beyond { distance(nearest) } else { 0.0 })
    }
}

/// For each Gaussian, the sum of the depth-map normals over the views that see it, world frame; zero if none does.
fn normals_from_depth(gaussians: &Gaussians, cameras: &[Camera]) -> Vec<Vector3<f64>> {
    let test = DepthTest::new(gaussians);
    let options = RenderOptions::default();
    // Only depths are needed.
    let black = vec![[0.0; 3]; gaussians.len()];
    let mut sums = vec![Vector3::zeros(); gaussians.len()];
    let count = cameras.len().min(VIEWS_MAX);
    for camera in (0..count).map(|k| &cameras[k * cameras.len() / count]) {
        let projected = Projected::new(gaussians, camera, &options);
        let drawn = projected.draw(&black);
        for splat in projected.splats() {
            let [x, y] = splat.center.map(|c| f64::from(c).floor() as i64);
            let Some(depth) = depth_at(&drawn, x, y) else { continue };
            if test.passes(splat, depth as f32)
                && let Some(normal) = depth_normal(&drawn, camera, x, y)
            {
                sums[splat.gaussian as usize] += normal;
            }
        }
    }
    sums
}

fn depth_at(drawn: &Render, x: i64, y: i64) -> Option<f64> {
    let inside = (0..i64::from(drawn.width)).contains(&x) && (0..i64::from(drawn.height)).contains(&y);
    let depth = inside.then(|| f64::from(drawn.median_depth[(y * i64::from(drawn.width) + x) as usize]))?;
    depth.is_finite().then_some(depth)
}

/// Normal of the depth map at a pixel, world frame, towards the camera, with its cosine to the line of sight as its
/// length: a view that grazes the surface measures it badly.
fn depth_normal(drawn: &Render, camera: &Camera, x: i64, y: i64) -> Option<Vector3<f64>> {
    let i = &camera.intrinsics;
    let point = |x: i64, y: i64| {
        let depth = depth_at(drawn, x, y)?;
        let (x, y) = i.distortion.invert((x as f64 + 0.5 - i.cx) / i.fx, (y as f64 + 0.5 - i.cy) / i.fy)?;
        Some(Vector3::new(x, y, 1.0) * depth)
    };
    let across = point(x + REACH_PX, y)? - point(x - REACH_PX, y)?;
    let down = point(x, y + REACH_PX)? - point(x, y - REACH_PX)?;
    if across.z.abs() > STEEP * across.x.abs() || down.z.abs() > STEEP * down.y.abs() {
        return None;
    }
    let ray = point(x, y)?.normalize();
    let normal = down.cross(&across).try_normalize(0.0)?;
    let toward = if normal.dot(&ray) > 0.0 { -normal } else { normal };
    Some(camera.camera_from_world.rotation.inverse() * toward * toward.dot(&ray).abs())
}

/// The normal from depth, shifted towards the Gaussian's shortest axis by how flat it is.
fn refined(gaussians: &Gaussians, i: usize, from_depth: Vector3<f64>) -> Vector3<f64> {
    let scale = gaussians.scale(i);
    let shortest = scale.imin();
    let middle = scale.sum() - scale.max() - scale.min();
    let axis = gaussians.rotation(i) * Vector3::ith(shortest, 1.0);
    let along = axis.dot(&from_depth);
    if along.abs() < AGREES {
        return from_depth;
    }
    let flatness = 1.0 - scale.min() / middle;
    (from_depth + axis * (along.signum() * flatness)).normalize()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::camera::{Distortion, Intrinsics};

    /// A wall that leans back, 35 degrees off the axis of a lens that shows angles instead of their tangents.
    #[test]
    fn a_lens_does_not_tilt_the_normal_of_a_wall() {
        let distortion = Distortion::fisheye([0.0; 4]);
        let intrinsics = Intrinsics { width: 64, height: 64, fx: 40.0, fy: 40.0, cx: 32.0, cy: 32.0, distortion };
        let camera = Camera { intrinsics, camera_from_world: Isometry3::identity() };
        let normal = Vector3::new(-0.5, 0.0, -1.0).normalize();
        let depth = |pixel: u32| {
            let [x, y] = [pixel % 64, pixel / 64].map(|at| (f64::from(at) + 0.5 - 32.0) / 40.0);
            let (x, y) = distortion.invert(x, y).unwrap();
            (-1.0 / normal.dot(&Vector3::new(x, y, 1.0))) as f32
        };
        let median_depth = (0..64 * 64).map(depth).collect();
        let (rgb, alpha, expected_depth) = (Vec::new(), Vec::new(), Vec::new());
        let drawn = Render { width: 64, height: 64, rgb, alpha, expected_depth, median_depth };
        let found = depth_normal(&drawn, &camera, 56, 32).unwrap();
        // Depths have 32 bits.
        assert!(found.angle(&normal).to_degrees() < 0.01, "{found}");
    }
}
