//! Asks what each part or segment is made of: a sheet and a prompt for a large multimodal model, whose answers are
//! checked and recorded.
//!
//! [`ask::rounds`] decides what to ask next. [`Queries::prepare`] draws the [sheet](question::sheet)s and writes the [`question`]s.
//! [`Queries::run`] is the stage: it takes answers from the [recordings](recorded) if there are any, asks an [asker](ask::asker)
//! (the [`client`] of a server) for the rest, and checks every response against the [schema](question::schema) and the material library
//! ([`answer`]). [`exchange`] exports the questions and imports the answers of people and other programs. A [`session`] does all of
//! this for one object.

pub mod answer;
pub mod ask;
pub mod batch_api;
pub mod client;
mod error;
pub mod exchange;
mod options;
pub mod question;
pub mod recorded;
pub mod session;

pub use answer::jsonl::AnswersError;
pub use answer::labels::{LabelSet, LabelsError};
pub use answer::recognition::{Choice, Found, Hypothesis, Printed, Recognition, RecognizedPart, Unnumbered};
pub use ask::direct::DirectGuess;
pub use ask::evidence::{Alternative, GuessQuestion, ObjectAnswers, PartQuestion};
pub use ask::follow_up::{Region, Why};
pub use ask::queries::{Queries, ViewSubjects};
pub use ask::recognition::{Bare, Layout, Side};
pub use ask::run::{Preview, Run};
pub use ask::size::Size;
pub use ask::whole::{AnyWholeQuestion, Purpose, WHOLE, WholeAnswer, WholeOutcome, WholeQuestion};
pub use error::{InVain, MissingAnswer, QueryError};
pub use options::{AnswerSource, Context, Guidance, Hints, Options, SCENE_KEYS};
pub use question::prompt::{PromptError, Prompts};
pub use question::shown_subject::ShownSubject;
pub use recorded::sha256::Sha256Hex;

use serde::{Deserialize, Serialize};

use crate::consensus::AskAbout;
use crate::materials::Material;
use crate::units::{Range, ShoreHardness};

/// The subject of a question, by its id in the view's label map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SubjectId {
    /// A part of the object or a piece of one, by its part id, which is the same in all views.
    Part(u16),
    /// A segment, by its number within the view.
    Segment(u16),
}

impl SubjectId {
    /// The subject with this id if the questions are about parts or about segments.
    pub fn of(about: AskAbout, id: u16) -> Self {
        match about {
            AskAbout::Object | AskAbout::Parts => Self::Part(id),
            AskAbout::Segments => Self::Segment(id),
        }
    }

    /// The id without what it is of: the number in the names of sheets.
    pub fn number(self) -> u16 {
        let (Self::Part(id) | Self::Segment(id)) = self;
        id
    }
}

impl std::fmt::Display for SubjectId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Part(id) => write!(f, "part {id}"),
            Self::Segment(id) => write!(f, "segment {id}"),
        }
    }
}

/// The outcome of one question: about one subject in one view. A line of `answers.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SubjectAnswer {
    pub view: String,
    #[serde(flatten)]
    pub subject: SubjectId,
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// An answer, or why there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "snake_case")]
#[expect(clippy::large_enum_variant, reason = "nearly all outcomes are answers")]
pub enum Outcome {
    Answered(Answer),
    Failed(Failure),
}

/// A subject's material and properties, validated against the schema and the library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Answer {
    pub caption: String,
    pub family: String,
    /// Name of a row of the library.
    pub material: String,
    /// Density of the material; of a mixed part, its mass divided by the volume within its outer surface.
    pub density_kg_m3: Range,
    pub youngs_modulus_pa: Range,
    pub poisson_ratio: Range,
    pub yield_strength_pa: Range,
    pub hardness: Option<ShoreHardness>,
    pub friction_rubber: Range,
    pub form: Form,
    /// The contents of a shell; `None` for everything else.
    #[serde(default)]
    pub inside: Option<Inside>,
    /// Why a mixed part has the density that it has, in the model's words.
    #[serde(default)]
    pub bulk_reason: Option<String>,
    /// True if the model sees more than one material in it and answered for the one that covers most of it.
    pub several_materials: bool,
    /// 0 to 1, as the model states it.
    pub confidence: f64,
    /// What else it may be made of, the most probable first; none unless the question asked for that. Their probabilities and the
    /// confidence together are at most 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<AlternativeMaterial>,
    pub matched: Match,
    /// The corrections and doubts about the answer, in words.
    pub flags: Vec<String>,
}

