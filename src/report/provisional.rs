//! Whether a result is provisional: it is if a run on the answers so far (`--answers partial`) left questions open.

use std::collections::BTreeSet;

use crate::query::{Answers, Failure, Outcome, SubjectAnswer, SubjectId};
use crate::words::output::{agreeing, counted};

/// How many of the parts are answered, and what the others count as; `None` if no part was left open. With `has_belief`, the
/// object as a whole is answered, too.
pub fn provisional(answers: &Answers, has_belief: bool) -> Option<String> {
    // A part has the same number in all views; the number of a segment means something else in every one.
    let subject = |answer: &SubjectAnswer| match answer.subject {
        SubjectId::Part(_) => (String::new(), answer.subject),
        SubjectId::Segment(_) => (answer.view.clone(), answer.subject),
    };
    let open = answers.all.iter().filter(|answer| answer.outcome == Outcome::Failed(Failure::Unanswered));
    let open: BTreeSet<_> = open.map(subject).collect();
    let answered = answers.all.iter().filter(|answer| matches!(answer.outcome, Outcome::Answered(_)));
    let answered: BTreeSet<_> = answered.map(subject).collect();
    if open.is_subset(&answered) {
        return None;
    }
    let all = answers.all.iter().map(subject).collect::<BTreeSet<_>>().len();
    let what = match answers.all.first()?.subject {
        SubjectId::Part(_) => "part",
        SubjectId::Segment(_) => "segment",
    };
    let (in_doubt, consequence) = if has_belief {
        (" in doubt", "for the others, the answer about the object stands")
    } else {
        ("", "what has no answer counts as the material around it")
    };
    let is = agreeing(answered.len(), "is", "are");
    Some(format!("{} of {}{in_doubt} {is} answered; {consequence}.", answered.len(), counted(all, what)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::MaterialLibrary;
    use crate::query::Answer;

    #[test]
    fn a_result_is_provisional_as_long_as_a_part_has_no_answer() {
        let answer = || Outcome::Answered(Answer::of(&MaterialLibrary::builtin().materials()[0]));
        let open = || Outcome::Failed(Failure::Unanswered);
        let refused = Failure::Refused { message: String::new() };
        let said = |outcomes: Vec<(&str, u16, Outcome)>, has_belief: bool| {
            let all = outcomes.into_iter().map(|(view, id, outcome)| SubjectAnswer {
                view: view.to_owned(),
                subject: SubjectId::Part(id),
                outcome,
            });
            provisional(&Answers::new(all.collect()), has_belief)
        };
        // Part 1 is answered in one of its two views.
        let some = || vec![("a", 1, answer()), ("b", 1, open()), ("a", 2, open()), ("b", 3, open())];
        let words = "1 of 3 parts is answered; what has no answer counts as the material around it.";
        assert_eq!(said(some(), false).as_deref(), Some(words));
        assert!(said(some(), true).unwrap().starts_with("1 of 3 parts in doubt is answered; for the others"));
        assert_eq!(said(vec![("a", 1, answer()), ("b", 1, open())], false), None);
        assert_eq!(said(vec![("a", 1, answer())], false), None);
        assert_eq!(said(vec![("a", 1, Outcome::Failed(refused))], false), None, "a failure is told otherwise");
    }
}
