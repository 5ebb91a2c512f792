//! Draws the best places on the splat: the whole object with the places numbered, and the best one in close-up with its
//! forces. Fingers are drawn like the splat, as small flat Gaussians over their faces, so that the object hides them
//! where it is in front of them.

use image::RgbImage;
use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector3};

use super::candidates::Candidate;
use super::fingers::{FINGER_LENGTH_M, FINGER_THICKNESS_M, OrientedBox, PALM_M, hand};
use super::{GraspReport, Limit};
use crate::camera::{Camera, Distortion, Intrinsics};
use crate::gaussians::{Gaussians, SH_C0, wxyz};
use crate::lettering::Style;
use crate::pictures::panels::{Entry, Key, Panel, compose};
use crate::pictures::{palette, strokes};
use crate::render::{RenderOptions, render, render_labels};
use crate::scene::robust_bounds;
use crate::words::part_name::part_name;
use crate::words::readable::significant;

/// Gaussians along a finger's side.
const PER_SIDE: f64 = 8.0;
/// They are no closer together than this, m: fingers are 40 mm long, however narrow.
const LEAST_SPACING_M: f64 = 5e-4;
/// Half side of the mark of a place other than the best, as a fraction of the finger's.
const MARK: f64 = 0.25;

/// Longest side of a panel, px, and of the pictures that measure how much of the hand a camera sees.
const SIDE_PX: u32 = 640;
const LOOK_PX: u32 = 96;
/// Least width of the region that the close-up shows around the hand, in hand lengths.
const SHOWN: f64 = 2.4;
/// Share of the close-up between the tails of the arrows, beyond which their labels stand.
const BETWEEN_LABELS: f64 = 0.7;
/// Share of a panel that the whole object fills.
const FILLED: f64 = 0.9;
/// The shorter side of a panel of the whole object is at least this share of the longer one.
const NARROWEST: f64 = 0.6;
/// Length of a force's arrow, m.
const ARROW_M: f64 = 0.03;
const ARROW_PX: f64 = 5.0;
/// An arrow shorter than this is of no use: the camera looks along it.
const SHORTEST_ARROW_PX: f64 = 14.0;
const LABEL_PX: u32 = 20;
/// Radius of a place's number.
const NUMBER_PX: f64 = 13.0;

/// Draws the cloud with the hand at the first candidate and a mark at both contacts of each other candidate, as the
/// camera that sees most of the hand sees it. `None` if there is no candidate or no camera.
pub fn picture(
    gaussians: &Gaussians,
    cameras: &[Camera],
    report: &GraspReport,
    finger_side_m: f64,
    meters_per_unit: f64,
) -> Option<RgbImage> {
    let best = report.candidates.first()?;
    let mut drawn = gaussians.clone();
    let spacing = spacing_m(finger_side_m);
    for (rank, candidate) in report.candidates.iter().enumerate() {
        let contacts = candidate.contacts_m.map(Point3::from);
        let approach = Vector3::from(candidate.approach);
        let shapes = if rank == 0 {
            hand(contacts, approach, finger_side_m, 0.0).to_vec()
        } else {
            contacts.iter().map(|contact| mark(*contact, 0.5 * MARK * finger_side_m)).collect()
        };
        for shape in shapes {
            drawn.append(&faces(&shape, spacing, palette::place(rank), gaussians.sh_degree, meters_per_unit));
        }
    }
    let camera = sees_most(cameras, &drawn, gaussians.len(), best, meters_per_unit)?;
    let whole = whole(camera, &drawn, gaussians.len());
    let near = close_by(camera, best, meters_per_unit, SIDE_PX);
    let scene = Scene { drawn: &drawn, meters_per_unit, report };
    Some(compose(&[scene.places(&whole), scene.forces(&near, best)]))
}

struct Scene<'a> {
    drawn: &'a Gaussians,
    meters_per_unit: f64,
    report: &'a GraspReport,
}

