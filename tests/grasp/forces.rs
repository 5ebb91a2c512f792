//! Forces against hand-computed cases, and over their whole domain.

use gprop::grasp::forces::{
    Bounds, ForceMax, GraspedPart, Load, TwoPads, f_hold, f_max, f_min, f_safe, f_star, torque_margin_n_m,
};
use gprop::grasp::gripper::GripperProfile;
use gprop::grasp::surface::{Surface, SurfacePoint};
use gprop::grasp::{
    ForceRule, GraspError, GraspReport, Limit, Options, Policy, Reason, grasp, grasped_part::PartChoice,
};
use gprop::materials::MaterialLibrary;
use gprop::parts::{NoVolume, Part, Parts};
use gprop::report::{grasp_line, part_lines};
use gprop::units::{Estimate, GRAVITY_M_S2};
use gprop::vote::FieldPart;
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use serde_json::json;

use crate::support::changed;

/// The error of a few roundings in double precision.
const ROUNDING: f64 = 1e-13;

fn close(computed: f64, by_hand: f64) {
    assert!((computed - by_hand).abs() <= ROUNDING * by_hand.abs(), "{computed} is not {by_hand}");
}

fn part(id: u32, caption: &str, mass_kg: Estimate, thickness_m: Estimate, to_center_m: Option<f64>) -> Part {
    let part = json!({
        "id": id,
        "caption": caption,
        "material": format!("material of {caption}"),
        "family": "wood",
        "gaussians": 100,
        "volume_m3": Estimate::exactly(1e-4),
        "thickness_m": thickness_m,
        "density_kg_m3": Estimate::exactly(1000.0),
        "mass_kg": mass_kg,
        "center_of_mass_m": ([0.0; 3]),
        "inertia_kg_m2": ([[0.0; 3]; 3]),
        "bodies": [],
        "surface_to_center_of_mass_m": to_center_m,
    });
    serde_json::from_value(part).unwrap()
}

fn label(id: u32, friction: Estimate, strength_pa: Estimate, youngs_modulus_pa: Estimate) -> FieldPart {
    changed(FieldPart::of(id, &MaterialLibrary::builtin().materials()[0]), |label| {
        label.density_kg_m3 = Estimate::exactly(1000.0);
        label.poisson_ratio = Estimate::exactly(0.3);
        label.hardness = None;
        (label.friction_rubber, label.yield_strength_pa, label.youngs_modulus_pa) =
            (friction, strength_pa, youngs_modulus_pa);
    })
}

/// A hickory handle (0) of 20 mm and a steel head (1) of 30 mm: 0.12 kg and 0.44 kg, the head nearer the middle.
pub fn hammer() -> (Parts, Vec<FieldPart>) {
    let parts = vec![
        part(0, "wooden handle", Estimate::new(0.10, 0.12, 0.14), Estimate::new(0.018, 0.020, 0.022), Some(0.02)),
        part(1, "steel head", Estimate::new(0.40, 0.44, 0.48), Estimate::new(0.028, 0.030, 0.032), Some(0.01)),
    ];
    let mass = parts[0].mass_kg.unwrap().plus(parts[1].mass_kg.unwrap());
    let object = json!({
        "volume_m3": Estimate::exactly(2e-4),
        "mass_kg": mass,
        "center_of_mass_m": ([0.0; 3]),
        "inertia_kg_m2": ([[0.0; 3]; 3]),
    });
    let labels = vec![
        label(0, Estimate::new(0.6, 0.7, 0.8), Estimate::new(40e6, 50e6, 60e6), Estimate::new(10e9, 12e9, 14e9)),
        label(1, Estimate::new(0.5, 0.6, 0.7), Estimate::exactly(300e6), Estimate::exactly(200e9)),
    ];
    (Parts::new(serde_json::from_value(object).unwrap(), parts), labels)
}

fn paper() -> GripperProfile {
    GripperProfile::load("paper").unwrap()
}

fn run(options: &Options) -> Result<GraspReport, GraspError> {
    let (parts, labels) = hammer();
    grasp(&parts, &labels, None, 1.0, &paper(), options)
}

fn of_part(name: &str) -> Options {
    Options { part: Some(name.to_owned()), ..Options::default() }
}

/// The faces of a wedge as surface of a part: 20 mm apart in the middle, and each 10 degrees off the vertical. So the line
/// of any two contacts is off one of the normals by 10 degrees or more.
fn wedge(part: u32) -> Surface {
    let (sin, cos) = 10f64.to_radians().sin_cos();
    let point = |(y, z): (i32, i32), side: f64| SurfacePoint {
        position: Point3::new(
            side * (0.01 + 1e-3 * f64::from(z) * sin / cos),
            1e-3 * f64::from(y),
            1e-3 * f64::from(z),
        ),
        normal: Vector3::new(side * cos, 0.0, -sin),
        part,
    };
    let places = (-20..=20).flat_map(|y| (-20..=20).map(move |z| (y, z)));
    let points = places.flat_map(|place| [point(place, -1.0), point(place, 1.0)]).collect();
    Surface { points, obstacles: Vec::new() }
}

