//! Places to grasp at, on clouds whose best places are known.

use gprop::grasp::gripper::GripperProfile;
use gprop::grasp::places::Place;
use gprop::grasp::surface::{Surface, SurfacePoint};
use gprop::grasp::touch::{Pads, Touch};
use gprop::grasp::{GraspError, GraspReport, Options, Reason, grasp};
use gprop::parts::{self, PartsResult};
use gprop::query::Form;
use gprop::units::{Estimate, MetricScale, Range, ScaleSource};
use gprop::vote::FieldPart;
use gprop::words::progress::Progress;
use nalgebra::{Point3, Vector3};

use crate::parts::clouds::{Cloud, cameras};

/// An upright rod (0) of 30 mm across and 160 mm on a disc (1) of 240 mm across and 20 mm, 1000 kg/m^3 both.
fn lollipop() -> Cloud {
    let mut cloud = Cloud::default();
    cloud.add_cylinder(0.015, [0.02, 0.18], [false, true], 0.002, 0);
    cloud.add_cylinder(0.12, [0.0, 0.02], [true, true], 0.003, 1);
    cloud
}

struct Scene {
    parts: PartsResult,
    labels: Vec<FieldPart>,
    surface: Surface,
}

fn scene(cloud: &Cloud, forms: &[Form]) -> Scene {
    let (gaussians, field) = (cloud.gaussians(0.0015), cloud.field(forms));
    let cameras = cameras(0.8, 24, |_| true);
    let scale =
        MetricScale { meters_per_unit: 1.0, source: ScaleSource::Metric, provenance: String::new(), range: None };
    let options = parts::Options { volume_cells: 200_000, ..Default::default() };
    let parts = parts::parts(&gaussians, &field, &cameras, Some(&scale), &options, Progress::HIDDEN).unwrap();
    let surface = Surface::of(&gaussians, &field.part_index, &cameras, 1.0);
    Scene { parts, labels: field.parts, surface }
}

fn run(scene: &Scene, gripper: &str, options: &Options) -> Result<GraspReport, GraspError> {
    let gripper = GripperProfile::load(gripper).unwrap();
    grasp(scene.parts.metric().unwrap(), &scene.labels, Some(&scene.surface), 1.0, &gripper, options)
}

#[test]
fn normals_of_a_ball_point_outward() {
    let cloud = Cloud::sphere(Point3::origin(), 0.05, 8000, |_| 0);
    let surface = Surface::of(&cloud.gaussians(0.001), &vec![0; 8000], &cameras(0.3, 24, |_| true), 1.0);
    assert!(surface.points.len() > 7900, "{} of 8000 are seen", surface.points.len());
    let off = |p: &SurfacePoint| p.normal.angle(&p.position.coords).to_degrees();
    let mut angles: Vec<f64> = surface.points.iter().map(off).collect();
    angles.sort_by(f64::total_cmp);
    // The Gaussians are flat, so the normals are theirs, except for a part of the depth map's error.
    assert!(angles[angles.len() / 2] < 3.0, "median {}", angles[angles.len() / 2]);
    assert!(angles[angles.len() * 99 / 100] < 15.0, "99 % {}", angles[angles.len() * 99 / 100]);
}

#[test]
fn a_rod_is_grasped_across() {
    let scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let report = run(&scene, "paper", &Options { part: Some("part 0".to_owned()), ..Options::default() }).unwrap();
    assert!(!report.candidates.is_empty() && report.candidates.len() <= 5);
    for place in &report.candidates {
        let [a, b] = place.contacts_m.map(Point3::from);
        let axis = (b - a).normalize();
        assert!(axis.z.abs() < 0.2, "the fingers close across the rod: {axis}");
        // The rod's 30 mm, one deviation of its Gaussians to either side, and the error of the smoothing.
        assert!((place.width_m - 0.03).abs() < 0.003, "{}", place.width_m);
        assert!((place.thickness_m.mid - 0.03).abs() < 0.003, "{:?}", place.thickness_m);
        let middle = nalgebra::center(&a, &b);
        assert!(middle.x.hypot(middle.y) < 0.004, "through the rod's axis: {middle}");
        // The disc is below: the hand comes from above or from the side, never through the disc.
        assert!(Vector3::from(place.approach).z > -0.1, "{:?}", place.approach);
    }
    // The best is the nearest to the centre of mass, which is near the disc.
    let lowest = report.candidates.iter().map(|p| p.contacts_m[0][2]).fold(f64::INFINITY, f64::min);
    assert!(report.candidates[0].contacts_m[0][2] < lowest + 0.02);
    // The top-level forces are those of the best place.
    assert_eq!(report.candidates[0].f_star_n, report.f_star_n);
    assert_eq!(report.candidates[0].f_max_n, report.f_max_n);
}

