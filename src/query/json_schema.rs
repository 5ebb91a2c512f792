//! Checks JSON against a JSON schema. It knows the keywords that answers of models are described with; a schema with
//! any other keyword is refused, because an answer could break it unnoticed.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

/// A schema. Keywords apply only to values of the type that they are about, as the standard has it.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "camelCase")]
pub struct JsonSchema {
    r#type: Option<Types>,
    r#enum: Option<Vec<Value>>,
    any_of: Vec<JsonSchema>,
    properties: BTreeMap<String, JsonSchema>,
    required: Vec<String>,
    additional_properties: Option<bool>,
    items: Option<Box<JsonSchema>>,
    min_items: Option<usize>,
    max_items: Option<usize>,
    min_length: Option<usize>,
    max_length: Option<usize>,
    minimum: Option<f64>,
    maximum: Option<f64>,
    // These constrain nothing.
    #[serde(rename = "$schema")]
    _schema: IgnoredAny,
    #[serde(rename = "title")]
    _title: IgnoredAny,
    #[serde(rename = "description")]
    _description: IgnoredAny,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Types {
    One(Type),
    Several(Vec<Type>),
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Type {
    Null,
    Boolean,
    Integer,
    Number,
    String,
    Array,
    Object,
}

impl JsonSchema {
    /// Everything in `value` that the schema does not allow, each with its place.
    pub fn problems(&self, value: &Value) -> Vec<String> {
        let mut found = Vec::new();
        self.check(value, "", &mut found);
        found
    }

    fn check(&self, value: &Value, place: &str, found: &mut Vec<String>) {
        let mut problem = |problem: String| {
            found.push(if place.is_empty() { problem } else { format!("{place}: {problem}") });
        };
        if let Some(types) = &self.r#type
            && !types.all().iter().any(|allowed| allowed.holds(value))
        {
            problem(types.refusal(value));
        }
        if let Some(choices) = &self.r#enum
            && !choices.iter().any(|choice| is_same(choice, value))
        {
            problem(format!("{value} is not one of {}", listed(choices)));
        }
        if !self.any_of.is_empty() && self.any_of.iter().all(|schema| !schema.problems(value).is_empty()) {
            problem(format!("{value} is not valid under any of the schemas listed in the 'anyOf' keyword"));
        }
        let mut counted = |count: usize, least: Option<usize>, most: Option<usize>, words: [&str; 3]| {
            let [few, many, unit] = words;
            let plural = |limit: usize| if limit == 1 { "" } else { "s" };
            if let Some(least) = least.filter(|&least| count < least) {
                problem(format!("{value} {few} {least} {unit}{}", plural(least)));
            }
            if let Some(most) = most.filter(|&most| count > most) {
                problem(format!("{value} {many} {most} {unit}{}", plural(most)));
            }
        };
        match value {
            Value::Array(items) => {
                counted(items.len(), self.min_items, self.max_items, ["has less than", "has more than", "item"]);
                for (n, item) in items.iter().enumerate() {
                    if let Some(schema) = &self.items {
                        schema.check(item, &inside(place, &n.to_string()), found);
                    }
                }
            }
            Value::String(text) => {
                let words = ["is shorter than", "is longer than", "character"];
                counted(text.chars().count(), self.min_length, self.max_length, words);
            }
            Value::Number(number) => {
                let number = number.as_f64().unwrap_or(f64::NAN);
                if let Some(least) = self.minimum.filter(|&least| number < least) {
                    problem(format!("{value} is less than the minimum of {least}"));
                }
                if let Some(most) = self.maximum.filter(|&most| number > most) {
                    problem(format!("{value} is greater than the maximum of {most}"));
                }
            }
            Value::Object(properties) => {
                for required in self.required.iter().filter(|name| !properties.contains_key(*name)) {
                    problem(format!("{required:?} is a required property"));
                }
                let unknown: Vec<String> = properties
                    .keys()
                    .filter(|name| !self.properties.contains_key(*name))
                    .map(|name| format!("'{name}'"))
                    .collect();
                if self.additional_properties == Some(false) && !unknown.is_empty() {
                    let were = if unknown.len() == 1 { "was" } else { "were" };
                    problem(format!(
                        "Additional properties are not allowed ({} {were} unexpected)",
                        unknown.join(", ")
                    ));
                }
                for (name, schema) in &self.properties {
                    if let Some(value) = properties.get(name) {
                        schema.check(value, &inside(place, name), found);
                    }
                }
            }
            Value::Null | Value::Bool(_) => {}
        }
    }
}

impl Types {
    fn all(&self) -> &[Type] {
        match self {
            Self::One(one) => std::slice::from_ref(one),
            Self::Several(several) => several,
        }
    }

    fn refusal(&self, value: &Value) -> String {
        let names: Vec<String> =
            self.all().iter().map(|allowed| format!("{:?}", format!("{allowed:?}").to_lowercase())).collect();
        let types = if names.len() == 1 { "type" } else { "types" };
        format!("{value} is not of {types} {}", names.join(", "))
    }
}

impl Type {
    fn holds(self, value: &Value) -> bool {
        match self {
            Self::Null => value.is_null(),
            Self::Boolean => value.is_boolean(),
            Self::Integer => value.as_f64().is_some_and(|number| number.fract() == 0.0),
            Self::Number => value.is_number(),
            Self::String => value.is_string(),
            Self::Array => value.is_array(),
            Self::Object => value.is_object(),
        }
    }
}

/// Equality of JSON: 1 is 1.0.
fn is_same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => a.as_f64() == b.as_f64(),
        _ => a == b,
    }
}

