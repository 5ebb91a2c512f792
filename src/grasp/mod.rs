//! The force with which a gripper may lift the object without slip or damage.
//!
//! - [`options`]: the user's options;
//! - [`gripper`]: the gripper: its range of force, its finger, its command; [`calibration`]: the command from
//!   measurements;
//! - [`forces`]: the paper's formulas, on numbers alone; [`intervals`]: the same, applied to intervals; [`curvature`]:
//!   how far a part may bend;
//! - [`infeasible`]: why a grasp is not safe;
//! - [`grasped_part`]: which part the fingers press on if no place is chosen;
//! - where to press: the [`surface`], opposite [`places`] on it, what the pads [`touch`] there, space for the [`fingers`], the
//!   best [`candidates`];
//! - [`picture`]: a drawing of the best candidates.

pub mod calibration;
mod calibration_report;
pub mod candidates;
mod cells;
pub mod curvature;
pub mod error;
mod fingers;
pub mod forces;
pub mod grasped_part;
pub mod gripper;
pub mod infeasible;
pub mod intervals;
pub mod options;
pub mod picture;
pub mod places;
mod stiffness;
pub mod surface;
pub mod touch;

use serde::{Deserialize, Serialize};

use crate::parts::{Part, Parts};
use crate::vote::FieldPart;
pub use calibration_report::CalibrationReport;
use candidates::{Candidate, Found, Graspable};
pub use error::GraspError;
use fingers::FINGER_LENGTH_M;
pub use grasped_part::PartChoice;
use gripper::GripperProfile;
pub use infeasible::Infeasible;
use intervals::{Contact, Forces};
pub use intervals::{Inputs, Intervals};
use nalgebra::Point3;
pub use options::{ForceRule, Options, Policy, SCENE_KEYS};
use places::Where;
use surface::Surface;

/// The limit that determines a force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Limit {
    /// Holding the object against slip takes at least as much force as damages the part: F_min >= F_max.
    Slip,
    /// Stress under the finger reaches the part's strength.
    Yield,
    /// The part bends by more than the allowed curvature.
    Bending,
    /// The force is limited by the gripper's range.
    Gripper,
    /// The safety factor alone: the force is that many times the least one that holds the object.
    Safety,
}

/// Why no safe force was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Reason {
    /// Holding the object takes at least as much force as damages the part: F_min >= F_max.
    Damage,
    /// Holding the object takes more force than the gripper has.
    TooWeak,
    /// The gripper's least force damages the part.
    TooStrong,
    /// The object's weight can turn it between the fingers: the torque margin is negative.
    Turns,
    /// Too little of the pads touches the object: an edge, or something much narrower than they are.
    Touches,
    /// The part is too limp to carry the object: it would fold, as a leaf does.
    Limp,
}

impl Reason {
    /// In words, beside a place.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Damage => "no force holds the object without damage",
            Self::TooWeak => "the gripper is too weak",
            Self::TooStrong => "the gripper cannot press so gently",
            Self::Turns => "the object may turn between the fingers",
            Self::Touches => "too little of the pads touches the object",
            Self::Limp => "the part is too limp to carry the object",
        }
    }
}