/// `--volume` may make a solid of a part that the answer calls a shell, and the other way round.
#[test]
fn the_thickness_is_that_of_a_wall_if_the_volume_is() {
    let scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let thickness = Estimate::new(0.002, 0.003, 0.004);
    let places = |is_wall: bool, form: Form| {
        let (mut parts, mut labels) = (scene.parts.metric().unwrap().clone(), scene.labels.clone());
        (parts.parts[0].is_wall, parts.parts[0].thickness_m) = (is_wall, Some(thickness));
        labels[0].form = form;
        let options = Options { part: Some("part 0".to_owned()), ..Options::default() };
        let gripper = GripperProfile::load("paper").unwrap();
        grasp(&parts, &labels, Some(&scene.surface), 1.0, &gripper, &options).unwrap().candidates
    };
    let walls = places(true, Form::Solid);
    assert!(!walls.is_empty() && walls.iter().all(|place| place.thickness_m == thickness), "{walls:?}");
    for place in places(false, Form::Shell { wall_thickness_m: Range::new(0.002, 0.004) }) {
        // As in `a_rod_is_grasped_across`; as uncertain as the part's own.
        let Estimate { low, mid, .. } = place.thickness_m;
        assert!((mid - 0.03).abs() < 0.003 && (low / mid - 2.0 / 3.0).abs() < 1e-12, "{:?}", place.thickness_m);
    }
}

#[test]
fn near_a_point_means_near_that_point() {
    let scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let report = run(&scene, "paper", &Options { point: Some([0.0, 0.015, 0.16]), ..Options::default() }).unwrap();
    let best = &report.candidates[0];
    let nearest = |c: [f64; 3]| (Point3::from(c) - Point3::new(0.0, 0.015, 0.16)).norm();
    assert!(best.contacts_m.map(nearest).into_iter().fold(f64::INFINITY, f64::min) < 0.01, "{:?}", best.contacts_m);
    assert_eq!(best.part_id, 0);
}

#[test]
fn a_point_far_from_the_object_is_refused_with_the_distance() {
    let scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let grasped_at = |point| run(&scene, "paper", &Options { point: Some(point), ..Options::default() });
    // Over the rod's top, which is at 0.18 m, a finger is 40 mm long; the Gaussians stand out by a deviation of 1.5 mm.
    assert!(grasped_at([0.0, 0.0, 0.215]).is_ok());
    for (point, millimeters) in [([0.0, 0.0, 0.3], 118.0), ([10.0, 0.0, 0.01], 9880.0)] {
        let error = grasped_at(point).unwrap_err();
        let GraspError::PointTooFar { distance_mm, .. } = &error else { panic!("{error}") };
        assert!((distance_mm - millimeters).abs() < 4.0, "{distance_mm} mm");
        assert!(error.to_string().contains("--point") && error.to_string().contains("40 mm"), "{error}");
    }
    // The middle of the disc is far from its surface, but not outside the object.
    assert!(scene.surface.distance_m(Point3::new(0.06, 0.0, 0.01)) == Some(0.0));
}

/// A plate that was seen from above only has no surface that faces down.
#[test]
fn a_point_far_behind_a_surface_is_not_within_the_object() {
    let points = (0..9).map(|n| SurfacePoint {
        position: Point3::new(0.01 * f64::from(n % 3), 0.01 * f64::from(n / 3), 0.0),
        normal: Vector3::z(),
        part: 0,
    });
    let plate = Surface { points: points.collect(), obstacles: Vec::new() };
    for z in [-10.0, 10.0] {
        assert_eq!(plate.distance_m(Point3::new(0.01, 0.01, z)), Some(10.0));
    }
}

