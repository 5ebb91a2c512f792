//! The parts as they are written, in metres and kilograms.

use std::fmt;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::mass::unknowns::Source;
use super::mass::weights::Weighing;
use crate::query::{AlternativeMaterial, PartQuestion, Why, materials_in_words};
use crate::units::{Estimate, MetricScale, Range, ScaleSource};
use crate::vote::{Corrected, FieldPart};
use crate::words::readable::significant;

/// The object and its parts, in metres and kilograms. Written as `parts.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Parts {
    /// The whole object.
    pub object: Object,
    /// By id.
    pub parts: Vec<Part>,
    /// The fillings of shells, which no photo shows. Their mass is part of the object's.
    #[serde(default)]
    pub fillings: Vec<Filling>,
    /// The known mass of the object; missing if it was not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "KnownMass"))]
    pub known_mass: Option<KnownMass>,
    /// What the object and its parts may be and how likely that is after all evidence; missing unless the model was asked about
    /// the object (`--ask object`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "ObjectBelief"))]
    pub belief: Option<ObjectBelief>,
    /// Metres in a scene unit, if they have an interval: from a marker, a side of the object (`bbox`), an estimate or the known mass;
    /// missing if they are exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "Estimate"))]
    pub meters_per_unit: Option<Estimate>,
    /// The source of the metric scale if a model estimated it: all metres, kilograms and newtons are no better than that;
    /// missing otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "String"))]
    pub estimated_scale: Option<String>,
    /// Messages about results that should be checked.
    pub warnings: Vec<String>,
    /// Other messages.
    #[serde(default)]
    pub notes: Vec<String>,
}

impl Parts {
    /// An object of these parts, without fillings, known mass or messages.
    pub fn new(object: Object, parts: Vec<Part>) -> Self {
        Self {
            object,
            parts,
            fillings: Vec::new(),
            known_mass: None,
            belief: None,
            meters_per_unit: None,
            estimated_scale: None,
            warnings: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// The parts by id. The bodies of a part that are written as parts (`--bodies parts`) are combined.
    pub fn whole_parts(&self) -> impl Iterator<Item = Part> {
        self.bodies_of_parts().map(combined)
    }

    /// The part with this id, of all its bodies.
    pub fn part(&self, id: u32) -> Option<Part> {
        self.bodies_of_parts().find(|bodies| bodies[0].id == id).map(combined)
    }

    /// Whether a weighing, or what else is known of the object, has changed what is believed about them.
    pub fn are_weighed(&self) -> bool {
        self.belief.is_some() || self.known_mass.as_ref().is_some_and(|known| known.is_possible)
    }

    /// Gives each part of the field the density that is believed of it.
    pub fn set_densities(&self, voted: &mut [FieldPart]) {
        for part in self.whole_parts() {
            if let Some(of) = voted.iter_mut().find(|of| of.id == part.id) {
                of.density_kg_m3 = part.density_kg_m3;
            }
        }
    }

    fn bodies_of_parts(&self) -> impl Iterator<Item = &[Part]> {
        self.parts.chunk_by(|one, next| one.id == next.id)
    }

    /// The metric scale that follows from the known mass. Only for an object that was weighed: an interval of another
    /// source is taken for one from the mass.
    pub fn scale(&self) -> Option<MetricScale> {
        let Estimate { low, mid, high } = self.meters_per_unit?;
        let [low_text, high_text] = [low, high].map(significant);
        let provenance = format!("from the known mass of the object: {low_text} to {high_text} m");
        Some(MetricScale {
            meters_per_unit: mid,
            source: ScaleSource::KnownMass,
            provenance,
            range: Some(Range::new(low, high)),
        })
    }
}

/// The whole object with its fillings. It has a volume; without one there is no result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Object {
    pub volume_m3: Estimate,
    pub mass_kg: Estimate,
    /// Where the width of the mass comes from.
    #[serde(default)]
    pub width: Vec<Width>,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
    /// About the centre of mass, world axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
}

/// What is believed of the object. Written as `belief` into `parts.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct ObjectBelief {
    /// What it may be, in the model's order.
    pub hypotheses: Vec<BelievedHypothesis>,
    /// How its parts may be made, by part id.
    pub parts: Vec<BelievedPart>,
    /// The mass that shape and materials give by themselves.
    pub shape_kg: Estimate,
    /// The mass that the model guesses from the photos alone, if it was asked and the guess counts.
    #[serde(default)]
    pub guess_kg: Option<Estimate>,
    /// What is printed on it about its contents, word for word, if it was taken into account.
    pub printed: Option<String>,
    /// What no part shows, with its probability before all evidence and after.
    pub unnumbered: Vec<BelievedThing>,
}

