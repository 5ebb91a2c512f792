//! A JSON schema that is sent to the model and that its answers are checked against, whatever the server promises.

use jsonschema::Validator;
use serde_json::{Value, json};

use super::extract::{self, NoJson};
use super::prompt::PromptError;
use super::sha256::Sha256Hex;
use crate::materials::fold;

/// A compiled schema.
#[derive(Debug)]
pub struct Schema {
    value: Value,
    validator: Validator,
    sha256: Sha256Hex,
    families: Vec<String>,
}

/// The error in a response, in words that the model can act on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ResponseProblem {
    #[error("it holds no JSON object.")]
    NoJson,
    #[error("its JSON cannot be read: {0}.")]
    BrokenJson(String),
    /// Each violation with its place in the object.
    #[error("{}.", .0.join("; "))]
    OffSchema(Vec<String>),
}

impl Schema {
    /// The schema `value` with its `family` narrowed to `families`.
    pub fn new(file: &str, mut value: Value, families: &[&str]) -> Result<Self, PromptError> {
        if let Some(family) = value.pointer_mut("/properties/family").and_then(Value::as_object_mut) {
            family.insert("enum".into(), json!(families));
        }
        let validator = jsonschema::validator_for(&value)
            .map_err(|error| PromptError::Schema { file: file.into(), problem: error.to_string() })?;
        let sha256 = Sha256Hex::of(value.to_string());
        Ok(Self { value, validator, sha256, families: families.iter().map(|&family| family.to_owned()).collect() })
    }

    /// The schema itself.
    pub fn value(&self) -> &Value {
        &self.value
    }

    /// Hash of its compact JSON text.
    pub fn sha256(&self) -> &Sha256Hex {
        &self.sha256
    }

    /// The JSON object in a model's response, if it follows the schema. The family's name may differ in case.
    pub fn check(&self, response: &str) -> Result<Value, ResponseProblem> {
        let mut value = match extract::json_object(response) {
            Ok(value) => value,
            Err(NoJson::None) => return Err(ResponseProblem::NoJson),
            Err(NoJson::Broken(problem)) => return Err(ResponseProblem::BrokenJson(problem)),
        };
        self.respell_family(&mut value);
        let problems: Vec<String> = self
            .validator
            .iter_errors(&value)
            .map(|error| match error.instance_path.as_str() {
                "" => format!("{error}"),
                path => format!("{}: {error}", path.trim_start_matches('/')),
            })
            .collect();
        if problems.is_empty() { Ok(value) } else { Err(ResponseProblem::OffSchema(problems)) }
    }

    /// Replaces the answer's family by the schema's spelling if only case, spelling or punctuation differ.
    fn respell_family(&self, value: &mut Value) {
        if let Some(Value::String(written)) = value.get_mut("family")
            && let Some(family) = self.families.iter().find(|family| fold(family) == fold(written))
        {
            family.clone_into(written);
        }
    }
}
