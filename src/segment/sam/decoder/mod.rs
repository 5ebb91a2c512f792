//! From a prompt to masks: SAM's prompt encoder and mask decoder, which exports contain in one graph.
//!
//! 1. `feed`: the inputs of the standard export.
//! 2. `four_masks`: finds the logits of all masks and their predicted IoU. An export that returns only the best of its
//!    four masks still computes all of them as internal values.
//! 3. `onnx_runtime`: ONNX Runtime runs the whole export for every prompt.
//! 4. `native`: ONNX Runtime runs the prompt encoder, and gprop the mask decoder ([`crate::sam`]) with the
//!    parameters that `weights` finds in the export, several times faster. It is used if the export has SAM's parameters
//!    under their names and the results of both agree on a trial.

mod feed;
mod four_masks;
mod native;
mod onnx_runtime;
mod weights;

use std::path::Path;

use crate::sam::{PreparedEmbedding, SIDE};

use super::super::error::SegmentError;
use super::super::options::DecoderRuntime;
use super::graph::Model;
use super::mismatch::Mismatch;
use super::runtime::{self, Runtime};
use super::{Decoded, Embedding, LOGITS_SIDE, MODEL_SIDE, not_sam, unloadable};
use feed::{OUTPUTS, PromptShape, check_names};
use four_masks::SEARCHED_VALUES;
use native::Native;
use onnx_runtime::OnnxRuntime;

const DECODER: &str = "a SAM prompt decoder (the standard export)";
/// Number of pixels in one mask's logits.
const LOGITS: usize = LOGITS_SIDE * LOGITS_SIDE;
/// Largest difference between the two decoders on the trial: of the predicted IoU, and of the logits in units of the
/// largest one.
const AGREEMENT: f32 = 1e-3;

/// Selects which of the three masks to compute, given the predicted IoU of all.
pub type Wanted<'a> = dyn Fn(&[f32; 3]) -> [bool; 3] + 'a;

/// The decoder, ready to run on several threads at once.
pub struct Decoder {
    prompt: PromptShape,
    backend: Backend,
}

enum Backend {
    Native(Box<Native>),
    OnnxRuntime(OnnxRuntime),
}

/// An image's embedding with the parts of the decoder's work that do not depend on the prompt.
pub enum Prepared {
    Native(PreparedEmbedding),
    OnnxRuntime(Embedding),
}

/// Checks everything that gprop itself reads from an export, without running any of it: names, the prompt's shape, the
/// parameters, the graph reduced to other outputs.
pub fn check(bytes: &[u8]) -> Result<(), Mismatch> {
    let model = Model::parse(bytes).ok_or(Mismatch::NotOnnx)?;
    let names = check_names(&model);
    let prompt = PromptShape::of(&model).map(PromptShape::blank);
    let inside = model.ancestors(OUTPUTS[0], SEARCHED_VALUES);
    let constants = model.constants();
    let weights = weights::read(&model, &constants);
    let sources = weights::Sources::find(&model, &constants);
    Model::parse(&model.with_outputs(&inside)).ok_or(Mismatch::Uncut)?;
    names.and(prompt.map(drop)).and(weights.map(drop)).and(sources.map(drop))
}

impl Decoder {
    /// Loads the model in `bytes`, read from `path`, for use on `threads` threads at once. Without a `choice`, gprop's
    /// own mask decoder is used if possible.
    pub fn open(
        runtime: &Runtime,
        path: &Path,
        bytes: &[u8],
        choice: Option<DecoderRuntime>,
        threads: usize,
    ) -> Result<Self, SegmentError> {
        let model = Model::parse(bytes).ok_or(Mismatch::NotOnnx).map_err(unloadable(path, DECODER))?;
        // ONNX Runtime reports errors in the file as a whole.
        runtime::session(runtime, bytes).map_err(unloadable(path, DECODER))?;
        let not_sam = not_sam(path, DECODER);
        check_names(&model).map_err(&not_sam)?;
        let prompt = PromptShape::of(&model).map_err(&not_sam)?;
        let exported = |threads: usize| {
            let backend = OnnxRuntime::open(runtime, &model, prompt, threads).map_err(&not_sam)?;
            Ok(Self { prompt, backend: Backend::OnnxRuntime(backend) })
        };
        if choice == Some(DecoderRuntime::OnnxRuntime) {
            return exported(threads);
        }
        match Self::native(runtime, &model, prompt, threads, &exported(1)?) {
            Ok(native) => Ok(native),
            Err(source) if choice == Some(DecoderRuntime::Native) => {
                Err(SegmentError::NoNativeDecoder { path: path.to_owned(), source })
            }
            Err(reason) => {
                tracing::info!("ONNX Runtime runs the SAM decoder, which is slower: {reason}");
                exported(threads)
            }
        }
    }

