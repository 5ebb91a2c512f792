//! Checks that a row agrees with the rule of `rules.csv` that it cites: at least half of the narrower of the two ranges
//! must lie in the other. Stiffness and strength are compared by their logarithms, because they vary by factors. A range
//! that is computed from another number of the row is only as good as that number, which must not be judgement.

use super::Findings;
use super::physics::gent_modulus_pa;
use crate::materials::Material;
use crate::materials::bibliography::{ClassRelation, JUDGEMENT, Rule};
use crate::units::{Range, ShoreScale};

pub fn agrees(material: &Material, rule: &Rule, findings: &mut Findings) {
    if let Some((base, citations)) = basis(material, rule) {
        let judged = citations.iter().any(|citation| citation == JUDGEMENT);
        findings.require(!judged, &material.name, "source", || {
            format!("the rule `{}` computes {} from {base}, which is judgement", rule.id, rule.property)
        });
    }
    let Some(ours) = range_of(material, &rule.property) else {
        let message = format!("has no {} for the rule `{}`", rule.property, rule.id);
        findings.error(&material.name, "source", message);
        return;
    };
    let Some(theirs) = expected(material, rule) else { return };
    let by_factors = matches!(rule.property.as_str(), "youngs_modulus" | "strength") && ours.low.min(theirs.low) > 0.0;
    let scaled = |range: Range| if by_factors { Range::new(range.low.ln(), range.high.ln()) } else { range };
    findings.require(half_meets(scaled(ours), scaled(theirs)), &material.name, "source", || {
        format!(
            "{} {:e} to {:e} is not that of the rule `{}`, {:e} to {:e}",
            rule.property, ours.low, ours.high, rule.id, theirs.low, theirs.high
        )
    });
}

/// The number of the row from which the rule computes its range, and that number's sources.
fn basis<'a>(material: &'a Material, rule: &Rule) -> Option<(&'static str, &'a [String])> {
    let sources = &material.sources;
    match rule.relation {
        ClassRelation::ShoreDOfStrength => Some(("strength", sources.strength.as_slice())),
        ClassRelation::ShoreDOfWood | ClassRelation::FoamScaling => Some(("density", sources.density.as_slice())),
        ClassRelation::ShoreAOfModulus => Some(("youngs_modulus", sources.youngs_modulus.as_slice())),
        ClassRelation::ShoreToStiffness if rule.property == "youngs_modulus" => {
            Some(("hardness", sources.hardness.as_slice()))
        }
        ClassRelation::Interval | ClassRelation::ShoreToStiffness | ClassRelation::CompositeBounds => None,
    }
}

fn range_of(material: &Material, property: &str) -> Option<Range> {
    let shore = |scale: ShoreScale| material.hardness.filter(|hardness| hardness.scale == scale).map(|one| one.range);
    match property {
        "density" => Some(material.density_kg_m3),
        "youngs_modulus" => Some(material.youngs_modulus_pa),
        "poisson_ratio" => Some(material.poisson_ratio),
        "strength" => Some(material.strength_pa),
        "friction_rubber" => Some(material.friction_rubber),
        "friction_steel" => Some(material.friction_steel),
        "shore_a" => shore(ShoreScale::A),
        "shore_d" => shore(ShoreScale::D),
        _ => None,
    }
}

/// The contact pressure of a cone over the yield stress (Tabor 1951).
const CONSTRAINT: f64 = 3.0;

/// The range that the rule gives for the material; `None` if another check tests the relation.
fn expected(material: &Material, rule: &Rule) -> Option<Range> {
    let bounds = rule.bounds?;
    let read = |range: Range, reading: &dyn Fn(f64) -> f64| {
        let shifted = |value: f64, points: f64| (reading(value) + points).clamp(0.0, 100.0);
        Some(Range::new(shifted(range.low, bounds.low), shifted(range.high, bounds.high)))
    };
    match rule.relation {
        ClassRelation::Interval => Some(bounds),
        ClassRelation::ShoreDOfStrength => read(material.strength_pa, &|strength| shore_d(CONSTRAINT * strength)),
        ClassRelation::ShoreDOfWood => read(material.density_kg_m3, &|density| shore_d(janka_pressure_pa(density))),
        ClassRelation::ShoreAOfModulus => read(material.youngs_modulus_pa, &shore_a),
        ClassRelation::FoamScaling | ClassRelation::ShoreToStiffness | ClassRelation::CompositeBounds => None,
    }
}

