//! The whole result: `report.json` for programs, `report.html` for people, a few lines for the terminal.

mod cloud;
mod disagreement;
mod force_scale;
mod motion;
mod page;
mod pictures;
mod provisional;
pub(crate) mod style;
mod summary;
mod tables;
mod weighing;

use serde::Serialize;

use crate::grasp::GraspReport;
use crate::parts::Parts;
use crate::query::{Answers, Match, Outcome};
use crate::simulate::SimulationReport;
use crate::units::MetricScale;
use crate::vote::FieldPart;

pub use cloud::{Cloud, Sphere};
pub use disagreement::{Disagreement, NamedMaterial};
pub use motion::Motion;
pub use page::{CorrectionsFile, page};
pub(crate) use page::{css, stage};
pub use pictures::{PictureError, Pictures, SheetPicture, ViewPictures, shrink_object};
pub use provisional::provisional;
pub use summary::{
    ESTIMATED, claim_line, grasp_line, mass_line, misfit_line, part_lines, provisional_line, size_line, summary,
};

/// Version of the format of `report.json`, which `docs/report.schema.json` describes: raised when a key changes its
/// meaning or is removed.
pub const SCHEMA_VERSION: u32 = 2;

/// The whole result of `gprop run`. SI throughout: m, kg, s, Pa, N, rad. The world frame is that of the input splat;
/// lengths in scene units say so.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[cfg_attr(test, schemars(title = "gprop report.json"))]
pub struct Report {
    /// Version of this schema; raised when a key is removed or changes its meaning.
    #[cfg_attr(test, schemars(extend("const" = SCHEMA_VERSION)))]
    pub schema_version: u32,
    /// gprop's version.
    pub version: &'static str,
    /// The scene as it was read.
    pub scene: SceneSummary,
    /// The stages before the report, in order.
    pub stages: Vec<StageTime>,
    /// Number of answers by how they were found.
    pub answers: AnswerCounts,
    /// How much is answered, if a run on the answers so far (`--answers partial`) left questions open; else missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "String"))]
    pub provisional: Option<String>,
    /// Parts about which the answers disagree, which lowers the confidence of their Gaussians; empty with `--ask segments`.
    pub disagreements: Vec<Disagreement>,
    /// `None` if the metric scale is unknown.
    pub parts: Option<Parts>,
    /// The properties of each part, by id.
    pub labels: Vec<FieldPart>,
    /// Number of Gaussians of each of these parts.
    pub gaussians_per_label: Vec<usize>,
    /// `None` if it was left out.
    pub simulation: Option<SimulationReport>,
    /// `None` if the metric scale is unknown or the object cannot be grasped; the warnings say why.
    pub grasp: Option<GraspReport>,
    /// Messages about results that may be wrong and should be checked, each with its stage.
    pub warnings: Vec<Remark>,
    /// Other messages, each with its stage.
    pub notes: Vec<Remark>,
    /// How to reproduce this result.
    pub reproduction: Reproduction,
}

impl Report {
    /// Number of Gaussians of a part.
    fn gaussians_of(&self, part: &FieldPart) -> Option<usize> {
        let index = self.labels.iter().position(|other| other.id == part.id)?;
        self.gaussians_per_label.get(index).copied()
    }
}

/// How to reproduce a result.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Reproduction {
    /// The command line, with the options from the original command line and from `gprop.toml`.
    pub command: String,
    /// The scene's files, apart from the photos and their masks, which the scene stage's digest covers.
    pub inputs: Vec<InputFile>,
}

/// A file of the scene.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct InputFile {
    /// Relative to the scene folder if the file is inside it.
    pub path: String,
    /// SHA-256 of its bytes, in lower-case hexadecimal.
    #[cfg_attr(test, schemars(regex(pattern = "^[0-9a-f]{64}$")))]
    pub sha256: String,
}

/// The scene as it was read.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SceneSummary {
    /// The scene folder's name.
    pub name: String,
    /// Gaussians of the object.
    pub gaussians: usize,
    /// Degree of the spherical harmonics.
    #[cfg_attr(test, schemars(range(max = 3)))]
    pub sh_degree: u8,
    /// `None` if the metric scale is unknown.
    pub scale: Option<MetricScale>,
    /// The mass that the file of a mesh states, or the robot or scene whose link this is; missing if it states none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, schemars(with = "f64"))]
    pub claimed_mass_kg: Option<f64>,
    /// How photos and splat disagree, which makes all results meaningless; `None` if they agree.
    pub misfit: Option<String>,
    /// The longest side of the object's box, in scene units.
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub longest_side: f64,
    /// Names of the chosen views.
    pub views: Vec<String>,
    /// Number of Gaussians that at least one view sees; the others take the part of their neighbours.
    pub seen_gaussians: usize,
}

