//! The ways in which a part may be made, after the user has corrected it.
//!
//! A correction is certain: ways that it excludes are impossible. Those that agree with it take its numbers and stay as
//! probable as they were among each other; if none does, what the user says is the only one. The model's hypotheses about the
//! object count on: one in [`OUTSIDE`] things is none of what a model says under a hypothesis, so a hypothesis that did not have the
//! corrected way becomes less probable, but is not excluded. What the model says such a thing weighs is about a thing made in one of
//! its ways, so it counts no longer if a part is made in [none of them](agree).

use super::Possible;
use crate::materials::MaterialLibrary;
use crate::query::ask::evidence::OUTSIDE;
use crate::vote::{Correction, FieldPart};

/// The choices after a `correction`, if there were any before; `part` is the part as the user says that it is.
pub fn corrected(
    mut choices: Vec<Possible>,
    correction: &Correction,
    part: &FieldPart,
    library: &MaterialLibrary,
) -> Vec<Possible> {
    let Some(hypotheses) = choices.first().map(|choice| choice.under.len()) else { return choices };
    let mut agrees = Vec::with_capacity(choices.len());
    for choice in &mut choices {
        let as_corrected = correction.applied(&choice.part, library);
        let as_corrected = as_corrected.ok().filter(|_| correction.agrees_with(&choice.part, library));
        agrees.push(as_corrected.is_some());
        match as_corrected {
            Some(as_corrected) => choice.part = FieldPart { corrected: part.corrected.clone(), ..as_corrected },
            None => choice.likelihood = 0.0,
        }
    }
    if !agrees.contains(&true) {
        let under = vec![OUTSIDE; hypotheses];
        choices.push(Possible { part: part.clone(), under, likelihood: 1.0, stated_probability: 0.0 });
    } else if agrees.contains(&false) {
        (0..hypotheses).for_each(|hypothesis| take_over(&mut choices, &agrees, hypothesis));
    }
    choices
}

/// Whether any of the ways that the model holds possible agrees with the correction; also if the model says nothing of the part.
pub fn agree(choices: &[Possible], correction: &Correction, library: &MaterialLibrary) -> bool {
    let agrees = |choice: &Possible| {
        correction.agrees_with(&choice.part, library) && correction.applied(&choice.part, library).is_ok()
    };
    choices.is_empty() || choices.iter().any(agrees)
}

/// Gives the choices that agree the probability that they have under a hypothesis and, of that of the others, what lies
/// outside of all that a model says.
fn take_over(choices: &mut [Possible], agrees: &[bool], hypothesis: usize) {
    let all: f64 = choices.iter().map(|choice| choice.under[hypothesis]).sum();
    let mut agreeing: Vec<&mut f64> = choices
        .iter_mut()
        .zip(agrees)
        .filter(|(_, agrees)| **agrees)
        .map(|(choice, _)| &mut choice.under[hypothesis])
        .collect();
    let kept: f64 = agreeing.iter().map(|under| **under).sum();
    let taken = OUTSIDE * all + (1.0 - OUTSIDE) * kept;
    let count = agreeing.len() as f64;
    for under in &mut agreeing {
        **under = if kept > 0.0 { **under * taken / kept } else { taken / count };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::Form;
    use crate::units::Range;

    /// Steel, sure if the object is a real one, or plastic, sure if it is an imitation.
    fn choices() -> Vec<Possible> {
        let library = MaterialLibrary::builtin();
        let choice = |material: &str, under: [f64; 2]| Possible {
            part: FieldPart::of(1, library.get(material).unwrap()),
            under: under.into(),
            likelihood: 0.7,
            stated_probability: 0.5,
        };
        vec![choice("stainless steel 304", [1.0, 0.0]), choice("abs", [0.0, 1.0])]
    }

    fn after(correction: &Correction) -> Vec<Possible> {
        let library = MaterialLibrary::builtin();
        let part = correction.applied(&choices()[0].part, library).unwrap();
        corrected(choices(), correction, &part, library)
    }

    #[test]
    fn a_choice_that_agrees_is_the_only_one_left_and_speaks_for_its_hypothesis() {
        let found = after(&Correction { material: Some("abs".to_owned()), ..Correction::default() });
        assert_eq!(found.iter().map(|choice| choice.likelihood).collect::<Vec<_>>(), [0.0, 0.7]);
        assert_eq!(found[1].under, [OUTSIDE, 1.0]);
        let answered = found[1].part.corrected.as_ref().map(|corrected| &*corrected.answered.material);
        assert_eq!(answered, Some("stainless steel 304"), "what the vote says, not what the choice says");
    }

    #[test]
    fn what_no_choice_says_becomes_the_only_one() {
        let found = after(&Correction { material: Some("aluminium 6061-t6".to_owned()), ..Correction::default() });
        assert_eq!(found.iter().map(|choice| choice.likelihood).collect::<Vec<_>>(), [0.0, 0.0, 1.0]);
        assert_eq!((&*found[2].part.material, found[2].stated_probability), ("aluminium 6061-t6", 0.0));
        assert_eq!(found[2].under[0], found[2].under[1], "it says nothing of what the object is");
    }

    #[test]
    fn a_correction_agrees_if_any_choice_does() {
        let agree = |material: &str| {
            let correction = Correction { material: Some(material.to_owned()), ..Correction::default() };
            super::agree(&choices(), &correction, MaterialLibrary::builtin())
        };
        assert!(agree("abs") && !agree("aluminium 6061-t6"));
        assert!(super::agree(&[], &Correction::default(), MaterialLibrary::builtin()), "nothing was said of the part");
    }

    #[test]
    fn a_density_leaves_the_choices_as_they_are() {
        let found = after(&Correction { density_kg_m3: Some(Range::exactly(900.0)), ..Correction::default() });
        assert!(found.len() == 2 && found.iter().all(|choice| choice.part.density_kg_m3.mid == 900.0), "{found:?}");
        assert!(found.iter().all(|choice| choice.likelihood == 0.7 && choice.part.form == Form::Solid));
        assert_eq!([&*found[0].under, &*found[1].under], [[1.0, 0.0], [0.0, 1.0]]);
    }
}
