//! Which parts are asked about by themselves once the answer about the whole object is there: those of which an answer would
//! narrow the mass, and those whose material is visible and undecided.
//!
//! *Mass.* How heavy the object may be has a variance, which the hypotheses and their masses state. A part contributes to it
//! by how much its mass differs between the ways in which it may be made, which an answer about it tells apart. Its mass in each of
//! these ways is its share of the surface, times the density, times the thickness of the material behind the surface; all
//! masses are then scaled to what the hypotheses say on the average. Parts are asked about in the order of their contributions,
//! until what is left is less than [`LEFT_SHARE`] of the variance.
//!
//! *Material.* A part is undecided if its likeliest family of materials is less probable than [`DECIDED`], and visible if it is
//! [`VISIBLE_SHARE`] of the object in some view. (Materials of one family are alike in what is done with them, or differ in density,
//! which the first rule sees.)

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::materials::MaterialLibrary;
use crate::numeric::NORMAL_90;
use crate::query::{Answer, Form, Hypothesis, Inside, Recognition, RecognizedPart};
use crate::units::Range;

/// The share of the mass's variance that parts may leave: a standard deviation that is 5 % smaller is hardly noticed.
const LEFT_SHARE: f64 = 0.1;
/// The likeliest family is at least twice as probable as all others together.
const DECIDED: f64 = 2.0 / 3.0;
/// A square of this share is a sixth as wide as the object: smaller parts change little of a picture of its materials.
const VISIBLE_SHARE: f64 = 0.03;
/// Volume of a round rod over its area and diameter: a plate has 1/2, a ball has 1/6.
const DEPTH_OF_SOLID: f64 = 0.25;
/// An interval from the 5th to the 95th percentile does not reach what is less probable than this; but a variance does, if it is
/// far off, such as an imitation of a hammer.
const IMPROBABLE: f64 = 0.05;

/// How much of the object a region is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// The id of a part or a piece of one.
    pub id: u16,
    /// Its share of what all views show of the object, 0 to 1.
    pub area_share: f64,
    /// Its largest share of what one view shows of the object, 0 to 1.
    pub view_share: f64,
    /// Its least extent; `None` if the scale is unknown.
    pub depth_m: Option<f64>,
}

/// Why a part is asked about by itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Why {
    /// How it may be made decides this share of the variance of the object's mass.
    Mass { variance_share: f64 },
    /// Its likeliest family of materials is no more probable than this, and it is this share of the object in some view.
    Material { probability: f64, view_share: f64 },
    /// It was found where the answer about the object names something without a number, so that answer does not say what it is
    /// made of.
    Found,
}

/// The words that follow "because".
impl std::fmt::Display for Why {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let percent = |share: &f64| (100.0 * share).round();
        match self {
            Self::Mass { variance_share } => {
                write!(f, "what it is made of decides {} % of the variance of the mass", percent(variance_share))
            }
            Self::Material { probability, view_share } => write!(
                f,
                "its material is undecided ({} % for the likeliest family), and in one view it is {} % of the object",
                percent(probability),
                percent(view_share)
            ),
            Self::Found => f.write_str("it had no number when the model was asked what the object is made of"),
        }
    }
}

/// A part of the object to ask about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowUp {
    /// Its index among the parts.
    pub part: usize,
    pub why: Why,
}

/// The parts to ask about, the most worthwhile first.
pub fn follow_ups(recognition: &Recognition, regions: &[Region], library: &MaterialLibrary) -> Vec<FollowUp> {
    let regions: BTreeMap<u16, Region> = regions.iter().map(|region| (region.id, *region)).collect();
    let new = recognition.parts.iter().enumerate().filter(|(_, part)| part.found.is_some());
    let mut due: Vec<FollowUp> = new.map(|(part, _)| FollowUp { part, why: Why::Found }).collect();
    due.extend(for_mass(recognition, &regions, library));
    let undecided = for_material(recognition, &regions);
    let is_new = |of: &FollowUp| due.iter().all(|other| other.part != of.part);
    let undecided: Vec<FollowUp> = undecided.into_iter().filter(is_new).collect();
    due.extend(undecided);
    due
}

