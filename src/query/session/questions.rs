//! Which questions are due, and what they would cost.

use std::collections::{BTreeMap, BTreeSet};

use super::{ForPerson, QuerySession};
use crate::consensus::AskAbout;
use crate::error::Result;
use crate::query::ask::asker::Asker;
use crate::query::ask::rounds::{Outcomes, SubjectInView};
use crate::query::exchange::Form;
use crate::query::recorded::Answerer;
use crate::query::{Outcome, Preview, Queries, ShownSubject, ViewSubjects};

impl QuerySession<'_> {
    /// The questions whose answers are recorded and those that are then due, with all sheets drawn. Answers that are not
    /// recorded yet may lead to more questions.
    pub fn queries(&self) -> Result<Queries<'_>> {
        self.queries_for(self.client.as_ref().map(Asker::answerer))
    }

    /// As [`Self::queries`], if `answerer` is the one that would be asked.
    pub(super) fn queries_for(&self, answerer: Option<&Answerer>) -> Result<Queries<'_>> {
        let mut answers = BTreeMap::new();
        let mut queries = self.about_whole()?;
        if let Some(what) = &self.whole.recognition {
            // Its answer says what is left to ask.
            if let Ok(recognition) = queries.recorded_whole(what, &self.recordings, answerer) {
                let due = self.follow_ups(&recognition.with(&self.found));
                queries.subjects = self.prepare_follow_ups(&due.places())?.subjects;
            }
            return Ok(queries);
        }
        loop {
            let due = self.due(&answers);
            let round = self.prepare(&due)?;
            let recorded = round.recorded(&self.recordings, answerer);
            let is_open = due.is_empty() || recorded.iter().any(Option::is_none);
            answers.extend(due.into_iter().zip(recorded).filter_map(|(subject, outcome)| Some((subject, outcome?))));
            queries.subjects.extend(round.subjects);
            if is_open {
                queries.subjects.sort_by_key(|subject| self.place(&subject.view, subject.id));
                return Ok(queries);
            }
        }
    }

    /// The questions to ask next, by view and id.
    pub(super) fn due(&self, answers: &BTreeMap<SubjectInView, Outcome>) -> Vec<SubjectInView> {
        let outcomes: Outcomes = answers.iter().map(|(&subject, outcome)| (subject, outcome)).collect();
        let mut due: Vec<SubjectInView> =
            self.subjects.iter().flat_map(|subject| subject.due(self.ask_views, &outcomes)).collect();
        due.sort_unstable();
        due
    }

    /// The questions about `subjects`, which are sorted, with their sheets.
    pub(super) fn prepare(&self, subjects: &[SubjectInView]) -> Result<Queries<'_>> {
        self.prepare_about(self.about, subjects)
    }

    /// As [`Self::prepare`], the questions that follow the one about the object.
    pub(super) fn prepare_follow_ups(&self, subjects: &[SubjectInView]) -> Result<Queries<'_>> {
        self.prepare_about(AskAbout::Object, subjects)
    }

    fn prepare_about(&self, about: AskAbout, subjects: &[SubjectInView]) -> Result<Queries<'_>> {
        let ids_of =
            |view: usize| subjects.iter().filter(|subject| subject.view == view).map(|subject| subject.id).collect();
        let ids: Vec<Vec<u16>> = (0..self.views.len()).map(ids_of).collect();
        let shown = self.views.iter().zip(&ids).filter(|(_, ids)| !ids.is_empty());
        let inputs: Vec<ViewSubjects> = shown
            .map(|(view, ids)| ViewSubjects { name: view.name, photo: &view.photo, maps: &view.maps, ids })
            .collect();
        Ok(Queries::prepare(&inputs, &self.library, &self.prompts, self.options, about)?)
    }

    /// The questions about the whole object, and no others yet.
    pub(super) fn about_whole(&self) -> Result<Queries<'_>> {
        let about = if self.whole.recognition.is_some() { AskAbout::Object } else { self.about };
        Ok(Queries { whole: self.whole.all().collect(), ..self.prepare_about(about, &[])? })
    }

    fn place(&self, view: &str, id: u16) -> SubjectInView {
        let view = self.views.iter().position(|other| other.name == view);
        SubjectInView { view: view.expect("questions are about the session's views"), id }
    }

    /// Number of the questions that have no recorded answer.
    pub fn count_open(&self, queries: &Queries) -> usize {
        queries.unanswered(&self.recordings, None).len()
    }

    /// Estimates what would be sent, and its cost.
    pub fn preview(&self, queries: &Queries) -> Preview {
        let answerer = self.client.as_ref().map(Asker::answerer);
        let preview = queries.preview(&self.recordings, answerer, self.price());
        let of_parts = match &self.whole.recognition {
            Some(what) => match queries.recorded_whole(what, &self.recordings, answerer) {
                Ok(_) => queries.subjects.len(),
                Err(_) => self.options.max_questions.min(self.subjects.len()),
            },
            None => self.subjects.iter().map(|subject| subject.all().len()).sum(),
        };
        Preview { at_most: of_parts + self.whole.all().count(), ..preview }
    }

    /// The same for two questions about the same part. The number of a segment identifies it only within its view; the
    /// number of a part is the same in all views.
    pub(super) fn part_of(&self, shown: &ShownSubject) -> (usize, u16) {
        let is_its = |one: &SubjectInView| self.views[one.view].name == shown.view && one.id == shown.id;
        let subject = self.subjects.iter().position(|subject| subject.all().iter().any(is_its));
        (subject.unwrap_or(self.subjects.len()), shown.id)
    }

    /// The questions for a person, with those that have no recorded answer added to the form.
    pub fn for_person(&self, form: &mut Form) -> Result<ForPerson<'_>> {
        let queries = self.queries_for(None)?;
        let open = queries.unanswered(&self.recordings, None);
        form.add(&open, &|shown| self.part_of(shown));
        let names: BTreeSet<String> =
            open.iter().map(|(shown, question)| shown.asked(question).content_sha256().short().to_owned()).collect();
        let recorded = form.questions().iter().map(|question| &question.query);
        let recorded = recorded.filter(|query| !names.contains(*query)).cloned().collect();
        let is_open = |shown: &ShownSubject| open.iter().any(|(of, _)| of.view == shown.view && of.id == shown.id);
        let (unanswered, answered): (Vec<_>, Vec<_>) = queries.subjects.iter().partition(|shown| is_open(shown));
        let ids = |shown: Vec<&ShownSubject>| shown.iter().map(|shown| shown.id).collect::<BTreeSet<u16>>();
        let (unanswered, answered) = (ids(unanswered), ids(answered));
        let (parts, without_answer) = ((&unanswered | &answered).len(), (&unanswered - &answered).len());
        let open = open.len();
        Ok(ForPerson { queries, open, recorded, parts, without_answer })
    }
}
