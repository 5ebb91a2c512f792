//! The segments or parts that can be voted for: those of all views that have an answer.

use std::collections::HashMap;

use super::{AnsweredPart, VoteError, VotingView};
use crate::materials::MaterialLibrary;
use crate::query::{Answer, Answers, Outcome, SubjectId};
use crate::words::output::{agreeing, counted};

/// A segment of one view, or a part as one view shows it.
pub(super) struct AnsweredSubject<'a> {
    /// Index of the view.
    pub view: usize,
    /// Id in the view's label map.
    pub id: u16,
    /// The answer about the segment; for a part, the one with most weight.
    pub answer: &'a Answer,
    /// Index into [`AnsweredSubjects::materials`].
    pub material: u32,
}

/// The answered subjects of all views, by view, then by id.
pub(super) struct AnsweredSubjects<'a> {
    pub subjects: Vec<AnsweredSubject<'a>>,
    /// Names of the materials that the answers give, sorted.
    pub materials: Vec<&'a str>,
    /// For every view, by segment id: index into `subjects`.
    index: Vec<Vec<Option<u32>>>,
    pub warnings: Vec<String>,
    pub notes: Vec<String>,
    /// Number of segments in the label maps.
    pub in_maps: usize,
}

impl<'a> AnsweredSubjects<'a> {
    /// Segments of the label maps without an answer are counted in the warnings, as are views without segments.
    ///
    /// # Errors
    /// [`VoteError::UnknownMaterial`] if an answer names a material that `library` does not have.
    pub fn new(views: &[VotingView], answers: &'a Answers, library: &MaterialLibrary) -> Result<Self, VoteError> {
        let outcomes = answers.by_subject();
        let mut found = Self::of_answers(views, "segment", |view, id| {
            match outcomes.get(&(views[view].name, SubjectId::Segment(id)))? {
                Outcome::Answered(answer) => Some(answer),
                Outcome::Failed(_) => None,
            }
        });
        for subject in &found.subjects {
            let about = || format!("segment {} of view `{}`", subject.id, views[subject.view].name);
            check_material(subject.answer, about, library)?;
        }
        found.name_materials(&[]);
        Ok(found)
    }

    /// As [`Self::new`], for label maps whose ids are those of `parts` in all views.
    pub fn of_parts(
        views: &[VotingView],
        parts: &'a [AnsweredPart],
        library: &MaterialLibrary,
    ) -> Result<Self, VoteError> {
        for part in parts {
            for (answer, _) in &part.answers {
                check_material(answer, || format!("part {}", part.id), library)?;
            }
        }
        let main: HashMap<u16, &Answer> =
            parts.iter().rev().filter_map(|part| Some((part.id, part.answers.first()?.0))).collect();
        let mut found = Self::of_answers(views, "part", |_, id| main.get(&id).copied());
        let all: Vec<&str> =
            parts.iter().flat_map(|part| part.answers.iter()).map(|(a, _)| a.material.as_str()).collect();
        found.name_materials(&all);
        Ok(found)
    }

    fn of_answers(views: &[VotingView], what: &str, answer: impl Fn(usize, u16) -> Option<&'a Answer>) -> Self {
        let mut found =
            Self { subjects: vec![], materials: vec![], index: vec![], warnings: vec![], notes: vec![], in_maps: 0 };
        let mut unanswered = Vec::new();
        for (number, view) in views.iter().enumerate() {
            let present = ids_of(view);
            found.in_maps += present.iter().filter(|present| **present).count();
            if !present.contains(&true) {
                found
                    .warnings
                    .push(format!("view `{}` shows no {what}s, so materials are found without it", view.name));
            }
            let mut index = vec![None; present.len()];
            for id in (0..present.len()).filter(|&id| present[id]) {
                match answer(number, id as u16) {
                    Some(answer) => {
                        index[id] = Some(found.subjects.len() as u32);
                        found.subjects.push(AnsweredSubject { view: number, id: id as u16, answer, material: 0 });
                    }
                    None => unanswered.push(format!("{}/{id}", view.name)),
                }
            }
            found.index.push(index);
        }
        if !unanswered.is_empty() {
            let (count, list) = (unanswered.len(), shortened(&unanswered));
            // A part counts once in each view that shows it.
            let region = if what == "part" { "region" } else { what };
            let (of, cast) = (
                counted(found.in_maps, region),
                agreeing(
                    count,
                    "has no answer, so what it shows takes the material around it",
                    "have no answer, so what they show takes the material around it",
                ),
            );
            found.warnings.push(format!("{count} of {of} {cast}: {list}"));
        }
        found
    }

    /// Numbers the materials of the segments' answers and those in `more`.
    fn name_materials(&mut self, more: &[&'a str]) {
        self.materials = self.subjects.iter().map(|subject| subject.answer.material.as_str()).collect();
        self.materials.extend(more);
        self.materials.sort_unstable();
        self.materials.dedup();
        for subject in &mut self.subjects {
            let place = self.materials.binary_search(&subject.answer.material.as_str());
            subject.material = place.expect("every answer's material is listed") as u32;
        }
    }

    /// The number of a material that some answer names.
    pub fn material(&self, name: &str) -> u32 {
        self.materials.binary_search(&name).expect("every answer's material is listed") as u32
    }

    /// Index of the segment with this id in the view's label map; `None` for the background and for segments without an
    /// answer.
    pub fn find(&self, view: usize, id: u16) -> Option<u32> {
        self.index[view].get(usize::from(id)).copied().flatten()
    }
}

/// Checks the material of an answer; `about` says what the answer is about.
///
/// # Errors
/// [`VoteError::UnknownMaterial`] if the answer names a material that `library` does not have.
fn check_material(answer: &Answer, about: impl Fn() -> String, library: &MaterialLibrary) -> Result<(), VoteError> {
    match library.get(&answer.material) {
        Some(_) => Ok(()),
        None => Err(VoteError::UnknownMaterial { about: about(), material: answer.material.clone() }),
    }
}

/// By id: true if the view's label map contains it. The background, 0, is not a segment.
fn ids_of(view: &VotingView) -> Vec<bool> {
    let largest = view.map.labels.iter().copied().max().unwrap_or(0);
    let mut present = vec![false; usize::from(largest) + 1];
    for &label in &view.map.labels {
        present[usize::from(label)] = true;
    }
    present[0] = false;
    present
}

/// The first few of a list.
fn shortened(names: &[String]) -> String {
    const SHOWN: usize = 5;
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    format!("{}{more}", names[..names.len().min(SHOWN)].join(", "))
}
