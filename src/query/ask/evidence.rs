//! What answers about parts by themselves say of the ways in which the parts of an object may be made, which the answer about
//! the whole object gave.
//!
//! An answer is a distribution over the whole library. It names materials with probabilities p: one with its confidence, and up to
//! two alternatives. Together they have at most 0.95, and leave r = 1 - sum p to all others, half of it to the rest of the families that
//! are named; the first is not less probable than each half (so without alternatives it has at least 1/3). So a choice of a material that
//! is named has the likelihood p, and any other r / 2, which is also the least that a choice that is named has. But choices are named
//! freely and looked up by words: if none is of just the material, those of its family are of it, with p + r / 2, except those of another
//! material that is named. Materials of which there is no such choice become choices of their own, with the likelihood of all of them
//! together; they share out the prior probability that the truth is not among those that a model gives ([`OUTSIDE`]) as their p
//! are. Form and inside, if both answers say them, count as right in [`RIGHT`] of the cases.
//!
//! Choices and hypotheses then have the product of their probabilities and likelihoods: parts are independent of each other, given
//! the hypothesis.

use serde::{Deserialize, Serialize};

use super::follow_up::Why;
use crate::materials::MaterialLibrary;
use crate::query::{
    AlternativeMaterial, Answer, DirectGuess, Form, Found, Inside, Outcome, Recognition, RecognizedPart, SubjectId,
    WholeOutcome,
};
use crate::units::Range;

/// As for the ends of ranges: one of ten things is none of what the model says.
pub const OUTSIDE: f64 = 0.1;
/// As for ranges.
const RIGHT: f64 = 0.9;
/// What all materials that an answer names have together at most: no answer is certain.
const MOST: f64 = 0.95;

/// What was answered about the object: as a whole, and then about some of its parts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectAnswers {
    #[serde(flatten)]
    pub recognition: Recognition,
    #[serde(default)]
    pub questions: Vec<PartQuestion>,
    /// The question how heavy it is, judged from the photos alone, if that was to be asked.
    #[serde(default)]
    pub guess: Option<GuessQuestion>,
}

/// The question how heavy the object is that followed the one what it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuessQuestion {
    /// The first of the views that it showed.
    pub view: String,
    /// `None` if it is not recorded, and nobody could be asked.
    pub outcome: Option<WholeOutcome<DirectGuess>>,
}

/// A question about a part by itself that followed the one about the object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartQuestion {
    /// Its index in the [`Recognition`].
    #[serde(rename = "piece")]
    pub part: usize,
    pub view: String,
    /// What the question showed.
    #[serde(flatten)]
    pub subject: SubjectId,
    pub why: Why,
    /// `None` if it is not recorded, and nobody could be asked.
    pub outcome: Option<Outcome>,
    /// True if what it showed turned out to be no part of its own, but belongs to this part: the answer counts for nothing.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub in_vain: bool,
}

/// A way in which a part may be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Alternative {
    pub answer: Answer,
    /// Its probability among the part's alternatives, by hypothesis, before any answer about the part.
    pub under: Vec<f64>,
    /// How probable the answer about the part is if this is so, relative to the other alternatives.
    pub likelihood: f64,
    /// Its probability as the answer about the object states it: 0 if that does not have it.
    pub stated_probability: f64,
}

impl PartQuestion {
    pub fn answer(&self) -> Option<&Answer> {
        match &self.outcome {
            Some(Outcome::Answered(answer)) => Some(answer),
            Some(Outcome::Failed(_)) | None => None,
        }
    }
}

impl GuessQuestion {
    pub fn answer(&self) -> Option<&DirectGuess> {
        self.outcome.as_ref().and_then(WholeOutcome::answered)
    }
}

impl ObjectAnswers {
    /// Why it cannot be what gprop wrote: a work folder may come from anyone.
    pub fn problem(&self) -> Option<String> {
        let is_known = |question: &PartQuestion| question.part < self.recognition.parts.len();
        let unknown = || "it has a question about a part that it does not have".to_owned();
        let alternatives = self.questions.iter().filter_map(PartQuestion::answer).flat_map(|of| &of.alternatives);
        let are_probabilities = alternatives.map(|of| of.probability).all(|of| (0.0..=1.0).contains(&of));
        let improbable = || "a probability in it is not from 0 to 1".to_owned();
        let guess = self.guess.as_ref().and_then(GuessQuestion::answer);
        let impossible = || "the mass that was guessed is impossible".to_owned();
        let problem = self.recognition.problem();
        let problem = problem.or_else(|| (!self.questions.iter().all(is_known)).then(unknown));
        let problem = problem.or_else(|| (!are_probabilities).then(improbable));
        problem.or_else(|| guess.is_some_and(|guess| !guess.mass_kg.is_positive()).then(impossible))
    }

