//! A JSON schema that is sent to the model and that its answers are checked against, whatever the server promises.

use jsonschema::Validator;
use serde_json::{Value, json};

use super::prompt::PromptError;
use crate::materials::fold;
use crate::query::answer::extract::{self, NoJson};
use crate::query::recorded::sha256::Sha256Hex;

/// The properties whose value is one of a list of names: of the families, of the fillings.
const NAMED: [&str; 2] = ["family", "filling"];

/// A compiled schema.
#[derive(Debug)]
pub struct Schema {
    value: Value,
    validator: Validator,
    sha256: Sha256Hex,
    /// The names that the properties of [`NAMED`] may have, if the schema has them.
    names: [Vec<String>; 2],
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
    /// The schema `value` with its `family` narrowed to `families` and its `filling`, if it has one, to `fillings` or
    /// null.
    pub fn new(file: &str, mut value: Value, families: &[&str], fillings: &[&str]) -> Result<Self, PromptError> {
        if !value.is_object() {
            return Err(PromptError::Schema { file: file.into(), problem: "it is not a JSON object".into() });
        }
        let or_null = fillings.iter().map(|name| json!(name)).chain([Value::Null]).collect();
        for (property, choices) in NAMED.into_iter().zip([json!(families), Value::Array(or_null)]) {
            let property = value.get_mut("properties").and_then(|properties| properties.get_mut(property));
            if let Some(property) = property.and_then(Value::as_object_mut) {
                property.insert("enum".into(), choices);
            }
        }
        let validator = jsonschema::validator_for(&value)
            .map_err(|error| PromptError::Schema { file: file.into(), problem: error.to_string() })?;
        let sha256 = Sha256Hex::of(value.to_string());
        let names = [families, fillings].map(|names| names.iter().map(|&name| name.to_owned()).collect());
        Ok(Self { value, validator, sha256, names })
    }

    /// The schema itself.
    pub fn value(&self) -> &Value {
        &self.value
    }

    /// Hash of its compact JSON text.
    pub fn sha256(&self) -> &Sha256Hex {
        &self.sha256
    }

    /// The JSON object in a model's response, if it follows the schema. The names of family and filling
    /// may differ in case, spelling or punctuation.
    pub fn check(&self, response: &str) -> Result<Value, ResponseProblem> {
        let mut value = match extract::json_object(response) {
            Ok(value) => value,
            Err(NoJson::None) => return Err(ResponseProblem::NoJson),
            Err(NoJson::Broken(problem)) => return Err(ResponseProblem::BrokenJson(problem)),
        };
        self.respell_names(&mut value);
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

    /// Replaces names in the answer by the schema's spelling if only case, spelling or punctuation differ.
    fn respell_names(&self, value: &mut Value) {
        for (property, names) in NAMED.into_iter().zip(&self.names) {
            if let Some(Value::String(written)) = value.get_mut(property)
                && let Some(name) = names.iter().find(|name| fold(name) == fold(written))
            {
                name.clone_into(written);
            }
        }
    }
}
