//! The decoder run by ONNX Runtime, completely for every prompt.

use super::super::graph::Model;
use super::super::mismatch::Mismatch;
use super::super::pool::Pool;
use super::super::runtime::{self, Runtime, Session};
use super::super::{Decoded, Embedding};
use super::feed::{PromptShape, feed, standard_inputs};
use super::four_masks::FourMasks;
use super::{LOGITS, Wanted};

/// ONNX Runtime with the export, reduced to the values of all masks.
pub struct OnnxRuntime {
    sessions: Pool<Session>,
    prompt: PromptShape,
    outputs: FourMasks,
}

impl OnnxRuntime {
    /// Loads the decoder for use on `threads` threads at once.
    pub fn open(runtime: &Runtime, model: &Model, prompt: PromptShape, threads: usize) -> Result<Self, Mismatch> {
        let outputs = FourMasks::find(runtime, model, prompt)?;
        let cut = model.with_outputs(&[&outputs.logits, &outputs.scores]);
        let sessions = (0..threads).map(|_| runtime::session(runtime, &cut)).collect::<Result<_, _>>()?;
        Ok(Self { sessions: Pool::new(sessions), prompt, outputs })
    }

    pub fn run(
        &self,
        embedding: &Embedding,
        points: &[[f32; 2]],
        wanted: &Wanted<'_>,
        mut take: impl FnMut(usize, Decoded<'_>),
    ) -> Result<(), Mismatch> {
        let prompt = self.prompt.fill(points);
        let standard = standard_inputs(embedding, &prompt, self.prompt);
        self.sessions.with(|session| {
            let inputs = feed(session, &standard)?;
            let outputs = session.run(inputs)?;
            let four = &self.outputs;
            let logits = outputs[four.logits.as_str()].try_extract_tensor::<f32>()?.1;
            let scores = outputs[four.scores.as_str()].try_extract_tensor::<f32>()?.1;
            let of_prompt = logits.chunks_exact(four.count * LOGITS).zip(scores.chunks_exact(four.count));
            for (index, (logits, scores)) in of_prompt.enumerate().take(points.len()) {
                // If there are four masks, the first is the one for unambiguous prompts; the others are the three
                // levels.
                let first = four.count - 3;
                let predicted_iou = [scores[first], scores[first + 1], scores[first + 2]];
                let is_wanted = wanted(&predicted_iou);
                let level = |level: usize| is_wanted[level].then(|| &logits[(first + level) * LOGITS..][..LOGITS]);
                take(index, Decoded { logits: [level(0), level(1), level(2)], predicted_iou });
            }
            Ok(())
        })
    }
}
