//! Volumes that no photo shows: rods in sleeves and drums, hollow bases, undersides of tables.

use std::f64::consts::PI;

use gprop::camera::Camera;
use gprop::parts::{BodiesAs, Known, Options, Parts, parts};
use gprop::query::Form;
use gprop::units::{MetricScale, Range, ScaleSource};
use gprop::words::progress::Progress;
use nalgebra::{Point3, Vector3};

use super::clouds::{Cloud, cameras, label, possible};

const SCALE: MetricScale =
    MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance: String::new(), range: None };
/// Spacing of the Gaussians along the surfaces on which they lie.
const SPACING: f64 = 0.03;

fn measured(cloud: &Cloud, forms: &[Form], from: impl Fn(&Vector3<f64>) -> bool) -> Parts {
    measured_as(BodiesAs::OnePart, cloud, forms, from)
}

fn measured_as(bodies: BodiesAs, cloud: &Cloud, forms: &[Form], from: impl Fn(&Vector3<f64>) -> bool) -> Parts {
    let options = Options { bodies, ..few_cells() };
    known_of(cloud, forms, Some(&SCALE).into(), &options, from)
}

fn few_cells() -> Options {
    Options { volume_cells: 200_000, ..Options::default() }
}

fn known_of(
    cloud: &Cloud,
    forms: &[Form],
    known: Known,
    options: &Options,
    from: impl Fn(&Vector3<f64>) -> bool,
) -> Parts {
    let (gaussians, field) = (cloud.gaussians(0.6 * SPACING), cloud.field(forms));
    let result = parts(&gaussians, &field, &cameras(4.0, 60, from), known, options, Progress::HIDDEN).unwrap();
    result.metric().unwrap().clone()
}

fn wall(thickness_m: f64) -> Form {
    Form::Shell { wall_thickness_m: Range::exactly(thickness_m) }
}

/// Prints a part's volume beside the true one and returns the relative error.
fn error(parts: &Parts, part: usize, truth: f64) -> f64 {
    let volume = parts.parts[part].volume_m3.unwrap();
    let error = volume.mid / truth - 1.0;
    println!(
        "part {part}: {:.4} {:.4} {:.4}, true {truth:.4}: {:+.1} %",
        volume.low,
        volume.mid,
        volume.high,
        100.0 * error
    );
    error
}

fn holds(parts: &Parts, part: usize, truth: f64) -> bool {
    let volume = parts.parts[part].volume_m3.unwrap();
    volume.low <= truth && truth <= volume.high
}

/// A rod of radius 0.2 from z = -1 to 1 with a sleeve of radius 0.28 around its lower half, closed at the bottom.
fn rod_in_sleeve() -> Cloud {
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.2, [0.0, 1.0], [false, true], SPACING, 0);
    cloud.add_cylinder(0.28, [-1.08, 0.0], [true, true], SPACING, 1);
    cloud.points.retain(|(p, _, part)| *part == 0 || p.z < -0.01 || p.coords.xy().norm() > 0.2);
    cloud
}

#[test]
fn a_rod_goes_on_in_its_sleeve() {
    let parts = measured(&rod_in_sleeve(), &[Form::Solid, wall(0.08)], |_| true);
    assert!(parts.notes.iter().any(|w| w.contains("inside")), "{:?}", parts.notes);
    let (rod, sleeve) = (PI * 0.04 * 2.0, PI * (0.28f64.powi(2) * 1.08 - 0.04));
    assert!(error(&parts, 0, rod).abs() < 0.15);
    assert!(error(&parts, 1, sleeve).abs() < 0.15);
}

/// In the first choices of both, the rod goes on in the sleeve; in the one state that is possible, the sleeve is solid.
#[test]
fn a_state_weighs_what_an_object_of_its_forms_weighs() {
    let forms = [Form::Solid, Form::Solid];
    let sleeve = vec![(label(1, wall(0.08)), 0.0), (label(1, forms[1]), 1.0)];
    let possible = possible(Range::new(1.0, 1e4), vec![vec![(label(0, forms[0]), 1.0)], sleeve]);
    let known = Known { scale: Some(&SCALE), possible: Some(&possible) };
    let believed = known_of(&rod_in_sleeve(), &forms, known, &few_cells(), |_| true).belief.unwrap();
    let sure = measured(&rod_in_sleeve(), &forms, |_| true).object.mass_kg;
    assert!((believed.shape_kg.mid / sure.mid - 1.0).abs() < 0.005, "{:?}, {sure:?}", believed.shape_kg);
}

