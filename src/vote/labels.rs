//! The properties of a label, from the answers that agree with it.

use super::FieldLabel;
use super::answered_segments::{AnsweredSegment, AnsweredSegments};
use super::identity::Identity;
use super::tally::PartMaterial;
use crate::materials::MaterialLibrary;
use crate::numeric::median;
use crate::query::{Answer, Form};
use crate::units::{Estimate, Range, ShoreHardness};

/// The label with number `id` for `choice`: from the answers for this material among the views' segments of this 3D
/// part, never from those for another material. The caption is that of the segment with most light.
pub(super) fn label(
    id: u32,
    choice: PartMaterial,
    segments: &AnsweredSegments,
    identity: &Identity,
    library: &MaterialLibrary,
) -> FieldLabel {
    let mut won: Vec<(&AnsweredSegment, u64)> = members(choice, segments, identity);
    won.sort_by_key(|(_, seen)| std::cmp::Reverse(*seen));
    let answers: Vec<&Answer> = won.iter().map(|(segment, _)| segment.answer).collect();
    let first = answers[0];
    let material = segments.materials[choice.material as usize];
    let estimate = |property: fn(&Answer) -> Range| middle_and_hull(answers.iter().map(|answer| property(answer)));
    FieldLabel {
        id,
        caption: first.caption.clone(),
        material: material.to_owned(),
        family: first.family.clone(),
        density_kg_m3: estimate(|answer| answer.density_kg_m3),
        youngs_modulus_pa: estimate(|answer| answer.youngs_modulus_pa),
        poisson_ratio: estimate(|answer| answer.poisson_ratio),
        yield_strength_pa: estimate(|answer| answer.yield_strength_pa),
        hardness: hardness(&answers),
        friction_rubber: estimate(|answer| answer.friction_rubber),
        form: form(&answers),
        law: library.get(material).expect("answers were checked against the library").law,
    }
}

fn members<'a>(
    choice: PartMaterial,
    segments: &'a AnsweredSegments,
    identity: &Identity,
) -> Vec<(&'a AnsweredSegment<'a>, u64)> {
    let all = segments.segments.iter().zip(&identity.part_of_segment).zip(&identity.seen);
    all.filter(|((segment, part), _)| **part == choice.part && segment.material == choice.material)
        .map(|((segment, _), seen)| (segment, *seen))
        .collect()
}

/// The median of the middles within the hull of the ranges.
fn middle_and_hull(ranges: impl Iterator<Item = Range>) -> Estimate {
    let ranges: Vec<Range> = ranges.collect();
    let hull = ranges.iter().copied().reduce(Range::hull).expect("a label is won by an answer");
    Estimate::new(
        hull.low,
        median(ranges.iter().map(|range| range.mid()).collect()).expect("somebody answered"),
        hull.high,
    )
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

/// Solid or shell, as most answers say (solid if equally many say either); the wall is the median one of the shells'.
fn form(answers: &[&Answer]) -> Form {
    let wall = |answer: &&Answer| match answer.form {
        Form::Shell { wall_thickness_m } => Some(wall_thickness_m),
        Form::Solid => None,
    };
    let mut walls: Vec<Range> = answers.iter().filter_map(wall).collect();
    if 2 * walls.len() <= answers.len() {
        return Form::Solid;
    }
    walls.sort_by(|a, b| a.mid().total_cmp(&b.mid()));
    Form::Shell { wall_thickness_m: walls[(walls.len() - 1) / 2] }
}
