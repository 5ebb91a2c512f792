//! The prompt templates and schemas: the built-in ones of the crate's `prompts/` folder, or the user's.
//!
//! A template is plain text with named placeholders (`{{ picture }}`); a placeholder that gprop does not know is an
//! error, so that a misspelt one cannot be sent as text.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use minijinja::{Environment, UndefinedBehavior, context};
use serde_json::Value;

use super::sheet::Context;
use crate::files;
use crate::files::json;
use crate::query::recorded::sha256::Sha256Hex;

/// All texts that are sent to the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Prompts {
    part: String,
    segment: String,
    family: String,
    correction: String,
    picture_global_local: String,
    picture_local: String,
    part_schema: Value,
    /// That of the file, from which [`Self::part_schema`] leaves out the alternatives.
    follow_up_schema: Value,
    segment_schema: Value,
    family_schema: Value,
    size: String,
    size_schema: Value,
    object: String,
    object_schema: Value,
    direct: String,
    direct_schema: Value,
}

/// A prompt file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PromptError {
    #[error("cannot read the prompt file {path:?}: {source}")]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("prompt file {file}: {problem}; it may use only the placeholders of the built-in file of that name")]
    Template { file: String, problem: String },
    #[error("prompt file {file} is not a JSON schema: {problem}")]
    Schema { file: String, problem: String },
    #[error("there is no prompt folder {0:?}: give --prompts a folder with files named like the built-in ones")]
    NoFolder(PathBuf),
    #[error(
        "--prompts {0:?} has no file named like a built-in one (part.txt, family.txt, ...), so it would change nothing"
    )]
    NoFile(PathBuf),
}

const PART: &str = "part.txt";
const SEGMENT: &str = "segment.txt";
const PART_SCHEMA: &str = "answer.schema.json";
const SEGMENT_SCHEMA: &str = "segment.schema.json";
const FAMILY: &str = "family.txt";
const CORRECTION: &str = "correction.txt";
const SIZE: &str = "size.txt";
const PICTURE_GLOBAL_LOCAL: &str = "picture_global_local.txt";
const PICTURE_LOCAL: &str = "picture_local.txt";
const SIZE_SCHEMA: &str = "size.schema.json";
const OBJECT: &str = "object.txt";
const OBJECT_SCHEMA: &str = "object.schema.json";
const DIRECT: &str = "direct.txt";
const DIRECT_SCHEMA: &str = "direct.schema.json";

impl Prompts {
    /// The built-in prompts.
    pub fn builtin() -> Self {
        Self::read(&|_| None).expect("a test renders every built-in prompt")
    }

    /// The prompts of a folder; a file that is missing there is replaced by the built-in one.
    pub fn from_folder(folder: &Path) -> Result<Self, PromptError> {
        if !folder.is_dir() {
            return Err(PromptError::NoFolder(folder.into()));
        }
        let found = Cell::new(false);
        let prompts = Self::read(&|name| {
            let path = folder.join(name);
            path.exists().then(|| {
                found.set(true);
                files::read_to_string(&path).map_err(|source| PromptError::Unreadable { path: path.clone(), source })
            })
        })?;
        if found.get() { Ok(prompts) } else { Err(PromptError::NoFile(folder.into())) }
    }

    fn read(own_text: &dyn Fn(&str) -> Option<Result<String, PromptError>>) -> Result<Self, PromptError> {
        let text = |name: &str, builtin: &str| own_text(name).unwrap_or_else(|| Ok(builtin.to_owned()));
        let json = |name: &str, builtin: &str| {
            let text = text(name, builtin)?;
            json::read(text.as_bytes())
                .map_err(|error| PromptError::Schema { file: name.into(), problem: error.to_string() })
        };
        let follow_up_schema: Value = json(PART_SCHEMA, include_str!("../../../prompts/answer.schema.json"))?;
        let prompts = Self {
            part: text(PART, include_str!("../../../prompts/part.txt"))?,
            segment: text(SEGMENT, include_str!("../../../prompts/segment.txt"))?,
            family: text(FAMILY, include_str!("../../../prompts/family.txt"))?,
            correction: text(CORRECTION, include_str!("../../../prompts/correction.txt"))?,
            picture_global_local: text(
                PICTURE_GLOBAL_LOCAL,
                include_str!("../../../prompts/picture_global_local.txt"),
            )?,
            picture_local: text(PICTURE_LOCAL, include_str!("../../../prompts/picture_local.txt"))?,
            part_schema: without_alternatives(follow_up_schema.clone()),
            follow_up_schema,
            segment_schema: json(SEGMENT_SCHEMA, include_str!("../../../prompts/segment.schema.json"))?,
            family_schema: json("family.schema.json", include_str!("../../../prompts/family.schema.json"))?,
            size: text(SIZE, include_str!("../../../prompts/size.txt"))?,
            size_schema: json(SIZE_SCHEMA, include_str!("../../../prompts/size.schema.json"))?,
            object: text(OBJECT, include_str!("../../../prompts/object.txt"))?,
            object_schema: json(OBJECT_SCHEMA, include_str!("../../../prompts/object.schema.json"))?,
            direct: text(DIRECT, include_str!("../../../prompts/direct.txt"))?,
            direct_schema: json(DIRECT_SCHEMA, include_str!("../../../prompts/direct.schema.json"))?,
        };
        prompts.part(Context::GlobalLocal, "", "")?;
        prompts.follow_up(Context::GlobalLocal, "", "")?;
        prompts.segment(Context::GlobalLocal, "")?;
        prompts.family(Context::GlobalLocal, "")?;
        prompts.correction("")?;
        prompts.object("", "")?;
        check_plain(SIZE, &prompts.size)?;
        check_plain(DIRECT, &prompts.direct)?;
        check_plain(PICTURE_GLOBAL_LOCAL, &prompts.picture_global_local)?;
        check_plain(PICTURE_LOCAL, &prompts.picture_local)?;
        Ok(prompts)
    }

