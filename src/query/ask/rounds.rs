//! The order of the questions: every part is asked about in a few views first, in more of them while the answers
//! disagree, and piece by piece if it consists of several materials. A question without an answer is no disagreement.

use std::collections::BTreeMap;

use crate::query::{Answer, Outcome};

/// The subject of one question: one segment of one view, or one part or piece as one view shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct SubjectInView {
    /// Index of the view.
    pub view: usize,
    /// Its id in the view's label map.
    pub id: u16,
}

/// A part, piece or segment: made of one material, as far as is known before the model is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    pub id: u16,
    /// The views that show it, by index, in the order in which it is asked about in them.
    pub views: Vec<usize>,
    /// The pieces to ask about instead if it consists of several materials.
    pub pieces: Vec<Subject>,
}

/// A part or piece about which this many questions were asked without any answer is not asked about again.
const MOST_UNANSWERED: usize = 3;

/// A piece is asked about in one view, unless that answer fails: a part has up to a dozen pieces, and it is already known
/// from the answers about the part that they differ.
const VIEWS_OF_PIECE: usize = 1;

/// The outcomes so far.
pub type Outcomes<'a> = BTreeMap<SubjectInView, &'a Outcome>;

/// A part of the object, or a piece of one.
#[derive(Debug, Clone, PartialEq)]
pub struct PartOrPiece {
    pub id: u16,
    /// The part of which this is a piece; `None` for a part.
    pub piece_of: Option<u16>,
    /// As in [`Subject`].
    pub views: Vec<usize>,
}

/// The parts, each with its pieces.
pub fn subjects(parts: impl IntoIterator<Item = PartOrPiece>) -> Vec<Subject> {
    let (whole, pieces): (Vec<_>, Vec<_>) = parts.into_iter().partition(|part| part.piece_of.is_none());
    let subject = |part: PartOrPiece| Subject { id: part.id, views: part.views, pieces: Vec::new() };
    let of_part = |part: PartOrPiece| {
        let of_this = pieces.iter().filter(|piece| piece.piece_of == Some(part.id));
        Subject { pieces: of_this.cloned().map(subject).collect(), ..subject(part) }
    };
    whole.into_iter().map(of_part).collect()
}

/// Maps the id of each piece to the id of its part if the part, according to the outcomes, does not consist of several
/// materials: the answers about the part then hold for the piece. Other ids stand for themselves.
pub fn settled(subjects: &[Subject], outcomes: &Outcomes) -> BTreeMap<u16, u16> {
    let whole = subjects.iter().filter(|subject| !subject.is_split(outcomes));
    whole.flat_map(|part| part.pieces.iter().map(|piece| (piece.id, part.id))).collect()
}

impl Subject {
    /// A segment, which one view shows.
    pub fn segment(view: usize, id: u16) -> Self {
        Self { id, views: vec![view], pieces: Vec::new() }
    }

    /// The questions to ask next, given the outcomes so far: none if the answers suffice, or if all views are used up.
    /// The first questions go to the first `views` views.
    pub fn due(&self, views: usize, outcomes: &Outcomes) -> Vec<SubjectInView> {
        let mut own = self.due_about_itself(views, outcomes);
        if own.is_empty() && self.is_split(outcomes) {
            own = self.pieces.iter().flat_map(|piece| piece.due(VIEWS_OF_PIECE, outcomes)).collect();
        }
        own
    }

    fn due_about_itself(&self, views: usize, outcomes: &Outcomes) -> Vec<SubjectInView> {
        for count in views.min(self.views.len())..=self.views.len() {
            let first = || self.in_views().take(count);
            let open: Vec<SubjectInView> = first().filter(|subject| !outcomes.contains_key(subject)).collect();
            if !open.is_empty() {
                return open;
            }
            let answers = answers(first(), outcomes);
            if agree(&answers) || (answers.is_empty() && count >= MOST_UNANSWERED) {
                break;
            }
        }
        Vec::new()
    }

    /// True if most of its answers say that it consists of several materials, and it has pieces to ask about instead.
    pub fn is_split(&self, outcomes: &Outcomes) -> bool {
        let answers = answers(self.in_views(), outcomes);
        let several = answers.iter().filter(|answer| answer.several_materials).count();
        !self.pieces.is_empty() && 2 * several > answers.len()
    }

    /// All questions that it may lead to.
    pub fn all(&self) -> Vec<SubjectInView> {
        self.in_views().chain(self.pieces.iter().flat_map(Self::all)).collect()
    }

    fn in_views(&self) -> impl Iterator<Item = SubjectInView> {
        self.views.iter().map(|&view| SubjectInView { view, id: self.id })
    }
}

fn answers<'a>(subjects: impl Iterator<Item = SubjectInView>, outcomes: &Outcomes<'a>) -> Vec<&'a Answer> {
    let answered = |subject| match outcomes.get(&subject) {
        Some(Outcome::Answered(answer)) => Some(answer),
        _ => None,
    };
    subjects.filter_map(answered).collect()
}

