//! Turns a model's JSON into an [`Answer`]: converts units to SI, finds the material's row in the library and keeps
//! numbers within what is possible.
//!
//! Both the library and the model give a range for every property. (But hardness has no bounds but 0 and 100; and what no
//! material bounds, such as the density of a mixed part, is only clamped, and refused if nothing of it is possible.)
//!
//! 1. If the model's range does not overlap that of the library's row, the answer is the row's range, flagged.
//! 2. Otherwise the model's range is clamped to what the bounds of the material's family and the row span; a clamped range
//!    is flagged.
//! 3. The answer is the narrower of the two. It is not their overlap, which is the smaller the more they disagree, so that
//!    disagreement would pass for certainty.
//!
//! The model's own text stays in the recording.

pub(super) mod extract;
pub(super) mod jsonl;
pub(super) mod labels;
pub(super) mod recognition;

use serde::Deserialize;
use serde_json::Value;

use super::{AlternativeMaterial, Answer, Failure, Form, Inside, Match};
use crate::materials::{Family, Material, MaterialLibrary};
use crate::units::{Range, ShoreHardness, ShoreScale};

/// Pascals per megapascal.
pub(super) const PA_PER_MPA: f64 = 1e6;
const M_PER_MM: f64 = 1e-3;
/// Walls thinner than foil or thicker than a metre do not occur in objects that a gripper holds.
const WALL_THICKNESS: Quantity = Quantity {
    field: "wall_thickness_mm",
    name: "wall thickness in m",
    what: "a thickness in mm",
    unit: M_PER_MM,
    bounds: Range::new(1e-6, 1.0),
};
/// Lighter things than aerogel and denser ones than tungsten do not occur; a mixed part is in between.
const BULK_DENSITY: Quantity = Quantity {
    field: "bulk_density_kg_m3",
    name: "bulk density in kg/m3",
    what: "a density in kg/m3",
    unit: 1.0,
    bounds: Range::new(1.0, 20_000.0),
};
/// As that of a mixed part.
const DENSITY: Quantity = Quantity { field: "density_kg_m3", name: "density in kg/m3", ..BULK_DENSITY };
/// The share of the hollow that a filling takes up. A range that begins below 1 % is cut there; one that ends there is
/// refused.
const FILL_SHARE: Quantity = Quantity {
    field: "fill_share",
    name: "fill share",
    what: "a share of the hollow",
    unit: 1.0,
    bounds: Range::new(0.01, 1.0),
};
/// Lighter fillings than feathers and denser ones than lead shot do not occur.
const FILLING_DENSITY: Quantity = Quantity {
    field: "filling_density_kg_m3",
    name: "density of the filling in kg/m3",
    what: "a density in kg/m3",
    unit: 1.0,
    bounds: Range::new(2.0, 8000.0),
};
const SHORE: Range = Range::new(0.0, 100.0);
/// Three probabilities with two digits each may add up to this much more than 1.
const ROUNDING: f64 = 0.015;
/// Lowest similarity (0 to 1) at which a name is taken for a library name.
const LIKENESS: f64 = 0.5;

/// A number that no material of the library bounds.
struct Quantity {
    /// Its field in an answer.
    field: &'static str,
    /// With its unit in flags, which are in SI.
    name: &'static str,
    /// With the unit of the field.
    what: &'static str,
    /// The unit of the field in SI.
    unit: f64,
    /// What is possible, in SI.
    bounds: Range,
}

/// Why a response cannot be used.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// An explanation that lets the model correct the response.
    pub reason: String,
    pub failure: Failure,
}

impl Problem {
    /// A response that does not have the requested form.
    pub fn invalid(reason: String) -> Self {
        Self { failure: Failure::Invalid { message: reason.clone() }, reason }
    }

    /// The same at this place of the answer.
    fn at(self, place: &str) -> Self {
        let reason = format!("{place}: {}", self.reason);
        match self.failure {
            Failure::Invalid { .. } => Self::invalid(reason),
            failure => Self { reason, failure },
        }
    }
}