    /// True if a question that followed has no answer.
    pub fn lacks_answers(&self) -> bool {
        self.questions.iter().any(|question| question.answer().is_none())
            || self.guess.as_ref().is_some_and(|question| question.answer().is_none())
    }

    /// The question about the part of this index by itself, if there was one.
    pub fn question_about(&self, part: usize) -> Option<&PartQuestion> {
        self.questions.iter().find(|question| question.part == part && !question.in_vain)
    }

    /// By part, the ways in which it may be made: those of its choices, in their order, and what an answer adds.
    pub fn alternatives(&self, library: &MaterialLibrary) -> Vec<Vec<Alternative>> {
        let of_part = |(index, part): (usize, &RecognizedPart)| {
            let stated = self.stated(part);
            match self.question_about(index).and_then(PartQuestion::answer) {
                Some(said) => weighed(stated, &named(said, library), self.outside(part)),
                None => stated,
            }
        };
        self.recognition.parts.iter().enumerate().map(of_part).collect()
    }

    /// The same without the parts that were found later of which no answer says that they are made of something else than what lies around
    /// them.
    pub fn without_unproven(mut self) -> Self {
        // From the last on, so that the indices of those before them hold.
        for index in (0..self.recognition.parts.len()).rev() {
            let Some(Found { cut_from, .. }) = self.recognition.parts[index].found.clone() else { continue };
            let around = cut_from.iter().flat_map(|part| &self.recognition.parts[*part].choices);
            let is_other = |said: &&Answer| around.clone().all(|choice| choice.answer.family != said.family);
            let said = self.question_about(index).and_then(PartQuestion::answer).filter(is_other);
            if let Some(caption) = said.map(|said| said.caption.clone()) {
                let part = &mut self.recognition.parts[index];
                part.choices.iter_mut().for_each(|choice| choice.answer.caption.clone_from(&caption));
                part.caption = caption;
                continue;
            }
            self.recognition.parts.remove(index);
            for question in &mut self.questions {
                if question.part == index {
                    (question.part, question.in_vain) = (cut_from[0], true);
                }
                question.part -= usize::from(question.part > index);
            }
        }
        self
    }

    /// How probable it is that a part is made in none of the ways that the answer about the object gives: of a thing that was found
    /// where that answer names one, it only gives those of what lies around it.
    fn outside(&self, part: &RecognizedPart) -> f64 {
        let thing = part.found.as_ref().and_then(|found| self.recognition.unnumbered.get(found.thing));
        thing.map_or(OUTSIDE, |thing| thing.probability.clamp(OUTSIDE, MOST))
    }

    fn stated(&self, part: &RecognizedPart) -> Vec<Alternative> {
        let hypotheses = &self.recognition.hypotheses;
        let under: Vec<Vec<f64>> = (0..hypotheses.len()).map(|hypothesis| part.probabilities(hypothesis)).collect();
        let alternative = |(choice, answer): (usize, &Answer)| {
            let under: Vec<f64> = under.iter().map(|probabilities| probabilities[choice]).collect();
            let stated_probability = hypotheses.iter().zip(&under).map(|(of, under)| of.probability * under).sum();
            Alternative { answer: answer.clone(), under, likelihood: 1.0, stated_probability }
        };
        part.choices.iter().map(|choice| &choice.answer).enumerate().map(alternative).collect()
    }

    /// By part, the probabilities of these alternatives after all answers.
    pub fn probabilities(&self, alternatives: &[Vec<Alternative>]) -> Vec<Vec<f64>> {
        let hypotheses = &self.recognition.hypotheses;
        let evidence = |part: &[Alternative], hypothesis: usize| -> f64 {
            part.iter().map(|of| of.under[hypothesis] * of.likelihood).sum()
        };
        let weight = |hypothesis: usize| {
            let of_parts: f64 = alternatives.iter().map(|part| evidence(part, hypothesis)).product();
            hypotheses[hypothesis].probability * of_parts
        };
        let weights: Vec<f64> = (0..hypotheses.len()).map(weight).collect();
        let all: f64 = weights.iter().sum();
        let of_alternative = |part: &[Alternative], of: &Alternative| -> f64 {
            let under = weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
            under.map(|(h, weight)| weight / all * of.under[h] * of.likelihood / evidence(part, h)).sum()
        };
        alternatives.iter().map(|part| part.iter().map(|of| of_alternative(part, of)).collect()).collect()
    }
}

