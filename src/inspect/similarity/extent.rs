//! Where the object is and how large, in the world of the cameras and in that of the splat.

use nalgebra::{Matrix3, Point2, Point3, Vector3};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::inspect::verdict::Small;
use crate::numeric::{nearest_to_lines, upper_median};
use crate::scene::{Scene, SceneError};

/// A place and a size, scene units.
pub(super) struct Extent {
    pub center: Point3<f64>,
    pub radius: f64,
}

/// One thing in two worlds.
pub(super) struct Pair {
    pub of_cameras: Extent,
    pub in_splat: Extent,
    /// By how much the ratio of the two radii may be wrong.
    pub factors: &'static [f64],
    /// Whether the extents are those of outlines, which can be compared in pictures.
    pub are_outlines: bool,
}

/// Gaussians fainter than this are haze.
const LEAST_OPACITY: f64 = 0.1;
/// With an object that fills the picture, as most do, its radius is about half of the cameras' distance from it.
const RADIUS_PER_DISTANCE: f64 = 0.5;

/// What may be the same in both worlds, the surest first.
pub(super) fn pairs(scene: &Scene, cloud: &Gaussians, views: &[Small]) -> Result<Vec<Pair>, SceneError> {
    let mut pairs = Vec::new();
    if let (Some(of_cameras), Some(in_splat)) = (of_outlines(views), of_surface(cloud)) {
        pairs.push(Pair { of_cameras, in_splat, factors: &[1.0], are_outlines: true });
    }
    let points = scene.registered.read_points()?;
    if let (Some(of_cameras), Some(in_splat)) = (around_median(&points), of_centers(cloud)) {
        pairs.push(Pair { of_cameras, in_splat, factors: &[0.65, 0.8, 1.0, 1.25, 1.55], are_outlines: false });
    }
    // Without outlines and points there is only where the cameras look.
    if let (true, Some(of_cameras), Some(in_splat)) = (pairs.is_empty(), of_views(views), of_centers(cloud)) {
        pairs.push(Pair { of_cameras, in_splat, factors: &[0.35, 0.5, 0.7, 1.0, 1.4, 2.0], are_outlines: false });
    }
    Ok(pairs)
}

/// The blob of an outline: its centre and its root mean square radius in pixels.
pub(super) struct Blob {
    center: Point2<f64>,
    radius: f64,
}

impl Blob {
    /// Of a picture of weights, 0 to 1; `None` if it is empty.
    pub fn of(weights: &[f32], width: usize) -> Option<Self> {
        let pixels = || weights.iter().enumerate().map(|(at, weight)| (pixel(at, width), f64::from(*weight)));
        let sum: f64 = pixels().map(|(_, weight)| weight).sum();
        let center = pixels().map(|(pixel, weight)| pixel.coords * weight).sum::<nalgebra::Vector2<f64>>() / sum;
        let square = pixels().map(|(pixel, weight)| (pixel.coords - center).norm_squared() * weight).sum::<f64>() / sum;
        (sum >= 1.0).then(|| Self { center: center.into(), radius: square.sqrt() })
    }
}

fn pixel(at: usize, width: usize) -> Point2<f64> {
    Point2::new((at % width) as f64 + 0.5, (at / width) as f64 + 0.5)
}

/// The direction of a pixel in the camera's frame, with z = 1; without lens distortion, which moves little here.
fn direction(camera: &Camera, pixel: &Point2<f64>) -> Vector3<f64> {
    let i = &camera.intrinsics;
    Vector3::new((pixel.x - i.cx) / i.fx, (pixel.y - i.cy) / i.fy, 1.0)
}

/// Where the outlines in the photos meet, and how large they are there; `None` if photos have no outlines.
fn of_outlines(views: &[Small]) -> Option<Extent> {
    let seen: Vec<(&Camera, Blob)> = views
        .iter()
        .filter_map(|view| {
            Some((&view.camera, Blob::of(view.outline.as_deref()?, view.camera.intrinsics.width as usize)?))
        })
        .collect();
    let centers: Vec<Point3<f64>> = seen.iter().map(|(camera, _)| camera.center_in_world()).collect();
    let rays: Vec<Vector3<f64>> = seen
        .iter()
        .map(|(camera, blob)| camera.camera_from_world.rotation.inverse() * direction(camera, &blob.center).normalize())
        .collect();
    let center = nearest_to_lines(&centers, &rays)?;
    let radius =
        |(camera, blob): &(&Camera, Blob)| blob.radius / camera.intrinsics.fx * camera.point_in_camera(center).z;
    let seen_radius = upper_median(seen.iter().map(radius).collect())?;
    // A picture shows two of the three directions in which the object extends.
    Some(Extent { center, radius: seen_radius * 1.5_f64.sqrt() }).filter(|extent| extent.radius > 0.0)
}

