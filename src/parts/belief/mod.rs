//! What is believed of an object after all evidence: what it is, how its parts are made, and how heavy it is.
//!
//! The unknowns are the object's identity (a [`Hypothesis`]), the way in which each part is made (a choice), and under each
//! of them the continuous ones of [`unknowns`](super::mass::unknowns). A [state](mod@states) is one combination of identity and
//! choices; its prior probability is what the model says of the object, times the likelihood of what it says of parts by themselves.
//! Under a state, shape and materials give a belief about the mass, and so does the model's own estimate for such a thing; both are
//! [`Spread`]s of its logarithm, independent of each other:
//!
//! p(state, m) is proportional to p(state) * (shape(m | state) * stated(m | hypothesis))^0.7 / overlap(state)
//!
//! (a product of experts; [`spread`] says why there is a power). The overlap is the integral of that if their middles were the same: so a state
//! under which the object would be much too heavy for what it is loses, but none loses because the mass of such a thing is little
//! known. If the model also guessed the mass from the photos alone, the sum over states and that guess are [pooled](Curve::pooled_with).
//! The sum is computed on a grid. `docs/parts.md` has the model in words.

mod corrected;
pub mod spread;
pub mod states;

use super::mass::unknowns::{Belief, OVERCONFIDENCE, PRINTED_ERROR, Quantity, Unknowns, extremes};
use super::mass::weights::{PrintedContents, Weighing, unseen};
use super::result::{AskedPart, BelievedChoice, BelievedHypothesis, BelievedPart, BelievedThing, ObjectBelief, Parts};
use crate::materials::MaterialLibrary;
use crate::query::{
    Alternative, GuessQuestion, Hypothesis, ObjectAnswers, Printed, Recognition, RecognizedPart, Unnumbered,
};
use crate::units::{Estimate, Range};
use crate::vote::{Contents, FieldPart, Filled, MaterialField};
use spread::{Curve, Spread, joint, mean_density};
use states::State;

/// What the object and its parts may be, beside what the field says of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Possibilities {
    /// What the whole may be; at least one.
    pub hypotheses: Vec<Hypothesis>,
    /// False if the user corrected a part to what the model holds possible under none of them: then their masses, and the guess, are those
    /// of another thing.
    pub stated_mass_counts: bool,
    /// What the model says of the mass from the photos alone.
    pub guess_kg: Option<Estimate>,
    /// By label of the field; those of which nothing more is known have no choices.
    pub of_label: Vec<Vec<Possible>>,
    /// By label, the question about the part by itself, if there was one.
    pub asked: Vec<Option<AskedPart>>,
    pub printed: Option<Printed>,
    pub unnumbered: Vec<Unnumbered>,
    /// By thing without a number, the id of the part that shows it after all.
    pub shown_as: Vec<Option<u32>>,
}

/// One way in which a part may be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Possible {
    pub part: FieldPart,
    /// Its probability among the part's choices, by hypothesis.
    pub under: Vec<f64>,
    /// How probable the answer about the part by itself is if this is so, relative to the other choices; 1 if there is none.
    pub likelihood: f64,
    /// Its probability as the answer about the object states it.
    pub stated_probability: f64,
}

impl Believed {
    /// The mass that the parts and their fillings have together.
    pub fn together_kg(&self) -> Estimate {
        // Most of an object is in its parts, whatever is said of what they do not show.
        const LEAST_SHARE: f64 = 0.1;
        let share = (1.0 - self.unshown_kg / self.mass_kg.mid).max(LEAST_SHARE);
        self.mass_kg.scaled(share)
    }

    /// Gives `parts` what is believed: the mass of the object, and the intervals of parts and fillings, whose middles add up to it
    /// with what no part shows. `labels` are those by whose index the masses are.
    pub fn give(self, parts: &mut Parts, labels: &[FieldPart]) {
        // What is believed of the whole is spread over it as its parts are.
        let factor = self.mass_kg.mid / parts.object.mass_kg.mid;
        parts.object.inertia_kg_m2.iter_mut().flatten().for_each(|moment| *moment *= factor);
        parts.object.mass_kg = self.mass_kg;
        let masses_of = |id: u32| labels.iter().position(|label| label.id == id).map(|label| &self.masses[label]);
        let wider = |mass: Estimate, of: Estimate, share: f64| {
            Estimate::new(mass.mid.min(of.low * share), mass.mid, mass.mid.max(of.high * share))
        };
        for bodies in parts.parts.chunk_by_mut(|one, next| one.id == next.id) {
            let Some([Some(of), _]) = masses_of(bodies[0].id) else { continue };
            let all: f64 = bodies.iter().filter_map(|body| body.mass_kg).map(|mass| mass.mid).sum();
            for mass in bodies.iter_mut().filter_map(|body| body.mass_kg.as_mut()) {
                *mass = wider(*mass, *of, mass.mid / all);
            }
        }
        for filling in &mut parts.fillings {
            if let Some([_, Some(of)]) = masses_of(filling.inside_of) {
                filling.mass_kg = wider(filling.mass_kg, *of, 1.0);
            }
        }
        parts.belief = Some(self.object);
    }
}

