//! Finds the masks inside a decoder: an export that returns only the best of its four masks still computes all of them
//! as internal values.

use super::super::graph::Model;
use super::super::mismatch::Mismatch;
use super::super::runtime::{self, Runtime};
use super::super::{Embedding, LOGITS_SIDE};
use super::feed::{OUTPUTS, PromptShape, feed, standard_inputs};

/// Number of values, going back from an output, that are searched for the values of all masks. From the public export's
/// single mask they are a dozen steps away.
pub const SEARCHED_VALUES: usize = 48;

/// The values that hold the logits, `[batch, count, 256, 256]`, and the predicted IoU, `[batch, count]`, of all masks.
pub struct FourMasks {
    pub logits: String,
    pub scores: String,
    pub count: usize,
}

impl FourMasks {
    /// Searches backwards from the outputs for the nearest values that have the shapes of three or four masks.
    pub fn find(runtime: &Runtime, model: &Model, prompt: PromptShape) -> Result<Self, Mismatch> {
        let (batch, side) = (prompt.batch as i64, LOGITS_SIDE as i64);
        let [masks, scores] = OUTPUTS.map(|output| model.ancestors(output, SEARCHED_VALUES));
        let mut all: Vec<&str> = masks.iter().chain(&scores).copied().collect();
        all.sort_unstable();
        all.dedup();
        let mut session = runtime::session(runtime, &model.with_outputs(&all))?;
        let (blank, points) = (Embedding::blank(), prompt.blank());
        let standard = standard_inputs(&blank, &points, prompt);
        let inputs = feed(&session, &standard)?;
        let values = session.run(inputs)?;
        // An output that no node makes is not among the values.
        let shape_of =
            |name: &&str| values.get(*name)?.try_extract_tensor::<f32>().map(|(shape, _)| shape.to_vec()).ok();
        let nearest = |names: &[&str], shape: &[i64]| {
            names.iter().find(|name| shape_of(name).is_some_and(|found| found == shape)).map(|name| (*name).to_owned())
        };
        for count in [4, 3] {
            let logits = nearest(&masks, &[batch, count, side, side]);
            let scores = nearest(&scores, &[batch, count]);
            if let (Some(logits), Some(scores)) = (logits, scores) {
                return Ok(Self { logits, scores, count: count as usize });
            }
        }
        let found = shape_of(&OUTPUTS[0]).unwrap_or_default();
        Err(Mismatch::OneMask { name: OUTPUTS[0], found, batch, side })
    }
}
