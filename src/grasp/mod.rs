//! The force with which a gripper may lift the object without slip or damage.
//!
//! - [`options`]: what the user may choose;
//! - [`gripper`]: the hand: its range of force, its finger, its command;
//! - [`bounds`]: the paper's formulas, on numbers alone;
//! - [`bearer`]: which part the fingers press on.

pub mod bearer;
pub mod bounds;
pub mod error;
pub mod gripper;
pub mod options;

use serde::{Deserialize, Serialize};

use crate::parts::Parts;
use crate::units::{Estimate, GRAVITY_M_S2};
use crate::vote::FieldLabel;
use bounds::{Bearing, ForceMax, f_max, f_min, f_star};
pub use error::GraspError;
use gripper::GripperProfile;
pub use options::{Options, Policy};

/// What limits a grasp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Holding the object takes more force than the part bears: F_min >= F_max.
    Slip,
    /// Stress under the finger reaches the part's strength.
    Yield,
    /// The part bends by more than the allowed curvature.
    Bending,
    /// The force is cut to what the gripper can do.
    Gripper,
}

/// The forces for one object, one part of it and one gripper. Written as `grasp.json`. Forces are those of one finger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GraspReport {
    /// Caption of the part that the fingers press on.
    pub part: String,
    pub part_id: u32,
    /// Why it is this part.
    pub part_chosen: bearer::Choice,
    pub gripper: String,
    pub policy: Policy,
    /// The least force that holds the object, as the policy reads it.
    pub f_min_n: f64,
    /// The greatest force that the part bears, as the policy reads it.
    pub f_max_n: f64,
    /// Which of the two ways to damage it sets `f_max_n`.
    pub f_max_limited_by: Limit,
    /// The force to press with; always within the gripper's range.
    pub f_star_n: f64,
    pub limited_by: Limit,
    /// Whether `f_star_n` both holds the object and spares the part.
    pub feasible: bool,
    /// What to send to the gripper's controller for `f_star_n`.
    pub normalized_command: f64,
    /// Whether the command is interpolated between measured pairs; linear in the force otherwise.
    pub command_calibrated: bool,
    pub intervals: Intervals,
    pub inputs: Inputs,
    pub warnings: Vec<String>,
}

/// What the bounds of the inputs make of the forces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intervals {
    pub f_min_n: Estimate,
    pub f_max_n: Estimate,
}

/// The numbers that went into the formulas.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    pub mass_kg: Estimate,
    pub friction: Estimate,
    pub strength_pa: Estimate,
    pub youngs_modulus_pa: Estimate,
    pub thickness_m: Estimate,
    pub contact_area_m2: f64,
    pub max_curvature_1_m: f64,
    pub lift_angle_rad: f64,
}

/// Forces to lift the object with `gripper`, after the paper (see [`bounds`] for the formulas).
///
/// `labels` are the field's, with the properties of each part; a part and its label share an id.
///
/// # Errors
/// A lift angle, curvature or margin outside its domain; a part that does not exist or is not told apart by its name; a
/// part whose friction, strength, stiffness or thickness is not positive; a mass that is not positive.
pub fn grasp(
    parts: &Parts,
    labels: &[FieldLabel],
    gripper: &GripperProfile,
    options: &Options,
) -> Result<GraspReport, GraspError> {
    let lift_angle_rad = options.checked_lift_angle_rad()?;
    let (part, part_chosen) = bearer::choose(parts, options.part.as_deref())?;
    let label = labels.iter().find(|l| l.id == part.id).ok_or(GraspError::NoLabel { part: part.id })?;
    let inputs = Inputs {
        mass_kg: parts.object.mass_kg,
        friction: label.friction_rubber,
        strength_pa: label.yield_strength_pa,
        youngs_modulus_pa: label.youngs_modulus_pa,
        thickness_m: part.thickness_m,
        contact_area_m2: gripper.finger_area_m2,
        max_curvature_1_m: options.max_curvature,
        lift_angle_rad,
    };
    inputs.check(&part.caption)?;
    let intervals = inputs.intervals();
    let (f_min_n, upper) = match options.policy {
        Policy::Mid => (intervals.f_min_n.mid, inputs.f_max_at(|e| e.mid)),
        Policy::Safe => (intervals.f_min_n.high, inputs.f_max_at(|e| e.low)),
    };
    let star = f_star(f_min_n, upper, gripper.force_n, options.force_margin);
    Ok(GraspReport {
        part: part.caption.clone(),
        part_id: part.id,
        part_chosen,
        gripper: gripper.name.clone(),
        policy: options.policy,
        f_min_n,
        f_max_n: upper.newtons,
        f_max_limited_by: upper.limit,
        f_star_n: star.newtons,
        limited_by: star.limit,
        feasible: star.feasible,
        normalized_command: gripper.command_for(star.newtons),
        command_calibrated: gripper.is_calibrated(),
        intervals,
        inputs,
        warnings: warnings(gripper, star.feasible, f_min_n, upper),
    })
}

