//! The views with their pictures, the sheets and the answers.

use minijinja::{Value, context};

use crate::output::counted;
use crate::part_name::part_name;
use crate::pictures::palette;
use crate::query::{Answers, Match, Outcome, SegmentAnswer};
use crate::readable::significant;
use crate::report::{AnswerCounts, Disagreement, Pictures, ViewPictures};

use super::{css, data_uri};

/// Every view.
pub(super) fn views(pictures: &Pictures, answers: &Answers) -> Vec<Value> {
    pictures.views.iter().map(|view| one(view, pictures, answers)).collect()
}

/// A sentence about the sources of the answers.
pub(super) fn sentence(counts: &AnswerCounts) -> String {
    format!(
        "Answers: {}, of which {} were given to exactly these questions and {} come from recordings with overlapping masks. \
         Failed questions: {}.",
        counts.answered(),
        counts.exact,
        counts.by_mask,
        counts.failed,
    )
}

/// The parts about which the answers disagree, each with all its sheets.
pub(super) fn disagreements(all: &[Disagreement], pictures: &Pictures, answers: &Answers) -> Vec<Value> {
    let one = |of: &Disagreement| {
        let named =
            of.materials.iter().map(|named| format!("{} in {}", named.material, counted(named.views.len(), "view")));
        let about = answers.segments.iter().filter(|segment| segment.segment == of.part);
        context! {
            part => of.part,
            materials => named.collect::<Vec<_>>().join(", "),
            rows => about.map(|segment| context! { view => segment.view, ..row(segment, pictures) }).collect::<Vec<_>>(),
        }
    };
    all.iter().map(one).collect()
}

fn one(view: &ViewPictures, pictures: &Pictures, answers: &Answers) -> Value {
    let of_view: Vec<&SegmentAnswer> = answers.segments.iter().filter(|segment| segment.view == view.name).collect();
    let named: Vec<&str> = of_view.iter().map(|segment| material(segment)).collect();
    let name = &view.name;
    let picture =
        |jpeg: &[u8], what: &str| context! { src => data_uri("image/jpeg", jpeg), alt => format!("{what} {name}") };
    context! {
        name,
        pictures => vec![
            picture(&view.photo, "photo of view"),
            picture(&view.splat, "splat drawn in view"),
            picture(&view.segments, "parts in view"),
            picture(&view.materials, "Gaussians drawn in view"),
        ],
        caption => format!("{}: {}", counted(named.len(), "question"), named.join("; ")),
        rows => of_view.iter().map(|segment| row(segment, pictures)).collect::<Vec<_>>(),
    }
}

fn material(segment: &SegmentAnswer) -> &str {
    match &segment.outcome {
        Outcome::Answered(answer) => &answer.material,
        Outcome::Failed(_) => "no answer",
    }
}

fn row(segment: &SegmentAnswer, pictures: &Pictures) -> Value {
    let view = pictures.views.iter().find(|view| view.name == segment.view);
    let part = view.and_then(|view| view.part_of_segment.get(&segment.segment));
    let sheet = pictures.sheets.iter().find(|sheet| sheet.view == segment.view && sheet.segment == segment.segment);
    let common = context! {
        segment => segment.segment,
        color => css(part.map_or(palette::NOTHING, |part| palette::part(*part))),
        sheet => sheet.map(|sheet| data_uri("image/jpeg", &sheet.jpeg)),
        material => material(segment),
    };
    let own = match &segment.outcome {
        Outcome::Answered(answer) => context! {
            name => part_name(&answer.caption, &answer.material),
            caption => &answer.caption,
            confidence => significant(answer.confidence),
            flags => &answer.flags,
            found => match answer.matched {
                Match::Exact | Match::Live => "recorded".to_owned(),
                Match::Mask { iou } => format!("recorded, mask IoU {iou:.3}"),
            },
        },
        Outcome::Failed(failure) => context! { name => failure.to_string(), found => "failed" },
    };
    context! { ..common, ..own }
}
