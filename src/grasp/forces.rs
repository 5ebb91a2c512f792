//! The paper's bounds on the force of one finger, on numbers alone. Derived in docs/grasp.md.
//!
//! ```text
//! F_min = sum_i 1/2 rho_i V_i g (cos(theta) / mu - sin(theta))
//! F_max = min(A sigma_y, 1/2 A E d kappa_max)
//! mean  = (F_min + F_max) / 2
//! F*    = mean cut to [ [F_min]_G + eta dF, [F_max]_G - eta dF ]    if F_min < F_max
//!       = [mean]_G                                                 if F_min >= F_max
//! dF    = max(0, [F_max]_G - [F_min]_G)
//! ```
//!
//! `[f]_G` clamps a force to the gripper's range G. mu, sigma_y, E, d and kappa_max are those of the grasped part, rho_i
//! and V_i those of every part.
//!
//! Source: Xu et al., *GaussianProperty*, arXiv 2412.11258, section 3.5 and supplement A.

use super::{Limit, Reason};

/// The smallest force of one finger, in N, that holds `mass_kg` (the sum of rho_i V_i) against slip. Never negative: if
/// tan(theta) > 1/mu, the object rests on the finger and needs no force. Infinite for zero friction below 90 degrees.
pub fn f_min(mass_kg: f64, friction: f64, lift_angle_rad: f64, gravity_m_s2: f64) -> f64 {
    let per_weight = lift_angle_rad.cos() / friction - lift_angle_rad.sin();
    (0.5 * mass_kg * gravity_m_s2 * per_weight).max(0.0)
}

/// Those properties of the grasped part that limit the force of one finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GraspedPart {
    pub area_m2: f64,
    pub strength_pa: f64,
    pub youngs_modulus_pa: f64,
    pub thickness_m: f64,
    pub max_curvature_1_m: f64,
}

/// The largest force that a part bears, and the limit that sets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceMax {
    pub newtons: f64,
    /// [`Limit::Yield`] or [`Limit::Bending`].
    pub limit: Limit,
}

/// The largest force of one finger that neither crushes nor bends the part. Yield is named if both limits are equal.
pub fn f_max(part: &GraspedPart) -> ForceMax {
    let crush = part.area_m2 * part.strength_pa;
    let bend = 0.5 * part.area_m2 * part.youngs_modulus_pa * part.thickness_m * part.max_curvature_1_m;
    if bend < crush {
        ForceMax { newtons: bend, limit: Limit::Bending }
    } else {
        ForceMax { newtons: crush, limit: Limit::Yield }
    }
}

/// The force to use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceStar {
    pub newtons: f64,
    pub limit: Limit,
    /// Why it does not hold the object without damaging the part; `None` if it does.
    pub infeasible_because: Option<Reason>,
}

/// F*, by the paper's two cases. `gripper_n` is the gripper's range G, `margin` is eta, 0 to 0.5.
///
/// **F_min < F_max**: the mean, kept away from both ends of the gripper's range between the bounds by eta times its
/// length. Feasible if F* then lies between F_min and F_max, that is, if the gripper can reach it. Limited by what sets
/// F_max, or by the gripper if its range changed the force.
///
/// **F_min >= F_max**: no force holds the object without damaging the part; the mean, clamped to the gripper's range.
/// Infeasible, limited by slip.
///
/// F* is continuous over both cases, always within the gripper's range, and never decreases if F_min or F_max
/// increases.
pub fn f_star(f_min_n: f64, upper: ForceMax, gripper_n: [f64; 2], margin: f64) -> ForceStar {
    let in_gripper = |force: f64| force.clamp(gripper_n[0], gripper_n[1]);
    let mean = 0.5 * (f_min_n + upper.newtons);
    if f_min_n >= upper.newtons {
        let infeasible_because = Some(Reason::Damage);
        return ForceStar { newtons: in_gripper(mean), limit: Limit::Slip, infeasible_because };
    }
    let (least, most) = (in_gripper(f_min_n), in_gripper(upper.newtons));
    let inset = margin * (most - least);
    let newtons = mean.max(least + inset).min(most - inset);
    let untouched = (least, most) == (f_min_n, upper.newtons) || newtons == mean;
    let infeasible_because =
        if newtons < f_min_n { Some(Reason::TooWeak) } else { (newtons > upper.newtons).then_some(Reason::TooStrong) };
    ForceStar { newtons, limit: if untouched { upper.limit } else { Limit::Gripper }, infeasible_because }
}