/// A material of which a part may be made instead of the one that an answer names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct AlternativeMaterial {
    pub family: String,
    /// Name of a row of the library.
    pub material: String,
    /// As that of an answer.
    pub density_kg_m3: Range,
    /// Of the wall. Without it, what the answer takes for a shell would be solid if it were made of this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_thickness_m: Option<Range>,
    /// As the model states it.
    pub probability: f64,
}

/// What a part is made of, in words: "stoneware", or "stoneware (70 %) or steel, mild (20 %)" if there are alternatives.
pub fn materials_in_words(material: &str, confidence: f64, alternatives: &[AlternativeMaterial]) -> String {
    if alternatives.is_empty() {
        return material.to_owned();
    }
    let others = alternatives.iter().map(|of| (&*of.material, of.probability));
    let all = std::iter::once((material, confidence)).chain(others);
    let in_words = |(material, probability): (&str, f64)| format!("{material} ({} %)", (100.0 * probability).round());
    all.map(in_words).collect::<Vec<_>>().join(" or ")
}

impl Answer {
    /// The answer that the library gives for a solid part that consists of this material alone.
    pub fn of(material: &Material) -> Self {
        Self {
            caption: material.name.clone(),
            family: material.family.clone(),
            material: material.name.clone(),
            density_kg_m3: material.density_kg_m3,
            youngs_modulus_pa: material.youngs_modulus_pa,
            poisson_ratio: material.poisson_ratio,
            yield_strength_pa: material.strength_pa,
            hardness: material.hardness,
            friction_rubber: material.friction_rubber,
            form: Form::Solid,
            inside: None,
            bulk_reason: None,
            several_materials: false,
            confidence: 1.0,
            alternatives: Vec::new(),
            matched: Match::Live,
            flags: Vec::new(),
        }
    }
}

/// How a part's material fills it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(tag = "form", rename_all = "snake_case")]
pub enum Form {
    /// Material through and through.
    Solid,
    /// A wall around a void or around another part.
    Shell { wall_thickness_m: Range },
    /// Neither: several things, known by their density as a whole, such as a book or a motor in its housing. The material
    /// is that of the outside.
    Mixed,
}

/// The contents of a shell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "inside", rename_all = "snake_case")]
pub enum Inside {
    /// Air.
    Empty,
    Filled {
        /// Name of a row of `fillings.csv`.
        filling: String,
        /// Its share of the hollow, with the gaps between its pieces, 0 to 1.
        share: Range,
        /// Its density with those gaps, if the answer says it; else that of the row.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        density_kg_m3: Option<Range>,
    },
    /// The model cannot tell, or was not asked.
    Unknown,
}

/// How a recording was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "matched", rename_all = "snake_case")]
pub enum Match {
    /// Asked live in this run.
    Live,
    /// Found by its key, or by view, prompt and the same mask.
    Exact,
    /// Found by view and mask overlap.
    Mask { iou: f64 },
}

/// Why a question has no answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "failure", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Failure {
    /// The model refused to answer.
    Refused { message: String },
    /// The response is empty, or is not a valid answer even after one correction.
    Invalid { message: String },
    /// The answer names a material that the library does not have.
    UnknownMaterial { material: String },
    /// The server could not be reached or kept failing.
    Endpoint { message: String },
    /// Nobody has answered yet.
    Unanswered,
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Refused { message } => write!(f, "the model refused to answer: {message}"),
            Self::Invalid { message } => write!(f, "no usable answer: {message}"),
            Self::UnknownMaterial { material } => write!(f, "the library has no material {material:?}"),
            Self::Endpoint { message } => write!(f, "the server failed: {message}"),
            Self::Unanswered => f.write_str("not answered yet"),
        }
    }
}

/// The answers about all subjects in all views, by view in the order of the views, then by id.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Answers {
    pub all: Vec<SubjectAnswer>,
}

impl Answers {
    /// These answers, in their order.
    pub fn new(all: Vec<SubjectAnswer>) -> Self {
        Self { all }
    }
}
