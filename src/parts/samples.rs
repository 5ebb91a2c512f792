//! Samples of what is believed of an object, over which a simulation can be randomised.
//!
//! Every quantity by itself is spread as its belief says: hypotheses and choices in proportion to their probabilities, masses over
//! the quantiles of their intervals (a Latin hypercube; McKay, Beckman and Conover 1979). Together they fit: under each hypothesis,
//! the choices that weigh more go with the larger masses of the whole, and the masses of what the object consists of are moved, each
//! in proportion to its own uncertainty, until they add up to the whole. The same belief gives the same samples.

use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::belief::spread::Spread;
use super::{BelievedChoice, BelievedPart, NoVolume, Part, Parts};
use crate::units::Estimate;
use crate::vote::{Contents, FieldPart};

/// One way in which everything may be. All samples are equally probable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sample {
    /// What the object is; null if the model was not asked about the whole.
    pub hypothesis: Option<String>,
    pub mass_kg: f64,
    /// World frame, metres.
    pub center_of_mass_m: [f64; 3],
    /// About the centre of mass, world axes.
    pub inertia_kg_m2: [[f64; 3]; 3],
    pub parts: Vec<SampledPart>,
    /// What fills shells, and what no part shows.
    pub others: Vec<SampledThing>,
}

/// A part in a sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SampledPart {
    pub id: u32,
    pub material: String,
    pub density_kg_m3: f64,
    pub volume_m3: f64,
    pub mass_kg: f64,
    /// Against rubber.
    pub friction: f64,
    pub youngs_modulus_pa: f64,
}

/// Something in a sample that is no part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SampledThing {
    pub what: String,
    /// The id of the shell that it fills; null for what no part shows.
    pub inside_of: Option<u32>,
    pub mass_kg: f64,
}

/// The least half-width of a mass's logarithm: something has to give way if the masses are to add up.
const LEAST_HALF_WIDTH: f64 = 1e-3;
/// No whole is this many half-widths heavier than the sum of what it consists of.
const MOST_SHIFT: f64 = 1e4;
/// The shift is found to one part in 2^60 of that.
const HALVINGS: usize = 60;
const SEED: u64 = 1;

/// `count` samples. `labels` gives, by part id, the properties of a part for each way in which it may be made; if there is one way,
/// one.
pub fn samples(parts: &Parts, labels: &dyn Fn(u32) -> Vec<FieldPart>, count: usize) -> Vec<Sample> {
    let mut random = fastrand::Rng::with_seed(SEED);
    let by_label = parts.whole_parts().map(|part| (labels(part.id), part));
    let object = Object { parts, by_label: by_label.filter(|(labels, _)| !labels.is_empty()).collect() };
    let mut found = Vec::with_capacity(count);
    let mut reached = 0.0;
    for whole in Whole::all(parts) {
        let before = found.len();
        reached += whole.probability;
        let until = ((reached * count as f64).round() as usize).min(count).max(before);
        found.extend(object.samples(&whole, until - before, &mut random));
    }
    random.shuffle(&mut found);
    found
}

/// What the object may be.
struct Whole {
    /// The index of the hypothesis, and its words.
    hypothesis: Option<(usize, String)>,
    probability: f64,
    mass: Spread,
}

impl Whole {
    /// All that it may be; the probabilities add up to 1.
    fn all(parts: &Parts) -> Vec<Self> {
        let any = Self { hypothesis: None, probability: 1.0, mass: Spread::of(parts.object.mass_kg) };
        let Some(belief) = &parts.belief else { return vec![any] };
        // What was weighed weighs the same, whatever it is.
        let reading = parts.known_mass.as_ref().filter(|known| known.is_possible).map(|_| parts.object.mass_kg);
        let likely = belief.hypotheses.iter().enumerate().filter_map(|(index, of)| {
            let mass = of.mass_kg.map(|mass| Spread::of(reading.unwrap_or(mass)))?;
            Some(Self { hypothesis: Some((index, of.what.clone())), probability: of.probability, mass })
        });
        let mut likely: Vec<Self> = likely.collect();
        let sum: f64 = likely.iter().map(|of| of.probability).sum();
        likely.iter_mut().for_each(|of| of.probability /= sum);
        likely
    }
}

