//! What the numbers rest on: the references, the entries of them that were read, and the deviations that were argued.

use serde::{Deserialize, Serialize};

use crate::units::Range;

/// Sources of a number that is not a transcribed fact: engineering knowledge given as a range wide enough to be true, and
/// what a user's own library says without naming a source.
pub const UNCITED: [&str; 2] = ["handbook", USER];

/// The source of a user's number that names none.
pub const USER: &str = "user";

/// A row of `bibliography.csv`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reference {
    pub id: String,
    pub title: String,
    pub publisher: String,
    pub year: String,
    /// A DOI, a standard's number or a public address.
    pub locator: String,
    pub licence: String,
}

/// A row of `evidence.csv`: one entry of a source, with the values read there.
///
/// A share-alike table is cited by its entries alone; its values stay where they are and the ranges here are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    pub source: String,
    /// The key that follows the colon in a citation.
    pub entry: String,
    /// What the source calls it.
    pub title: String,
    /// What `values` says of density, E, nu and strength, in the order of [`Evidence::PROPERTIES`].
    pub values: [Option<Range>; 4],
}

impl Evidence {
    /// The properties whose values are kept with an entry, named as in [`Sources::by_property`](super::Sources).
    pub const PROPERTIES: [&'static str; 4] = ["density", "youngs_modulus", "poisson_ratio", "strength"];

    /// What was read there of `property`.
    pub fn value(&self, property: &str) -> Option<Range> {
        let at = Self::PROPERTIES.iter().position(|name| *name == property)?;
        self.values[at]
    }
}

/// A row of `constituents.csv`: what a foam, a composite or a fabric is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Constituent {
    pub material: String,
    pub relation: Relation,
    /// The constituent in words.
    pub name: String,
    pub density_kg_m3: f64,
    pub youngs_modulus_pa: f64,
    pub strength_pa: Option<f64>,
    /// Its share of the volume.
    pub volume_fraction: Range,
    pub source: String,
}

/// What a constituent is to the whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// The solid of a foam's cells.
    CellWall,
    /// The stiff phase of a composite.
    Reinforcement,
    /// The phase that holds it together.
    Matrix,
    /// What a cloth is spun of.
    Fibre,
}

/// A row of `deviations.csv`: a finding that is right as it stands, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Deviation {
    /// The material's name, or `family:NAME` for a finding about a whole family.
    pub subject: String,
    /// The check that would fail, by its [name](super::check::Finding::check).
    pub check: String,
    pub reason: String,
}

/// A citation taken apart: the reference's id, and the entry in it.
pub fn split_citation(citation: &str) -> (&str, Option<&str>) {
    match citation.split_once(':') {
        Some((source, entry)) => (source, Some(entry)),
        None => (citation, None),
    }
}