#[test]
fn the_rim_of_a_wide_disc_is_pinched_not_spanned() {
    let scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let report = run(&scene, "paper", &Options { part: Some("part 1".to_owned()), ..Options::default() }).unwrap();
    for place in &report.candidates {
        assert!((place.width_m - 0.02).abs() < 0.004, "across the disc's 20 mm: {}", place.width_m);
    }
}

#[test]
fn a_stroke_that_is_too_small_is_told() {
    let ball = Cloud::sphere(Point3::origin(), 0.08, 12_000, |_| 0);
    let scene = scene(&ball, &[Form::Solid]);
    let error = run(&scene, "paper", &Options { auto: true, ..Options::default() }).unwrap_err();
    assert!(matches!(error, GraspError::StrokeTooSmall { .. }), "{error}");
    let message = error.to_string();
    assert!(message.contains("90 mm") && message.contains("longer stroke"), "{message}");
    // If the user did not ask for a place, this is only a warning, and the forces are those of the part.
    let report = run(&scene, "paper", &Options::default()).unwrap();
    assert!(
        report.candidates.is_empty() && report.warnings.iter().any(|w| w.contains("90 mm")),
        "{:?}",
        report.warnings
    );
}

/// The disc may have no friction at all, so no force is sure to hold it there; the rod can still be grasped.
#[test]
fn a_part_with_a_bad_property_is_left_out() {
    let mut scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let auto = || Options { auto: true, ..Options::default() };
    scene.labels[1].friction_rubber = Estimate::new(0.0, 0.5, 0.5);
    let report = run(&scene, "paper", &auto()).unwrap();
    assert!(!report.candidates.is_empty() && report.candidates.iter().all(|place| place.part_id == 0));
    let tells = |warning: &String| warning.contains("left out") && warning.contains("friction of part \"part 1\"");
    assert!(report.warnings.iter().any(tells), "{:?}", report.warnings);
    let of_disc = run(&scene, "paper", &Options { part: Some("part 1".to_owned()), ..Options::default() });
    assert!(matches!(of_disc, Err(GraspError::Property { .. })), "{of_disc:?}");
    scene.labels[0].friction_rubber = scene.labels[1].friction_rubber;
    let of_either = run(&scene, "paper", &auto());
    assert!(matches!(of_either, Err(GraspError::Property { .. })), "{of_either:?}");
}

#[test]
fn torque_by_hand() {
    let scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let report = run(&scene, "paper", &Options { part: Some("part 0".to_owned()), ..Options::default() }).unwrap();
    let (place, mass) = (&report.candidates[0], scene.parts.metric().unwrap().object.mass_kg.mid);
    // 2 fingers, 2/3 mu F r for a whole pad of sqrt(1.1e-4 m2 / pi), less what the weight takes; mu is 0.5. The Gaussians are 2 mm
    // apart, too far to show what such a pad touches.
    let arm = 2.0 / 3.0 * (1.1e-4 / std::f64::consts::PI).sqrt();
    assert!((place.pressure_arm_m / arm - 1.0).abs() < 1e-9 && place.touched_share == 1.0, "{place:?}");
    assert!(place.offset_m < 0.5 * place.width_m, "the centre of mass hangs from both fingers: {place:?}");
    // The centre of mass is a little beside the middle, which the pads on the round rod do not resist.
    let tilting = (mass * 9.8 * place.offset_m - 2.0 * place.force_n * place.pressure_shift_m).max(0.0);
    let taken = (place.f_min_n + tilting / (0.5 * place.width_m)) / place.force_n;
    let held = 2.0 * 0.5 * place.force_n * arm * (1.0 - taken * taken).max(0.0).sqrt();
    let by_hand = held - mass * 9.8 * place.lever_m;
    assert!((place.torque_margin_n_m - by_hand).abs() < 1e-12, "{} is not {by_hand}", place.torque_margin_n_m);
}

