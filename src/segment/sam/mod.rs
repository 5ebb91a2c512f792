//! SAM's two networks: a picture becomes an embedding once, then each prompt becomes four masks.
//!
//! The encoder takes `[1,3,1024,1024]` and gives `[1,256,64,64]`. The decoder is the standard SAM export; one that returns a
//! single mask has all four as values inside, and is made to give them too (see [`FOUR_MASK_OUTPUTS`]).

mod pool;
mod runtime;

use std::path::Path;

use ort::session::{HasSelectedOutputs, OutputSelector, RunOptions, Session};
use ort::value::{TensorRef, ValueType};

use super::error::SegmentError;
use crate::setup::ModelFiles;
use pool::Pool;

/// Side of the square picture that the encoder sees.
pub const MODEL_SIDE: usize = 1024;
/// Side of the square logits that the decoder gives.
pub const LOGITS_SIDE: usize = 256;

const ENCODER_INPUT: [i64; 4] = [1, 3, MODEL_SIDE as i64, MODEL_SIDE as i64];
const EMBEDDING: [i64; 4] = [1, 256, 64, 64];
const ENCODER: &str = "a SAM image encoder ([1,3,1024,1024] float32 to [1,256,64,64])";
const DECODER: &str = "a SAM prompt decoder (the standard export)";
const DECODER_INPUTS: [&str; 6] =
    ["image_embeddings", "point_coords", "point_labels", "mask_input", "has_mask_input", "orig_im_size"];

/// Two `ValueInfoProto`s as outputs of a `GraphProto` of a `ModelProto`: `/Reshape_9_output_0`, float [?,?,?,?], the
/// logits of the four masks, and `/iou_prediction_head/layers.2/Gemm_output_0`, float [?,?], their predicted IoU.
/// Protobuf merges concatenated messages, so a model followed by these bytes has these two outputs more. The names are
/// those that PyTorch gives the values when it exports SAM's decoder.
const FOUR_MASK_OUTPUTS: &[u8] = b"\x3a\x52\
    \x62\x1b\x0a\x13/Reshape_9_output_0\x12\x04\x0a\x02\x08\x01\
    \x62\x33\x0a\x2b/iou_prediction_head/layers.2/Gemm_output_0\x12\x04\x0a\x02\x08\x01";
const FOUR_MASKS: &str = "/Reshape_9_output_0";
const FOUR_SCORES: &str = "/iou_prediction_head/layers.2/Gemm_output_0";

/// The networks, ready to run on several threads at once.
pub struct Sam {
    encoders: Pool<Session>,
    decoders: Pool<Decoder>,
}

/// What the encoder makes of one picture, `[1,256,64,64]`.
#[derive(Debug, Clone)]
pub struct Embedding(Vec<f32>);

/// The three nested masks of one prompt: small, middle, large.
#[derive(Debug, Clone, Copy)]
pub struct Decoded<'a> {
    /// Each 256 x 256, row by row.
    pub logits: [&'a [f32]; 3],
    pub predicted_iou: [f32; 3],
}

impl Sam {
    /// Loads the networks, `threads` times over so that as many threads can run them at once.
    ///
    /// # Errors
    /// Where ONNX Runtime or a model cannot be loaded, or a model has not the tensors of SAM.
    pub fn open(files: &ModelFiles, threads: usize) -> Result<Self, SegmentError> {
        let environment = runtime::load(&files.onnxruntime)?;
        let encoder = read(&files.encoder)?;
        let decoder = read(&files.decoder)?;
        let open_encoder = || -> Result<Session, SegmentError> {
            let session = runtime::session(&environment, &encoder).map_err(unloadable(&files.encoder, ENCODER))?;
            check_encoder(&session).map_err(not_sam(&files.encoder, ENCODER))?;
            Ok(session)
        };
        let open_decoder = || Decoder::open(&environment, &files.decoder, &decoder);
        let threads = threads.max(1);
        Ok(Self {
            encoders: Pool::new((0..threads).map(|_| open_encoder()).collect::<Result<_, _>>()?),
            decoders: Pool::new((0..threads).map(|_| open_decoder()).collect::<Result<_, _>>()?),
        })
    }

