//! The page on which a person can answer: one file that opens from disk, without a network or a server.

use minijinja::{Environment, context};
use serde::Serialize;
use serde_json::Value;

/// One question as the page shows it.
#[derive(Debug, Serialize)]
pub struct FormQuery<'a> {
    pub query: &'a str,
    /// Path of the picture, relative to the page.
    pub sheet: String,
    /// Index of its text and schema among the [`FormText`]s.
    pub text: usize,
}

/// A prompt with the schema of its answer and the materials to choose from.
#[derive(Debug, Serialize)]
pub struct FormText<'a> {
    pub prompt: &'a str,
    pub schema: &'a Value,
}

/// The page. What it embeds is escaped by the template engine's `tojson`, so that no text can end the script.
pub fn page(queries: &[FormQuery], texts: &[FormText]) -> String {
    let template = include_str!("form.html.j2");
    Environment::new()
        .render_str(template, context! { queries, texts })
        .expect("a test renders the page with every value that it names")
}