/// Something that adds to the mass.
#[derive(Clone)]
struct Item<'a> {
    what: What<'a>,
    mass_kg: Estimate,
}

#[derive(Clone, Copy)]
enum What<'a> {
    /// A part made in one way, with its density after the evidence.
    Part {
        part: &'a Part,
        label: &'a FieldPart,
        density_kg_m3: Estimate,
    },
    Filling {
        name: &'a str,
        part: &'a Part,
    },
    Unseen(&'a str),
}

/// The object, to draw samples of.
struct Object<'a> {
    parts: &'a Parts,
    /// Each with its properties for every way in which it may be made.
    by_label: Vec<(Vec<FieldPart>, Part)>,
}

impl Object<'_> {
    fn samples(&self, whole: &Whole, count: usize, random: &mut fastrand::Rng) -> Vec<Sample> {
        let mut made = self.drawn(whole, count, random);
        let weight = |items: &[Item]| items.iter().map(|item| item.mass_kg.mid).sum::<f64>();
        made.sort_by(|a, b| weight(a).total_cmp(&weight(b)));
        // By item, for all samples.
        let most = made.iter().map(Vec::len).max().unwrap_or(0);
        let places: Vec<Places> = (0..most).map(|_| Places::shuffled(count, random)).collect();
        let sample = |(n, items): (usize, Vec<Item>)| {
            let mass_kg = whole.mass.quantile(middle_of_step(n, count));
            let drawn = items.iter().zip(&places).map(|(item, of)| Spread::of(item.mass_kg).quantile(of.mass[n]));
            let masses = adding_up(&items, &drawn.collect::<Vec<f64>>(), mass_kg);
            let (center_of_mass_m, inertia_kg_m2) = self.moments(&items, &masses);
            let with_mass = || items.iter().zip(&masses);
            let part =
                |((item, mass), of): ((&Item, &f64), &Places)| item.as_part(*mass, of.friction[n], of.stiffness[n]);
            Sample {
                hypothesis: whole.hypothesis.as_ref().map(|(_, what)| what.clone()),
                mass_kg,
                center_of_mass_m,
                inertia_kg_m2,
                parts: with_mass().zip(&places).filter_map(part).collect(),
                others: with_mass().filter_map(|(item, mass)| item.as_thing(*mass)).collect(),
            }
        };
        made.into_iter().enumerate().map(sample).collect()
    }

    /// For each sample, what the object consists of.
    fn drawn(&self, whole: &Whole, count: usize, random: &mut fastrand::Rng) -> Vec<Vec<Item<'_>>> {
        let mut made: Vec<Vec<Item>> = vec![Vec::new(); count];
        let belief = self.parts.belief.as_ref();
        // What is too thin to measure is among what has no number.
        let measured = self.by_label.iter().filter(|(_, part)| part.no_volume != Some(NoVolume::TooThin));
        for (labels, part) in measured {
            let believed = belief.into_iter().flat_map(|belief| &belief.parts).find(|of| of.id == part.id);
            let places = shuffled(count, random);
            for (items, place) in made.iter_mut().zip(places) {
                let way = believed.zip(whole.hypothesis.as_ref()).and_then(|(believed, (hypothesis, _))| {
                    let chosen = chosen(believed, *hypothesis, place);
                    labels.get(chosen).zip(believed.choices.get(chosen))
                });
                match way {
                    Some((label, choice)) => items.extend(Item::of_choice(part, label, choice)),
                    None => items.extend(self.items_of(part, &labels[0])),
                }
            }
        }
        // What weighs nothing has no density.
        made.iter_mut().for_each(|items| items.retain(|item| item.mass_kg.mid > 0.0));
        for thing in belief.into_iter().flat_map(|belief| &belief.unnumbered) {
            let item = Item { what: What::Unseen(&thing.what), mass_kg: thing.mass_kg.geometric_estimate() };
            let places = shuffled(count, random);
            let with = made.iter_mut().zip(places).filter(|(_, place)| *place < thing.probability);
            with.for_each(|(items, _)| items.push(item.clone()));
        }
        made
    }

    /// A part and its filling as they were weighed.
    fn items_of<'a>(&'a self, part: &'a Part, label: &'a FieldPart) -> impl Iterator<Item = Item<'a>> {
        let what = What::Part { part, label, density_kg_m3: part.density_kg_m3 };
        let own = part.mass_kg.map(|mass_kg| Item { what, mass_kg });
        let filling = self.parts.fillings.iter().filter(move |filling| filling.inside_of == part.id);
        let filling =
            filling.map(move |of| Item { what: What::Filling { name: &of.filling, part }, mass_kg: of.mass_kg });
        own.into_iter().chain(filling)
    }

    /// The centre of mass and the inertia about it; as weighed if nothing has a place. Every part and filling has its own shape; a filling that was not weighed has that of
    /// its shell, and what no part shows is spread like the rest.
    fn moments(&self, items: &[Item], masses: &[f64]) -> ([f64; 3], [[f64; 3]; 3]) {
        let bodies: Vec<(f64, Vector3<f64>, Matrix3<f64>)> = items
            .iter()
            .zip(masses)
            .filter_map(|(item, mass)| self.shape(item).map(|(center, per_kg)| (*mass, center, per_kg)))
            .collect();
        let placed: f64 = bodies.iter().map(|(mass, ..)| mass).sum();
        if placed <= 0.0 {
            let object = &self.parts.object;
            return (object.center_of_mass_m, object.inertia_kg_m2);
        }
        let center = bodies.iter().map(|(mass, center, _)| center * *mass).sum::<Vector3<f64>>() / placed;
        let about_center = |(mass, own, per_kg): &(f64, Vector3<f64>, Matrix3<f64>)| {
            let offset = own - center;
            (per_kg + Matrix3::identity() * offset.norm_squared() - offset * offset.transpose()) * *mass
        };
        let inertia: Matrix3<f64> = bodies.iter().map(about_center).sum();
        let inertia = inertia * (masses.iter().sum::<f64>() / placed);
        let row = |row: usize| [inertia[(row, 0)], inertia[(row, 1)], inertia[(row, 2)]];
        (center.into(), [row(0), row(1), row(2)])
    }

    /// The centre of mass of an item, and its inertia about it for each kilogram.
    fn shape(&self, item: &Item) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let of_part = |part: &Part| Some((part.center_of_mass_m?, part.inertia_kg_m2?, part.mass_kg?));
        let (center, inertia, mass) = match item.what {
            What::Part { part, .. } => of_part(part)?,
            What::Filling { part, .. } => {
                let weighed = self.parts.fillings.iter().find(|filling| filling.inside_of == part.id);
                match weighed {
                    Some(filling) => (filling.center_of_mass_m, filling.inertia_kg_m2, filling.mass_kg),
                    None => of_part(part)?,
                }
            }
            What::Unseen(_) => return None,
        };
        (mass.mid > 0.0).then(|| (center.into(), Matrix3::from_fn(|row, column| inertia[row][column] / mass.mid)))
    }
}

