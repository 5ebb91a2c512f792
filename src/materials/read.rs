//! Reading the library's CSV tables: every error says file, line, column and what would be right.

use std::path::PathBuf;

use csv::StringRecord;
use thiserror::Error;

use super::bibliography::{Deviation, Evidence, Reference, USER};
use super::{Family, Label, Labels, Law, Material, ShoreReading, Sources, StrengthKind};
use crate::units::{Range, ShoreHardness, ShoreScale};

/// What can be wrong with a library on disk.
#[derive(Debug, Error)]
pub enum LibraryError {
    #[error("cannot read the material library {path:?}: {source}; give a CSV file or a folder of them")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{path:?} holds no CSV file; a material library is one CSV, or a folder of them")]
    Empty { path: PathBuf },
    #[error("{file}: not a CSV table: {source}")]
    NotCsv { file: String, source: csv::Error },
    #[error("{file} line 1: the column `{column}` is missing; materials/README.md lists the columns")]
    MissingColumn { file: String, column: String },
    #[error("{file} line 1, column {number} `{column}`: no such column; materials/README.md lists the columns")]
    UnknownColumn { file: String, number: usize, column: String },
    #[error("{file} line {line}, column {number} `{column}`: {found:?} {problem}")]
    BadCell { file: String, line: u64, number: usize, column: String, found: String, problem: String },
    #[error("{file} line {line}: the name or alias {name:?} already stands for {other:?}; names must be unique")]
    Duplicate { file: String, line: u64, name: String, other: String },
}

/// A file of the library.
#[derive(Debug, Clone, Copy)]
pub struct Table<'a> {
    /// For messages, and its stem says which table it is.
    pub name: &'a str,
    pub text: &'a str,
}

/// What a set of tables holds, each in the order of the files.
#[derive(Debug, Default)]
pub struct Tables {
    pub families: Vec<Family>,
    pub materials: Vec<Placed>,
    pub references: Vec<Reference>,
    pub evidence: Vec<Evidence>,
    pub deviations: Vec<Deviation>,
}

/// A material and where its row stands, for messages about it.
#[derive(Debug)]
pub struct Placed {
    pub material: Material,
    pub file: String,
    pub line: u64,
    /// The number of its column `family`.
    pub family_column: usize,
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
/// Columns of a material beside its ranges.
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
/// Columns that a user's table may leave out: the labels, and the sources, which are then [`USER`].
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

/// Reads all tables; which is which says the file's stem.
pub fn read_tables(files: &[Table]) -> Result<Tables, LibraryError> {
    let mut tables = Tables::default();
    for file in files {
        let stem = std::path::Path::new(file.name).file_stem().unwrap_or_default();
        match stem.to_str().unwrap_or_default() {
            "families" => {
                let required = [&FAMILY_COLUMNS[..], &RANGE_COLUMNS[..], &LABEL_COLUMNS[..]].concat();
                each_row(file, &required, &[], |row| Ok(tables.families.push(family(row)?)))?;
            }
            "bibliography" => {
                each_row(file, &REFERENCE_COLUMNS, &[], |row| Ok(tables.references.push(reference(row))))?;
            }
            "evidence" => each_row(file, &EVIDENCE_COLUMNS, &[], |row| Ok(tables.evidence.push(evidence(row)?)))?,
            "deviations" => {
                each_row(file, &DEVIATION_COLUMNS, &[], |row| Ok(tables.deviations.push(deviation(row))))?;
            }
            _ => {
                let required = [&MATERIAL_COLUMNS[..], &RANGE_COLUMNS[..]].concat();
                let optional = [&OPTIONAL_COLUMNS[..], &LABEL_COLUMNS[..]].concat();
                each_row(file, &required, &optional, |row| Ok(tables.materials.push(material(row)?)))?;
            }
        }
    }
    Ok(tables)
}

/// A record with its place and its columns' names.
struct Row<'a> {
    file: &'a str,
    line: u64,
    columns: &'a StringRecord,
    cells: &'a StringRecord,
}

fn each_row(
    table: &Table,
    required: &[&str],
    optional: &[&str],
    mut take: impl FnMut(&Row) -> Result<(), LibraryError>,
) -> Result<(), LibraryError> {
    let file = table.name;
    let not_csv = |source| LibraryError::NotCsv { file: file.to_owned(), source };
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(table.text.as_bytes());
    let columns = reader.headers().map_err(not_csv)?.clone();
    if let Some(column) = required.iter().find(|name| !columns.iter().any(|column| column == **name)) {
        return Err(LibraryError::MissingColumn { file: file.to_owned(), column: (*column).to_owned() });
    }
    if let Some(at) = columns.iter().position(|column| !required.contains(&column) && !optional.contains(&column)) {
        let column = columns[at].to_owned();
        return Err(LibraryError::UnknownColumn { file: file.to_owned(), number: at + 1, column });
    }
    let mut cells = StringRecord::new();
    while reader.read_record(&mut cells).map_err(not_csv)? {
        let line = cells.position().map_or(0, csv::Position::line);
        take(&Row { file, line, columns: &columns, cells: &cells })?;
    }
    Ok(())
}

