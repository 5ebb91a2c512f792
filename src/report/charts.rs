//! The page's two drawings: the scale of forces and the simulation's curves, as places in their SVGs.

use minijinja::{Value, context};

use crate::grasp::GraspReport;
use crate::simulate::FrameSummary;

use super::numbers::significant;

/// Left and right end of the force scale in its drawing.
const SCALE: (f64, f64) = (20.0, 980.0);
/// Left and right end of a curve, and the height of one.
const CURVE: (f64, f64) = (40.0, 460.0);
const CURVE_HEIGHT: f64 = 90.0;

/// Where slip, grip and damage lie on a scale that ends a little beyond what matters.
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

/// The next 1, 2 or 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|step| step * power).into_iter().find(|step| *step >= value).unwrap_or(value)
}

/// Height of the centre of mass and kinetic energy over time, one above the other.
pub fn curves(frames: &[FrameSummary]) -> Vec<Value> {
    let height: Vec<_> = frames.iter().map(|frame| (frame.t_s, frame.center_of_mass_m[2])).collect();
    let energy: Vec<_> = frames.iter().map(|frame| (frame.t_s, frame.kinetic_energy_j)).collect();
    vec![curve("height of the centre of mass", "m", &height, 130.0), curve("kinetic energy", "J", &energy, 264.0)]
}

fn curve(title: &str, unit: &str, points: &[(f64, f64)], base_y: f64) -> Value {
    let values = points.iter().map(|point| point.1);
    let (low, high) = (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max));
    let end = points.last().map_or(1.0, |point| point.0).max(f64::MIN_POSITIVE);
    let place = |&(t, value): &(f64, f64)| {
        let x = CURVE.0 + (CURVE.1 - CURVE.0) * t / end;
        let y = base_y - CURVE_HEIGHT * (value - low) / (high - low).max(f64::MIN_POSITIVE);
        format!("{x:.1} {y:.1}")
    };
    let path: Vec<_> = points.iter().map(place).collect();
    context! {
        title,
        base_y,
        title_y => base_y - CURVE_HEIGHT - 14.0,
        path => if path.is_empty() { String::new() } else { format!("M{}", path.join("L")) },
        range => format!("{} to {} {unit}", significant(low), significant(high)),
    }
}
