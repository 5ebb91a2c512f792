//! Sheets, prompts, answers, recordings, servers.

// Answering by hand on a page that gprop serves, and beside a model.
mod answering;
// Reading a model's text.
mod answers;
// OpenAI's Batch API: submitted, expired, collected.
pub mod batch_api;
// A server that misbehaves in every way that servers are known to.
pub mod client;
// Connections that do not open, certificates, keys in other headers and variables.
mod connection;
mod cost;
// Servers that send the key back, escaped, in part or in pieces.
mod echoes;
// Export of questions, import of answers.
mod exchange;
// Servers that fail in every way: how often they are asked, and what is said.
mod failures;
// The fields of a request: those of --lmm-body, and those that limit its tokens.
mod fields;
// What the answer names and no part shows.
mod found;
// The form for people.
mod form;
// Servers that send too much, too slowly or too little; requests that may have been billed count.
mod hostile;
// Where servers put an answer, and the requests that follow a reply without one.
mod places;
// Recordings that two runs write, that cannot be written, or for which there is no disk space.
mod kept;
mod labels;
mod object;
// GPROP_OFFLINE and --offline, tested with sockets.
pub mod offline;
mod options;
// Mock servers of other projects, if they are installed.
mod peers;
// The whole program with a server: keys, kills, prices, exit codes, one picture.
mod program;
mod prompts;
// The recipes of docs/models.md.
mod recipes;
mod recordings;
// The dialects of vLLM, Ollama, llama.cpp, DashScope.
mod servers;
mod sheets;
// The question about the size of the object.
mod size;
// How long servers ask to wait, each in its own way.
mod waits;

use std::borrow::Cow;
use std::path::Path;
use std::sync::Mutex;

use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::ask::asker::{AskError, Asker, Reply, ReplyContent, Request};
use gprop::query::ask::budget::{Account, Budget};
use gprop::query::client::{ApiKey, Client, ClientError};
use gprop::query::recorded::{Answerer, Recordings, Usage};
use gprop::query::{Options, Prompts, Queries, QueryError, Run, ViewSubjects};
use gprop::scene::{ForegroundSource, Photo};
use gprop::segment::{LabelMap, Level, Segment, ViewSegments};
use gprop::words::progress::Progress;
use image::{GrayImage, Luma, Rgb, RgbImage};
use serde_json::{Value, json};

/// A made-up view: a photo and a label map of one size.
struct View {
    name: &'static str,
    photo: Photo,
    segments: ViewSegments,
}

/// A view whose pixel (x, y) belongs to segment `label(x, y)`; 0 is white background with alpha 0. Every segment has
/// its own shade, and `tint` sets one view's photo apart from another's.
fn view(name: &'static str, (width, height): (u32, u32), tint: u8, label: impl Fn(u32, u32) -> u16) -> View {
    let labels: Vec<u16> =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| label(x, y)).collect();
    let label_at = |x: u32, y: u32| labels[(y * width + x) as usize];
    let rgb = RgbImage::from_fn(width, height, |x, y| match label_at(x, y) {
        0 => Rgb([255; 3]),
        segment => Rgb([(segment * 40 % 200) as u8 + (x % 7) as u8, tint, (y % 11) as u8 * 9]),
    });
    let foreground = GrayImage::from_fn(width, height, |x, y| Luma([if label_at(x, y) == 0 { 0 } else { 255 }]));
    let mut ids: Vec<u16> = labels.iter().copied().filter(|label| *label != 0).collect();
    ids.sort_unstable();
    ids.dedup();
    let segments = ids
        .into_iter()
        .map(|id| Segment {
            id,
            area: labels.iter().filter(|label| **label == id).count() as u32,
            bbox: [0, 0, width, height],
            predicted_iou: 0.9,
            stability_score: 0.95,
            level: Level::Middle,
            parent: 0,
        })
        .collect();
    let segments = ViewSegments { view: name.into(), map: LabelMap { width, height, labels }, segments };
    View {
        name,
        photo: Photo { rgb, foreground, foreground_source: ForegroundSource::Alpha, over_white: true },
        segments,
    }
}

/// One segment on a background.
fn one_segment() -> View {
    view("000", (160, 120), 80, |x, y| u16::from((20..140).contains(&x) && (30..90).contains(&y)))
}

/// Two segments side by side on a background: 1 on the left, 2 on the right of column `border`.
fn two_segments(name: &'static str, tint: u8, border: u32) -> View {
    view(name, (160, 120), tint, |x, y| match (x, y) {
        (20..140, 30..90) if x < border => 1,
        (20..140, 30..90) => 2,
        _ => 0,
    })
}

fn prepare<'a>(views: &[View], prompts: &'a Prompts, options: &'a Options) -> Queries<'a> {
    prepare_about(AskAbout::Segments, views, prompts, options)
}

fn prepare_about<'a>(about: AskAbout, views: &[View], prompts: &'a Prompts, options: &'a Options) -> Queries<'a> {
    let ids: Vec<Vec<u16>> =
        views.iter().map(|view| view.segments.segments.iter().map(|segment| segment.id).collect()).collect();
    let maps: Vec<[Cow<LabelMap>; 1]> = views.iter().map(|view| [Cow::Borrowed(&view.segments.map)]).collect();
    let inputs = views.iter().zip(&maps).zip(&ids);
    let inputs: Vec<ViewSubjects> =
        inputs.map(|((view, maps), ids)| ViewSubjects { name: view.name, photo: &view.photo, maps, ids }).collect();
    Queries::prepare(&inputs, MaterialLibrary::builtin(), prompts, options, about).expect("made-up views are sound")
}

