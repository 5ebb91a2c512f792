//! Turns a model's JSON about the whole object into a [`Recognition`]: probabilities that add up to 1, SI units, materials
//! of the library.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{
    BULK_DENSITY, DENSITY, FILL_SHARE, FILLING_DENSITY, LIKENESS, Problem, Quantity, WALL_THICKNESS, WrittenMake,
    in_order, make, possible,
};
use crate::consensus::FoundThing;
use crate::materials::{Family, Material, MaterialLibrary, fold};
use crate::query::{Answer, Failure, Form};
use crate::units::Range;

const KG_PER_G: f64 = 1e-3;
const M3_PER_ML: f64 = 1e-6;
/// From a milligram to a thousand tonnes, as for a kitchen scale's reading.
const MASS: Quantity = Quantity {
    field: "mass_g",
    name: "mass in kg",
    what: "a mass in g",
    unit: KG_PER_G,
    bounds: Range::new(1e-6, 1e6),
};

/// The numbers that are possible in the fields of answers, in the fields' units: by the name of the field, or, if it differs from
/// that, by its lists and its name, such as `unnumbered.mass_g`.
pub fn limits() -> BTreeMap<&'static str, Range> {
    let in_unit = |quantity: Quantity| {
        let Quantity { field, unit, bounds, .. } = quantity;
        (field, Range::new(bounds.low / unit, bounds.high / unit))
    };
    let (_, mass_g) = in_unit(MASS);
    // A millilitre of most contents weighs about a gram.
    let printed = [("printed_mass_g", mass_g), ("printed_volume_ml", mass_g)];
    // Nothing may add next to nothing.
    let unnumbered = ("unnumbered.mass_g", Range::new(0.0, mass_g.high));
    // A person is asked again instead of being put right.
    let confidence = ("confidence", Range::new(0.0, 1.0));
    let quantities = [WALL_THICKNESS, FILL_SHARE, FILLING_DENSITY, BULK_DENSITY, DENSITY, MASS];
    quantities.map(in_unit).into_iter().chain(printed).chain([unnumbered, confidence]).collect()
}

/// What a model says of the object as a whole.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recognition {
    /// The object, as the model names it.
    pub object: String,
    /// What is printed on it about its contents, if that is legible.
    pub printed: Option<Printed>,
    /// What it may be, at least one, the most probable first; their probabilities add up to 1.
    pub hypotheses: Vec<Hypothesis>,
    /// Every region of the question belongs to exactly one of them.
    #[serde(rename = "pieces")]
    pub parts: Vec<RecognizedPart>,
    /// What has no region of its own.
    pub unnumbered: Vec<Unnumbered>,
}

/// What is printed on the object about its contents.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Printed {
    /// Word for word.
    pub text: String,
    pub mass_kg: Option<f64>,
    pub volume_m3: Option<f64>,
}

/// One thing that the whole object may be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    pub what: String,
    pub probability: f64,
    /// The mass of the whole object if this is what it is; holds the truth in nine of ten cases, as the model believes.
    pub mass_kg: Range,
}

/// Regions that are one part of one material, as the model says: a "piece" of its answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecognizedPart {
    /// The ids of its regions, in order.
    pub numbers: Vec<u16>,
    pub caption: String,
    /// How it may be made, at least one.
    pub choices: Vec<Choice>,
    /// What it shows, if it was found later; `None` for those of the answer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub found: Option<Found>,
}

/// What a part shows that was found where the answer names a thing without a number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Its index among the things without a number.
    pub thing: usize,
    /// The indices of the parts from which it was cut, at least one, the one that lost most first.
    pub cut_from: Vec<usize>,
}

/// One way in which a part may be made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The hypotheses under which it may be so, by index.
    pub under: Vec<usize>,
    /// Relative to the other choices under the same hypothesis.
    pub probability: f64,
    pub answer: Answer,
}

/// Something that has no region of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unnumbered {
    pub what: String,
    pub probability: f64,
    /// The panel that shows it, from 0, and its place there, from 0 to 1 from the upper left corner; `None` if none does.
    pub place: Option<(usize, [f64; 2])>,
    /// How much heavier it makes the object.
    pub mass_kg: Range,
}