/// What an answer about a part says that it may be made of, its alternatives last; the confidence of each is the probability that counts.
fn named(said: &Answer, library: &MaterialLibrary) -> Vec<Answer> {
    let answer = |of: &AlternativeMaterial| {
        let Answer { caption, form, inside, bulk_reason, several_materials, matched, .. } = said.clone();
        let (form, inside) = match (of.wall_thickness_m, form) {
            (Some(wall_thickness_m), _) => (Form::Shell { wall_thickness_m }, inside),
            (None, Form::Shell { .. }) => (Form::Solid, None),
            (None, form) => (form, inside),
        };
        let (density_kg_m3, confidence) = (of.density_kg_m3, of.probability);
        let row = Answer::of(library.get(&of.material)?);
        Some(Answer {
            caption,
            form,
            inside,
            bulk_reason,
            several_materials,
            matched,
            density_kg_m3,
            confidence,
            ..row
        })
    };
    let others: Vec<Answer> = said.alternatives.iter().filter_map(answer).collect();
    let of_others = probability_of(&others);
    let first = said.confidence.max((1.0 - of_others) / 3.0);
    let factor = if said.several_materials {
        // It names only some of the materials: the first is as probable as each half of what it leaves.
        1.0 / (3.0 * first + of_others)
    } else {
        (MOST / (first + of_others)).min(1.0)
    };
    let first = Answer { confidence: first, alternatives: Vec::new(), ..said.clone() };
    let counted = |of: Answer| Answer { confidence: factor * of.confidence, ..of };
    std::iter::once(first).chain(others).map(counted).collect()
}

/// The probability that one of these [`named`] materials is right.
fn probability_of<'a>(named: impl IntoIterator<Item = &'a Answer>) -> f64 {
    named.into_iter().map(|of| of.confidence).sum()
}

/// The alternatives after an answer about the part that [`named`] these; `prior_of_outside` is the probability that none of them is right.
fn weighed(mut alternatives: Vec<Alternative>, named: &[Answer], prior_of_outside: f64) -> Vec<Alternative> {
    let half_of_rest = 0.5 * (1.0 - probability_of(named));
    let is_named = |of: &Answer| named.iter().any(|said| said.material == of.material);
    let is_a_choice = |said: &Answer| alternatives.iter().any(|of| of.answer.material == said.material);
    let agree = |of: &Answer, said: &Answer| {
        of.material == said.material || (of.family == said.family && !is_named(of) && !is_a_choice(said))
    };
    let agreeing = |of: &Alternative| named.iter().filter(|said| agree(&of.answer, said)).collect();
    let agreeing: Vec<Vec<&Answer>> = alternatives.iter().map(agreeing).collect();
    let outside = named.iter().filter(|said| !alternatives.iter().any(|of| agree(&of.answer, said)));
    let outside: Vec<&Answer> = outside.collect();
    for (of, said) in alternatives.iter_mut().zip(&agreeing) {
        let of_family = if is_named(&of.answer) { 0.0 } else { half_of_rest };
        let probability = (probability_of(said.iter().copied()) + of_family).max(half_of_rest);
        let most_probable = said.first().copied();
        of.likelihood = probability * likelihood_of_make(&of.answer, most_probable.unwrap_or(&named[0]));
        if let Some(most_probable) = most_probable {
            of.answer = joined(&of.answer, most_probable);
        }
    }
    let all_outside = probability_of(outside.iter().copied());
    let Some(Alternative { under, answer, .. }) = alternatives.first().filter(|_| all_outside > 0.0) else {
        return alternatives;
    };
    let (hypotheses, caption) = (under.len(), answer.caption.clone());
    alternatives.iter_mut().flat_map(|of| &mut of.under).for_each(|probability| *probability *= 1.0 - prior_of_outside);
    alternatives.extend(outside.into_iter().map(|said| Alternative {
        answer: Answer { caption: caption.clone(), ..said.clone() },
        under: vec![prior_of_outside * said.confidence / all_outside; hypotheses],
        likelihood: all_outside * RIGHT * RIGHT,
        stated_probability: 0.0,
    }));
    alternatives
}