#[test]
fn f_min_by_hand() {
    // 1/2 * 0.56 kg * 9.8 m/s2 * (1 / 0.7) = 2.744 / 0.7 = 3.92 N
    close(f_min(0.56, 0.7, 0.0, GRAVITY_M_S2), 3.92);
    // At 30 degrees: 2.744 * (0.8660254037844386 / 0.7 - 0.5) = 2.744 * 0.7371791482634838
    close(f_min(0.56, 0.7, 30f64.to_radians(), GRAVITY_M_S2), 2.0228195828349995);
    // At 90 degrees the object rests on a finger.
    assert_eq!(f_min(0.56, 0.7, 90f64.to_radians(), GRAVITY_M_S2), 0.0);
}

#[test]
fn f_max_by_hand() {
    let rubber = GraspedPart {
        area_m2: 1.1e-4,
        strength_pa: 10e6,
        youngs_modulus_pa: 5e6,
        thickness_m: 0.03,
        max_curvature_1_m: 0.5,
    };
    // 1/2 * 1.1e-4 * 5e6 * 0.03 * 0.5 = 4.125 N, against 1.1e-4 * 10e6 = 1100 N
    close(f_max(&rubber).newtons, 4.125);
    assert_eq!(f_max(&rubber).limit, Limit::Bending);
    // 1.1e-4 * 50e6 = 5500 N, against 1/2 * 1.1e-4 * 12e9 * 0.02 * 0.5 = 6600 N
    let wood = GraspedPart { strength_pa: 50e6, youngs_modulus_pa: 12e9, thickness_m: 0.02, ..rubber };
    close(f_max(&wood).newtons, 5500.0);
    assert_eq!(f_max(&wood).limit, Limit::Yield);
}

#[test]
fn f_star_by_hand() {
    let bending = |newtons| ForceMax { newtons, limit: Limit::Bending };
    let of =
        |f_min_n, f_max_n, gripper_n| f_star(&Bounds { f_min_n, upper: bending(f_max_n), gripper_n, margin: 0.05 });
    let star = |f_min, f_max| of(f_min, f_max, [0.0, 40.0]);
    // (4 + 20) / 2 = 12 N, within 4 + 0.05 * 16 and 20 - 0.05 * 16.
    let middle = star(4.0, 20.0);
    assert_eq!((middle.newtons, middle.limit, middle.infeasible_because), (12.0, Limit::Bending, None));
    // The mean, 2752 N, is cut to 40 - 0.05 * (40 - 4) = 38.2 N.
    let strong = star(4.0, 5500.0);
    assert_eq!((strong.newtons, strong.limit, strong.infeasible_because), (38.2, Limit::Gripper, None));
    // 40 - 0.05 * (40 - 39) = 39.95 N.
    let heavy = star(39.0, 5500.0);
    assert_eq!((heavy.newtons, heavy.limit, heavy.infeasible_because), (39.95, Limit::Gripper, None));
    // (0.5 + 1.5) / 2, well within the gripper's range.
    let tender = star(0.5, 1.5);
    assert_eq!((tender.newtons, tender.limit, tender.infeasible_because), (1.0, Limit::Bending, None));
    // Heavier than the gripper can hold.
    let too_heavy = star(41.0, 5500.0);
    assert_eq!(
        (too_heavy.newtons, too_heavy.limit, too_heavy.infeasible_because),
        (40.0, Limit::Gripper, Some(Reason::TooWeak))
    );
    // The gripper presses with at least 10 N, but the part bears only 1.5 N.
    let delicate = of(0.5, 1.5, [10.0, 40.0]);
    assert_eq!(
        (delicate.newtons, delicate.limit, delicate.infeasible_because),
        (10.0, Limit::Gripper, Some(Reason::TooStrong))
    );
    // Holding takes 5 N and the part bears 3 N: the paper's second case, (5 + 3) / 2.
    let impossible = star(5.0, 3.0);
    assert_eq!(
        (impossible.newtons, impossible.limit, impossible.infeasible_because),
        (4.0, Limit::Slip, Some(Reason::Damage))
    );
    // F_min = F_max is the second case.
    assert_eq!(star(5.0, 5.0).infeasible_because, Some(Reason::Damage));
}