/// Nothing can be held at the end of the rod: the disc below weighs too much for its lever.
#[test]
fn an_object_that_turns_between_the_fingers_is_no_safe_grip() {
    let scene = scene(&lollipop(), &[Form::Solid, Form::Solid]);
    let at_the_end = Options { point: Some([0.0, 0.015, 0.16]), ..Options::default() };
    let report = run(&scene, "paper", &at_the_end).unwrap();
    let best = &report.candidates[0];
    assert!(report.f_min_n < report.f_star_n && report.f_star_n < report.f_max_n, "the forces alone fit");
    assert!(best.torque_margin_n_m < 0.0 && best.infeasible_because == Some(Reason::Turns), "{best:?}");
    let why = report.infeasible.as_ref().unwrap();
    assert!(!report.feasible && why.reason == Reason::Turns, "{why}");
    assert!(["nearer to the centre of mass", "wider", "two hands"].iter().all(|a| why.advice.contains(a)), "{why}");
    assert!(report.warnings.iter().any(|warning| warning.contains("no safe grip")), "{:?}", report.warnings);
    // Among places at which it turns and others, the others come first.
    let anywhere = run(&scene, "robotiq-2f-85", &Options { auto: true, ..Options::default() }).unwrap();
    let turns: Vec<bool> = anywhere.candidates.iter().map(|place| place.torque_margin_n_m < 0.0).collect();
    assert!(turns.is_sorted(), "{turns:?}");
}

/// The two sides of a bar along y that is `width_m` wide along z and 20 mm thick along x, with grooves of 3 mm across it if it is
/// ribbed: every other 3 mm.
fn rail(width_m: f64, is_ribbed: bool) -> Surface {
    const STEP_M: f64 = 5e-4;
    let across = (width_m / STEP_M).round() as i32;
    let point = |along: i32, over: i32, side: f64| {
        let y = STEP_M * f64::from(along);
        let is_groove = is_ribbed && (y / 0.003).floor() as i64 % 2 != 0;
        let x = side * if is_groove { 0.007 } else { 0.01 };
        let z = STEP_M * (f64::from(over) - 0.5 * f64::from(across));
        SurfacePoint { position: Point3::new(x, y, z), normal: Vector3::x() * side, part: 0 }
    };
    let places = (-60..=60).flat_map(|along| (0..=across).map(move |over| (along, over)));
    let points = places.flat_map(|(along, over)| [-1.0, 1.0].map(|side| point(along, over, side))).collect();
    Surface { points, obstacles: Vec::new() }
}

fn touch(surface: &Surface, z_m: f64) -> Touch {
    let positions: Vec<Point3<f64>> = surface.points.iter().map(|point| point.position).collect();
    let gripper = GripperProfile::load("paper").unwrap();
    let contacts = [Point3::new(-0.01, 0.001, z_m), Point3::new(0.01, 0.001, z_m)];
    let place = Place { contacts, part: 0, thickness_m: 0.02, misalignment_rad: 0.0 };
    Pads::new(surface, &positions, gripper.contact_radius_m()).touch(&place)
}