impl Scene<'_> {
    /// The whole object, each place with its number.
    fn places(&self, camera: &Camera) -> Panel {
        let mut picture = self.rendered(camera, self.report.candidates[0].contacts_m[0]);
        let mut taken: Vec<Point2<f64>> = Vec::new();
        let candidates = || (0..).zip(&self.report.candidates);
        for (rank, candidate) in candidates() {
            let contacts = candidate.contacts_m.map(|contact| self.pixel(camera, Point3::from(contact)));
            let Some((_, nearer)) = contacts.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
            let place = beside(nearer, &taken, picture.dimensions());
            strokes::numbered(&mut picture, place, NUMBER_PX, color(rank), rank as u32 + 1);
            taken.push(place);
        }
        let entry = |(rank, candidate): (usize, &Candidate)| Entry {
            text: format!(
                "{}: {}, {:.0} mm wide{}",
                part_name(&candidate.part, &candidate.material),
                newtons(candidate.force_n),
                1e3 * candidate.width_m,
                if candidate.feasible { "" } else { ", not safe" },
            ),
            key: Key::Number(color(rank), rank as u32 + 1),
        };
        Panel::new("Places to grasp", picture).with_legend(candidates().map(entry).collect())
    }

    /// The best place with the forces of the fingers.
    fn forces(&self, camera: &Camera, best: &Candidate) -> Panel {
        let report = self.report;
        let mut picture = self.rendered(camera, best.contacts_m[0]);
        let contacts = best.contacts_m.map(Point3::from);
        for (contact, other) in [(contacts[0], contacts[1]), (contacts[1], contacts[0])] {
            let outward = (contact - other).normalize();
            let ends = [FINGER_THICKNESS_M + ARROW_M, FINGER_THICKNESS_M]
                .map(|out| self.pixel(camera, contact + outward * out).map(|(_, pixel)| pixel));
            if let [Some(from), Some(tip)] = ends
                && (tip - from).norm() >= SHORTEST_ARROW_PX
            {
                strokes::arrow(&mut picture, from, tip, ARROW_PX, color(0));
                let (style, text) = (Style::semibold(LABEL_PX), newtons(report.force_n));
                let (along, size) = ((from - tip).normalize(), [style.width(&text), style.height()].map(f64::from));
                let away = 0.5 * (along.x.abs() * size[0] + along.y.abs() * size[1]) + 2.0 * ARROW_PX;
                strokes::centered(&mut picture, style, &text, from + along * away);
            }
        }
        let damage = match report.f_max_limited_by {
            Limit::Yield => "the part yields",
            Limit::Bending => "the part bends too far",
            Limit::Slip | Limit::Gripper | Limit::Safety => "the part is damaged",
        };
        let mut lines = vec![
            format!("{}: press with this, command {}", newtons(report.force_n), significant(report.force_command)),
            format!("F_min {}: with less, the object slips", newtons(report.f_min_n)),
            format!("F_max {}: with more, {damage}", newtons(report.f_max_n)),
            format!("F* {}: the paper's choice", newtons(report.f_star_n)),
        ];
        if let Some(why) = &report.infeasible {
            lines[0] = format!("{}: for comparison only", newtons(report.force_n));
            lines.extend(Style::regular(LABEL_PX).wrapped(&format!("Not safe: {why}"), picture.width()));
        }
        let legend = lines.into_iter().map(|text| Entry { text, key: Key::None }).collect();
        Panel::new(&format!("Place 1: force of each finger (gripper: {})", report.gripper), picture).with_legend(legend)
    }

    /// The cloud with a scale bar for the depth of a point in metres.
    fn rendered(&self, camera: &Camera, at_m: [f64; 3]) -> RgbImage {
        let picture = render(self.drawn, camera, &RenderOptions::default()).to_image([1.0; 3]);
        let mut picture = image::DynamicImage::ImageRgba8(picture).into_rgb8();
        if let Some((depth, _)) = self.pixel(camera, Point3::from(at_m)) {
            strokes::scale_bar(&mut picture, camera.intrinsics.fx / (depth * self.meters_per_unit));
        }
        picture
    }

    /// Depth in scene units and pixel of a point in metres.
    fn pixel(&self, camera: &Camera, point_m: Point3<f64>) -> Option<(f64, Point2<f64>)> {
        let in_camera = camera.point_in_camera(point_m / self.meters_per_unit);
        Some((in_camera.z, camera.pixel(in_camera)?))
    }
}