#[test]
fn the_force_to_press_with_by_hand() {
    let bounds = |f_min_n, f_max_n, gripper_n| {
        let upper = ForceMax { newtons: f_max_n, limit: Limit::Bending };
        Bounds { f_min_n, upper, gripper_n, margin: 0.05 }
    };
    // 0.5 kg, 3 mm from the centre of mass, mu 0.6 and pressure 4 mm from its middle: 0.0147 N m over 2 * 0.6 * 4 mm is
    // 3.0625 N, at a right angle to 4 N.
    let load = Load { f_min_n: 4.0, turning_n_m: 0.5 * 9.8 * 0.003, tilting_n_m: 0.0 };
    let pads = TwoPads { friction: 0.6, arm_m: 0.004, shift_m: 0.0015, apart_m: 0.02 };
    close(f_hold(&load, &pads), (16f64 + 3.0625 * 3.0625).sqrt());
    assert_eq!(f_hold(&Load { turning_n_m: 0.0, ..load }, &pads), 4.0);
    let force = |hold_n, factor, bounds: Bounds| {
        let force = f_safe(hold_n, factor, &bounds);
        (force.newtons, force.limit, force.infeasible_because)
    };
    let of_paper = [0.0, 40.0];
    // Twice what holds.
    assert_eq!(force(4.0, 2.0, bounds(4.0, 5500.0, of_paper)), (8.0, Limit::Safety, None));
    assert_eq!(force(5.0, 3.0, bounds(4.0, 5500.0, of_paper)), (15.0, Limit::Safety, None));
    // As far from 6 N, which damages it, as from 4 N, as a ratio; at most 6 - 0.05 * (6 - 4) though. At most 40 - 0.05 * (40 - 30) with this gripper, at least 10 with the
    // other.
    assert_eq!(force(4.0, 2.0, bounds(4.0, 6.0, of_paper)), (24f64.sqrt(), Limit::Bending, None));
    assert_eq!(force(5.9, 2.0, bounds(4.0, 6.0, of_paper)), (5.9, Limit::Bending, None));
    assert_eq!(force(7.0, 2.0, bounds(4.0, 6.0, of_paper)), (5.9, Limit::Bending, None), "it may turn");
    assert_eq!(force(30.0, 2.0, bounds(30.0, 5500.0, of_paper)), (39.5, Limit::Gripper, None));
    assert_eq!(force(4.0, 2.0, bounds(4.0, 5500.0, [10.0, 40.0])), (10.0, Limit::Gripper, None));
    // Where nothing holds without damage, the same as F*.
    assert_eq!(force(5.0, 2.0, bounds(5.0, 3.0, of_paper)), (4.0, Limit::Slip, Some(Reason::Damage)));
    assert_eq!(force(41.0, 2.0, bounds(41.0, 5500.0, of_paper)), (40.0, Limit::Gripper, Some(Reason::TooWeak)));
    assert_eq!(force(0.5, 2.0, bounds(0.5, 1.5, [10.0, 40.0])), (10.0, Limit::Gripper, Some(Reason::TooStrong)));
}

#[test]
fn one_finger_carries_more_if_the_centre_of_mass_is_beside_both() {
    // Pads 20 mm apart, mu 0.5, pressure 4 mm from its middle, and 1.5 mm by which it can move.
    let pads = TwoPads { friction: 0.5, arm_m: 0.004, shift_m: 0.0015, apart_m: 0.02 };
    let load = |tilting_n_m| Load { f_min_n: 4.0, turning_n_m: 0.0, tilting_n_m };
    // Up to 4 N * 2 * 1.5 mm, the pads keep it level by pressing harder at one edge.
    assert_eq!(f_hold(&load(0.012), &pads), 4.0);
    // 0.1 N m: F = 4 N + (0.1 N m - F * 3 mm) / (0.5 * 20 mm), so 1.3 F = 14 N.
    close(f_hold(&load(0.1), &pads), 14.0 / 1.3);
    // Besides, 0.02 N m about the line: 5 N, at a right angle. F^2 = (14 N - 0.3 F)^2 + 25 N^2.
    let both = Load { turning_n_m: 0.02, ..load(0.1) };
    let hold_n = f_hold(&both, &pads);
    close(hold_n.powi(2), (14.0 - 0.3 * hold_n).powi(2) + 25.0);
    // A wall of 1 mm, as that of a can: 3 mm of shift of the pressure is more than the friction at half a millimetre.
    let thin = TwoPads { apart_m: 0.001, ..pads };
    close(f_hold(&load(0.1), &thin), 204.0 / 7.0);
    // The margin has the sign of what is too much or too little, and says by how much.
    for (load, pads) in [(both, pads), (load(0.1), thin)] {
        let hold_n = f_hold(&load, &pads);
        let margin = |share: f64| torque_margin_n_m(share * hold_n, &load, &pads);
        assert!(margin(1.0).abs() < 1e-6 && margin(0.99) < 0.0 && margin(1.01) > 0.0, "{load:?}");
    }
    // 10 N: without any torque about the line, 14 N - 3 N is 1 N too much of friction, on 20 mm with mu 0.5.
    close(torque_margin_n_m(10.0, &load(0.1), &pads), -0.01);
}