/// How to treat a material that the library does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unknown {
    /// Report it, so that the answer can be corrected.
    Refuse,
    /// Take the nearest name of the answer's family and flag it.
    TakeNearest,
}

/// The fields of `prompts/answer.schema.json`, in its units. Answers about segments lack those that are not required
/// here.
#[derive(Debug, Deserialize)]
struct Written {
    caption: String,
    family: String,
    material: String,
    density_kg_m3: Range,
    youngs_modulus_mpa: Range,
    poisson_ratio: Range,
    yield_strength_mpa: Range,
    shore_scale: WrittenScale,
    shore_hardness: Option<Range>,
    friction_rubber: Range,
    several_materials: bool,
    #[serde(flatten)]
    make: WrittenMake,
    bulk_density_kg_m3: Option<Range>,
    bulk_reason: Option<String>,
    confidence: f64,
    /// Only in an answer to a question that follows the one about the whole object.
    #[serde(default)]
    alternatives: Vec<WrittenAlternative>,
}

#[derive(Debug, Deserialize)]
struct WrittenAlternative {
    family: String,
    material: String,
    density_kg_m3: Range,
    wall_thickness_mm: Option<Range>,
    probability: f64,
}

/// How a part is made: the fields that answers about a part and about the whole object have in common.
#[derive(Debug, Deserialize)]
struct WrittenMake {
    form: WrittenForm,
    wall_thickness_mm: Option<Range>,
    inside: Option<WrittenInside>,
    filling: Option<String>,
    fill_share: Option<Range>,
    /// Only in an answer about the whole object.
    filling_density_kg_m3: Option<Range>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
enum WrittenScale {
    A,
    D,
    #[serde(rename = "none")]
    None,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum WrittenForm {
    Solid,
    Shell,
    Mixed,
}

#[derive(Debug, Clone, Copy, Deserialize)]
enum WrittenInside {
    #[serde(rename = "empty")]
    Empty,
    #[serde(rename = "filled")]
    Filled,
    #[serde(rename = "not known")]
    Unknown,
}

/// Reads an answer that follows the schema. It is marked as asked live; the caller changes that if it comes from a
/// recording.
pub fn read(value: Value, library: &MaterialLibrary, unknown: Unknown) -> Result<Answer, Problem> {
    let written: Written = serde_json::from_value(value).map_err(|error| Problem::invalid(format!("{error}.")))?;
    let mut flags = Vec::new();
    let names = Names { library, unknown };
    let (material, family) = names.find(&written.family, &written.material, &mut flags)?;
    let (form, inside) = make(&written.make, library, &mut flags)?;
    let alternatives = alternatives(&written, material, names, &mut flags)?;
    Ok(Answer { alternatives, ..settle(written, material, family, form, inside, flags)? })
}

/// Where materials are looked up.
#[derive(Clone, Copy)]
struct Names<'a> {
    library: &'a MaterialLibrary,
    unknown: Unknown,
}

impl<'a> Names<'a> {
    /// The material of this name with its family, which need not be the one that is `written` beside it.
    fn find(
        self,
        written: &str,
        material: &str,
        flags: &mut Vec<String>,
    ) -> Result<(&'a Material, &'a Family), Problem> {
        let material = self.material(written, material, flags)?;
        let family = self.library.family(&material.family).ok_or_else(|| {
            Problem::invalid(format!(
                "the library has no family {:?}, to which {:?} belongs.",
                material.family, material.name
            ))
        })?;
        if written != material.family {
            flags.push(format!("{} is of the family {}, not {written}", material.name, material.family));
        }
        Ok((material, family))
    }

