//! Checks each row by itself: order and width of its ranges, its family's bounds, friction, hardness, sources.

use std::collections::{HashMap, HashSet};

use super::{Findings, rules};
use crate::materials::bibliography::{Evidence, RULE, Rule, UNCITED, split_citation};
use crate::materials::{Family, Law, Material, MaterialLibrary, ShoreReading, StrengthKind};
use crate::units::{Range, ShoreScale};

pub fn check(library: &MaterialLibrary, findings: &mut Findings) {
    let known = Known {
        references: library.references.iter().map(|reference| reference.id.as_str()).collect(),
        evidence: library.evidence.iter().map(|one| ((one.source.as_str(), one.entry.as_str()), one)).collect(),
        rules: library.rules.iter().map(|rule| (rule.id.as_str(), rule)).collect(),
    };
    for rule in &library.rules {
        for id in &rule.references {
            findings.require(known.references.contains(id.as_str()), &rule.id, "source", || {
                format!("the rule cites `{id}`, which bibliography.csv does not have")
            });
        }
    }
    for family in library.families() {
        known.require_all(&family.name, "restitution", &family.restitution_sources, findings);
    }
    for material in library.materials() {
        ranges(material, findings);
        widths(material, findings);
        if let Some(family) = library.family(&material.family) {
            family_bounds(material, family, findings);
        }
        poisson(material, findings);
        strength_kind(material, findings);
        friction(material, findings);
        hardness(material, findings);
        sources(material, &known, findings);
    }
}