impl Possibilities {
    /// What was answered about the object, in the parts of the field.
    pub fn new(answered: &ObjectAnswers, field: &MaterialField, library: &MaterialLibrary) -> Self {
        let ObjectAnswers { recognition, .. } = answered;
        let alternatives = answered.alternatives(library);
        let recognized_as = |part: &FieldPart| {
            let is_its = |of: &RecognizedPart| of.numbers.first().is_some_and(|first| u32::from(*first) == part.id);
            recognition.parts.iter().position(is_its)
        };
        let possible = |id: u32, of: &Alternative| Possible {
            part: FieldPart::answered(id, &of.answer, library),
            under: of.under.clone(),
            likelihood: of.likelihood,
            stated_probability: of.stated_probability,
        };
        let mut stated_mass_counts = true;
        // What the user says of the contents beats what is printed.
        let are_contents_corrected = field
            .parts
            .iter()
            .filter_map(|part| part.corrected.as_ref())
            .any(|of| of.to.filling.is_some() || of.to.share.is_some());
        let found = |recognized: usize| recognition.parts[recognized].found.as_ref();
        let mut of_label = |part: &FieldPart| {
            let recognized = recognized_as(part);
            let of = recognized.map_or(&[][..], |recognized| &alternatives[recognized]);
            if recognized.and_then(found).is_some() {
                // It weighs what the answer says of it, whatever it is made of.
                return vec![as_voted(part, of, recognition.hypotheses.len())];
            }
            let choices: Vec<Possible> = of.iter().map(|of| possible(part.id, of)).collect();
            let Some(of) = &part.corrected else { return choices };
            stated_mass_counts &= corrected::agree(&choices, &of.to, library);
            corrected::corrected(choices, &of.to, part, library)
        };
        let of_label = field.parts.iter().map(&mut of_label).collect();
        let guess = answered.guess.as_ref().and_then(GuessQuestion::answer).filter(|_| stated_mass_counts);
        let asked = |part: &FieldPart| answered.question_about(recognized_as(part)?).map(AskedPart::of);
        Self {
            hypotheses: recognition.hypotheses.clone(),
            stated_mass_counts,
            guess_kg: guess.map(|guess| guess.mass_kg),
            of_label,
            asked: field.parts.iter().map(asked).collect(),
            printed: recognition.printed.clone().filter(|_| !are_contents_corrected),
            unnumbered: recognition.unnumbered.clone(),
            shown_as: (0..recognition.unnumbered.len()).map(|thing| shown_as(recognition, thing)).collect(),
        }
    }

    /// How many ways there are for the part with most of them.
    pub fn most_choices(&self) -> usize {
        self.of_label.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// The ways in which the part with this id may be made.
    pub fn ways_of(&self, id: u32) -> impl Iterator<Item = &FieldPart> {
        self.of_label.iter().flatten().map(|possible| &possible.part).filter(move |part| part.id == id)
    }

    /// The parts of a field if each is made in the way that is `taken` for it.
    pub fn parts_taken(&self, field: &MaterialField, taken: &[Option<usize>]) -> Vec<FieldPart> {
        let part_as_taken = |(label, taken): (usize, &Option<usize>)| {
            taken.map_or(&field.parts[label], |taken| self.part(&field.parts, label, taken)).clone()
        };
        taken.iter().enumerate().map(part_as_taken).collect()
    }

    /// A part of a field, whose `parts` these are, if it is made in the way of this index; as the field has it if it has no such way.
    pub fn part<'a>(&'a self, parts: &'a [FieldPart], label: usize, choice: usize) -> &'a FieldPart {
        self.of_label[label].get(choice).map_or(&parts[label], |possible| &possible.part)
    }

    /// In how many ways a part may be made; in one if nothing more is known of it than the field says.
    pub fn choices(&self, label: usize) -> usize {
        self.of_label[label].len().max(1)
    }
}

/// The only way in which a part of the field may be made: as the field has it.
fn as_voted(part: &FieldPart, of: &[Alternative], hypotheses: usize) -> Possible {
    let stated = of.iter().find(|of| of.answer.material == part.material).map_or(0.0, |of| of.stated_probability);
    Possible { part: part.clone(), under: vec![1.0; hypotheses], likelihood: 1.0, stated_probability: stated }
}

/// The id of the part that shows this thing without a number after all.
fn shown_as(recognition: &Recognition, thing: usize) -> Option<u32> {
    let mut parts = recognition.parts.iter();
    let part = parts.find(|part| part.found.as_ref().is_some_and(|found| found.thing == thing))?;
    part.numbers.first().map(|number| u32::from(*number))
}

/// What follows from a belief for the weighing of parts.
pub struct Believed {
    pub object: ObjectBelief,
    /// What the things that no part shows weigh, on the average, kg.
    pub unshown_kg: f64,
    /// What the fillings weigh by what is printed on the object, if parts are made in the ways that are taken.
    pub contents: Option<PrintedContents>,
    /// By label, the way that is taken, if there are several.
    pub taken: Vec<Option<usize>>,
    /// The things that no part shows and that are taken to be there: number and mass.
    pub unseen: Vec<(usize, Range)>,
    /// The mass of the object, by all but a reading of a kitchen scale.
    pub mass_kg: Estimate,
    /// What the reading means, if there is one.
    pub reading: Option<Read>,
    /// By label, of its material, and of what fills it.
    pub masses: Vec<[Option<Estimate>; 2]>,
}

/// A reading of a kitchen scale, compared with all states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Read {
    /// The bounds of the mass under the state in which they are nearest to the reading, kg.
    pub possible_kg: [f64; 2],
    /// Whether any state allows it. If none does, nothing that is believed depends on it.
    pub is_possible: bool,
}

