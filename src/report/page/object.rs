//! What the object is taken for: the picture that the question showed, and how likely each answer is after all evidence.

use minijinja::{Value, context};

use super::data_uri;
use crate::parts::{BelievedPart, ObjectBelief, Parts};
use crate::report::Pictures;
use crate::words::part_name::part_name;
use crate::words::readable::{interval, significant};

/// The section; `None` unless the model was asked about the object.
pub fn object(parts: &Parts, pictures: &Pictures) -> Option<Value> {
    let belief = parts.belief.as_ref()?;
    let percent = |probability: f64| format!("{} %", significant((100.0 * probability).round()));
    let hypotheses = belief.hypotheses.iter().map(|of| {
        context! {
            what => &of.what,
            stated => percent(of.stated_probability),
            probability => percent(of.probability),
            stated_mass => interval(of.stated_mass_kg.into(), 1.0),
            mass => of.mass_kg.map(|mass| interval(mass, 1.0)),
        }
    });
    let name = |part: &BelievedPart| {
        let of = parts.part(part.id);
        of.map_or_else(|| part.id.to_string(), |of| part_name(&of.caption, &of.material))
    };
    let choices = belief.parts.iter().filter(|part| part.choices.len() > 1).map(|part| {
        let choice = |choice: &crate::parts::BelievedChoice| {
            context! {
                material => &choice.material,
                stated => percent(choice.stated_probability),
                probability => percent(choice.probability),
            }
        };
        context! { name => name(part), choices => part.choices.iter().map(choice).collect::<Vec<_>>() }
    });
    let asked = belief.parts.iter().filter_map(|part| {
        let asked = part.asked.as_ref()?;
        let (why, answer) = (asked.why.to_string(), asked.answer_in_words());
        Some(context! { name => name(part), view => &asked.view, why, answer })
    });
    Some(context! {
        sheet => pictures.object.as_ref().map(|jpeg| data_uri("image/jpeg", jpeg)),
        hypotheses => hypotheses.collect::<Vec<_>>(),
        choices => choices.collect::<Vec<_>>(),
        asked => asked.collect::<Vec<_>>(),
        unnumbered => unnumbered(belief, &percent),
    })
}

fn unnumbered(belief: &ObjectBelief, percent: &dyn Fn(f64) -> String) -> Vec<Value> {
    let thing = |of: &crate::parts::BelievedThing| {
        context! {
            what => &of.what,
            stated => percent(of.stated_probability),
            probability => percent(of.probability),
            mass => interval(of.mass_kg.into(), 1.0),
            part => of.part,
        }
    };
    belief.unnumbered.iter().map(thing).collect()
}
