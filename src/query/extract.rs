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

/// An answer is an object of ranges: two levels. No answer has so many.
const MOST_NESTED: usize = 16;

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

/// Whether the value that `text` begins with opens more than [`MOST_NESTED`] brackets within each other. Without this, every
/// brace of a deep text would be tried in turn.
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

/// A cut-off object closed at its last complete value.
fn closed(text: &str) -> Option<Value> {
    let mut brackets = Brackets::default();
    text.chars().for_each(|character| brackets.read(character));
    let end: String = brackets.open.iter().rev().collect();
    let closed_string = if brackets.in_string { "\"" } else { "" };
    serde_json::from_str(&format!("{}{closed_string}{end}", text.trim_end_matches([',', ' ', '\n']))).ok()
}

/// What is open in a JSON text that is read character by character.
#[derive(Default)]
struct Brackets {
    /// The closing brackets that are owed, the last first.
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