/// The forces for one object, one part of it and one gripper. Written as `grasp.json`. Forces are those of one finger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct GraspReport {
    /// Caption of the part that the fingers press on.
    pub part: String,
    pub part_id: u32,
    /// Its material, which names the part if the caption does not.
    #[serde(default)]
    pub material: String,
    /// Why it is this part.
    pub part_chosen: PartChoice,
    pub gripper: String,
    pub policy: Policy,
    /// How `force_n` is found.
    pub force_rule: ForceRule,
    pub safety_factor: f64,
    /// The force to press with, as the policy reads it; always within the gripper's range.
    pub force_n: f64,
    /// The limit that sets `force_n`.
    pub force_limited_by: Limit,
    /// The command for the gripper's controller that gives `force_n`.
    pub force_command: f64,
    /// The least force with which the object neither slips nor turns between the fingers, as the policy reads it.
    pub f_hold_n: f64,
    /// The least force with which the object does not slip, as the policy reads it.
    pub f_min_n: f64,
    /// The greatest force that the part withstands, as the policy reads it.
    pub f_max_n: f64,
    /// The limit that sets `f_max_n`: yield or bending.
    pub f_max_limited_by: Limit,
    /// The paper's F*: midway between F_min and F_max as far as the gripper can.
    pub f_star_n: f64,
    /// The limit that sets `f_star_n`: slip, yield, bending or the gripper.
    pub limited_by: Limit,
    /// Whether `force_n` holds the object without damaging the part, and at the best place without letting it turn
    /// between the fingers.
    pub feasible: bool,
    /// Why not, and what to do about it; `None` if it is feasible.
    pub infeasible: Option<Infeasible>,
    /// The command for the gripper's controller that gives `f_star_n`.
    pub normalized_command: f64,
    /// Whether the command inverts a curve through measured pairs; linear in the force otherwise.
    pub command_calibrated: bool,
    pub intervals: Intervals,
    pub inputs: Inputs,
    /// True if all forces follow from a scale that a model estimated; missing otherwise.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub estimated_scale: bool,
    /// The best places to grasp at, best first; the forces above are for the first. Empty if none was found.
    pub candidates: Vec<Candidate>,
    /// Messages about results that should be checked.
    pub warnings: Vec<String>,
    /// Other messages.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// The forces to lift the object with `gripper` by the paper's formulas ([`forces`]), at the best of the places where the
/// fingers fit; without a `surface` on which to look for them, on the part that was named or is nearest to the centre
/// of mass.
///
/// `labels` are the field's, with the properties of each part; a part and its label share an id. `meters_per_unit` is
/// for the user's point, which is in scene units.
///
/// # Errors
/// If a lift angle, curvature or margin is outside its domain; if a part does not exist, its name is ambiguous, or it has
/// no volume; if the mass, or the grasped part's friction, strength, stiffness or thickness, is not positive (of other
/// parts, this is only a warning). If the user says where to grasp: if a point is farther from the object than a finger's
/// length, or no place there has space for the fingers within the stroke; otherwise this is only a warning.
pub fn grasp(
    parts: &Parts,
    labels: &[FieldPart],
    surface: Option<&Surface>,
    meters_per_unit: f64,
    gripper: &GripperProfile,
    options: &Options,
) -> Result<GraspReport, GraspError> {
    options.check()?;
    let (part, chosen) = grasped_part::choose(parts, options.part.as_deref())?;
    let (label, _) = label_of(&part, labels)?;
    if options.part.is_some() && part.volume_m3.is_none() {
        return Err(no_thickness(&part));
    }
    let place = place(label, surface, meters_per_unit, options)?;
    let doubt = options.part.as_deref().and_then(|name| grasped_part::doubt(&part, name));
    let mut warnings: Vec<String> = doubt.into_iter().collect();
    let object = surface.map(|surface| Graspable { parts, labels, surface });
    let candidates = search(object.as_ref(), place, gripper, options, &mut warnings)?;
    let (part, part_chosen, contact) = match candidates.first() {
        Some(best) => {
            let chosen = if options.part.is_some() { PartChoice::Named } else { PartChoice::BestPlace };
            (parts.part(best.part_id).unwrap_or(part), chosen, best.contact())
        }
        None => {
            let nowhere = contact_nowhere(&part, gripper)?;
            (part, chosen, nowhere)
        }
    };
    let (_, label) = label_of(&part, labels)?;
    let inputs = Inputs::of(parts, label, contact, gripper, options)?;
    let Forces { inputs, intervals, f_min_n, upper, hold_n, star, force, .. } =
        inputs.forces(&part.caption, gripper, options)?;
    let of_place = || candidates.first().filter(|best| !best.feasible).map(|best| Infeasible::of_place(best, options));
    let of_force = |reason| Infeasible::of_force(reason, f_min_n, upper.newtons, gripper);
    let infeasible = force.infeasible_because.map(of_force).or_else(of_place);
    warnings.extend(infeasible.as_ref().map(|why| format!("no safe grip: {why}")));
    Ok(GraspReport {
        part: part.caption,
        part_id: part.id,
        material: part.material,
        part_chosen,
        gripper: gripper.name.clone(),
        policy: options.policy,
        force_rule: options.force,
        safety_factor: options.safety_factor,
        force_n: force.newtons,
        force_limited_by: force.limit,
        force_command: gripper.command_for(force.newtons),
        f_hold_n: hold_n,
        f_min_n,
        f_max_n: upper.newtons,
        f_max_limited_by: upper.limit,
        f_star_n: star.newtons,
        limited_by: star.limit,
        feasible: infeasible.is_none(),
        infeasible,
        normalized_command: gripper.command_for(star.newtons),
        command_calibrated: gripper.is_calibrated(),
        intervals,
        inputs,
        estimated_scale: parts.estimated_scale.is_some(),
        candidates,
        warnings,
        notes: note_on_command(gripper).into_iter().collect(),
    })
}