impl ObjectBelief {
    /// For each part of the field, the index of the way that is taken.
    pub fn taken(&self, voted: &[FieldPart]) -> Vec<Option<usize>> {
        let taken_of = |of: &FieldPart| self.parts.iter().find(|part| part.id == of.id).map(|part| part.taken);
        voted.iter().map(taken_of).collect()
    }
}

/// A hypothesis before and after the evidence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct BelievedHypothesis {
    pub what: String,
    /// What the model said.
    pub stated_probability: f64,
    pub stated_mass_kg: Range,
    /// After all evidence.
    pub probability: f64,
    /// The object's mass if this is what it is; `None` if that is all but excluded.
    pub mass_kg: Option<Estimate>,
}

/// The ways in which a part may be made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct BelievedPart {
    /// The part id.
    pub id: u32,
    /// In the model's order.
    pub choices: Vec<BelievedChoice>,
    /// The index of the one that masses, simulation, grasps and exports take.
    pub taken: usize,
    /// The question about the part by itself, if one followed that about the object.
    #[serde(default)]
    pub asked: Option<AskedPart>,
}

/// A question about a part by itself that followed the one about the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct AskedPart {
    /// The view in which it was asked about.
    pub view: String,
    pub why: Why,
    /// Name of the library row that was answered; null without an answer.
    pub material: Option<String>,
    /// Its probability, as the model stated it; null without an answer.
    #[serde(default)]
    pub confidence: Option<f64>,
    /// What else the part may be made of, by the answer.
    #[serde(default)]
    pub alternatives: Vec<AlternativeMaterial>,
}

impl AskedPart {
    pub fn of(question: &PartQuestion) -> Self {
        let answer = question.answer();
        Self {
            view: question.view.clone(),
            why: question.why,
            material: answer.map(|answer| answer.material.clone()),
            confidence: answer.map(|answer| answer.confidence),
            alternatives: answer.map_or_else(Vec::new, |answer| answer.alternatives.clone()),
        }
    }

    /// What was answered, in words; `None` without an answer.
    pub fn answer_in_words(&self) -> Option<String> {
        let material = self.material.as_ref()?;
        Some(materials_in_words(material, self.confidence.unwrap_or(1.0), &self.alternatives))
    }
}

/// One way in which a part may be made, before and after the evidence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct BelievedChoice {
    /// Name of the library row.
    pub material: String,
    pub stated_probability: f64,
    pub probability: f64,
    /// Its probability among the part's choices under each hypothesis.
    pub under: Vec<f64>,
    /// What the part weighs in this way by shape and material alone, kg; null if it fills no volume.
    pub mass_kg: Option<Estimate>,
    /// The same of what fills it, or what is printed on the object about its contents; null if nothing does.
    pub filling_kg: Option<Estimate>,
}

/// Something that no part shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct BelievedThing {
    pub what: String,
    pub stated_probability: f64,
    pub probability: f64,
    /// How much heavier it makes the object.
    pub mass_kg: Range,
    /// The id of the part that shows it after all, as the photos were searched for it; null if none does.
    #[serde(default)]
    pub part: Option<u32>,
}

/// Why a part has no volume, and with it, as a rule, no mass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum NoVolume {
    /// None of the object's surface is its own: other parts cover what its Gaussians draw, or they lie off the object.
    OwnsNoPlace,
    /// It owns places, but all of them lie too far behind what was seen to count as material, or its wall has no thickness.
    NoMaterial,
    /// It lies flat on another part, so that the volume below it is that part's. It has the mass that the answer about the object
    /// gives it.
    TooThin,
}