/// The choices in words; of more than three, the first two.
fn listed(choices: &[Value]) -> String {
    let words: Vec<String> = choices.iter().map(Value::to_string).collect();
    match words.as_slice() {
        [] => "none".to_owned(),
        [one] => one.clone(),
        [first, last] => format!("{first} or {last}"),
        [first, second, last] => format!("{first}, {second} or {last}"),
        [first, second, others @ ..] => format!("{first}, {second} or {} other candidates", others.len()),
    }
}

/// The place of `name` within the object or array at `place`.
fn inside(place: &str, name: &str) -> String {
    if place.is_empty() { name.to_owned() } else { format!("{place}/{name}") }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Every keyword with values that it allows and values that it does not, judged by the `jsonschema` crate: the same
    /// number of problems in the same words.
    #[test]
    fn it_finds_what_the_reference_finds() {
        let schemas = [
            json!({}),
            json!({ "type": "integer" }),
            json!({ "type": ["array", "null"], "items": { "type": "number" }, "minItems": 2, "maxItems": 2 }),
            json!({ "type": "array", "minItems": 1, "maxItems": 1, "items": { "maximum": 2.5, "minimum": 1.5 } }),
            json!({ "enum": ["A", 1, null] }),
            json!({ "enum": ["A", "B", "C", "D"] }),
            json!({ "anyOf": [{ "type": "string", "minLength": 2 }, { "type": "null" }], "description": "text" }),
            json!({ "type": "string", "minLength": 1, "maxLength": 1 }),
            json!({
                "type": "object", "required": ["a", "b"], "additionalProperties": false,
                "properties": { "a": { "type": "string" }, "b": { "items": { "enum": ["x", "y"] } } },
            }),
            json!({ "properties": { "a": { "properties": { "b": { "type": "boolean" } } } } }),
        ];
        let values = [
            json!(null),
            json!(true),
            json!(1),
            json!(1.0),
            json!(2.75),
            json!(""),
            json!("A"),
            json!("ß"),
            json!("long"),
            json!([]),
            json!([1]),
            json!([1, 2]),
            json!([2, "x", null]),
            json!({}),
            json!({ "a": 1 }),
            json!({ "a": "x", "b": ["x", "z"] }),
            json!({ "a": { "b": 3 }, "c": 1 }),
            json!({ "b": [], "a": "", "c": 1, "d": 2 }),
        ];
        let mut problems = 0;
        for schema in schemas {
            let ours: JsonSchema = serde_json::from_value(schema.clone()).unwrap();
            let reference = jsonschema::validator_for(&schema).unwrap();
            for value in &values {
                let place = |error: &jsonschema::ValidationError| match error.instance_path.as_str() {
                    "" => error.to_string(),
                    path => format!("{}: {error}", path.trim_start_matches('/')),
                };
                let mut expected: Vec<String> = reference.iter_errors(value).map(|error| place(&error)).collect();
                let mut found = ours.problems(value);
                expected.sort();
                found.sort();
                assert_eq!(found, expected, "{schema} and {value}");
                problems += found.len();
            }
        }
        assert!(problems > 80, "{problems}");
    }

    #[test]
    fn a_keyword_that_would_not_be_checked_is_refused() {
        let schema = json!({ "properties": { "a": { "type": "string", "pattern": "^x" } } });
        let error = serde_json::from_value::<JsonSchema>(schema).unwrap_err().to_string();
        assert!(error.starts_with("unknown field `pattern`, expected one of `type`, `enum`"), "{error}");
    }
}
