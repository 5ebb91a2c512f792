//! `answers.jsonl`: one line per question, written and read back.

use std::collections::{HashMap, HashSet};

use crate::query::{Answers, Outcome, SegmentAnswer};

/// A line that gprop did not write; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
pub enum AnswersError {
    #[error("line {line}: {problem}")]
    NotAnAnswer { line: usize, problem: serde_json::Error },
    #[error("line {line}: the segment {segment} of view {view:?} has an answer already")]
    Again { line: usize, view: String, segment: u16 },
}

impl Answers {
    /// The answers as JSON Lines.
    pub fn to_jsonl(&self) -> String {
        self.segments.iter().map(SegmentAnswer::to_jsonl).collect()
    }

    /// Reads JSON Lines; blank lines are skipped.
    ///
    /// # Errors
    /// If a line is not an answer, or answers the same question as an earlier one.
    pub fn from_jsonl(text: &str) -> Result<Self, AnswersError> {
        let lines = (1..).zip(text.lines()).filter(|(_, text)| !text.trim().is_empty());
        let mut segments: Vec<SegmentAnswer> = Vec::new();
        let mut answered = HashSet::new();
        for (line, text) in lines {
            let answer: SegmentAnswer =
                serde_json::from_str(text).map_err(|problem| AnswersError::NotAnAnswer { line, problem })?;
            if !answered.insert((answer.view.clone(), answer.segment)) {
                return Err(AnswersError::Again { line, view: answer.view, segment: answer.segment });
            }
            segments.push(answer);
        }
        Ok(Self { segments })
    }

    /// The outcome of each question, by view and segment.
    pub fn by_segment(&self) -> HashMap<(&str, u16), &Outcome> {
        self.segments.iter().map(|answer| ((&*answer.view, answer.segment), &answer.outcome)).collect()
    }

    /// The segments that have no answer.
    pub fn failed(&self) -> impl Iterator<Item = &SegmentAnswer> {
        self.segments.iter().filter(|segment| matches!(segment.outcome, Outcome::Failed(_)))
    }
}

impl SegmentAnswer {
    /// One line, with its line break.
    pub fn to_jsonl(&self) -> String {
        let mut line = serde_json::to_string(self).expect("an answer has string keys and finite numbers");
        line.push('\n');
        line
    }
}