/// The sleeve's wall fills a fifteenth of each of its cells, so the rod takes all of them; the sleeve weighs all the same.
#[test]
fn a_sleeve_thinner_than_a_cell_has_a_center_and_an_inertia() {
    let parts = measured(&rod_in_sleeve(), &[Form::Solid, wall(0.001)], |_| true);
    let sleeve = &parts.parts[1];
    let center = sleeve.center_of_mass_m.expect("it has a mass, so it has a center");
    // The middle of the wall, which includes the bottom.
    assert!(center[0].hypot(center[1]) < 0.02 && (-0.7..-0.5).contains(&center[2]), "{center:?}");
    assert_eq!(sleeve.bodies.len(), 1);
    let about_axis = sleeve.inertia_kg_m2.unwrap()[2][2] / sleeve.mass_kg.unwrap().mid;
    // Side and bottom: m r^2 and m r^2 / 2.
    let (side, bottom) = (2.0 * 0.28 * 1.08, 0.28f64.powi(2));
    let expected = 0.28f64.powi(2) * (side + bottom / 2.0) / (side + bottom);
    println!("I / m {about_axis:.4}, true {expected:.4}");
    // A cell is 0.015 wide: its outer half lies beyond the surface.
    assert!((about_axis / expected - 1.0).abs() < 0.12);
}

#[test]
fn a_rod_goes_through_a_drum() {
    // A drum of radius 0.6 from z = -0.3 to 0.3 on a rod of radius 0.2 that sticks out at both ends.
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.2, [-1.0, -0.3], [true, false], SPACING, 0);
    cloud.add_cylinder(0.2, [0.3, 1.0], [false, true], SPACING, 0);
    cloud.add_cylinder(0.6, [-0.3, 0.3], [true, true], SPACING, 1);
    cloud.points.retain(|(p, n, part)| *part == 0 || n.z.abs() < 0.5 || p.coords.xy().norm() > 0.2);
    let parts = measured(&cloud, &[Form::Solid; 2], |_| true);
    assert!(parts.notes.iter().any(|w| w.contains("through")), "{:?}", parts.notes);
    let (rod, drum) = (PI * 0.04 * 2.0, PI * (0.36 - 0.04) * 0.6);
    assert!(error(&parts, 0, rod).abs() < 0.15);
    assert!(error(&parts, 1, drum).abs() < 0.15);
}

/// Its heads touch the bar at both ends, in line, but do not surround it.
#[test]
fn heads_do_not_go_through_the_bar_between_them() {
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.2, [-0.6, 0.6], [false, false], SPACING, 0);
    for (low, high) in [(-1.0, -0.6), (0.6, 1.0)] {
        cloud.add_cylinder(0.35, [low, high], [true, true], SPACING, 1);
    }
    cloud.points.retain(|(p, n, part)| *part == 0 || n.z.abs() < 0.5 || p.z.abs() > 0.9 || p.coords.xy().norm() > 0.2);
    let parts = measured(&cloud, &[Form::Solid; 2], |_| true);
    assert!(!parts.notes.iter().any(|w| w.contains("through")), "{:?}", parts.notes);
    let (bar, heads) = (PI * 0.04 * 1.2, 2.0 * PI * 0.35f64.powi(2) * 0.4);
    assert!(error(&parts, 0, bar).abs() < 0.15);
    assert!(error(&parts, 1, heads).abs() < 0.15);
}

/// Two legs of one solid, each with a grip of the same part, like those of pliers.
fn two_rods_in_two_sleeves() -> Cloud {
    let mut cloud = Cloud::default();
    for at in [Vector3::new(-0.5, 0.0, 0.0), Vector3::new(0.5, 0.0, 0.0)] {
        for (point, normal, part) in rod_in_sleeve().points {
            cloud.add(point + at, normal, part);
        }
    }
    cloud
}

