//! The sources of the library's numbers: the references, the entries read in them, and the justified deviations.

use serde::{Deserialize, Serialize};

use crate::units::Range;

/// The source of a number that no reference supports: engineering judgement, given as a range wide enough to be true.
pub const JUDGEMENT: &str = "judgement";

/// Sources that are not citations: judgement, and a user's own numbers without a named source.
pub const UNCITED: [&str; 2] = [JUDGEMENT, USER];

/// The source of a user's number if none is named.
pub const USER: &str = "user";

/// Stands for the reference in the citation of a row of `rules.csv`: `rule:poisson-steel`.
pub const RULE: &str = "rule";

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
/// A share-alike table is cited by its entries only; its values are not copied and the ranges here are `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    pub source: String,
    /// The key after the colon in a citation.
    pub entry: String,
    /// The name of the material in the source.
    pub title: String,
    /// The ranges of density, E, nu and strength, in the order of [`Evidence::PROPERTIES`].
    pub values: [Option<Range>; 4],
}

impl Evidence {
    /// The properties whose values are kept with an entry, named as in [`Sources::by_property`](super::Sources).
    pub const PROPERTIES: [&'static str; 4] = ["density", "youngs_modulus", "poisson_ratio", "strength"];

    /// The value that the entry gives for `property`.
    pub fn value(&self, property: &str) -> Option<Range> {
        let at = Self::PROPERTIES.iter().position(|name| *name == property)?;
        self.values[at]
    }
}

/// A row of `rules.csv`: a statement of references about a class of materials.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    pub id: String,
    /// The property, named as in [`Sources::by_property`](super::Sources); hardness as `shore_a` or `shore_d`.
    pub property: String,
    /// To be read as `relation` says; `None` if another check tests the relation.
    pub bounds: Option<Range>,
    pub relation: ClassRelation,
    /// Ids of the bibliography.
    pub references: Vec<String>,
    /// The rule in words.
    pub statement: String,
}

impl Rule {
    /// True if the rule is about `property`, named as in [`Sources::by_property`](super::Sources).
    pub fn is_about(&self, property: &str) -> bool {
        self.property == property || (property == "hardness" && self.property.starts_with("shore_"))
    }
}

/// How a rule's range follows for a member of the class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ClassRelation {
    /// The bounds are the range.
    Interval,
    /// Shore D at which the cone's pressure is three times the strength; the bounds are points added to either end.
    ShoreDOfStrength,
    /// Shore D at which the cone's pressure is that of the Janka test for the density; the bounds are added likewise.
    ShoreDOfWood,
    /// Shore A of an elastic solid of the row's E; the bounds are added likewise.
    ShoreAOfModulus,
    /// The check `foam_scaling` tests it.
    FoamScaling,
    /// The check `shore_to_stiffness` tests it.
    ShoreToStiffness,
    /// The check `composite_bounds` tests it.
    CompositeBounds,
}

/// A row of `constituents.csv`: a constituent of a foam, a composite or a fabric.
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

/// The role of a constituent in the whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Relation {
    /// The solid of a foam's cells.
    CellWall,
    /// The stiff phase of a composite.
    Reinforcement,
    /// The phase that holds the composite together.
    Matrix,
    /// The fibre of which a cloth is spun.
    Fibre,
}

/// A row of `deviations.csv`: a finding that needs no correction, with the reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Deviation {
    /// As in [`Finding::subject`](super::check::Finding::subject).
    pub subject: String,
    /// The check that would fail, by its [name](super::check::Finding::check).
    pub check: String,
    pub reason: String,
    /// True if a user's tables were added after it: it still applies, but may match no finding, because they may replace
    /// what it is about.
    pub is_inherited: bool,
}

/// Splits a citation into the reference's id and the entry in it.
pub fn split_citation(citation: &str) -> (&str, Option<&str>) {
    match citation.split_once(':') {
        Some((source, entry)) => (source, Some(entry)),
        None => (citation, None),
    }
}