#[test]
fn the_factor_or_the_paper_decides_how_hard_to_press_and_both_are_told() {
    let factor = |safety_factor| run(&Options { safety_factor, ..of_part("handle") }).unwrap();
    let twice = factor(2.0);
    close(twice.force_n, 2.0 * 3.92);
    // 15 + (100 - 15) * 7.84 / 40
    close(twice.force_command, 31.66);
    assert_eq!((twice.force_limited_by, twice.f_hold_n), (Limit::Safety, twice.f_min_n));
    close(factor(3.0).force_n, 3.0 * 3.92);
    let most = factor(20.0);
    assert_eq!((most.force_limited_by, most.force_n), (Limit::Gripper, most.f_star_n));
    // Whatever is pressed with, the keys of F* are those of F*.
    let paper = run(&Options { force: ForceRule::Paper, ..of_part("handle") }).unwrap();
    assert_eq!((paper.force_n, paper.force_command), (paper.f_star_n, paper.normalized_command));
    for report in [&twice, &most] {
        assert_eq!((report.f_star_n, report.normalized_command), (paper.f_star_n, paper.normalized_command));
        assert_eq!((report.limited_by, report.feasible), (paper.limited_by, paper.feasible));
    }
}

#[test]
fn off_the_centre_of_mass_it_presses_harder_so_that_nothing_turns() {
    let (mut parts, labels) = hammer();
    // 10 mm above the wedge, across its line of contacts: more force than twice F_min resists.
    parts.object.center_of_mass_m = [0.0, 0.0, 0.03];
    let placed = |force| {
        let options = Options { force, ..of_part("handle") };
        grasp(&parts, &labels, Some(&wedge(0)), 1.0, &paper(), &options).unwrap().candidates.remove(0)
    };
    let safe = placed(ForceRule::Safety);
    let torque_n_m = 0.56 * GRAVITY_M_S2 * safe.lever_m;
    // The line of the contacts is 10 degrees or more off a face, so one pad presses on the wedge with a part of itself.
    let arm_m = safe.pressure_arm_m / (2.0 / 3.0 * paper().contact_radius_m());
    assert!(arm_m > 0.7 && arm_m < 1.0 && (0.4..=1.0).contains(&safe.touched_share), "{safe:?}");
    // The centre of mass is between the fingers, so neither carries more than the other.
    assert!(safe.offset_m < 0.5 * safe.width_m, "{safe:?}");
    let hold_n = safe.f_min_n.hypot(torque_n_m / (2.0 * 0.7 * safe.pressure_arm_m));
    close(safe.f_hold_n, hold_n);
    assert!(hold_n > 2.0 * safe.f_min_n && safe.force_n >= hold_n, "{safe:?}");
    assert!(safe.feasible && safe.torque_margin_n_m > 0.0, "{safe:?}");
}

#[test]
fn whole_grasp_by_hand() {
    let report = run(&of_part("handle")).unwrap();
    assert_eq!((report.part.as_str(), report.part_chosen), ("wooden handle", PartChoice::Named));
    // Mass 0.12 + 0.44 = 0.56 kg, friction 0.7; F_max 5500 N by yield; F* 40 - 0.05 * (40 - 3.92) N.
    close(report.f_min_n, 3.92);
    close(report.f_max_n, 5500.0);
    assert_eq!((report.f_max_limited_by, report.limited_by), (Limit::Yield, Limit::Gripper));
    close(report.f_star_n, 38.196);
    assert!(report.feasible);
    // 15 + (100 - 15) * 38.196 / 40
    close(report.normalized_command, 96.1665);
    assert!(!report.command_calibrated);
    // F_min: 1/2 * 0.50 * 9.8 / 0.8 = 3.0625 and 1/2 * 0.62 * 9.8 / 0.6 = 5.0633...
    close(report.intervals.f_min_n.low, 3.0625);
    close(report.intervals.f_min_n.high, 3.038 / 0.6);
    // F_max: min(1.1e-4 * 40e6, 1/2 * 1.1e-4 * 10e9 * 0.018 * 0.5) = min(4400, 4950); high min(6600, 8470)
    close(report.intervals.f_max_n.low, 4400.0);
    close(report.intervals.f_max_n.high, 6600.0);
}

#[test]
fn safe_takes_the_worst_of_both_bounds() {
    let safe = run(&Options { policy: Policy::Safe, ..of_part("handle") }).unwrap();
    close(safe.f_min_n, 3.038 / 0.6);
    close(safe.f_max_n, 4400.0);
}

