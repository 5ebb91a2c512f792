//! The properties of a part, from the answers that agree on it.

use super::FieldPart;
use super::contents::contents;
use super::estimate::middle_and_hull;
use super::identity::Identity;
use super::tally::PartMaterial;
use crate::materials::MaterialLibrary;
use crate::query::{Answer, Form};
use crate::units::{Estimate, Range, ShoreHardness};

/// The part with this `id` for `choice`: from the answers for this material about this 3D part, never from those for
/// another material. The caption is that of the answer with most weight.
pub(super) fn part(
    id: u32,
    choice: PartMaterial,
    material: &str,
    identity: &Identity,
    library: &MaterialLibrary,
) -> FieldPart {
    let of_part = identity.answers_of_part[choice.part as usize].iter().map(|(answer, _)| *answer);
    let answers: Vec<&Answer> = of_part.filter(|answer| answer.material == material).collect();
    agreed(id, &answers, library)
}

/// The part with this `id` that `answers` for one material give together.
pub(super) fn agreed(id: u32, answers: &[&Answer], library: &MaterialLibrary) -> FieldPart {
    let first = answers[0];
    let form = form(answers);
    let is_mixed = |answer: &Answer| answer.form == Form::Mixed;
    let same_density = answers.iter().filter(|answer| is_mixed(answer) == (form == Form::Mixed));
    let material = library.get(&first.material).expect("answers were checked against the library");
    let estimate = |property: fn(&Answer) -> Range| middle_and_hull(answers.iter().map(|answer| property(answer)));
    FieldPart {
        id,
        caption: first.caption.clone(),
        material: first.material.clone(),
        family: first.family.clone(),
        density_kg_m3: middle_and_hull(same_density.map(|answer| answer.density_kg_m3)),
        youngs_modulus_pa: estimate(|answer| answer.youngs_modulus_pa),
        poisson_ratio: estimate(|answer| answer.poisson_ratio),
        yield_strength_pa: estimate(|answer| answer.yield_strength_pa),
        hardness: hardness(answers),
        friction_rubber: estimate(|answer| answer.friction_rubber),
        restitution: material.restitution.map(Estimate::from),
        inside: contents(form, answers, library),
        bulk_reason: answers.iter().filter(|_| form == Form::Mixed).find_map(|answer| answer.bulk_reason.clone()),
        form,
        law: material.law,
        corrected: None,
    }
}

/// The hull of the readings on the scale that most answers use (of two equally frequent scales, the first answer's):
/// readings on two scales are not combined.
fn hardness(answers: &[&Answer]) -> Option<ShoreHardness> {
    let readings: Vec<ShoreHardness> = answers.iter().filter_map(|answer| answer.hardness).collect();
    let on = |scale| readings.iter().filter(move |reading| reading.scale == scale);
    let scale = readings
        .iter()
        .map(|reading| reading.scale)
        .reduce(|best, next| if on(next).count() > on(best).count() { next } else { best })?;
    let range = on(scale).map(|reading| reading.range).reduce(Range::hull)?;
    Some(ShoreHardness { scale, range })
}

/// The form that most answers name; of equally frequent ones, solid before mixed before shell. The wall is the median
/// of the shells' walls.
fn form(answers: &[&Answer]) -> Form {
    let wall = |answer: &&Answer| match answer.form {
        Form::Shell { wall_thickness_m } => Some(wall_thickness_m),
        Form::Solid | Form::Mixed => None,
    };
    let mut walls: Vec<Range> = answers.iter().filter_map(wall).collect();
    let mixed = answers.iter().filter(|answer| answer.form == Form::Mixed).count();
    let solid = answers.len() - mixed - walls.len();
    if solid >= mixed && solid >= walls.len() {
        return Form::Solid;
    }
    if mixed >= walls.len() {
        return Form::Mixed;
    }
    walls.sort_by(|a, b| a.mid().total_cmp(&b.mid()));
    Form::Shell { wall_thickness_m: walls[(walls.len() - 1) / 2] }
}