fn properties(material: &Material) -> [(&'static str, Range); 6] {
    [
        ("density", material.density_kg_m3),
        ("Young's modulus", material.youngs_modulus_pa),
        ("Poisson's ratio", material.poisson_ratio),
        ("strength", material.strength_pa),
        ("friction on rubber", material.friction_rubber),
        ("friction on steel", material.friction_steel),
    ]
}

fn ranges(material: &Material, findings: &mut Findings) {
    for (property, range) in properties(material) {
        findings.require(range.is_valid(), &material.name, "range", || format!("{property} {range:?} is not a range"));
    }
    let positive = [material.density_kg_m3, material.youngs_modulus_pa].iter().all(|range| range.low > 0.0);
    findings.require(positive, &material.name, "range", || "density and modulus must be positive".to_owned());
    let may_be_zero = material.strength_kind == StrengthKind::Cohesion;
    let strong = material.strength_pa.low > 0.0 || may_be_zero;
    findings.require(strong, &material.name, "range", || {
        "the strength must be positive; only a cohesion may be 0".to_owned()
    });
}

/// Largest high/low of density and of E. The limits of solids assume a well-defined material; a vaguer name belongs to
/// the family row.
fn width_limits(family: &str) -> (f64, f64) {
    match family {
        "metal" | "glass" => (1.25, 1.5),
        "thermoplastic" | "thermoset_composite" => (1.25, 3.0),
        "wood" => (2.0, 3.0),
        "stone" | "ceramic" => (2.0, 30.0),
        "concrete" => (3.0, 30.0),
        "rubber" | "leather" => (3.0, 300.0),
        _ => (10.0, 300.0),
    }
}

/// Tolerance of a ratio, for the rounding of the division: a range may be exactly as wide as the limit.
const ROUNDING: f64 = 1.0 + 1e-9;

fn widths(material: &Material, findings: &mut Findings) {
    let (density, youngs) = width_limits(&material.family);
    for (check, range, limit) in
        [("density_width", material.density_kg_m3, density), ("youngs_width", material.youngs_modulus_pa, youngs)]
    {
        let ratio = range.high / range.low;
        findings.require(ratio <= limit * ROUNDING, &material.name, check, || {
            format!("high/low is {ratio:.2}; at most {limit} for {}", material.family)
        });
    }
}

fn family_bounds(material: &Material, family: &Family, findings: &mut Findings) {
    let bounds = [
        family.density_kg_m3,
        family.youngs_modulus_pa,
        family.poisson_ratio,
        family.strength_pa,
        family.friction_rubber,
        family.friction_steel,
    ];
    for ((property, range), bounds) in properties(material).into_iter().zip(bounds) {
        let cohesionless = property == "strength" && material.strength_kind == StrengthKind::Cohesion;
        let inside = (range.low >= bounds.low || cohesionless) && range.high <= bounds.high;
        findings.require(inside, &material.name, "family_bounds", || {
            format!(
                "{property} {:e} to {:e} is not within {:e} to {:e}",
                range.low, range.high, bounds.low, bounds.high
            )
        });
    }
    if let Some(hardness) = material.hardness {
        let [softest, hardest] = family.hardness;
        let reading = |value| ShoreReading { scale: hardness.scale, value };
        let inside =
            softest.is_at_most(reading(hardness.range.low)) && reading(hardness.range.high).is_at_most(hardest);
        findings.require(inside, &material.name, "family_bounds", || {
            format!("Shore hardness {hardness:?} is not within {softest:?} to {hardest:?}")
        });
    }
}

/// The largest nu for an isotropic solver: the bulk modulus stays finite.
const POISSON_LIMIT: f64 = 0.4999;

fn poisson(material: &Material, findings: &mut Findings) {
    let nu = material.poisson_ratio;
    findings.require(nu.low > -1.0 && nu.high <= POISSON_LIMIT, &material.name, "poisson", || {
        format!("nu {} to {} is not within -1 to {POISSON_LIMIT}", nu.low, nu.high)
    });
    let may_be_auxetic = matches!(material.family.as_str(), "foam" | "fabric" | "paper" | "food");
    if nu.low < 0.0 && !may_be_auxetic {
        findings.warn(
            &material.name,
            "poisson",
            format!("nu goes down to {}, which is unusual for {}", nu.low, material.family),
        );
    }
    let may_be_incompressible = matches!(material.family.as_str(), "rubber" | "food" | "granular_soft");
    if nu.high > 0.49 && !may_be_incompressible {
        findings.warn(
            &material.name,
            "poisson",
            format!("nu goes up to {}, which is unusual for {}", nu.high, material.family),
        );
    }
}

/// The kind of strength that is measured for a family's members, so that a tensile one is never taken for a compressive
/// one.
fn strength_kind(material: &Material, findings: &mut Findings) {
    use StrengthKind::{Cohesion, Compressive, Flexural, Fracture, Plateau, Uts, Yield};
    let kinds: &[StrengthKind] = match material.family.as_str() {
        "wood" => &[Flexural],
        "metal" => &[Yield, Uts],
        "thermoplastic" | "thermoset_composite" => &[Yield, Uts, Flexural],
        "rubber" | "leather" | "fabric" => &[Uts],
        "foam" => &[Plateau],
        "glass" | "ceramic" => &[Flexural, Uts],
        "stone" | "concrete" => &[Compressive],
        "paper" => &[Uts],
        _ => &[Yield, Uts, Flexural, Compressive, Plateau, Fracture, Cohesion],
    };
    let loose = matches!(material.law, Law::DruckerPrager { .. }) && material.strength_kind == Cohesion;
    findings.require(kinds.contains(&material.strength_kind) || loose, &material.name, "strength_kind", || {
        format!("`{}` is not how the strength of {} is measured", material.strength_kind, material.family)
    });
}

fn friction(material: &Material, findings: &mut Findings) {
    let (rubber, steel) = (material.friction_rubber, material.friction_steel);
    findings.require(rubber.low >= steel.low && rubber.high >= steel.high, &material.name, "friction", || {
        format!(
            "friction on rubber ({} to {}) must be at least that on steel ({} to {})",
            rubber.low, rubber.high, steel.low, steel.high
        )
    });
    let plausible = |range: Range| range.low >= 0.03 && range.high <= 2.0;
    findings.require(plausible(rubber) && plausible(steel), &material.name, "friction", || {
        "friction coefficients lie between 0.03 and 2".to_owned()
    });
    let slippery = match material.name.as_str() {
        "ptfe" => Some(0.2),
        "ice" => Some(0.05),
        _ => None,
    };
    if let Some(limit) = slippery {
        findings.require(steel.high <= limit, &material.name, "friction", || {
            format!("its friction on steel must be at most {limit}")
        });
    }
    if let Law::DruckerPrager { friction_angle_rad, .. } = material.law {
        let limit = friction_angle_rad.tan() + 0.3;
        findings.require(rubber.mid() <= limit, &material.name, "friction", || {
            format!("loose grains slip over each other: friction {:.2} is above tan(phi) + 0.3", rubber.mid())
        });
    }
}

fn hardness(material: &Material, findings: &mut Findings) {
    let Some(hardness) = material.hardness else { return };
    let (scale, other, off) = match hardness.scale {
        ShoreScale::A => ("A", "D", hardness.range.mid() > 95.0),
        ShoreScale::D => ("D", "A", hardness.range.mid() < 20.0),
    };
    if off {
        findings.warn(
            &material.name,
            "hardness",
            format!("its hardness is near an end of Shore {scale}; give it on Shore {other}"),
        );
    }
}

/// How far a cited value may lie outside the row's range, as a factor: rounding of units and of the range itself. In
/// the order of [`Evidence::PROPERTIES`].
pub(super) const CITED_TOLERANCE: [f64; 4] = [1.03, 1.10, 1.08, 1.12];

/// The citations that exist.
struct Known<'a> {
    references: HashSet<&'a str>,
    evidence: HashMap<(&'a str, &'a str), &'a Evidence>,
    rules: HashMap<&'a str, &'a Rule>,
}

