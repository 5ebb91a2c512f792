//! The JSON object in what a model wrote: bare, fenced, after some thinking aloud, or cut off at the end.

use serde_json::{Deserializer, Value};

/// Why a text yields no JSON object.
#[derive(Debug, PartialEq)]
pub enum NoJson {
    /// No opening brace starts one.
    None,
    /// One starts but cannot be read, not even when closed at its end.
    Broken(String),
}

/// Closes the thinking of models that write it into their answer; nothing before it is the answer.
const END_OF_THOUGHT: &str = "</think>";

/// The first JSON object in `text`. One that was cut off is closed where it ends: what it lacks then is for the schema
/// to say.
pub fn json_object(text: &str) -> Result<Value, NoJson> {
    let text = text.rsplit_once(END_OF_THOUGHT).map_or(text, |(_, answer)| answer);
    let text = text.trim_end().trim_end_matches('`').trim_end();
    let mut problem = NoJson::None;
    for (start, _) in text.match_indices('{') {
        let rest = &text[start..];
        match Deserializer::from_str(rest).into_iter::<Value>().next() {
            Some(Ok(value)) => return Ok(value),
            Some(Err(error)) if error.is_eof() => {
                return closed(rest).ok_or_else(|| NoJson::Broken(error.to_string()));
            }
            Some(Err(error)) if problem == NoJson::None => problem = NoJson::Broken(error.to_string()),
            _ => {}
        }
    }
    Err(problem)
}

/// A cut-off object closed at its last complete value.
fn closed(text: &str) -> Option<Value> {
    let mut open = Vec::new();
    let mut in_string = false;
    let mut escaped = false;
    for character in text.chars() {
        match character {
            _ if escaped => escaped = false,
            '\\' if in_string => escaped = true,
            '"' => in_string = !in_string,
            _ if in_string => {}
            '{' => open.push('}'),
            '[' => open.push(']'),
            '}' | ']' => drop(open.pop()),
            _ => {}
        }
    }
    let end: String = open.iter().rev().collect();
    let closed_string = if in_string { "\"" } else { "" };
    serde_json::from_str(&format!("{}{closed_string}{end}", text.trim_end_matches([',', ' ', '\n']))).ok()
}
