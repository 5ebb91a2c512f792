//! The page on which a person can answer: it opens from disk, beside its sheets, without a network or a server. Its
//! fields are those of the schema, those of its lists included; choosing a material fills in what the library knows.

use std::collections::BTreeMap;

use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;
use serde_json::Value;

use super::filled::Filled;
use crate::units::Range;
use crate::words::html;

/// One question as the page shows it.
#[derive(Debug, Serialize)]
pub struct FormQuestion {
    pub query: String,
    /// Path of the picture, relative to the page.
    pub sheet: String,
    /// Index of its text and schema among the [`FormText`]s.
    pub text: usize,
    /// Questions with the same one are about the same part.
    pub part: String,
    /// The numbers of the regions on the picture.
    pub regions: Vec<u16>,
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

/// Rules, controls and navigation, in the order in which the page runs them.
const SCRIPT: &str = concat!(include_str!("form_answer.js"), include_str!("form_controls.js"), include_str!("form.js"));

/// The page, with the names of fillings to choose from and, by field, the numbers that are possible. What it embeds is
/// escaped by the template engine, so that no text can end the script or an element.
pub fn page(
    queries: &[FormQuestion],
    texts: &[FormText],
    materials: &[FormMaterial],
    fillings: &[&str],
    limits: &BTreeMap<&str, Range>,
) -> String {
    let unescaped = |text: &str| minijinja::Value::from_safe_string(text.to_owned());
    let (style, script) = (unescaped(include_str!("form.css")), unescaped(SCRIPT));
    let data = context! {
        queries => Serde(queries),
        texts => Serde(texts),
        materials => Serde(materials),
        fillings => Serde(fillings),
        limits => Serde(limits),
        style,
        script,
    };
    html::engine()
        .render_str(include_str!("form.html.j2"), data)
        .expect("a test renders the page with every value that it names")
}
