//! What the model is asked about and what its answers settle: parts of the object, or segments of each view.

use std::borrow::Cow;
use std::collections::BTreeMap;

use anyhow::Result;

use crate::query::question::About;
use crate::query::rounds::{Ask, Outcomes, Subject};
use crate::query::{Answer, Answers, Outcome, SegmentAnswer};
use crate::segment::{LabelMap, ViewSegments};
use crate::vote::AnsweredPart;

use super::Pipeline;
use super::consensus::{FoundPart, FoundParts, renamed};
use super::query_session::{QueryView, Subjects};

impl Pipeline {
    /// What the model is asked about.
    pub(super) fn subjects<'a>(&self, views: Vec<QueryView<'a>>) -> Result<Subjects<'a>> {
        let Some(found) = self.found_parts()? else {
            let of_views = self.segmentation()?.views.iter().enumerate();
            // Segments that lie in it may cover all of a segment.
            let is_left = |of: &ViewSegments, id: u16| of.map.labels.contains(&id);
            let segments = of_views.flat_map(|(view, of)| {
                of.segments.iter().filter(move |found| is_left(of, found.id)).map(move |found| (view, found.id))
            });
            let subjects = segments.map(|(view, id)| Subject::segment(view, id)).collect();
            return Ok(Subjects { views, subjects, ask_views: 1, about: About::Segments });
        };
        let index = self.view_indices();
        let (subjects, ask_views) = (found.subjects(&index), self.options.consensus.ask_views.get());
        Ok(Subjects { views, subjects, ask_views, about: About::Parts })
    }

    /// By name, the index of each chosen view.
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
        let ask = |answer: &SegmentAnswer| Some(Ask { view: *index.get(answer.view.as_str())?, id: answer.segment });
        let outcomes: Outcomes =
            answers.segments.iter().filter_map(|answer| Some((ask(answer)?, &answer.outcome))).collect();
        let split: Vec<u16> = found
            .subjects(&index)
            .iter()
            .filter(|subject| subject.is_split(&outcomes))
            .map(|subject| subject.id)
            .collect();
        let settled = |id: u16| match found.part_of(id) {
            part if split.contains(&part) => id,
            part => part,
        };
        Ok(found.maps.iter().map(|map| Cow::Owned(renamed(map, settled))).collect())
    }
}

impl FoundParts {
    /// The parts and pieces that have answers, weighed by how many of their pixels each view shows.
    pub fn answered<'a>(&self, answers: &'a Answers) -> Vec<AnsweredPart<'a>> {
        let of_part = |found: &FoundPart| {
            let shown = |view: &str| found.views.iter().find(|shown| shown.view == view).map(|shown| shown.pixels);
            let weighed = |answer: &'a SegmentAnswer| match &answer.outcome {
                Outcome::Answered(said) if answer.segment == found.part.id => {
                    Some((said, f64::from(shown(&answer.view)?)))
                }
                _ => None,
            };
            let mut answers: Vec<(&Answer, f64)> = answers.segments.iter().filter_map(weighed).collect();
            answers.sort_by(|a, b| b.1.total_cmp(&a.1));
            AnsweredPart { id: found.part.id, answers }
        };
        self.parts.iter().map(of_part).filter(|part| !part.answers.is_empty()).collect()
    }

    fn subjects(&self, index: &BTreeMap<&str, usize>) -> Vec<Subject> {
        let subject = |found: &FoundPart, pieces| Subject {
            id: found.part.id,
            views: found.views.iter().filter_map(|shown| index.get(shown.view.as_str()).copied()).collect(),
            pieces,
        };
        let pieces = |id: u16| {
            let of_part = self.parts.iter().filter(|found| found.part.piece_of == Some(id));
            of_part.map(|piece| subject(piece, Vec::new())).collect()
        };
        let whole = self.parts.iter().filter(|found| found.part.piece_of.is_none());
        whole.map(|found| subject(found, pieces(found.part.id))).collect()
    }
}