/// A stage: how long it took, and what its results depend on.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StageTime {
    #[cfg_attr(test, schemars(schema_with = "schema::stage_before_the_report"))]
    pub name: String,
    /// Duration when the stage last ran.
    #[cfg_attr(test, schemars(range(min = 0)))]
    pub seconds: f64,
    /// Whether the last run reused its results.
    pub reused: bool,
    /// SHA-256 of the stage's results, or of everything that they depend on: equal digests, equal results.
    #[cfg_attr(test, schemars(regex(pattern = "^[0-9a-f]{64}$")))]
    pub digest: String,
}

/// Something the user should know.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Remark {
    pub stage: String,
    pub message: String,
}

/// Number of answers by how they were found.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct AnswerCounts {
    /// Answers to exactly this query, from this run or an earlier one.
    pub exact: usize,
    /// Answers recorded for the same view with an overlapping mask.
    pub by_mask: usize,
    /// Questions without an answer, which are left out of the vote.
    pub failed: usize,
}

impl AnswerCounts {
    /// Counts the answers by how each was found.
    pub fn of(answers: &Answers) -> Self {
        let mut counts = Self::default();
        for answer in &answers.all {
            match &answer.outcome {
                Outcome::Failed(_) => counts.failed += 1,
                Outcome::Answered(answer) => match answer.matched {
                    // Live answers are recorded first.
                    Match::Exact | Match::Live => counts.exact += 1,
                    Match::Mask { .. } => counts.by_mask += 1,
                },
            }
        }
        counts
    }

    /// Number of questions with an answer.
    pub fn answered(&self) -> usize {
        self.exact + self.by_mask
    }
}

#[cfg(test)]
mod schema {
    //! `docs/report.schema.json` is generated from the types: their fields, with their doc comments as descriptions.

    use std::path::Path;
    use std::{env, fs};

    use schemars::generate::SchemaSettings;
    use schemars::transform::RecursiveTransform;
    use schemars::{Schema, SchemaGenerator, json_schema};
    use serde_json::Value;

    use super::Report;
    use crate::pipeline::Stage;

    /// The keyword that forbids keys that are not described.
    const CLOSED: &str = "additionalProperties";
    /// If set, the test writes the file.
    const UPDATE: &str = "GPROP_UPDATE_SCHEMA";

    /// The names of the stages that a report includes.
    pub fn stage_before_the_report(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<String> =
            Stage::all().iter().copied().filter(|stage| *stage < Stage::Report).map(Stage::name).collect();
        json_schema!({ "enum": names })
    }

    /// Forbids keys that are not described. Descriptions are for readers of JSON: without links and line breaks, and
    /// with null for `None`. Number formats are Rust's, not the standard's, so they are removed; so are defaults,
    /// because no program reads a report back.
    fn published(schema: &mut Schema) {
        if schema.get("properties").is_some() {
            schema.insert(CLOSED.to_owned(), false.into());
        }
        schema.remove("format");
        schema.remove("default");
        if let Some(Value::String(text)) = schema.get_mut("description") {
            let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
            *text = words.replace("`None`", "null").replace("[`", "`").replace("`]", "`");
        }
    }

    /// Of an object into which one of several others is flattened, each schema alone sees only some of the keys: the whole
    /// forbids what none of them describes.
    fn flattened(schema: &mut Schema) {
        let Some(object) = schema.as_object_mut().filter(|object| object.contains_key("properties")) else { return };
        let Some(Value::Array(others)) = object.get_mut("oneOf") else { return };
        for other in others.iter_mut().filter_map(Value::as_object_mut) {
            other.remove(CLOSED);
        }
        object.remove(CLOSED);
        object.insert("unevaluatedProperties".to_owned(), false.into());
    }

    #[test]
    fn the_published_schema_is_that_of_the_types() {
        let settings = SchemaSettings::draft2020_12()
            .for_serialize()
            .with_transform(RecursiveTransform(published))
            .with_transform(RecursiveTransform(flattened));
        let schema = settings.into_generator().into_root_schema_for::<Report>();
        let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
        assert!(!text.contains("](") && !text.contains("::"), "a description contains a Rust path");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/report.schema.json");
        if env::var_os(UPDATE).is_some() {
            fs::write(&path, &text).unwrap();
        }
        let is_same = fs::read_to_string(&path).unwrap() == text;
        assert!(is_same, "docs/report.schema.json is not that of the types; `{UPDATE}=1 cargo test schema` writes it");
    }
}
