//! The prompt decoder, cut in two when it is loaded: what depends on the picture alone runs once a picture, and only what
//! a prompt changes runs for every prompt.
//!
//! 1. `feed`: the inputs of the standard export.
//! 2. `four_masks`: where the logits of all masks and their predicted IoU lie. An export that returns only the best of
//!    its four masks has all of them as values inside.
//! 3. `split`: values that no prompt changes are taken out of the prompts' part. Those that depend on shapes alone
//!    become constants, the others (the first layer's projections of the picture) its inputs.

mod feed;
mod four_masks;
mod split;

use std::path::Path;

use ort::session::Session;

use super::super::error::SegmentError;
use super::graph::{Input, Model};
use super::pool::Pool;
use super::runtime::{self, Runtime};
use super::{Decoded, Embedding, LOGITS_SIDE, not_sam, unloadable};
use feed::{Fed, PromptShape, check_names, feed, standard_inputs};
use four_masks::FourMasks;
use split::{Split, split, whole};

const DECODER: &str = "a SAM prompt decoder (the standard export)";
/// Pixels of one mask's logits.
const LOGITS: usize = LOGITS_SIDE * LOGITS_SIDE;

/// The decoder, ready to run on several threads at once.
pub struct Decoder {
    plan: Plan,
    /// `None` where the model cannot be cut: then its picture inputs go straight to the prompts' part.
    picture: Option<Pool<Session>>,
    prompt: Pool<Session>,
}

/// How to run the two parts.
struct Plan {
    prompt: PromptShape,
    /// What the prompts' part takes of the picture.
    picture_values: Vec<Input>,
    outputs: FourMasks,
}

/// What the prompts' part takes of one picture, in the order of the plan.
pub struct PictureValues(Vec<Vec<f32>>);

impl Decoder {
    /// Loads the model in `bytes`, read from `path`, for use on `threads` threads at once.
    pub fn open(runtime: &Runtime, path: &Path, bytes: &[u8], threads: usize) -> Result<Self, SegmentError> {
        let not_onnx = || unloadable(path, DECODER)("it is no ONNX model, or one cut short".to_owned());
        let model = Model::parse(bytes).ok_or_else(not_onnx)?;
        // What is wrong with the file as a whole is ONNX Runtime's to say.
        runtime::session(runtime, bytes).map_err(unloadable(path, DECODER))?;
        Self::of_model(runtime, &model, threads).map_err(not_sam(path, DECODER))
    }

    fn of_model(runtime: &Runtime, model: &Model, threads: usize) -> Result<Self, String> {
        check_names(model)?;
        let prompt = PromptShape::of(model)?;
        let outputs = FourMasks::find(runtime, model, prompt)?;
        let Split { picture_model, prompt_model, picture_values } =
            if model.is_plain() { split(runtime, model, prompt, &outputs)? } else { whole(model, &outputs) };
        let pool = |model: &[u8], count: usize| -> Result<_, String> {
            Ok(Pool::new((0..count).map(|_| runtime::session(runtime, model)).collect::<Result<_, _>>()?))
        };
        Ok(Self {
            picture: picture_model.map(|model| pool(&model, 1)).transpose()?,
            prompt: pool(&prompt_model, threads)?,
            plan: Plan { prompt, picture_values, outputs },
        })
    }

    /// How many prompts a run takes.
    pub fn batch(&self) -> usize {
        self.plan.prompt.batch
    }

    /// Computes what the prompts' part needs of a picture.
    pub fn look(&self, embedding: &Embedding) -> Result<PictureValues, String> {
        let points = self.plan.prompt.blank();
        let standard = standard_inputs(embedding, &points, self.plan.prompt);
        let given = |name: &str| standard.iter().find(|fed| fed.0 == name).map(|fed| fed.2.to_vec());
        let names: Vec<&str> = self.plan.picture_values.iter().map(|value| value.name.as_str()).collect();
        let Some(pool) = &self.picture else {
            return Ok(PictureValues(names.into_iter().filter_map(given).collect()));
        };
        pool.with(|session| {
            let inputs = feed(session, &standard)?;
            let outputs = session.run(inputs).map_err(|error| error.to_string())?;
            let value = |name: &str| match given(name) {
                Some(value) => Ok(value),
                None => Ok(outputs[name].try_extract_tensor::<f32>().map_err(|error| error.to_string())?.1.to_vec()),
            };
            Ok(PictureValues(names.into_iter().map(value).collect::<Result<_, String>>()?))
        })
    }

    /// Decodes up to [`Self::batch`] point prompts and hands the masks of each to `take`, with the prompt's index.
    pub fn run(
        &self,
        picture: &PictureValues,
        points: &[[f32; 2]],
        mut take: impl FnMut(usize, Decoded<'_>),
    ) -> Result<(), String> {
        let failed = |error: ort::Error| error.to_string();
        let prompt = self.plan.prompt.fill(points);
        let values = self.plan.picture_values.iter().zip(&picture.0);
        let mut fed: Vec<Fed<'_>> =
            values.map(|(input, values)| (input.name.as_str(), input.shape.clone(), values.as_slice())).collect();
        fed.extend(prompt.inputs(self.plan.prompt));
        self.prompt.with(|session| {
            let inputs = feed(session, &fed)?;
            let outputs = session.run(inputs).map_err(failed)?;
            let four = &self.plan.outputs;
            let logits = outputs[four.logits.as_str()].try_extract_tensor::<f32>().map_err(failed)?.1;
            let scores = outputs[four.scores.as_str()].try_extract_tensor::<f32>().map_err(failed)?.1;
            let of_prompt = logits.chunks_exact(four.count * LOGITS).zip(scores.chunks_exact(four.count));
            for (index, (logits, scores)) in of_prompt.enumerate().take(points.len()) {
                // Of four masks the first is the one for unambiguous prompts; the others are the three levels.
                let first = four.count - 3;
                let level = |level: usize| &logits[(first + level) * LOGITS..][..LOGITS];
                let predicted_iou = [scores[first], scores[first + 1], scores[first + 2]];
                take(index, Decoded { logits: [level(0), level(1), level(2)], predicted_iou });
            }
            Ok(())
        })
    }
}
