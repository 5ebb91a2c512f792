//! The subjects that the model is asked about and that its answers settle: parts of the object, or segments of each
//! view.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::Point3;

use crate::consensus::{AskAbout, FoundThing};
use crate::error::Result;
use crate::gaussians::bounds::least_extent;
use crate::query::ask::rounds::{self, Outcomes, PartOrPiece, Subject, SubjectInView};
use crate::query::{Answers, Outcome, Region, SubjectAnswer, SubjectId};
use crate::segment::{LabelMap, Segmentation, ViewSegments};
use crate::vote::AnsweredPart;

use super::consensus::{FoundPart, FoundParts, ShownIn, Unasked, renamed};
use super::recognized::Recognized;
use super::{OpenScene, scene};

/// What the questions are about, with the label maps that show it.
pub enum FoundSubjects {
    Parts(Arc<FoundParts>),
    Segments(Arc<Segmentation>),
}

impl FoundSubjects {
    /// What the options say; the parts must have been found.
    pub fn of(open: &OpenScene) -> Result<Self> {
        Ok(match open.options.consensus.ask {
            AskAbout::Object | AskAbout::Parts => Self::Parts(open.get()?),
            AskAbout::Segments => Self::Segments(open.get()?),
        })
    }

    /// As [`Self::of`], but as they are before anyone is asked.
    pub fn unasked(open: &OpenScene) -> Result<Self> {
        Ok(match open.options.consensus.ask {
            AskAbout::Object | AskAbout::Parts => Self::Parts(Arc::new(open.get::<Unasked>()?.0.clone())),
            AskAbout::Segments => Self::Segments(open.get()?),
        })
    }

    /// The parts that were found where the answer what the object is names something without a number.
    pub fn found(&self) -> Vec<FoundThing> {
        match self {
            Self::Parts(found) => found.found.clone(),
            Self::Segments(_) => Vec::new(),
        }
    }

    /// The subjects that the model is asked about, and the number of views in which each is asked about first.
    pub fn subjects(&self, open: &OpenScene) -> (Vec<Subject>, usize) {
        match self {
            Self::Parts(found) => (found.subjects(&view_indices(open)), open.options.consensus.ask_views.get()),
            Self::Segments(segmentation) => {
                let of_views = segmentation.views.iter().enumerate();
                // A segment may be covered completely by the segments that lie in it.
                let is_left = |of: &ViewSegments, id: u16| of.map.labels.contains(&id);
                let segments = of_views.flat_map(|(view, of)| {
                    of.segments.iter().filter(move |found| is_left(of, found.id)).map(move |found| (view, found.id))
                });
                (segments.map(|(view, id)| Subject::segment(view, id)).collect(), 1)
            }
        }
    }

    /// Every part and piece of one, with how much of the object it is.
    ///
    /// # Errors
    /// If the scale cannot be read.
    pub fn regions(&self, open: &OpenScene) -> Result<Vec<Region>> {
        let Self::Parts(found) = self else { return Ok(Vec::new()) };
        let gaussians = &open.scene.gaussians;
        let scale = scene::scale(open)?.map(|scale| scale.meters_per_unit);
        let whole = || found.parts.iter().filter(|of| of.part.piece_of.is_none());
        let all: f64 = whole().map(|of| of.part.light).sum();
        let mut of_views: BTreeMap<&str, f64> = BTreeMap::new();
        for shown in whole().flat_map(|of| &of.views) {
            *of_views.entry(&shown.view).or_default() += f64::from(shown.pixels);
        }
        let view_share =
            |shown: &ShownIn| f64::from(shown.pixels) / of_views.get(&*shown.view).copied().unwrap_or(f64::INFINITY);
        // By id; the Gaussians of a piece also count for its part.
        let mut centers: BTreeMap<u16, Vec<Point3<f64>>> = BTreeMap::new();
        for i in (0..gaussians.len()).filter(|i| !gaussians.is_set_aside(*i)) {
            let id = found.of_gaussian[i];
            for id in BTreeSet::from([id, found.part_of(id)]) {
                centers.entry(id).or_default().push(gaussians.center(i));
            }
        }
        let depth = |id: u16| least_extent(centers.get(&id).into_iter().flatten().copied());
        let region = |FoundPart { part, views, .. }: &FoundPart| Region {
            id: part.id,
            view_share: views.iter().map(view_share).fold(0.0, f64::max).min(1.0),
            area_share: if all > 0.0 { part.light / all } else { 0.0 },
            depth_m: scale.map(|scale| scale * depth(part.id)),
        };
        Ok(found.parts.iter().map(region).collect())
    }

    /// The same for the text of a question.
    pub fn about(&self) -> AskAbout {
        match self {
            Self::Parts(_) => AskAbout::Parts,
            Self::Segments(_) => AskAbout::Segments,
        }
    }

