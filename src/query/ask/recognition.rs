//! What the object is, and what its parts are made of: one question about the whole object, with all of its regions
//! numbered in one picture from several sides. It is asked with `--ask object`.

use super::whole::{Purpose, WHOLE, WholeQuestion};
use crate::materials::MaterialLibrary;
use crate::query::answer::recognition::{self, Recognition};
use crate::query::options::Options;
use crate::query::question::prompt::{PromptError, Prompts};
use crate::query::question::schema::Schema;
use crate::query::question::sheet::Sheet;
pub use crate::query::question::sheet::sides::{Bare, Layout, Side};
use crate::query::question::shown_subject::ShownSubject;
use crate::query::question::{Question, by_kind};
use crate::query::recorded::Mask;

/// What the question says of the object besides what its picture shows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Told<'a> {
    pub outer_size: Option<&'a str>,
    pub bare: Bare,
    /// A paragraph for the end of the prompt.
    pub hints: Option<&'a str>,
}

/// Tokens of an answer, and more for each region: the least squares of 27 answers about objects with 1 to 13 regions, of 1,190 to
/// 6,400 characters, at three characters of JSON for a token.
const TOKENS: u64 = 440;
const TOKENS_OF_REGION: u64 = 70;

/// The question about the object that `sides` show. The answer has to give every one of `numbers` to a piece.
///
/// # Errors
/// If the user's prompt or schema cannot be used.
///
/// # Panics
/// If there is no side.
pub fn question(
    sides: &[Side],
    numbers: Vec<u16>,
    told: Told,
    prompts: &Prompts,
    library: MaterialLibrary,
    options: &Options,
) -> Result<WholeQuestion<Recognition>, PromptError> {
    let Side { view, photo, map } = sides[0];
    let mask = map.map_or_else(|| Mask::of_foreground(&photo.foreground), Mask::of_regions);
    let sheet = Sheet::of_sides(sides, told.outer_size, told.bare, options.sheet_size);
    let shown = ShownSubject { regions: numbers.clone(), ..ShownSubject::new(view, WHOLE, photo, mask, &sheet) };
    let families: Vec<&str> = library.families().iter().map(|family| family.name.as_str()).collect();
    let prompt = prompts.object(&families.join("; "), &by_kind(&library))?;
    let prompt = match told.hints {
        Some(hints) => format!("{}\n\n{hints}\n", prompt.trim_end()),
        None => prompt,
    };
    let (file, schema) = prompts.object_schema();
    let tokens = TOKENS + TOKENS_OF_REGION * numbers.len() as u64;
    let question = Question::new(prompt, Schema::new(file, schema.clone(), &[], &[])?).answered_in(tokens);
    let read = move |value| recognition::read(value, &numbers, &library);
    Ok(WholeQuestion::new(Purpose::Recognition, shown, question, read))
}