    /// The native decoder, if it decodes a trial prompt as the `exported` one does.
    fn native(
        runtime: &Runtime,
        model: &Model,
        prompt: PromptShape,
        threads: usize,
        exported: &Self,
    ) -> Result<Self, Mismatch> {
        let native = Box::new(Native::open(runtime, model, prompt, threads)?);
        let native = Self { prompt, backend: Backend::Native(native) };
        native.check_against(exported)?;
        Ok(native)
    }

    /// True if gprop computes the mask decoder itself.
    pub fn is_native(&self) -> bool {
        matches!(self.backend, Backend::Native(_))
    }

    /// Number of prompts in a run.
    pub fn batch(&self) -> usize {
        self.prompt.batch
    }

    /// Does the work that does not depend on the prompt. Logits are wanted for the first `shown` columns and rows of the
    /// embedding.
    pub fn prepare(&self, embedding: &Embedding, shown: [usize; 2]) -> Result<Prepared, Mismatch> {
        match &self.backend {
            Backend::Native(native) => native.prepare(embedding, shown).map(Prepared::Native),
            Backend::OnnxRuntime(_) => Ok(Prepared::OnnxRuntime(embedding.clone())),
        }
    }

    /// Decodes up to [`Self::batch`] point prompts and passes the masks of each to `take`, with the prompt's index.
    pub fn run(
        &self,
        image: &Prepared,
        points: &[[f32; 2]],
        wanted: &Wanted<'_>,
        take: impl FnMut(usize, Decoded<'_>),
    ) -> Result<(), Mismatch> {
        match (&self.backend, image) {
            (Backend::Native(native), Prepared::Native(image)) => native.run(image, points, wanted, take),
            (Backend::OnnxRuntime(exported), Prepared::OnnxRuntime(image)) => exported.run(image, points, wanted, take),
            _ => Err(Mismatch::OtherDecoder),
        }
    }

    /// Checks that both decoders give the same result for a prompt on a made-up picture.
    fn check_against(&self, other: &Self) -> Result<(), Mismatch> {
        // Any values will do if they are as large as those of an embedding and the same every time.
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let embedding = Embedding(Embedding::blank().0.iter().map(|_| next()).collect());
        let point = [0.4 * MODEL_SIDE as f32, 0.3 * MODEL_SIDE as f32];
        let decode = |decoder: &Self| -> Result<(Vec<f32>, [f32; 3]), Mismatch> {
            let mut answer = (Vec::new(), [0.0; 3]);
            decoder.run(&decoder.prepare(&embedding, [SIDE; 2])?, &[point], &|_| [true; 3], |_, decoded| {
                answer = (decoded.logits.into_iter().flatten().flatten().copied().collect(), decoded.predicted_iou);
            })?;
            Ok(answer)
        };
        let ((logits, scores), (expected_logits, expected_scores)) = (decode(self)?, decode(other)?);
        let greatest = |values: &[f32]| values.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
        let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
        let of_logits = apart(&logits, &expected_logits) / greatest(&expected_logits);
        let of_scores = apart(&scores, &expected_scores);
        tracing::debug!("trial of the SAM decoder: logits {of_logits:e} and predicted IoU {of_scores:e} apart");
        if of_logits <= AGREEMENT && of_scores <= AGREEMENT {
            Ok(())
        } else {
            Err(Mismatch::Trial { logits: of_logits, predicted_iou: of_scores })
        }
    }
}
