//! Applies the formulas: from intervals of the inputs to intervals of the forces, and by the policy to a single force.

use serde::{Deserialize, Serialize};

use super::forces::{ForceMax, ForceStar, GraspedPart, f_max, f_min, f_star};
use super::{GraspError, GripperProfile, Options, Policy};
use crate::parts::Parts;
use crate::units::{Estimate, GRAVITY_M_S2, Reading};
use crate::vote::FieldLabel;

/// The numbers that go into the formulas.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Inputs {
    /// Of the whole object: the sum of rho_i V_i.
    pub mass_kg: Estimate,
    /// Of the grasped part, and so are the next three properties.
    pub friction: Estimate,
    pub strength_pa: Estimate,
    pub youngs_modulus_pa: Estimate,
    pub thickness_m: Estimate,
    pub contact_area_m2: f64,
    pub max_curvature_1_m: f64,
    pub lift_angle_rad: f64,
}

/// The forces that follow from the bounds of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Intervals {
    pub f_min_n: Estimate,
    pub f_max_n: Estimate,
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
    pub star: ForceStar,
    pub friction: f64,
    pub mass_kg: f64,
}

impl Inputs {
    /// The inputs if the part of `label` is grasped where it has this thickness.
    ///
    /// # Errors
    /// If a lift angle, curvature or margin is outside its domain.
    pub fn of(
        parts: &Parts,
        label: &FieldLabel,
        thickness_m: Estimate,
        gripper: &GripperProfile,
        options: &Options,
    ) -> Result<Self, GraspError> {
        Ok(Self {
            mass_kg: parts.object.mass_kg,
            friction: label.friction_rubber,
            strength_pa: label.yield_strength_pa,
            youngs_modulus_pa: label.youngs_modulus_pa,
            thickness_m,
            contact_area_m2: gripper.finger_area_m2,
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
        let star = |f_min_n, upper| f_star(f_min_n, upper, gripper.force_n, options.force_margin);
        let [low, mid, high] = [Reading::Low, Reading::Mid, Reading::High].map(|reading| self.bounds(reading));
        let intervals = Intervals {
            f_min_n: Estimate::new(low.0, mid.0, high.0),
            f_max_n: Estimate::new(low.1.newtons, mid.1.newtons, high.1.newtons),
            f_star_n: Estimate::new(
                star(low.0, low.1).newtons,
                star(mid.0, mid.1).newtons,
                star(high.0, high.1).newtons,
            ),
        };
        let friction = options.policy.friction(self.friction);
        let ((f_min_n, _), (_, upper), mass_kg) = match options.policy {
            Policy::Mid => (mid, mid, self.mass_kg.mid),
            Policy::Safe => (high, low, self.mass_kg.high),
        };
        Ok(Forces { inputs: self, intervals, f_min_n, upper, star: star(f_min_n, upper), friction, mass_kg })
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

    /// The low, middle or high value of both bounds: F_min is largest for the heaviest object with the least friction,
    /// F_max smallest for the weakest, softest and thinnest part.
    fn bounds(&self, reading: Reading) -> (f64, ForceMax) {
        let read = |e: Estimate| reading.of(e);
        let friction = reading.opposite().of(self.friction);
        let upper = f_max(&GraspedPart {
            area_m2: self.contact_area_m2,
            strength_pa: read(self.strength_pa),
            youngs_modulus_pa: read(self.youngs_modulus_pa),
            thickness_m: read(self.thickness_m),
            max_curvature_1_m: self.max_curvature_1_m,
        });
        (f_min(read(self.mass_kg), friction, self.lift_angle_rad, GRAVITY_M_S2), upper)
    }
}