    /// The question for a part's material, properties and contents, with `candidates` and `fillings` to choose from.
    pub fn part(&self, context: Context, candidates: &str, fillings: &str) -> Result<String, PromptError> {
        self.about_part(context, candidates, fillings, false)
    }

    /// As [`Self::part`], for a question that follows the one about the whole object: what else the part may be made of is asked for,
    /// too, if the schema has it.
    pub fn follow_up(&self, context: Context, candidates: &str, fillings: &str) -> Result<String, PromptError> {
        self.about_part(context, candidates, fillings, self.follow_up_schema != self.part_schema)
    }

    fn about_part(
        &self,
        context: Context,
        candidates: &str,
        fillings: &str,
        alternatives: bool,
    ) -> Result<String, PromptError> {
        let picture = self.picture(context);
        render(PART, &self.part, context! { picture, candidates, fillings, alternatives })
    }

    /// The question for a segment's material and properties, with `candidates` to choose from.
    pub fn segment(&self, context: Context, candidates: &str) -> Result<String, PromptError> {
        let picture = self.picture(context);
        render(SEGMENT, &self.segment, context! { picture, candidates })
    }

    /// The question for the family of a part or segment, with `candidates` to choose from.
    pub fn family(&self, context: Context, candidates: &str) -> Result<String, PromptError> {
        let picture = self.picture(context);
        render(FAMILY, &self.family, context! { picture, candidates })
    }

    /// The question for the size of the object.
    pub fn size(&self) -> &str {
        &self.size
    }

    /// The schema of an answer to [`Self::size`], with its file's name.
    pub fn size_schema(&self) -> (&'static str, &Value) {
        (SIZE_SCHEMA, &self.size_schema)
    }

    /// The question for what the object is and what its pieces are made of, with `families` and `fillings` to choose from.
    pub fn object(&self, families: &str, fillings: &str) -> Result<String, PromptError> {
        render(OBJECT, &self.object, context! { families, fillings })
    }

    /// The schema of an answer to [`Self::object`], with its file's name.
    pub fn object_schema(&self) -> (&'static str, &Value) {
        (OBJECT_SCHEMA, &self.object_schema)
    }

    /// The question for the mass of the object.
    pub fn direct(&self) -> &str {
        &self.direct
    }

    /// The schema of an answer to [`Self::direct`], with its file's name.
    pub fn direct_schema(&self) -> (&'static str, &Value) {
        (DIRECT_SCHEMA, &self.direct_schema)
    }

    /// The message that asks the model to correct an answer.
    pub fn correction(&self, reason: &str) -> Result<String, PromptError> {
        render(CORRECTION, &self.correction, context! { reason })
    }

    /// The schema of an answer to [`Self::part`], with its file's name.
    pub fn part_schema(&self) -> (&'static str, &Value) {
        (PART_SCHEMA, &self.part_schema)
    }

    /// The schema of an answer to [`Self::follow_up`], with its file's name.
    pub fn follow_up_schema(&self) -> (&'static str, &Value) {
        (PART_SCHEMA, &self.follow_up_schema)
    }

    /// The schema of an answer to [`Self::segment`], with its file's name.
    pub fn segment_schema(&self) -> (&'static str, &Value) {
        (SEGMENT_SCHEMA, &self.segment_schema)
    }

    /// The schema of an answer to [`Self::family`], as in the file.
    pub fn family_schema(&self) -> &Value {
        &self.family_schema
    }

    /// A hash that changes whenever any text sent to the model changes.
    pub fn sha256(&self) -> Sha256Hex {
        Sha256Hex::of_fields(&[
            self.part.as_bytes(),
            self.segment.as_bytes(),
            self.family.as_bytes(),
            self.correction.as_bytes(),
            self.picture_global_local.as_bytes(),
            self.picture_local.as_bytes(),
            self.follow_up_schema.to_string().as_bytes(),
            self.segment_schema.to_string().as_bytes(),
            self.family_schema.to_string().as_bytes(),
            self.size.as_bytes(),
            self.size_schema.to_string().as_bytes(),
            self.object.as_bytes(),
            self.object_schema.to_string().as_bytes(),
        ])
    }

    fn picture(&self, context: Context) -> &str {
        match context {
            Context::GlobalLocal => self.picture_global_local.trim(),
            Context::Local => self.picture_local.trim(),
        }
    }
}

/// The schema of an answer about a part that names one material only.
fn without_alternatives(mut schema: Value) -> Value {
    const NAME: &str = "alternatives";
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        properties.shift_remove(NAME);
    }
    if let Some(required) = schema.get_mut("required").and_then(Value::as_array_mut) {
        required.retain(|name| name != NAME);
    }
    schema
}

/// Checks that a text, which is sent as it is, has no placeholder, comment or statement of a template.
fn check_plain(file: &str, text: &str) -> Result<(), PromptError> {
    match render(file, text, context! {})? {
        rendered if rendered.trim() == text.trim() => Ok(()),
        _ => Err(PromptError::Template { file: file.into(), problem: "it is sent as it is, not as a template".into() }),
    }
}

fn render(file: &str, template: &str, values: minijinja::Value) -> Result<String, PromptError> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment
        .render_str(template, values)
        .map_err(|error| PromptError::Template { file: file.into(), problem: error.to_string() })
}