/// The sleeves are so thin that the rods take all of their cells, but their surface, which is nearer to the centre of mass,
/// is not that of the rods.
#[test]
fn a_rod_is_as_near_to_the_center_as_its_own_surface_is() {
    let distance = |bodies| {
        let parts = measured_as(bodies, &two_rods_in_two_sleeves(), &[Form::Solid, wall(0.001)], |_| true);
        parts.part(0).unwrap().surface_to_center_of_mass_m.unwrap()
    };
    let (whole, in_bodies) = (distance(BodiesAs::OnePart), distance(BodiesAs::Parts));
    // As thick as the sleeves below, the rods have their centre of mass at z = -0.21: 0.22 from the sleeves, and 0.36 from
    // the rods' own surface, which begins above. A cell is 0.02 wide.
    assert!((whole - 0.36).abs() < 0.05 && (whole - in_bodies).abs() < 0.02, "{whole}, {in_bodies}");
}

#[test]
fn two_rods_go_on_in_two_sleeves_of_one_part() {
    let parts = measured(&two_rods_in_two_sleeves(), &[Form::Solid, wall(0.08)], |_| true);
    let notes: Vec<_> = parts.notes.iter().filter(|w| w.contains("continue inside")).collect();
    assert_eq!(notes.len(), 1, "{:?}", parts.notes);
    assert!(error(&parts, 0, 2.0 * PI * 0.04 * 2.0).abs() < 0.15);
}

#[test]
fn a_thin_stem_does_not_fill_the_hollow_base_under_it() {
    // A closed base of radius 0.6 with walls of 0.05, and a solid stem of radius 0.12 on it.
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.12, [0.0, 1.0], [false, true], SPACING, 0);
    cloud.add_cylinder(0.6, [-0.6, 0.0], [true, true], SPACING, 1);
    cloud.points.retain(|(p, n, part)| *part == 0 || n.z < 0.5 || p.coords.xy().norm() > 0.12);
    let parts = measured(&cloud, &[Form::Solid, wall(0.05)], |_| true);
    assert!(!parts.notes.iter().any(|w| w.contains("inside")), "{:?}", parts.notes);
    let (stem, base) = (PI * 0.12f64.powi(2), PI * (0.6f64.powi(2) * 0.6 - 0.55f64.powi(2) * 0.5));
    assert!(error(&parts, 0, stem).abs() < 0.25);
    assert!(error(&parts, 1, base).abs() < 0.15);
}

#[test]
fn the_interval_of_a_table_holds_what_lies_under_it_unseen() {
    // A top of radius 0.9, 0.12 thick, on one leg of radius 0.12; photos from 6 to 78 degrees above the horizon.
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.9, [0.0, 0.12], [true, true], SPACING, 0);
    cloud.add_cylinder(0.12, [-0.9, 0.0], [true, false], SPACING, 0);
    // No photo shows the underside, so training would not have put Gaussians there.
    cloud.points.retain(|(_, n, _)| n.z > -0.5);
    let parts = measured(&cloud, &[Form::Solid], |n| (0.1..0.98).contains(&n.z));
    let table = PI * (0.81 * 0.12 + 0.12f64.powi(2) * 0.9);
    // Few views are low enough to look under the top, so the middle is up to twice the true volume: the interval says
    // so.
    assert!(error(&parts, 0, table).abs() < 1.0);
    assert!(holds(&parts, 0, table), "{:?}", parts.parts[0].volume_m3);
}