/// True if more than half name one material, or all name materials of one family.
fn agree(answers: &[&Answer]) -> bool {
    let Some(first) = answers.first() else { return false };
    let naming = |material: &str| answers.iter().filter(|answer| answer.material == material).count();
    answers.iter().any(|answer| 2 * naming(&answer.material) > answers.len())
        || answers.iter().all(|answer| answer.family == first.family)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::MaterialLibrary;
    use crate::query::Failure;

    fn answer(family: &str, material: &str, several_materials: bool) -> Outcome {
        let (family, material) = (family.to_owned(), material.to_owned());
        let any = &MaterialLibrary::builtin().materials()[0];
        Outcome::Answered(Answer { family, material, several_materials, ..Answer::of(any) })
    }

    fn failed() -> Outcome {
        Outcome::Failed(Failure::Refused { message: "no".to_owned() })
    }

    fn part(id: u16, views: &[usize]) -> Subject {
        Subject { id, views: views.to_vec(), pieces: Vec::new() }
    }

    /// The views in which to ask about `subject` next, once its questions, in the order in which they are asked, have
    /// these outcomes.
    fn due(subject: &Subject, given: &[Outcome]) -> Vec<usize> {
        let outcomes: Outcomes =
            subject.views.iter().map(|&view| SubjectInView { view, id: subject.id }).zip(given).collect();
        subject.due(3, &outcomes).iter().map(|subject| subject.view).collect()
    }

    #[test]
    fn a_part_is_asked_about_in_its_best_views_and_in_more_while_answers_disagree() {
        let part = part(1, &[4, 2, 7, 0, 5]);
        let (oak, ash) = (answer("wood", "oak", false), answer("wood", "ash", false));
        let (steel, nylon) = (answer("metal", "steel", false), answer("plastic", "nylon", false));
        assert_eq!(due(&part, &[]), [4, 2, 7]);
        assert_eq!(due(&part, &[oak.clone(), steel.clone()]), [7]);
        assert!(due(&part, &[oak.clone(), oak.clone(), steel.clone()]).is_empty(), "a majority");
        assert!(due(&part, &[oak.clone(), ash.clone(), answer("wood", "elm", false)]).is_empty(), "one family");
        assert_eq!(due(&part, &[oak.clone(), steel.clone(), nylon.clone()]), [0]);
        assert!(
            due(&part, &[oak.clone(), steel.clone(), nylon.clone(), ash, failed()]).is_empty(),
            "all views are spent"
        );
        assert!(due(&part, &[oak, failed(), failed()]).is_empty(), "one answer is better than none");
        assert!(due(&part, &[failed(), failed(), failed()]).is_empty(), "no answer is no disagreement");
        let piece = |given: usize| {
            let outcomes: Vec<Outcome> = std::iter::repeat_with(failed).take(given).collect();
            let of_piece = part.views.iter().map(|&view| SubjectInView { view, id: part.id }).zip(&outcomes);
            part.due(VIEWS_OF_PIECE, &of_piece.collect()).len()
        };
        assert_eq!([piece(0), piece(1), piece(2), piece(3)], [1, 1, 1, 0], "three views at most without an answer");
    }

    #[test]
    fn a_part_of_several_materials_is_asked_about_piece_by_piece() {
        let named = |id, piece_of, views: &[usize]| PartOrPiece { id, piece_of, views: views.to_vec() };
        let parts =
            [named(2, None, &[0, 1]), named(3, None, &[2]), named(5, Some(2), &[1]), named(6, Some(2), &[0, 1])];
        let subjects = subjects(parts);
        let whole = &subjects[0];
        assert_eq!(*whole, Subject { pieces: vec![part(5, &[1]), part(6, &[0, 1])], ..part(2, &[0, 1]) });
        assert_eq!(subjects[1..], [part(3, &[2])]);
        let outcome = [answer("wood", "oak", true), answer("metal", "steel", false), answer("wood", "oak", true)];
        let mut outcomes: Outcomes = [(SubjectInView { view: 0, id: 2 }, &outcome[0])].into();
        assert_eq!(whole.due(1, &outcomes), [SubjectInView { view: 1, id: 5 }, SubjectInView { view: 0, id: 6 }]);
        assert!(whole.is_split(&outcomes));
        assert!(settled(&subjects, &outcomes).is_empty(), "pieces stand for themselves");
        outcomes.insert(SubjectInView { view: 1, id: 2 }, &outcome[1]);
        assert!(!whole.is_split(&outcomes), "one of two says so");
        assert_eq!(settled(&subjects, &outcomes), [(5, 2), (6, 2)].into());
        assert!(!part(2, &[0]).is_split(&outcomes), "there is nothing else to ask about");
        assert_eq!(whole.all().len(), 5);
    }
}
