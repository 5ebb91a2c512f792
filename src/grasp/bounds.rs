//! The paper's bounds on the force of one finger, on numbers alone.
//!
//! Two fingers press an object of mass m with F each; friction mu lets each carry mu F along the surface. The object is
//! lifted along a direction that leaves the vertical by theta. Across that direction the weight's share m g sin(theta)
//! itself presses on a finger, along it 2 mu F must carry m g cos(theta). So with the paper
//!
//! ```text
//! F_min = sum_i 1/2 rho_i V_i g (cos(theta) / mu - sin(theta))
//! F_max = min(A sigma_y, 1/2 A E d kappa_max)
//! F*    = (F_min + F_max) / 2, cut to the gripper's range with margin eta
//! ```
//!
//! A sigma_y is the force whose mean stress under a finger of contact area A is the strength sigma_y. The second bound
//! is the force of the bending stress: a wall of thickness d bent to curvature kappa strains by kappa d / 2 at its outer
//! fibre, there bears E kappa d / 2, and over A that is the bound.
//!
//! Source: Xu et al., *GaussianProperty*, 2024, section on grasping and its supplement.

use super::Limit;

/// The least force of one finger, in N, that holds `mass_kg` (the sum of rho_i V_i) against slip. Never negative: where
/// tan(theta) > 1/mu the object rests on the finger and needs no force. Infinite for zero friction below 90 degrees.
pub fn f_min(mass_kg: f64, friction: f64, lift_angle_rad: f64, gravity_m_s2: f64) -> f64 {
    let per_weight = lift_angle_rad.cos() / friction - lift_angle_rad.sin();
    (0.5 * mass_kg * gravity_m_s2 * per_weight).max(0.0)
}

/// What bears the force of one finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bearing {
    pub area_m2: f64,
    pub strength_pa: f64,
    pub youngs_modulus_pa: f64,
    pub thickness_m: f64,
    pub max_curvature_1_m: f64,
}

/// The greatest force that a part bears, and what would go first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceMax {
    pub newtons: f64,
    /// [`Limit::Yield`] or [`Limit::Bending`].
    pub limit: Limit,
}

/// The greatest force of one finger that neither crushes nor bends the part. Yield is named where both are equal.
pub fn f_max(bearing: &Bearing) -> ForceMax {
    let crush = bearing.area_m2 * bearing.strength_pa;
    let bend = 0.5 * bearing.area_m2 * bearing.youngs_modulus_pa * bearing.thickness_m * bearing.max_curvature_1_m;
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
    pub feasible: bool,
}

/// F*, by two cases.
///
/// **F_min < F_max**: the middle of the two, cut to the gripper's range `[low, high]` less a margin of `margin * (high -
/// low)` at either end. Where the margin would leave no force between F_min and F_max, the full range is used. The grasp
/// is feasible if what results lies between F_min and F_max. Limited by yield or bending (whichever sets F_max), or by
/// the gripper where the cut changed the force.
///
/// **F_min >= F_max**: no force holds the object and spares the part. F* is then F_max cut to the gripper's full range,
/// since an object that slips can be grasped again and a broken one cannot. Infeasible, limited by slip.
pub fn f_star(f_min_n: f64, upper: ForceMax, gripper_n: [f64; 2], margin: f64) -> ForceStar {
    let [low, high] = gripper_n;
    if f_min_n >= upper.newtons {
        return ForceStar { newtons: upper.newtons.clamp(low, high), limit: Limit::Slip, feasible: false };
    }
    let inset = margin * (high - low);
    let holds = |[low, high]: [f64; 2]| low <= upper.newtons && f_min_n <= high;
    let range = if holds([low + inset, high - inset]) { [low + inset, high - inset] } else { gripper_n };
    let middle = 0.5 * (f_min_n + upper.newtons);
    let newtons = middle.clamp(range[0], range[1]);
    let limit = if newtons == middle { upper.limit } else { Limit::Gripper };
    ForceStar { newtons, limit, feasible: holds(range) }
}
