//! The image encoder: `[1,3,1024,1024]` float32 to `[1,256,64,64]`, as in the exports of MobileSAM and of SAM's ViT-B,
//! L and H.

use std::fs;
use std::path::Path;

use ort::session::Session;
use ort::value::{Outlet, TensorRef, ValueType};

use super::super::error::SegmentError;
use super::mismatch::Mismatch;
use super::pool::Pool;
use super::runtime::{self, Runtime};
use super::{EMBEDDING, Embedding, MODEL_SIDE, not_sam, unloadable};

const ENCODER: &str = "a SAM image encoder ([1,3,1024,1024] float32 to [1,256,64,64])";
const INPUT: [i64; 4] = [1, 3, MODEL_SIDE as i64, MODEL_SIDE as i64];
/// An encoder of more bytes (ViT-B, L, H) is loaded once, and the threads take turns: one copy per thread would take
/// too much memory.
const COPIED_BYTES: u64 = 128 << 20;

/// The encoder, ready to run.
pub struct Encoder {
    sessions: Pool<Session>,
}

impl Encoder {
    /// Loads the model at `path` for use on `threads` threads. Weights in files beside the model are found as well.
    pub fn open(runtime: &Runtime, path: &Path, threads: usize) -> Result<Self, SegmentError> {
        let length = fs::metadata(path).map_err(|source| SegmentError::Read { path: path.to_owned(), source })?.len();
        let copies = if length > COPIED_BYTES { 1 } else { threads };
        let open = || -> Result<Session, SegmentError> {
            let session = runtime::session_of_file(runtime, path).map_err(unloadable(path, ENCODER))?;
            check(&session).map_err(not_sam(path, ENCODER))?;
            Ok(session)
        };
        Ok(Self { sessions: Pool::new((0..copies).map(|_| open()).collect::<Result<_, _>>()?) })
    }

    /// Encodes a preprocessed picture.
    pub fn run(&self, input: &[f32]) -> Result<Embedding, Mismatch> {
        self.sessions.with(|session| {
            let input = TensorRef::from_array_view((INPUT, input))?;
            let outputs = session.run(ort::inputs![input])?;
            let (shape, values) = outputs[0].try_extract_tensor::<f32>()?;
            if **shape == EMBEDDING {
                Ok(Embedding(values.to_vec()))
            } else {
                Err(Mismatch::Embedding { given: shape.to_string(), expected: EMBEDDING })
            }
        })
    }
}

fn check(session: &Session) -> Result<(), Mismatch> {
    let is = |dtype: &ValueType, expected: &[i64]| {
        // Negative dimensions are dynamic and may match at run time.
        dtype.tensor_shape().is_some_and(|shape| {
            shape.len() == expected.len() && shape.iter().zip(expected).all(|(is, should)| *is < 0 || is == should)
        })
    };
    let tensor = |kind, outlet: &Outlet| {
        let (name, tensor) = (outlet.name().to_owned(), outlet.dtype().to_string());
        Mismatch::Tensor { kind, name, tensor }
    };
    match (session.inputs(), session.outputs()) {
        ([input], [output, ..]) => {
            if !is(input.dtype(), &INPUT) {
                return Err(tensor("input", input));
            }
            if !is(output.dtype(), &EMBEDDING) {
                return Err(tensor("output", output));
            }
            Ok(())
        }
        (inputs, _) => Err(Mismatch::Inputs { inputs: inputs.iter().map(|input| input.name().to_owned()).collect() }),
    }
}