fn for_mass(recognition: &Recognition, regions: &BTreeMap<u16, Region>, library: &MaterialLibrary) -> Vec<FollowUp> {
    let Recognition { hypotheses, parts, .. } = recognition;
    let Some(masses) = parts.iter().map(|part| masses(part, regions, library)).collect::<Option<Vec<_>>>() else {
        return Vec::new();
    };
    let of_parts: Vec<Moments> = parts.iter().zip(&masses).map(|(part, of)| between(hypotheses, part, of)).collect();
    let whole = stated(hypotheses);
    let sum: f64 = of_parts.iter().map(|of| of.mean).sum();
    if !(sum > 0.0 && whole.variance > 0.0) {
        return Vec::new();
    }
    let to_kg2 = (whole.mean / sum).powi(2);
    let share = |part: usize| of_parts[part].variance * to_kg2 / whole.variance;
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by(|a, b| share(*b).total_cmp(&share(*a)));
    let mut left: f64 = order.iter().map(|part| share(*part)).sum();
    let is_due = |part: &usize| {
        let is_due = left >= LEFT_SHARE;
        left -= share(*part);
        is_due
    };
    let due: Vec<usize> = order.into_iter().take_while(is_due).collect();
    due.into_iter().map(|part| FollowUp { part, why: Why::Mass { variance_share: share(part).min(1.0) } }).collect()
}

fn for_material(recognition: &Recognition, regions: &BTreeMap<u16, Region>) -> Vec<FollowUp> {
    let Recognition { hypotheses, parts, .. } = recognition;
    let undecided = |(part, of): (usize, &RecognizedPart)| {
        let probability = likeliest_family(hypotheses, of);
        let view_share = regions_of(of, regions).map(|region| region.view_share).fold(0.0, f64::max);
        let is_due = probability < DECIDED && view_share >= VISIBLE_SHARE;
        is_due.then_some((view_share, FollowUp { part, why: Why::Material { probability, view_share } }))
    };
    let of_answer = parts.iter().enumerate().filter(|(_, of)| of.found.is_none());
    let mut due: Vec<(f64, FollowUp)> = of_answer.filter_map(undecided).collect();
    due.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    due.into_iter().map(|(_, follow_up)| follow_up).collect()
}

fn likeliest_family(hypotheses: &[Hypothesis], part: &RecognizedPart) -> f64 {
    let mut of_family: BTreeMap<&str, f64> = BTreeMap::new();
    for (index, hypothesis) in hypotheses.iter().enumerate() {
        for (choice, probability) in part.choices.iter().zip(part.probabilities(index)) {
            *of_family.entry(&choice.answer.family).or_default() += hypothesis.probability * probability;
        }
    }
    of_family.into_values().fold(0.0, f64::max)
}

fn regions_of<'a>(part: &RecognizedPart, regions: &'a BTreeMap<u16, Region>) -> impl Iterator<Item = &'a Region> {
    part.numbers.iter().filter_map(|number| regions.get(number))
}

/// By choice, the mass of a part up to a factor that all parts have in common; `None` if the scale is unknown.
fn masses(part: &RecognizedPart, regions: &BTreeMap<u16, Region>, library: &MaterialLibrary) -> Option<Vec<f64>> {
    let of_region =
        |answer: &Answer, region: &Region| Some(region.area_share * areal_density(answer, region.depth_m?, library));
    // What was found later weighs what the answer says, whatever it is made of.
    if part.found.is_some() {
        return Some(vec![0.0; part.choices.len()]);
    }
    let of_choice = |answer: &Answer| regions_of(part, regions).map(|region| of_region(answer, region)).sum();
    part.choices.iter().map(|choice| of_choice(&choice.answer)).collect()
}

