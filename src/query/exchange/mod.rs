//! Exports questions and imports answers: for people, batch services, and models that no server offers.
//!
//! An export is a folder with one sheet per question, the prompts, the schemas, and a form to fill in ([`form`]).
//! Questions and sheets are named by hash, so that whoever answers knows only the picture and the prompt.
//! `origins.jsonl` says what each answer belongs to. An import checks the answers with the library, prompts and options
//! of the scene.

mod filled;
mod form;
pub mod read_back;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::files;
use crate::files::json;
use crate::files::write::Folder;
use crate::materials::MaterialLibrary;
use crate::query::answer::{Problem, Unknown};
use crate::query::ask::queries::Queries;
use crate::query::question::Question;
use crate::query::question::shown_subject::ShownSubject;
use crate::query::recorded::{Answerer, QuestionId, Recording, RecordingError, Recordings};
use form::FormQuestion;
pub use form::{Form, Served};

const QUERIES: &str = "queries.jsonl";
const ANSWERS: &str = "answers.jsonl";
const ORIGINS: &str = "origins.jsonl";
const MANIFEST: &str = "manifest.json";
const FORM: &str = "form.html";
const FORMAT: u32 = 1;

/// A line of `queries.jsonl`; file names are relative to the folder.
#[derive(Debug, Serialize, Deserialize)]
struct QuestionLine<'a> {
    query: &'a str,
    sheet: &'a str,
    prompt: &'a str,
    schema: &'a str,
}

/// A line of `answers.jsonl`.
#[derive(Debug, Serialize, Deserialize)]
struct AnswerLine {
    query: String,
    /// The answer as an object, or a model's whole response as a string; null if there is none yet.
    answer: Value,
    /// Who answered, if different from the manifest's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    /// True if a person answered, by that name; the form says so.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    by_hand: bool,
}

/// A line of `origins.jsonl`.
#[derive(Debug, Serialize, Deserialize)]
struct OriginLine {
    query: String,
    asked: QuestionId,
}

#[derive(Debug, Serialize, Deserialize)]
struct Manifest {
    format: u32,
    /// Who answered.
    model: Option<String>,
    queries: usize,
}

/// The result of an import.
#[derive(Debug, Default, PartialEq, Serialize)]
pub struct Imported {
    pub recorded: usize,
    /// How many of these a person gave, as the form says.
    pub by_hand: usize,
    /// Questions of the folder for which nothing was recorded.
    pub unanswered: usize,
    /// The lines that were not recorded, with the reasons.
    pub bad: Vec<BadLine>,
}

/// A line of `answers.jsonl` that cannot be used.
#[derive(Debug, PartialEq, Serialize)]
pub struct BadLine {
    /// Counted from 1.
    pub line: usize,
    pub problem: String,
}

impl std::fmt::Display for BadLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{ANSWERS} line {}: {}", self.line, self.problem)
    }
}