/// The label of a part, with its number among the labels.
fn label_of<'a>(part: &Part, labels: &'a [FieldPart]) -> Result<(u32, &'a FieldPart), GraspError> {
    let of_part = (0..).zip(labels).find(|(_, label)| label.id == part.id);
    of_part.ok_or(GraspError::NoLabel { part: part.id })
}

/// The contact with a part on which no place was found: its thickness is known, and nothing of where the fingers are.
fn contact_nowhere(part: &Part, gripper: &GripperProfile) -> Result<Contact, GraspError> {
    Ok(Contact {
        thickness_m: part.thickness_m.ok_or_else(|| no_thickness(part))?,
        pressure_arm_m: gripper.pressure_arm_m(),
        pressure_shift_m: gripper.pressure_shift_m(),
        width_m: 0.0,
        lever_m: 0.0,
        offset_m: 0.0,
    })
}

fn no_thickness(part: &Part) -> GraspError {
    GraspError::NoThickness { part: part.caption.clone(), why: part.no_volume }
}

/// Where to look for places: on the part that the user names, whose label has the number `named`, or near the point.
///
/// # Errors
/// [`GraspError::PointTooFar`] if no finger reaches the object from the point.
fn place(named: u32, surface: Option<&Surface>, meters_per_unit: f64, options: &Options) -> Result<Where, GraspError> {
    let point = match (&options.part, options.point) {
        (Some(_), _) => return Ok(Where::Part(named)),
        (None, None) => return Ok(Where::Anywhere),
        (None, Some(point)) => point,
    };
    let near = Point3::from(point) * meters_per_unit;
    match surface.and_then(|surface| surface.distance_m(near)) {
        Some(distance_m) if distance_m > FINGER_LENGTH_M => {
            Err(GraspError::PointTooFar { point, distance_mm: distance_m * 1e3, finger_mm: FINGER_LENGTH_M * 1e3 })
        }
        _ => Ok(Where::Near(near)),
    }
}

/// The best places on the object, none if it has no surface. That there is no place is an error only if the user says
/// where to grasp, and otherwise a warning.
fn search(
    object: Option<&Graspable>,
    place: Where,
    gripper: &GripperProfile,
    options: &Options,
    warnings: &mut Vec<String>,
) -> Result<Vec<Candidate>, GraspError> {
    let Some(object) = object else { return Ok(Vec::new()) };
    match candidates::candidates(object, place, gripper, options) {
        Ok(Found { candidates, left_out }) => {
            warnings.extend(left_out.iter().map(|why| format!("a part was left out of the search for places: {why}")));
            Ok(candidates)
        }
        Err(error @ (GraspError::StrokeTooSmall { .. } | GraspError::NoPlace { .. } | GraspError::Property { .. }))
            if !options.names_a_place() =>
        {
            warnings.push(error.to_string());
            Ok(Vec::new())
        }
        Err(error) => Err(error),
    }
}

/// A note if nobody measured the forces that belong to the gripper's commands.
fn note_on_command(gripper: &GripperProfile) -> Option<String> {
    (!gripper.is_calibrated()).then(|| {
        format!(
            "no one has measured which force the commands of gripper {:?} give, so the command is only in proportion to the \
             force: send it the force, or measure and make a profile with `gprop grasp calibrate`",
            gripper.name
        )
    })
}
