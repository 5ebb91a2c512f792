//! The scale of forces on the page, as shares of its length.

use minijinja::{Value, context};

use crate::grasp::{GraspReport, Reason};
use crate::words::readable::significant;

/// The scale ends at this many times the larger of the force to press with and the least one that holds, so that there is room beside the mark; or a tenth beyond
/// F_max if that is less.
const ROOM: f64 = 1.5;
const BEYOND_DAMAGE: f64 = 1.1;

/// Positions of slip, turning, grip and damage, in percent of a scale that ends a little above the largest relevant force, and the
/// words for the forces that hold.
pub fn force_scale(grasp: &GraspReport) -> Value {
    let relevant = grasp.force_n.max(grasp.f_hold_n);
    let end = round_up((ROOM * relevant).min(BEYOND_DAMAGE * relevant.max(grasp.f_max_n)));
    let percent = |force: f64| 100.0 * (force / end).clamp(0.0, 1.0);
    let (slip, damage, mark) = (percent(grasp.f_min_n), percent(grasp.f_max_n), percent(grasp.force_n));
    let hold = percent(grasp.f_hold_n).min(damage);
    context! {
        end => significant(end),
        slip,
        turns => (hold - slip).max(0.0),
        holds => (damage - hold.max(slip)).max(0.0),
        effect => effect(grasp.infeasible.as_ref().map(|why| why.reason)),
        mark,
        // The text stands on the side of the mark that has more room.
        is_right => mark > 50.0,
    }
}

/// What forces between the least one that holds and F_max do.
fn effect(unsafe_because: Option<Reason>) -> &'static str {
    match unsafe_because {
        None | Some(Reason::Damage | Reason::Turns) => "holds",
        Some(Reason::TooWeak) => "would hold, but the gripper is too weak",
        Some(Reason::Touches | Reason::Limp) => "would not slip",
        Some(Reason::TooStrong) => "would hold, but the gripper cannot press so gently",
    }
}

/// The next larger round number.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-9).log10().floor());
    [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0]
        .map(|step| step * power)
        .into_iter()
        .find(|step| *step >= value)
        .unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_ends_at_a_round_number() {
        assert_eq!([79.8, 33.0, 101.0].map(round_up), [80.0, 40.0, 120.0]);
    }
}
