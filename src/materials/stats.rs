//! The shares of the library that are based on cited tables and on handbook knowledge.

use serde::Serialize;

use super::bibliography::UNCITED;
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
    /// Each property with the share from 0 to 1 of its values that come from a cited table.
    pub cited: Vec<(&'static str, f64)>,
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

/// True if a property's citations name a table rather than handbook knowledge.
pub fn is_cited(citations: &[String]) -> bool {
    !citations.is_empty() && citations.iter().all(|citation| !UNCITED.contains(&citation.as_str()))
}

fn shares_of<'a>(of: &str, materials: impl Iterator<Item = &'a Material>) -> Shares {
    let mut names: Vec<&'static str> = Vec::new();
    let mut counts: Vec<(usize, usize)> = Vec::new();
    let mut total = 0;
    for material in materials {
        total += 1;
        for (at, (property, citations)) in material.sources.by_property().into_iter().enumerate() {
            if at == names.len() {
                names.push(property);
                counts.push((0, 0));
            }
            if property != "hardness" || material.hardness.is_some() {
                counts[at].1 += 1;
                counts[at].0 += usize::from(is_cited(citations));
            }
        }
    }
    let share = |(cited, of): (usize, usize)| if of == 0 { 0.0 } else { cited as f64 / of as f64 };
    Shares {
        of: of.to_owned(),
        materials: total,
        cited: names.into_iter().zip(counts.into_iter().map(share)).collect(),
    }
}
