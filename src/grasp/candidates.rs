//! The best places to grasp at: forces, torque, free space, ranked.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::cells::Cells;
use super::fingers::free_approach;
use super::forces::torque_margin_n_m;
use super::intervals::{Contact, Forces, Inputs};
use super::places::{Place, Where, places};
use super::stiffness::{FOLDS_RAD, bend_rad};
use super::surface::Surface;
use super::touch::{Pads, Touch};
use super::{GraspError, GripperProfile, Limit, Options, Reason};
use crate::parallel;
use crate::parts::Parts;
use crate::units::Estimate;
use crate::vote::FieldPart;

/// How many places are reported.
pub const REPORTED: usize = 5;
/// Places are ranked by the sum of three terms, smallest first: distance of the line of the contacts from the centre of
/// mass (near a `--point`, of a contact from that point) over the object's radius; F_hold over the greatest force that part and
/// gripper allow (F_min near a `--point`, from which F_hold would lead away, and where F_hold is more than is allowed, since the
/// object may turn there anyway); and misalignment over the friction cone, with this weight. Those at which the object may turn between the fingers come after the others, and those that hold nothing last.
const MISALIGNMENT_WEIGHT: f64 = 0.25;
/// Pads that touch with less of themselves do not hold: what they press on is a line or a point, about which the object rocks. A
/// rail of a quarter of a pad's width touches with as much, and so does a pad whose middle lies an eighth of its width beyond an edge.
const LEAST_TOUCHED: f64 = 1.0 / 3.0;
/// A pad that touches at one point resists no torque: the force that would hold is then large, not infinite.
const LEAST_ARM_M: f64 = 1e-5;
/// Two places are the same if their middles are within a finger's side and their axes within 30 degrees.
const SAME_AXIS: f64 = 0.866;
/// Obstacles are sorted into cells of at least this side, m: for a hand of some 50 mm, smaller cells only take longer.
const LEAST_CELL_M: f64 = 0.005;

/// A place to grasp at. Forces are those of one finger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Candidate {
    /// Caption of the part that both fingers press on.
    pub part: String,
    pub part_id: u32,
    /// Its material, which names the part if the caption does not.
    #[serde(default)]
    pub material: String,
    /// Where the fingers press, world frame, m.
    pub contacts_m: [[f64; 3]; 2],
    /// Midway between the contacts, world frame, m: the gripper's tool centre point.
    pub position_m: [f64; 3],
    /// Rotation from the gripper's axes to the world's, as w x y z: its z points at the object, its y leads from the
    /// first contact to the second, as Franka's hand has them.
    pub quaternion_wxyz: [f64; 4],
    /// Unit vector from the contacts to the palm: the hand approaches in the opposite direction.
    pub approach: [f64; 3],
    pub width_m: f64,
    /// Thickness of the part at the contacts: a shell's wall, or a solid's own along the line of the contacts.
    pub thickness_m: Estimate,
    /// The larger angle between the line of the contacts and the surface's normals there.
    pub misalignment_rad: f64,
    /// The share of a pad that touches the object, of the pad that touches less.
    pub touched_share: f64,
    /// Mean distance of the pressure under a finger from its middle, over both fingers.
    pub pressure_arm_m: f64,
    /// How far this pressure can move before an edge of a pad lifts off.
    pub pressure_shift_m: f64,
    /// By how much the object's weight would bend the part between the contacts and the centre of mass, in radians, if it did not
    /// fold.
    pub bend_rad: f64,
    /// Distance of the line of the contacts from the object's centre of mass.
    pub lever_m: f64,
    /// Distance of the object's centre of mass from the middle of the contacts along their line.
    pub offset_m: f64,
    /// The force to press with, and the limit that sets it.
    pub force_n: f64,
    pub force_limited_by: Limit,
    /// The least force with which the object neither slips nor turns between the fingers.
    pub f_hold_n: f64,
    pub f_min_n: f64,
    pub f_max_n: f64,
    /// The paper's F*, and the limit that sets it.
    pub f_star_n: f64,
    pub limited_by: Limit,
    /// Whether `force_n` holds the object without damaging the part, and without letting it turn between the fingers.
    pub feasible: bool,
    /// Why not; `None` if it is feasible.
    pub infeasible_because: Option<Reason>,
    /// Torque about the line of the contacts that two fingers pressing with `force_n` can hold besides the weight, minus the
    /// torque of the weight at the worst inclination. Negative: the object may turn between the fingers.
    pub torque_margin_n_m: f64,
}

impl Candidate {
    /// Where and how the fingers press.
    pub(super) fn contact(&self) -> Contact {
        let Self { thickness_m, pressure_arm_m, pressure_shift_m, width_m, lever_m, offset_m, .. } = *self;
        Contact { thickness_m, pressure_arm_m, pressure_shift_m, width_m, lever_m, offset_m }
    }
}

