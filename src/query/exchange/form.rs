//! The page on which a person can answer: it opens from disk, beside its sheets, without a network or a server. Its
//! fields are those of the schema; choosing a material fills in what the library knows.

use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;
use serde_json::Value;

use super::filled::Filled;
use crate::words::html;

/// One question as the page shows it.
#[derive(Debug, Serialize)]
pub struct FormQuestion<'a> {
    pub query: &'a str,
    /// Path of the picture, relative to the page.
    pub sheet: String,
    /// Index of its text and schema among the [`FormText`]s.
    pub text: usize,
    /// Questions with the same one are about the same part.
    pub part: String,
}

/// A prompt with the schema of its answer and the materials to choose from.
#[derive(Debug, Serialize)]
pub struct FormText<'a> {
    pub prompt: &'a str,
    pub schema: &'a Value,
}

/// A material to choose.
#[derive(Debug, Serialize)]
pub struct FormMaterial<'a> {
    /// Other names, by which it is found too.
    pub aliases: &'a [String],
    pub fields: Filled<'a>,
}

/// The page, with the names of fillings to choose from. What it embeds is escaped by the template engine, so that no text
/// can end the script or an element.
pub fn page(queries: &[FormQuestion], texts: &[FormText], materials: &[FormMaterial], fillings: &[&str]) -> String {
    let unescaped = |text: &str| minijinja::Value::from_safe_string(text.to_owned());
    let (style, script) = (unescaped(include_str!("form.css")), unescaped(include_str!("form.js")));
    let data = context! {
        queries => Serde(queries),
        texts => Serde(texts),
        materials => Serde(materials),
        fillings => Serde(fillings),
        style,
        script,
    };
    html::engine()
        .render_str(include_str!("form.html.j2"), data)
        .expect("a test renders the page with every value that it names")
}
