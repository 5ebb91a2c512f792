//! Checks the library as a whole: no duplicates, no copied rows, no column filled with a default, correct labels; and of
//! the built-in library, but not of one with a user's tables, the size and the shares that are cited.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use super::Findings;
use crate::materials::stats::{LEAST_CITED, WELL_MEASURED, stats};
use crate::materials::{Labels, Material, MaterialLibrary, fold};
use crate::numeric::median;
use crate::units::Range;
use crate::words::output::counted;

pub fn check(library: &MaterialLibrary, findings: &mut Findings) {
    names(library, findings);
    copied_rows(library, findings);
    class_defaults(library, findings);
    labels(library, findings);
    if !library.is_extended {
        counts(library, findings);
        cited_shares(library, findings);
    }
}

/// The minimum size of the paper's library: 15 families and 600 materials.
const FEWEST_FAMILIES: usize = 15;
const FEWEST_MATERIALS: usize = 600;
const FEWEST_OF_A_FAMILY: usize = 20;

fn counts(library: &MaterialLibrary, findings: &mut Findings) {
    let (families, materials) = (library.families().len(), library.materials().len());
    findings.require(families >= FEWEST_FAMILIES && materials >= FEWEST_MATERIALS, "library", "count", || {
        format!("{families} families and {materials} materials; at least {FEWEST_FAMILIES} and {FEWEST_MATERIALS} are needed")
    });
    for family in library.families() {
        let members = library.of_family(&family.name).count();
        findings.require(members >= FEWEST_OF_A_FAMILY, &format!("family:{}", family.name), "count", || {
            format!("{}; at least {FEWEST_OF_A_FAMILY} are needed", counted(members, "member"))
        });
    }
}

fn names(library: &MaterialLibrary, findings: &mut Findings) {
    let mut owners: HashMap<String, &str> = HashMap::new();
    for material in library.materials() {
        for name in std::iter::once(&material.name).chain(&material.aliases) {
            if let Some(owner) = owners.insert(fold(name), &material.name) {
                findings.error(&material.name, "duplicate_name", format!("{name:?} already stands for {owner:?}"));
            }
        }
    }
}

fn copied_rows(library: &MaterialLibrary, findings: &mut Findings) {
    let mut seen: HashMap<[u64; 8], &str> = HashMap::new();
    for material in library.materials() {
        let ranges = [material.density_kg_m3, material.youngs_modulus_pa, material.poisson_ratio, material.strength_pa];
        let mut key = [0; 8];
        for (at, range) in ranges.iter().enumerate() {
            key[2 * at] = range.low.to_bits();
            key[2 * at + 1] = range.high.to_bits();
        }
        if let Some(other) = seen.insert(key, &material.name) {
            let message = format!("density, E, nu and strength are all those of {other:?}: one of them is a copy");
            findings.error(&material.name, "copied_row", message);
        }
    }
}

type Column = fn(&Material) -> Range;

/// A column with fewer distinct ranges than this, in a family with more rows than the next number, was filled with a
/// default.
const FEWEST_DISTINCT: usize = 10;
const MANY_ROWS: usize = 50;

fn class_defaults(library: &MaterialLibrary, findings: &mut Findings) {
    let columns: [(&str, Column); 7] = [
        ("density", |material| material.density_kg_m3),
        ("Young's modulus", |material| material.youngs_modulus_pa),
        ("Poisson's ratio", |material| material.poisson_ratio),
        ("strength", |material| material.strength_pa),
        ("friction on rubber", |material| material.friction_rubber),
        ("friction on steel", |material| material.friction_steel),
        ("hardness", |material| material.hardness.map_or(Range::exactly(-1.0), |hardness| hardness.range)),
    ];
    for family in library.families() {
        let members: Vec<&Material> = library.of_family(&family.name).collect();
        if members.len() <= MANY_ROWS {
            continue;
        }
        for (name, column) in columns {
            let bits = |range: Range| (range.low.to_bits(), range.high.to_bits());
            let distinct: BTreeSet<_> = members.iter().map(|material| bits(column(material))).collect();
            findings.require(
                distinct.len() >= FEWEST_DISTINCT,
                &format!("family:{}", family.name),
                "class_default",
                || {
                    format!(
                        "{name} has only {} different ranges in {} rows; at least {FEWEST_DISTINCT} are needed",
                        distinct.len(),
                        members.len()
                    )
                },
            );
        }
    }
}

/// Bounds of the median density, in kg/m3, of the materials that carry a label exactly.
const LABEL_DENSITIES: [(&str, [f64; 2]); 9] = [
    ("wood", [400.0, 800.0]),
    ("metal", [2700.0, 8900.0]),
    ("glass", [2200.0, 2600.0]),
    ("plastic", [900.0, 1500.0]),
    ("concrete", [1500.0, 2500.0]),
    ("ceramic", [1800.0, 4000.0]),
    ("marble", [2300.0, 2900.0]),
    ("leather", [500.0, 1100.0]),
    ("foam", [10.0, 500.0]),
];

fn labels(library: &MaterialLibrary, findings: &mut Findings) {
    for set in ["abo", "mvimgnet"] {
        let label_of = |labels: &Labels| if set == "abo" { labels.abo.clone() } else { labels.mvimgnet.clone() };
        let mut densities: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        let mut used: BTreeSet<String> = BTreeSet::new();
        for material in library.materials() {
            let label = label_of(&material.labels);
            findings.require(!label.name.is_empty(), &material.name, "label", || format!("has no {set} label"));
            used.insert(label.name.clone());
            if label.exact {
                densities.entry(label.name).or_default().push(material.density_kg_m3.mid());
            }
        }
        for family in library.families() {
            let label = label_of(&family.labels).name;
            findings.require(used.contains(&label), "library", "label", || {
                format!("no material has the {set} label {label:?}")
            });
        }
        for (label, values) in densities {
            let Some((_, [low, high])) = LABEL_DENSITIES.iter().find(|(name, _)| *name == label) else { continue };
            let middle = median(values).unwrap_or_default();
            findings.require((*low..=*high).contains(&middle), "library", "label", || {
                format!(
                    "materials labelled {label:?} in {set} have a median density of {middle:.0}, not {low} to {high}"
                )
            });
        }
    }
}

/// The share of densities and moduli that must come from cited tables.
fn cited_shares(library: &MaterialLibrary, findings: &mut Findings) {
    for shares in stats(library).iter().filter(|shares| WELL_MEASURED.contains(&shares.of.as_str())) {
        for (property, least) in LEAST_CITED {
            let share = shares.cited(property).unwrap_or(0.0);
            findings.require(share >= least, &format!("family:{}", shares.of), "cited_share", || {
                format!("{:.0}% of {property} values are cited; at least {:.0}% must be", 100.0 * share, 100.0 * least)
            });
        }
    }
}
