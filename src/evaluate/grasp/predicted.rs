//! How the grasps that gprop proposed would end, and how the paper's three fixed forces would end at the same places, in
//! the form of the paper's table of 16 objects.
//!
//! The judge is not independent: it puts true properties into the formulas from which gprop computed its forces. So it
//! shows errors of mass, material and thickness, not those of the formulas.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Outcome;
use super::truth::Truth;
use crate::grasp::GraspReport;
use crate::grasp::curvature;
use crate::grasp::forces::{GraspedPart, f_max, f_min};
use crate::grasp::gripper::GripperProfile;
use crate::units::GRAVITY_M_S2;
use crate::words::output::one_line;

/// gprop's own policy, and the paper's F* computed by gprop.
const GPROP: &str = "gprop";
const PAPER: &str = "F*";
/// The paper's fixed-force policies: normalised inputs of 15, 60 and 100, with a gripper that obeys 15 to 100. Given as
/// fractions of the enabled commands, for any gripper.
const FIXED: [(&str, f64); 3] = [("MinGF", 0.0), ("MidGF", 45.0 / 85.0), ("MaxGF", 1.0)];

/// Printed below the tables.
pub(super) const NOTE: &str =
    "predicted by gprop's own formulas from true properties, not seen on a robot or in a simulator";

/// An object for which gprop proposed a grasp, with the predicted outcomes. Forces are those of one finger.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GraspedObject {
    pub object: String,
    /// Caption of the part that the fingers press on.
    pub part: String,
    /// From `grasp.json`, like the next six.
    pub force_n: f64,
    pub force_command: f64,
    pub f_min_n: f64,
    pub f_max_n: f64,
    pub f_star_n: f64,
    pub normalized_command: f64,
    pub feasible: bool,
    /// The true properties that decide the outcome.
    pub truth: Truth,
    pub true_f_min_n: f64,
    pub true_f_max_n: f64,
    /// By policy.
    pub grasps: BTreeMap<&'static str, Predicted>,
}

/// How a grasp would end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Predicted {
    pub force_n: f64,
    /// The force is at least the true F_min for a lift straight up.
    pub picked_up: bool,
    /// The force is at most the true F_max.
    pub undamaged: bool,
}

impl GraspedObject {
    /// The outcomes of gprop's force, of F* and of the fixed forces of `gripper` at the place that `report` proposes.
    pub fn new(object: &str, report: &GraspReport, truth: Truth, gripper: &GripperProfile) -> Self {
        let [from, full] = gripper.enabled();
        let fixed = FIXED.map(|(name, share)| (name, gripper.force_for(from + share * (full - from))));
        let true_f_min_n = f_min(truth.mass_kg, truth.friction, 0.0, GRAVITY_M_S2);
        let true_f_max_n = f_max(&GraspedPart {
            area_m2: gripper.finger_area_m2,
            strength_pa: truth.strength_pa,
            youngs_modulus_pa: truth.youngs_modulus_pa,
            thickness_m: truth.thickness_m,
            max_curvature_1_m: curvature::of_family(&truth.family),
        });
        let true_f_max_n = true_f_max_n.newtons;
        let predicted = |force_n: f64| Predicted {
            force_n,
            picked_up: force_n >= true_f_min_n,
            undamaged: force_n <= true_f_max_n,
        };
        let policies = fixed.into_iter().chain([(PAPER, report.f_star_n), (GPROP, report.force_n)]);
        Self {
            object: object.to_owned(),
            part: report.part.clone(),
            force_n: report.force_n,
            force_command: report.force_command,
            f_min_n: report.f_min_n,
            f_max_n: report.f_max_n,
            f_star_n: report.f_star_n,
            normalized_command: report.normalized_command,
            feasible: report.feasible,
            truth,
            true_f_min_n,
            true_f_max_n,
            grasps: policies.map(|(policy, force_n)| (policy, predicted(force_n))).collect(),
        }
    }

    /// Its outcomes in the form of recorded ones.
    pub(super) fn outcomes(&self) -> impl Iterator<Item = Outcome> {
        self.grasps.iter().map(|(policy, grasp)| Outcome {
            object: self.object.clone(),
            policy: (*policy).to_owned(),
            picked_up: grasp.picked_up,
            undamaged: grasp.undamaged,
        })
    }
}

impl Predicted {
    fn word(self) -> &'static str {
        match (self.picked_up, self.undamaged) {
            (true, true) => "held",
            (false, true) => "slips",
            (true, false) => "damaged",
            (false, false) => "slips, damaged",
        }
    }
}

/// One line per object, and the values of the fixed forces; empty without objects.
pub(super) fn table(objects: &[GraspedObject]) -> String {
    let Some(first) = objects.first() else { return String::new() };
    let policies = FIXED.map(|(name, _)| name).into_iter().chain([PAPER, GPROP]);
    let mut text = format!(
        "{:<14} {:<14} {:>8} {:>8} {:>8} {:>10} {:>8} {:>5} {:>9} {:>10}",
        "object", "pressed on", "force N", "F_min N", "F* N", "F_max N", "command", "safe", "true min", "true max"
    );
    policies.clone().for_each(|policy| text += &format!(" {policy:>8}"));
    for o in objects {
        let short = |name: &str| one_line(name).chars().take(14).collect::<String>();
        text += &format!(
            "\n{:<14} {:<14} {:>8.2} {:>8.2} {:>8.2} {:>10.1} {:>8.1} {:>5} {:>9.2} {:>10.1}",
            short(&o.object),
            short(&o.truth.part),
            o.force_n,
            o.f_min_n,
            o.f_star_n,
            o.f_max_n,
            o.force_command,
            if o.feasible { "yes" } else { "no" },
            o.true_f_min_n,
            o.true_f_max_n
        );
        policies.clone().for_each(|policy| text += &format!(" {:>8}", o.grasps[policy].word()));
    }
    let forces: Vec<String> =
        FIXED.iter().map(|(name, _)| format!("{name} {:.1} N", first.grasps[name].force_n)).collect();
    text += &format!("\nfixed forces: {}", forces.join(", "));
    if first.grasps[FIXED[0].0].force_n == 0.0 {
        text +=
            "; according to the profile, the lowest command gives no force at all, so the rates of MinGF mean nothing";
    }
    text + "\n\n"
}
