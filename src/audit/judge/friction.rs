//! Sliding friction: that something states it, and that a pair of materials can have it.

use std::sync::LazyLock;

use super::{Finding, Kind, Subject};
use crate::materials::MaterialLibrary;
use crate::scene::mesh::containers::{Format, Friction, Mobility};
use crate::words::readable::significant;

/// Measured coefficients of one pair of materials scatter by about this factor.
const SCATTER: f64 = 1.25;

/// The least and the largest friction on rubber or steel in the library.
static RANGE: LazyLock<[f64; 2]> = LazyLock::new(|| {
    let materials = MaterialLibrary::builtin().materials().iter();
    let all = materials.flat_map(|material| [material.friction_rubber, material.friction_steel]);
    all.fold([f64::INFINITY, 0.0], |[low, high], range| [range.low.min(low), range.high.max(high)])
});

pub fn judge(subject: &Subject) -> Vec<Finding> {
    let body = subject.body;
    let of_shapes = body.shapes.iter().filter(|shape| shape.role.collides());
    let collides = of_shapes.clone().count() > 0;
    let mut stated: Vec<&Friction> =
        of_shapes.filter_map(|shape| shape.friction.as_ref()).chain(&body.friction).collect();
    if stated.is_empty() && collides && body.mobility != Mobility::Static {
        return vec![missing(subject)];
    }
    // One finding for each value, however many shapes have it.
    stated.sort_by(|a, b| a.coefficient.total_cmp(&b.coefficient).then(a.place.line.cmp(&b.place.line)));
    stated.dedup_by_key(|friction| friction.coefficient);
    stated.into_iter().filter_map(|friction| out_of_range(subject, friction)).collect()
}

fn missing(subject: &Subject) -> Finding {
    let (problem, remedy) = match subject.container.format {
        Format::Urdf => (
            "it states no friction, so every simulator takes a default of its own",
            "add <contact><lateral_friction value=\"..\"/></contact> (PyBullet), <drake:mu_static> (Drake) or <mu1> (Gazebo)",
        ),
        Format::Gltf => (
            "it states no friction, so every engine takes a default of its own",
            "give its colliders a physicsMaterial",
        ),
        Format::Usd => (
            "it states no friction, so every engine takes a default of its own",
            "bind a material with PhysicsMaterialAPI to its colliders (material:binding:physics)",
        ),
        Format::Mjcf => ("it states no friction, and MuJoCo takes 1", "give its geoms friction"),
    };
    subject.finding(Kind::FrictionMissing, &subject.body.place, problem.to_owned(), remedy)
}

fn out_of_range(subject: &Subject, friction: &Friction) -> Option<Finding> {
    let [low, high] = *RANGE;
    let is_possible = (low / SCATTER..=high * SCATTER).contains(&friction.coefficient);
    let problem = || {
        format!(
            "its friction of {} is that of no material: those of the library have {low} (ice on steel) to {high} (gel on rubber)",
            significant(friction.coefficient)
        )
    };
    let remedy = "state the coefficient of the pair of materials";
    (!is_possible).then(|| subject.finding(Kind::FrictionRange, &friction.place, problem(), remedy))
}