    fn material(self, family: &str, name: &str, flags: &mut Vec<String>) -> Result<&'a Material, Problem> {
        let Self { library, unknown } = self;
        let name = name.trim();
        if let Some(material) = library.get(name) {
            return Ok(material);
        }
        // A similar name in another family means something else: petal is not metal.
        let nearest = library.nearest_of_family(name, family).filter(|(_, likeness)| *likeness >= LIKENESS);
        match (unknown, nearest) {
            (Unknown::TakeNearest, Some((material, _))) => {
                flags.push(format!("{name:?} is not in the library; the nearest name, {}, is used", material.name));
                Ok(material)
            }
            (_, nearest) => {
                let hint = nearest.map_or(String::new(), |(material, _)| format!(" Did you mean {:?}?", material.name));
                Err(Problem {
                    reason: format!(
                        "the material {name:?} is not in the list.{hint} Copy a name from the list exactly."
                    ),
                    failure: Failure::UnknownMaterial { material: name.into() },
                })
            }
        }
    }
}

/// What else the part may be made of, beside the `named` material.
fn alternatives(
    written: &Written,
    named: &Material,
    names: Names,
    flags: &mut Vec<String>,
) -> Result<Vec<AlternativeMaterial>, Problem> {
    let mut all: Vec<AlternativeMaterial> = Vec::new();
    for (place, of) in (1..).zip(&written.alternatives) {
        let mut own_flags = Vec::new();
        let place = format!("alternative {place}");
        let read = alternative(of, written.make.form, names, &mut own_flags).map_err(|problem| problem.at(&place))?;
        if read.material == named.name || all.iter().any(|other| other.material == read.material) {
            return Err(Problem::invalid(format!(
                "{place}: {} is named already; name another material.",
                read.material
            )));
        }
        flags.extend(own_flags.into_iter().map(|flag| format!("{place}: {flag}")));
        all.push(read);
    }
    let together = written.confidence.clamp(0.0, 1.0) + all.iter().map(|of| of.probability).sum::<f64>();
    if together > 1.0 + ROUNDING {
        return Err(Problem::invalid(format!(
            "alternatives: their probabilities and the confidence make {together:.2} together; at most 1 is possible."
        )));
    }
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    Ok(all)
}

/// An alternative to the material of a part of this form.
fn alternative(
    written: &WrittenAlternative,
    form: WrittenForm,
    names: Names,
    flags: &mut Vec<String>,
) -> Result<AlternativeMaterial, Problem> {
    let (material, family) = names.find(&written.family, &written.material, flags)?;
    if !(0.0..=1.0).contains(&written.probability) {
        return Err(Problem::invalid(format!(
            "probability: {} is not possible; give one from 0 to 1.",
            written.probability
        )));
    }
    let form = match (form, written.wall_thickness_mm) {
        // Instead of an imitation with a wall, the real fruit.
        (WrittenForm::Shell, None) => Form::Solid,
        (form, wall_thickness_mm) => self::form(form, wall_thickness_mm, flags)?,
    };
    let said = possible(&DENSITY, written.density_kg_m3, flags)?;
    let density_kg_m3 = if form == Form::Mixed {
        said
    } else {
        narrower(DENSITY.name, said, family.density_kg_m3, material.density_kg_m3, flags)
    };
    Ok(AlternativeMaterial {
        family: material.family.clone(),
        material: material.name.clone(),
        density_kg_m3,
        wall_thickness_m: if let Form::Shell { wall_thickness_m } = form { Some(wall_thickness_m) } else { None },
        probability: written.probability,
    })
}

/// The form of a part, and the contents of a shell.
fn make(
    written: &WrittenMake,
    library: &MaterialLibrary,
    flags: &mut Vec<String>,
) -> Result<(Form, Option<Inside>), Problem> {
    let form = form(written.form, written.wall_thickness_mm, flags)?;
    let inside = match form {
        Form::Shell { .. } => Some(inside(written, library, flags)?),
        Form::Solid | Form::Mixed => None,
    };
    Ok((form, inside))
}