impl fmt::Display for NoVolume {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OwnsNoPlace => "has no surface of its own",
            Self::NoMaterial => "fills no cell of the grid",
            Self::TooThin => "is too thin to measure",
        })
    }
}

/// One part. What follows from a volume is `None` if it has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Part {
    /// The part id, as in the questions; also its value of `part_label` in `field.ply`. The bodies of a part that are
    /// written as parts have the same.
    pub id: u32,
    pub caption: String,
    /// Name of the library row.
    pub material: String,
    pub family: String,
    /// What the user says of it, and what the answers say instead; missing if nothing was corrected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "Corrected"))]
    pub corrected: Option<Box<Corrected>>,
    /// Number of Gaussians with its label.
    pub gaussians: usize,
    /// `None`, like what follows from it, if the part has no volume; only one that is too thin to measure has a mass all the same.
    pub volume_m3: Option<Estimate>,
    /// Why it has no volume; missing if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "NoVolume"))]
    pub no_volume: Option<NoVolume>,
    /// Thickness below the surface that is grasped: from surface to surface for a solid, the wall for a shell; `None` if no
    /// surface of it was seen.
    pub thickness_m: Option<Estimate>,
    /// Whether its volume is that of a wall as thick as `thickness_m`.
    #[serde(default)]
    pub is_wall: bool,
    pub density_kg_m3: Estimate,
    pub mass_kg: Option<Estimate>,
    /// Where the width of the mass comes from.
    #[serde(default)]
    pub width: Vec<Width>,
    /// World frame, metres.
    pub center_of_mass_m: Option<[f64; 3]>,
    /// About the part's centre of mass, world axes.
    pub inertia_kg_m2: Option<[[f64; 3]; 3]>,
    /// The connected bodies that it is made of.
    pub bodies: Vec<PartBody>,
    /// Distance from the nearest place on its outer surface to the object's centre of mass; `None` if it has no outer surface.
    pub surface_to_center_of_mass_m: Option<f64>,
}

/// The part that consists of these bodies, each written as a part; at least one.
fn combined(bodies: &[Part]) -> Part {
    let first = &bodies[0];
    if bodies.len() == 1 {
        return first.clone();
    }
    let number = format!(" (1 of {})", bodies.len());
    let sum = |value: fn(&Part) -> Option<Estimate>| bodies.iter().filter_map(value).reduce(Estimate::plus);
    let width = first.width.iter().map(|&Width { source, .. }| {
        let of_source = bodies.iter().flat_map(|body| &body.width).filter(|width| width.source == source);
        let ends = of_source.map(|width| width.mass_kg);
        let (low, high) = ends.fold((0.0, 0.0), |(low, high), mass| (low + mass.low, high + mass.high));
        Width { source, mass_kg: Range::new(low, high) }
    });
    let (center_of_mass_m, inertia_kg_m2) = moments(bodies).unzip();
    let distances = bodies.iter().filter_map(|body| body.surface_to_center_of_mass_m);
    Part {
        caption: first.caption.strip_suffix(&number).unwrap_or(&first.caption).to_owned(),
        gaussians: bodies.iter().map(|body| body.gaussians).sum(),
        volume_m3: sum(|body| body.volume_m3),
        mass_kg: sum(|body| body.mass_kg),
        width: width.collect(),
        center_of_mass_m,
        inertia_kg_m2,
        bodies: bodies.iter().flat_map(|body| &body.bodies).copied().collect(),
        surface_to_center_of_mass_m: distances.reduce(f64::min),
        ..first.clone()
    }
}

