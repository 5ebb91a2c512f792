//! Projects 3D Gaussians to 2D splats: EWA projection (Zwicker et al. 2001), as in 3DGS.
//!
//! A Gaussian's covariance is transformed by the camera's Jacobian at its centre, including lens distortion, and
//! widened by a low-pass filter of [`LOW_PASS_PX2`]. The depth along the optical axis is treated the same way: the
//! local affine map takes the Gaussian to a 3D one in (pixel x, pixel y, depth), whose conditional mean of the depth
//! given the pixel is a plane. The slope of that plane makes the depth of a flat Gaussian correct across its whole
//! footprint, and the conditional standard deviation is the Gaussian's own extent along the ray: the camera sees its
//! front, [`SURFACE_DEVIATIONS`] in front of its centre.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Point3, Vector2, Vector3};

use crate::camera::{Camera, Distortion, Intrinsics};
use crate::gaussians::{ELLIPSOID_DEVIATIONS, Gaussians};
use crate::parallel;

/// Variance in px^2 added to a splat along both axes so that none is thinner than a pixel (3DGS, Kerbl et al. 2023).
pub const LOW_PASS_PX2: f64 = 0.3;
/// Minimum alpha with which a splat contributes to a pixel: one step of an 8-bit picture (3DGS).
pub const ALPHA_MIN: f32 = 1.0 / 255.0;
/// Number of standard deviations by which a Gaussian's surface lies in front of its centre: it is the surface of its ellipsoid.
/// On the four scenes with ground truth this reduces the median error of the expected depth from 0.6..1.2% of the object's
/// diagonal to 0.14..0.28%.
pub const SURFACE_DEVIATIONS: f64 = ELLIPSOID_DEVIATIONS;
/// The affine map is evaluated at most this share of half the picture outside its border; farther out, the perspective
/// Jacobian of large Gaussians diverges (3DGS clamps at 1.3 times the half field of view).
const JACOBIAN_MARGIN: f64 = 0.3;

/// A Gaussian as one camera sees it.
#[derive(Debug, Clone, Copy)]
pub struct Splat {
    /// Index of the Gaussian.
    pub gaussian: u32,
    /// Centre in pixels.
    pub center: [f32; 2],
    /// Inverse of the 2D covariance: xx, xy, yy in 1/px^2.
    pub conic: [f32; 3],
    /// Alpha at the centre.
    pub opacity: f32,
    /// Half width and half height in px of the ellipse outside of which alpha is below [`ALPHA_MIN`].
    pub reach: [f32; 2],
    /// Planar depth of the centre, scene units; splats are blended in this order.
    pub depth: f32,
    /// Planar depth of the surface in front of the centre, scene units; not in front of the near plane.
    pub surface_depth: f32,
    /// Change with the pixel of the depth of the Gaussian's densest point on the ray, and of its surface: scene units
    /// per px.
    pub depth_slope: [f32; 2],
    /// Standard deviation of the depth along the ray, scene units.
    pub depth_deviation: f32,
}

impl Splat {
    /// Planar depth of its surface on the ray through `pixel` (px), scene units.
    pub fn surface_at(&self, pixel: [f32; 2]) -> f32 {
        let [dx, dy] = [pixel[0] - self.center[0], pixel[1] - self.center[1]];
        self.surface_depth + self.depth_slope[0] * dx + self.depth_slope[1] * dy
    }
}

/// A camera with the values that every projection needs.
pub(super) struct Projector<'a> {
    camera: &'a Camera,
    rotation: Matrix3<f64>,
    near: f64,
    antialiased: bool,
    /// Largest |x/z - middle| and |y/z - middle| at which the Jacobian is evaluated.
    tangent_limit: Vector2<f64>,
    tangent_middle: Vector2<f64>,
}

impl<'a> Projector<'a> {
    pub(super) fn new(camera: &'a Camera, near: f64, antialiased: bool) -> Self {
        let (low, high) = tangents_of_border(&camera.intrinsics);
        let (half, middle) = (0.5 * (high - low), 0.5 * (high + low));
        Self {
            camera,
            rotation: camera.camera_from_world.rotation.to_rotation_matrix().into_inner(),
            near,
            antialiased,
            tangent_limit: half * (1.0 + JACOBIAN_MARGIN),
            tangent_middle: middle,
        }
    }

