//! The questions about every subject: one prompt and schema, or a chain of two.
//!
//! Prompts and schemas do not depend on the subject (only the picture does), so servers that cache the beginning of a
//! request process the long list of materials once.

pub(super) mod prompt;
pub mod schema;
pub mod sheet;
pub(super) mod shown_subject;

use std::collections::BTreeMap;

use super::Answer;
use super::answer::{self, Problem, Unknown};
use super::options::{Context, Guidance};
use super::recorded::QuestionId;
use crate::consensus::AskAbout;
use crate::materials::MaterialLibrary;
use crate::materials::fillings::FillingKind;
use crate::query::question::prompt::{PromptError, Prompts};
use crate::query::question::schema::Schema;
use crate::query::recorded::sha256::Sha256Hex;

/// One prompt with the schema of its answer.
#[derive(Debug)]
pub struct Question {
    pub prompt: String,
    pub prompt_sha256: Sha256Hex,
    pub schema: Schema,
    /// Tokens of an answer of the usual length.
    pub usual_tokens: u64,
}

/// Tokens of an answer about a part, with nineteen fields.
const TOKENS_OF_PART: u64 = 370;
/// The same with two alternatives to the material.
const TOKENS_OF_FOLLOW_UP: u64 = 480;
/// Tokens of an answer that names a thing, its clues and a range.
pub(super) const TOKENS_OF_GUESS: u64 = 100;

impl Question {
    /// The question with this prompt, whose answers follow `schema` and are as long as those about a part.
    pub fn new(prompt: String, schema: Schema) -> Self {
        Self { prompt_sha256: Sha256Hex::of(&prompt), prompt, schema, usual_tokens: TOKENS_OF_PART }
    }

    /// The same, with answers that usually have this many tokens.
    pub fn answered_in(self, usual_tokens: u64) -> Self {
        Self { usual_tokens, ..self }
    }

    /// True if this is what was asked.
    pub fn is(&self, asked: &QuestionId) -> bool {
        self.prompt_sha256 == asked.prompt_sha256 && *self.schema.sha256() == asked.schema_sha256
    }
}

/// The first question and those that may follow it.
#[derive(Debug)]
pub struct Questions {
    first: Question,
    /// If the first question asks for the family, the question about the materials of each family; otherwise empty.
    by_family: BTreeMap<String, Question>,
}

/// The result of a valid response.
pub enum Reading<'a> {
    Answered(Box<Answer>),
    Next(&'a Question),
}

impl Questions {
    /// The questions for a library, with the given prompts. About [`AskAbout::Object`], they are those about a single part that follow
    /// the one about the object.
    pub fn new(
        prompts: &Prompts,
        library: &MaterialLibrary,
        guidance: Guidance,
        context: Context,
        about: AskAbout,
    ) -> Result<Self, PromptError> {
        let families: Vec<&str> = library.families().iter().map(|family| family.name.as_str()).collect();
        match guidance {
            Guidance::OneQuestion => {
                Ok(Self { first: material(prompts, library, &families, context, about)?, by_family: BTreeMap::new() })
            }
            Guidance::FamilyFirst => {
                let schema = Schema::new("family.schema.json", prompts.family_schema().clone(), &families, &[])?;
                let prompt = prompts.family(context, &families.join("; "))?;
                let by_family = families
                    .iter()
                    .map(|family| Ok(((*family).to_owned(), material(prompts, library, &[family], context, about)?)))
                    .collect::<Result<_, PromptError>>()?;
                Ok(Self { first: Question::new(prompt, schema), by_family })
            }
        }
    }

    /// The first question about every subject.
    pub fn first(&self) -> &Question {
        &self.first
    }

    /// The longest chain of questions that a subject may need.
    pub fn longest_chain(&self) -> Vec<&Question> {
        let longest = self.by_family.values().max_by_key(|question| question.prompt.len());
        std::iter::once(&self.first).chain(longest).collect()
    }

    /// Every question that may be asked about a subject.
    pub fn all(&self) -> impl Iterator<Item = &Question> {
        std::iter::once(&self.first).chain(self.by_family.values())
    }

    /// The question that was asked, if it is one of these.
    pub fn find(&self, asked: &QuestionId) -> Option<&Question> {
        self.all().find(|question| question.is(asked))
    }

    /// Reads a response to `question`.
    pub fn read(
        &self,
        question: &Question,
        response: &str,
        library: &MaterialLibrary,
        unknown: Unknown,
    ) -> Result<Reading<'_>, Problem> {
        let value = question.schema.check(response).map_err(|problem| Problem::invalid(problem.to_string()))?;
        if self.by_family.is_empty() || question.prompt_sha256 != self.first.prompt_sha256 {
            return answer::read(value, library, unknown).map(|answer| Reading::Answered(Box::new(answer)));
        }
        let family = value["family"].as_str().unwrap_or_default();
        let next = self.by_family.get(family);
        next.map(Reading::Next).ok_or_else(|| Problem::invalid(format!("there is no family {family:?}.")))
    }
}

fn material(
    prompts: &Prompts,
    library: &MaterialLibrary,
    families: &[&str],
    context: Context,
    about: AskAbout,
) -> Result<Question, PromptError> {
    let candidates: Vec<String> = families
        .iter()
        .map(|family| {
            let names: Vec<&str> = library.of_family(family).map(|material| material.name.as_str()).collect();
            format!("{family}: {}", names.join("; "))
        })
        .collect();
    let candidates = candidates.join("\n");
    let named = by_kind(library);
    let (prompt, (file, schema), tokens) = match about {
        AskAbout::Object => {
            (prompts.follow_up(context, &candidates, &named)?, prompts.follow_up_schema(), TOKENS_OF_FOLLOW_UP)
        }
        AskAbout::Parts => (prompts.part(context, &candidates, &named)?, prompts.part_schema(), TOKENS_OF_PART),
        AskAbout::Segments => (prompts.segment(context, &candidates)?, prompts.segment_schema(), TOKENS_OF_PART),
    };
    let fillings: Vec<&str> = library.fillings().iter().map(|filling| filling.name.as_str()).collect();
    Ok(Question::new(prompt, Schema::new(file, schema.clone(), families, &fillings)?).answered_in(tokens))
}

/// The names of the fillings, one line for each kind.
pub(super) fn by_kind(library: &MaterialLibrary) -> String {
    let line = |kind: FillingKind| {
        let of_kind = library.fillings().iter().filter(|filling| filling.kind == kind);
        let names: Vec<&str> = of_kind.map(|filling| filling.name.as_str()).collect();
        (!names.is_empty()).then(|| format!("{}: {}", kind.name(), names.join("; ")))
    };
    let lines: Vec<String> = FillingKind::ALL.into_iter().filter_map(line).collect();
    lines.join("\n")
}