impl<'a> Item<'a> {
    /// A part that is made in this way, and its filling.
    fn of_choice(
        part: &'a Part,
        label: &'a FieldPart,
        choice: &BelievedChoice,
    ) -> impl Iterator<Item = Self> + use<'a> {
        let what = What::Part { part, label, density_kg_m3: label.density_kg_m3 };
        let own = choice.mass_kg.map(|mass_kg| Self { what, mass_kg });
        let filling = match &label.inside {
            Some(Contents::Filled(filled)) => {
                choice.filling_kg.map(|mass_kg| Self { what: What::Filling { name: &filled.filling, part }, mass_kg })
            }
            _ => None,
        };
        own.into_iter().chain(filling)
    }

    /// If it is a part, the part with this mass; `friction` and `stiffness` are the places of these within their intervals, 0 to 1.
    fn as_part(&self, mass_kg: f64, friction: f64, stiffness: f64) -> Option<SampledPart> {
        let What::Part { label, density_kg_m3, .. } = self.what else { return None };
        // As much of what the mass is off is due to the density as of its uncertainty is.
        let share = (half_width(density_kg_m3) / half_width(self.mass_kg)).powi(2).min(1.0);
        let density = density_kg_m3.mid * (mass_kg / self.mass_kg.mid).powf(share);
        Some(SampledPart {
            id: label.id,
            material: label.material.clone(),
            density_kg_m3: density,
            volume_m3: mass_kg / density,
            mass_kg,
            friction: within(label.friction_rubber, friction),
            youngs_modulus_pa: within(label.youngs_modulus_pa, stiffness),
        })
    }

    /// If it is no part, the thing with this mass.
    fn as_thing(&self, mass_kg: f64) -> Option<SampledThing> {
        let (what, inside_of) = match self.what {
            What::Part { .. } => return None,
            What::Filling { name, part } => (name, Some(part.id)),
            What::Unseen(what) => (what, None),
        };
        Some(SampledThing { what: what.to_owned(), inside_of, mass_kg })
    }
}

