//! Things thinner than a splat is soft: wires as thick as photos show them, sheets counted once, cavities that no view
//! looks all the way into.

use std::f64::consts::PI;

use gprop::camera::Camera;
use gprop::parts::{Options, Parts, Views, parts};
use gprop::query::Form;
use gprop::units::{Estimate, MetricScale, Range, ScaleSource};
use gprop::words::progress::Progress;
use image::{GrayImage, Luma};
use nalgebra::{Point3, Vector2, Vector3};

use super::clouds::{Cloud, cameras};

const SCALE: MetricScale =
    MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance: String::new(), range: None };
/// Radius of the ring that the wire forms, and of the ball within it.
const RING: f64 = 0.8;
const BALL: f64 = 0.5;
/// Radius of the wire: three pixels.
const WIRE: f64 = 0.03;

fn measured(cloud: &Cloud, deviation: f64, forms: &[Form], eyes: &[Camera], coverage: &[Option<GrayImage>]) -> Parts {
    let options = Options { volume_cells: 200_000, ..Options::default() };
    let (gaussians, field) = (cloud.gaussians(deviation), cloud.field(forms));
    let result =
        parts(&gaussians, &field, Views { cameras: eyes, coverage }, Some(&SCALE), &options, Progress::HIDDEN).unwrap();
    result.metric().unwrap().clone()
}

/// Prints a part's volume beside the true one and returns the relative error.
fn error(volume: Estimate, truth: f64) -> f64 {
    let error = volume.mid / truth - 1.0;
    println!("{:.5} {:.5} {:.5}, true {truth:.5}: {:+.1} %", volume.low, volume.mid, volume.high, 100.0 * error);
    error
}

/// The share of each pixel that the true object covers: the distance to it is known, so a ray walks by it.
fn photo(camera: &Camera, distance: impl Fn(Point3<f64>) -> f64) -> GrayImage {
    const SAMPLES: u32 = 3;
    /// Of a ball around the origin that holds every object.
    const RADIUS: f64 = 0.9;
    let (of, eye) = (camera.intrinsics, camera.center_in_world());
    let hits = |x: f64, y: f64| {
        let sight = Vector3::new((x - of.cx) / of.fx, (y - of.cy) / of.fy, 1.0).normalize();
        let sight = camera.camera_from_world.rotation.inverse() * sight;
        let nearest = -eye.coords.dot(&sight);
        let half = (RADIUS * RADIUS - eye.coords.norm_squared() + nearest * nearest).max(0.0).sqrt();
        let mut along = nearest - half;
        while along < nearest + half {
            let left = distance(eye + sight * along);
            if left < 1e-3 {
                return true;
            }
            along += left;
        }
        false
    };
    GrayImage::from_fn(of.width, of.height, |x, y| {
        let position = |pixel: u32, sample: u32| f64::from(pixel) + (f64::from(sample) + 0.5) / f64::from(SAMPLES);
        let samples = (0..SAMPLES * SAMPLES).filter(|s| hits(position(x, s % SAMPLES), position(y, s / SAMPLES)));
        Luma([(255 * samples.count() as u32 / (SAMPLES * SAMPLES)) as u8])
    })
}