#[test]
fn the_safe_policy_relies_on_the_least_friction_at_the_contacts_too() {
    let (parts, mut labels) = hammer();
    // 6, 35 and 39 degrees.
    labels[0].friction_rubber = Estimate::new(0.1, 0.7, 0.8);
    let placed =
        |policy| grasp(&parts, &labels, Some(&wedge(0)), 1.0, &paper(), &Options { policy, ..of_part("handle") });
    let places = placed(Policy::Mid).unwrap().candidates;
    let off: Vec<f64> = places.iter().map(|place| place.misalignment_rad.to_degrees()).collect();
    assert!(!off.is_empty() && off.iter().all(|degrees| *degrees > 9.99), "{off:?}");
    assert!(matches!(placed(Policy::Safe), Err(GraspError::NoPlace { .. })));
}

#[test]
fn a_named_part_without_a_volume_is_refused_with_the_reason() {
    let (mut parts, labels) = hammer();
    (parts.parts[1].volume_m3, parts.parts[1].mass_kg) = (None, None);
    parts.parts[1].no_volume = Some(NoVolume::NoMaterial);
    let error = grasp(&parts, &labels, Some(&wedge(1)), 1.0, &paper(), &of_part("head")).unwrap_err();
    assert!(matches!(error, GraspError::NoThickness { .. }), "{error}");
    assert!(error.to_string().contains("fills no cell") && error.is_of_the_object(), "{error}");
}

#[test]
fn the_interval_of_f_star_holds_both_policies() {
    for policy in [Policy::Mid, Policy::Safe] {
        let report = run(&Options { policy, ..of_part("handle") }).unwrap();
        let interval = report.intervals.f_star_n;
        assert!(interval.low <= report.f_star_n && report.f_star_n <= interval.high, "{interval:?}");
    }
}

#[test]
fn every_built_in_gripper_loads() {
    for (name, most) in [("paper", 40.0), ("robotiq-2f-85", 235.0), ("franka-hand", 70.0)] {
        let gripper = GripperProfile::load(name).unwrap();
        assert_eq!(gripper.force_n[1], most, "{name}");
        close(gripper.force_for(gripper.command_for(30.0)), 30.0);
    }
}

#[test]
fn without_a_name_the_part_nearest_the_center_of_mass_bears() {
    let report = run(&Options::default()).unwrap();
    assert_eq!((report.part.as_str(), report.part_chosen), ("steel head", PartChoice::NearestCenterOfMass));
}

#[test]
fn parts_by_name() {
    for name in ["0", "Wooden Handle", "handle", "material of wooden"] {
        assert_eq!(run(&of_part(name)).unwrap().part_id, 0, "{name}");
    }
    let missing = run(&of_part("blade")).unwrap_err().to_string();
    assert!(
        missing.contains("blade") && missing.contains("wooden handle") && missing.contains("steel head"),
        "{missing}"
    );
    assert!(matches!(run(&of_part("material")), Err(GraspError::AmbiguousPart { .. })));
    assert!(matches!(run(&of_part("")), Err(GraspError::NoSuchPart { .. })));
}

#[test]
fn a_part_is_called_by_its_name_before_another_that_mentions_it() {
    let (mut parts, labels) = hammer();
    parts.parts[0].caption = "wooden handle below the head; pale".into();
    parts.parts[1].caption = "steel head of a hammer with a wooden handle".into();
    let found = |name| grasp(&parts, &labels, None, 1.0, &paper(), &of_part(name)).map(|report| report.part_id);
    for (name, id) in [("head", 1), ("Steel Head", 1), ("handle", 0), ("wooden handle", 0), ("pale", 0), ("of a", 1)] {
        assert_eq!(found(name).unwrap(), id, "{name}");
    }
    assert!(matches!(found("material"), Err(GraspError::AmbiguousPart { .. })));
    // Only a caption mentions it: this may be another part than the one that was meant.
    let told = |name| grasp(&parts, &labels, None, 1.0, &paper(), &of_part(name)).unwrap().warnings;
    assert!(told("handle").iter().chain(&told("1")).all(|warning| !warning.contains("no part is called")));
    let doubt = told("pale");
    assert!(doubt.iter().any(|warning| warning.starts_with("no part is called \"pale\"; taking part 0")), "{doubt:?}");
}

