//! The views with their pictures, the sheets and the answers.

use minijinja::{Value, context};

use crate::pictures::palette;
use crate::query::{Answers, Match, Outcome, SubjectAnswer, SubjectId};
use crate::report::{AnswerCounts, Disagreement, Pictures, Report, ViewPictures};
use crate::vote::FieldPart;
use crate::words::output::{agreeing, counted};
use crate::words::part_name::part_name;
use crate::words::readable::significant;

use super::{css, data_uri};

/// Every view.
pub(super) fn views(pictures: &Pictures, answers: &Answers) -> Vec<Value> {
    pictures.views.iter().map(|view| one(view, pictures, answers)).collect()
}

/// A sentence about the sources of the answers.
pub(super) fn sentence(counts: &AnswerCounts) -> String {
    let by_mask = match counts.by_mask {
        0 => String::new(),
        some => format!(", of which {some} {} given for slightly different outlines", agreeing(some, "was", "were")),
    };
    let failed = match counts.failed {
        0 => String::new(),
        some => format!("; {} without an answer", counted(some, "question")),
    };
    format!("{}{by_mask}{failed}.", counted(counts.answered(), "answer"))
}

/// The parts about which the answers disagree, each with all its sheets.
pub(super) fn disagreements(report: &Report, pictures: &Pictures, answers: &Answers) -> Vec<Value> {
    let one = |of: &Disagreement| {
        let named =
            of.materials.iter().map(|named| format!("{} in {}", named.material, counted(named.views.len(), "view")));
        let about = answers.all.iter().filter(|answer| answer.subject == SubjectId::Part(of.part));
        context! {
            part => voted(of.part, report).map_or_else(|| format!("{}, as a whole", of.part), title),
            materials => named.collect::<Vec<_>>().join("; "),
            rows => about.map(|answer| context! { view => &answer.view, ..row(answer, pictures) }).collect::<Vec<_>>(),
        }
    };
    report.disagreements.iter().map(one).collect()
}

/// The part with this id; `None` if its pieces were voted on by themselves, or no Gaussian belongs to it.
fn voted(part_id: u16, report: &Report) -> Option<&FieldPart> {
    report.labels.iter().find(|part| part.id == u32::from(part_id))
}

/// A part's id and name, as in the table of parts.
fn title(part: &FieldPart) -> String {
    format!("{} {}", part.id, part_name(&part.caption, &part.material))
}

fn one(view: &ViewPictures, pictures: &Pictures, answers: &Answers) -> Value {
    let of_view: Vec<&SubjectAnswer> = answers.all.iter().filter(|answer| answer.view == view.name).collect();
    let named: Vec<&str> = of_view.iter().map(|answer| material(answer)).collect();
    let questions = counted(named.len(), "question");
    let caption = if named.is_empty() { questions } else { format!("{questions}: {}", named.join("; ")) };
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
        caption,
        rows => of_view.iter().map(|answer| row(answer, pictures)).collect::<Vec<_>>(),
    }
}

fn material(answer: &SubjectAnswer) -> &str {
    match &answer.outcome {
        Outcome::Answered(answer) => &answer.material,
        Outcome::Failed(_) => "no answer",
    }
}

fn row(answer: &SubjectAnswer, pictures: &Pictures) -> Value {
    let part = pictures.part_of(&answer.view, answer.subject.number());
    let sheet =
        pictures.sheets.iter().find(|sheet| sheet.view == answer.view && sheet.subject == answer.subject.number());
    let common = context! {
        part => part.map_or_else(String::new, |part| part.to_string()),
        color => css(part.map_or(palette::NOTHING, palette::part)),
        sheet => sheet.map(|sheet| data_uri("image/jpeg", &sheet.jpeg)),
        material => material(answer),
    };
    let own = match &answer.outcome {
        Outcome::Answered(answer) => context! {
            name => part_name(&answer.caption, &answer.material),
            caption => &answer.caption,
            confidence => significant(answer.confidence),
            flags => &answer.flags,
            found => match answer.matched {
                Match::Exact | Match::Live => "recorded".to_owned(),
                Match::Mask { iou } => format!("recorded for an outline that overlaps this one by {:.0} %", (100.0 * iou).floor()),
            },
        },
        Outcome::Failed(failure) => context! { name => failure.to_string(), found => "failed" },
    };
    context! { ..common, ..own }
}
