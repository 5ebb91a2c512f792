//! Guesses of the place, in the cameras' world and in the splat, of what the photos show, and of the ratio of their units.
//! With each guess only a rotation is missing from a similarity.
//!
//! If the photos show outlines (alpha, masks, a white ground), their centres and sizes give place and size in the cameras'
//! world, and the splat's surface gives them in the splat. Otherwise the cameras of a capture of a room look at something
//! that the splat shows in finer Gaussians than the rest, and that place and its size are known roughly: there are
//! several guesses around it.

use nalgebra::{Point3, Similarity3, Translation3, UnitQuaternion, Vector3};

use super::merge::area;
use super::pictures::{Blob, Reduced};
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::{nearest_to_lines, upper_median};

/// A guess of all but the rotation.
#[derive(Clone, Copy)]
pub(super) struct Anchor {
    /// The middle of what the photos show, in the cameras' world.
    pub focus: Point3<f64>,
    /// Half the width of what is compared around it, in the cameras' unit.
    pub half_width: f64,
    /// Where `focus` is in the splat.
    pub place: Point3<f64>,
    /// The radius in the splat of what the photos show.
    pub radius: f64,
    /// The splat's units in one of the cameras'.
    pub scale: f64,
}

impl Anchor {
    /// From the cameras' world to the splat's.
    pub fn similarity(&self, rotation: UnitQuaternion<f64>) -> Similarity3<f64> {
        let turned = Similarity3::from_parts(Translation3::identity(), rotation, self.scale);
        let shift = self.place - turned * self.focus;
        Similarity3::from_parts(shift.into(), rotation, self.scale)
    }
}

/// A place and a radius.
struct Extent {
    center: Point3<f64>,
    radius: f64,
}

/// Half the width of what is compared, in root mean square radii: a rod reaches to 1.7.
const WIDTH_OF_OUTLINES: f64 = 2.2;
/// By how much the sizes of outlines and of the splat's surface may differ.
const SCALES_OF_OUTLINES: [f64; 3] = [0.87, 1.0, 1.15];
/// Median distance from the focus of the splat's finest Gaussians, in units of the cameras' median distance from it: 0.31 in
/// `captures/miku_plush` and 0.34 in `tables/fit_breakfast`.
const RADIUS_PER_DISTANCE: f64 = 0.32;
const SCALES_OF_ROOMS: [f64; 6] = [0.5, 0.71, 1.0, 1.41, 2.0, 2.83];
/// Shifts of the place, in radii: in the same captures the two places are 0.6 radii apart.
const SHIFT_IN_ROOMS: f64 = 0.45;

/// All guesses; none if the cameras do not look at anything together.
pub(super) fn anchors(cloud: &Gaussians, photos: &[Reduced]) -> Vec<Anchor> {
    if let (Some(seen), Some(surface)) = (of_outlines(photos), of_surface(cloud)) {
        let anchor = |factor: f64| Anchor {
            focus: seen.center,
            half_width: WIDTH_OF_OUTLINES * seen.radius,
            place: surface.center,
            radius: surface.radius,
            scale: factor * surface.radius / seen.radius,
        };
        return SCALES_OF_OUTLINES.map(anchor).into();
    }
    let (Some(looked_at), Some(finest)) = (of_axes(photos), of_finest(cloud)) else { return Vec::new() };
    let half_width =
        looked_at.radius * upper_median(photos.iter().map(|p| half_tangent(&p.camera)).collect()).unwrap_or(0.5);
    let scale = finest.radius / (RADIUS_PER_DISTANCE * looked_at.radius);
    let anchor_at = |shift: Vector3<f64>, factor: f64| Anchor {
        focus: looked_at.center,
        half_width,
        place: finest.center + shift * finest.radius,
        radius: finest.radius,
        scale: scale * factor,
    };
    let along = |axis: usize| Vector3::ith(axis, SHIFT_IN_ROOMS);
    let shifts = (0..3).flat_map(|axis| [along(axis), -along(axis)]);
    let shifts: Vec<Vector3<f64>> = std::iter::once(Vector3::zeros()).chain(shifts).collect();
    shifts.iter().flat_map(|shift| SCALES_OF_ROOMS.map(|factor| anchor_at(*shift, factor))).collect()
}

/// Half of the shorter side of the picture at a depth of 1.
fn half_tangent(camera: &Camera) -> f64 {
    let i = &camera.intrinsics;
    (0.5 * f64::from(i.width) / i.fx).min(0.5 * f64::from(i.height) / i.fy)
}