/// With `--bodies parts`.
#[test]
fn bodies_that_are_written_as_parts_are_one_part() {
    let (mut parts, labels) = hammer();
    let whole = parts.parts.pop().unwrap();
    let body = |number: usize, gaussians: usize, share: f64, x: f64| {
        changed(whole.clone(), |body| {
            body.caption = format!("{} ({number} of 2)", whole.caption);
            body.gaussians = gaussians;
            body.volume_m3 = whole.volume_m3.map(|volume| volume.scaled(share));
            body.mass_kg = whole.mass_kg.map(|mass| mass.scaled(share));
            body.center_of_mass_m = Some([x, 0.0, 0.0]);
            body.inertia_kg_m2 = Some([[0.001, 0.0, 0.0], [0.0, 0.002, 0.0], [0.0, 0.0, 0.003]]);
        })
    };
    parts.parts.extend([body(1, 40, 0.25, 0.3), body(2, 60, 0.75, -0.1)]);

    let head = parts.part(1).unwrap();
    assert_eq!((head.caption.as_str(), head.gaussians), ("steel head", 100));
    close(head.volume_m3.unwrap().mid, 1e-4);
    let mass = head.mass_kg.unwrap();
    for (sum, whole) in [(mass.low, 0.40), (mass.mid, 0.44), (mass.high, 0.48)] {
        close(sum, whole);
    }
    // 0.11 kg at 0.3 m and 0.33 kg at -0.1 m balance at 0, up to a few roundings of 0.1 m.
    assert!(head.center_of_mass_m.unwrap().into_iter().all(|x| x.abs() < 1e-15), "{:?}", head.center_of_mass_m);
    // 0.11 * 0.3^2 + 0.33 * 0.1^2 = 0.0132 kg m2 about y and z, besides the bodies' own.
    let inertia = head.inertia_kg_m2.unwrap();
    for (axis, by_hand) in [0.002, 0.0172, 0.0192].into_iter().enumerate() {
        close(inertia[axis][axis], by_hand);
    }
    let ids: Vec<u32> = parts.whole_parts().map(|part| part.id).collect();
    assert_eq!((ids, parts.part(2)), (vec![0, 1], None));

    for name in ["1", "steel head", "head", "steel head (2 of 2)"] {
        let report = grasp(&parts, &labels, None, 1.0, &paper(), &of_part(name)).unwrap();
        assert_eq!((report.part_id, report.part.as_str()), (1, "steel head"), "{name}");
    }
    let missing = grasp(&parts, &labels, None, 1.0, &paper(), &of_part("2")).unwrap_err();
    assert!(matches!(missing, GraspError::NoSuchPart { .. }), "a body's number is no name: {missing}");
    assert!(part_lines(&labels, Some(&parts)).contains("440 g (400 to 480)"), "{}", part_lines(&labels, Some(&parts)));
}

#[test]
fn a_part_whose_caption_names_nothing_is_called_by_its_material() {
    let (mut parts, labels) = hammer();
    parts.parts[0].caption = String::new();
    parts.parts[0].material = "hickory, dry".into();
    let report = grasp(&parts, &labels, None, 1.0, &paper(), &of_part("0")).unwrap();
    assert_eq!(report.material, "hickory, dry");
    assert!(grasp_line(&report).contains(" the hickory slips "), "{}", grasp_line(&report));
}

#[test]
fn options_outside_their_domain_are_refused() {
    for lift_angle_deg in [-1.0, 90.5, f64::NAN] {
        let options = Options { lift_angle_deg, ..Options::default() };
        let error = run(&options).unwrap_err();
        assert!(matches!(error, GraspError::Option(_)) && !error.is_of_the_object(), "{lift_angle_deg}");
    }
    let curvature = Options { max_curvature: Some(0.0), ..Options::default() };
    assert!(matches!(run(&curvature), Err(GraspError::Option(_))));
    for safety_factor in [0.9, f64::NAN] {
        let factor = Options { safety_factor, ..Options::default() };
        assert!(matches!(run(&factor), Err(GraspError::Option(_))));
    }
    let margin = Options { force_margin: 0.51, ..Options::default() };
    assert!(matches!(run(&margin), Err(GraspError::Option(_))));
}