/// Under this share of all probability, a hypothesis is not worth a mass of its own.
const EXCLUDED: f64 = 1e-4;
/// States whose parts are weighed one by one; the rest differ little from them, or are improbable.
const WEIGHED_STATES: usize = 8;

/// The masses of a part's material and of its filling; `None` if it has none.
pub type PartMasses = [Option<Quantity>; 2];

/// The evidence that bears on the masses.
pub struct Evidence<'a> {
    pub possible: &'a Possibilities,
    /// The parts of the field, by label.
    pub labels: &'a [FieldPart],
    /// By label, the masses by shape and materials alone if parts are made in these ways, all over the same unknowns.
    pub masses_by_shape: &'a dyn Fn(&[usize]) -> Vec<PartMasses>,
    /// What a kitchen scale shows.
    pub weighing: Option<Weighing>,
}

/// A state with what it says of the mass.
struct Weighed {
    state: State,
    /// By label, the masses of its material and of its filling.
    masses: Vec<PartMasses>,
    extra: Vec<Quantity>,
    shape: Estimate,
}

impl Weighed {
    fn all(&self) -> Vec<Quantity> {
        self.masses.iter().flatten().flatten().chain(&self.extra).cloned().collect()
    }
}

/// Weighs all evidence; `states` are those of [`states()`].
pub fn believe(evidence: &Evidence, states: Vec<State>, unknowns: &mut Unknowns) -> Believed {
    let Evidence { possible, .. } = evidence;
    let stated: Vec<Spread> = possible.hypotheses.iter().map(|of| Spread::of_range(of.mass_kg)).collect();
    let states: Vec<Weighed> = states.into_iter().map(|state| weighed(evidence, state, unknowns)).collect();
    let read = evidence.weighing.map(|weighing| read(weighing, &states, unknowns));
    let weighing = evidence.weighing.filter(|_| read.is_some_and(|read| read.is_possible));
    let shapes: Vec<Spread> = states.iter().map(|of| Spread::of(of.shape)).collect();
    let guess = possible.guess_kg.map(Spread::of);
    let empty = Curve::over(shapes.iter().chain(&stated).chain(&guess));
    let (mut unpooled, mut by_shape) = (empty.clone(), empty.clone());
    let mut products = Vec::with_capacity(states.len());
    for (of, shape) in states.iter().zip(&shapes) {
        let stated = possible.stated_mass_counts.then_some(&stated[of.state.hypothesis]);
        let product = empty.product(shape, stated);
        let overlap = empty.product(shape, stated.map(|stated| stated.moved_to(shape)).as_ref());
        let prior = of.state.probability / overlap.integral();
        unpooled.add(&product, prior);
        by_shape.add(&empty.product(shape, None), of.state.probability);
        products.push((product, prior));
    }
    let factor = guess.map(|guess| unpooled.pooled_with(&guess));
    let mut whole = empty.clone();
    let mut by_hypothesis = vec![(empty, 0.0); stated.len()];
    let mut given_state = Vec::with_capacity(states.len());
    for ((of, shape), (mut product, prior)) in states.iter().zip(&shapes).zip(products) {
        factor.iter().for_each(|factor| product.multiply(factor));
        let stated = possible.stated_mass_counts.then_some(&stated[of.state.hypothesis]);
        // A reading may lie beyond the grid.
        let density = |ln_kg: f64| {
            let unpooled = joint(shape.density(ln_kg), stated.map(|stated| stated.density(ln_kg)));
            unpooled * factor.as_ref().map_or(1.0, |factor| factor.at(ln_kg))
        };
        let at_reading = weighing.map(|of| mean_density(density, of.kg.ln(), of.relative_error()));
        let weight = prior * at_reading.unwrap_or_else(|| product.integral());
        whole.add(&product, prior);
        let (curve, sum) = &mut by_hypothesis[of.state.hypothesis];
        curve.add(&product, prior);
        *sum += weight;
        given_state.push((product.percentiles(), weight));
    }
    let all: f64 = given_state.iter().map(|(_, weight)| weight).sum();
    let posterior: Vec<f64> = given_state.iter().map(|(_, weight)| weight / all).collect();
    let given_state: Vec<Estimate> = given_state.into_iter().map(|(mass, _)| mass).collect();
    let of_hypothesis: Vec<f64> = by_hypothesis.iter().map(|(_, sum)| sum / all).collect();
    let mut taken = taken(possible, &states, &posterior, &of_hypothesis);
    let are_there = taken.split_off(possible.of_label.len());
    let contents = contents(evidence, &taken, &(evidence.masses_by_shape)(&taken));
    let taken: Vec<Option<usize>> =
        taken.into_iter().zip(&possible.of_label).map(|(taken, of)| (!of.is_empty()).then_some(taken)).collect();
    let unseen = possible.unnumbered.iter().map(|thing| thing.mass_kg).enumerate();
    let unseen = unseen.zip(are_there).filter(|(_, there)| *there == 1).map(|(thing, _)| thing).collect();
    let unnumbered = things(possible, &states, &posterior);
    let unshown = unnumbered.iter().map(|of| of.probability * of.mass_kg.geometric_estimate().mid);
    Believed {
        unshown_kg: unshown.sum(),
        contents,
        object: ObjectBelief {
            hypotheses: hypotheses(possible, &by_hypothesis, &of_hypothesis),
            parts: parts(evidence, unknowns, &states, &posterior, &taken),
            shape_kg: by_shape.percentiles(),
            guess_kg: possible.guess_kg,
            printed: printed_text(possible, &states),
            unnumbered,
        },
        masses: masses(&states, &posterior, &given_state, unknowns),
        mass_kg: whole.percentiles(),
        taken,
        unseen,
        reading: read,
    }
}

