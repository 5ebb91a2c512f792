//! The shares of the library that are cited, cited by a rule for a class, and engineering judgement.

use std::fmt;

use serde::Serialize;

use super::bibliography::{RULE, UNCITED, USER, split_citation};
use super::{Material, MaterialLibrary};

/// Families of hard goods: open tables exist for them, so most of their densities and moduli must be cited.
pub const WELL_MEASURED: [&str; 8] =
    ["wood", "metal", "thermoplastic", "thermoset_composite", "glass", "ceramic", "stone", "concrete"];

/// The smallest allowed share of cited densities and of cited moduli in each of [`WELL_MEASURED`].
pub const LEAST_CITED: [(&str, f64); 2] = [("density", 0.9), ("youngs_modulus", 0.7)];

/// The cited share of each property among some materials.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shares {
    /// A family, `well measured` for [`WELL_MEASURED`] together, or `all`.
    pub of: String,
    pub materials: usize,
    /// Each property with the share from 0 to 1 of its values that are cited; the rest is judgement or a user's.
    pub cited: Vec<(&'static str, f64)>,
    /// Each property with the share that is cited by a rule for a class of materials, a part of `cited`.
    pub by_rule: Vec<(&'static str, f64)>,
}

impl Shares {
    /// The cited share of `property`.
    pub fn cited(&self, property: &str) -> Option<f64> {
        self.cited.iter().find(|(name, _)| *name == property).map(|(_, share)| *share)
    }
}

/// The shares of every family, then of the well-measured ones, then of all.
pub fn stats(library: &MaterialLibrary) -> Vec<Shares> {
    let mut shares: Vec<Shares> =
        library.families().iter().map(|family| shares_of(&family.name, library.of_family(&family.name))).collect();
    let well_measured = library.materials().iter().filter(|one| WELL_MEASURED.contains(&one.family.as_str()));
    shares.push(shares_of("well measured", well_measured));
    shares.push(shares_of("all", library.materials().iter()));
    shares
}

/// True if a property's citations all name references or rules: none is judgement or the user's own.
pub fn is_cited(citations: &[String]) -> bool {
    !citations.is_empty() && citations.iter().all(|citation| !UNCITED.contains(&citation.as_str()))
}

/// True if a property is cited by a rule for a class of materials.
pub fn is_by_rule(citations: &[String]) -> bool {
    citations.iter().any(|citation| split_citation(citation).0 == RULE)
}

/// The properties of one material by the kind of their sources, in words.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Provenance {
    pub cited: Vec<&'static str>,
    pub by_rule: Vec<&'static str>,
    pub judged: Vec<&'static str>,
    /// Numbers of the user's own table without a source.
    pub own: Vec<&'static str>,
}

impl Provenance {
    pub fn of(material: &Material) -> Self {
        let mut kinds = Self::default();
        for (property, citations) in material.sources.by_property() {
            let Some(words) = in_words(property).filter(|_| !citations.is_empty()) else { continue };
            let kind = if citations.iter().any(|citation| citation == USER) {
                &mut kinds.own
            } else if !is_cited(citations) {
                &mut kinds.judged
            } else if is_by_rule(citations) {
                &mut kinds.by_rule
            } else {
                &mut kinds.cited
            };
            kind.push(words);
        }
        kinds
    }
}

/// `cited: density; by a rule for its class: friction on rubber; engineering judgement: strength`.
impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds = [
            ("cited", &self.cited),
            ("by a rule for its class", &self.by_rule),
            ("engineering judgement", &self.judged),
            ("your own", &self.own),
        ];
        let named = kinds.iter().filter(|(_, properties)| !properties.is_empty());
        let parts: Vec<String> = named.map(|(kind, properties)| format!("{kind}: {}", properties.join(", "))).collect();
        f.write_str(&parts.join("; "))
    }
}

/// The property in words; `None` for the law, which is not a number.
fn in_words(property: &str) -> Option<&'static str> {
    match property {
        "density" => Some("density"),
        "youngs_modulus" => Some("Young's modulus"),
        "poisson_ratio" => Some("Poisson's ratio"),
        "strength" => Some("strength"),
        "friction_rubber" => Some("friction on rubber"),
        "friction_steel" => Some("friction on steel"),
        "hardness" => Some("hardness"),
        _ => None,
    }
}

/// How many values of a property there are, are cited, and are cited by a rule.
#[derive(Clone, Copy, Default)]
struct Count {
    values: usize,
    cited: usize,
    by_rule: usize,
}

fn shares_of<'a>(of: &str, materials: impl Iterator<Item = &'a Material>) -> Shares {
    let mut counts: Vec<(&'static str, Count)> = Vec::new();
    let mut total = 0;
    for material in materials {
        total += 1;
        for (at, (property, citations)) in material.sources.by_property().into_iter().enumerate() {
            if at == counts.len() {
                counts.push((property, Count::default()));
            }
            if property != "hardness" || material.hardness.is_some() {
                let count = &mut counts[at].1;
                count.values += 1;
                count.cited += usize::from(is_cited(citations));
                count.by_rule += usize::from(is_by_rule(citations));
            }
        }
    }
    let share = |part: usize, of: usize| if of == 0 { 0.0 } else { part as f64 / of as f64 };
    Shares {
        of: of.to_owned(),
        materials: total,
        cited: counts.iter().map(|(name, count)| (*name, share(count.cited, count.values))).collect(),
        by_rule: counts.iter().map(|(name, count)| (*name, share(count.by_rule, count.values))).collect(),
    }
}