impl Row<'_> {
    fn index(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|name| name == column)
    }

    /// The cell's text; empty where an optional column is left out.
    fn text(&self, column: &str) -> &str {
        self.index(column).and_then(|at| self.cells.get(at)).unwrap_or_default()
    }

    fn bad(&self, column: &str, problem: impl Into<String>) -> LibraryError {
        LibraryError::BadCell {
            file: self.file.to_owned(),
            line: self.line,
            number: self.index(column).map_or(0, |at| at + 1),
            column: column.to_owned(),
            found: self.text(column).to_owned(),
            problem: problem.into(),
        }
    }

    fn filled(&self, column: &str) -> Result<String, LibraryError> {
        match self.text(column) {
            "" => Err(self.bad(column, "must not be empty")),
            text => Ok(text.to_owned()),
        }
    }

    fn number(&self, column: &str) -> Result<f64, LibraryError> {
        let number: f64 =
            self.text(column).parse().map_err(|_| self.bad(column, "is no number; write it like 680 or 6.8e2"))?;
        if number.is_finite() { Ok(number) } else { Err(self.bad(column, "is not finite")) }
    }

    /// The range in the columns `name_low` and `name_high`, within `(at_least, below)`.
    fn range(&self, name: &str, at_least: f64, below: f64) -> Result<Range, LibraryError> {
        let [low, high] = [format!("{name}_low"), format!("{name}_high")];
        let range = Range::new(self.number(&low)?, self.number(&high)?);
        for (column, value) in [(&low, range.low), (&high, range.high)] {
            if value < at_least || value >= below {
                return Err(self.bad(column, format!("must be at least {at_least:e} and below {below:e} (SI)")));
            }
        }
        if range.low > range.high {
            return Err(self.bad(&high, format!("is less than the low end, {}", range.low)));
        }
        Ok(range)
    }

    fn scale(&self, column: &str) -> Result<ShoreScale, LibraryError> {
        match self.text(column) {
            "A" => Ok(ShoreScale::A),
            "D" => Ok(ShoreScale::D),
            _ => Err(self.bad(column, "is no Shore scale; write A or D")),
        }
    }

    fn sources(&self, column: &str) -> Vec<String> {
        let cited: Vec<String> = list(self.text(column));
        if cited.is_empty() { vec![USER.to_owned()] } else { cited }
    }

    fn label(&self, name: &str) -> Result<Label, LibraryError> {
        let flag = format!("{name}_exact");
        let exact = match self.text(&flag) {
            "1" => true,
            "0" | "" => false,
            _ => return Err(self.bad(&flag, "must be 1 (the label means this material) or 0 (it is the nearest)")),
        };
        Ok(Label { name: self.text(name).to_owned(), exact })
    }

    fn labels(&self) -> Result<Labels, LibraryError> {
        Ok(Labels { abo: self.label("label_abo")?, mvimgnet: self.label("label_mvimgnet")? })
    }

    fn law(&self) -> Result<Law, LibraryError> {
        let mut given: Vec<(&str, f64)> = Vec::new();
        for pair in self.text("law_parameters").split(';').map(str::trim).filter(|pair| !pair.is_empty()) {
            let parsed = pair.split_once('=').and_then(|(name, value)| Some((name.trim(), value.trim().parse().ok()?)));
            given.push(parsed.ok_or_else(|| self.bad("law_parameters", "must be name=number pairs between ;"))?);
        }
        let take = |name: &str, at_least: f64, below: f64| {
            let value = given.iter().find(|(given, _)| *given == name).map(|(_, value)| *value);
            value.filter(|value| (at_least..below).contains(value)).ok_or_else(|| {
                let problem = format!("lacks `{name}` for this law, at least {at_least:e} and below {below:e} (SI)");
                self.bad("law_parameters", problem)
            })
        };
        let law = match self.text("law") {
            "elastic" => Law::Elastic,
            "von_mises" => Law::VonMises { yield_stress_pa: take("yield_stress_pa", 1.0, 1e12)? },
            "drucker_prager" => Law::DruckerPrager {
                friction_angle_rad: take("friction_angle_rad", 0.0, std::f64::consts::FRAC_PI_2)?,
                cohesion_pa: take("cohesion_pa", 0.0, 1e9)?,
            },
            "foam" => Law::Foam {
                yield_stress_pa: take("yield_stress_pa", 0.1, 1e9)?,
                viscosity_pa_s: take("viscosity_pa_s", 0.0, 1e9)?,
            },
            "snow" => Law::Snow {
                theta_c: take("theta_c", 1e-4, 1.0)?,
                theta_s: take("theta_s", 1e-5, 1.0)?,
                hardening: take("hardening", 0.0, 100.0)?,
            },
            "plasticine" => Law::Plasticine {
                yield_stress_pa: take("yield_stress_pa", 0.1, 1e9)?,
                softening: take("softening", 0.0, 1.0 + f64::EPSILON)?,
            },
            _ => {
                let problem = "is no law; write elastic, von_mises, drucker_prager, foam, snow or plasticine";
                return Err(self.bad("law", problem));
            }
        };
        let known = law.parameters();
        match given.iter().find(|(name, _)| !known.iter().any(|(parameter, _)| parameter == name)) {
            Some((name, _)) => Err(self.bad("law_parameters", format!("gives `{name}`, which the law does not have"))),
            None => Ok(law),
        }
    }
}