/// The view from below, which is not among those that carve, removes nothing there; so the Gaussians still have to.
#[test]
fn a_view_that_does_not_carve_bounds_nothing() {
    let cloud = Cloud::sphere(Point3::origin(), 1.0, 4000, |_| 0);
    let (gaussians, field) = (cloud.gaussians(0.05), cloud.field(&[Form::Solid]));
    let above = cameras(4.0, 120, |n| n.z > 0.7);
    let below = cameras(4.0, 120, |n| n.z < -0.9);
    let options = Options { volume_cells: 50_000, carve_views: above.len(), ..Options::default() };
    let result_of = |eyes: &[Camera]| {
        let result = parts(&gaussians, &field, eyes, Some(&SCALE), &options, Progress::HIDDEN).unwrap();
        (result.metric().unwrap().clone(), result.interior)
    };
    // Spread evenly over one more view, those that carve are all but the last.
    let with_another = [&above[..], &below[..1]].concat();
    let (alone, beside) = (result_of(&above), result_of(&with_another));
    assert_eq!(alone.0.object, beside.0.object);
    assert!(alone == beside, "the bound below is gone");
}

#[test]
fn an_open_cup_holds_air() {
    // Side and bottom of Gaussians on the outside, side and floor on the inside: nothing but the wall is material.
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.6, [-0.6, 0.6], [true, false], SPACING, 0);
    let mut inside = Cloud::default();
    inside.add_cylinder(0.5, [-0.5, 0.6], [true, false], SPACING, 0);
    inside.points.iter().for_each(|(p, n, part)| cloud.add(*p, -n, *part));
    let parts = measured(&cloud, &[Form::Solid], |n| n.z > -0.5);
    let cup = PI * (0.36 * 1.2 - 0.25 * 1.1);
    assert!(error(&parts, 0, cup).abs() < 0.3);
    assert!(holds(&parts, 0, cup), "{:?}", parts.parts[0].volume_m3);
}

#[test]
fn an_open_bowl_of_one_sheet_is_counted_once() {
    // Half a ball's surface, seen from inside and outside, with a wall of 0.01: far thinner than the splat is soft.
    let mut cloud = Cloud::sphere(Point3::origin(), 0.9, 12_000, |_| 0);
    cloud.points.retain(|(p, _, _)| p.z < 0.0);
    let parts = measured(&cloud, &[wall(0.01)], |_| true);
    let bowl = 2.0 * PI * 0.81 * 0.01;
    assert!(error(&parts, 0, bowl).abs() < 0.15);
    assert!(holds(&parts, 0, bowl), "{:?}", parts.parts[0].volume_m3);
}

#[test]
fn a_rod_that_lies_on_a_table_is_as_round_below_as_above() {
    let mut upright = Cloud::default();
    upright.add_cylinder(0.3, [-1.0, 1.0], [true, true], SPACING, 0);
    let mut cloud = Cloud::default();
    for (p, n, part) in &upright.points {
        cloud.add(Point3::new(p.z, p.y, -p.x), Vector3::new(n.z, n.y, -n.x), *part);
    }
    // No photo shows the underside, so training would not have put Gaussians there.
    cloud.points.retain(|(_, n, _)| n.z > -0.7);
    let parts = measured(&cloud, &[Form::Solid], |n| (-0.1..0.98).contains(&n.z));
    assert!(parts.notes.iter().any(|note| note.contains("like the opposite one")), "{:?}", parts.notes);
    let rod = PI * 0.09 * 2.0;
    assert!(error(&parts, 0, rod).abs() < 0.06);
    assert!(holds(&parts, 0, rod), "{:?}", parts.parts[0].volume_m3);
}

#[test]
fn what_stands_on_a_broad_foot_is_not_mirrored() {
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.7, [-0.9, -0.6], [true, true], SPACING, 0);
    cloud.add_cylinder(0.2, [-0.6, 0.9], [false, true], SPACING, 0);
    cloud.points.retain(|(p, n, _)| n.z > -0.7 && (p.z != -0.6 || p.coords.xy().norm() > 0.2));
    let parts = measured(&cloud, &[Form::Solid], |n| (-0.1..0.98).contains(&n.z));
    assert!(parts.notes.iter().all(|note| !note.contains("like the opposite one")), "{:?}", parts.notes);
    let stand = PI * (0.49 * 0.3 + 0.04 * 1.5);
    // What the views do not look through beside the foot stays full.
    assert!(error(&parts, 0, stand).abs() < 0.2);
}
