//! How heavy the object is, judged from its photos alone: what a user gets without gprop, for comparison.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::whole::{Purpose, WHOLE, WholeQuestion};
use crate::query::answer::Problem;
use crate::query::options::Options;
use crate::query::question::prompt::{PromptError, Prompts};
use crate::query::question::schema::Schema;
use crate::query::question::sheet::Sheet;
use crate::query::question::sheet::sides::{Bare, Side};
use crate::query::question::shown_subject::ShownSubject;
use crate::query::question::{Question, TOKENS_OF_GUESS};
use crate::query::recorded::Mask;
use crate::units::Estimate;

const KG_PER_G: f64 = 1e-3;

/// A guess of the mass of the whole object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DirectGuess {
    /// The object, as the model names it.
    pub object: String,
    /// What its mass follows from, in the model's words.
    pub clues: String,
    /// The model's best guess, and the range that holds the truth in nine of ten such cases, as the model believes.
    pub mass_kg: Estimate,
}

/// The fields of `prompts/direct.schema.json`.
#[derive(Debug, Deserialize)]
struct Written {
    object: String,
    clues: String,
    mass_g: [f64; 3],
}

/// The question about the object that the photos of `sides` show.
///
/// # Errors
/// If the user's schema cannot be used.
///
/// # Panics
/// If there is no side.
pub fn question(
    sides: &[Side],
    outer_size: Option<&str>,
    prompts: &Prompts,
    options: &Options,
) -> Result<WholeQuestion<DirectGuess>, PromptError> {
    let Side { view, photo, .. } = sides[0];
    let sides: Vec<Side> = sides.iter().map(|side| Side { map: None, ..*side }).collect();
    let sheet = Sheet::of_sides(&sides, outer_size, Bare::No, options.sheet_size);
    let shown = ShownSubject::new(view, WHOLE, photo, Mask::of_foreground(&photo.foreground), &sheet);
    let (file, schema) = prompts.direct_schema();
    let question = Question::new(prompts.direct().to_owned(), Schema::new(file, schema.clone(), &[], &[])?);
    let question = question.answered_in(TOKENS_OF_GUESS);
    Ok(WholeQuestion::new(Purpose::DirectGuess, shown, question, read))
}

fn read(value: Value) -> Result<DirectGuess, Problem> {
    let Written { object, clues, mass_g: [low, mid, high] } =
        serde_json::from_value(value).map_err(|error| Problem::invalid(format!("{error}.")))?;
    let mass_kg = Estimate::new(low, mid, high).scaled(KG_PER_G);
    if !mass_kg.is_positive() {
        let problem = "mass_g: give [low, mid, high] in g, in this order, all more than 0.";
        return Err(Problem::invalid(problem.to_owned()));
    }
    Ok(DirectGuess { object: object.trim().into(), clues: clues.trim().into(), mass_kg })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_guess_is_in_kilograms_and_in_order() {
        let read = |mass: [f64; 3]| read(json!({ "object": "a mug", "clues": "stoneware", "mass_g": mass }));
        assert_eq!(read([250.0, 330.0, 420.0]).unwrap().mass_kg, Estimate::new(0.25, 0.33, 0.42));
        assert!(read([420.0, 330.0, 250.0]).unwrap_err().reason.contains("in this order"));
        assert!(read([0.0, 330.0, 420.0]).is_err());
    }
}