/// The orientation of a gripper that presses on two contacts, with the palm in the direction `approach` from them:
/// [`Candidate::quaternion_wxyz`].
fn orientation(contacts: [Point3<f64>; 2], approach: Vector3<f64>) -> [f64; 4] {
    let y = (contacts[1] - contacts[0]).normalize();
    let z = -(approach - y * approach.dot(&y)).normalize();
    let axes = Matrix3::from_columns(&[y.cross(&z), y, z]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    [turn.w, turn.i, turn.j, turn.k]
}

/// The object, as the search for places needs it.
pub struct Graspable<'a> {
    pub parts: &'a Parts,
    pub labels: &'a [FieldPart],
    pub surface: &'a Surface,
}

/// The result of the search.
#[derive(Debug, Default)]
pub struct Found {
    /// The [`REPORTED`] best places, the best first.
    pub candidates: Vec<Candidate>,
    /// Why parts with places were left out, one error for each.
    pub left_out: Vec<GraspError>,
}

/// The best places. Parts whose friction, strength, stiffness or thickness is not positive are left out.
///
/// # Errors
/// If every antipodal place is wider than the gripper's stroke, the mass is not positive, or none of the places has free
/// space for the fingers; if parts were left out, why the first of them was.
pub fn candidates(
    object: &Graspable,
    wanted: Where,
    gripper: &GripperProfile,
    options: &Options,
) -> Result<Found, GraspError> {
    let what = || match wanted {
        Where::Part(label) => format!("part {:?}", object.labels[label as usize].caption),
        Where::Anywhere | Where::Near(_) => "the object".to_owned(),
    };
    let friction = |label: &FieldPart| options.policy.friction(label.friction_rubber);
    let friction: Vec<f64> = object.labels.iter().map(friction).collect();
    let all = places(object.surface, wanted, &friction, gripper.contact_radius_m());
    let stroke_m = gripper.stroke_m.unwrap_or(f64::INFINITY);
    let fitting: Vec<Place> = all.iter().copied().filter(|p| p.width_m() <= stroke_m).collect();
    if fitting.is_empty() && !all.is_empty() {
        return Err(GraspError::StrokeTooSmall {
            what: what(),
            gripper: gripper.name.clone(),
            stroke_mm: stroke_m * 1e3,
            narrowest_mm: all.iter().map(Place::width_m).fold(f64::INFINITY, f64::min) * 1e3,
        });
    }
    let positions: Vec<Point3<f64>> = object.surface.points.iter().map(|point| point.position).collect();
    let pads = Pads::new(object.surface, &positions, gripper.contact_radius_m());
    let touches: Vec<Touch> = parallel::map(&fitting, |place| pads.touch(place));
    let mut ranked = Vec::with_capacity(fitting.len());
    let mut left_out: BTreeMap<u32, GraspError> = BTreeMap::new();
    for (place, touch) in fitting.into_iter().zip(touches) {
        match grip_at(object, place, touch, gripper, options) {
            Ok(Some(grip)) => ranked.push(grip),
            Ok(None) => {}
            Err(error @ GraspError::Property { .. }) => {
                left_out.entry(place.part).or_insert(error);
            }
            Err(error) => return Err(error),
        }
    }
    rank(&mut ranked, object, wanted, gripper, &friction);
    let candidates = best_with_space(&ranked, object, gripper);
    let mut left_out = left_out.into_values();
    if candidates.is_empty() {
        return Err(left_out.next().unwrap_or_else(|| GraspError::NoPlace { what: what() }));
    }
    Ok(Found { candidates, left_out: left_out.collect() })
}

/// A place with what happens there.
struct Grip {
    place: Place,
    touch: Touch,
    bend_rad: f64,
    forces: Forces,
}

impl Grip {
    /// Why it does not hold the object.
    fn infeasible_because(&self) -> Option<Reason> {
        if self.forces.force.infeasible_because.is_some() {
            self.forces.force.infeasible_because
        } else if self.touch.share < LEAST_TOUCHED {
            Some(Reason::Touches)
        } else if self.bend_rad > FOLDS_RAD {
            Some(Reason::Limp)
        } else {
            self.forces.lets_turn().then_some(Reason::Turns)
        }
    }

    /// 0 for a place that holds, 1 where the object may only turn, 2 where nothing holds.
    fn flaw(&self) -> u8 {
        match self.infeasible_because() {
            None => 0,
            Some(Reason::Turns) => 1,
            Some(_) => 2,
        }
    }
}

