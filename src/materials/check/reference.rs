//! Checks the library against `reference.csv`: textbook values from which no row was made.
//!
//! A library with very wide ranges would agree with any reference, so its ranges must not be much wider either.

use std::collections::BTreeMap;

use super::Findings;
use crate::materials::bibliography::Evidence;
use crate::materials::{Material, MaterialLibrary};
use crate::units::Range;

/// The share of a family's reference values that its ranges must overlap.
const AGREEMENT: f64 = 0.95;

/// A range may be at most three times as wide (as high / low) as the reference's: log10(3).
const EXCESS_DECADES: f64 = 0.477_121_254_719_662_4;

pub fn check(library: &MaterialLibrary, findings: &mut Findings) {
    let mut met: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for reference in &library.reference {
        let known = library.references.iter().any(|one| one.id == reference.source);
        findings.require(known, &reference.entry, "source", || {
            format!("reference.csv cites `{}`, which bibliography.csv does not have", reference.source)
        });
        let Some(material) = library.get(&reference.entry) else {
            let message = "reference.csv has it, but the library does not".to_owned();
            findings.error(&reference.entry, "reference", message);
            continue;
        };
        let ours = [material.density_kg_m3, material.youngs_modulus_pa, material.poisson_ratio, material.strength_pa];
        for ((property, ours), theirs) in Evidence::PROPERTIES.into_iter().zip(ours).zip(reference.values) {
            let Some(theirs) = theirs else { continue };
            let (hits, total) = met.entry(&material.family).or_default();
            *total += 1;
            if overlaps(ours, widened(theirs, property, material)) {
                *hits += 1;
            } else {
                let message = format!("{property} {ours:?} misses {theirs:?} of {}", reference.source);
                findings.warn(&material.name, "reference", message);
            }
            let decades = |range: Range| (range.high / range.low).log10();
            let excess = decades(ours) - decades(theirs);
            findings.require(
                excess <= EXCESS_DECADES || property == "poisson_ratio",
                &material.name,
                "reference_width",
                || format!("{property} {ours:?} is far wider than {theirs:?} of {}", reference.source),
            );
        }
    }
    for (family, (hits, total)) in met {
        let share = hits as f64 / total as f64;
        findings.require(share >= AGREEMENT, &format!("family:{family}"), "reference", || {
            format!("{hits} of {total} ranges overlap the textbook's; at least {:.0}% must", 100.0 * AGREEMENT)
        });
    }
}

fn overlaps(one: Range, other: Range) -> bool {
    one.low <= other.high && other.low <= one.high
}

/// The textbook's range, widened by the spread between manufacturers, grades and batches.
fn widened(range: Range, property: &str, material: &Material) -> Range {
    let family = material.family.as_str();
    let factor = match property {
        "density" if matches!(family, "wood" | "food" | "foam" | "granular_soft") => 1.20,
        "density" => 1.05,
        "youngs_modulus" => match family {
            "metal" | "glass" | "ceramic" => 1.15,
            "thermoplastic" | "thermoset_composite" | "wood" | "stone" | "concrete" => 1.3,
            _ => 3.0,
        },
        "strength" if matches!(family, "metal" | "thermoplastic" | "thermoset_composite" | "wood") => 1.5,
        "strength" => 2.0,
        _ => return Range::new(range.low - 0.05, range.high + 0.05),
    };
    Range::new(range.low / factor, range.high * factor)
}