/// Centre and root mean square radius of the splat's surface: each Gaussian counts as its area and opacity say.
fn of_surface(cloud: &Gaussians) -> Option<Extent> {
    let weight = |i: usize| {
        let mut sides: [f64; 3] = cloud.scale(i).into();
        sides.sort_by(f64::total_cmp);
        cloud.opacity(i) * sides[1] * sides[2]
    };
    let weights: Vec<f64> = (0..cloud.len()).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    let weighted = |value: &dyn Fn(usize) -> Vector3<f64>| -> Vector3<f64> {
        weights.iter().enumerate().map(|(i, weight)| value(i) * *weight).sum::<Vector3<f64>>() / sum
    };
    let center = Point3::from(weighted(&|i| cloud.center(i).coords));
    let squares = weighted(&|i| (cloud.center(i) - center).map(|side| side * side));
    Some(Extent { center, radius: squares.sum().sqrt() }).filter(|extent| extent.radius.is_normal())
}

/// The median along each axis, and the median distance from it.
fn around_median(points: &[Point3<f64>]) -> Option<Extent> {
    let along = |axis: usize| upper_median(points.iter().map(|point| point[axis]).collect());
    let center = Point3::new(along(0)?, along(1)?, along(2)?);
    let radius = upper_median(points.iter().map(|point| (point - center).norm()).collect())?;
    Some(Extent { center, radius }).filter(|extent| extent.radius > 0.0)
}

fn of_centers(cloud: &Gaussians) -> Option<Extent> {
    let opaque = (0..cloud.len()).filter(|i| cloud.opacity(*i) >= LEAST_OPACITY);
    around_median(&opaque.map(|i| cloud.center(i)).collect::<Vec<_>>())
}

/// Where the optical axes meet, and what an object there fills of the pictures.
fn of_views(views: &[Small]) -> Option<Extent> {
    let centers: Vec<Point3<f64>> = views.iter().map(|view| view.camera.center_in_world()).collect();
    let axes: Vec<Vector3<f64>> =
        views.iter().map(|view| view.camera.camera_from_world.rotation.inverse() * Vector3::z()).collect();
    let center = nearest_to_lines(&centers, &axes)?;
    let distance = upper_median(centers.iter().map(|place| (place - center).norm()).collect())?;
    Some(Extent { center, radius: RADIUS_PER_DISTANCE * distance }).filter(|extent| extent.radius > 0.0)
}

/// How far the splat's outlines are from the photos', collected over views.
#[derive(Default)]
pub(super) struct Offsets {
    across: Matrix3<f64>,
    shift: Vector3<f64>,
    factors: Vec<f64>,
}

impl Offsets {
    /// Adds a view: `camera` sees the object, whose centre is at `center`, as `drawn`, and is to see it as `photo`.
    pub fn add(&mut self, camera: &Camera, center: Point3<f64>, photo: &Blob, drawn: &Blob) {
        let depth = camera.point_in_camera(center).z;
        if depth <= 0.0 || drawn.radius <= 0.0 {
            return;
        }
        let offset = (direction(camera, &photo.center) - direction(camera, &drawn.center)) * depth;
        let to_world = camera.camera_from_world.rotation.inverse();
        let axis = to_world * Vector3::z();
        self.across += Matrix3::identity() - axis * axis.transpose();
        self.shift += to_world * offset;
        self.factors.push(photo.radius / drawn.radius);
    }

    /// The shift in the splat's world and the factor of its apparent size that bring its outlines over the photos'.
    pub fn shift_and_factor(self) -> Option<(Vector3<f64>, f64)> {
        let factor = upper_median(self.factors)?;
        Some((self.across.try_inverse()? * self.shift, factor)).filter(|(_, factor)| factor.is_normal())
    }
}