#[test]
fn pads_touch_what_is_under_them() {
    // A disc of 1.1e-4 m2 is 11.8 mm across. 48 points stand for it, each for 2 % of it; two of them may be on the wrong side of an
    // edge, and as much again for the points of the surface, which are 0.5 mm apart.
    let about = |share: f64, expected: f64| (share - expected).abs() < 0.08;
    let whole = 2.0 / 3.0 * GripperProfile::load("paper").unwrap().contact_radius_m();
    let wide = touch(&rail(0.03, false), 0.0);
    assert_eq!(wide.share, 1.0, "{wide:?}");
    assert!((wide.arm_m / whole - 1.0).abs() < 1e-9, "{wide:?}");
    // A strip through the middle: 2 / pi (asin u + u sqrt(1 - u^2)) of the disc for u = 4 mm / 11.8 mm.
    let narrow = touch(&rail(0.004, false), 0.0);
    assert!(about(narrow.share, 0.42) && narrow.arm_m < 0.9 * whole, "{narrow:?}");
    // Half of the pad lies beyond the edge of a plate. The mean distance from the middle of half a disc is 0.78 of that of a whole
    // one, numerically.
    let edge = touch(&rail(0.03, false), 0.015);
    assert!(about(edge.share, 0.5) && (edge.arm_m / whole - 0.78).abs() < 0.05, "{edge:?}");
    // 4.5 mm beyond it: (acos u - u sqrt(1 - u^2)) / pi for u = 4.5 mm / 5.9 mm.
    let beyond = touch(&rail(0.03, false), 0.0195);
    assert!(about(beyond.share, 0.07), "{beyond:?}");
    // A rib from -1 to 2 mm under the middle, and what is left of the next ones beyond -4 and 5 mm: by the same formulas, 0.32, 0.10
    // and 0.04 of the disc. They are as far apart as the pad is wide, so the arm hardly suffers.
    let ribbed = touch(&rail(0.03, true), 0.0);
    assert!(about(ribbed.share, 0.46) && ribbed.arm_m > 0.85 * whole, "{ribbed:?}");
    // Both: the middle rib's 3 mm of 4 mm, 12 of 110 mm2, and the ends of its neighbours.
    let both = touch(&rail(0.004, true), 0.0);
    assert!(both.share < 0.29 && both.share > 0.08, "{both:?}");
}

/// A bar that is as thick as the contacts are apart rolls between the pads, and a plate does not.
#[test]
fn the_pressure_moves_on_what_is_flat_and_not_on_what_rolls() {
    let radius = GripperProfile::load("paper").unwrap().contact_radius_m();
    let flat = touch(&rail(0.03, false), 0.0);
    assert!((flat.shift_m / (radius / 4.0) - 1.0).abs() < 1e-9, "{flat:?}");
    // Twice as thick as the contacts are apart, it rolls half as much.
    for (bar_radius, rolls) in [(0.01, 1.0), (0.02, 0.5)] {
        let point = |along: i32, turn: i32, side: f64| {
            let (sin, cos) = (0.05 * f64::from(turn)).sin_cos();
            let position =
                Point3::new(side * (0.01 + bar_radius * (cos - 1.0)), 0.5e-3 * f64::from(along), bar_radius * sin);
            SurfacePoint { position, normal: Vector3::new(side * cos, 0.0, sin), part: 0 }
        };
        let places = (-40..=40).flat_map(|along| (-20..=20).map(move |turn| (along, turn)));
        let points = places.flat_map(|(along, turn)| [-1.0, 1.0].map(|side| point(along, turn, side))).collect();
        let bar = touch(&Surface { points, obstacles: Vec::new() }, 0.0);
        // The slope of a circle grows faster than in proportion, 5 to 20 % on average.
        let expected = (1.0 - rolls) * 3.0 / 8.0 * bar.arm_m;
        assert!((bar.shift_m - expected).abs() < 0.2 * radius / 4.0, "{bar_radius}: {bar:?} is not {expected}");
    }
}

/// Points far apart, as Gaussians on a plain wall are, do not make holes.
#[test]
fn a_sparse_surface_is_flat_until_it_shows_otherwise() {
    let whole = 2.0 / 3.0 * GripperProfile::load("paper").unwrap().contact_radius_m();
    let every = |nth: i64, surface: Surface| {
        let at = |v: f64| (v / 5e-4).round() as i64;
        let kept = |p: &&SurfacePoint| at(p.position.y) % nth == 0 && at(p.position.z) % nth == 0;
        Surface { points: surface.points.iter().filter(kept).copied().collect(), obstacles: Vec::new() }
    };
    for nth in [2, 3, 4, 8, 16] {
        let sparse = touch(&every(nth, rail(0.03, false)), 0.0);
        assert!(sparse.share == 1.0 && (sparse.arm_m / whole - 1.0).abs() < 1e-9, "every {nth}th: {sparse:?}");
    }
}