/// By sample, the places of an item's quantities within what is believed of them, 0 to 1.
struct Places {
    mass: Vec<f64>,
    friction: Vec<f64>,
    stiffness: Vec<f64>,
}

impl Places {
    fn shuffled(count: usize, random: &mut fastrand::Rng) -> Self {
        let mut places = || shuffled(count, random);
        Self { mass: places(), friction: places(), stiffness: places() }
    }
}

/// The index of the choice at this place, 0 to 1, among those that are possible under the hypothesis.
fn chosen(part: &BelievedPart, hypothesis: usize, place: f64) -> usize {
    let mut reached = 0.0;
    let is_it = |choice: &BelievedChoice| {
        reached += choice.under.get(hypothesis).copied().unwrap_or(0.0);
        place < reached
    };
    part.choices.iter().position(is_it).unwrap_or(part.taken)
}

fn middle_of_step(n: usize, count: usize) -> f64 {
    (n as f64 + 0.5) / count as f64
}

/// The middles of `count` equal steps from 0 to 1, in random order.
fn shuffled(count: usize, random: &mut fastrand::Rng) -> Vec<f64> {
    let mut places: Vec<f64> = (0..count).map(|n| middle_of_step(n, count)).collect();
    random.shuffle(&mut places);
    places
}

fn half_width(of: Estimate) -> f64 {
    let half = 0.5 * (of.high / of.low).ln();
    if half.is_finite() { half.max(LEAST_HALF_WIDTH) } else { 1.0 }
}

/// The masses, each moved by the same multiple of its half-width, so that they add up.
fn adding_up(items: &[Item], drawn: &[f64], sum: f64) -> Vec<f64> {
    let moved = |shift: f64| -> Vec<f64> {
        items.iter().zip(drawn).map(|(item, mass)| mass * (shift * half_width(item.mass_kg)).exp()).collect()
    };
    let [mut low, mut high] = [-MOST_SHIFT, MOST_SHIFT];
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if moved(middle).iter().sum::<f64>() < sum {
            low = middle;
        } else {
            high = middle;
        }
    }
    moved(0.5 * (low + high))
}

