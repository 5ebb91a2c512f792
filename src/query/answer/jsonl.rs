//! `answers.jsonl`: one line per question, written and read back.

use std::collections::{HashMap, HashSet};

use crate::files::json;
use crate::query::{Answers, Outcome, SubjectAnswer, SubjectId};

/// A line that gprop did not write; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
pub enum AnswersError {
    #[error("line {line}: {problem}")]
    NotAnAnswer { line: usize, problem: serde_json::Error },
    #[error("line {line}: {subject} of view {view:?} has an answer already")]
    Again { line: usize, view: String, subject: SubjectId },
}

impl Answers {
    /// The answers as JSON Lines.
    pub fn to_jsonl(&self) -> String {
        self.all.iter().map(SubjectAnswer::to_jsonl).collect()
    }

    /// Reads JSON Lines; blank lines are skipped.
    ///
    /// # Errors
    /// If a line is not an answer, or answers the same question as an earlier one.
    pub fn from_jsonl(text: &str) -> Result<Self, AnswersError> {
        let lines = (1..).zip(text.lines()).filter(|(_, text)| !text.trim().is_empty());
        let mut all: Vec<SubjectAnswer> = Vec::new();
        let mut answered = HashSet::new();
        for (line, text) in lines {
            let answer: SubjectAnswer =
                json::read(text.as_bytes()).map_err(|problem| AnswersError::NotAnAnswer { line, problem })?;
            if !answered.insert((answer.view.clone(), answer.subject)) {
                return Err(AnswersError::Again { line, view: answer.view, subject: answer.subject });
            }
            all.push(answer);
        }
        Ok(Self { all })
    }

    /// The outcome of each question, by view and subject.
    pub fn by_subject(&self) -> HashMap<(&str, SubjectId), &Outcome> {
        self.all.iter().map(|answer| ((&*answer.view, answer.subject), &answer.outcome)).collect()
    }

    /// The questions that have no answer.
    pub fn failed(&self) -> impl Iterator<Item = &SubjectAnswer> {
        self.all.iter().filter(|answer| matches!(answer.outcome, Outcome::Failed(_)))
    }
}

impl SubjectAnswer {
    /// One line, with its line break.
    pub fn to_jsonl(&self) -> String {
        let mut line = json::compact(self).expect("an answer has string keys and finite numbers");
        line.push('\n');
        line
    }
}