#[test]
fn a_wire_is_as_thick_as_the_photos_show_it() {
    // In the splat the wire is too thick by 40 %: its section is twice the true one.
    let mut cloud = Cloud::torus(RING, 1.4 * WIRE, 0.012);
    cloud.points.extend(Cloud::sphere(Point3::origin(), BALL, 6000, |_| 1).points);
    let eyes = cameras(4.0, 40, |_| true);
    let distance = |p: Point3<f64>| {
        let wire = (p.coords.xy().norm() - RING).hypot(p.z) - WIRE;
        wire.min(p.coords.norm() - BALL)
    };
    let photos: Vec<Option<GrayImage>> = eyes.iter().map(|eye| Some(photo(eye, distance))).collect();
    let truth = 2.0 * PI * PI * RING * WIRE * WIRE;
    let volume = |coverage: &[Option<GrayImage>]| {
        let parts = measured(&cloud, 0.0072, &[Form::Solid; 2], &eyes, coverage);
        [0, 1].map(|part: usize| parts.parts[part].volume_m3.unwrap())
    };
    let ([blurred, ball], [wire, same_ball]) = (volume(&[]), volume(&photos));
    assert!(error(blurred, truth) > 0.9, "without photos, the wire is as thick as its splat");
    assert!(error(wire, truth).abs() < 0.2);
    assert!(wire.low <= truth && truth <= wire.high, "{wire:?}");
    assert!(
        wire.high / wire.low < 0.75 * blurred.high / blurred.low,
        "an edge is known better than the splat's surface"
    );
    assert_eq!(ball, same_ball, "what is thick is measured as without photos");
}

#[test]
fn a_wire_goes_through_a_drum_as_thick_as_the_photos_show_it() {
    // In the splat the wire is too thick by 40 %; the drum is two fifths as long as the wire.
    let mut cloud = Cloud::default();
    cloud.add_cylinder(1.4 * WIRE, [-0.8, -0.3], [true, false], 0.012, 0);
    cloud.add_cylinder(1.4 * WIRE, [0.3, 0.8], [false, true], 0.012, 0);
    cloud.add_cylinder(0.4, [-0.3, 0.3], [true, true], 0.02, 1);
    cloud.points.retain(|(p, n, part)| *part == 0 || n.z.abs() < 0.5 || p.coords.xy().norm() > 1.4 * WIRE);
    let distance = |p: Point3<f64>| {
        let to_cylinder = |radius: f64, half: f64| {
            let beyond = Vector2::new(p.coords.xy().norm() - radius, p.z.abs() - half);
            beyond.sup(&Vector2::zeros()).norm() + beyond.max().min(0.0)
        };
        to_cylinder(WIRE, 0.8).min(to_cylinder(0.4, 0.3))
    };
    let eyes = cameras(4.0, 40, |_| true);
    let photos: Vec<Option<GrayImage>> = eyes.iter().map(|eye| Some(photo(eye, distance))).collect();
    let parts = measured(&cloud, 0.0072, &[Form::Solid; 2], &eyes, &photos);
    assert!(parts.notes.iter().any(|note| note.contains("through")), "{:?}", parts.notes);
    // 0.6 of its length of 1.6 is in the drum. With its carved section there, it is 2.4 times the truth. Where a thin wire meets
    // the drum, the seam is wider than the wire.
    let error = error(parts.parts[0].volume_m3.unwrap(), PI * WIRE * WIRE * 1.6);
    assert!((-0.2..0.5).contains(&error), "{error}");
}

/// The volume of bars with these centres and half sides: by carving alone, measured in the photos of `eyes` too, and the
/// true one. In the splat, each side of a bar is longer by `soft` at either end.
fn bars(bars: &[(Vector3<f64>, Vector3<f64>)], soft: f64, eyes: &[Camera]) -> (Estimate, Estimate, f64) {
    let mut cloud = Cloud::default();
    for (center, half) in bars {
        for (point, normal, part) in Cloud::cuboid(half.add_scalar(soft), 0.01).points {
            cloud.add(point + center, normal, part);
        }
    }
    let distance = |p: Point3<f64>| {
        let to_bar = |(center, half): &(Vector3<f64>, Vector3<f64>)| {
            let beyond = (p.coords - center).abs() - half;
            beyond.sup(&Vector3::zeros()).norm() + beyond.max().min(0.0)
        };
        bars.iter().map(to_bar).fold(f64::INFINITY, f64::min)
    };
    let photos: Vec<Option<GrayImage>> = eyes.iter().map(|eye| Some(photo(eye, distance))).collect();
    let volume = |coverage: &[Option<GrayImage>]| {
        measured(&cloud, 0.006, &[Form::Solid], eyes, coverage).parts[0].volume_m3.unwrap()
    };
    (volume(&[]), volume(&photos), bars.iter().map(|(_, half)| 8.0 * half.product()).sum())
}