#[test]
fn a_ribbed_rail_that_is_narrower_than_the_pads_is_no_safe_grip() {
    let (parts, labels) = super::forces::hammer();
    let gripper = GripperProfile::load("paper").unwrap();
    let grasped =
        |surface: &Surface| grasp(&parts, &labels, Some(surface), 1.0, &gripper, &Options::default()).unwrap();
    let wide = grasped(&rail(0.03, false));
    assert!(wide.feasible, "{wide:?}");
    let narrow = grasped(&rail(0.003, true));
    let why = narrow.infeasible.as_ref().unwrap();
    assert_eq!(why.reason, Reason::Touches, "{why}");
    assert!(why.explanation.contains("of a pad") && why.advice.contains("smaller pads"), "{why}");
}

/// A sheet of 0.5 mm and 1 GPa at 150 mm from the centre of mass of 0.56 kg, and a stiff bar beside it. The sheet withstands
/// 1/2 A E d kappa_max = 13.75 N, more than F_min, but hangs down.
#[test]
fn a_leaf_is_never_the_best_place() {
    let (mut parts, mut labels) = super::forces::hammer();
    labels[0].youngs_modulus_pa = Estimate::exactly(1e9);
    parts.parts[0].is_wall = true;
    parts.parts[0].thickness_m = Some(Estimate::exactly(5e-4));
    parts.parts[0].volume_m3 = Some(Estimate::exactly(1e-6));
    parts.object.center_of_mass_m = [0.0, 0.0, 0.15];
    let bar = rail(0.03, false);
    // The sides of a splat's sheet are some millimetres apart, however thin it is.
    let at = |z: f64, part: u32, half_m: f64| {
        let moved = |p: &SurfacePoint| {
            let position = Point3::new(p.position.x.signum() * half_m, p.position.y, p.position.z + z);
            SurfacePoint { position, part, ..*p }
        };
        bar.points.iter().map(moved).collect::<Vec<_>>()
    };
    let gripper = GripperProfile::load("paper").unwrap();
    let leaf = at(0.0, 0, 0.0015);
    let both = Surface { points: [leaf.clone(), at(0.35, 1, 0.01)].concat(), obstacles: Vec::new() };
    let report = grasp(&parts, &labels, Some(&both), 1.0, &gripper, &Options::default()).unwrap();
    assert_eq!(report.part_id, 1, "the bar, although it is farther from the centre of mass: {report:?}");
    let alone = Surface { points: leaf, obstacles: Vec::new() };
    let report = grasp(&parts, &labels, Some(&alone), 1.0, &gripper, &Options::default()).unwrap();
    let why = report.infeasible.as_ref().unwrap();
    // m g l^2 / (2 E I) with I = b d^3 / 12 and b = sqrt(V / d).
    let stiffness = 1e9 * (1e-6f64 / 5e-4).sqrt() * 5e-4f64.powi(3) / 12.0;
    let best = &report.candidates[0];
    let [a, b] = best.contacts_m.map(Point3::from);
    let length = (nalgebra::center(&a, &b) - Point3::new(0.0, 0.0, 0.15)).norm();
    let by_hand = 0.56 * 9.8 * length * length / (2.0 * stiffness);
    assert!((best.bend_rad / by_hand - 1.0).abs() < 1e-9, "{} is not {by_hand}", best.bend_rad);
    assert!(why.reason == Reason::Limp && why.explanation.contains("too limp"), "{why}");
    assert!(why.advice.contains("stiffer part"), "{why}");
    // The same wall around something hollow of 20 mm does not fold: I = b d w^2 / 4, 4800 times as much.
    let tube = Surface { points: at(0.0, 0, 0.01), obstacles: Vec::new() };
    let report = grasp(&parts, &labels, Some(&tube), 1.0, &gripper, &Options::default()).unwrap();
    let best = &report.candidates[0];
    let stiffness = 1e9 * (1e-6f64 / 5e-4).sqrt() * 5e-4 * best.width_m.powi(2) / 4.0;
    let [a, b] = best.contacts_m.map(Point3::from);
    let length = (nalgebra::center(&a, &b) - Point3::new(0.0, 0.0, 0.15)).norm();
    let by_hand = 0.56 * 9.8 * length * length / (2.0 * stiffness);
    assert!((best.bend_rad / by_hand - 1.0).abs() < 1e-9, "{} is not {by_hand}", best.bend_rad);
    assert_eq!(best.infeasible_because, Some(Reason::Turns), "{best:?}");
}
