//! Draws the best places on the splat. Fingers are drawn like the splat, as small flat Gaussians over their faces, so
//! that the object hides them where it is in front of them.

use image::RgbImage;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::candidates::Candidate;
use super::fingers::{FINGER_LENGTH_M, OrientedBox, PALM_M, hand};
use crate::camera::{Camera, Distortion, Intrinsics};
use crate::pictures::palette;
use crate::render::{RenderOptions, render, render_labels};
use crate::scene::gaussians::{Gaussians, SH_C0};

/// Gaussians along a finger's side.
const PER_SIDE: f64 = 8.0;
/// Half side of the mark of a place other than the best, as a fraction of the finger's.
const MARK: f64 = 0.25;

/// Side of the picture, px, and of the pictures that measure how much of the hand a camera sees.
const SIDE_PX: u32 = 640;
const LOOK_PX: u32 = 96;
/// Width of the region that the picture shows around the hand, in hand lengths.
const SHOWN: f64 = 5.0;

/// Draws the cloud with the hand at the first candidate and a mark at both contacts of each other candidate, in
/// close-up, from the camera that sees most of the hand. `None` if there is no candidate or no camera.
pub fn picture(
    gaussians: &Gaussians,
    cameras: &[Camera],
    candidates: &[Candidate],
    finger_side_m: f64,
    meters_per_unit: f64,
) -> Option<RgbImage> {
    let best = candidates.first()?;
    let mut drawn = gaussians.clone();
    let spacing = finger_side_m / PER_SIDE;
    for (rank, candidate) in candidates.iter().enumerate() {
        let contacts = candidate.contacts_m.map(Point3::from);
        let approach = Vector3::from(candidate.approach);
        let shapes = if rank == 0 {
            hand(contacts, approach, finger_side_m, 0.0).to_vec()
        } else {
            contacts.iter().map(|contact| mark(*contact, 0.5 * MARK * finger_side_m)).collect()
        };
        for shape in shapes {
            drawn.append(&faces(&shape, spacing, palette::color(rank as u32), gaussians.sh_degree, meters_per_unit));
        }
    }
    let camera = sees_most(cameras, &drawn, gaussians.len(), best, meters_per_unit)?;
    let camera = close_by(camera, best, meters_per_unit, SIDE_PX);
    let picture = render(&drawn, &camera, &RenderOptions::default()).to_image([1.0; 3]);
    Some(image::DynamicImage::ImageRgba8(picture).into_rgb8())
}

/// The camera in whose picture the Gaussians from index `hand` on cover the most pixels.
fn sees_most<'a>(
    cameras: &'a [Camera],
    drawn: &Gaussians,
    hand: usize,
    best: &Candidate,
    meters_per_unit: f64,
) -> Option<&'a Camera> {
    let labels: Vec<u32> = (0..drawn.len()).map(|i| u32::from(i >= hand)).collect();
    let seen = |camera: &&Camera| {
        let near = close_by(camera, best, meters_per_unit, LOOK_PX);
        let pixels = render_labels(drawn, &near, &labels, &RenderOptions::default());
        pixels.into_iter().filter(|label| *label == Some(1)).count()
    };
    // Among equals, the first.
    cameras.iter().rev().max_by_key(seen)
}

/// The camera, rotated and zoomed to the hand: same position, a square picture of `side` px.
fn close_by(camera: &Camera, best: &Candidate, meters_per_unit: f64, side: u32) -> Camera {
    let contacts = best.contacts_m.map(Point3::from);
    let middle = nalgebra::center(&contacts[0], &contacts[1]) + Vector3::from(best.approach) * (0.5 * FINGER_LENGTH_M);
    let (eye, target) = (camera.center_in_world(), middle / meters_per_unit);
    let shown = SHOWN * (FINGER_LENGTH_M + PALM_M).max(best.width_m) / meters_per_unit;
    let focal = f64::from(side) * (target - eye).norm() / shown;
    let half = 0.5 * f64::from(side);
    let distortion = Distortion::default();
    let intrinsics = Intrinsics { width: side, height: side, fx: focal, fy: focal, cx: half, cy: half, distortion };
    // The camera's own up direction, so that an upright picture stays upright.
    let down = camera.camera_from_world.rotation.inverse() * Vector3::y();
    Camera { intrinsics, camera_from_world: Isometry3::face_towards(&eye, &target, &down).inverse() }
}

fn mark(center: Point3<f64>, half: f64) -> OrientedBox {
    OrientedBox { center, axes: [Vector3::x(), Vector3::y(), Vector3::z()], half: [half; 3] }
}

/// The six faces of a box in metres as flat Gaussians in scene units, shaded by their orientation.
fn faces(shape: &OrientedBox, spacing: f64, color: [f32; 3], sh_degree: u8, meters_per_unit: f64) -> Gaussians {
    /// Opacity 0.99.
    const LOGIT: f32 = 4.6;
    let mut gaussians = Gaussians { sh_degree, ..Gaussians::default() };
    let log = |m: f64| (m / meters_per_unit).ln() as f32;
    for axis in 0..3 {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let counts = [u, v].map(|side| (2.0 * shape.half[side] / spacing).ceil().max(1.0) as usize);
        for sign in [-1.0, 1.0] {
            let normal = shape.axes[axis] * sign;
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &normal)
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            let light = 0.75 + 0.25 * normal.dot(&Vector3::new(0.3, 0.5, 0.8).normalize());
            for (i, j) in (0..counts[0]).flat_map(|i| (0..counts[1]).map(move |j| (i, j))) {
                let at = |k: usize, count: usize, side: usize| {
                    shape.axes[side] * shape.half[side] * (2.0 * (k as f64 + 0.5) / count as f64 - 1.0)
                };
                let place = shape.center + normal * shape.half[axis] + at(i, counts[0], u) + at(j, counts[1], v);
                gaussians.positions.push((place / meters_per_unit).coords.map(|c| c as f32).into());
                gaussians.log_scales.push([log(0.7 * spacing), log(0.7 * spacing), log(0.1 * spacing)]);
                let q = turn.quaternion();
                gaussians.rotations.push([q.w, q.i, q.j, q.k].map(|c| c as f32));
                gaussians.opacity_logits.push(LOGIT);
                gaussians.sh_dc.push(color.map(|c| (c * light as f32 - 0.5) / SH_C0));
            }
        }
    }
    gaussians.sh_rest = vec![0.0; gaussians.len() * 3 * gaussians.sh_rest_per_channel()];
    gaussians
}