/// The entries of a list cell, which `;` divides.
fn list(cell: &str) -> Vec<String> {
    cell.split(';').map(str::trim).filter(|entry| !entry.is_empty()).map(str::to_owned).collect()
}

/// Smallest accepted density, modulus: below is surely a wrong unit (aerogel 1 kg/m3; a gel 10 Pa).
const LEAST: f64 = 1.0;

fn material(row: &Row) -> Result<Placed, LibraryError> {
    let kind = StrengthKind::NAMES.iter().find(|(name, _)| *name == row.text("strength_kind"));
    let kinds = StrengthKind::NAMES.map(|(name, _)| name).join(", ");
    let material = Material {
        name: row.filled("name")?,
        family: row.filled("family")?,
        aliases: list(row.text("aliases")),
        density_kg_m3: row.range("density_kg_m3", LEAST, 1e5)?,
        youngs_modulus_pa: row.range("youngs_modulus_pa", LEAST, 1e13)?,
        poisson_ratio: row.range("poisson_ratio", -0.999, 0.5)?,
        strength_pa: row.range("strength_pa", 0.0, 1e12)?,
        strength_kind: kind.ok_or_else(|| row.bad("strength_kind", format!("is no kind; write one of {kinds}")))?.1,
        friction_rubber: row.range("friction_rubber", 0.0, 5.0)?,
        friction_steel: row.range("friction_steel", 0.0, 5.0)?,
        hardness: hardness(row)?,
        law: row.law()?,
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
    let family_column = row.index("family").map_or(0, |at| at + 1);
    Ok(Placed { material, file: row.file.to_owned(), line: row.line, family_column })
}

fn hardness(row: &Row) -> Result<Option<ShoreHardness>, LibraryError> {
    if row.text("hardness_scale").is_empty() {
        return match ["hardness_low", "hardness_high"].into_iter().find(|column| !row.text(column).is_empty()) {
            Some(column) => Err(row.bad(column, "needs its scale in `hardness_scale`, A or D")),
            None => Ok(None),
        };
    }
    let range = row.range("hardness", 0.0, 100.0 + 1e-9)?;
    Ok(Some(ShoreHardness { scale: row.scale("hardness_scale")?, range }))
}

fn family(row: &Row) -> Result<Family, LibraryError> {
    let reading = |end: &str| -> Result<ShoreReading, LibraryError> {
        let column = format!("hardness_{end}");
        Ok(ShoreReading { scale: row.scale(&format!("{column}_scale"))?, value: row.number(&column)? })
    };
    Ok(Family {
        name: row.filled("family")?,
        density_kg_m3: row.range("density_kg_m3", LEAST, 1e5)?,
        youngs_modulus_pa: row.range("youngs_modulus_pa", LEAST, 1e13)?,
        poisson_ratio: row.range("poisson_ratio", -0.999, 0.5)?,
        strength_pa: row.range("strength_pa", 0.0, 1e12)?,
        strength_meaning: row.filled("strength_meaning")?,
        friction_rubber: row.range("friction_rubber", 0.0, 5.0)?,
        friction_steel: row.range("friction_steel", 0.0, 5.0)?,
        hardness: [reading("low")?, reading("high")?],
        law: row.law()?,
        labels: row.labels()?,
    })
}

fn reference(row: &Row) -> Reference {
    let text = |column: &str| row.text(column).to_owned();
    Reference {
        id: text("id"),
        title: text("title"),
        publisher: text("publisher"),
        year: text("year"),
        locator: text("locator"),
        licence: text("licence"),
    }
}

fn evidence(row: &Row) -> Result<Evidence, LibraryError> {
    let value = |name: &str| match row.text(&format!("{name}_low")) {
        "" => Ok(None),
        _ => row.range(name, -0.999, 1e13).map(Some),
    };
    Ok(Evidence {
        source: row.filled("source")?,
        entry: row.filled("entry")?,
        title: row.filled("title")?,
        values: [value("density_kg_m3")?, value("youngs_modulus_pa")?, value("poisson_ratio")?, value("strength_pa")?],
    })
}

fn deviation(row: &Row) -> Deviation {
    let text = |column: &str| row.text(column).to_owned();
    Deviation { subject: text("subject"), check: text("check"), reason: text("reason") }
}