/// How well an answer's form and inside fit those of an alternative.
fn likelihood_of_make(of: &Answer, said: &Answer) -> f64 {
    let as_often = |same: bool| if same { RIGHT } else { 1.0 - RIGHT };
    let form = as_often(std::mem::discriminant(&of.form) == std::mem::discriminant(&said.form));
    let inside = match (&of.inside, &said.inside) {
        (Some(Inside::Empty | Inside::Filled { .. }), Some(Inside::Empty | Inside::Filled { .. })) => {
            let are_filled = [of, said].map(|answer| matches!(answer.inside, Some(Inside::Filled { .. })));
            as_often(are_filled[0] == are_filled[1])
        }
        _ => RIGHT,
    };
    form * inside
}

/// What both answers say of one way: what the question about the object does not ask for is from the answer about the part,
/// if that is about the same material; walls and shares of fillings are [what both say together](together).
fn joined(of_object: &Answer, of_part: &Answer) -> Answer {
    let mut joined = of_object.clone();
    if of_object.material == of_part.material {
        let Answer { youngs_modulus_pa, poisson_ratio, yield_strength_pa, hardness, friction_rubber, .. } = *of_part;
        joined = Answer { youngs_modulus_pa, poisson_ratio, yield_strength_pa, hardness, friction_rubber, ..joined };
    }
    if let (Form::Shell { wall_thickness_m: a }, Form::Shell { wall_thickness_m: b }) = (of_object.form, of_part.form) {
        joined.form = Form::Shell { wall_thickness_m: together(a, b) };
    }
    if let (Some(Inside::Filled { filling, share, .. }), Some(Inside::Filled { filling: other, share: b, .. })) =
        (&mut joined.inside, &of_part.inside)
        && filling == other
    {
        *share = together(*share, *b).clipped(Range::new(0.0, 1.0));
    }
    joined
}