fn color(rank: usize) -> image::Rgb<u8> {
    palette::bytes(palette::place(rank))
}

fn newtons(force: f64) -> String {
    match force {
        ..100.0 => format!("{force:.1} N"),
        ..1000.0 => format!("{force:.0} N"),
        _ => format!("{} N", significant(force)),
    }
}

/// A point near `at`, inside a picture of this size, for a number that covers none of those already there.
fn beside(at: Point2<f64>, taken: &[Point2<f64>], (width, height): (u32, u32)) -> Point2<f64> {
    let apart = 2.2 * NUMBER_PX;
    let inside = |value: f64, size: u32| value.clamp(apart, (f64::from(size) - apart).max(apart));
    let candidate = |n: u32| {
        // A spiral of steps around the point.
        let (sin, cos) = (f64::from(n) * 2.4).sin_cos();
        let out = apart * (0.6 + 0.25 * f64::from(n));
        Point2::new(inside(at.x + out * cos, width), inside(at.y + out * sin, height))
    };
    let free = |place: &Point2<f64>| taken.iter().all(|other| (place - other).norm() >= apart);
    (0..60).map(candidate).find(free).unwrap_or_else(|| candidate(0))
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

/// The camera, rotated and zoomed to the whole object and the Gaussians from index `hand` on: same position.
fn whole(camera: &Camera, drawn: &Gaussians, hand: usize) -> Camera {
    /// A Gaussian farther outside the robust bounds than this share of their size is a stray.
    const BEYOND: f64 = 0.15;
    let bounds = robust_bounds(drawn);
    let margin = bounds.size() * BEYOND;
    let (low, high) = (bounds.min - margin, bounds.max + margin);
    let belongs = |i: &usize| {
        let at = drawn.center(*i);
        *i >= hand || drawn.opacity_logits[*i] >= 0.0 && (0..3).all(|a| low[a] <= at[a] && at[a] <= high[a])
    };
    let points: Vec<Point3<f64>> = (0..drawn.len()).filter(belongs).map(|i| drawn.center(i)).collect();
    let turned = towards(camera, bounds.center());
    let seen: Vec<[f64; 2]> = points
        .iter()
        .map(|point| turned * point)
        .filter(|point| point.z > 0.0)
        .map(|point| [point.x / point.z, point.y / point.z])
        .collect();
    let range = |axis: usize| {
        let values = seen.iter().map(|point| point[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let (x, y) = (range(0), range(1));
    let (wide, high) = (x.1 - x.0, y.1 - y.0);
    let longest = wide.max(high).max(1e-9);
    let side = |length: f64| (f64::from(SIDE_PX) * (length / longest).max(NARROWEST)).round();
    let (width, height) = (side(wide), side(high));
    let focal = FILLED * f64::from(SIDE_PX) / longest;
    let intrinsics = Intrinsics {
        width: width as u32,
        height: height as u32,
        fx: focal,
        fy: focal,
        cx: 0.5 * width - focal * 0.5 * (x.0 + x.1),
        cy: 0.5 * height - focal * 0.5 * (y.0 + y.1),
        distortion: Distortion::default(),
    };
    Camera { intrinsics, camera_from_world: turned }
}

/// The pose of the camera rotated to look at `target`. The camera's own up direction stays, so that an upright picture
/// stays upright.
fn towards(camera: &Camera, target: Point3<f64>) -> Isometry3<f64> {
    let down = camera.camera_from_world.rotation.inverse() * Vector3::y();
    Isometry3::face_towards(&camera.center_in_world(), &target, &down).inverse()
}

/// The camera, rotated and zoomed to the hand: same position, a square picture of `side` px.
fn close_by(camera: &Camera, best: &Candidate, meters_per_unit: f64, side: u32) -> Camera {
    let contacts = best.contacts_m.map(Point3::from);
    let middle = nalgebra::center(&contacts[0], &contacts[1]) + Vector3::from(best.approach) * (0.5 * FINGER_LENGTH_M);
    let (eye, target) = (camera.center_in_world(), middle / meters_per_unit);
    let across_m = best.width_m + 2.0 * (FINGER_THICKNESS_M + ARROW_M);
    let shown = (across_m / BETWEEN_LABELS).max(SHOWN * (FINGER_LENGTH_M + PALM_M)) / meters_per_unit;
    let focal = f64::from(side) * (target - eye).norm() / shown;
    let half = 0.5 * f64::from(side);
    let distortion = Distortion::default();
    let intrinsics = Intrinsics { width: side, height: side, fx: focal, fy: focal, cx: half, cy: half, distortion };
    Camera { intrinsics, camera_from_world: towards(camera, target) }
}

/// Distance between the Gaussians that draw a hand, m.
fn spacing_m(finger_side_m: f64) -> f64 {
    (finger_side_m / PER_SIDE).max(LEAST_SPACING_M)
}

fn mark(center: Point3<f64>, half: f64) -> OrientedBox {
    OrientedBox { center, axes: [Vector3::x(), Vector3::y(), Vector3::z()], half: [half; 3] }
}

/// The six faces of a box in metres as flat Gaussians in scene units, shaded by their orientation.
fn faces(shape: &OrientedBox, spacing: f64, color: [f32; 3], sh_degree: u8, meters_per_unit: f64) -> Gaussians {
    /// Opacity 0.99.
    const LOGIT: f32 = 4.6;
    // A picture shows no more Gaussians along a side than it has pixels.
    let longest = shape.half.iter().fold(0.0_f64, |longest, half| longest.max(2.0 * half));
    let spacing = spacing.max(longest / f64::from(SIDE_PX));
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
                let offset_along = |k: usize, count: usize, side: usize| {
                    shape.axes[side] * shape.half[side] * (2.0 * (k as f64 + 0.5) / count as f64 - 1.0)
                };
                let place = shape.center
                    + normal * shape.half[axis]
                    + offset_along(i, counts[0], u)
                    + offset_along(j, counts[1], v);
                gaussians.positions.push((place / meters_per_unit).coords.map(|c| c as f32).into());
                gaussians.log_scales.push([log(0.7 * spacing), log(0.7 * spacing), log(0.1 * spacing)]);
                gaussians.rotations.push(wxyz(&turn));
                gaussians.opacity_logits.push(LOGIT);
                gaussians.sh_dc.push(color.map(|c| (c * light as f32 - 0.5) / SH_C0));
            }
        }
    }
    gaussians.sh_rest = vec![0.0; gaussians.len() * 3 * gaussians.sh_rest_per_channel()];
    gaussians
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_with_tiny_fingers_is_drawn_with_few_gaussians() {
        // Of a square millimetre, the least area of a profile, around an object of 200 mm.
        let (side, contacts) = (1e-3, [Point3::origin(), Point3::new(0.2, 0.0, 0.0)]);
        let hand = hand(contacts, Vector3::z(), side, 0.0);
        let count: usize = hand.iter().map(|part| faces(part, spacing_m(side), [0.0; 3], 0, 1.0).len()).sum();
        // The faces of the fingers and the palm have 110 cm2: 4 Gaussians for each mm2.
        assert!(count < 60_000, "{count}");
    }

    #[test]
    fn a_hand_around_a_huge_object_is_drawn_with_few_gaussians() {
        // A palm of 200 m, with fingers of 20 mm: the scene is in millimetres, and was taken to be in metres.
        let (side, contacts) = (0.02, [Point3::origin(), Point3::new(200.0, 0.0, 0.0)]);
        let [.., palm] = hand(contacts, Vector3::z(), side, 0.0);
        let drawn = faces(&palm, spacing_m(side), [0.0; 3], 0, 1.0);
        // One for each of 640 pixels on four faces, and one at either end.
        assert!((2560..3000).contains(&drawn.len()), "{}", drawn.len());
        let end = |farther: fn(f32, f32) -> f32, from: f32| drawn.positions.iter().map(|p| p[0]).fold(from, farther);
        assert!(end(f32::min, f32::INFINITY) < 0.2 && end(f32::max, f32::NEG_INFINITY) > 199.8, "the whole palm");
    }
}
