//! The mask decoder computed by gprop ([`crate::sam`]). ONNX Runtime runs what comes before the transformer:
//! the prompt encoder, and once per image the embedding and its positional encoding.

use crate::sam::{CHANNELS, MASKS, MaskDecoder, PreparedEmbedding, Scratch, TOKENS};
use ort::session::SessionOutputs;

use super::super::graph::Model;
use super::super::mismatch::Mismatch;
use super::super::pool::Pool;
use super::super::runtime::{self, Runtime, Session};
use super::super::{Decoded, Embedding};
use super::Wanted;
use super::feed::{PromptShape, feed, standard_inputs};
use super::weights::{self, Sources};

/// The native mask decoder and the sessions that feed it.
pub struct Native {
    mask_decoder: MaskDecoder,
    sources: Sources,
    prompt: PromptShape,
    image: Pool<Session>,
    tokens: Pool<Session>,
    scratch: Pool<Scratch>,
}

impl Native {
    /// Loads the decoder for use on `threads` threads at once. The error says how the model differs from SAM's.
    pub fn open(runtime: &Runtime, model: &Model, prompt: PromptShape, threads: usize) -> Result<Self, Mismatch> {
        let constants = model.constants();
        let mask_decoder = MaskDecoder::new(weights::read(model, &constants)?);
        let sources = Sources::find(model, &constants)?;
        let sessions = |outputs: &[&str], count: usize| -> ort::Result<_> {
            let cut = model.with_outputs(outputs);
            Ok(Pool::new((0..count).map(|_| runtime::session(runtime, &cut)).collect::<Result<_, _>>()?))
        };
        let image = sessions(&[&sources.image_embedding, &sources.positional_encoding], 1)?;
        let tokens = sessions(&[&sources.tokens], threads)?;
        let scratch = Pool::new((0..threads).map(|_| Scratch::default()).collect());
        let native = Self { mask_decoder, sources, prompt, image, tokens, scratch };
        native.tokens_of(&[])?;
        Ok(native)
    }

    pub fn prepare(&self, embedding: &Embedding, shown: [usize; 2]) -> Result<PreparedEmbedding, Mismatch> {
        let blank = self.prompt.blank();
        let standard = standard_inputs(embedding, &blank, self.prompt);
        self.image.with(|session| {
            let inputs = feed(session, &standard)?;
            let outputs = session.run(inputs)?;
            // The same for every prompt of a batch.
            let first = |name: &str| {
                let values = floats(&outputs, name)?.get(..embedding.0.len());
                values.map(<[f32]>::to_vec).ok_or_else(|| Mismatch::SmallValue(name.to_owned()))
            };
            let embedding = first(&self.sources.image_embedding)?;
            Ok(self.mask_decoder.prepare(embedding, first(&self.sources.positional_encoding)?, shown))
        })
    }

    pub fn run(
        &self,
        image: &PreparedEmbedding,
        points: &[[f32; 2]],
        wanted: &Wanted<'_>,
        mut take: impl FnMut(usize, Decoded<'_>),
    ) -> Result<(), Mismatch> {
        let tokens = self.tokens_of(points)?;
        let of_prompt = tokens.chunks_exact(tokens.len() / self.prompt.batch);
        // The first mask is the one for unambiguous prompts; the others are the three levels.
        let levels = |scores: &[f32; MASKS]| [scores[1], scores[2], scores[3]];
        self.scratch.with(|scratch| {
            for (index, tokens) in of_prompt.enumerate().take(points.len()) {
                let wanted_masks = |scores: &[f32; MASKS]| {
                    let [small, middle, large] = wanted(&levels(scores));
                    [false, small, middle, large]
                };
                let scores = self.mask_decoder.decode(image, tokens, &wanted_masks, scratch);
                let mut made = scratch.logits.iter().map(<[f32; _]>::as_slice);
                let logits = wanted(&levels(&scores)).map(|is_wanted| if is_wanted { made.next() } else { None });
                take(index, Decoded { logits, predicted_iou: levels(&scores) });
            }
        });
        Ok(())
    }

    /// Computes the tokens, `[batch, tokens, CHANNELS]`, and checks that there are as many as SAM's prompts have.
    fn tokens_of(&self, points: &[[f32; 2]]) -> Result<Vec<f32>, Mismatch> {
        let prompt = self.prompt.fill(points);
        let of_prompt = prompt.inputs(self.prompt);
        self.tokens.with(|session| {
            let inputs = feed(session, &of_prompt)?;
            let outputs = session.run(inputs)?;
            let tokens = floats(&outputs, &self.sources.tokens)?;
            let is_of_sam = |count| tokens.len() == count * self.prompt.batch * CHANNELS;
            let fits = (MASKS + 1..=TOKENS).any(is_of_sam);
            fits.then(|| tokens.to_vec()).ok_or(Mismatch::Tokens(tokens.len()))
        })
    }
}

fn floats<'a>(outputs: &'a SessionOutputs<'_>, name: &str) -> Result<&'a [f32], Mismatch> {
    Ok(outputs[name].try_extract_tensor::<f32>()?.1)
}
