//! The JSON of a response's body, in whatever wrapping servers send it: bare, in a list, or as an event stream although
//! `stream` was false.

use crate::files::json;
use serde_json::{Deserializer, Value};

/// The last line of an event stream.
const END: &str = "[DONE]";

/// The JSON objects of a body: the body itself or the elements of its list, or those on the lines of an event stream. Empty
/// if there are none. What follows text that is not JSON is left out.
pub fn documents(body: &str) -> Vec<Value> {
    let values = json::read(body.as_bytes()).map_or_else(|_| of_stream(body), |value| vec![value]);
    let elements = |value| match value {
        Value::Array(elements) => elements,
        value => vec![value],
    };
    values.into_iter().flat_map(elements).filter(Value::is_object).collect()
}

/// The values on the `data:` lines. Lines without that prefix count too: some servers append `data: [DONE]` to a whole
/// response.
fn of_stream(body: &str) -> Vec<Value> {
    let is_field = |line: &str| [":", "event:", "id:", "retry:"].iter().any(|field| line.starts_with(field));
    let lines = body.lines().map(str::trim).filter(|line| !is_field(line));
    let data = lines.map(|line| line.strip_prefix("data:").map_or(line, str::trim_start)).filter(|data| *data != END);
    let data: Vec<&str> = data.collect();
    Deserializer::from_str(&data.join("\n")).into_iter().map_while(Result::ok).collect()
}

/// The explanation in a body that reports an error: the server's sentence, without the JSON around it. `None` if it has
/// none.
pub fn sentence(body: &str) -> Option<String> {
    if let Ok(value) = json::read(body.as_bytes()) {
        return sentence_in(&value);
    }
    let documents = documents(body);
    if documents.is_empty() { plain(body) } else { documents.iter().find_map(sentence_in) }
}

/// The keys under which servers explain an error, the most talkative first.
const EXPLANATIONS: [&str; 8] =
    ["message", "msg", "detail", "error_description", "description", "error", "errors", "title"];

fn sentence_in(value: &Value) -> Option<String> {
    match value {
        // Some servers pass on another server's error as text.
        Value::String(text) if text.trim_start().starts_with(['{', '[']) => sentence(text),
        Value::String(text) => Some(text.trim().to_owned()).filter(|text| !text.is_empty()),
        Value::Array(items) => {
            let sentences: Vec<String> = items.iter().filter_map(sentence_in).collect();
            (!sentences.is_empty()).then(|| sentences.join("; "))
        }
        Value::Object(fields) => {
            let sentence = EXPLANATIONS.iter().find_map(|key| sentence_in(fields.get(*key)?))?;
            // FastAPI names the field, OpenRouter quotes the provider that it asked.
            let field = fields.get("loc").and_then(Value::as_array).and_then(|path| path.last()?.as_str());
            let sentence = field.map_or(sentence.clone(), |field| format!("{field}: {sentence}"));
            let raw = fields.get("metadata").and_then(|metadata| sentence_in(metadata.get("raw")?));
            Some(raw.map_or(sentence.clone(), |raw| format!("{sentence}: {raw}")))
        }
        _ => None,
    }
}

/// A text that is not JSON; of a web page, its title.
fn plain(body: &str) -> Option<String> {
    let text = body.trim();
    if !text.starts_with('<') {
        return Some(text.to_owned()).filter(|text| !text.is_empty());
    }
    let (_, rest) = text.split_once("<title>")?;
    let (title, _) = rest.split_once("</title>")?;
    Some(format!("a web page with the title {:?}", title.trim()))
}

/// True if the document reports an error and is not an answer.
pub fn is_error(document: &Value) -> bool {
    let has = |key: &str| document.get(key).is_some_and(|value| sentence_in(value).is_some());
    !document["choices"][0].is_object() && ["error", "detail", "message"].into_iter().any(has)
}