/// Sorts places, the best first; `friction` is that of each label.
fn rank(grips: &mut Vec<Grip>, object: &Graspable, wanted: Where, gripper: &GripperProfile, friction: &[f64]) {
    let center = Point3::from(object.parts.object.center_of_mass_m);
    let distances = object.surface.points.iter().map(|p| (p.position - center).norm());
    let radius = distances.fold(f64::MIN_POSITIVE, f64::max);
    let cost = |Grip { place, forces, .. }: &Grip| {
        let allowed_n = forces.upper.newtons.min(gripper.force_n[1]);
        let (distance_m, needed_n) = match wanted {
            Where::Near(point) => (place.nearest_m(point), forces.f_min_n),
            Where::Anywhere | Where::Part(_) if forces.hold_n > allowed_n => (forces.inputs.lever_m, forces.f_min_n),
            Where::Anywhere | Where::Part(_) => (forces.inputs.lever_m, forces.hold_n),
        };
        let misalignment = place.misalignment_rad / friction[place.part as usize].atan();
        distance_m / radius + MISALIGNMENT_WEIGHT * misalignment + needed_n / allowed_n
    };
    let mut keyed: Vec<(u8, f64, Grip)> = grips.drain(..).map(|grip| (grip.flaw(), cost(&grip), grip)).collect();
    keyed.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    grips.extend(keyed.into_iter().map(|(_, _, grip)| grip));
}

/// The first [`REPORTED`] of the places that have free space for the fingers; of those that are the same, the first.
fn best_with_space(ranked: &[Grip], object: &Graspable, gripper: &GripperProfile) -> Vec<Candidate> {
    let side = gripper.finger_side_m();
    let cells = Cells::new(&object.surface.obstacles, side.max(LEAST_CELL_M));
    let mut chosen: Vec<(&Place, Candidate)> = Vec::new();
    for grip in ranked {
        let place = &grip.place;
        if chosen.len() == REPORTED {
            break;
        }
        if chosen.iter().any(|(other, _)| same(place, other, side)) {
            continue;
        }
        if let Some(approach) = free_approach(place, side, &object.surface.obstacles, &cells) {
            chosen.push((place, candidate(object, grip, approach)));
        }
    }
    chosen.into_iter().map(|(_, candidate)| candidate).collect()
}

/// What happens at a place; `None` if its part has no mass and so is not part of the object.
fn grip_at(
    object: &Graspable,
    place: Place,
    touch: Touch,
    gripper: &GripperProfile,
    options: &Options,
) -> Result<Option<Grip>, GraspError> {
    let label = &object.labels[place.part as usize];
    let Some(part) = object.parts.part(label.id) else { return Ok(None) };
    if part.volume_m3.is_none() {
        return Ok(None);
    }
    let thickness_m = match part.thickness_m {
        Some(wall) if part.is_wall => wall,
        // With the same relative uncertainty of its size as the part's own.
        Some(of_part) => of_part.scaled(place.thickness_m / of_part.mid),
        None => Estimate::exactly(place.thickness_m),
    };
    let center = Point3::from(object.parts.object.center_of_mass_m);
    let contact = Contact {
        thickness_m,
        pressure_arm_m: touch.arm_m.max(LEAST_ARM_M),
        pressure_shift_m: touch.shift_m,
        width_m: place.width_m(),
        lever_m: place.lever_m(center),
        offset_m: place.offset_m(center),
    };
    let inputs = Inputs::of(object.parts, label, contact, gripper, options)?;
    let forces = inputs.forces(&part.caption, gripper, options)?;
    let bend_rad = bend_rad(&part, &place, &inputs, center);
    Ok(Some(Grip { place, touch, bend_rad, forces }))
}

fn same(a: &Place, b: &Place, side: f64) -> bool {
    (a.middle() - b.middle()).norm() < side && a.axis().dot(&b.axis()).abs() > SAME_AXIS
}

fn candidate(object: &Graspable, grip: &Grip, approach: Vector3<f64>) -> Candidate {
    let Grip { place, touch, bend_rad, forces } = grip;
    let infeasible_because = grip.infeasible_because();
    let part_id = object.labels[place.part as usize].id;
    let part = object.parts.part(part_id);
    let (part, material) = part.map(|part| (part.caption, part.material)).unwrap_or_default();
    Candidate {
        part,
        part_id,
        material,
        contacts_m: place.contacts.map(Into::into),
        position_m: place.middle().into(),
        quaternion_wxyz: orientation(place.contacts, approach),
        approach: approach.into(),
        width_m: place.width_m(),
        thickness_m: forces.inputs.thickness_m,
        misalignment_rad: place.misalignment_rad,
        touched_share: touch.share,
        pressure_arm_m: forces.inputs.pressure_arm_m,
        pressure_shift_m: forces.inputs.pressure_shift_m,
        bend_rad: *bend_rad,
        lever_m: forces.inputs.lever_m,
        offset_m: forces.inputs.offset_m,
        force_n: forces.force.newtons,
        force_limited_by: forces.force.limit,
        f_hold_n: forces.hold_n,
        f_min_n: forces.f_min_n,
        f_max_n: forces.upper.newtons,
        f_star_n: forces.star.newtons,
        limited_by: forces.star.limit,
        feasible: infeasible_because.is_none(),
        infeasible_because,
        torque_margin_n_m: torque_margin_n_m(forces.force.newtons, &forces.load, &forces.pads),
    }
}