impl Recognition {
    /// Why it cannot be what [`read`] made: a work folder may come from anyone.
    pub fn problem(&self) -> Option<String> {
        let hypotheses = self.hypotheses.len();
        let mut numbers = BTreeSet::new();
        let is_whole = |part: &RecognizedPart| {
            let is_known =
                |choice: &Choice| choice.under.iter().all(|&of| of < hypotheses) && choice.probability.is_finite();
            !part.choices.is_empty() && part.choices.iter().all(is_known)
        };
        if hypotheses == 0 || !self.parts.iter().all(is_whole) {
            return Some("it has no hypothesis, or a piece without a choice".to_owned());
        }
        if !self.parts.iter().flat_map(|part| &part.numbers).all(|number| numbers.insert(*number)) {
            return Some("a region is in two of its pieces".to_owned());
        }
        let is_known = |found: &Found| {
            let are_parts = !found.cut_from.is_empty() && found.cut_from.iter().all(|part| *part < self.parts.len());
            are_parts && found.thing < self.unnumbered.len()
        };
        if !self.parts.iter().filter_map(|part| part.found.as_ref()).all(is_known) {
            return Some("a piece in it is a thing that it does not name".to_owned());
        }
        let masses = self.hypotheses.iter().map(|of| of.mass_kg).chain(self.unnumbered.iter().map(|of| of.mass_kg));
        (!masses.into_iter().all(Range::is_positive)).then(|| "a mass in it is impossible".to_owned())
    }

    /// The same with the regions that were found later, each a part of its own, which may be made as the part is from which it was cut.
    pub fn with(mut self, found: &[FoundThing]) -> Self {
        for FoundThing { thing, id, cut_from } in found {
            let Some(named) = self.unnumbered.get(*thing) else { continue };
            let part_with = |region: &u16| self.parts.iter().position(|of| of.numbers.contains(region));
            let mut around: Vec<usize> = Vec::new();
            for part in cut_from.iter().filter_map(part_with) {
                if !around.contains(&part) {
                    around.push(part);
                }
            }
            let Some(first) = around.first() else { continue };
            self.parts.push(RecognizedPart {
                numbers: vec![*id],
                caption: named.what.clone(),
                choices: self.parts[*first].choices.clone(),
                found: Some(Found { thing: *thing, cut_from: around }),
            });
        }
        self
    }

    /// For each region, the first region of its part, by which the part goes.
    pub fn first_of_part(&self) -> BTreeMap<u16, u16> {
        let of_part = |part: &RecognizedPart| {
            let first = part.numbers.first().copied();
            part.numbers.iter().filter_map(|number| Some((*number, first?))).collect::<Vec<_>>()
        };
        self.parts.iter().flat_map(of_part).collect()
    }
}

impl RecognizedPart {
    /// The probability of each choice under a hypothesis: 0 for those that it excludes, and all of them as they are if it
    /// excludes all.
    pub fn probabilities(&self, hypothesis: usize) -> Vec<f64> {
        let probability_of =
            |choice: &Choice| if choice.under.contains(&hypothesis) { choice.probability } else { 0.0 };
        normalized(self.choices.iter().map(probability_of).collect())
            .or_else(|| normalized(self.choices.iter().map(|choice| choice.probability).collect()))
            .unwrap_or_else(|| vec![1.0 / self.choices.len() as f64; self.choices.len()])
    }
}

/// Weights as probabilities; `None` if they add up to nothing.
fn normalized(weights: Vec<f64>) -> Option<Vec<f64>> {
    let sum: f64 = weights.iter().sum();
    (sum > 0.0).then(|| weights.into_iter().map(|weight| weight / sum).collect())
}

/// The fields of `prompts/object.schema.json`, in its units.
#[derive(Debug, Deserialize)]
struct Written {
    object: String,
    printed: Option<String>,
    printed_mass_g: Option<f64>,
    printed_volume_ml: Option<f64>,
    hypotheses: Vec<WrittenHypothesis>,
    pieces: Vec<WrittenPiece>,
    unnumbered: Vec<WrittenUnnumbered>,
}

#[derive(Debug, Deserialize)]
struct WrittenHypothesis {
    what: String,
    probability: f64,
    mass_g: Range,
}