fn form(form: WrittenForm, wall_thickness_mm: Option<Range>, flags: &mut Vec<String>) -> Result<Form, Problem> {
    match (form, wall_thickness_mm) {
        (WrittenForm::Solid, _) => Ok(Form::Solid),
        (WrittenForm::Mixed, _) => Ok(Form::Mixed),
        (WrittenForm::Shell, None) => {
            Err(Problem::invalid("form is \"shell\" but wall_thickness_mm is null; give the wall's thickness.".into()))
        }
        (WrittenForm::Shell, Some(said)) => {
            Ok(Form::Shell { wall_thickness_m: possible(&WALL_THICKNESS, said, flags)? })
        }
    }
}

/// The contents of a shell; unknown if the answer does not state them.
fn inside(written: &WrittenMake, library: &MaterialLibrary, flags: &mut Vec<String>) -> Result<Inside, Problem> {
    match written.inside {
        None | Some(WrittenInside::Unknown) => return Ok(Inside::Unknown),
        Some(WrittenInside::Empty) => return Ok(Inside::Empty),
        Some(WrittenInside::Filled) => {}
    }
    let lacking = |field: &str| Problem::invalid(format!("inside is \"filled\" but {field} is null; give it."));
    let name = written.filling.as_deref().ok_or_else(|| lacking("filling"))?;
    let filling = library.filling(name).ok_or_else(|| {
        Problem::invalid(format!("the filling {name:?} is not in the list. Copy a name from the list exactly."))
    })?;
    let share = possible(&FILL_SHARE, written.fill_share.ok_or_else(|| lacking("fill_share"))?, flags)?;
    let density = written.filling_density_kg_m3.map(|said| possible(&FILLING_DENSITY, said, flags)).transpose()?;
    Ok(Inside::Filled { filling: filling.name.clone(), share, density_kg_m3: density })
}

/// The density of a part. The density of a mixed part is that of the whole, which no material of the library bounds.
fn density(written: &Written, material: &Material, family: &Family, flags: &mut Vec<String>) -> Result<Range, Problem> {
    if matches!(written.make.form, WrittenForm::Mixed) {
        let said = written.bulk_density_kg_m3.ok_or_else(|| {
            Problem::invalid(
                "form is \"mixed\" but bulk_density_kg_m3 is null; give the density of the whole part.".to_owned(),
            )
        })?;
        return possible(&BULK_DENSITY, said, flags);
    }
    let name = "density in kg/m3";
    let said = in_order(name, written.density_kg_m3, flags);
    Ok(narrower(name, said, family.density_kg_m3, material.density_kg_m3, flags))
}

fn settle(
    written: Written,
    material: &Material,
    family: &Family,
    form: Form,
    inside: Option<Inside>,
    mut flags: Vec<String>,
) -> Result<Answer, Problem> {
    let density_kg_m3 = density(&written, material, family, &mut flags)?;
    let bulk_reason = written.bulk_reason.filter(|_| form == Form::Mixed);
    if form == Form::Mixed && bulk_reason.as_deref().is_none_or(|reason| reason.trim().is_empty()) {
        flags.push("the bulk density comes without a reason".to_owned());
    }
    let mut property = |name: &str, said: Range, family: Range, row: Range| {
        let said = in_order(name, said, &mut flags);
        narrower(name, said, family, row, &mut flags)
    };
    let youngs_modulus_pa = property(
        "Young's modulus in Pa",
        scaled(written.youngs_modulus_mpa, PA_PER_MPA),
        family.youngs_modulus_pa,
        material.youngs_modulus_pa,
    );
    let poisson_ratio =
        property("Poisson's ratio", written.poisson_ratio, family.poisson_ratio, material.poisson_ratio);
    let yield_strength_pa = property(
        "strength in Pa",
        scaled(written.yield_strength_mpa, PA_PER_MPA),
        family.strength_pa,
        material.strength_pa,
    );
    let friction_rubber =
        property("friction", written.friction_rubber, family.friction_rubber, material.friction_rubber);
    let hardness = hardness(written.shore_scale, written.shore_hardness, material.hardness, &mut flags);
    let confidence = written.confidence.clamp(0.0, 1.0);
    if confidence != written.confidence {
        flags.push(format!("confidence {} is not within 0 to 1; it was clamped", written.confidence));
    }
    Ok(Answer {
        caption: written.caption.trim().into(),
        family: material.family.clone(),
        material: material.name.clone(),
        density_kg_m3,
        youngs_modulus_pa,
        poisson_ratio,
        yield_strength_pa,
        hardness,
        friction_rubber,
        form,
        inside,
        bulk_reason,
        several_materials: written.several_materials,
        confidence,
        alternatives: Vec::new(),
        matched: Match::Live,
        flags,
    })
}

