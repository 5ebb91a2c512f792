//! The scale of forces on the page, as positions in its SVG.

use minijinja::{Value, context};

use crate::grasp::GraspReport;

use super::numbers::significant;

/// Left and right end of the force scale in its drawing.
const SCALE: (f64, f64) = (20.0, 980.0);

/// Positions of slip, grip and damage on a scale that ends a little above the largest relevant force.
pub fn force_scale(grasp: &GraspReport) -> Value {
    let interesting = grasp.f_star_n.max(grasp.f_min_n);
    let end = round_up(1.25 * interesting.max(grasp.f_max_n.min(4.0 * interesting)));
    let x = |force: f64| SCALE.0 + (SCALE.1 - SCALE.0) * (force / end).clamp(0.0, 1.0);
    let (slip, damage, star) = (x(grasp.f_min_n.max(0.0)), x(grasp.f_max_n), x(grasp.f_star_n));
    context! {
        end => significant(end),
        slip_width => slip - SCALE.0,
        safe_x => slip,
        safe_width => (damage - slip).max(0.0),
        star_x => star,
        star_anchor => if star > 0.5 * (SCALE.0 + SCALE.1) { "end" } else { "start" },
    }
}

/// The next larger 1, 2 or 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter().find(|step| *step >= value).unwrap_or(value)
}
