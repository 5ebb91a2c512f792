//! The other side of an export, for a program that hands the questions on: the questions read back, and answers written where
//! an import finds them.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use super::{
    ANSWERS, AnswerLine, ExchangeError, FORMAT, MANIFEST, Manifest, ORIGINS, OriginLine, QUERIES, QuestionId,
    QuestionLine, files, json, origins, push_line, read, write,
};
use crate::files::write::Folder;

/// Questions that were exported, in their order.
#[derive(Debug, Default)]
pub struct Exported {
    pub questions: Vec<ExportedQuestion>,
    /// Prompts with the schemas of their answers.
    pub texts: Vec<(String, Value)>,
    pub origins: Origins,
}

/// A question that was exported.
#[derive(Debug)]
pub struct ExportedQuestion {
    /// Its name.
    pub query: String,
    /// Index of its prompt and schema.
    pub text: usize,
    pub jpeg: Vec<u8>,
}

/// What each question was asked about.
#[derive(Debug, Default, Clone)]
pub struct Origins(BTreeMap<String, QuestionId>);

impl Origins {
    pub fn has(&self, query: &str) -> bool {
        self.0.contains_key(query)
    }

    pub fn extend(&mut self, more: Self) {
        self.0.extend(more.0);
    }
}

/// The questions in a folder that [`super::export`] wrote.
///
/// # Errors
/// If the folder is not whole.
pub fn exported(folder: &Path) -> Result<Exported, ExchangeError> {
    let mut exported = Exported { origins: Origins(origins(&folder.join(ORIGINS))?), ..Exported::default() };
    let mut files: Vec<[String; 2]> = Vec::new();
    let path = folder.join(QUERIES);
    for (line, text) in (1..).zip(read(&path)?.lines()) {
        let broken =
            |error: serde_json::Error| ExchangeError::Broken { path: path.clone(), line, problem: error.to_string() };
        let QuestionLine { query, sheet, prompt, schema } = json::read(text.as_bytes()).map_err(broken)?;
        let of_text = [prompt.to_owned(), schema.to_owned()];
        let text = match files.iter().position(|known| *known == of_text) {
            Some(known) => known,
            None => {
                let schema = json::read(read(&folder.join(schema))?.as_bytes()).map_err(broken)?;
                exported.texts.push((read(&folder.join(prompt))?, schema));
                files.push(of_text);
                files.len() - 1
            }
        };
        let sheet = folder.join(sheet);
        let jpeg = files::read(&sheet).map_err(|source| ExchangeError::Unreadable { path: sheet, source })?;
        exported.questions.push(ExportedQuestion { query: query.to_owned(), text, jpeg });
    }
    Ok(exported)
}

/// Writes answers by somebody of this name into an empty folder, as the form saves them. Questions that are not among the
/// origins are left to the import, which refuses them.
///
/// # Errors
/// If the folder cannot be written.
pub fn write_answers(
    folder: &Path,
    name: &str,
    answers: &[(&str, &Value)],
    known: &Origins,
) -> Result<(), ExchangeError> {
    let unwritable = |source| ExchangeError::Unwritable { path: folder.into(), source };
    let into = Folder::open(folder).map_err(unwritable)?;
    let (mut lines, mut origins, mut manifest) = (String::new(), String::new(), String::new());
    for (query, answer) in answers {
        let (model, answer) = (Some(name.to_owned()), (*answer).clone());
        push_line(&mut lines, &AnswerLine { query: (*query).to_owned(), answer, model, by_hand: true });
        if let Some(asked) = known.0.get(*query) {
            push_line(&mut origins, &OriginLine { query: (*query).to_owned(), asked: asked.clone() });
        }
    }
    push_line(&mut manifest, &Manifest { format: FORMAT, model: None, queries: answers.len() });
    write(&into, ANSWERS, lines.as_bytes())?;
    write(&into, ORIGINS, origins.as_bytes())?;
    write(&into, MANIFEST, manifest.as_bytes())
}
