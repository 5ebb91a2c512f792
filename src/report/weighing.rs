//! Sentences about the object's mass: what it consists of besides the parts, where the width of its interval comes
//! from, and what would narrow it.

use super::summary::claim;
use crate::parts::{ObjectBelief, Parts, Source, Width};
use crate::units::Estimate;
use crate::words::part_name::part_name;
use crate::words::readable::{Figures, interval, mass, significant};

/// A cause that widens an interval by less than this factor is not worth a sentence.
const WORTH_SAYING: f64 = 1.05;

/// The sentences, the most important first. `claimed_kg` is the mass that the file of the object states.
pub fn sentences(parts: &Parts, claimed_kg: Option<f64>) -> Vec<String> {
    let filling = |filling: &crate::parts::Filling| {
        let around = parts.part(filling.inside_of);
        let name = around.map_or_else(|| "object".to_owned(), |part| part_name(&part.caption, &part.material));
        let Figures { mid, interval } = mass(filling.mass_kg);
        format!(
            "According to the answers, the {name} is filled with {}, which no photo shows; it adds {mid} ({interval}).",
            filling.filling
        )
    };
    let weighed = parts.known_mass.as_ref().filter(|known| known.is_possible).map(|known| {
        format!(
            "The known mass is {} kg, give or take {}; without it, gprop would expect {} kg.",
            significant(known.reading_kg),
            mass(Estimate::exactly(known.error_kg)).mid,
            interval(known.expected_kg, 1.0)
        )
    });
    let fillings = parts.fillings.iter().map(filling);
    let claimed = claimed_kg.map(|claimed| format!("The file {}.", claim(claimed, parts.object.mass_kg)));
    let estimated = parts.estimated_scale.as_ref();
    let estimated = estimated.map(|source| format!("All lengths and masses follow from a scale that is {source}."));
    let believed = parts.belief.iter().flat_map(beliefs);
    claimed
        .into_iter()
        .chain(estimated)
        .chain(weighed)
        .chain(believed)
        .chain(fillings)
        .chain(causes(parts))
        .chain(remedy(parts))
        .collect()
}

/// A hypothesis, or a thing that no part shows, is not worth a sentence under this probability.
const WORTH_A_DOUBT: f64 = 0.05;

/// What the object is taken for and how heavy it would be, what is printed on it, and what no part shows.
fn beliefs(belief: &ObjectBelief) -> Vec<String> {
    let mut likely: Vec<_> = belief.hypotheses.iter().filter(|of| of.probability >= WORTH_A_DOUBT).collect();
    likely.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let taken = likely.iter().filter_map(|of| {
        let (what, percent) = (&of.what, (100.0 * of.probability).round());
        Some(format!("{what} ({percent} %: {} kg)", interval(of.mass_kg?, 1.0)))
    });
    let taken: Vec<String> = taken.collect();
    let printed =
        belief.printed.iter().map(|text| format!("Printed on it: {text:?}, which gives the weight of its contents."));
    let unshown = belief.unnumbered.iter().filter(|of| of.probability >= WORTH_A_DOUBT).map(|of| {
        let (percent, kg) = ((100.0 * of.probability).round(), interval(of.mass_kg.into(), 1.0));
        match of.part {
            Some(part) => format!("Part {part}, found later: {} ({percent} %), {kg} kg.", of.what),
            None => format!("No part shows: {} ({percent} %), {kg} kg.", of.what),
        }
    });
    let taken = (!taken.is_empty()).then(|| format!("The object is taken for {}.", taken.join(", or ")));
    let shape = format!("Shape and materials alone would give {} kg.", interval(belief.shape_kg, 1.0));
    let guess =
        belief.guess_kg.map(|kg| format!("From the photos alone, the model would guess {} kg.", interval(kg, 1.0)));
    taken.into_iter().chain([shape]).chain(guess).chain(printed).chain(unshown).collect()
}

/// The causes of the width of the object's mass, the widest first.
fn causes(parts: &Parts) -> Option<String> {
    let mut causes: Vec<&Width> = parts.object.width.iter().filter(|width| width.factor() > WORTH_SAYING).collect();
    causes.sort_by(|a, b| b.factor().total_cmp(&a.factor()));
    let said: Vec<String> = causes
        .iter()
        .map(|width| {
            let alone = Estimate::new(width.mass_kg.low, parts.object.mass_kg.mid, width.mass_kg.high);
            format!("{} (alone: {} kg)", cause(width.source), interval(alone, 1.0))
        })
        .collect();
    (!said.is_empty()).then(|| format!("The mass is uncertain because of {}.", said.join("; ")))
}

fn cause(source: Source) -> &'static str {
    match source {
        Source::Method => "the limited accuracy of the surface in the splat",
        Source::Wall => "the thickness of the walls",
        Source::UnseenDepth => "places that no photo shows",
        Source::Density => "the density of the materials",
        Source::Filling => "the contents",
        Source::Scale => "the length of a scene unit",
        Source::Unnumbered => "things that no photo shows",
    }
}

/// The remedy that would narrow the mass's interval most, and the interval that would remain.
fn remedy(parts: &Parts) -> Option<String> {
    let mass = parts.object.mass_kg;
    let widest = parts.object.width.iter().max_by(|a, b| a.factor().total_cmp(&b.factor()))?;
    if widest.factor() <= WORTH_SAYING {
        return None;
    }
    // Causes add up in quadrature, so removing a cause removes its square.
    let left = |end: f64, alone: f64| {
        let (all, own) = ((end / mass.mid).ln(), (alone / mass.mid).ln());
        mass.mid * (all.signum() * (all * all - own * own).max(0.0).sqrt()).exp()
    };
    let narrowed = Estimate::new(left(mass.low, widest.mass_kg.low), mass.mid, left(mass.high, widest.mass_kg.high));
    let what = match widest.source {
        Source::Method => "Sharper or more photos",
        Source::Wall => "Measuring the wall thickness and giving it in the answers",
        Source::UnseenDepth => "Photos of the sides that no photo shows yet, such as one from below,",
        Source::Density => "Weighing the object (--known-mass), or more certain answers about the material,",
        Source::Filling => "Weighing the object (--known-mass), or a look inside,",
        Source::Scale => "Measuring a length (--scale)",
        Source::Unnumbered => "Weighing the object (--known-mass)",
    };
    Some(format!("{what} would narrow the mass ({} kg) to about {} kg.", interval(mass, 1.0), interval(narrowed, 1.0)))
}