/// The two scales cannot be converted into each other: a value on another scale than the library's is replaced by the
/// library's.
fn hardness(
    scale: WrittenScale,
    said: Option<Range>,
    row: Option<ShoreHardness>,
    flags: &mut Vec<String>,
) -> Option<ShoreHardness> {
    let row = row?;
    let scale = match scale {
        WrittenScale::A => ShoreScale::A,
        WrittenScale::D => ShoreScale::D,
        WrittenScale::None => return Some(row),
    };
    let Some(said) = said else { return Some(row) };
    if scale != row.scale {
        flags.push(format!("hardness was given on Shore {scale:?}; the library's, on Shore {:?}, is used", row.scale));
        return Some(row);
    }
    let said = in_order("hardness", said, flags);
    Some(ShoreHardness { scale, range: narrower("hardness", said, SHORE, row.range, flags) })
}

fn scaled(range: Range, factor: f64) -> Range {
    Range::new(range.low * factor, range.high * factor)
}

fn in_order(name: &str, said: Range, flags: &mut Vec<String>) -> Range {
    if said.low <= said.high {
        return said;
    }
    flags.push(format!("{name}: low and high were swapped"));
    Range::new(said.high, said.low)
}

/// What is possible of a range in the unit of its field, in SI.
///
/// # Errors
/// If that is nothing, or no more than one end of what is possible: a range would become an exact number that nobody gave.
fn possible(quantity: &Quantity, written: Range, flags: &mut Vec<String>) -> Result<Range, Problem> {
    let Quantity { field, name, what, unit, bounds } = *quantity;
    let said = in_order(name, scaled(written, unit), flags);
    let cut = cut(name, said, bounds, flags);
    if cut.low == cut.high && cut != said {
        return Err(Problem::invalid(format!(
            "{field}: {} is not possible; give {what}, from {} to {}.",
            shown(written),
            bounds.low / unit,
            bounds.high / unit
        )));
    }
    Ok(cut)
}

fn cut(name: &str, said: Range, bounds: Range, flags: &mut Vec<String>) -> Range {
    let cut = said.clipped(bounds);
    if cut != said {
        flags.push(format!("{name}: {} exceeds the possible range {}; it was clamped", shown(said), shown(bounds)));
    }
    cut
}

/// The narrower of the answer's range, cut to what is possible, and the library's `row`; the library's if they do not
/// overlap.
fn narrower(name: &str, said: Range, bounds: Range, row: Range, flags: &mut Vec<String>) -> Range {
    if said.low > row.high || row.low > said.high {
        flags.push(format!(
            "{name}: the answer's {} does not overlap the library's {}; the library's is used",
            shown(said),
            shown(row)
        ));
        return row;
    }
    // A row may lie outside of its family's bounds, as cork does, which is softer than other wood.
    let said = cut(name, said, bounds.hull(row), flags);
    // Grows with high / low, but stays finite if low is 0.
    let width = |range: Range| (range.high - range.low) / (range.high + range.low).max(f64::MIN_POSITIVE);
    if width(said) <= width(row) { said } else { row }
}

fn shown(range: Range) -> String {
    let number = |value: f64| if value < 1e4 { format!("{value}") } else { format!("{value:e}") };
    format!("[{}, {}]", number(range.low), number(range.high))
}
