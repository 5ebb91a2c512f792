//! The prompt decoder.
//!
//! 1. `feed`: the inputs of the standard export.
//! 2. `four_masks`: where the logits of all masks and their predicted IoU lie. An export that returns only the best of
//!    its four masks has all of them as values inside.
//! 3. `whole`: ONNX Runtime runs the export as it is, for every prompt.
//! 4. `fused`, which `quick` feeds: gprop computes SAM's mask decoder itself, several times faster. It serves where the
//!    export has SAM's parameters by their names and where both ways agree on a trial.

mod feed;
mod four_masks;
mod fused;
mod quick;
mod whole;

use std::path::Path;

use super::super::error::SegmentError;
use super::graph::Model;
use super::runtime::{self, Runtime};
use super::{Decoded, Embedding, LOGITS_SIDE, MODEL_SIDE, Mismatch, not_sam, unloadable};
use feed::{OUTPUTS, PromptShape, check_names};
use four_masks::SEARCHED_VALUES;
use quick::Quick;
use whole::Whole;

const DECODER: &str = "a SAM prompt decoder (the standard export)";
/// Pixels of one mask's logits.
const LOGITS: usize = LOGITS_SIDE * LOGITS_SIDE;
/// How far apart both ways may be on the trial: predicted IoU, and logits in units of their spread.
const AGREEMENT: f32 = 1e-3;

/// Which of the three masks are worth making, given the predicted IoU of all.
pub type Wanted<'a> = dyn Fn(&[f32; 3]) -> [bool; 3] + 'a;

/// The decoder, ready to run on several threads at once.
pub struct Decoder {
    prompt: PromptShape,
    backend: Backend,
}

enum Backend {
    Quick(Box<Quick>),
    Whole(Whole),
}

/// What a prompt takes of one picture.
pub enum PictureValues {
    Quick(fused::Picture),
    Whole(Embedding),
}

/// Reads what gprop itself makes of an export, without running any of it: names, the prompt's shape, the parameters, the
/// graph cut to other outputs.
pub fn check(bytes: &[u8]) -> Result<(), Mismatch> {
    let model = Model::parse(bytes).ok_or(Mismatch::NotOnnx)?;
    let names = check_names(&model);
    let prompt = PromptShape::of(&model).map(PromptShape::blank);
    let inside = model.ancestors(OUTPUTS[0], SEARCHED_VALUES);
    let constants = model.constants();
    let fused = fused::Fused::read(&model, &constants);
    let sources = fused::Sources::find(&model, &constants);
    Model::parse(&model.with_outputs(&inside)).ok_or(Mismatch::Uncut)?;
    names.and(prompt.map(drop)).and(fused.map(drop)).and(sources.map(drop))
}

impl Decoder {
    /// Loads the model in `bytes`, read from `path`, for use on `threads` threads at once.
    pub fn open(runtime: &Runtime, path: &Path, bytes: &[u8], threads: usize) -> Result<Self, SegmentError> {
        let model = Model::parse(bytes).ok_or(Mismatch::NotOnnx).map_err(unloadable(path, DECODER))?;
        // What is wrong with the file as a whole is ONNX Runtime's to say.
        runtime::session(runtime, bytes).map_err(unloadable(path, DECODER))?;
        Self::of_model(runtime, &model, threads).map_err(not_sam(path, DECODER))
    }

    fn of_model(runtime: &Runtime, model: &Model, threads: usize) -> Result<Self, Mismatch> {
        check_names(model)?;
        let prompt = PromptShape::of(model)?;
        let whole = Self { prompt, backend: Backend::Whole(Whole::open(runtime, model, prompt, 1)?) };
        let quick = Quick::open(runtime, model, prompt, threads).and_then(|quick| {
            let quick = Self { prompt, backend: Backend::Quick(Box::new(quick)) };
            quick.check_against(&whole).map(|()| quick)
        });
        quick.or_else(|reason| {
            tracing::info!("the SAM decoder runs as exported, which is slower: {reason}");
            Ok(Self { prompt, backend: Backend::Whole(Whole::open(runtime, model, prompt, threads)?) })
        })
    }

    /// Whether gprop computes it itself.
    pub fn is_quick(&self) -> bool {
        matches!(self.backend, Backend::Quick(_))
    }

    /// How many prompts a run takes.
    pub fn batch(&self) -> usize {
        self.prompt.batch
    }

    /// Computes what the prompts need of a picture.
    pub fn prepare(&self, embedding: &Embedding) -> Result<PictureValues, Mismatch> {
        match &self.backend {
            Backend::Quick(quick) => quick.prepare(embedding).map(PictureValues::Quick),
            Backend::Whole(_) => Ok(PictureValues::Whole(embedding.clone())),
        }
    }

    /// Decodes up to [`Self::batch`] point prompts and hands the masks of each to `take`, with the prompt's index.
    pub fn run(
        &self,
        picture: &PictureValues,
        points: &[[f32; 2]],
        wanted: &Wanted<'_>,
        take: impl FnMut(usize, Decoded<'_>),
    ) -> Result<(), Mismatch> {
        match (&self.backend, picture) {
            (Backend::Quick(quick), PictureValues::Quick(picture)) => quick.run(picture, points, wanted, take),
            (Backend::Whole(whole), PictureValues::Whole(embedding)) => whole.run(embedding, points, wanted, take),
            _ => Err(Mismatch::OtherDecoder),
        }
    }

    /// Whether both decode a prompt to a made-up picture alike.
    fn check_against(&self, other: &Self) -> Result<(), Mismatch> {
        // Any values will do that are as large as an embedding's and the same every time.
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let embedding = Embedding(Embedding::blank().0.iter().map(|_| next()).collect());
        let point = [0.4 * MODEL_SIDE as f32, 0.3 * MODEL_SIDE as f32];
        let decode = |decoder: &Self| -> Result<(Vec<f32>, [f32; 3]), Mismatch> {
            let mut answer = (Vec::new(), [0.0; 3]);
            decoder.run(&decoder.prepare(&embedding)?, &[point], &|_| [true; 3], |_, decoded| {
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
