//! Finds the JSON object in a model's text: bare, fenced, after some reasoning, or cut off at the end.

use serde_json::{Deserializer, Value};

/// Why a text contains no JSON object.
#[derive(Debug, PartialEq)]
pub enum NoJson {
    /// It has no opening brace that starts one.
    None,
    /// One starts but cannot be parsed, not even when closed at its end.
    Broken(String),
}

/// An answer is an object of ranges, which is two levels; no answer nests this deeply.
const MOST_NESTED: usize = 16;

/// Ends the reasoning of models that write it into their response; nothing before it is the answer.
const END_OF_THOUGHT: &str = "</think>";

/// The first JSON object in `text`. An object that was cut off is closed where it ends; the schema then reports what is
/// missing.
pub fn json_object(text: &str) -> Result<Value, NoJson> {
    let text = text.rsplit_once(END_OF_THOUGHT).map_or(text, |(_, answer)| answer);
    let text = text.trim_end().trim_end_matches('`').trim_end();
    let mut problem = NoJson::None;
    for (start, _) in text.match_indices('{') {
        let rest = &text[start..];
        if nests_too_deeply(rest) {
            return Err(NoJson::Broken(format!("it is nested more than {MOST_NESTED} deep")));
        }
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

/// True if the value that `text` begins with nests brackets more than [`MOST_NESTED`] deep. Without this check, every
/// brace of a deeply nested text would be tried in turn.
fn nests_too_deeply(text: &str) -> bool {
    let mut brackets = Brackets::default();
    for character in text.chars() {
        brackets.read(character);
        if brackets.open.len() > MOST_NESTED {
            return true;
        }
        if brackets.open.is_empty() {
            return false;
        }
    }
    false
}

/// A cut-off object, with its open string and brackets closed where the text ends; `None` if that is not JSON.
fn closed(text: &str) -> Option<Value> {
    let mut brackets = Brackets::default();
    text.chars().for_each(|character| brackets.read(character));
    // A number at the end may lack digits.
    let last = text.rsplit(|c: char| c.is_whitespace() || ":,[{".contains(c)).next().unwrap_or_default();
    if !brackets.in_string && last.starts_with(|c: char| c.is_ascii_digit() || c == '-') {
        return None;
    }
    let end: String = brackets.open.iter().rev().collect();
    let closed_string = if brackets.in_string { "\"" } else { "" };
    serde_json::from_str(&format!("{}{closed_string}{end}", text.trim_end_matches([',', ' ', '\n']))).ok()
}

/// The open brackets of a JSON text that is read character by character.
#[derive(Default)]
struct Brackets {
    /// The closing brackets that are still missing, the last first.
    open: Vec<char>,
    in_string: bool,
    escaped: bool,
}

impl Brackets {
    fn read(&mut self, character: char) {
        match character {
            _ if self.escaped => self.escaped = false,
            '\\' if self.in_string => self.escaped = true,
            '"' => self.in_string = !self.in_string,
            _ if self.in_string => {}
            '{' => self.open.push('}'),
            '[' => self.open.push(']'),
            '}' | ']' => drop(self.open.pop()),
            _ => {}
        }
    }
}
