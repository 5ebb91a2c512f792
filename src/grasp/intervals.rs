//! Applies the formulas: from intervals of the inputs to intervals of the forces, and by the policy to a single force.

use serde::{Deserialize, Serialize};

use super::forces::{Bounds, Force, ForceMax, GraspedPart, Load, TwoPads, f_hold, f_max, f_min, f_safe, f_star};
use super::options::ForceRule;
use super::{GraspError, GripperProfile, Options, Policy};
use crate::parts::Parts;
use crate::units::{Estimate, GRAVITY_M_S2, Reading};
use crate::vote::FieldPart;

/// The numbers that go into the formulas.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Inputs {
    /// Of the whole object: the sum of rho_i V_i.
    pub mass_kg: Estimate,
    /// Of the grasped part, and so are the next three properties.
    pub friction: Estimate,
    pub strength_pa: Estimate,
    pub youngs_modulus_pa: Estimate,
    pub thickness_m: Estimate,
    pub contact_area_m2: f64,
    /// Mean distance of the pressure under a finger from its middle: 2/3 of the radius of a disc of the finger's area, less if
    /// the pad touches with a part of itself.
    pub pressure_arm_m: f64,
    /// How far this pressure can move before an edge of the pad lifts off: a quarter of that radius on what is flat, 0 on a bar as
    /// thick as the contacts are apart, which rolls under the pads.
    pub pressure_shift_m: f64,
    /// Distance between the contacts; 0, as the next two, if no place was chosen.
    pub width_m: f64,
    /// Distance of the line of the contacts from the centre of mass.
    pub lever_m: f64,
    /// Distance of the centre of mass from the middle of the contacts along their line.
    pub offset_m: f64,
    pub max_curvature_1_m: f64,
    pub lift_angle_rad: f64,
}

/// The forces that follow from the bounds of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Intervals {
    pub f_min_n: Estimate,
    pub f_max_n: Estimate,
    /// Of the force to press with; like F*, it never decreases if a bound increases.
    pub force_n: Estimate,
    /// Over all inputs within their bounds: F* never decreases if F_min or F_max increases, so its ends follow from
    /// theirs.
    pub f_star_n: Estimate,
}

/// The forces of one finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forces {
    pub inputs: Inputs,
    pub intervals: Intervals,
    /// The value of the interval that the policy selects; likewise below.
    pub f_min_n: f64,
    pub upper: ForceMax,
    /// The least force with which the object neither slips nor turns.
    pub hold_n: f64,
    pub star: Force,
    /// The force to press with.
    pub force: Force,
    pub load: Load,
    pub pads: TwoPads,
}

/// The forces of one finger for the low, middle or high values of the inputs.
#[derive(Debug, Clone, Copy)]
struct ForcesOfReading {
    hold_n: f64,
    load: Load,
    pads: TwoPads,
    bounds: Bounds,
}

/// Where the fingers press on a part.
#[derive(Debug, Clone, Copy)]
pub struct Contact {
    pub thickness_m: Estimate,
    /// As in [`Inputs`], like the next four.
    pub pressure_arm_m: f64,
    pub pressure_shift_m: f64,
    pub width_m: f64,
    pub lever_m: f64,
    pub offset_m: f64,
}

impl Forces {
    /// True if the weight can turn the object between fingers that press with this force.
    pub fn lets_turn(&self) -> bool {
        self.force.newtons < self.hold_n
    }
}

impl Inputs {
    /// The inputs if the part of `label` is grasped at this contact.
    ///
    /// # Errors
    /// If a lift angle, curvature or margin is outside its domain.
    pub fn of(
        parts: &Parts,
        label: &FieldPart,
        contact: Contact,
        gripper: &GripperProfile,
        options: &Options,
    ) -> Result<Self, GraspError> {
        Ok(Self {
            mass_kg: parts.object.mass_kg,
            friction: label.friction_rubber,
            strength_pa: label.yield_strength_pa,
            youngs_modulus_pa: label.youngs_modulus_pa,
            thickness_m: contact.thickness_m,
            contact_area_m2: gripper.finger_area_m2,
            pressure_arm_m: contact.pressure_arm_m,
            pressure_shift_m: contact.pressure_shift_m,
            width_m: contact.width_m,
            lever_m: contact.lever_m,
            offset_m: contact.offset_m,
            max_curvature_1_m: options.max_curvature_of(&label.family),
            lift_angle_rad: options.lift_angle_deg.to_radians(),
        })
    }

    /// The forces on `part`.
    ///
    /// # Errors
    /// If friction, strength, stiffness, thickness or mass is not positive.
    pub fn forces(self, part: &str, gripper: &GripperProfile, options: &Options) -> Result<Forces, GraspError> {
        self.check(part)?;
        let reading = |reading| self.of_reading(reading, gripper, options);
        let (low, mid, high) = (reading(Reading::Low), reading(Reading::Mid), reading(Reading::High));
        let estimate =
            |newtons: &dyn Fn(&ForcesOfReading) -> f64| Estimate::new(newtons(&low), newtons(&mid), newtons(&high));
        let force = |of: &ForcesOfReading| match options.force {
            ForceRule::Safety => f_safe(of.hold_n, options.safety_factor, &of.bounds),
            ForceRule::Paper => f_star(&of.bounds),
        };
        let intervals = Intervals {
            f_min_n: estimate(&|of| of.bounds.f_min_n),
            f_max_n: estimate(&|of| of.bounds.upper.newtons),
            force_n: estimate(&|of| force(of).newtons),
            f_star_n: estimate(&|of| f_star(&of.bounds).newtons),
        };
        let chosen = match options.policy {
            Policy::Mid => mid,
            Policy::Safe => {
                let bounds = Bounds { f_min_n: high.bounds.f_min_n, ..low.bounds };
                ForcesOfReading { bounds, ..high }
            }
        };
        Ok(Forces {
            inputs: self,
            intervals,
            f_min_n: chosen.bounds.f_min_n,
            upper: chosen.bounds.upper,
            hold_n: chosen.hold_n,
            star: f_star(&chosen.bounds),
            force: force(&chosen),
            load: chosen.load,
            pads: chosen.pads,
        })
    }

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

    /// The low, middle or high value of all forces: F_min is largest for the heaviest object with the least friction,
    /// F_max smallest for the weakest, softest and thinnest part.
    fn of_reading(&self, reading: Reading, gripper: &GripperProfile, options: &Options) -> ForcesOfReading {
        let read = |e: Estimate| reading.of(e);
        let friction = reading.opposite().of(self.friction);
        let upper = f_max(&GraspedPart {
            area_m2: self.contact_area_m2,
            strength_pa: read(self.strength_pa),
            youngs_modulus_pa: read(self.youngs_modulus_pa),
            thickness_m: read(self.thickness_m),
            max_curvature_1_m: self.max_curvature_1_m,
        });
        let mass_kg = read(self.mass_kg);
        let f_min_n = f_min(mass_kg, friction, self.lift_angle_rad, GRAVITY_M_S2);
        let torque_n_m = |arm_m: f64| mass_kg * GRAVITY_M_S2 * arm_m;
        let load = Load { f_min_n, turning_n_m: torque_n_m(self.lever_m), tilting_n_m: torque_n_m(self.offset_m) };
        let pads =
            TwoPads { friction, arm_m: self.pressure_arm_m, shift_m: self.pressure_shift_m, apart_m: self.width_m };
        ForcesOfReading {
            hold_n: f_hold(&load, &pads),
            load,
            pads,
            bounds: Bounds { f_min_n, upper, gripper_n: gripper.force_n, margin: options.force_margin },
        }
    }
}