impl Inputs {
    fn check(&self, part: &str) -> Result<(), GraspError> {
        let zero_is_low_enough = [
            ("mass", self.mass_kg),
            ("strength", self.strength_pa),
            ("Young's modulus", self.youngs_modulus_pa),
            ("thickness", self.thickness_m),
        ];
        let fits = |e: Estimate| e.low <= e.mid && e.mid <= e.high && e.low >= 0.0 && e.mid > 0.0 && e.high.is_finite();
        let wrong = zero_is_low_enough.into_iter().find(|(_, estimate)| !fits(*estimate));
        // F_min grows without bound as friction goes to zero.
        let slippery = ("friction", self.friction);
        let wrong = wrong.or((!fits(slippery.1) || slippery.1.low <= 0.0).then_some(slippery));
        if let Some((what, estimate)) = wrong {
            return Err(GraspError::Property { part: part.to_owned(), what, estimate });
        }
        Ok(())
    }

    fn f_max_at(&self, pick: impl Fn(Estimate) -> f64) -> ForceMax {
        f_max(&Bearing {
            area_m2: self.contact_area_m2,
            strength_pa: pick(self.strength_pa),
            youngs_modulus_pa: pick(self.youngs_modulus_pa),
            thickness_m: pick(self.thickness_m),
            max_curvature_1_m: self.max_curvature_1_m,
        })
    }

    /// The forces at the ends of the inputs: F_min is greatest for the heaviest object with the least friction, F_max
    /// least for the weakest, softest and thinnest part.
    fn intervals(&self) -> Intervals {
        let slip = |mass, friction| f_min(mass, friction, self.lift_angle_rad, GRAVITY_M_S2);
        Intervals {
            f_min_n: Estimate::new(
                slip(self.mass_kg.low, self.friction.high),
                slip(self.mass_kg.mid, self.friction.mid),
                slip(self.mass_kg.high, self.friction.low),
            ),
            f_max_n: Estimate::new(
                self.f_max_at(|e| e.low).newtons,
                self.f_max_at(|e| e.mid).newtons,
                self.f_max_at(|e| e.high).newtons,
            ),
        }
    }
}

fn warnings(gripper: &GripperProfile, feasible: bool, f_min_n: f64, upper: ForceMax) -> Vec<String> {
    let mut warnings = Vec::new();
    if !feasible {
        let [least, most] = gripper.force_n;
        warnings.push(format!(
            "no force of {} ({least} to {most} N) both holds the object ({f_min_n:.3} N or more) and spares the part ({:.3} \
             N or less); grasp another part with --part, or use a gripper with a larger finger",
            gripper.name, upper.newtons
        ));
    }
    if !gripper.is_calibrated() {
        warnings.push(format!(
            "gripper {} has no calibration points: its command is taken as linear in the force",
            gripper.name
        ));
    }
    warnings
}