/// The mass behind a square metre of surface, kg.
fn areal_density(answer: &Answer, depth_m: f64, library: &MaterialLibrary) -> f64 {
    let (density, behind) = (answer.density_kg_m3.mid(), DEPTH_OF_SOLID * depth_m);
    let Form::Shell { wall_thickness_m } = answer.form else { return density * behind };
    let wall = density * wall_thickness_m.mid();
    let Some(Inside::Filled { filling, share, density_kg_m3 }) = &answer.inside else { return wall };
    let of_row = || library.filling(filling).map(|row| row.density_kg_m3);
    wall + density_kg_m3.or_else(of_row).map_or(0.0, Range::mid) * share.mid() * behind
}

struct Moments {
    mean: f64,
    variance: f64,
}

impl Moments {
    /// Of values with probabilities and variances of their own, leaving out the [`IMPROBABLE`].
    fn of(values: impl Iterator<Item = (f64, f64, f64)>) -> Self {
        let (mut all, mut mean, mut square) = (0.0, 0.0, 0.0);
        for (probability, value, variance) in values.filter(|(probability, ..)| *probability >= IMPROBABLE) {
            all += probability;
            mean += probability * value;
            square += probability * (value * value + variance);
        }
        let (mean, square) = if all > 0.0 { (mean / all, square / all) } else { (0.0, 0.0) };
        Self { mean, variance: (square - mean * mean).max(0.0) }
    }
}

/// Of the object's mass, as the hypotheses state it, kg.
fn stated(hypotheses: &[Hypothesis]) -> Moments {
    let weighed = |hypothesis: &Hypothesis| {
        let Range { low, high } = hypothesis.mass_kg;
        (hypothesis.probability, hypothesis.mass_kg.mid(), (0.5 * (high - low) / NORMAL_90).powi(2))
    };
    Moments::of(hypotheses.iter().map(weighed))
}

