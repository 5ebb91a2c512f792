//! A JSON schema that is sent to the model and that its answers are checked against, whatever the server promises.

use jsonschema::Validator;
use serde_json::{Value, json};

use super::prompt::PromptError;
use crate::files::json;
use crate::materials::fold;
use crate::query::answer::extract::{self, NoJson};
use crate::query::recorded::sha256::Sha256Hex;

/// The properties whose value is one of a list of names: of the families, of the fillings.
const NAMED: [&str; 2] = ["family", "filling"];
/// The list whose items have such properties, too.
const LIST: &str = "alternatives";

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
    /// The schema `value` with its `family`, and that of its `alternatives`, narrowed to `families`, and its `filling`, if it has one,
    /// to `fillings` or null.
    pub fn new(file: &str, mut value: Value, families: &[&str], fillings: &[&str]) -> Result<Self, PromptError> {
        if !value.is_object() {
            return Err(PromptError::Schema { file: file.into(), problem: "it is not a JSON object".into() });
        }
        let or_null = fillings.iter().map(|name| json!(name)).chain([Value::Null]).collect();
        for (property, choices) in NAMED.into_iter().zip([json!(families), Value::Array(or_null)]) {
            for of in [String::new(), format!("/properties/{LIST}/items")] {
                let property = value.pointer_mut(&format!("{of}/properties/{property}"));
                if let Some(property) = property.and_then(Value::as_object_mut) {
                    property.insert("enum".into(), choices.clone());
                }
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

    /// The JSON object in a model's response that follows the schema: the last one, or one that lies in another object, as a
    /// wrapper has it. Objects in the model's reasoning count only if it wrote none after it. The names of family and filling
    /// may differ in case, spelling or punctuation, and numbers may be written as strings.
    pub fn check(&self, response: &str) -> Result<Value, ResponseProblem> {
        let (thought, answer) = extract::split_thought(response);
        match self.last_fitting(answer) {
            Err(ResponseProblem::NoJson) => self.last_fitting(thought),
            checked => checked,
        }
    }

    /// The last object in `text` that follows the schema.
    ///
    /// # Errors
    /// The problems of the object that comes closest.
    fn last_fitting(&self, text: &str) -> Result<Value, ResponseProblem> {
        let objects = extract::json_objects(text).map_err(|none| match none {
            NoJson::None => ResponseProblem::NoJson,
            NoJson::Broken(problem) => ResponseProblem::BrokenJson(problem),
        })?;
        let mut closest: Option<Vec<String>> = None;
        for mut object in objects.into_iter().rev().flat_map(with_wrapped) {
            self.respell_names(&mut object);
            read_literals(&mut object, &self.value);
            let problems = self.problems(&object);
            if problems.is_empty() {
                return Ok(object);
            }
            if closest.as_ref().is_none_or(|closest| problems.len() < closest.len()) {
                closest = Some(problems);
            }
        }
        Err(ResponseProblem::OffSchema(closest.unwrap_or_default()))
    }

    /// Each violation of the schema, with its place in the object.
    fn problems(&self, object: &Value) -> Vec<String> {
        let problem = |error: jsonschema::ValidationError| match error.instance_path().as_str() {
            "" => format!("{error}"),
            path => format!("{}: {error}", path.trim_start_matches('/')),
        };
        self.validator.iter_errors(object).map(problem).collect()
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
        let items = value.get_mut(LIST).and_then(Value::as_array_mut);
        items.into_iter().flatten().for_each(|item| self.respell_names(item));
    }
}

/// The object, and those that are values of it, as some servers wrap an answer: `{"values": {...}}`.
fn with_wrapped(object: Value) -> Vec<Value> {
    let values = object.as_object().into_iter().flat_map(|fields| fields.values());
    let wrapped: Vec<Value> = values.filter(|value| value.is_object()).cloned().collect();
    std::iter::once(object).chain(wrapped).collect()
}

/// Replaces numbers and other values that are written as strings where the schema has no string.
fn read_literals(value: &mut Value, schema: &Value) {
    if let Value::String(text) = value
        && !allows(schema, "string")
        && let Ok(literal) = json::read::<Value>(text.trim().to_lowercase().as_bytes())
        && allows(schema, type_of(&literal))
    {
        *value = literal;
    }
    match value {
        Value::Object(fields) => {
            fields.iter_mut().for_each(|(name, field)| read_literals(field, &schema["properties"][name.as_str()]));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| read_literals(item, &schema["items"])),
        _ => {}
    }
}

/// True if the schema names this type.
fn allows(schema: &Value, name: &str) -> bool {
    match &schema["type"] {
        Value::Array(names) => names.iter().any(|known| known == name),
        known => known == name,
    }
}

/// The name of a value's type in a schema.
fn type_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    }
}
