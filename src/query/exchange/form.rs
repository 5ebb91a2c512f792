//! The page on which a person can answer: it opens from disk, beside its sheets, without a network or a server, or gprop
//! serves it on this machine. Its fields are those of the schema, those of its lists included; choosing a material fills in
//! what the library knows.

use std::collections::BTreeSet;

use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;
use serde_json::Value;

use super::filled::Filled;
use crate::files::json;
use crate::materials::MaterialLibrary;
use crate::query::answer::recognition;
use crate::query::question::Question;
use crate::query::question::shown_subject::ShownSubject;
use crate::query::recorded::QuestionId;
use crate::query::recorded::sha256::Sha256Hex;
use crate::words::html;

/// Questions on their way to a person, in the order of the page.
#[derive(Default)]
pub struct Form {
    questions: Vec<FormQuestion>,
    texts: Vec<FormText>,
}

/// One question as the page shows it, with what it asks.
#[derive(Serialize)]
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
    /// Of what is asked about, on average.
    pub color: [u8; 3],
    #[serde(skip)]
    pub asked: QuestionId,
    #[serde(skip)]
    pub jpeg: Vec<u8>,
}

/// A prompt with the schema of its answer.
#[derive(Serialize)]
pub struct FormText {
    pub prompt: String,
    pub schema: Value,
    #[serde(skip)]
    hashes: [Sha256Hex; 2],
}

/// A material to choose.
#[derive(Serialize)]
struct FormMaterial<'a> {
    /// Other names, by which it is found too.
    aliases: &'a [String],
    fields: Filled<'a>,
}

/// What a page that gprop serves knows besides its questions.
#[derive(Debug, Serialize)]
pub struct Served {
    /// The questions whose answers are recorded.
    pub recorded: Vec<String>,
    /// How things stand, a sentence in each line.
    pub standing: Vec<String>,
    /// True once there is nothing left to answer.
    pub done: bool,
    /// A name for whoever answers, to start with.
    pub name: String,
}

/// The reply to an answer: the questions that are known now, and the problem with the answer.
#[derive(Serialize)]
struct Reply<'a> {
    queries: &'a [FormQuestion],
    texts: &'a [FormText],
    served: &'a Served,
    problem: Option<&'a str>,
}

/// Likeness of names, rules, controls and navigation, in the order in which the page runs them.
const SCRIPT: &str = concat!(
    include_str!("../../materials/nearest.js"),
    include_str!("form_answer.js"),
    include_str!("form_controls.js"),
    include_str!("form.js")
);

impl Form {
    /// Adds the questions that it does not have yet. Two subjects with the same picture share one question. `part_of` returns
    /// the same value for the same part: the form puts the questions about one part together, and offers the answer to one of
    /// them for the next.
    pub fn add(&mut self, open: &[(&ShownSubject, &Question)], part_of: &dyn Fn(&ShownSubject) -> (usize, u16)) {
        let mut known: BTreeSet<String> = self.questions.iter().map(|question| question.query.clone()).collect();
        let mut added = Vec::new();
        for (subject, question) in open {
            let asked = subject.asked(question);
            let query = asked.content_sha256().short().to_owned();
            if !known.insert(query.clone()) {
                continue;
            }
            let part = part_of(subject);
            let question = FormQuestion {
                sheet: format!("sheets/{query}.jpg"),
                query,
                text: self.text(question),
                part: format!("{}-{}", part.0, part.1),
                regions: subject.regions.clone(),
                color: subject.color,
                asked,
                jpeg: subject.jpeg.clone(),
            };
            added.push((part, question));
        }
        added.sort_by_key(|(part, _)| *part);
        self.questions.extend(added.into_iter().map(|(_, question)| question));
    }

    /// The index of the question's text.
    fn text(&mut self, question: &Question) -> usize {
        let hashes = [question.prompt_sha256.clone(), question.schema.sha256().clone()];
        self.texts.iter().position(|text| text.hashes == hashes).unwrap_or_else(|| {
            self.texts.push(FormText {
                prompt: question.prompt.clone(),
                schema: question.schema.value().clone(),
                hashes,
            });
            self.texts.len() - 1
        })
    }

    pub fn questions(&self) -> &[FormQuestion] {
        &self.questions
    }

    pub fn texts(&self) -> &[FormText] {
        &self.texts
    }

    /// What the question of this name asks, if there is one.
    pub fn asked(&self, query: &str) -> Option<&QuestionId> {
        self.questions.iter().find(|question| question.query == query).map(|question| &question.asked)
    }

    /// The page, on which a person chooses from the library's materials and fillings: to be opened from disk, or to be
    /// `served`. What it embeds is escaped by the template engine, so that no text can end the script or an element.
    pub fn page(&self, library: &MaterialLibrary, served: Option<&Served>) -> String {
        let unescaped = |text: &str| minijinja::Value::from_safe_string(text.to_owned());
        let (style, script) = (unescaped(include_str!("form.css")), unescaped(SCRIPT));
        let materials = library.materials().iter();
        let materials: Vec<_> =
            materials.map(|material| FormMaterial { aliases: &material.aliases, fields: material.into() }).collect();
        let fillings: Vec<&str> = library.fillings().iter().map(|filling| filling.name.as_str()).collect();
        let data = context! {
            queries => Serde(&self.questions),
            texts => Serde(&self.texts),
            materials => Serde(&materials),
            fillings => Serde(&fillings),
            limits => Serde(&recognition::limits()),
            served => Serde(&served),
            style,
            script,
        };
        html::engine()
            .render_str(include_str!("form.html.j2"), data)
            .expect("a test renders the page with every value that it names")
    }

    /// The reply to an answer, as JSON for the page.
    pub fn reply(&self, served: &Served, problem: Option<&str>) -> String {
        let reply = Reply { queries: &self.questions, texts: &self.texts, served, problem };
        json::compact(&reply).expect("its keys are strings and its numbers finite")
    }
}
