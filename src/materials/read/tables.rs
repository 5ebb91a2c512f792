//! The tables of a library: the columns of each, and how its rows are read.

use std::ops::RangeInclusive;
use std::path::Path;

use super::law::law;
use super::{LONGEST_NAME, LibraryError, MOST_ROWS, Row, Table, list, rows};
use crate::materials::bibliography::{Constituent, Deviation, Evidence, Reference, Rule};
use crate::materials::fillings::Filling;
use crate::materials::{Family, Material, ShoreReading, Sources};
use crate::units::{Range, ShoreHardness};

/// The contents of a set of tables, each in the order of the files.
#[derive(Debug, Default)]
pub struct Tables {
    pub families: Vec<Placed<Family>>,
    pub materials: Vec<Placed<Material>>,
    pub fillings: Vec<Placed<Filling>>,
    pub references: Vec<Placed<Reference>>,
    pub evidence: Vec<Placed<Evidence>>,
    pub rules: Vec<Placed<Rule>>,
    pub reference: Vec<Evidence>,
    pub constituents: Vec<Constituent>,
    pub deviations: Vec<Deviation>,
}

/// The contents of a row and its place, for messages about it.
#[derive(Debug)]
pub struct Placed<T> {
    pub row: T,
    pub file: String,
    pub line: u64,
    /// The column by which it refers to a row of another table, or by which it is referred to.
    key: &'static str,
    /// The number of that column, counted from 1.
    number: usize,
}

impl<T> Placed<T> {
    fn at(place: &Row, key: &'static str, row: T) -> Self {
        let number = place.index(key).map_or(0, |at| at + 1);
        Self { row, file: place.file.to_owned(), line: place.line, key, number }
    }

    /// A problem with what was found in its key.
    pub fn bad_key(&self, found: &str, problem: String) -> LibraryError {
        LibraryError::BadCell {
            file: self.file.clone(),
            line: self.line,
            number: self.number,
            column: self.key.to_owned(),
            found: found.chars().take(LONGEST_NAME).collect(),
            problem,
        }
    }
}

const REFERENCE_COLUMNS: [&str; 6] = ["id", "title", "publisher", "year", "locator", "licence"];
const EVIDENCE_COLUMNS: [&str; 11] = [
    "source",
    "entry",
    "title",
    "density_kg_m3_low",
    "density_kg_m3_high",
    "youngs_modulus_pa_low",
    "youngs_modulus_pa_high",
    "poisson_ratio_low",
    "poisson_ratio_high",
    "strength_pa_low",
    "strength_pa_high",
];
const RULE_COLUMNS: [&str; 7] = ["rule", "property", "low", "high", "relation", "references", "statement"];
const CONSTITUENT_COLUMNS: [&str; 9] = [
    "material",
    "relation",
    "constituent",
    "density_kg_m3",
    "youngs_modulus_pa",
    "strength_pa",
    "volume_fraction_low",
    "volume_fraction_high",
    "source",
];
const FILLING_COLUMNS: [&str; 11] = [
    "kind",
    "name",
    "density_kg_m3_low",
    "density_kg_m3_high",
    "basis",
    "youngs_modulus_pa_low",
    "youngs_modulus_pa_high",
    "poisson_ratio_low",
    "poisson_ratio_high",
    "law",
    "law_parameters",
];
const DEVIATION_COLUMNS: [&str; 3] = ["subject", "check", "reason"];
const LABEL_COLUMNS: [&str; 4] = ["label_abo", "label_abo_exact", "label_mvimgnet", "label_mvimgnet_exact"];
const RANGE_COLUMNS: [&str; 12] = [
    "density_kg_m3_low",
    "density_kg_m3_high",
    "youngs_modulus_pa_low",
    "youngs_modulus_pa_high",
    "poisson_ratio_low",
    "poisson_ratio_high",
    "strength_pa_low",
    "strength_pa_high",
    "friction_rubber_low",
    "friction_rubber_high",
    "friction_steel_low",
    "friction_steel_high",
];
const FAMILY_COLUMNS: [&str; 8] = [
    "family",
    "strength_meaning",
    "hardness_low_scale",
    "hardness_low",
    "hardness_high_scale",
    "hardness_high",
    "law",
    "law_parameters",
];
/// Columns of a family that a user's table may leave out, like those of the labels.
const RESTITUTION_COLUMNS: [&str; 3] = ["restitution_low", "restitution_high", "restitution_source"];
/// Columns of a material besides its ranges.
const MATERIAL_COLUMNS: [&str; 9] = [
    "family",
    "name",
    "aliases",
    "strength_kind",
    "hardness_scale",
    "hardness_low",
    "hardness_high",
    "law",
    "law_parameters",
];
/// Columns that a user's table may leave out, like those of the labels: the sources, which are then `user`.
const OPTIONAL_COLUMNS: [&str; 8] = [
    "density_source",
    "youngs_modulus_source",
    "poisson_ratio_source",
    "strength_source",
    "friction_rubber_source",
    "friction_steel_source",
    "hardness_source",
    "law_source",
];

