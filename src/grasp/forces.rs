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
//! and, of our own, the force to press with: the least one with which the object neither slips nor turns, times a safety
//! factor s.
//!
//! ```text
//! F_hold = the least F with F^2 >= (F_min + max(0, m g c - 2 F e) / (mu w))^2 + (m g l / (2 mu a))^2
//! F      = s F_hold cut to [ [F_min]_G, [F_max]_G - eta dF ]          if F_min < F_max, else as F*
//! ```
//!
//! `l` is the distance of the line of the contacts from the centre of mass, `c` that of the centre of mass from the middle of
//! the contacts along their line, `w` the distance between the contacts, `a` the mean distance of the pressure under a finger
//! from its middle (for a disc of radius r, 2/3 r), and `e` how far that pressure can move before an edge lifts off (r/4).
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

/// What bounds the force of one finger.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    pub f_min_n: f64,
    pub upper: ForceMax,
    /// The gripper's range G.
    pub gripper_n: [f64; 2],
    /// eta, 0 to 0.5.
    pub margin: f64,
}

/// A force to press with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force {
    pub newtons: f64,
    pub limit: Limit,
    /// Why it does not keep the object from slipping without damaging the part; `None` if it does.
    pub infeasible_because: Option<Reason>,
}

/// F*, by the paper's two cases.
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
pub fn f_star(bounds: &Bounds) -> Force {
    let &Bounds { f_min_n, upper, gripper_n, margin } = bounds;
    let in_gripper = |force: f64| force.clamp(gripper_n[0], gripper_n[1]);
    let mean = 0.5 * (f_min_n + upper.newtons);
    if f_min_n >= upper.newtons {
        let infeasible_because = Some(Reason::Damage);
        return Force { newtons: in_gripper(mean), limit: Limit::Slip, infeasible_because };
    }
    let (least, most) = (in_gripper(f_min_n), in_gripper(upper.newtons));
    let inset = margin * (most - least);
    let newtons = mean.max(least + inset).min(most - inset);
    let untouched = (least, most) == (f_min_n, upper.newtons) || newtons == mean;
    let infeasible_because =
        if newtons < f_min_n { Some(Reason::TooWeak) } else { (newtons > upper.newtons).then_some(Reason::TooStrong) };
    Force { newtons, limit: if untouched { upper.limit } else { Limit::Gripper }, infeasible_because }
}

/// What the object's weight does between two fingers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    pub f_min_n: f64,
    /// The greatest torque about the line of the contacts: m g l.
    pub turning_n_m: f64,
    /// The greatest torque about a line across it, by which one finger carries more than the other: m g c.
    pub tilting_n_m: f64,
}

/// The pads of two fingers on an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoPads {
    pub friction: f64,
    /// Mean distance of the pressure under a finger from its middle.
    pub arm_m: f64,
    /// How far this pressure can move before an edge of the pad lifts off.
    pub shift_m: f64,
    /// Distance between the contacts.
    pub apart_m: f64,
}

impl TwoPads {
    /// The torque about a line across that of the contacts which the pads resist by pressing harder at one edge.
    fn steadied_n_m(&self, force_n: f64) -> f64 {
        2.0 * force_n * self.shift_m
    }

    /// By how much more a finger must press whose friction carries what of the tilting torque the pads do not resist by pressing
    /// harder at one edge.
    fn tilts_n(&self, load: &Load, force_n: f64) -> f64 {
        let rest_n_m = load.tilting_n_m - self.steadied_n_m(force_n);
        if rest_n_m > 0.0 { rest_n_m / (self.friction * self.apart_m) } else { 0.0 }
    }
}

/// The smallest force of one finger, in N, with which the object neither slips nor turns.
///
/// Two fingers that press with F resist turning about their line with up to 2 mu F a. Force along the surface and torque share the
/// friction: to a good approximation, (f / (mu F))^2 + (tau / (mu F a))^2 = 1 (Howe and Cutkosky, *Practical force-motion models
/// for sliding manipulation*, 1996). The weight takes f / (mu F) = F_min / F of each. If the centre of mass is beside both fingers,
/// one of them also carries what holds the object level, M / w, and the other as much downwards; M is m g c less what the pads
/// resist by pressing harder at one edge, F e each.
pub fn f_hold(load: &Load, pads: &TwoPads) -> f64 {
    let turns_n = load.turning_n_m / (2.0 * pads.friction * pads.arm_m);
    let level_n = load.f_min_n.hypot(turns_n);
    if load.tilting_n_m <= pads.steadied_n_m(level_n) {
        return level_n;
    }
    // F^2 = (most - spared F)^2 + turns^2, solved so that no difference of large numbers is divided.
    let most_n = load.f_min_n + pads.tilts_n(load, 0.0);
    let spared = pads.steadied_n_m(1.0) / (pads.friction * pads.apart_m);
    let root_n = (most_n.powi(2) + turns_n.powi(2) * (1.0 - spared * spared)).max(0.0).sqrt();
    (most_n.powi(2) + turns_n.powi(2)) / (most_n * spared + root_n)
}

/// The torque about the line of the contacts that fingers which press with this force hold besides all else, minus that of the
/// weight, N m; what is missing against tilting counts as well. Negative below [`f_hold`].
pub fn torque_margin_n_m(force_n: f64, load: &Load, pads: &TwoPads) -> f64 {
    let tilts_n = pads.tilts_n(load, force_n);
    let taken_n = load.f_min_n + tilts_n;
    let spare_n = (force_n.powi(2) - taken_n.powi(2)).max(0.0).sqrt();
    let missing_n = (taken_n - force_n).clamp(0.0, tilts_n);
    pads.friction * (2.0 * pads.arm_m * spare_n - pads.apart_m * missing_n) - load.turning_n_m
}

/// `factor` times [`f_hold`], as far as part and gripper allow: never nearer, as a ratio, to what damages the part than to what
/// holds it, and as far below the gripper's most as F*. Where no force avoids both slip and damage, F*.
pub fn f_safe(hold_n: f64, factor: f64, bounds: &Bounds) -> Force {
    let &Bounds { f_min_n, upper, gripper_n, margin } = bounds;
    let star = f_star(bounds);
    if star.infeasible_because.is_some() {
        return star;
    }
    let [least, most] = [f_min_n, upper.newtons].map(|force| force.clamp(gripper_n[0], gripper_n[1]));
    let even = (hold_n * upper.newtons).sqrt().max(hold_n);
    let wanted = (factor * hold_n).min(even);
    let newtons = wanted.clamp(least, most - margin * (most - least));
    let limit = if newtons == factor * hold_n {
        Limit::Safety
    } else if newtons == even || newtons < wanted && most == upper.newtons {
        upper.limit
    } else {
        Limit::Gripper
    };
    Force { newtons, limit, infeasible_because: None }
}
