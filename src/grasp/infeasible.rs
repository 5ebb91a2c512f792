//! Why a grasp is not safe, and what would make it so.

use serde::{Deserialize, Serialize};

use super::candidates::Candidate;
use super::{GripperProfile, Limit, Options, Reason};
use crate::words::part_name::part_name;
use crate::words::readable::significant;

/// Why a grasp is not safe, in words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Infeasible {
    pub reason: Reason,
    /// The numbers that do not fit together.
    pub explanation: String,
    /// Suggested changes.
    pub advice: String,
}

impl Infeasible {
    /// The verdict on forces of one finger that do not fit together.
    pub fn of_force(reason: Reason, f_min_n: f64, f_max_n: f64, gripper: &GripperProfile) -> Self {
        let (name, [least, most]) = (&gripper.name, gripper.force_n.map(significant));
        let [f_min, f_max] = [f_min_n, f_max_n].map(significant);
        let (explanation, advice) = match reason {
            Reason::TooWeak => (
                format!(
                    "each finger must press with at least {f_min} N, but the gripper {name:?} presses with at most {most} N"
                ),
                "use a stronger gripper, or lift with two hands",
            ),
            Reason::TooStrong => (
                format!(
                    "the gripper {name:?} presses with at least {least} N, but the part withstands at most {f_max} N"
                ),
                "use a gentler gripper or wider fingers, or grasp another part with --part",
            ),
            Reason::Damage | Reason::Turns | Reason::Touches | Reason::Limp => (
                format!("each finger must press with at least {f_min} N, but the part withstands at most {f_max} N"),
                "use wider fingers, grasp another part with --part, or lift with two hands",
            ),
        };
        Self { reason, explanation, advice: advice.to_owned() }
    }

    /// The verdict if forces fit together, but the object cannot be held even at the `best` place.
    pub fn of_place(best: &Candidate, options: &Options) -> Self {
        let (reason, explanation, advice) = match best.infeasible_because {
            Some(reason @ Reason::Touches) => (
                reason,
                format!(
                    "only {:.0} % of a pad touches the object: the pad lies over an edge, or on something that is uneven or much \
                     narrower than itself",
                    100.0 * best.touched_share
                ),
                "use smaller pads, or name another part with --part",
            ),
            Some(reason @ Reason::Limp) => (
                reason,
                format!(
                    "the {} is too limp to carry the object: its weight, {} mm away, would fold it",
                    part_name(&best.part, &best.material),
                    significant(1e3 * best.lever_m.hypot(best.offset_m))
                ),
                "name a stiffer part with --part, or support the object from below",
            ),
            _ => return Self::of_torque(best, options),
        };
        Self { reason, explanation, advice: advice.to_owned() }
    }

    /// The verdict if the object may turn between the fingers.
    fn of_torque(best: &Candidate, options: &Options) -> Self {
        let mut advice = vec!["use wider fingers".to_owned()];
        if best.force_limited_by == Limit::Gripper {
            advice.push("use a stronger gripper".to_owned());
        }
        if options.part.is_some() || options.point.is_some() {
            advice.push("grasp nearer to the centre of mass".to_owned());
        }
        let [lever_mm, offset_mm] = [best.lever_m, best.offset_m].map(|length| significant(length * 1e3));
        // Between the contacts, the object hangs from both fingers alike.
        let beside =
            if best.offset_m > best.width_m { format!(" and {offset_mm} mm beside them") } else { String::new() };
        Self {
            reason: Reason::Turns,
            explanation: format!(
                "the weight can turn the object between the fingers: the centre of mass is {lever_mm} mm from the line through \
                 them{beside}, and the torque exceeds their resistance by {} N m",
                significant(-best.torque_margin_n_m)
            ),
            advice: format!("{}, or lift with two hands", advice.join(", ")),
        }
    }
}

impl std::fmt::Display for Infeasible {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}; {}", self.explanation, self.advice)
    }
}