fn small() -> Options {
    Options { sheet_size: 256, ..Options::default() }
}

fn recordings(folder: &Path) -> Recordings {
    Recordings::open(&[], folder).expect("the folder is readable")
}

/// The client that the options ask for, online and without progress messages.
fn connect(options: &Options, key: Option<ApiKey>) -> Result<Option<Client>, ClientError> {
    Client::new(options, key, Ok(()), Progress::HIDDEN)
}

fn run(queries: &Queries, recordings: &Recordings, asker: Option<&dyn Asker>) -> Result<Run, QueryError> {
    queries.run(recordings, asker, &Budget::new(None, queries.options.max_usd), Progress::HIDDEN)
}

/// An answer about a part that names `material` with the library's values, as a model would write it.
pub fn good_answer_about_part(material: &str) -> Value {
    let mut answer = good_answer(material);
    for field in ["inside", "filling", "fill_share", "bulk_density_kg_m3", "bulk_reason"] {
        answer[field] = Value::Null;
    }
    answer
}

/// As [`good_answer_about_part`], to a question that follows the one about the object: this else, with these probabilities.
pub fn good_answer_with(material: &str, alternatives: &[(&str, f64)]) -> Value {
    let alternative = |(material, probability): &(&str, f64)| {
        let row = MaterialLibrary::builtin().get(material).expect("the library has the test's material");
        json!({
            "family": row.family, "material": material, "wall_thickness_mm": null, "probability": probability,
            "density_kg_m3": [row.density_kg_m3.low, row.density_kg_m3.high],
        })
    };
    let alternatives: Vec<Value> = alternatives.iter().map(alternative).collect();
    with(good_answer_about_part(material), "alternatives", alternatives.into())
}

/// As [`good_answer_about_part`], about a segment.
pub fn good_answer(material: &str) -> Value {
    let row = MaterialLibrary::builtin().get(material).expect("the library has the test's material");
    json!({
        "caption": "a part",
        "several_materials": false,
        "family": row.family,
        "material": material,
        "density_kg_m3": [row.density_kg_m3.low, row.density_kg_m3.high],
        "youngs_modulus_mpa": [row.youngs_modulus_pa.low / 1e6, row.youngs_modulus_pa.high / 1e6],
        "poisson_ratio": [row.poisson_ratio.low, row.poisson_ratio.high],
        "yield_strength_mpa": [row.strength_pa.low / 1e6, row.strength_pa.high / 1e6],
        "shore_scale": "none",
        "shore_hardness": null,
        "friction_rubber": [row.friction_rubber.low, row.friction_rubber.high],
        "form": "solid",
        "wall_thickness_mm": null,
        "confidence": 0.8
    })
}

/// The answer with one field changed.
fn with(mut answer: Value, field: &str, value: Value) -> Value {
    answer[field] = value;
    answer
}

/// An asker that returns the result of a closure and stores the questions.
struct Scripted<F> {
    answerer: Answerer,
    say: F,
    /// Prompt and correction of each question, in the order of arrival.
    asked: Mutex<Vec<(String, Option<String>)>>,
}

impl<F: Fn(&Request) -> Result<ReplyContent, AskError> + Sync> Scripted<F> {
    fn new(say: F) -> Self {
        let answerer = Answerer { model: "scripted".into(), parameters: json!({ "temperature": 0.0 }) };
        Self { answerer, say, asked: Mutex::default() }
    }

    fn count(&self) -> usize {
        self.asked.lock().unwrap().len()
    }
}

impl<F: Fn(&Request) -> Result<ReplyContent, AskError> + Sync> Asker for Scripted<F> {
    fn answerer(&self) -> &Answerer {
        &self.answerer
    }

    fn parallel(&self) -> usize {
        3
    }

    fn ask(&self, request: Request, account: &Account) -> Result<Reply, AskError> {
        let entry = account.open()?;
        let correction = request.correction.map(|correction| correction.prompt.to_owned());
        self.asked.lock().unwrap().push((request.question.prompt.clone(), correction));
        let usage = Some(Usage { input_tokens: 1000, output_tokens: 100 });
        let content = (self.say)(&request);
        match &content {
            Ok(_) => entry.answered(usage),
            Err(_) => entry.not_billed(),
        }
        content.map(|content| Reply { content, usage, served_model: None })
    }
}

/// A text from the model.
fn text(text: impl ToString) -> Result<ReplyContent, AskError> {
    Ok(ReplyContent::Text(text.to_string()))
}

/// A chat completion with the content `text`.
pub fn completion(text: &str) -> Value {
    json!({
        "id": "1", "object": "chat.completion", "model": "test-model-0001",
        "choices": [{ "index": 0, "finish_reason": "stop", "message": { "role": "assistant", "content": text } }],
        "usage": { "prompt_tokens": 1200, "completion_tokens": 80, "total_tokens": 1280 }
    })
}

/// A view of `count` segments of 4 x 4 pixels each, up to 25 in a row.
fn grid(count: u32) -> View {
    view("000", (count.min(25) * 4, count.div_ceil(25) * 4), 80, |x, y| (1 + x / 4 + 25 * (y / 4)) as u16)
}

/// The first material of a family.
pub fn a(family: &'static str) -> &'static str {
    &MaterialLibrary::builtin().of_family(family).next().expect("the library has the family").name
}