/// Rounding of the ends of a range, in its unit or its logarithm.
const ROUNDING: f64 = 1e-9;

fn half_meets(one: Range, other: Range) -> bool {
    let width = |range: Range| range.high - range.low;
    let common = one.high.min(other.high) - one.low.max(other.low);
    common >= 0.5 * width(one).min(width(other)) - ROUNDING
}

/// The type D durometer of ASTM D2240: force in N at a reading of 100, depth in m at 0, half the cone's angle, radius of
/// its tip in m.
const FULL_FORCE: f64 = 44.48;
const FULL_DEPTH: f64 = 2.54e-3;
const HALF_ANGLE_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;
const TIP_RADIUS: f64 = 1e-4;

/// Shore D of a solid that carries the contact pressure `pressure_pa`.
fn shore_d(pressure_pa: f64) -> f64 {
    largest(100.0, |reading| {
        let area = cone_area_m2(FULL_DEPTH * (1.0 - reading / 100.0));
        pressure_pa * area >= FULL_FORCE * reading / 100.0
    })
}

/// The cone's cross-section at a depth: of its spherical tip, then of its flank.
fn cone_area_m2(depth: f64) -> f64 {
    let tip_depth = TIP_RADIUS * (1.0 - HALF_ANGLE_RAD.sin());
    let radius = if depth <= tip_depth {
        (2.0 * TIP_RADIUS * depth - depth * depth).sqrt()
    } else {
        TIP_RADIUS * HALF_ANGLE_RAD.cos() + (depth - tip_depth) * HALF_ANGLE_RAD.tan()
    };
    std::f64::consts::PI * radius * radius
}

/// Side hardness of wood of a density at 12 % moisture, 3770 lbf G^2.25 (Forest Products Laboratory), as the pressure on
/// the ball's 100 mm2.
fn janka_pressure_pa(density_kg_m3: f64) -> f64 {
    let specific_gravity = density_kg_m3 / 1.12e3;
    3770.0 * 4.448_22 * specific_gravity.powf(2.25) / 1e-4
}

/// Shore A of an elastic solid (Gent 1958), whose relation ends just below 100.
fn shore_a(youngs_modulus_pa: f64) -> f64 {
    largest(99.9, |reading| gent_modulus_pa(reading) <= youngs_modulus_pa)
}

/// The largest number from 0 to `most` for which `holds` is true; 0 if there is none. Above that number, `holds` must be
/// false, and below it true.
fn largest(most: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, most);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::{half_meets, shore_a, shore_d};
    use crate::materials::check::gent_modulus_pa;
    use crate::units::Range;

    /// Brinell 100 is 981 MPa: the cone sinks by 0.16 mm, of which the tip takes 0.074 mm.
    #[test]
    fn hard_metals_read_near_the_end_of_the_scale() {
        let reading = shore_d(981e6);
        assert!((reading - 94.2).abs() < 0.3, "{reading}");
        assert!(shore_d(5e9) > 99.0 && shore_d(10e6) < 30.0);
    }

    #[test]
    fn shore_a_inverts_gents_relation() {
        for reading in [0.0, 20.0, 55.0, 90.0] {
            let back = shore_a(gent_modulus_pa(reading));
            assert!((back - reading).abs() < 1e-6, "{reading}: {back}");
        }
    }

    #[test]
    fn half_of_the_narrower_range_must_lie_in_the_other() {
        let meets = |a: [f64; 2], b: [f64; 2]| half_meets(Range::from(a), Range::from(b));
        assert!(meets([0.0, 10.0], [5.0, 25.0]) && meets([0.0, 10.0], [2.0, 3.0]) && meets([1.0, 2.0], [1.5, 1.5]));
        assert!(!meets([0.0, 10.0], [6.0, 25.0]) && !meets([1.0, 2.0], [3.0, 3.0]));
    }
}
