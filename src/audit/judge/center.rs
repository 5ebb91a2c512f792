//! The centre of mass: within the hull of the shapes.

use super::super::hull::extent;
use super::{Finding, Kind, Subject, words};

/// By this share of the size, the centre may lie outside: meshes are coarse, and some parts are not modelled.
const COARSE: f64 = 0.02;

pub fn judge(subject: &Subject) -> Option<Finding> {
    let inertial = subject.inertial()?;
    if subject.engines_fill_in() && !inertial.states_center {
        return None;
    }
    let hull = subject.size.hull.as_ref()?;
    let mass = subject.mass.kg().filter(|mass| *mass > 0.0)?;
    let outside = hull.beyond(&inertial.center_m());
    let is_stated = if inertial.states_center { "lies" } else { "is not stated, and the origin lies" };
    let problem = || {
        format!(
            "the centre of mass ({}) {is_stated} {} outside of its shape",
            words::mass(mass),
            words::length(outside)
        )
    };
    (outside > COARSE * extent(&hull.corners).norm())
        .then(|| subject.finding(Kind::Center, &inertial.place, problem(), subject.remedy_of_shape()))
}