/// What two answers say of one number: around the middle of both on a logarithmic scale, as wide as the wider one, since both come
/// from one model, and wide enough for the middles of both if they disagree.
fn together(a: Range, b: Range) -> Range {
    if a.low <= 0.0 || b.low <= 0.0 {
        return a.hull(b);
    }
    let middle = |of: Range| of.geometric_mid().ln();
    let half_width = |of: Range| 0.5 * (of.high / of.low).ln();
    let disagreement = 0.5 * (middle(a) - middle(b)).abs();
    let half_width = half_width(a).max(half_width(b)).max(disagreement);
    let middle = 0.5 * (middle(a) + middle(b));
    Range::new((middle - half_width).exp(), (middle + half_width).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::{Choice, Hypothesis, Match, Unnumbered};

    fn answer(material: &str, confidence: f64) -> Answer {
        let row = MaterialLibrary::builtin().get(material).unwrap();
        Answer { confidence, matched: Match::Exact, ..Answer::of(row) }
    }

    fn wall(low: f64, high: f64, of: Answer) -> Answer {
        Answer { form: Form::Shell { wall_thickness_m: Range::new(low, high) }, ..of }
    }

    /// An object that is real with 0.7 and of one part, made in one of these ways under the hypotheses of these indices; the
    /// answer about it by itself is `said`.
    fn asked(choices: &[(&[usize], f64, Answer)], said: Answer) -> ObjectAnswers {
        let hypothesis =
            |probability| Hypothesis { what: "a thing".to_owned(), probability, mass_kg: Range::new(0.1, 0.2) };
        let choice = |(under, probability, answer): &(&[usize], f64, Answer)| Choice {
            under: under.to_vec(),
            probability: *probability,
            answer: answer.clone(),
        };
        let part = RecognizedPart {
            numbers: vec![1],
            caption: "a globe".to_owned(),
            choices: choices.iter().map(choice).collect(),
            found: None,
        };
        let recognition = Recognition {
            object: "a thing".to_owned(),
            printed: None,
            hypotheses: vec![hypothesis(0.7), hypothesis(0.3)],
            parts: vec![part],
            unnumbered: Vec::new(),
        };
        let question = PartQuestion {
            part: 0,
            view: "000".to_owned(),
            subject: SubjectId::Part(1),
            why: Why::Material { probability: 0.6, view_share: 0.1 },
            outcome: Some(Outcome::Answered(said)),
            in_vain: false,
        };
        ObjectAnswers { recognition, questions: vec![question], guess: None }
    }

    fn probabilities(answers: &ObjectAnswers) -> Vec<f64> {
        let alternatives = answers.alternatives(MaterialLibrary::builtin());
        answers.probabilities(&alternatives).remove(0)
    }

    #[test]
    fn an_answer_about_a_part_decides_between_alternatives() {
        let choices = [(&[0, 1][..], 0.6, answer("pc", 0.6)), (&[0, 1], 0.4, answer("soda-lime glass, float", 0.4))];
        // Its row is none of the two, but of the family of one: 0.6 x 0.2 against 0.4 x 0.8.
        let found = probabilities(&asked(&choices, answer("opal glass", 0.6)));
        assert!((found[1] - 0.32 / 0.44).abs() < 1e-12, "{found:?}");
        // Its row is one of the two: 0.6 x 0.6 against 0.4 x 0.2.
        let found = probabilities(&asked(&choices, answer("pc", 0.6)));
        assert!((found[0] - 0.36 / 0.44).abs() < 1e-12, "{found:?}");
        let sure = probabilities(&asked(&choices, answer("opal glass", 1.0)));
        assert!(sure[0] > 0.0, "no answer excludes anything: {sure:?}");
    }

    #[test]
    fn an_answer_about_a_part_counts_for_what_the_object_is() {
        let steel_if_real = [(&[0][..], 1.0, answer("steel, mild", 1.0)), (&[1][..], 1.0, answer("abs", 1.0))];
        let found = probabilities(&asked(&steel_if_real, answer("abs", 0.8)));
        // 0.7 x 0.1 against 0.3 x 0.8.
        assert!((found[1] - 0.24 / 0.31).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn an_answer_that_the_object_did_not_give_becomes_possible() {
        let choices = [(&[0, 1][..], 1.0, answer("steel, mild", 1.0))];
        let answers = asked(&choices, answer("abs", 0.8));
        let alternatives = answers.alternatives(MaterialLibrary::builtin());
        let added = &alternatives[0][1];
        assert_eq!((&*added.answer.material, &*added.answer.caption), ("abs", &*alternatives[0][0].answer.caption));
        assert_eq!(added.stated_probability, 0.0);
        // 0.9 x 0.1 against 0.1 x 0.8.
        let found = probabilities(&answers);
        assert!((found[1] - 0.08 / 0.17).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn an_answer_about_what_was_found_later_counts_for_more_than_what_lies_around_it() {
        let choices = [(&[0, 1][..], 1.0, answer("steel, mild", 1.0))];
        let mut answers = asked(&choices, answer("abs", 0.8));
        let label = Unnumbered {
            what: "a label".to_owned(),
            probability: 0.9,
            place: Some((0, [0.5, 0.5])),
            mass_kg: Range::new(0.001, 0.002),
        };
        answers.recognition.unnumbered = vec![label];
        answers.recognition.parts[0].found = Some(Found { thing: 0, cut_from: vec![0] });
        let found = probabilities(&answers);
        // 0.1 x 0.1 against 0.9 x 0.8.
        assert!((found[1] - 0.72 / 0.73).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn what_was_found_later_is_a_part_if_it_is_made_of_something_else() {
        let choices = [(&[0, 1][..], 1.0, answer("steel, mild", 1.0))];
        let parts_if = |said: Option<&str>| {
            let mut answers = asked(&choices, answer(said.unwrap_or("abs"), 0.8));
            let around = answers.recognition.parts[0].clone();
            let found = Some(Found { thing: 0, cut_from: vec![0] });
            answers.recognition.parts.push(RecognizedPart { numbers: vec![2], found, ..around });
            answers.questions[0].part = 1;
            if said.is_none() {
                answers.questions[0].outcome = None;
            }
            let settled = answers.without_unproven();
            let numbers: Vec<_> = settled.recognition.parts.iter().map(|part| part.numbers.clone()).collect();
            (numbers, settled.question_about(1).is_some(), settled.question_about(0).is_some())
        };
        assert_eq!(parts_if(Some("abs")), (vec![vec![1], vec![2]], true, false));
        assert_eq!(parts_if(Some("stainless steel 304")), (vec![vec![1]], false, false), "of the same family");
        assert_eq!(parts_if(None), (vec![vec![1]], false, false), "nobody has said so");
    }

    #[test]
    fn form_counts_and_walls_lie_between_both() {
        let choices = [
            (&[0, 1][..], 0.5, answer("stoneware", 0.5)),
            (&[0, 1][..], 0.5, wall(0.002, 0.008, answer("stoneware", 0.5))),
        ];
        let answers = asked(&choices, wall(0.002, 0.002, answer("stoneware", 0.8)));
        let found = probabilities(&answers);
        assert!((found[1] - 0.9).abs() < 1e-12, "{found:?}");
        let Form::Shell { wall_thickness_m: Range { low, high } } =
            answers.alternatives(MaterialLibrary::builtin())[0][1].answer.form
        else {
            panic!("it was a wall")
        };
        let middle = 0.001 * 8.0_f64.sqrt();
        assert!((low - 0.5 * middle).abs() < 1e-12 && (high - 2.0 * middle).abs() < 1e-12, "{low} to {high}");
    }

    #[test]
    fn two_answers_that_disagree_leave_both_possible() {
        let Range { low, high } = together(Range::new(1.0, 1.2), Range::new(4.0, 5.0));
        assert!((1.0..1.2).contains(&low) && (4.0..5.0).contains(&high), "{low} to {high}");
        let Range { low, high } = together(Range::new(0.0, 0.2), Range::new(0.1, 0.5));
        assert_eq!((low, high), (0.0, 0.5), "nothing has no logarithm");
    }

    #[test]
    fn an_answer_that_sees_several_materials_decides_little() {
        let choices = [(&[0, 1][..], 0.6, answer("pc", 0.6)), (&[0, 1], 0.4, answer("abs", 0.4))];
        let found = probabilities(&asked(&choices, Answer { several_materials: true, ..answer("pc", 0.9) }));
        // 0.6 x 1/3 against 0.4 x 1/3.
        assert!((found[0] - 0.6).abs() < 1e-12, "{found:?}");
    }

    /// The same answer with these alternatives.
    fn or(alternatives: &[(&str, f64)], of: Answer) -> Answer {
        let alternative = |(material, probability): &(&str, f64)| {
            let row = MaterialLibrary::builtin().get(material).unwrap();
            let wall = if let Form::Shell { wall_thickness_m } = of.form { Some(wall_thickness_m) } else { None };
            AlternativeMaterial {
                family: row.family.clone(),
                material: row.name.clone(),
                density_kg_m3: Range::new(row.density_kg_m3.low, row.density_kg_m3.low),
                wall_thickness_m: wall,
                probability: *probability,
            }
        };
        Answer { alternatives: alternatives.iter().map(alternative).collect(), ..of }
    }

    fn assert_near(found: &[f64], weights: &[f64]) {
        let all: f64 = weights.iter().sum();
        let is_near = |(found, weight): (&f64, &f64)| (found - weight / all).abs() < 1e-12;
        assert!(found.len() == weights.len() && found.iter().zip(weights).all(is_near), "{found:?}, not {weights:?}");
    }

    const EQUAL: f64 = 1.0 / 3.0;

    /// Choices of these materials, which are equally probable under both hypotheses.
    fn equally_probable(materials: [&str; 3]) -> [(&'static [usize], f64, Answer); 3] {
        materials.map(|material| (&[0, 1][..], EQUAL, answer(material, EQUAL)))
    }

    #[test]
    fn every_material_that_is_named_has_its_probability() {
        let choices = equally_probable(["stoneware", "steel, mild", "abs"]);
        // It leaves 0.2, of which any other choice has half.
        let said = or(&[("steel, mild", 0.3)], answer("stoneware", 0.5));
        assert_near(&probabilities(&asked(&choices, said)), &[0.5, 0.3, 0.1]);
        // What is named is not less probable than what is not: it leaves 0.45.
        let said = or(&[("steel, mild", 0.05)], answer("stoneware", 0.5));
        assert_near(&probabilities(&asked(&choices, said)), &[0.5, 0.225, 0.225]);
        // One leaves no less than 0.05, and the other counts as the same share of 0.95.
        let said = or(&[("steel, mild", 0.25)], answer("stoneware", 0.75));
        assert_near(&probabilities(&asked(&choices, said)), &[0.7125, 0.2375, 0.025]);
        // The first counts as half of what is left beside the other: q = (1 - 0.4 - q) / 2.
        let said = or(&[("steel, mild", 0.4)], answer("stoneware", 0.1));
        assert_near(&probabilities(&asked(&choices, said)), &[0.2, 0.4, 0.2]);
    }

    #[test]
    fn an_alternative_without_a_choice_counts_for_those_of_its_family() {
        let choices = equally_probable(["steel, mild", "aluminium 6061-t6", "abs"]);
        // Both metals that are named, the second of which is none of the choices; it leaves 0.1.
        let said = or(&[("stainless steel 304", 0.4)], answer("aluminium 6061-t6", 0.5));
        assert_near(&probabilities(&asked(&choices, said)), &[0.45, 0.5, 0.05]);
        let said = or(&[("aluminium 6061-t6", 0.4)], answer("stainless steel 304", 0.5));
        assert_near(&probabilities(&asked(&choices, said)), &[0.55, 0.4, 0.05]);
    }

    #[test]
    fn alternatives_that_the_object_did_not_give_share_what_is_outside() {
        let choices = [(&[0, 1][..], 1.0, answer("steel, mild", 1.0))];
        let wall = |thickness: f64, of: Answer| wall(thickness, thickness, of);
        let said = or(&[("abs", 0.3), ("stoneware", 0.1)], wall(0.002, answer("steel, mild", 0.5)));
        let answers = asked(&choices, said);
        let alternatives = answers.alternatives(MaterialLibrary::builtin());
        let added: Vec<&Answer> = alternatives[0][1..].iter().map(|of| &of.answer).collect();
        let abs = MaterialLibrary::builtin().get("abs").unwrap();
        assert_eq!((&*added[0].material, &*added[1].material), ("abs", "stoneware"));
        assert_eq!((&*added[0].caption, added[0].youngs_modulus_pa), ("steel, mild", abs.youngs_modulus_pa));
        assert_eq!(added[0].density_kg_m3, Range::new(abs.density_kg_m3.low, abs.density_kg_m3.low), "as answered");
        assert_eq!(added[0].form, Form::Shell { wall_thickness_m: Range::new(0.002, 0.002) });
        // Steel is solid by one answer and a wall by the other: 0.9 x 0.5 x 0.1 x 0.9. The others have 0.1 together, by 3 to 1, and
        // the likelihood 0.4 x 0.9 x 0.9.
        let found = probabilities(&answers);
        assert_near(&found, &[0.0405, 0.75 * 0.0324, 0.25 * 0.0324]);
    }

    #[test]
    fn an_alternative_is_compared_in_its_own_form() {
        let imitation = wall(0.001, 0.001, answer("abs", EQUAL));
        let choices = [(&[0, 1][..], 0.5, imitation.clone()), (&[0, 1], 0.5, answer("stoneware", EQUAL))];
        let mut said = or(&[("stoneware", 0.3)], Answer { confidence: 0.6, ..imitation });
        assert!(said.alternatives[0].wall_thickness_m.is_some());
        // As walls: the choice of solid stoneware has another form than the alternative.
        assert_near(&probabilities(&asked(&choices, said.clone())), &[0.6 * 0.9, 0.3 * 0.1]);
        said.alternatives[0].wall_thickness_m = None;
        assert_near(&probabilities(&asked(&choices, said)), &[0.6, 0.3]);
    }

    #[test]
    fn an_answer_that_sees_several_materials_decides_little_with_alternatives_too() {
        let choices = equally_probable(["stoneware", "steel, mild", "abs"]);
        let said = or(&[("steel, mild", 0.2)], answer("stoneware", 0.6));
        // 0.6 and 0.2 over 3 x 0.6 + 0.2; what is left has half of the rest, which is as much as the first. So has the second.
        let found = probabilities(&asked(&choices, Answer { several_materials: true, ..said }));
        assert_near(&found, &[0.3, 0.3, 0.3]);
    }

    #[test]
    fn a_question_without_an_answer_changes_nothing() {
        let choices = [(&[0, 1][..], 0.6, answer("pc", 0.6)), (&[0, 1], 0.4, answer("abs", 0.4))];
        let mut answers = asked(&choices, answer("pc", 0.9));
        answers.questions[0].outcome = None;
        assert!(answers.lacks_answers());
        let found = probabilities(&answers);
        assert!((found[0] - 0.6).abs() < 1e-12 && (found[1] - 0.4).abs() < 1e-12, "{found:?}");
    }
}