impl Known<'_> {
    /// Finds citations of references, and of entries of references, that do not exist.
    fn require_all(&self, of: &str, property: &str, citations: &[String], findings: &mut Findings) {
        for citation in citations.iter().filter(|citation| !UNCITED.contains(&citation.as_str())) {
            let (source, entry) = split_citation(citation);
            let exists = self.references.contains(source)
                && entry.is_none_or(|entry| self.evidence.contains_key(&(source, entry)));
            findings.require(exists, of, "source", || {
                format!("{property} cites `{citation}`, which bibliography.csv and evidence.csv do not have")
            });
        }
    }
}

fn sources(material: &Material, known: &Known, findings: &mut Findings) {
    for (property, citations) in material.sources.by_property() {
        let absent = property == "hardness" && material.hardness.is_none();
        findings
            .require(!citations.is_empty() || absent, &material.name, "source", || format!("{property} has no source"));
        for citation in citations {
            if UNCITED.contains(&citation.as_str()) {
                continue;
            }
            let (source, entry) = split_citation(citation);
            if source == RULE {
                match entry.and_then(|id| known.rules.get(id)).filter(|rule| rule.is_about(property)) {
                    Some(rule) => rules::agrees(material, rule, findings),
                    None => findings.error(
                        &material.name,
                        "source",
                        format!("{property} cites `{citation}`, but rules.csv has no such rule about it"),
                    ),
                }
                continue;
            }
            findings.require(known.references.contains(source), &material.name, "source", || {
                format!("{property} cites `{source}`, which bibliography.csv does not have")
            });
            let Some(entry) = entry else { continue };
            match known.evidence.get(&(source, entry)) {
                None => findings.error(&material.name, "source", format!("evidence.csv has no `{citation}`")),
                Some(evidence) => agrees(material, property, evidence, findings),
            }
        }
        let mixed = citations.len() > 1 && citations.iter().any(|citation| UNCITED.contains(&citation.as_str()));
        findings.require(!mixed, &material.name, "source", || format!("{property} is both cited and judged"));
    }
}

/// The row's range and the value of the cited entry must overlap.
fn agrees(material: &Material, property: &str, evidence: &Evidence, findings: &mut Findings) {
    let ours = [material.density_kg_m3, material.youngs_modulus_pa, material.poisson_ratio, material.strength_pa];
    let Some(at) = Evidence::PROPERTIES.iter().position(|name| *name == property) else { return };
    let Some(theirs) = evidence.values[at] else { return };
    let tolerance = CITED_TOLERANCE[at];
    let meets = theirs.high * tolerance >= ours[at].low && theirs.low <= ours[at].high * tolerance;
    findings.require(meets, &material.name, "source", || {
        format!(
            "{property} {:e} to {:e} misses {}:{}, {:e} to {:e}",
            ours[at].low, ours[at].high, evidence.source, evidence.entry, theirs.low, theirs.high
        )
    });
}
