//! Finds the JSON objects in a model's text: bare, fenced, after some reasoning, or cut off at the end.

use crate::files::json;
use std::collections::VecDeque;

use serde_json::{Deserializer, Value};

/// Why a text contains no JSON object.
#[derive(Debug, Clone, PartialEq)]
pub enum NoJson {
    /// It has no opening brace that starts one.
    None,
    /// One starts but cannot be parsed, not even when closed at its end.
    Broken(String),
}

/// An answer is an object of ranges, which is two levels; no answer nests this deeply.
const MOST_NESTED: usize = 16;

/// Most objects of a text that are looked at, counted from its end.
const MOST_OBJECTS: usize = 64;

/// The marks after which models write their answer if they write their reasoning into the response too: those of Qwen and
/// DeepSeek, of Magistral, Kimi, Seed-OSS, Command A and Gemma, and the one that begins the text of a channel in the format
/// of gpt-oss.
const ENDS_OF_THOUGHT: [&str; 9] = [
    "</think>",
    "</thinking>",
    "</thought>",
    "[/THINK]",
    "◁/think▷",
    "</seed:think>",
    "<|END_THINKING|>",
    "<channel|>",
    "<|message|>",
];

/// Splits a response after the last mark that ends a model's reasoning: into the reasoning, which may be empty, and the
/// answer.
pub fn split_thought(response: &str) -> (&str, &str) {
    let ends = ENDS_OF_THOUGHT.iter().filter_map(|mark| Some(response.rfind(mark)? + mark.len()));
    response.split_at(ends.max().unwrap_or(0))
}

/// The last JSON objects in `text`, in their order. An object that was cut off is closed where it ends; the schema then
/// reports what is missing.
pub fn json_objects(text: &str) -> Result<Vec<Value>, NoJson> {
    let text = text.trim_end().trim_end_matches('`').trim_end();
    let mut found = VecDeque::new();
    let mut problem = NoJson::None;
    let mut at = 0;
    while let Some(start) = text[at..].find('{').map(|next| at + next) {
        let rest = &text[start..];
        at = start + 1;
        if nests_too_deeply(rest) {
            problem = NoJson::Broken(format!("it is nested more than {MOST_NESTED} deep"));
            break;
        }
        let mut values = Deserializer::from_str(rest).into_iter::<Value>();
        match values.next() {
            Some(Ok(value)) => {
                found.push_back(value);
                at = start + values.byte_offset();
            }
            Some(Err(error)) => {
                let whole = if error.is_eof() { closed(rest) } else { None };
                if whole.is_none() && problem == NoJson::None {
                    problem = NoJson::Broken(error.to_string());
                }
                found.extend(whole);
            }
            None => {}
        }
        if found.len() > MOST_OBJECTS {
            found.pop_front();
        }
    }
    if found.is_empty() { Err(problem) } else { Ok(found.into()) }
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
    json::read(format!("{}{closed_string}{end}", text.trim_end_matches([',', ' ', '\n'])).as_bytes()).ok()
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