/// Compares a reading with the bounds that each state sets.
fn read(weighing: Weighing, states: &[Weighed], unknowns: &Unknowns) -> Read {
    let bounds = states.iter().map(|of| extremes(unknowns, &of.all()));
    let nearest = bounds.min_by(|a, b| weighing.off(*a).total_cmp(&weighing.off(*b)));
    let possible_kg = nearest.expect("there is a state");
    Read { possible_kg, is_possible: weighing.is_possible(possible_kg) }
}

/// The hypotheses with their probabilities and curves after the evidence.
fn hypotheses(possible: &Possibilities, curves: &[(Curve, f64)], probabilities: &[f64]) -> Vec<BelievedHypothesis> {
    let believed = |(stated, ((curve, _), probability)): (&Hypothesis, (&(Curve, f64), &f64))| BelievedHypothesis {
        what: stated.what.clone(),
        stated_probability: stated.probability,
        stated_mass_kg: stated.mass_kg,
        probability: *probability,
        mass_kg: (*probability > EXCLUDED).then(|| curve.percentiles()),
    };
    possible.hypotheses.iter().zip(curves.iter().zip(probabilities)).map(believed).collect()
}

/// The combinations of hypotheses, of choices for the labels that have any, and of whether each thing without a number is
/// there.
pub fn states(possible: &Possibilities) -> Vec<State> {
    let hypotheses: Vec<f64> = possible.hypotheses.iter().map(|of| of.probability).collect();
    let of_label = |choices: &Vec<Possible>| -> Vec<Vec<f64>> {
        let under =
            |hypothesis: usize| choices.iter().map(|choice| choice.under[hypothesis] * choice.likelihood).collect();
        if choices.is_empty() { vec![vec![1.0]; hypotheses.len()] } else { (0..hypotheses.len()).map(under).collect() }
    };
    let thing = |of: &Unnumbered| vec![vec![1.0 - of.probability, of.probability]; hypotheses.len()];
    let items: Vec<_> = possible.of_label.iter().map(of_label).chain(possible.unnumbered.iter().map(thing)).collect();
    states::most_probable(&hypotheses, &items)
}

/// The masses under a state.
fn weighed(evidence: &Evidence, state: State, unknowns: &mut Unknowns) -> Weighed {
    let Evidence { possible, .. } = evidence;
    let mut masses = (evidence.masses_by_shape)(&state.choices);
    if let Some(contents) = contents(evidence, &state.choices, &masses) {
        let all = filling_kg(&masses);
        let fillings = masses.iter_mut().filter_map(|[_, filling]| filling.as_mut());
        fillings.for_each(|filling| *filling = contents.share(filling.mid / all, unknowns));
    }
    let is_there = possible.unnumbered.iter().zip(&state.choices[possible.of_label.len()..]);
    let is_there = is_there.enumerate().filter(|(_, (_, there))| **there == 1);
    let extra = is_there.map(|(n, (thing, _))| unseen(n, thing.mass_kg, unknowns)).collect();
    let mut weighed = Weighed { shape: Estimate::exactly(0.0), state, masses, extra };
    weighed.shape = Belief::prior(unknowns).of_sum(&weighed.all());
    weighed
}

fn filling_kg(masses: &[PartMasses]) -> f64 {
    masses.iter().filter_map(|[_, filling]| filling.as_ref()).map(|filling| filling.mid).sum()
}

/// What the fillings weigh by what is printed on the object, if it says so and parts are made in these ways. The print is about a full
/// package: one of which a filling takes up a smaller share than it may has as much less.
fn contents(evidence: &Evidence, choices: &[usize], by_shape: &[PartMasses]) -> Option<PrintedContents> {
    let Evidence { possible, labels, .. } = evidence;
    let printed = possible.printed.as_ref()?;
    let filled_in = |choice: usize, label: usize| -> Option<&Filled> {
        match &possible.part(labels, label, choice).inside {
            Some(Contents::Filled(filled)) => Some(filled),
            _ => None,
        }
    };
    let (mut full_kg, mut full_m3, mut largest) = (0.0, 0.0, None);
    for (label, [_, filling]) in by_shape.iter().enumerate() {
        let Some(Quantity { mid: kg, .. }) = filling else { continue };
        let filled = filled_in(choices[label], label);
        let fullest = (0..possible.choices(label)).filter_map(|choice| filled_in(choice, label)).map(|of| of.share.mid);
        let fullest = fullest.fold(0.0, f64::max);
        let kg_if_full = kg * filled.map_or(1.0, |filled| fullest / filled.share.mid);
        full_kg += kg_if_full;
        full_m3 += filled.map_or(f64::NAN, |filled| kg_if_full / filled.density_kg_m3.mid);
        if largest.is_none_or(|(most, _)| *kg > most) {
            largest = Some((*kg, filled));
        }
    }
    let (_, largest) = largest?;
    let all = filling_kg(by_shape);
    let half_width = |of: Option<Estimate>, factor: f64| of.map_or(0.0, |of| factor * 0.5 * (of.high / of.low).ln());
    let is_full = all > 0.999 * full_kg;
    let of_share = half_width(largest.map(|filled| filled.share).filter(|_| !is_full), OVERCONFIDENCE);
    let of_density = half_width(largest.map(|filled| filled.density_kg_m3).filter(|_| printed.mass_kg.is_none()), 1.0);
    let kg = printed.mass_kg.map(|kg| kg * all / full_kg);
    let kg = kg.or_else(|| Some(printed.volume_m3? * all / full_m3)).filter(|kg| kg.is_finite())?;
    Some(PrintedContents { kg, half_width: PRINTED_ERROR.hypot(of_share).hypot(of_density) })
}