    /// The splats of all Gaussians that this camera can see, in the order of the Gaussians.
    pub(super) fn splats(&self, gaussians: &Gaussians) -> Vec<Splat> {
        // In one allocation, which is freed at once: many small ones would stay with the threads that made them.
        let splats: Vec<Option<Splat>> = parallel::map_range(gaussians.len(), |i| self.splat(gaussians, i));
        splats.into_iter().flatten().collect()
    }

    /// The splat of Gaussian `i`; `None` if it is nearer than the near plane, outside the picture, fainter than
    /// [`ALPHA_MIN`] or not finite.
    fn splat(&self, gaussians: &Gaussians, i: usize) -> Option<Splat> {
        let center = self.camera.point_in_camera(gaussians.center(i));
        let opacity = gaussians.opacity(i);
        if !(center.z > self.near && opacity >= f64::from(ALPHA_MIN)) {
            return None;
        }
        let pixel = self.camera.pixel(center)?.coords;
        let in_camera = self.rotation * gaussians.covariance(i) * self.rotation.transpose();
        let jacobian = self.jacobian(center);
        let sharp = jacobian * in_camera * jacobian.transpose();
        let covariance = sharp + Matrix2::identity() * LOW_PASS_PX2;
        let conic = covariance.try_inverse()?;
        let opacity = if self.antialiased {
            opacity * (sharp.determinant() / covariance.determinant()).max(0.0).sqrt()
        } else {
            opacity
        };
        // alpha = opacity exp(-q/2) is ALPHA_MIN on the ellipse q = 2 ln(opacity / ALPHA_MIN).
        let q = 2.0 * (opacity / f64::from(ALPHA_MIN)).ln();
        let reach = Vector2::new((q * covariance.m11).sqrt(), (q * covariance.m22).sqrt());
        let with_depth = jacobian * in_camera * Vector3::z();
        let slope = conic * with_depth;
        let deviation = (in_camera.m33 - with_depth.dot(&slope)).max(0.0).sqrt();
        let finite = reach.sum() + slope.sum() + deviation + conic.sum();
        if !(q >= 0.0 && finite.is_finite() && self.touches_picture(pixel, reach)) {
            return None;
        }
        Some(Splat {
            gaussian: i as u32,
            center: [pixel.x as f32, pixel.y as f32],
            conic: [conic.m11 as f32, conic.m12 as f32, conic.m22 as f32],
            opacity: opacity as f32,
            reach: [reach.x as f32, reach.y as f32],
            depth: center.z as f32,
            surface_depth: (center.z - SURFACE_DEVIATIONS * deviation).max(self.near) as f32,
            depth_slope: [slope.x as f32, slope.y as f32],
            depth_deviation: deviation as f32,
        })
    }

    /// d(pixel x, pixel y) / d(point in camera), 2x3, in px per scene unit.
    fn jacobian(&self, center: Point3<f64>) -> Matrix2x3<f64> {
        let i = &self.camera.intrinsics;
        let clamp = |tangent: f64, axis: usize| {
            let (middle, limit) = (self.tangent_middle[axis], self.tangent_limit[axis]);
            // Not `clamp`, which panics if the border's tangents are infinite: focal lengths come from a file.
            tangent.max(middle - limit).min(middle + limit)
        };
        let (x, y) = (clamp(center.x / center.z, 0), clamp(center.y / center.z, 1));
        let [[xx, xy], [yx, yy]] = i.distortion.jacobian(x, y);
        let lens = Matrix2::new(i.fx * xx, i.fx * xy, i.fy * yx, i.fy * yy);
        lens * Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / center.z
    }

    fn touches_picture(&self, pixel: Vector2<f64>, reach: Vector2<f64>) -> bool {
        let i = &self.camera.intrinsics;
        pixel.x + reach.x > 0.0
            && pixel.y + reach.y > 0.0
            && pixel.x - reach.x < f64::from(i.width)
            && pixel.y - reach.y < f64::from(i.height)
    }
}