    /// Encodes a preprocessed picture, `[3,1024,1024]` as [`super::preprocess`] makes it.
    pub fn encode(&self, input: &[f32]) -> Result<Embedding, SegmentError> {
        let failed = |error: ort::Error| SegmentError::Run { what: "the SAM encoder", reason: error.to_string() };
        self.encoders.with(|session| {
            let input = TensorRef::from_array_view((ENCODER_INPUT, input)).map_err(failed)?;
            let outputs = session.run(ort::inputs![input]).map_err(failed)?;
            let (shape, values) = outputs[0].try_extract_tensor::<f32>().map_err(failed)?;
            if **shape == EMBEDDING {
                Ok(Embedding(values.to_vec()))
            } else {
                let reason = format!("it gave {shape} where {EMBEDDING:?} is expected");
                Err(SegmentError::Run { what: "the SAM encoder", reason })
            }
        })
    }

    /// Decodes one point prompt, (x, y) in the frame of the scaled picture (its longest side is 1024), and hands the
    /// masks to `take`.
    pub fn decode<T>(
        &self,
        embedding: &Embedding,
        point: [f32; 2],
        take: impl FnOnce(Decoded<'_>) -> T,
    ) -> Result<T, SegmentError> {
        self.decoders.with(|decoder| {
            decoder.run(embedding, point, take).map_err(|reason| SegmentError::Run { what: "the SAM decoder", reason })
        })
    }
}

/// A decoder session and which of its outputs to take.
struct Decoder {
    session: Session,
    masks: &'static str,
    scores: &'static str,
    /// Only the two outputs above: leaving the others out spares the decoder its final resize.
    outputs: RunOptions<HasSelectedOutputs>,
}

impl Decoder {
    fn open(environment: &ort::environment::Environment, path: &Path, model: &[u8]) -> Result<Self, SegmentError> {
        let has = |name: &str| model.windows(name.len()).any(|window| window == name.as_bytes());
        if has(FOUR_MASKS) && has(FOUR_SCORES) {
            let with_outputs = [model, FOUR_MASK_OUTPUTS].concat();
            // Another export may use these names for other things; then what the file itself offers counts.
            if let Ok(session) = runtime::session(environment, &with_outputs)
                && let Ok(decoder) = Self::new(session, FOUR_MASKS, FOUR_SCORES)
            {
                return Ok(decoder);
            }
        }
        let session = runtime::session(environment, model).map_err(unloadable(path, DECODER))?;
        Self::new(session, "low_res_masks", "iou_predictions").map_err(not_sam(path, DECODER))
    }

    /// Checks names, and the shapes by a trial run.
    fn new(session: Session, masks: &'static str, scores: &'static str) -> Result<Self, String> {
        let inputs: Vec<&str> = session.inputs().iter().map(|input| input.name()).collect();
        let outputs: Vec<&str> = session.outputs().iter().map(|output| output.name()).collect();
        for name in DECODER_INPUTS {
            if !inputs.contains(&name) {
                return Err(format!("it has no input {name:?}, only {}", inputs.join(", ")));
            }
        }
        for name in [masks, scores] {
            if !outputs.contains(&name) {
                return Err(format!("it has no output {name:?}, only {}", outputs.join(", ")));
            }
        }
        let selected = OutputSelector::no_default().with(masks).with(scores);
        let outputs = RunOptions::new().map_err(|error| error.to_string())?.with_outputs(selected);
        let mut decoder = Self { session, masks, scores, outputs };
        let blank = Embedding(vec![0.0; EMBEDDING.iter().product::<i64>() as usize]);
        decoder.run(&blank, [512.0, 512.0], |_| ())?;
        Ok(decoder)
    }