/// For each item of the states, the choice that is the most probable under the most probable hypothesis.
fn taken(possible: &Possibilities, states: &[Weighed], posterior: &[f64], of_hypothesis: &[f64]) -> Vec<usize> {
    let best = (0..of_hypothesis.len()).rev().max_by(|a, b| of_hypothesis[*a].total_cmp(&of_hypothesis[*b]));
    let of_item = |(item, choices): (usize, usize)| {
        let mut sums = vec![0.0; choices];
        for (of, probability) in states.iter().zip(posterior).filter(|(of, _)| Some(of.state.hypothesis) == best) {
            sums[of.state.choices[item]] += probability;
        }
        (0..choices).rev().max_by(|a, b| sums[*a].total_cmp(&sums[*b])).unwrap_or(0)
    };
    let of_labels = (0..possible.of_label.len()).map(|label| possible.choices(label));
    // A thing is there or not.
    of_labels.chain(possible.unnumbered.iter().map(|_| 2)).enumerate().map(of_item).collect()
}

/// The probability that an item of the states is made in this way.
fn probability_of(states: &[Weighed], posterior: &[f64], item: usize, choice: usize) -> f64 {
    let with = states.iter().zip(posterior).filter(|(of, _)| of.state.choices[item] == choice);
    with.map(|(_, probability)| probability).sum()
}

/// The probability that an item of the states is made in this way, under each hypothesis; none of those that are excluded.
fn probabilities_under(
    possible: &Possibilities,
    states: &[Weighed],
    posterior: &[f64],
    label: usize,
    choice: usize,
) -> Vec<f64> {
    let mut sums = vec![[0.0; 2]; possible.hypotheses.len()];
    for (of, probability) in states.iter().zip(posterior) {
        let [with, all] = &mut sums[of.state.hypothesis];
        *all += probability;
        *with += if of.state.choices[label] == choice { *probability } else { 0.0 };
    }
    sums.into_iter().map(|[with, all]| if all > 0.0 { with / all } else { 0.0 }).collect()
}

fn parts(
    evidence: &Evidence,
    unknowns: &Unknowns,
    states: &[Weighed],
    posterior: &[f64],
    taken: &[Option<usize>],
) -> Vec<BelievedPart> {
    let possible = evidence.possible;
    let prior = Belief::prior(unknowns);
    let as_taken: Vec<usize> = taken.iter().map(|taken| taken.unwrap_or(0)).collect();
    // Of a part that is made in another way than the one that is taken.
    let masses = |label: usize, choice: usize| {
        let mut choices = as_taken.clone();
        choices[label] = choice;
        let masses = (evidence.masses_by_shape)(&choices);
        let [own, filling] = masses[label].clone().map(|mass| mass.map(|mass| prior.of(&mass)));
        let printed = contents(evidence, &choices, &masses).map(|contents| {
            let kg = contents.kg / filling_kg(&masses);
            let factor = contents.half_width.exp();
            move |mid: f64| Estimate::new(mid * kg / factor, mid * kg, mid * kg * factor)
        });
        [own, filling.map(|filling| printed.map_or(filling, |printed| printed(filling.mid)))]
    };
    let of_label = |(label, choices): (usize, &Vec<Possible>)| {
        let choice = |(index, choice): (usize, &Possible)| {
            let [mass_kg, filling_kg] = masses(label, index);
            BelievedChoice {
                material: choice.part.material.clone(),
                stated_probability: choice.stated_probability,
                probability: probability_of(states, posterior, label, index),
                under: probabilities_under(possible, states, posterior, label, index),
                mass_kg,
                filling_kg,
            }
        };
        let first = choices.first()?;
        Some(BelievedPart {
            id: first.part.id,
            choices: choices.iter().enumerate().map(choice).collect(),
            taken: taken[label]?,
            asked: possible.asked[label].clone(),
        })
    };
    possible.of_label.iter().enumerate().filter_map(of_label).collect()
}

fn things(possible: &Possibilities, states: &[Weighed], posterior: &[f64]) -> Vec<BelievedThing> {
    let labels = possible.of_label.len();
    let thing = |(n, thing): (usize, &Unnumbered)| BelievedThing {
        what: thing.what.clone(),
        stated_probability: thing.probability,
        probability: probability_of(states, posterior, labels + n, 1),
        mass_kg: thing.mass_kg,
        part: possible.shown_as.get(n).copied().flatten(),
    };
    possible.unnumbered.iter().enumerate().map(thing).collect()
}

/// What is printed, if any state has a filling of which it tells the mass.
fn printed_text(possible: &Possibilities, states: &[Weighed]) -> Option<String> {
    let printed = possible.printed.as_ref().filter(|printed| printed.mass_kg.or(printed.volume_m3).is_some())?;
    let has_filling = |of: &Weighed| of.masses.iter().any(|[_, filling]| filling.is_some());
    states.iter().any(has_filling).then(|| printed.text.clone())
}

