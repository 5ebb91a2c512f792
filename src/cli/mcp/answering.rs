//! Questions for the model that uses the tools, and its answers: `gprop query --export` and `--import`, checked and recorded like
//! those of a person.

use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::sync::{MutexGuard, PoisonError};

use serde_json::{Map, Value, json};

use crate::files::json;
use crate::mcp::{Call, Content, Finished, Outcome};
use crate::query::exchange::ExchangeError;
use crate::query::exchange::read_back::{Exported, Origins, exported, write_answers};

use super::words::Words;
use super::{Commands, failed, is_done, message_of, outcome};

/// Questions in one result: with their pictures, as much as a model looks at carefully at once.
const MOST_QUESTIONS: usize = 6;

/// Why there is no result.
enum Problem {
    /// The command that failed.
    Ended(io::Result<Finished>),
    Exchange(ExchangeError),
}

impl From<ExchangeError> for Problem {
    fn from(error: ExchangeError) -> Self {
        Self::Exchange(error)
    }
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Self::Ended(Err(error))
    }
}

impl Problem {
    fn outcome(self) -> Outcome {
        match self {
            Self::Ended(ended) => outcome(ended),
            Self::Exchange(error) => failed(vec![Content::Text(error.to_string())]),
        }
    }
}

impl Commands {
    /// The open questions with their pictures.
    pub fn questions(&self, words: &Words, arguments: &Map<String, Value>, call: &Call) -> Outcome {
        let most = arguments.get("most").and_then(Value::as_u64).map_or(MOST_QUESTIONS, |most| most as usize);
        self.open(words, call).map_or_else(Problem::outcome, |open| shown(open, most))
    }

    /// Records answers, and says what is open then and how the mass stands.
    pub fn answers(&self, words: &Words, arguments: &Map<String, Value>, call: &Call) -> Outcome {
        let name = arguments.get("name").and_then(Value::as_str).unwrap_or_default();
        let answers = arguments.get("answers").and_then(Value::as_array).into_iter().flatten();
        let answers: Vec<(&str, &Value)> =
            answers.filter_map(|one| Some((one.get("query")?.as_str()?, one.get("answer")?))).collect();
        self.record(words, name, &answers, call).unwrap_or_else(Problem::outcome)
    }

    fn record(&self, words: &Words, name: &str, answers: &[(&str, &Value)], call: &Call) -> Result<Outcome, Problem> {
        if !answers.iter().all(|(query, _)| self.origins().has(query)) {
            // They may have been asked before the server was started again.
            self.open(words, call)?;
        }
        let folder = tempfile::tempdir()?;
        let known = self.origins().clone();
        write_answers(folder.path(), name, answers, &known)?;
        let ended = self.run(words, &[flag("--import=", folder.path())], call)?;
        let Ok(mut imported) = json::read::<Value>(ended.stdout.as_bytes()) else {
            return Err(Problem::Ended(Ok(ended)));
        };
        let bad = imported.get_mut("bad").map(Value::take).unwrap_or_default();
        let refused = bad.as_array().into_iter().flatten().map(|line| {
            let (query, _) = answers[(line["line"].as_u64().unwrap_or(1) as usize).clamp(1, answers.len()) - 1];
            json!({ "query": query, "problem": line["problem"] })
        });
        let refused: Vec<Value> = refused.collect();
        let is_error = imported["recorded"] == 0;
        let open = self.open(words, call)?.questions.len();
        let mut standing = json!({ "recorded": imported["recorded"], "refused": refused, "open": open });
        self.weigh(words, call, &mut standing)?;
        let text = json::pretty(&standing).expect("it is plain data");
        Ok(Outcome { content: vec![Content::Text(text)], is_error })
    }

    /// The mass on the answers so far, or why there is none.
    fn weigh(&self, words: &Words, call: &Call, standing: &mut Value) -> Result<(), Problem> {
        let parts = self.run(&words.with_command("parts"), &["--answers=partial".into()], call)?;
        if !parts.code.is_some_and(is_done) {
            standing["mass_kg"] = Value::Null;
            standing["no_mass"] = message_of(&parts).into();
            return Ok(());
        }
        let found: Value = json::read(parts.stdout.as_bytes()).unwrap_or_default();
        standing["mass_kg"] = found["object"]["mass_kg"].clone();
        Ok(())
    }

    /// The questions that have no answer.
    fn open(&self, words: &Words, call: &Call) -> Result<Exported, Problem> {
        let folder = tempfile::tempdir()?;
        let ended = self.run(words, &[flag("--export=", folder.path())], call)?;
        if !ended.code.is_some_and(is_done) {
            return Err(Problem::Ended(Ok(ended)));
        }
        let open = exported(folder.path())?;
        self.origins().extend(open.origins.clone());
        Ok(open)
    }

    fn origins(&self) -> MutexGuard<'_, Origins> {
        self.origins.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn flag(name: &str, folder: &Path) -> OsString {
    let mut text = OsString::from(name);
    text.push(folder);
    text
}

/// The first questions: their texts as JSON, then each picture after the name of its question.
fn shown(open: Exported, most: usize) -> Outcome {
    let Exported { questions, texts, .. } = open;
    let texts: Vec<Value> =
        texts.into_iter().map(|(prompt, schema)| json!({ "prompt": prompt, "schema": schema })).collect();
    let count = questions.len();
    let shown: Vec<_> = questions.into_iter().take(most).collect();
    let listed: Vec<Value> =
        shown.iter().map(|question| json!({ "query": question.query, "text": question.text })).collect();
    let about = json!({ "open": count, "questions": listed, "texts": texts });
    let mut content = vec![Content::Text(json::pretty(&about).expect("it is plain data"))];
    for question in shown {
        content.push(Content::Text(format!("The picture of question {}:", question.query)));
        content.push(Content::Jpeg(question.jpeg));
    }
    Outcome { content, is_error: false }
}