/// Reads all tables; the file's stem determines which table it is.
pub fn read_tables(files: &[Table]) -> Result<Tables, LibraryError> {
    let mut tables = Tables::default();
    let mut left = MOST_ROWS;
    let family_columns = [&FAMILY_COLUMNS[..], &RANGE_COLUMNS[..], &LABEL_COLUMNS[..]].concat();
    let material_columns = [&MATERIAL_COLUMNS[..], &RANGE_COLUMNS[..]].concat();
    let optional_columns = [&OPTIONAL_COLUMNS[..], &LABEL_COLUMNS[..]].concat();
    for file in files {
        let stem = Path::new(file.name).file_stem().unwrap_or_default();
        match stem.to_str().unwrap_or_default() {
            "families" => tables.families.extend(rows(file, &mut left, &family_columns, &RESTITUTION_COLUMNS, family)?),
            "bibliography" => tables.references.extend(rows(file, &mut left, &REFERENCE_COLUMNS, &[], reference)?),
            "evidence" => tables.evidence.extend(rows(file, &mut left, &EVIDENCE_COLUMNS, &[], evidence)?),
            "rules" => tables.rules.extend(rows(file, &mut left, &RULE_COLUMNS, &[], rule)?),
            "reference" => {
                let read = rows(file, &mut left, &EVIDENCE_COLUMNS, &[], evidence)?;
                tables.reference.extend(read.into_iter().map(|placed| placed.row));
            }
            "constituents" => {
                tables.constituents.extend(rows(file, &mut left, &CONSTITUENT_COLUMNS, &[], constituent)?);
            }
            "fillings" => {
                tables.fillings.extend(rows(file, &mut left, &FILLING_COLUMNS, &["density_source"], filling)?);
            }
            "deviations" => tables.deviations.extend(rows(file, &mut left, &DEVIATION_COLUMNS, &[], deviation)?),
            _ => tables.materials.extend(rows(file, &mut left, &material_columns, &optional_columns, material)?),
        }
    }
    Ok(tables)
}

/// Smallest accepted density and modulus: a smaller one is surely in a wrong unit (aerogel 1 kg/m3; a gel 10 Pa).
const LEAST: f64 = 1.0;

/// Limits of Poisson's ratio for a solver's isotropic material: at -1 the shear modulus and at 0.5 the bulk modulus
/// becomes infinite, and negative beyond.
const MOST_AUXETIC: f64 = -0.99;
const INCOMPRESSIBLE: f64 = 0.4999;

/// The readings of a Shore durometer, on either scale.
const SHORE: RangeInclusive<f64> = 0.0..=100.0;

fn material(row: &Row) -> Result<Placed<Material>, LibraryError> {
    let material = Material {
        name: row.name("name")?,
        family: row.name("family")?,
        aliases: row.names("aliases")?,
        density_kg_m3: row.range("density_kg_m3", LEAST..=1e5)?,
        youngs_modulus_pa: row.range("youngs_modulus_pa", LEAST..=1e13)?,
        poisson_ratio: row.range("poisson_ratio", MOST_AUXETIC..=INCOMPRESSIBLE)?,
        strength_pa: row.range("strength_pa", 0.0..=1e12)?,
        strength_kind: row.variant("strength_kind", "a kind of strength")?,
        friction_rubber: row.range("friction_rubber", 0.0..=5.0)?,
        friction_steel: row.range("friction_steel", 0.0..=5.0)?,
        restitution: None,
        hardness: hardness(row)?,
        law: law(row)?,
        labels: row.labels()?,
        sources: Sources {
            density: row.sources("density_source"),
            youngs_modulus: row.sources("youngs_modulus_source"),
            poisson_ratio: row.sources("poisson_ratio_source"),
            strength: row.sources("strength_source"),
            friction_rubber: row.sources("friction_rubber_source"),
            friction_steel: row.sources("friction_steel_source"),
            hardness: if row.text("hardness_scale").is_empty() { vec![] } else { row.sources("hardness_source") },
            law: row.sources("law_source"),
        },
    };
    Ok(Placed::at(row, "family", material))
}

fn hardness(row: &Row) -> Result<Option<ShoreHardness>, LibraryError> {
    if row.text("hardness_scale").is_empty() {
        return match ["hardness_low", "hardness_high"].into_iter().find(|column| !row.text(column).is_empty()) {
            Some(column) => Err(row.bad(column, "needs its scale in `hardness_scale`, A or D")),
            None => Ok(None),
        };
    }
    let range = row.range("hardness", SHORE)?;
    Ok(Some(ShoreHardness { scale: row.scale("hardness_scale")?, range }))
}