#[derive(Debug, Deserialize)]
struct WrittenPiece {
    numbers: Vec<u16>,
    caption: String,
    choices: Vec<WrittenChoice>,
}

#[derive(Debug, Deserialize)]
struct WrittenChoice {
    under: Vec<usize>,
    probability: f64,
    family: String,
    material: String,
    #[serde(flatten)]
    make: WrittenMake,
    density_kg_m3: Range,
}

#[derive(Debug, Deserialize)]
struct WrittenUnnumbered {
    what: String,
    probability: f64,
    panel: Option<String>,
    at: Option<[f64; 2]>,
    mass_g: Range,
}

/// Reads an answer that follows the schema, to a question about these region `numbers`.
///
/// # Errors
/// What the model has to correct.
pub fn read(value: Value, numbers: &[u16], library: &MaterialLibrary) -> Result<Recognition, Problem> {
    let written: Written = serde_json::from_value(value).map_err(|error| Problem::invalid(format!("{error}.")))?;
    let hypotheses = hypotheses(&written.hypotheses)?;
    check_numbers(&written.pieces, numbers)?;
    let parts = written.pieces.iter().map(|piece| part(piece, hypotheses.len(), library));
    Ok(Recognition {
        object: written.object.trim().to_owned(),
        printed: printed(&written),
        parts: parts.collect::<Result<_, _>>()?,
        unnumbered: written.unnumbered.iter().map(unnumbered).collect::<Result<_, _>>()?,
        hypotheses,
    })
}

fn hypotheses(written: &[WrittenHypothesis]) -> Result<Vec<Hypothesis>, Problem> {
    let probabilities = written.iter().map(|hypothesis| hypothesis.probability.max(0.0)).collect();
    let probabilities = normalized(probabilities)
        .ok_or_else(|| Problem::invalid("hypotheses: their probabilities have to add up to 1.".to_owned()))?;
    let read = |(written, probability): (&WrittenHypothesis, f64)| {
        let mass_kg = possible(&MASS, written.mass_g, &mut Vec::new())?;
        Ok(Hypothesis { what: written.what.trim().to_owned(), probability, mass_kg })
    };
    written.iter().zip(probabilities).map(read).collect()
}

/// Checks that every region is in exactly one piece.
fn check_numbers(pieces: &[WrittenPiece], numbers: &[u16]) -> Result<(), Problem> {
    let mut left: BTreeSet<u16> = numbers.iter().copied().collect();
    for number in pieces.iter().flat_map(|piece| &piece.numbers) {
        if !left.remove(number) {
            let problem = if numbers.contains(number) {
                "is in two pieces".to_owned()
            } else {
                format!("is not in the picture, which has {}", listed(numbers.iter()))
            };
            return Err(Problem::invalid(format!("pieces: number {number} {problem}.")));
        }
    }
    if left.is_empty() {
        return Ok(());
    }
    Err(Problem::invalid(format!("pieces: give each of the numbers {} to a piece.", listed(left.iter()))))
}

fn listed<'a>(numbers: impl Iterator<Item = &'a u16>) -> String {
    numbers.map(u16::to_string).collect::<Vec<_>>().join(", ")
}

fn part(written: &WrittenPiece, hypotheses: usize, library: &MaterialLibrary) -> Result<RecognizedPart, Problem> {
    let mut numbers = written.numbers.clone();
    numbers.sort_unstable();
    let caption = written.caption.trim();
    let choices = written.choices.iter().map(|choice| self::choice(choice, caption, hypotheses, library));
    let choices = choices.collect::<Result<_, _>>()?;
    Ok(RecognizedPart { numbers, caption: caption.to_owned(), choices, found: None })
}