/// Of a part's mass between its choices, which have these masses.
fn between(hypotheses: &[Hypothesis], part: &RecognizedPart, masses: &[f64]) -> Moments {
    let under = |(index, hypothesis): (usize, &Hypothesis)| {
        let probability = hypothesis.probability;
        part.probabilities(index).into_iter().zip(masses).map(move |(of, mass)| (probability * of, *mass, 0.0))
    };
    Moments::of(hypotheses.iter().enumerate().flat_map(under))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::{Choice, Found};

    fn answer(material: &str, form: Form) -> Answer {
        Answer { form, ..Answer::of(MaterialLibrary::builtin().get(material).unwrap()) }
    }

    /// A part of the region `number` that may be any of these with these probabilities, whatever the object is.
    fn part(number: u16, choices: &[(&str, f64)]) -> RecognizedPart {
        let wall = Form::Shell { wall_thickness_m: Range::new(0.001, 0.003) };
        let choice = |(material, probability): &(&str, f64)| Choice {
            under: vec![0, 1],
            probability: *probability,
            answer: answer(material, wall),
        };
        RecognizedPart {
            numbers: vec![number],
            caption: "a part".to_owned(),
            choices: choices.iter().map(choice).collect(),
            found: None,
        }
    }

    /// An object that weighs 0.9 to 1.1 kg, or, with this probability, as much as this.
    fn object(parts: Vec<RecognizedPart>, other: f64, mass_kg: Range) -> Recognition {
        let hypothesis = |probability, mass_kg| Hypothesis { what: "an object".to_owned(), probability, mass_kg };
        Recognition {
            object: "an object".to_owned(),
            printed: None,
            hypotheses: vec![hypothesis(1.0 - other, Range::new(0.9, 1.1)), hypothesis(other, mass_kg)],
            parts,
            unnumbered: Vec::new(),
        }
    }

    fn regions(view_shares: [f64; 3], depth_m: Option<f64>) -> Vec<Region> {
        let region = |(id, view_share)| Region { id, area_share: view_share, view_share, depth_m };
        (1..).zip(view_shares).map(region).collect()
    }

    fn due(recognition: &Recognition, regions: &[Region]) -> Vec<FollowUp> {
        follow_ups(recognition, regions, MaterialLibrary::builtin())
    }

    const SURE: &[(&str, f64)] = &[("steel, mild", 1.0)];

    #[test]
    fn the_piece_that_decides_the_mass_comes_first_and_what_matters_little_is_left() {
        let steel_or_plastic = [("steel, mild", 0.7), ("abs", 0.3)];
        let parts = vec![part(1, SURE), part(2, &steel_or_plastic), part(3, &steel_or_plastic)];
        let recognition = object(parts, 0.0, Range::new(1.0, 1.0));
        let order = |shares: [f64; 3]| -> Vec<usize> {
            due(&recognition, &regions(shares, Some(0.05))).iter().map(|of| of.part).collect()
        };
        assert_eq!(order([0.4, 0.25, 0.35]), [2, 1]);
        assert_eq!(order([0.4, 0.35, 0.25]), [1, 2]);
        assert_eq!(order([0.49, 0.5, 0.01]), [1], "the other leaves less than a tenth");
        let share = due(&recognition, &regions([0.5, 0.5, 0.0], Some(0.05)))[0].why;
        assert!(matches!(share, Why::Mass { variance_share } if variance_share > 0.5), "{share:?}");
        assert!(due(&recognition, &regions([0.4, 0.3, 0.3], None)).is_empty(), "without a scale, no mass");
    }

    #[test]
    fn a_mass_that_is_little_known_anyway_is_not_asked_for() {
        let parts = vec![part(1, SURE), part(2, &[("steel, mild", 0.9), ("brass, cartridge 70/30", 0.1)])];
        let shares = regions([0.5, 0.5, 0.0], Some(0.05));
        let vague = Recognition {
            hypotheses: vec![Hypothesis { what: "a thing".into(), probability: 1.0, mass_kg: Range::new(0.2, 3.0) }],
            ..object(parts, 0.0, Range::new(1.0, 1.0))
        };
        assert!(due(&vague, &shares).is_empty());
    }

    #[test]
    fn what_is_improbable_is_not_asked_about() {
        let imitation = |probability: f64| {
            let mut part = part(1, &[("steel, mild", 1.0), ("abs", 1.0)]);
            (part.choices[0].under, part.choices[1].under) = (vec![0], vec![1]);
            due(&object(vec![part], probability, Range::new(0.1, 0.2)), &regions([1.0, 0.0, 0.0], Some(0.05)))
        };
        assert!(imitation(0.04).is_empty());
        assert_eq!(imitation(0.2).len(), 1);
    }

    #[test]
    fn what_was_found_later_is_asked_about_first() {
        let steel_or_plastic = [("steel, mild", 0.7), ("abs", 0.3)];
        let found = Some(Found { thing: 0, cut_from: vec![0] });
        let parts = vec![part(1, &steel_or_plastic), RecognizedPart { found, ..part(2, &steel_or_plastic) }];
        let due = due(&object(parts, 0.0, Range::new(1.0, 1.0)), &regions([0.5, 0.5, 0.0], Some(0.05)));
        let why: Vec<(usize, bool)> = due.iter().map(|of| (of.part, of.why == Why::Found)).collect();
        assert_eq!(why, [(1, true), (0, false)]);
    }

    #[test]
    fn an_undecided_material_is_asked_about_if_it_is_visible() {
        let glass_or_plastic = [("pc", 0.6), ("soda-lime glass, float", 0.4)];
        let asked = |choices: &[(&str, f64)], share: f64| {
            let recognition = object(vec![part(1, SURE), part(2, choices)], 0.0, Range::new(1.0, 1.0));
            let due = due(&recognition, &regions([1.0 - share, share, 0.0], None));
            due.first().map(|of| (of.part, of.why))
        };
        assert_eq!(asked(&glass_or_plastic, 0.04), Some((1, Why::Material { probability: 0.6, view_share: 0.04 })));
        assert_eq!(asked(&glass_or_plastic, 0.02), None, "too small");
        assert_eq!(asked(&[("pc", 0.7), ("soda-lime glass, float", 0.3)], 0.04), None, "decided");
        assert_eq!(asked(&[("pc", 0.5), ("abs", 0.5)], 0.04), None, "of one family");
    }
}