/// Checks that the photos, and not carving, give the volume of a bar, within `most` of the truth. Returns both volumes.
fn assert_measured(half: Vector3<f64>, most: f64) -> (Estimate, Estimate) {
    let (carved, bar, truth) = bars(&[(Vector3::zeros(), half)], 0.01, &cameras(4.0, 60, |_| true));
    assert!(error(carved, truth) > 0.9, "without photos, it is as thick as its splat");
    assert!(error(bar, truth).abs() < most);
    assert!(bar.low <= truth && truth <= bar.high, "{bar:?}");
    (carved, bar)
}

#[test]
fn a_blade_is_as_thick_as_the_photos_show_its_edge() {
    // In the splat, it is twice as thick.
    let (carved, blade) = assert_measured(Vector3::new(0.8, 0.05, 0.01), 0.2);
    assert!(blade.high / blade.low < 0.75 * carved.high / carved.low, "{blade:?}, {carved:?}");
}

/// The photos must not make the volume worse.
fn assert_no_worse((carved, photographed, truth): (Estimate, Estimate, f64)) {
    let [with, without] = [photographed, carved].map(|volume| error(volume, truth).abs());
    assert!(with <= without, "{photographed:?}, {carved:?}, {truth}");
}

#[test]
fn a_strip_that_lies_flat_is_no_worse_for_views_of_its_upper_face_alone() {
    let above = cameras(4.0, 60, |n| n.z > 0.3);
    assert_no_worse(bars(&[(Vector3::zeros(), Vector3::new(0.8, 0.05, 0.01))], 0.01, &above));
}

#[test]
fn two_slats_side_by_side_are_not_one() {
    let half = Vector3::new(0.8, 0.04, 0.012);
    let all = cameras(4.0, 60, |_| true);
    assert_no_worse(bars(&[(Vector3::new(0.0, -0.06, 0.0), half), (Vector3::new(0.0, 0.06, 0.0), half)], 0.01, &all));
}

#[test]
fn a_flat_bar_is_not_round() {
    assert_measured(Vector3::new(0.8, 0.03, 0.015), 0.25);
}

/// The side of a cylinder of radius 0.6 and height 1.2, a sheet far thinner than the splat is soft.
fn tube() -> (Cloud, Form, f64) {
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.6, [-0.6, 0.6], [false, false], 0.03, 0);
    (cloud, Form::Shell { wall_thickness_m: Range::exactly(0.01) }, 2.0 * PI * 0.6 * 1.2 * 0.01)
}

#[test]
fn a_sheet_weighs_area_times_wall() {
    let (cloud, wall, truth) = tube();
    let mut rough = Cloud::default();
    for (k, (point, normal, part)) in cloud.points.iter().enumerate() {
        // Scattered over two deviations of the Gaussians on either side.
        let off = 0.02 * ((k * 7919 % 101) as f64 / 50.0 - 1.0);
        rough.add(point + normal * off, *normal, *part);
    }
    for cloud in [cloud, rough] {
        let parts = measured(&cloud, 0.018, &[wall], &cameras(4.0, 60, |_| true), &[]);
        assert!(error(parts.parts[0].volume_m3.unwrap(), truth).abs() < 0.1);
    }
}

#[test]
fn a_cavity_that_views_see_in_part_has_one_wall_around_it() {
    let (cloud, wall, truth) = tube();
    // From 6 to 33 degrees above the horizon, the views see the outside and the upper half of the inside.
    let parts = measured(&cloud, 0.018, &[wall], &cameras(4.0, 120, |n| (0.1..0.55).contains(&n.z)), &[]);
    let volume = parts.parts[0].volume_m3.unwrap();
    assert!(error(volume, truth).abs() < 0.25);
    assert!(volume.low <= truth && truth <= volume.high, "{volume:?}");
}
