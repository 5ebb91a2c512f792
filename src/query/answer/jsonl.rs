//! `answers.jsonl`: one line per question, written and read back.

use crate::query::{Answers, Outcome, SegmentAnswer};

/// A line that is not an answer.
#[derive(Debug, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct AnswersError {
    /// Counted from 1.
    pub line: usize,
    pub problem: serde_json::Error,
}

impl Answers {
    /// The answers as JSON Lines.
    pub fn to_jsonl(&self) -> String {
        self.segments.iter().map(SegmentAnswer::to_jsonl).collect()
    }

    /// Reads JSON Lines; blank lines are skipped.
    pub fn from_jsonl(text: &str) -> Result<Self, AnswersError> {
        let lines = (1..).zip(text.lines()).filter(|(_, text)| !text.trim().is_empty());
        let segments = lines
            .map(|(line, text)| serde_json::from_str(text).map_err(|problem| AnswersError { line, problem }))
            .collect::<Result<_, _>>()?;
        Ok(Self { segments })
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