    /// The label maps whose ids the questions are about, for the view with this number.
    pub fn maps(&self, view: usize) -> Vec<Cow<'_, LabelMap>> {
        match self {
            Self::Parts(found) => vec![Cow::Owned(found.whole_parts(view)), Cow::Borrowed(&found.maps[view])],
            Self::Segments(segmentation) => vec![Cow::Borrowed(&segmentation.views[view].map)],
        }
    }

    /// For every chosen view, the label map whose ids the answers settle: of segments; or of parts, and of the pieces of
    /// those that consist of several materials.
    ///
    /// # Errors
    /// If the answer about the object cannot be read.
    pub fn settled_maps(&self, open: &OpenScene, answers: &Answers) -> Result<Vec<Cow<'_, LabelMap>>> {
        let found = match self {
            Self::Parts(found) => found,
            Self::Segments(segmentation) => {
                return Ok(segmentation.views.iter().map(|view| Cow::Borrowed(&view.map)).collect());
            }
        };
        if let Some(recognized) = &open.get::<Recognized>()?.0 {
            let first = recognized.recognition.first_of_part();
            let before = &open.get::<Unasked>()?.0.maps;
            // What was found but is no part of its own is what it was before.
            let is_part = |id: u16| id == 0 || first.contains_key(&id);
            let of_part = |(now, before): (&u16, &u16)| {
                let id = if is_part(*now) { *now } else { *before };
                first.get(&id).copied().unwrap_or(id)
            };
            let settled = |(map, before): (&LabelMap, &LabelMap)| LabelMap {
                labels: map.labels.iter().zip(&before.labels).map(of_part).collect(),
                ..*map
            };
            return Ok(found.maps.iter().zip(before).map(settled).map(Cow::Owned).collect());
        }
        let index = view_indices(open);
        let in_view = |answer: &SubjectAnswer| {
            Some(SubjectInView { view: *index.get(answer.view.as_str())?, id: answer.subject.number() })
        };
        let outcomes: Outcomes =
            answers.all.iter().filter_map(|answer| Some((in_view(answer)?, &answer.outcome))).collect();
        let settled = rounds::settled(&found.subjects(&index), &outcomes);
        let settled = |id: u16| settled.get(&id).copied().unwrap_or(id);
        Ok(found.maps.iter().map(|map| Cow::Owned(renamed(map, settled))).collect())
    }
}

/// The index of each chosen view, by its name.
fn view_indices(open: &OpenScene) -> BTreeMap<&str, usize> {
    open.views.iter().map(|view| view.name.as_str()).zip(0..).collect()
}

impl FoundParts {
    /// The parts and pieces that have answers, weighed by how many of their pixels each view shows. The answer about a recognised part
    /// stands under its first region, which its view may not show.
    pub fn answered<'a>(&self, answers: &'a Answers) -> Vec<AnsweredPart<'a>> {
        let pixels = |id: u16, view: &str| {
            let found = self.parts.iter().find(|found| found.part.id == id)?;
            Some(found.views.iter().find(|shown| shown.view == view)?.pixels)
        };
        let weighed = |answer: &'a SubjectAnswer| match (answer.subject, &answer.outcome) {
            (SubjectId::Part(id), Outcome::Answered(said)) => {
                Some((id, said, f64::from(pixels(id, &answer.view).unwrap_or(1))))
            }
            _ => None,
        };
        AnsweredPart::collect(answers.all.iter().filter_map(weighed))
    }

    fn subjects(&self, index: &BTreeMap<&str, usize>) -> Vec<Subject> {
        rounds::subjects(self.parts.iter().map(|FoundPart { part, views, .. }| PartOrPiece {
            id: part.id,
            piece_of: part.piece_of,
            views: views.iter().filter_map(|shown| index.get(shown.view.as_str()).copied()).collect(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::materials::MaterialLibrary;
    use crate::query::Answer;

    #[test]
    fn an_answer_counts_where_its_view_does_not_show_the_first_region_of_its_part() {
        let found = |id: u16, views: serde_json::Value| {
            let part = json!({
                "id": id, "piece_of": null, "gaussians": 20, "light": 9.0, "separation": 1.0, "backed_by": 1, "opposed_by": 0,
                "views": views,
            });
            serde_json::from_value::<FoundPart>(part).unwrap()
        };
        let shown = json!([{ "view": "000", "pixels": 50 }]);
        let parts = vec![found(1, json!([])), found(2, shown)];
        let parts = FoundParts { parts, maps: Vec::new(), of_gaussian: Vec::new(), found: Vec::new() };
        let answer = Answer::of(MaterialLibrary::builtin().get("abs").unwrap());
        let about = |id: u16| SubjectAnswer {
            view: "000".to_owned(),
            subject: SubjectId::Part(id),
            outcome: Outcome::Answered(answer.clone()),
        };
        let answers = Answers::new(vec![about(1), about(2)]);
        let weights: Vec<(u16, f64)> = parts.answered(&answers).iter().map(|of| (of.id, of.answers[0].1)).collect();
        assert_eq!(weights, [(1, 1.0), (2, 50.0)]);
    }
}