fn choice(
    written: &WrittenChoice,
    caption: &str,
    hypotheses: usize,
    library: &MaterialLibrary,
) -> Result<Choice, Problem> {
    let mut flags = Vec::new();
    let material = material(written, library, &mut flags)?;
    let (form, inside) = make(&written.make, library, &mut flags)?;
    // No row of the library bounds it, since rows are found by words here, and the density of a foam or a wood does not follow from
    // its name.
    let density_kg_m3 = possible(&DENSITY, written.density_kg_m3, &mut flags)?;
    // The model counts from 1.
    let under: Vec<usize> = written.under.iter().filter_map(|place| place.checked_sub(1)).collect();
    if let Some(place) = under.iter().find(|place| **place >= hypotheses) {
        return Err(Problem::invalid(format!("under: there is no hypothesis {}.", place + 1)));
    }
    Ok(Choice {
        under: if under.is_empty() { (0..hypotheses).collect() } else { under },
        probability: written.probability.clamp(0.0, 1.0),
        answer: Answer {
            caption: caption.to_owned(),
            density_kg_m3,
            form,
            inside,
            bulk_reason: (form == Form::Mixed).then(|| "as a whole, with all gaps".to_owned()),
            confidence: written.probability.clamp(0.0, 1.0),
            flags,
            ..Answer::of(material)
        },
    })
}

/// The row of the library that is meant: the model has not seen its names.
fn material<'a>(
    written: &WrittenChoice,
    library: &'a MaterialLibrary,
    flags: &mut Vec<String>,
) -> Result<&'a Material, Problem> {
    let name = written.material.trim();
    let family = library.family(&written.family).ok_or_else(|| {
        Problem::invalid(format!(
            "the family {:?} is not in the list. Copy a name from the list exactly.",
            written.family
        ))
    })?;
    if let Some(exact) = library.get(name) {
        if exact.family != family.name {
            flags.push(format!("{} is of the family {}, not {}", exact.name, exact.family, family.name));
        }
        return Ok(exact);
    }
    // Names are the model's own here, often with words about the part in them: any material of the family that shares a word is
    // nearer than none.
    if let Some((found, _)) = library.nearest_of_family(name, &family.name) {
        if fold(&found.name) != fold(name) {
            flags.push(format!("{name:?} is not in the library; the nearest name, {}, is used", found.name));
        }
        return Ok(found);
    }
    let found = without_a_word(written, family, library).ok_or_else(|| Problem {
        reason: format!("the material {name:?} is not known, and neither is any of the family {}.", family.name),
        failure: Failure::UnknownMaterial { material: name.to_owned() },
    })?;
    flags.push(format!("{name:?} is not known; {}, of the family {}, is the nearest", found.name, found.family));
    Ok(found)
}

/// What stands for a material that shares no word with any of its family: one of another family with nearly the same name, such as
/// a thermoplastic elastomer, which is a rubber here; else the one of the family whose density is nearest to the answer's.
fn without_a_word<'a>(
    written: &WrittenChoice,
    family: &'a Family,
    library: &'a MaterialLibrary,
) -> Option<&'a Material> {
    let of_other = library.nearest(written.material.trim()).filter(|(_, likeness)| *likeness >= LIKENESS);
    let off = |material: &&Material| (material.density_kg_m3.mid() - written.density_kg_m3.mid()).abs();
    let by_density = || library.of_family(&family.name).min_by(|a, b| off(a).total_cmp(&off(b)));
    of_other.map(|(material, _)| material).or_else(by_density)
}

fn printed(written: &Written) -> Option<Printed> {
    let text = written.printed.as_deref().map(str::trim).filter(|text| !text.is_empty())?;
    let amount = |value: Option<f64>, unit: f64| value.filter(|value| *value > 0.0).map(|value| value * unit);
    Some(Printed {
        text: text.to_owned(),
        mass_kg: amount(written.printed_mass_g, KG_PER_G),
        volume_m3: amount(written.printed_volume_ml, M3_PER_ML),
    })
}