#[test]
fn why_no_force_is_safe_is_told_with_advice_that_fits() {
    let (parts, labels) = hammer();
    let verdict = |force_n: [f64; 2], strength_pa: f64| {
        let mut labels = labels.clone();
        labels[0].yield_strength_pa = Estimate::exactly(strength_pa);
        let [least, most] = force_n;
        let profile = format!(
            "name = \"g\"\nforce_n = [{least:?}, {most:?}]\nfinger_area_m2 = 1.1e-4\npad = \"rubber\"\n\
             [command]\nenabled_from = 0.0\nfull = 1.0\n"
        );
        let gripper = GripperProfile::from_toml(&profile, "test").unwrap();
        let report = grasp(&parts, &labels, None, 1.0, &gripper, &of_part("handle")).unwrap();
        assert!(!report.feasible);
        report.infeasible.unwrap()
    };
    // F_min is 3.92 N; a strength of 1e4 Pa on 1.1e-4 m2 bears 1.1 N, of 1e5 Pa 11 N.
    let weak = verdict([0.0, 3.0], 5e7);
    assert_eq!(weak.reason, Reason::TooWeak);
    assert!(weak.explanation.contains("3.92 N") && weak.explanation.contains("3 N"), "{weak}");
    assert!(weak.advice.contains("stronger gripper") && weak.advice.contains("two hands"), "{weak}");
    let strong = verdict([20.0, 40.0], 1e5);
    assert_eq!(strong.reason, Reason::TooStrong);
    assert!(strong.explanation.contains("at most 11 N") && strong.advice.contains("gentler"), "{strong}");
    let tender = verdict([0.0, 40.0], 1e4);
    assert_eq!(tender.reason, Reason::Damage);
    assert!(tender.explanation.contains("1.1 N") && tender.advice.contains("wider fingers"), "{tender}");
    assert!(!tender.advice.contains("stronger"), "{tender}");
}

#[test]
fn kappa_max_is_that_of_the_parts_family_unless_it_is_given() {
    let (parts, mut labels) = hammer();
    labels[0].family = "glass".to_owned();
    let curvature = |max_curvature| {
        let options = Options { max_curvature, ..of_part("handle") };
        grasp(&parts, &labels, None, 1.0, &paper(), &options).unwrap().inputs.max_curvature_1_m
    };
    assert!(curvature(None) < 0.5, "glass breaks sooner than metal");
    assert_eq!(curvature(Some(0.5)), 0.5);
}

#[test]
fn properties_that_bear_no_force_are_refused() {
    let (mut parts, mut labels) = hammer();
    labels[0].friction_rubber = Estimate::exactly(0.0);
    let error = grasp(&parts, &labels, None, 1.0, &paper(), &of_part("0")).unwrap_err().to_string();
    assert!(error.contains("friction") && error.contains("wooden handle"), "{error}");
    labels[0].friction_rubber = Estimate::new(0.0, 0.4, 0.8);
    assert!(matches!(grasp(&parts, &labels, None, 1.0, &paper(), &of_part("0")), Err(GraspError::Property { .. })));
    parts.parts[1].thickness_m = Some(Estimate::exactly(0.0));
    let error = grasp(&parts, &labels, None, 1.0, &paper(), &of_part("1")).unwrap_err().to_string();
    assert!(error.contains("thickness"), "{error}");
    parts.parts[1].thickness_m = None;
    parts.parts[1].no_volume = Some(NoVolume::OwnsNoPlace);
    let error = grasp(&parts, &labels, None, 1.0, &paper(), &of_part("1")).unwrap_err().to_string();
    assert!(error.contains("no surface of its own") && error.contains("--part"), "{error}");
}

#[test]
fn profiles_that_are_wrong_are_refused() {
    let good = "name = \"g\"\nforce_n = [5.0, 70.0]\nfinger_area_m2 = 2e-4\npad = \"rubber\"\n[command]\nenabled_from = 0.0\nfull = 1.0\n";
    let command = |text: &str| GripperProfile::from_toml(text, "test").map(|p| p.command_for(37.5));
    // Half of the way from 5 to 70 N.
    close(command(good).unwrap(), 0.5);
    let refused = |from: &str, to: &str, needle: &str| {
        let error = command(&good.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(needle) && error.contains("test"), "{error}");
    };
    refused("name = \"g\"", "name = \"g\"\nfinger_aera_m2 = 1.0", "finger_aera_m2");
    refused("[5.0, 70.0]", "[70.0, 5.0]", "force_n");
    for area in ["0.0", "9e-7", "0.2", "inf", "nan"] {
        refused("2e-4", area, "finger_area_m2 must be from 1e-6 to 0.1");
    }
    refused("\"rubber\"", "\"velcro\"", "velcro");
    refused("full = 1.0", "full = 0.0", "command");
    refused("enabled_from = 0.0", "enabled_from = -inf", "both finite");
    refused("full = 1.0", "full = inf", "both finite");
    refused("full = 1.0", "full = nan", "both finite");
    refused("full = 1.0", "full = 1.0\n[[calibration]]\ncommand = 0.5\nforce_n = 9.0", "too few");
    refused("[command]\nenabled_from = 0.0\nfull = 1.0", "", "no calibration");
    refused("name = \"g\"", "name = ", "line 1");
    assert!(matches!(GripperProfile::load("no such gripper"), Err(GraspError::NoSuchGripper { .. })));
}