/// Why a folder cannot be written or read as a whole.
#[derive(Debug, thiserror::Error)]
pub enum ExchangeError {
    #[error("{0:?} is not empty: export into a new folder, so that no answers are overwritten")]
    NotEmpty(PathBuf),
    #[error("cannot write {path:?}: {source}; make room, or export into another folder")]
    Unwritable { path: PathBuf, source: std::io::Error },
    #[error("cannot read {path:?}: {source}; --import takes a folder that --export wrote")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{path:?} line {line}: {problem}; export the questions again")]
    Broken { path: PathBuf, line: usize, problem: String },
    #[error("{path:?}: {problem}; export the questions again")]
    Manifest { path: PathBuf, problem: String },
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// Writes questions into a new or empty folder; returns their number. `part_of` is that of [`Form::add`].
pub fn export(
    folder: &Path,
    open: &[(&ShownSubject, &Question)],
    library: &MaterialLibrary,
    part_of: &dyn Fn(&ShownSubject) -> (usize, u16),
) -> Result<usize, ExchangeError> {
    if fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(ExchangeError::NotEmpty(folder.into()));
    }
    let folder = &Folder::open(folder).map_err(|source| ExchangeError::Unwritable { path: folder.into(), source })?;
    let mut form = Form::default();
    form.add(open, part_of);
    for (index, text) in form.texts().iter().enumerate() {
        let [prompt, schema] = text_files(index);
        write(folder, &prompt, text.prompt.as_bytes())?;
        write(folder, &schema, format!("{:#}\n", text.schema).as_bytes())?;
    }
    let (mut queries, mut answers, mut origins) = (String::new(), String::new(), String::new());
    for FormQuestion { query, sheet, text, asked, jpeg, .. } in form.questions() {
        write(folder, sheet, jpeg)?;
        let [prompt, schema] = &text_files(*text);
        push_line(&mut queries, &QuestionLine { query, sheet, prompt, schema });
        let open = AnswerLine { query: query.clone(), answer: Value::Null, model: None, by_hand: false };
        push_line(&mut answers, &open);
        push_line(&mut origins, &OriginLine { query: query.clone(), asked: asked.clone() });
    }
    let mut manifest = String::new();
    push_line(&mut manifest, &Manifest { format: FORMAT, model: None, queries: form.questions().len() });
    let page = form.page(library, None);
    let readme = include_str!("../../../prompts/export_readme.txt");
    let files = [
        (QUERIES, &*queries),
        (ANSWERS, &answers),
        (ORIGINS, &origins),
        (MANIFEST, &manifest),
        (FORM, &page),
        ("README.txt", readme),
    ];
    for (name, text) in files {
        write(folder, name, text.as_bytes())?;
    }
    Ok(form.questions().len())
}

/// The names of the files with the prompt and the schema of this index.
fn text_files(index: usize) -> [String; 2] {
    let suffix = if index == 0 { String::new() } else { format!("-{}", index + 1) };
    [format!("prompt{suffix}.txt"), format!("answer{suffix}.schema.json")]
}

/// Checks the answers of a folder and records the valid ones; every bad line is reported with its number.
///
/// The answering model is `model`, or else the one that the line or the manifest names. An answer by a person keeps the name
/// on its line. `queries` have the questions of the
/// library, prompts and options that the scene will be run with; an answer to any other question cannot be checked and
/// is a bad line.
pub fn import(
    folder: &Path,
    model: Option<&str>,
    queries: &Queries,
    recordings: &Recordings,
) -> Result<Imported, ExchangeError> {
    let manifest: Manifest = {
        let path = folder.join(MANIFEST);
        let problem = |problem: String| ExchangeError::Manifest { path: path.clone(), problem };
        let manifest: Manifest = json::read(read(&path)?.as_bytes()).map_err(|error| problem(error.to_string()))?;
        if manifest.format != FORMAT {
            return Err(problem(format!("its format is {}, but this gprop reads {FORMAT}", manifest.format)));
        }
        manifest
    };
    let origins = origins(&folder.join(ORIGINS))?;
    let mut imported = Imported::default();
    let mut seen = BTreeMap::new();
    for (line, text) in (1..).zip(read(&folder.join(ANSWERS))?.lines()).filter(|(_, text)| !text.trim().is_empty()) {
        let checked = parse(text).and_then(|answer| {
            if answer.answer.is_null() {
                return Ok(None);
            }
            if let Some(&earlier) = seen.get(&answer.query) {
                return Err(LineProblem::Again { query: answer.query, earlier });
            }
            let query = answer.query.clone();
            let of_line = answer.model.as_deref();
            let named = if answer.by_hand { of_line.or(model) } else { model.or(of_line) };
            let named = named.or(manifest.model.as_deref()).map(str::to_owned);
            let recording = check(answer, named, origins.get(&query), queries)?;
            seen.insert(query, line);
            Ok(Some(recording))
        });
        match checked {
            Ok(None) => {}
            Ok(Some(recording)) => {
                recordings.insert(&recording)?;
                imported.recorded += 1;
                imported.by_hand += usize::from(recording.is_by_hand());
            }
            Err(problem) => imported.bad.push(BadLine { line, problem: problem.to_string() }),
        }
    }
    imported.unanswered = origins.len() - imported.recorded;
    Ok(imported)
}