/// Where the outlines in the photos meet, and how large they are there; `None` unless most photos have one.
fn of_outlines(photos: &[Reduced]) -> Option<Extent> {
    let seen: Vec<_> = photos.iter().filter_map(|photo| Some((&photo.camera, photo.outline.as_ref()?))).collect();
    if 2 * seen.len() <= photos.len() {
        return None;
    }
    let centers: Vec<Point3<f64>> = seen.iter().map(|(camera, _)| camera.center_in_world()).collect();
    let to_world = |(camera, blob): &(&Camera, &Blob)| {
        camera.camera_from_world.rotation.inverse() * blob.direction(camera).normalize()
    };
    let center = nearest_to_lines(&centers, &seen.iter().map(to_world).collect::<Vec<_>>())?;
    let radii = seen.iter().map(|(camera, blob)| blob.tangent(camera) * camera.point_in_camera(center).z);
    let radius = upper_median(radii.collect())?;
    // A picture shows two of the three directions in which the object extends.
    Some(Extent { center, radius: radius * 1.5_f64.sqrt() })
        .filter(|extent| extent.radius.is_normal() && extent.radius > 0.0)
}

/// Centre and root mean square radius of the splat's surface: each Gaussian counts as its area and opacity say.
fn of_surface(cloud: &Gaussians) -> Option<Extent> {
    let weights: Vec<f64> = (0..cloud.len()).map(|i| cloud.opacity(i) * area(cloud.scale(i))).collect();
    let sum: f64 = weights.iter().sum();
    let weighted = |value: &dyn Fn(usize) -> Vector3<f64>| -> Vector3<f64> {
        weights.iter().enumerate().map(|(i, weight)| value(i) * *weight).sum::<Vector3<f64>>() / sum
    };
    let center = Point3::from(weighted(&|i| cloud.center(i).coords));
    let squares = weighted(&|i| (cloud.center(i) - center).map(|side| side * side));
    Some(Extent { center, radius: squares.sum().sqrt() }).filter(|extent| extent.radius.is_normal())
}

/// Where the optical axes meet, and the cameras' median distance from there.
fn of_axes(photos: &[Reduced]) -> Option<Extent> {
    let centers: Vec<Point3<f64>> = photos.iter().map(|photo| photo.camera.center_in_world()).collect();
    let axes: Vec<Vector3<f64>> =
        photos.iter().map(|photo| photo.camera.camera_from_world.rotation.inverse() * Vector3::z()).collect();
    let center = nearest_to_lines(&centers, &axes)?;
    let radius = upper_median(centers.iter().map(|place| (place - center).norm()).collect())?;
    Some(Extent { center, radius }).filter(|extent| extent.radius > 0.0)
}

/// The median place of the Gaussians, and their median distance from there; each counts the more, the finer it is: trainers
/// put the finest where most cameras look.
fn of_finest(cloud: &Gaussians) -> Option<Extent> {
    let areas: Vec<f64> = (0..cloud.len()).map(|i| area(cloud.scale(i))).collect();
    // The very finest count no more than a quarter of all do: a Gaussian may have no width at all.
    let mut sorted = areas.clone();
    sorted.sort_by(f64::total_cmp);
    let least = sorted.get(sorted.len() / 4)?.max(f64::MIN_POSITIVE);
    let weights: Vec<f64> = areas.iter().enumerate().map(|(i, area)| cloud.opacity(i) / area.max(least)).collect();
    let median_of = |value: &dyn Fn(usize) -> f64| {
        weighted_median(weights.iter().enumerate().map(|(i, weight)| (value(i), *weight)).collect())
    };
    let along = |axis: usize| median_of(&|i| cloud.center(i)[axis]);
    let center = Point3::new(along(0)?, along(1)?, along(2)?);
    let radius = median_of(&|i| (cloud.center(i) - center).norm())?;
    Some(Extent { center, radius }).filter(|extent| extent.radius.is_normal())
}

/// The value below which half of the weight lies.
fn weighted_median(mut values: Vec<(f64, f64)>) -> Option<f64> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut below = 0.0;
    values.into_iter().find_map(|(value, weight)| {
        below += weight;
        (below >= half).then_some(value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_weight_lies_below_the_weighted_median() {
        assert_eq!(weighted_median(vec![(3.0, 1.0), (1.0, 1.0), (2.0, 1.0)]), Some(2.0));
        assert_eq!(weighted_median(vec![(3.0, 5.0), (1.0, 1.0), (2.0, 1.0)]), Some(3.0));
        assert_eq!(weighted_median(Vec::new()), None);
    }

    #[test]
    fn the_similarity_of_an_anchor_brings_its_focus_to_its_place() {
        let (focus, place) = (Point3::new(1.0, 2.0, 3.0), Point3::new(-4.0, 0.5, 0.0));
        let anchor = Anchor { focus, half_width: 1.0, place, radius: 1.0, scale: 2.5 };
        let similarity = anchor.similarity(UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0));
        assert!((similarity * focus - place).norm() < 1e-12 && similarity.scaling() == 2.5);
    }
}
