//! How long the object is: what such an object is, and what its length follows from. It is asked only with `--scale
//! estimate`.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::whole::{Purpose, WHOLE, WholeQuestion};
use crate::query::answer::Problem;
use crate::query::options::Options;
use crate::query::question::prompt::{PromptError, Prompts};
use crate::query::question::schema::Schema;
use crate::query::question::sheet::Sheet;
use crate::query::question::shown_subject::ShownSubject;
use crate::query::question::{Question, TOKENS_OF_GUESS};
use crate::query::recorded::Mask;
use crate::scene::Photo;
use crate::units::Range;

const M_PER_CM: f64 = 1e-2;
/// The least ratio of the two ends: a picture does not tell the length of an object more precisely than to 2 %.
const NARROWEST: f64 = 1.02;

/// The answer to the question.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Size {
    /// The object, as the model names it.
    pub object: String,
    /// The clues from which the length follows, in the model's words.
    pub clues: String,
    /// Holds the true length in nine of ten cases, as the model believes.
    pub longest_side_m: Range,
}

/// The fields of `prompts/size.schema.json`.
#[derive(Debug, Deserialize)]
struct Written {
    object: String,
    clues: String,
    longest_side_cm: Range,
}

/// The question about the object in `photo`, which is that of `view`.
///
/// # Errors
/// If the user's schema cannot be used.
pub fn question(
    view: &str,
    photo: &Photo,
    prompts: &Prompts,
    options: &Options,
) -> Result<WholeQuestion<Size>, PromptError> {
    let (mask, sheet) = (Mask::of_foreground(&photo.foreground), Sheet::of_object(photo, options.sheet_size));
    let shown = ShownSubject::new(view, WHOLE, photo, mask, &sheet);
    let (file, schema) = prompts.size_schema();
    let question = Question::new(prompts.size().to_owned(), Schema::new(file, schema.clone(), &[], &[])?);
    let question = question.answered_in(TOKENS_OF_GUESS);
    Ok(WholeQuestion::new(Purpose::Size, shown, question, read))
}

fn read(value: Value) -> Result<Size, Problem> {
    let Written { object, clues, longest_side_cm: Range { low, high } } =
        serde_json::from_value(value).map_err(|error| Problem::invalid(format!("{error}.")))?;
    let (low, high) = (low.min(high), low.max(high));
    if !(low > 0.0 && high.is_finite()) {
        return Err(Problem::invalid("longest_side_cm: a length is more than 0; give the range in cm.".into()));
    }
    let wider = (NARROWEST / (high / low)).sqrt().max(1.0);
    let longest_side_m = Range::new(low / wider * M_PER_CM, high * wider * M_PER_CM);
    Ok(Size { object: object.trim().into(), clues: clues.trim().into(), longest_side_m })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn length(low: f64, high: f64) -> Result<Range, String> {
        let value = json!({ "object": " a hammer ", "clues": "its grip", "longest_side_cm": [low, high] });
        read(value).map(|size| size.longest_side_m).map_err(|problem| problem.reason)
    }

    #[test]
    fn lengths_are_in_metres_in_order_and_never_exact() {
        assert_eq!(length(28.0, 35.0).unwrap(), Range::new(0.28, 0.35000000000000003));
        assert_eq!(length(35.0, 28.0), length(28.0, 35.0));
        let exact = length(100.0, 100.0).unwrap();
        assert!((exact.high / exact.low - NARROWEST).abs() < 1e-12 && (exact.low * exact.high - 1.0).abs() < 1e-12);
        assert!(length(0.0, 30.0).unwrap_err().contains("more than 0"));
        assert!(length(-3.0, 30.0).is_err());
    }
}