/// What something weighs under each of several states, `None` if it is not there, and the probability of the state.
type Mixture = Vec<(Option<Spread>, f64)>;

/// By label, the masses of its material and its filling over the most probable states: in each of them, the mass of the whole is
/// shared out as a kitchen scale's reading would be.
fn masses(
    states: &[Weighed],
    posterior: &[f64],
    given_state: &[Estimate],
    unknowns: &Unknowns,
) -> Vec<[Option<Estimate>; 2]> {
    let labels = states.first().map_or(0, |of| of.masses.len());
    let mut order: Vec<usize> = (0..states.len()).collect();
    order.sort_by(|a, b| posterior[*b].total_cmp(&posterior[*a]));
    order.truncate(WEIGHED_STATES);
    let mut found: Vec<[Mixture; 2]> = vec![[Vec::new(), Vec::new()]; labels];
    for &s in &order {
        let belief = Belief::in_which(unknowns, &states[s].all(), given_state[s]);
        for (found, masses) in found.iter_mut().zip(&states[s].masses) {
            for (found, mass) in found.iter_mut().zip(masses) {
                found.push((mass.as_ref().map(|mass| Spread::of(belief.of(mass))), posterior[s]));
            }
        }
    }
    let mixed = |spreads: Mixture, may_be_nothing: bool| {
        let (mut of_nothing, mut all) = (0.0, 0.0);
        let there = || spreads.iter().filter_map(|(spread, weight)| Some((spread.as_ref()?, weight)));
        there().next()?;
        let mut curve = Curve::over(there().map(|(spread, _)| spread));
        let empty = curve.clone();
        there().for_each(|(spread, weight)| curve.add(&empty.product(spread, None), *weight));
        for (spread, weight) in &spreads {
            all += weight;
            of_nothing += if spread.is_none() && may_be_nothing { *weight } else { 0.0 };
        }
        Some(curve.percentiles_unless(of_nothing / all))
    };
    // A part is there under every state, its filling is not.
    found.into_iter().map(|[own, filling]| [mixed(own, false), mixed(filling, true)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::mass::unknowns::{Effect, Owner, Source};

    fn symmetric(half_width: f64) -> Effect {
        Effect { low: -half_width, high: half_width }
    }

    /// By label and choice, the masses of a part, whatever the others are.
    type ByChoice = Vec<Vec<PartMasses>>;

    /// Two parts, each with two ways of being made, and two hypotheses, the second of which excludes a way.
    fn two_parts() -> (Possibilities, ByChoice, Vec<FieldPart>, Unknowns) {
        let library = MaterialLibrary::builtin();
        let part = |id: u32, material: &str| FieldPart::of(id, library.get(material).unwrap());
        let possible = |id, material: &str, under: [f64; 2]| Possible {
            part: part(id, material),
            under: under.into(),
            likelihood: 1.0,
            stated_probability: 0.5,
        };
        let hypothesis = |what: &str, probability, low, high| Hypothesis {
            what: what.to_owned(),
            probability,
            mass_kg: Range::new(low, high),
        };
        let possible = Possibilities {
            stated_mass_counts: true,
            guess_kg: None,
            hypotheses: vec![hypothesis("a real one", 0.7, 0.5, 1.2), hypothesis("an imitation", 0.3, 0.05, 0.2)],
            of_label: vec![
                vec![possible(1, "stainless steel 304", [0.8, 0.1]), possible(1, "abs", [0.2, 0.9])],
                vec![possible(2, "ash, white", [1.0, 0.5]), possible(2, "abs", [0.0, 0.5])],
            ],
            asked: vec![None; 2],
            printed: None,
            unnumbered: Vec::new(),
            shown_as: Vec::new(),
        };
        let mut unknowns = Unknowns::default();
        let method = unknowns.number(Source::Method, &Owner::Object);
        let mut mass = |of, mid, half_width| {
            let density = unknowns.number(Source::Density, &Owner::Part(of));
            [Some(Quantity { mid, effects: vec![(method, symmetric(0.1)), (density, symmetric(half_width))] }), None]
        };
        let built = vec![vec![mass(0, 0.6, 0.02), mass(0, 0.08, 0.05)], vec![mass(1, 0.1, 0.2), mass(1, 0.15, 0.05)]];
        let labels = possible.of_label.iter().map(|of| of[0].part.clone()).collect();
        (possible, built, labels, unknowns)
    }

    fn weighed(
        possible: &Possibilities,
        built: &[Vec<PartMasses>],
        labels: &[FieldPart],
        unknowns: &mut Unknowns,
        weighing: Option<Weighing>,
    ) -> Believed {
        let masses = |choices: &[usize]| built.iter().zip(choices).map(|(of, choice)| of[*choice].clone()).collect();
        let evidence = Evidence { possible, labels, masses_by_shape: &masses, weighing };
        believe(&evidence, states(possible), unknowns)
    }

    /// A kitchen scale shows this, within a hundredth of it.
    fn reads(kg: f64) -> Option<Weighing> {
        Some(Weighing { kg, error_kg: 0.01 * kg })
    }

    #[test]
    fn a_belief_is_what_summing_over_everything_gives() {
        let (possible, built, labels, mut unknowns) = two_parts();
        for guess_kg in [None, Some(Estimate::new(0.1, 0.14, 0.3))] {
            let possible = Possibilities { guess_kg, ..possible.clone() };
            let believed = weighed(&possible, &built, &labels, &mut unknowns, None);
            // Every combination, on a grid of its own.
            let places: Vec<f64> = (0..20_000).map(|n| -6.0 + 8.0 * f64::from(n) / 20_000.0).collect();
            let mut of_state: Vec<([usize; 2], Vec<f64>)> = Vec::new();
            for (h, hypothesis) in possible.hypotheses.iter().enumerate() {
                for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let prior =
                        hypothesis.probability * possible.of_label[0][a].under[h] * possible.of_label[1][b].under[h];
                    let masses = [&built[0][a], &built[1][b]].map(|masses| masses[0].clone().unwrap());
                    let shape = Spread::of(Belief::prior(&unknowns).of_sum(&masses));
                    let stated = Spread::of_range(hypothesis.mass_kg);
                    let moved = stated.moved_to(&shape);
                    let both = |ln_kg: f64, stated: &Spread| (shape.density(ln_kg) * stated.density(ln_kg)).powf(0.7);
                    let overlap: f64 = places.iter().map(|ln_kg| both(*ln_kg, &moved)).sum();
                    let density = places.iter().map(|ln_kg| prior * both(*ln_kg, &stated) / overlap);
                    of_state.push(([h, a], density.collect()));
                }
            }
            let sum_at = |place: usize| of_state.iter().map(|(_, density)| density[place]).sum::<f64>();
            let without_guess: Vec<f64> = (0..places.len()).map(sum_at).collect();
            let factor = |place: usize| {
                guess_kg.map_or(1.0, |of| (Spread::of(of).density(places[place]) / without_guess[place]).sqrt())
            };
            let (mut all, mut real, mut steel) = (0.0, 0.0, 0.0);
            let mut of_mass = vec![0.0; places.len()];
            for ([h, a], density) in &of_state {
                for (place, density) in density.iter().enumerate() {
                    let density = density * factor(place);
                    all += density;
                    real += if *h == 0 { density } else { 0.0 };
                    steel += if *a == 0 { density } else { 0.0 };
                    of_mass[place] += density;
                }
            }
            let percentile = |share: f64| {
                let mut below = 0.0;
                let reached = of_mass.iter().position(|density| {
                    below += density;
                    below >= share * all
                });
                places[reached.unwrap()].exp()
            };
            let ObjectBelief { hypotheses, parts, .. } = &believed.object;
            assert!((hypotheses[0].probability - real / all).abs() < 0.01, "{hypotheses:?}, {}", real / all);
            assert!((parts[0].choices[0].probability - steel / all).abs() < 0.01, "{parts:?}, {}", steel / all);
            let Estimate { low, mid, high } = believed.mass_kg;
            for (found, share) in [(low, 0.05), (mid, 0.5), (high, 0.95)] {
                assert!((found / percentile(share)).ln().abs() < 0.02, "{found}, {}", percentile(share));
            }
            let steel = if guess_kg.is_none() { Some(0) } else { Some(1) };
            assert_eq!(
                believed.taken[0], steel,
                "with steel it is heavy enough for a real one, and too heavy for the guess"
            );
            assert_eq!(believed.object.guess_kg, guess_kg);
        }
    }

    #[test]
    fn a_guess_that_says_what_is_believed_changes_nothing() {
        let (mut possible, built, labels, mut unknowns) = two_parts();
        possible.hypotheses.truncate(1);
        let mut weighed = |guess_kg: Option<Estimate>| {
            let possible = Possibilities { guess_kg, ..possible.clone() };
            weighed(&possible, &built, &labels, &mut unknowns, None).mass_kg
        };
        let without = weighed(None);
        let with = weighed(Some(without));
        for (with, without) in [(with.low, without.low), (with.mid, without.mid), (with.high, without.high)] {
            assert!((with / without).ln().abs() < 0.02, "{with}, {without}");
        }
    }

    #[test]
    fn a_hypothesis_does_not_lose_because_little_is_known_of_its_mass() {
        let (mut possible, built, labels, mut unknowns) = two_parts();
        possible.of_label.iter_mut().flatten().for_each(|choice| choice.under = vec![0.5; 2]);
        let middle = 0.5;
        let around = |factor: f64| Range::new(middle / factor, middle * factor);
        possible.hypotheses[0].mass_kg = around(1.2);
        possible.hypotheses[1].mass_kg = around(6.0);
        let believed = weighed(&possible, &built, &labels, &mut unknowns, None);
        let [narrow, wide] =
            [0, 1].map(|h| believed.object.hypotheses[h].probability / possible.hypotheses[h].probability);
        assert!(wide > narrow, "the shape is nearer to what a wide range expects: {narrow}, {wide}");
    }

    /// The user said of a part what the model did not hold possible.
    #[test]
    fn without_the_stated_masses_shape_and_materials_are_all() {
        let (mut possible, built, labels, mut unknowns) = two_parts();
        possible.stated_mass_counts = false;
        let mut weighed = |weighing| weighed(&possible, &built, &labels, &mut unknowns, weighing);
        let believed = weighed(None);
        let ends = |mass: Estimate| [mass.low, mass.mid, mass.high];
        for (found, shape) in ends(believed.mass_kg).into_iter().zip(ends(believed.object.shape_kg)) {
            assert!((found / shape).ln().abs() < 1e-4, "the grid cuts off a little of each density: {found}, {shape}");
        }
        for (hypothesis, stated) in believed.object.hypotheses.iter().zip(&possible.hypotheses) {
            assert!((hypothesis.probability - stated.probability).abs() < 1e-4, "{hypothesis:?}");
        }
        assert!(weighed(reads(0.2)).object.hypotheses[1].probability > 0.5, "a reading still decides");
    }

    #[test]
    fn a_reading_decides_between_hypotheses_unless_it_is_far_off() {
        let (possible, built, labels, mut unknowns) = two_parts();
        let mut weighed = |weighing| weighed(&possible, &built, &labels, &mut unknowns, weighing);
        let (before, believed) = (weighed(None), weighed(reads(0.2)));
        assert!(believed.object.hypotheses[1].probability > 0.9, "{:?}", believed.object);
        assert_eq!(believed.taken[0], Some(1), "steel would be too heavy");
        assert_eq!(believed.mass_kg, before.mass_kg, "as it was expected");
        // A scale that may be off by a factor of a thousand says nothing.
        let rough = weighed(Some(Weighing { kg: 0.2, error_kg: 0.2 * 1000f64.ln() }));
        for (found, expected) in rough.object.hypotheses.iter().zip(&before.object.hypotheses) {
            assert!((found.probability - expected.probability).abs() < 0.02, "{found:?}, {expected:?}");
        }
    }

    /// With many unknowns at their ends, a mass may be farther from its middle than the grid reaches.
    #[test]
    fn a_reading_beyond_the_grid_is_weighed() {
        let (mut possible, mut built, labels, mut unknowns) = two_parts();
        let many = (10..60).map(|of| (unknowns.number(Source::Density, &Owner::Part(of)), symmetric(0.05))).collect();
        built[0][0][0].as_mut().unwrap().effects = many;
        possible.hypotheses.truncate(1);
        possible.hypotheses[0].mass_kg = Range::new(0.65, 0.75);
        for guess_kg in [None, Some(Estimate::new(0.6, 0.7, 0.8))] {
            possible.guess_kg = guess_kg;
            let believed = weighed(&possible, &built, &labels, &mut unknowns, reads(6.0));
            assert!(believed.reading.unwrap().is_possible);
            let [hypothesis] = &believed.object.hypotheses[..] else { panic!("{:?}", believed.object) };
            assert!((hypothesis.probability - 1.0).abs() < 1e-9, "{hypothesis:?}");
            assert_eq!(believed.taken[0], Some(0), "plastic is never as heavy");
        }
    }

    #[test]
    fn a_reading_that_no_state_allows_changes_nothing() {
        let (mut possible, built, labels, mut unknowns) = two_parts();
        let mut weighed = |possible: &Possibilities, kg: f64| {
            let [before, after] = [None, reads(kg)].map(|of| weighed(possible, &built, &labels, &mut unknowns, of));
            let is_ignored = after.object == before.object && after.taken == before.taken;
            (after.reading.unwrap(), is_ignored)
        };
        // Steel and abs weigh 0.6 and 0.15 kg, and each unknown is good for a few percent.
        let (Read { possible_kg: [_, most], is_possible }, is_ignored) = weighed(&possible, 1.5);
        assert!(!is_possible && is_ignored && (0.75..1.0).contains(&most), "{most}");
        // Between what steel and what plastic allow; nearer to plastic.
        let (Read { possible_kg: [_, most], is_possible }, is_ignored) = weighed(&possible, 0.4);
        assert!(!is_possible && is_ignored && most < 0.4, "{most}");
        let thing =
            Unnumbered { what: "a weight".into(), probability: 0.1, place: None, mass_kg: Range::new(0.7, 0.8) };
        possible.unnumbered.push(thing);
        let (Read { is_possible, .. }, is_ignored) = weighed(&possible, 1.5);
        assert!(is_possible && !is_ignored, "the weight is there");
    }

    #[test]
    fn what_is_printed_gives_the_weight_of_the_contents() {
        let (mut possible, mut built, labels, mut unknowns) = two_parts();
        possible.hypotheses = vec![Hypothesis { what: "full".into(), probability: 1.0, mass_kg: Range::new(0.2, 2.0) }];
        let share = unknowns.number(Source::Filling, &Owner::Part(1));
        for [_, filling] in &mut built[0] {
            *filling = Some(Quantity { mid: 0.9, effects: vec![(share, symmetric(0.4))] });
        }
        let printed = Printed { text: "NET WT 500 g".to_owned(), mass_kg: Some(0.5), volume_m3: None };
        let mut weigh = |printed: Option<Printed>| {
            let possible = Possibilities { printed, ..possible.clone() };
            weighed(&possible, &built, &labels, &mut unknowns, None)
        };
        let (guessed, read) = (weigh(None), weigh(Some(printed)));
        assert_eq!(read.contents, Some(PrintedContents { kg: 0.5, half_width: PRINTED_ERROR }));
        let filling = |of: &Believed| of.masses[0][1].unwrap();
        assert!((filling(&read).mid / 0.5).ln().abs() < 0.02 && filling(&guessed).mid > 0.7, "{:?}", filling(&read));
        let width = |mass: Estimate| mass.high / mass.low;
        assert!(width(filling(&read)) < 1.12 && width(filling(&guessed)) > 1.5, "{:?}", filling(&read));
    }
}