/// Least and largest x/z and y/z shown at the middles of the picture's borders: a barrel lens shows more, a fisheye far
/// more, than a pinhole of its focal length would. If a lens shows nothing at a border, the edge of what it shows in
/// that direction counts instead.
fn tangents_of_border(i: &Intrinsics) -> (Vector2<f64>, Vector2<f64>) {
    let (width, height) = (f64::from(i.width), f64::from(i.height));
    let tangents = |x: f64, y: f64| {
        let pinhole = ((x - i.cx) / i.fx, (y - i.cy) / i.fy);
        let seen = match i.distortion {
            Distortion::None => pinhole,
            lens => lens.invert(pinhole.0, pinhole.1).unwrap_or_else(|| lens.at_distance_of(pinhole.0, pinhole.1)),
        };
        Vector2::new(seen.0, seen.1)
    };
    let (left, right) = (tangents(0.0, i.cy), tangents(width, i.cy));
    let (top, bottom) = (tangents(i.cx, 0.0), tangents(i.cx, height));
    (Vector2::new(left.x, top.y), Vector2::new(right.x, bottom.y))
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;

    /// A camera at the origin with a picture of 1000 x 1000 pixels.
    fn camera(focal: f64, distortion: Distortion) -> Camera {
        let intrinsics =
            Intrinsics { width: 1000, height: 1000, fx: focal, fy: focal, cx: 500.0, cy: 500.0, distortion };
        Camera { intrinsics, camera_from_world: Isometry3::identity() }
    }

    /// The tangents of the borders are infinite or NaN, and so is their middle.
    #[test]
    fn a_focal_length_that_is_next_to_nothing_does_no_harm() {
        for distortion in [Distortion::None, Distortion::opencv(-0.3, 0.05, 0.0, 0.0, 0.0)] {
            let camera = camera(1e-310, distortion);
            let jacobian = Projector::new(&camera, 0.01, false).jacobian(Point3::new(0.3, 0.2, 1.0));
            assert!(jacobian.iter().all(|slope| slope.is_finite()), "{jacobian}");
        }
    }

    /// Compares the Jacobian at `center`, which is in the picture and at least at distance 1, with central differences.
    fn assert_is_slope(camera: &Camera, center: Point3<f64>) {
        const STEP: f64 = 1e-5;
        /// The error of central differences is STEP^2 / 6 times the third derivative, at most 13,000 for these lenses,
        /// plus rounding, 1e-16 * 1000 px / STEP: together about 2e-7.
        const TOLERANCE: f64 = 1e-6;
        let pixel = |point: Point3<f64>| camera.pixel(point).unwrap().coords;
        assert!((0.0..1000.0).contains(&pixel(center).x), "{}", pixel(center));
        let jacobian = Projector::new(camera, 0.01, false).jacobian(center);
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = STEP;
            let slope = (pixel(center + step) - pixel(center - step)) / (2.0 * STEP);
            assert!((jacobian.column(axis) - slope).norm() < TOLERANCE, "axis {axis}: {jacobian} {slope}");
        }
    }

    /// At the borders of the picture, the radius is 500 / 300 rad, or 95 degrees: more than the lens can show.
    #[test]
    fn the_jacobian_of_a_circular_fisheye_is_the_slope_of_its_projection() {
        let (sin, cos) = 80.0f64.to_radians().sin_cos();
        assert_is_slope(&camera(300.0, Distortion::fisheye([0.0; 4])), Point3::new(2.0 * sin, 0.0, 2.0 * cos));
    }

    /// The border is at x/z = 1.5; a pinhole of the same focal length would show 0.87 there, and 1.3 times that is less
    /// than 1.45.
    #[test]
    fn the_jacobian_of_a_barrel_lens_is_the_slope_of_its_projection_up_to_the_border() {
        assert_is_slope(&camera(577.0, Distortion::opencv(-0.3, 0.05, 0.0, 0.0, 0.0)), Point3::new(1.45, 0.1, 1.0));
    }
}