/// The centre of mass of several bodies, and their inertia about it by the parallel axis theorem; `None` if one of them
/// has no mass.
fn moments(bodies: &[Part]) -> Option<([f64; 3], [[f64; 3]; 3])> {
    let mut mass = 0.0;
    let mut first = Vector3::<f64>::zeros();
    for body in bodies {
        let own = body.mass_kg?.mid;
        mass += own;
        first += Vector3::from(body.center_of_mass_m?) * own;
    }
    let center = first / mass;
    let mut inertia = Matrix3::<f64>::zeros();
    for body in bodies {
        let own = body.inertia_kg_m2?;
        let offset = Vector3::from(body.center_of_mass_m?) - center;
        let of_offset = Matrix3::identity() * offset.norm_squared() - offset * offset.transpose();
        inertia += Matrix3::from_fn(|row, column| own[row][column]) + of_offset * body.mass_kg?.mid;
    }
    let row = |row: usize| [inertia[(row, 0)], inertia[(row, 1)], inertia[(row, 2)]];
    Some((center.into(), [row(0), row(1), row(2)]))
}

/// A connected body of a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct PartBody {
    pub volume_m3: f64,
    pub mass_kg: f64,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
}

/// The filling of a shell, as an entry of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Filling {
    /// The `id` of the shell.
    pub inside_of: u32,
    pub caption: String,
    /// Name of a row of `fillings.csv`.
    pub filling: String,
    /// True: no view shows it; the answers say that it is there.
    pub unseen: bool,
    /// The share of the hollow that it takes up, 0 to 1.
    pub share_of_hollow: Estimate,
    /// With the gaps between its pieces.
    pub volume_m3: Estimate,
    pub density_kg_m3: Estimate,
    pub mass_kg: Estimate,
    /// Where the width of the mass comes from.
    pub width: Vec<Width>,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
    /// About its centre of mass, world axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
}

/// The share of one cause in the width of a mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Width {
    pub source: Source,
    /// The interval of the mass if only this were uncertain.
    pub mass_kg: Range,
}

impl Width {
    pub(super) fn new(source: Source, mass_kg: Estimate) -> Self {
        Self { source, mass_kg: Range::new(mass_kg.low, mass_kg.high) }
    }

    /// How many times as heavy its high end is as its low end.
    pub fn factor(&self) -> f64 {
        self.mass_kg.high / self.mass_kg.low
    }
}

/// One reading of a kitchen scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct KnownMass {
    pub reading_kg: f64,
    /// Half-width of its 90 % interval.
    pub error_kg: f64,
    /// The mass as it was expected without the reading.
    pub expected_kg: Estimate,
    /// The least and the greatest mass that the answers and the surface allow; if the object may be several things, made in the way whose
    /// bounds are nearest to the reading.
    pub possible_kg: Range,
    /// Whether it is possible; if not, the masses are those that were expected.
    pub is_possible: bool,
}

/// Density of carbon steel.
const STEEL_KG_M3: f64 = 7850.0;

impl KnownMass {
    pub(super) fn new(weighing: Weighing, expected_kg: Estimate, possible_kg: [f64; 2]) -> Self {
        let Weighing { kg: reading_kg, error_kg } = weighing;
        let [least, most] = possible_kg;
        let is_possible = weighing.is_possible(possible_kg);
        Self { reading_kg, error_kg, expected_kg, possible_kg: Range::new(least, most), is_possible }
    }

    /// Why the reading is impossible, and the nearest mass that is possible; `None` if the reading is possible. The
    /// object's surface encloses `enclosed_m3`.
    pub(super) fn problem(&self, enclosed_m3: f64) -> Option<String> {
        if self.is_possible {
            return None;
        }
        let (reading, Range { low, high }) = (self.reading_kg, self.possible_kg);
        let (side, nearest) = if reading > high { ("high", high) } else { ("low", low) };
        let density = reading / enclosed_m3;
        let steel = if density > STEEL_KG_M3 { ", denser than solid steel" } else { "" };
        Some(format!(
            "--known-mass {reading} kg is impossible: the answers allow {} to {} kg. The nearest is {} kg, if the surface, \
             every wall, density, filling and unseen depth, and the scale are all at their {side} ends. {reading} kg would mean a \
             density of {} kg/m3 for the whole volume within the surface{steel}. Check the reading, the metric scale and \
             the answers; the masses are as without --known-mass",
            significant(low),
            significant(high),
            significant(nearest),
            significant(density)
        ))
    }
}
