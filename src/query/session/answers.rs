//! Asking what is due, round by round.

use std::collections::BTreeMap;

use super::{Answered, AnsweredWhole, QuerySession};
use crate::error::Result;
use crate::query::ask::asker::Asker;
use crate::query::ask::follow_up::{self, FollowUp};
use crate::query::ask::rounds::{Subject, SubjectInView};
use crate::query::{
    Alternative, Answer, Answers, AnyWholeQuestion, DirectGuess, GuessQuestion, ObjectAnswers, Outcome, PartQuestion,
    Queries, QueryError, Recognition, RecognizedPart, Size, SubjectAnswer, SubjectId, WholeAnswer, WholeOutcome,
};

/// The parts to ask about by themselves, the most worthwhile first, each with the view in which to ask.
pub(super) struct FollowUps(Vec<(FollowUp, SubjectInView)>);

impl FollowUps {
    /// Sorted.
    pub fn places(&self) -> Vec<SubjectInView> {
        let mut places: Vec<SubjectInView> = self.0.iter().map(|(_, place)| *place).collect();
        places.sort_unstable();
        places
    }
}

impl QuerySession<'_> {
    /// Asks about the object as a whole: how long it is, if that is to be asked, and what it is, if that is. `begin` gets the
    /// questions before they are asked. Each answer is recorded as it arrives. `of_size` converts the answer about the size; if that
    /// fails, the run ends before it costs more. Where nobody can be asked what the object is, recorded answers about its parts serve.
    pub fn answer_whole<T>(
        &self,
        begin: &dyn Fn(&Queries) -> Result<()>,
        of_size: impl FnOnce(WholeAnswer<Size>) -> Result<T>,
    ) -> Result<AnsweredWhole<T>> {
        let object = self.about_whole()?;
        begin(&object)?;
        let size = self.whole.size.as_ref();
        let size = size.map(|size| object.ask_whole(size, &self.recordings, self.asker(), &self.budget, self.progress));
        let size = size.transpose()?.map(of_size).transpose().inspect_err(|_| self.budget.spent().tell(""))?;
        let recognition = self.whole.recognition.as_ref();
        let recognition =
            recognition.map(|what| object.ask_whole(what, &self.recordings, self.asker(), &self.budget, self.progress));
        let recognition = match recognition.transpose() {
            Err(QueryError::MissingWhole { .. }) if self.parts_are_recorded()? => None,
            recognition => recognition?,
        };
        Ok(AnsweredWhole { size, recognition })
    }

    /// Asks about the parts, round by round: those that narrow what the `recognition` says, or all of them without one. `begin` and
    /// recordings are as for [`Self::answer_whole`]. Reports the cost before and after.
    pub fn answer_parts(
        &self,
        recognition: Option<WholeAnswer<Recognition>>,
        begin: &dyn Fn(&Queries) -> Result<()>,
    ) -> Result<Answered> {
        let recognition = recognition.map(|answer| self.with_follow_ups(answer, begin)).transpose()?;
        let recognized = recognition.as_ref().and_then(|answer| answer.outcome.answered());
        let answers = match recognized {
            Some(recognized) => self.of_parts(recognized),
            None => self.of_subjects(begin)?,
        };
        let (failed, all) = (answers.failed().count(), answers.all.len());
        let about = if recognized.is_some() { String::new() } else { format!("; {failed} of {all} questions failed") };
        self.budget.spent().tell(&about);
        Ok(Answered { answers, recognition })
    }

    fn asker(&self) -> Option<&dyn Asker> {
        self.client.as_ref().map(|client| client as &dyn Asker)
    }

    /// The answer about the object with those about the parts that are worth a question. One that is not recorded and cannot be
    /// asked is left open: what is known serves without it.
    fn with_follow_ups(
        &self,
        WholeAnswer { view, outcome }: WholeAnswer<Recognition>,
        begin: &dyn Fn(&Queries) -> Result<()>,
    ) -> Result<WholeAnswer<ObjectAnswers>> {
        let recognition = match outcome {
            WholeOutcome::Answered(recognition) => recognition.with(&self.found),
            WholeOutcome::Failed(failure) => return Ok(WholeAnswer { view, outcome: WholeOutcome::Failed(failure) }),
        };
        let due = self.follow_ups(&recognition);
        let places = due.places();
        let round = self.prepare_follow_ups(&places)?;
        begin(&round)?;
        let outcomes: Vec<Option<Outcome>> = match self.asker().filter(|_| self.options.answers.may_ask()) {
            Some(asker) => {
                let run = round.run(&self.recordings, Some(asker), &self.budget, self.progress)?;
                run.answers.all.into_iter().map(|answer| Some(answer.outcome)).collect()
            }
            None => round.recorded(&self.recordings, None),
        };
        let by_place: BTreeMap<SubjectInView, Option<Outcome>> = places.into_iter().zip(outcomes).collect();
        let questions = due.0.into_iter().map(|(FollowUp { part, why }, place)| PartQuestion {
            part,
            view: self.views[place.view].name.to_owned(),
            subject: SubjectId::of(self.about, place.id),
            why,
            outcome: by_place[&place].clone(),
            in_vain: false,
        });
        let questions = questions.collect();
        let guess = self.guess_question(begin)?;
        let answers = ObjectAnswers { recognition, questions, guess }.without_unproven();
        Ok(WholeAnswer { view, outcome: WholeOutcome::Answered(answers) })
    }

    /// The question how heavy the object is, if that is to be asked; left open as those about parts are.
    fn guess_question(&self, begin: &dyn Fn(&Queries) -> Result<()>) -> Result<Option<GuessQuestion>> {
        let Some(question) = &self.whole.direct else { return Ok(None) };
        let object = self.about_whole()?;
        begin(&object)?;
        let view = question.shown().view.clone();
        let outcome = match object.ask_whole(question, &self.recordings, self.asker(), &self.budget, self.progress) {
            Ok(WholeAnswer { outcome, .. }) => Some(outcome),
            Err(QueryError::MissingWhole { .. }) => None,
            Err(error) => return Err(error.into()),
        };
        Ok(Some(GuessQuestion { view, outcome }))
    }

    /// The parts to ask about by themselves, the most worthwhile first.
    pub(super) fn follow_ups(&self, recognition: &Recognition) -> FollowUps {
        let follow_ups = follow_up::follow_ups(recognition, &self.regions, &self.library);
        let placed = follow_ups.into_iter().filter_map(|of| {
            let place = self.largest_place(&recognition.parts[of.part])?;
            Some((of, place))
        });
        FollowUps(placed.take(self.options.max_questions).collect())
    }

    /// The largest part or piece of one that belongs to a recognised part of the object, in the view that shows it best; `None` if no view
    /// shows any.
    fn largest_place(&self, part: &RecognizedPart) -> Option<SubjectInView> {
        let belongs = |id: u16| part.numbers.contains(&id);
        let is_its = |region: &&Subject| match region.pieces.as_slice() {
            _ if region.views.is_empty() => false,
            [] => belongs(region.id),
            pieces => pieces.iter().all(|piece| belongs(piece.id)),
        };
        let area = |of: &Subject| {
            let region = self.regions.iter().find(|region| region.id == of.id);
            region.map_or(0.0, |region| region.area_share)
        };
        // Among equals, the first.
        let largest = self.regions_asked().filter(is_its).reduce(|a, b| if area(b) > area(a) { b } else { a })?;
        Some(SubjectInView { view: largest.views[0], id: largest.id })
    }

    /// Every part and piece of one.
    fn regions_asked(&self) -> impl Iterator<Item = &Subject> {
        self.subjects.iter().flat_map(|subject| std::iter::once(subject).chain(&subject.pieces))
    }

    /// Whether the first questions about the subjects all have a recorded answer.
    fn parts_are_recorded(&self) -> Result<bool> {
        let round = self.prepare(&self.due(&BTreeMap::new()))?;
        let recorded = round.recorded(&self.recordings, None);
        Ok(!recorded.is_empty() && recorded.iter().all(Option::is_some))
    }

    /// The answers about the subjects, round by round.
    fn of_subjects(&self, begin: &dyn Fn(&Queries) -> Result<()>) -> Result<Answers> {
        let mut answers = BTreeMap::new();
        loop {
            let due = self.due(&answers);
            if due.is_empty() {
                break;
            }
            let round = self.prepare(&due)?;
            begin(&round)?;
            let run = round.run(&self.recordings, self.asker(), &self.budget, self.progress)?;
            let is_fruitless = run.answers.failed().count() == run.answers.all.len();
            answers.extend(due.into_iter().zip(run.answers.all.into_iter().map(|answer| answer.outcome)));
            // Answers may call for more questions. Failures do not: the next ones would fail as well.
            if is_fruitless {
                break;
            }
        }
        Ok(self.named(answers))
    }

    /// Outcomes by view and id as answers, in that order.
    fn named(&self, outcomes: BTreeMap<SubjectInView, Outcome>) -> Answers {
        let answer = |(SubjectInView { view, id }, outcome)| SubjectAnswer {
            view: self.views[view].name.to_owned(),
            subject: SubjectId::of(self.about, id),
            outcome,
        };
        Answers::new(outcomes.into_iter().map(answer).collect())
    }

    /// The most probable way in which each part of the object may be made, as an answer about its first region in the view that
    /// shows it best; its confidence is its probability.
    fn of_parts(&self, recognized: &ObjectAnswers) -> Answers {
        let alternatives = recognized.alternatives(&self.library);
        let probabilities = recognized.probabilities(&alternatives);
        let answered = |(part, (of, probabilities)): (&RecognizedPart, (&Vec<Alternative>, &Vec<f64>))| {
            let best = (0..of.len()).rev().max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]))?;
            let answer = Answer { confidence: probabilities[best], ..of[best].answer.clone() };
            Some((self.best_place(part)?, Outcome::Answered(answer)))
        };
        let parts = recognized.recognition.parts.iter().zip(alternatives.iter().zip(&probabilities));
        self.named(parts.filter_map(answered).collect())
    }

    /// The first region of a part, which stands for all of them, in the view that shows it best, or else the next of them that a view
    /// shows; `None` if no view shows any.
    fn best_place(&self, part: &RecognizedPart) -> Option<SubjectInView> {
        let id = *part.numbers.first()?;
        let best_view = |number: &u16| {
            self.regions_asked().filter(|region| region.id == *number).find_map(|region| region.views.first())
        };
        Some(SubjectInView { view: *part.numbers.iter().find_map(best_view)?, id })
    }

    /// How heavy the object is, as a model judges it from the photos alone; `None` if that is not to be asked.
    pub fn direct_guess(&self, begin: &dyn Fn(&Queries) -> Result<()>) -> Result<Option<WholeAnswer<DirectGuess>>> {
        let Some(question) = &self.whole.direct else { return Ok(None) };
        let object = self.about_whole()?;
        begin(&object)?;
        let guess = object.ask_whole(question, &self.recordings, self.asker(), &self.budget, self.progress)?;
        self.budget.spent().tell("");
        Ok(Some(guess))
    }
}