/// The value at this place, 0 to 1, of an interval; half of it is on either side of the middle.
fn within(Estimate { low, mid, high }: Estimate, place: f64) -> f64 {
    if place < 0.5 { low + (mid - low) * 2.0 * place } else { mid + (high - mid) * (2.0 * place - 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::MaterialLibrary;
    use serde_json::json;

    /// A part that is of steel or, lighter, of plastic, and another that is known; real with 0.7, or an imitation.
    fn object() -> Parts {
        let mass = |low: f64, mid: f64, high: f64| json!({ "low": low, "mid": mid, "high": high });
        let part = |id: u32, material: &str, kg: serde_json::Value, x: f64| {
            json!({
                "id": id, "caption": "a part", "material": material, "family": "metal", "gaussians": 9,
                "volume_m3": mass(0.9e-4, 1e-4, 1.1e-4), "thickness_m": null, "density_kg_m3": mass(7700.0, 7850.0, 8000.0),
                "mass_kg": kg, "center_of_mass_m": [x, 0.0, 0.0],
                "inertia_kg_m2": [[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-4]], "bodies": [],
                "surface_to_center_of_mass_m": null,
            })
        };
        let choice = |material: &str, under: [f64; 2], kg: serde_json::Value| {
            json!({
                "material": material, "stated_probability": 0.5, "probability": 0.5, "under": under, "mass_kg": kg,
                "filling_kg": null,
            })
        };
        let hypothesis = |what: &str, probability: f64, kg: serde_json::Value| {
            json!({
                "what": what, "stated_probability": probability, "stated_mass_kg": [0.1, 1.0], "probability": probability,
                "mass_kg": kg,
            })
        };
        let parts = json!({
            "object": {
                "volume_m3": mass(1.8e-4, 2e-4, 2.2e-4), "mass_kg": mass(0.2, 0.9, 1.1), "center_of_mass_m": [0.0, 0.0, 0.0],
                "inertia_kg_m2": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
            },
            "parts": [
                part(1, "steel, mild", mass(0.7, 0.78, 0.87), 0.1), part(2, "steel, mild", mass(0.09, 0.1, 0.11), -0.1),
            ],
            "belief": {
                "hypotheses": [
                    hypothesis("a real one", 0.7, mass(0.8, 0.93, 1.1)), hypothesis("an imitation", 0.3, mass(0.18, 0.24, 0.3)),
                ],
                "parts": [{
                    "id": 1, "taken": 0,
                    "choices": [
                        choice("steel, mild", [1.0, 0.0], mass(0.7, 0.78, 0.87)),
                        choice("abs", [0.0, 1.0], mass(0.08, 0.1, 0.13)),
                    ],
                }],
                "shape_kg": mass(0.2, 0.9, 1.1), "printed": null,
                "unnumbered": [{
                    "what": "a screw", "stated_probability": 0.5, "probability": 0.5, "mass_kg": [0.01, 0.03],
                }],
            },
            "warnings": [],
        });
        serde_json::from_value(parts).unwrap()
    }

    fn sampled(parts: &Parts, count: usize) -> Vec<Sample> {
        let library = MaterialLibrary::builtin();
        let labels = |id| ["steel, mild", "abs"].map(|name| FieldPart::of(id, library.get(name).unwrap())).to_vec();
        samples(parts, &labels, count)
    }

    fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
        values.sort_by(f64::total_cmp);
        values[(share * values.len() as f64) as usize]
    }

    #[test]
    fn samples_are_spread_as_the_belief_says() {
        let samples = sampled(&object(), 1000);
        assert_eq!(samples.len(), 1000);
        let real: Vec<&Sample> = samples.iter().filter(|of| of.hypothesis.as_deref() == Some("a real one")).collect();
        assert_eq!(real.len(), 700);
        let masses = || real.iter().map(|of| of.mass_kg).collect::<Vec<f64>>();
        for (share, expected) in [(0.05, 0.8), (0.5, 0.93), (0.95, 1.1)] {
            let found = quantile(masses(), share);
            assert!((found / expected).ln().abs() < 0.02, "{share}: {found}");
        }
        let with_screw = samples.iter().filter(|of| !of.others.is_empty()).count();
        assert!((480..=520).contains(&with_screw), "{with_screw}");
        assert_eq!(sampled(&object(), 1000), samples, "the same every time");
    }

    #[test]
    fn a_sample_fits_together() {
        for sample in sampled(&object(), 64) {
            let all = sample.parts.iter().map(|of| of.mass_kg).chain(sample.others.iter().map(|of| of.mass_kg));
            let sum: f64 = all.sum();
            assert!((sum / sample.mass_kg - 1.0).abs() < 1e-9, "{sum} of {}", sample.mass_kg);
            let material = if sample.hypothesis.as_deref() == Some("an imitation") { "abs" } else { "steel, mild" };
            let [first, second] = sample.parts.as_slice() else { panic!("{:?}", sample.parts) };
            assert_eq!(first.material, material);
            for part in [first, second] {
                assert!((part.density_kg_m3 * part.volume_m3 / part.mass_kg - 1.0).abs() < 1e-9);
                assert!(part.friction > 0.0 && part.youngs_modulus_pa > 1e8);
            }
            let [x, ..] = sample.center_of_mass_m;
            let expected = 0.1 * (first.mass_kg - second.mass_kg) / (first.mass_kg + second.mass_kg);
            assert!((x - expected).abs() < 1e-9, "{x}, {expected}");
            assert!(sample.inertia_kg_m2[1][1] > sample.inertia_kg_m2[0][0], "the parts lie along x");
        }
    }

    #[test]
    fn without_a_belief_the_mass_is_that_of_the_object() {
        let mut parts = object();
        parts.belief = None;
        let median = quantile(sampled(&parts, 500).iter().map(|of| of.mass_kg).collect(), 0.5);
        assert!((median / parts.object.mass_kg.mid).ln().abs() < 0.02, "{median}");
    }
}