fn family(row: &Row) -> Result<Placed<Family>, LibraryError> {
    let reading = |end: &str| -> Result<ShoreReading, LibraryError> {
        let column = format!("hardness_{end}");
        Ok(ShoreReading { scale: row.scale(&format!("{column}_scale"))?, value: row.number_within(&column, &SHORE)? })
    };
    let is_said = RESTITUTION_COLUMNS.iter().any(|column| !row.text(column).is_empty());
    let restitution = is_said.then(|| row.range("restitution", 0.0..=1.0)).transpose()?;
    let family = Family {
        name: row.name("family")?,
        density_kg_m3: row.range("density_kg_m3", LEAST..=1e5)?,
        youngs_modulus_pa: row.range("youngs_modulus_pa", LEAST..=1e13)?,
        poisson_ratio: row.range("poisson_ratio", MOST_AUXETIC..=INCOMPRESSIBLE)?,
        strength_pa: row.range("strength_pa", 0.0..=1e12)?,
        strength_meaning: row.filled("strength_meaning")?,
        friction_rubber: row.range("friction_rubber", 0.0..=5.0)?,
        friction_steel: row.range("friction_steel", 0.0..=5.0)?,
        restitution,
        restitution_sources: if restitution.is_some() { row.sources("restitution_source") } else { vec![] },
        hardness: [reading("low")?, reading("high")?],
        law: law(row)?,
        labels: row.labels()?,
    };
    Ok(Placed::at(row, "family", family))
}

fn reference(row: &Row) -> Result<Placed<Reference>, LibraryError> {
    let text = |column: &str| row.text(column).to_owned();
    let reference = Reference {
        id: row.filled("id")?,
        title: text("title"),
        publisher: text("publisher"),
        year: text("year"),
        locator: text("locator"),
        licence: text("licence"),
    };
    Ok(Placed::at(row, "id", reference))
}

fn evidence(row: &Row) -> Result<Placed<Evidence>, LibraryError> {
    let value = |name: &str| {
        let is_missing = ["low", "high"].iter().all(|end| row.text(&format!("{name}_{end}")).is_empty());
        if is_missing { Ok(None) } else { row.range(name, MOST_AUXETIC..=1e13).map(Some) }
    };
    let evidence = Evidence {
        source: row.filled("source")?,
        entry: row.filled("entry")?,
        title: row.filled("title")?,
        values: [value("density_kg_m3")?, value("youngs_modulus_pa")?, value("poisson_ratio")?, value("strength_pa")?],
    };
    Ok(Placed::at(row, "entry", evidence))
}

fn rule(row: &Row) -> Result<Placed<Rule>, LibraryError> {
    let bounds = match [row.text("low"), row.text("high")] {
        ["", ""] => None,
        _ => Some(Range::new(row.number("low")?, row.number("high")?)),
    };
    if bounds.is_some_and(|bounds| !bounds.is_valid()) {
        return Err(row.bad("high", "is less than `low`"));
    }
    let rule = Rule {
        id: row.filled("rule")?,
        property: row.filled("property")?,
        bounds,
        relation: row.variant("relation", "a relation")?,
        references: list(row.text("references")),
        statement: row.filled("statement")?,
    };
    Ok(Placed::at(row, "rule", rule))
}

fn constituent(row: &Row) -> Result<Constituent, LibraryError> {
    let strength = match row.text("strength_pa") {
        "" => None,
        _ => Some(row.number("strength_pa")?),
    };
    Ok(Constituent {
        material: row.filled("material")?,
        relation: row.variant("relation", "a relation")?,
        name: row.filled("constituent")?,
        density_kg_m3: row.number("density_kg_m3")?,
        youngs_modulus_pa: row.number("youngs_modulus_pa")?,
        strength_pa: strength,
        volume_fraction: row.range("volume_fraction", 0.0..=1.0)?,
        source: row.filled("source")?,
    })
}

fn filling(row: &Row) -> Result<Placed<Filling>, LibraryError> {
    let filling = Filling {
        name: row.name("name")?,
        kind: row.variant("kind", "a kind of filling")?,
        density_kg_m3: row.range("density_kg_m3", LEAST..=1e5)?,
        density_sources: row.sources("density_source"),
        basis: row.text("basis").to_owned(),
        youngs_modulus_pa: row.range("youngs_modulus_pa", LEAST..=1e13)?,
        poisson_ratio: row.range("poisson_ratio", MOST_AUXETIC..=INCOMPRESSIBLE)?,
        law: law(row)?,
    };
    Ok(Placed::at(row, "name", filling))
}

fn deviation(row: &Row) -> Result<Deviation, LibraryError> {
    Ok(Deviation {
        subject: row.filled("subject")?,
        check: row.filled("check")?,
        reason: row.filled("reason")?,
        is_inherited: false,
    })
}