proptest! {
    #[test]
    fn every_force_is_within_the_gripper_and_infeasible_is_flagged(
        hold in 1.0..5.0f64, factor in 1.0..9.0f64, f_min in 0.0..1e4f64, f_max in 0.0..1e6f64, low in 0.0..50.0f64, span in 0.1..500.0f64, margin in 0.0..=0.5f64,
    ) {
        let upper = ForceMax { newtons: f_max, limit: Limit::Yield };
        let bounds = Bounds { f_min_n: f_min, upper, gripper_n: [low, low + span], margin };
        for force in [f_star(&bounds), f_safe(hold * f_min, factor, &bounds)] {
            prop_assert!((low..=low + span).contains(&force.newtons));
            let spares_and_holds = f_min < f_max && (f_min..=f_max).contains(&force.newtons);
            prop_assert_eq!(force.infeasible_because.is_none(), spares_and_holds);
            if f_min >= f_max {
                prop_assert_eq!(force.limit, Limit::Slip);
            }
        }
    }

    /// Over both cases: heavier never means a weaker grip, nor does a stronger part.
    #[test]
    fn no_force_falls_with_mass_or_strength(
        mass in 1e-3..50.0f64, more in 1e-3..50.0f64, f_max in 1e-2..1e3f64, stronger in 1.0..10.0f64,
        friction in 0.05..2.0f64, degrees in 0.0..=90.0f64, low in 0.0..50.0f64, span in 0.1..500.0f64,
        margin in 0.0..=0.5f64, factor in 1.0..9.0f64, tilting in 0.0..1.0f64, apart_m in 1e-3..0.1f64, shift_m in 0.0..3e-3f64,
    ) {
        let forces = |mass, newtons| {
            let f_min_n = f_min(mass, friction, degrees.to_radians(), GRAVITY_M_S2);
            let upper = ForceMax { newtons, limit: Limit::Yield };
            let bounds = Bounds { f_min_n, upper, gripper_n: [low, low + span], margin };
            let load = Load { f_min_n, turning_n_m: 1e-2 * mass, tilting_n_m: tilting * mass };
            let hold_n = f_hold(&load, &TwoPads { friction, arm_m: 4e-3, shift_m, apart_m });
            [f_star(&bounds), f_safe(hold_n, factor, &bounds)].map(|force| force.newtons)
        };
        // Rounding of forces up to 1e4 N.
        let slack = 1e-11;
        for rule in 0..2 {
            prop_assert!(forces(mass, f_max)[rule] <= forces(mass + more, f_max)[rule] + slack);
            prop_assert!(forces(mass, f_max)[rule] <= forces(mass, f_max * stronger)[rule] + slack);
        }
    }

    /// Whatever turns and tilts the object: more of it never needs less force, and the margin is zero where force just holds.
    #[test]
    fn the_least_force_that_holds_is_where_the_margin_is_zero(
        f_min_n in 0.01..50.0f64, turning_n_m in 0.0..1.0f64, tilting_n_m in 0.0..2.0f64, more in 1.0..3.0f64,
        friction in 0.05..2.0f64, arm_m in 1e-4..1e-2f64, shift_m in 0.0..3e-3f64, apart_m in 1e-3..0.1f64,
    ) {
        let (load, pads) = (Load { f_min_n, turning_n_m, tilting_n_m }, TwoPads { friction, arm_m, shift_m, apart_m });
        let hold_n = f_hold(&load, &pads);
        prop_assert!(hold_n.is_finite() && hold_n >= f_min_n);
        prop_assert!(torque_margin_n_m(1.001 * hold_n, &load, &pads) >= 0.0);
        prop_assert!(torque_margin_n_m(0.999 * hold_n, &load, &pads) <= 0.0);
        // Rounding of forces up to 1e6 N.
        let slack = 1e-9 * hold_n;
        let tilted = Load { tilting_n_m: more * tilting_n_m, ..load };
        let turned = Load { turning_n_m: more * turning_n_m, ..load };
        prop_assert!(f_hold(&tilted, &pads) >= hold_n - slack && f_hold(&turned, &pads) >= hold_n - slack);
    }

    #[test]
    fn heavier_objects_need_more_force(
        mass in 1e-3..50.0f64, more in 1e-3..50.0f64, friction in 0.05..2.0f64, degrees in 0.0..=90.0f64,
    ) {
        let force = |mass| f_min(mass, friction, degrees.to_radians(), GRAVITY_M_S2);
        prop_assert!(force(mass) <= force(mass + more));
        prop_assert!(force(mass) >= 0.0 && force(mass).is_finite());
    }

    #[test]
    fn more_friction_needs_less_force(mass in 1e-3..50.0f64, friction in 0.05..2.0f64, more in 0.01..2.0f64, degrees in 0.0..90.0f64) {
        let force = |friction| f_min(mass, friction, degrees.to_radians(), GRAVITY_M_S2);
        prop_assert!(force(friction) >= force(friction + more));
    }
}
