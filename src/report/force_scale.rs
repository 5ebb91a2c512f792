//! The scale of forces on the page, as shares of its length.

use minijinja::{Value, context};

use crate::grasp::GraspReport;

use crate::readable::significant;

/// Positions of slip, grip and damage, in percent of a scale that ends a little above the largest relevant force.
pub fn force_scale(grasp: &GraspReport) -> Value {
    let interesting = grasp.f_star_n.max(grasp.f_min_n);
    let end = round_up(1.25 * interesting.max(grasp.f_max_n.min(4.0 * interesting)));
    let percent = |force: f64| 100.0 * (force / end).clamp(0.0, 1.0);
    let (slip, damage, star) = (percent(grasp.f_min_n), percent(grasp.f_max_n), percent(grasp.f_star_n));
    context! {
        end => significant(end),
        slip,
        safe => (damage - slip).max(0.0),
        star,
        // The text stands on the side of the mark that has more room.
        is_right => star > 50.0,
    }
}

/// The next larger 1, 2 or 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter().find(|step| *step >= value).unwrap_or(value)
}