/// Checks an answer to a question of the form, a line as those of an export, and records it as one that a person gave.
///
/// # Errors
/// The problem with the line, in words; or a recording that cannot be written.
pub fn record(
    line: &[u8],
    form: &Form,
    queries: &Queries,
    recordings: &Recordings,
) -> Result<Result<(), String>, RecordingError> {
    let text = String::from_utf8_lossy(line);
    let checked = parse(&text).and_then(|answer| {
        let (model, asked) = (answer.model.clone(), form.asked(&answer.query));
        check(AnswerLine { by_hand: true, ..answer }, model, asked, queries)
    });
    match checked {
        Ok(recording) => recordings.insert(&recording).map(Ok),
        Err(problem) => Ok(Err(problem.to_string())),
    }
}

/// The error in a line of `answers.jsonl`.
#[derive(Debug, thiserror::Error)]
enum LineProblem {
    #[error("{0}")]
    Json(#[from] serde_json::Error),
    #[error("question {query} is already answered on line {earlier}")]
    Again { query: String, earlier: usize },
    #[error("there is no question {0:?}")]
    NoQuery(String),
    #[error("it does not say who answered: write the name after \"model\" in {MANIFEST}")]
    NoModel,
    #[error(
        "it was asked with prompts, a library or options that differ from this run's; import with the options of the export, or export again"
    )]
    OtherQuestion,
    /// An explanation that lets the answer be corrected.
    #[error("{0}")]
    Answer(String),
}

fn parse(text: &str) -> Result<AnswerLine, LineProblem> {
    Ok(json::read(text.as_bytes())?)
}

/// The recording of a line's answer, if the line is valid.
fn check(
    line: AnswerLine,
    model: Option<String>,
    asked: Option<&QuestionId>,
    queries: &Queries,
) -> Result<Recording, LineProblem> {
    let asked = asked.ok_or(LineProblem::NoQuery(line.query))?;
    let model = model.filter(|model| !model.trim().is_empty()).ok_or(LineProblem::NoModel)?;
    let response = match line.answer {
        Value::String(text) => text,
        answer => answer.to_string(),
    };
    let checked = queries.check(asked, &response, Unknown::Refuse).ok_or(LineProblem::OtherQuestion)?;
    checked.map_err(|Problem { reason, .. }| LineProblem::Answer(reason))?;
    let answerer = if line.by_hand { Answerer::person(model) } else { Answerer { model, parameters: Value::Null } };
    Ok(Recording::new(&answerer, asked.clone(), response, None, None))
}

fn origins(path: &Path) -> Result<BTreeMap<String, QuestionId>, ExchangeError> {
    (1..)
        .zip(read(path)?.lines())
        .map(|(line, text)| {
            let origin: OriginLine = json::read(text.as_bytes()).map_err(|error| ExchangeError::Broken {
                path: path.into(),
                line,
                problem: error.to_string(),
            })?;
            Ok((origin.query, origin.asked))
        })
        .collect()
}

fn push_line(text: &mut String, value: &impl Serialize) {
    text.push_str(&json::compact(value).expect("lines have string keys and finite numbers"));
    text.push('\n');
}

fn read(path: &Path) -> Result<String, ExchangeError> {
    files::read_to_string(path).map_err(|source| ExchangeError::Unreadable { path: path.into(), source })
}

fn write(folder: &Folder, name: &str, bytes: &[u8]) -> Result<(), ExchangeError> {
    let written = folder.write(Path::new(name), |out| out.write_all(bytes));
    written.map_err(|source| ExchangeError::Unwritable { path: folder.path().join(name), source })
}
