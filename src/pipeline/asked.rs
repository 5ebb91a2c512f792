//! The subjects that the model is asked about and that its answers settle: parts of the object, or segments of each
//! view.

use std::borrow::Cow;
use std::collections::BTreeMap;

use anyhow::Result;

use crate::query::ask::rounds::{self, Outcomes, PartOrPiece, Subject, Target};
use crate::query::question::About;
use crate::query::{Answers, Outcome, SegmentAnswer};
use crate::scene::ScaleChoice;
use crate::segment::{LabelMap, ViewSegments};
use crate::vote::AnsweredPart;

use super::Pipeline;
use super::consensus::{FoundPart, FoundParts, renamed};
use super::query_session::{QueryView, Subjects};

impl Pipeline {
    /// The subjects that the model is asked about.
    pub(super) fn subjects<'a>(&self, views: Vec<QueryView<'a>>) -> Result<Subjects<'a>> {
        let asks_size = self.options.scene.scale == ScaleChoice::Estimate;
        let size_in = if asks_size { self.fullest_view() } else { None };
        let Some(found) = self.found_parts()? else {
            let of_views = self.segmentation()?.views.iter().enumerate();
            // A segment may be covered completely by the segments that lie in it.
            let is_left = |of: &ViewSegments, id: u16| of.map.labels.contains(&id);
            let segments = of_views.flat_map(|(view, of)| {
                of.segments.iter().filter(move |found| is_left(of, found.id)).map(move |found| (view, found.id))
            });
            let subjects = segments.map(|(view, id)| Subject::segment(view, id)).collect();
            return Ok(Subjects { views, subjects, ask_views: 1, about: About::Segments, size_in });
        };
        let index = self.view_indices();
        let (subjects, ask_views) = (found.subjects(&index), self.options.consensus.ask_views.get());
        Ok(Subjects { views, subjects, ask_views, about: About::Parts, size_in })
    }

    /// The index of each chosen view, by its name.
    fn view_indices(&self) -> BTreeMap<&str, usize> {
        self.views.iter().map(|view| view.name.as_str()).zip(0..).collect()
    }

    /// The label maps whose ids the questions are about, for the view with this number.
    pub(super) fn asked_maps(&self, view: usize) -> Result<Vec<Cow<'_, LabelMap>>> {
        Ok(match self.found_parts()? {
            None => vec![Cow::Borrowed(&self.segmentation()?.views[view].map)],
            Some(found) => vec![Cow::Owned(found.whole_parts(view)), Cow::Borrowed(&found.maps[view])],
        })
    }

    /// For every chosen view, the label map whose ids the answers settle: of segments; or of parts, and of the pieces of
    /// those that consist of several materials.
    pub(super) fn settled_maps(&self, answers: &Answers) -> Result<Vec<Cow<'_, LabelMap>>> {
        let Some(found) = self.found_parts()? else {
            return Ok(self.segmentation()?.views.iter().map(|view| Cow::Borrowed(&view.map)).collect());
        };
        let index = self.view_indices();
        let target =
            |answer: &SegmentAnswer| Some(Target { view: *index.get(answer.view.as_str())?, id: answer.segment });
        let outcomes: Outcomes =
            answers.segments.iter().filter_map(|answer| Some((target(answer)?, &answer.outcome))).collect();
        let settled = rounds::settled(&found.subjects(&index), &outcomes);
        let settled = |id: u16| settled.get(&id).copied().unwrap_or(id);
        Ok(found.maps.iter().map(|map| Cow::Owned(renamed(map, settled))).collect())
    }
}

impl FoundParts {
    /// The parts and pieces that have answers, weighed by how many of their pixels each view shows.
    pub fn answered<'a>(&self, answers: &'a Answers) -> Vec<AnsweredPart<'a>> {
        let shown = |answer: &SegmentAnswer| {
            let found = self.parts.iter().find(|found| found.part.id == answer.segment)?;
            Some(found.views.iter().find(|shown| shown.view == answer.view)?.pixels)
        };
        let weighed = |answer: &'a SegmentAnswer| match &answer.outcome {
            Outcome::Answered(said) => Some((answer.segment, said, f64::from(shown(answer)?))),
            Outcome::Failed(_) => None,
        };
        AnsweredPart::collect(answers.segments.iter().filter_map(weighed))
    }

    fn subjects(&self, index: &BTreeMap<&str, usize>) -> Vec<Subject> {
        rounds::subjects(self.parts.iter().map(|FoundPart { part, views, .. }| PartOrPiece {
            id: part.id,
            piece_of: part.piece_of,
            views: views.iter().filter_map(|shown| index.get(shown.view.as_str()).copied()).collect(),
        }))
    }
}