    fn run<T>(
        &mut self,
        embedding: &Embedding,
        point: [f32; 2],
        take: impl FnOnce(Decoded<'_>) -> T,
    ) -> Result<T, String> {
        static NO_MASK: [f32; LOGITS_SIDE * LOGITS_SIDE] = [0.0; LOGITS_SIDE * LOGITS_SIDE];
        let failed = |error: ort::Error| error.to_string();
        // Without a box the export wants a padding point of label -1 after the prompt.
        let points = [point[0], point[1], 0.0, 0.0];
        let labels = [1.0_f32, -1.0];
        let mask_shape = [1_i64, 1, LOGITS_SIDE as i64, LOGITS_SIDE as i64];
        let size = [MODEL_SIDE as f32; 2];
        let inputs = ort::inputs![
            "image_embeddings" => TensorRef::from_array_view((EMBEDDING, embedding.0.as_slice())).map_err(failed)?,
            "point_coords" => TensorRef::from_array_view(([1_i64, 2, 2], points.as_slice())).map_err(failed)?,
            "point_labels" => TensorRef::from_array_view(([1_i64, 2], labels.as_slice())).map_err(failed)?,
            "mask_input" => TensorRef::from_array_view((mask_shape, NO_MASK.as_slice())).map_err(failed)?,
            "has_mask_input" => TensorRef::from_array_view(([1_i64], [0.0_f32].as_slice())).map_err(failed)?,
            "orig_im_size" => TensorRef::from_array_view(([2_i64], size.as_slice())).map_err(failed)?,
        ];
        let outputs = self.session.run_with_options(inputs, &self.outputs).map_err(failed)?;
        let (mask_shape, logits) = outputs[self.masks].try_extract_tensor::<f32>().map_err(failed)?;
        let (score_shape, scores) = outputs[self.scores].try_extract_tensor::<f32>().map_err(failed)?;
        let side = LOGITS_SIDE as i64;
        let count = *score_shape.last().unwrap_or(&0);
        // Of four masks the first is the one for unambiguous prompts; the others are the three levels.
        if !(count == 3 || count == 4) || **score_shape != [1, count] || **mask_shape != [1, count, side, side] {
            return Err(format!(
                "output {:?} has shape {mask_shape} and {:?} {score_shape}; expected are 3 or 4 masks of one prompt, \
                 [1,4,256,256] and [1,4] (export the decoder with multimask output)",
                self.masks, self.scores
            ));
        }
        let first = count as usize - 3;
        let level = |level: usize| &logits[(first + level) * NO_MASK.len()..(first + level + 1) * NO_MASK.len()];
        let predicted_iou = [scores[first], scores[first + 1], scores[first + 2]];
        Ok(take(Decoded { logits: [level(0), level(1), level(2)], predicted_iou }))
    }
}

fn check_encoder(session: &Session) -> Result<(), String> {
    let is = |dtype: &ValueType, expected: &[i64]| {
        // Negative dimensions are dynamic and may turn out right.
        dtype.tensor_shape().is_some_and(|shape| {
            shape.len() == expected.len() && shape.iter().zip(expected).all(|(is, should)| *is < 0 || is == should)
        })
    };
    match (session.inputs(), session.outputs()) {
        ([input], [output, ..]) => {
            if !is(input.dtype(), &ENCODER_INPUT) {
                return Err(format!("its input {:?} is {}", input.name(), input.dtype()));
            }
            if !is(output.dtype(), &EMBEDDING) {
                return Err(format!("its output {:?} is {}", output.name(), output.dtype()));
            }
            Ok(())
        }
        (inputs, outputs) => Err(format!("it has {} inputs and {} outputs", inputs.len(), outputs.len())),
    }
}

fn read(path: &Path) -> Result<Vec<u8>, SegmentError> {
    std::fs::read(path).map_err(|source| SegmentError::Read { path: path.to_owned(), source })
}

fn unloadable(path: &Path, what: &'static str) -> impl Fn(String) -> SegmentError {
    move |reason| SegmentError::Model { path: path.to_owned(), what, reason }
}

fn not_sam(path: &Path, what: &'static str) -> impl Fn(String) -> SegmentError {
    move |problem| SegmentError::NotSam { path: path.to_owned(), what, problem }
}
