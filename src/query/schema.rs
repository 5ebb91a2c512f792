//! A JSON schema as it is sent to the model and as its answers are checked here, whatever the server promises.

use jsonschema::Validator;
use serde_json::{Value, json};

use super::extract::{self, NoJson};
use super::prompt::PromptError;
use super::sha256::Sha256Hex;
use crate::materials::fold;

/// A schema, compiled.
#[derive(Debug)]
pub struct Schema {
    value: Value,
    validator: Validator,
    sha256: Sha256Hex,
    families: Vec<String>,
}

/// What is wrong with a response, in words for the model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ResponseProblem {
    #[error("it holds no JSON object.")]
    NoJson,
    #[error("its JSON cannot be read: {0}.")]
    BrokenJson(String),
    /// Each with the place in the object.
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

    /// Of its compact JSON text.
    pub fn sha256(&self) -> &Sha256Hex {
        &self.sha256
    }

    /// The JSON object in a model's response, if it follows the schema. A family may be in capitals.
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

    /// Writes the answer's family as the schema does where only case, spelling or punctuation differ.
    fn respell_family(&self, value: &mut Value) {
        if let Some(Value::String(written)) = value.get_mut("family")
            && let Some(family) = self.families.iter().find(|family| fold(family) == fold(written))
        {
            family.clone_into(written);
        }
    }
}