fn unnumbered(written: &WrittenUnnumbered) -> Result<Unnumbered, Problem> {
    let panel = written.panel.as_deref().and_then(|letter| "ABCD".find(letter));
    // Nothing may add next to nothing, so a range may begin at 0.
    let said = in_order(MASS.name, written.mass_g, &mut Vec::new());
    let mass_kg =
        possible(&MASS, Range::new(said.low, said.high.max(MASS.bounds.low / KG_PER_G * 2.0)), &mut Vec::new())?;
    Ok(Unnumbered {
        what: written.what.trim().to_owned(),
        probability: written.probability.clamp(0.0, 1.0),
        place: panel.zip(written.at.map(|at| at.map(|share| share.clamp(0.0, 1.0)))),
        mass_kg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn choice(under: &[usize], probability: f64, material: &str) -> Value {
        json!({
            "under": under, "probability": probability, "family": "metal", "material": material, "form": "solid",
            "wall_thickness_mm": null, "inside": null, "filling": null, "fill_share": null,
            "filling_density_kg_m3": null, "density_kg_m3": [7700, 8100],
        })
    }

    fn answer(pieces: Value) -> Value {
        json!({
            "object": "a spoon", "printed": " NET WT 305 g ", "printed_mass_g": 305, "printed_volume_ml": null,
            "hypotheses": [
                { "what": "steel", "probability": 0.9, "mass_g": [30, 50] },
                { "what": "aluminium", "probability": 0.3, "mass_g": [10, 20] },
            ],
            "pieces": pieces, "unnumbered": [{
                "what": "a core", "probability": 0.5, "panel": "B", "at": [0.2, 1.4], "mass_g": [0, 5],
            }],
        })
    }

    fn read(value: Value) -> Result<Recognition, Problem> {
        super::read(value, &[1, 2], MaterialLibrary::builtin())
    }

    #[test]
    fn probabilities_add_up_and_units_are_si() {
        let choices = json!([choice(&[1], 0.8, "stainless steel 304"), choice(&[2], 0.4, "aluminium 6061-t6")]);
        let said = read(answer(json!([{ "numbers": [2, 1], "caption": "all of it", "choices": choices }]))).unwrap();
        assert!((said.hypotheses[0].probability - 0.75).abs() < 1e-12, "{:?}", said.hypotheses);
        assert_eq!(said.hypotheses[1].mass_kg, Range::new(0.01, 0.02));
        assert_eq!(said.printed.as_ref().unwrap().mass_kg, Some(0.305));
        assert_eq!(said.unnumbered[0].place, Some((1, [0.2, 1.0])));
        let part = &said.parts[0];
        assert_eq!(part.numbers, [1, 2]);
        assert_eq!([part.probabilities(0), part.probabilities(1)], [[1.0, 0.0], [0.0, 1.0]]);
        assert!(part.choices.iter().all(|choice| choice.answer.family == "metal"), "{part:?}");
        assert_eq!(part.choices[0].answer.density_kg_m3, Range::new(7700.0, 8100.0), "as said, not the library's");
    }

    #[test]
    fn a_material_is_found_by_any_word_of_its_family() {
        let material = |name: &str| {
            let choices = json!([choice(&[], 1.0, name)]);
            let said = read(answer(json!([{ "numbers": [1, 2], "caption": "x", "choices": choices }])));
            said.map(|said| said.parts[0].choices[0].answer.material.clone()).map_err(|problem| problem.reason)
        };
        assert!(material("carbon steel, medium to high carbon (aisi 1060)").unwrap().contains("carbon"));
        assert!(material("steel chuck body and jaws in a polyamide sleeve").unwrap().contains("steel"));
        assert_eq!(
            material("thermoplastic polyurethane").unwrap(),
            "tpu 85a",
            "the name counts, not the family beside it"
        );
        assert_eq!(material("thermoplastic elastomer (tpe)").unwrap(), "tpe, sebs 40a", "of another family");
        let steel = material("unobtainium").unwrap();
        let density = MaterialLibrary::builtin().get(&steel).unwrap().density_kg_m3;
        assert!(density.low < 8100.0 && density.high > 7700.0, "{steel} is as dense as the answer says");
    }

    #[test]
    fn every_region_belongs_to_exactly_one_piece() {
        let piece =
            |numbers: &[u16]| json!({ "numbers": numbers, "caption": "x", "choices": [choice(&[], 1.0, "steel")] });
        let problem = |pieces: Value| read(answer(pieces)).unwrap_err().reason;
        assert!(problem(json!([piece(&[1])])).contains("each of the numbers 2"));
        assert!(problem(json!([piece(&[1, 2]), piece(&[2])])).contains("2 is in two pieces"));
        assert!(problem(json!([piece(&[1, 2, 7])])).contains("7 is not in the picture"));
        assert!(
            problem(json!([{ "numbers": [1, 2], "caption": "x", "choices": [choice(&[3], 1.0, "steel")] }]))
                .contains("no hypothesis 3")
        );
    }
}
