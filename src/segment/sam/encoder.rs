//! The image encoder: `[1,3,1024,1024]` float32 to `[1,256,64,64]`, as in the exports of MobileSAM and of SAM's ViT-B,
//! L and H.

use std::fs;
use std::path::{Path, PathBuf};

use ort::value::{Outlet, TensorRef, ValueType};
use tracing::debug;

use super::super::error::SegmentError;
use super::mismatch::Mismatch;
use super::pool::Pool;
use super::runtime::{self, Runtime, Session};
use super::{EMBEDDING, Embedding, MODEL_SIDE, external, not_sam, unloadable};

const ENCODER: &str = "a SAM image encoder ([1,3,1024,1024] float32 to [1,256,64,64])";
const INPUT: [i64; 4] = [1, 3, MODEL_SIDE as i64, MODEL_SIDE as i64];
/// An encoder of more bytes (ViT-B, L, H), including weights in other files, is loaded once, and the threads take turns:
/// one copy per thread would take too much memory.
const COPIED_BYTES: u64 = 128 << 20;

/// The encoder, ready to run.
pub struct Encoder {
    runtime: Runtime,
    path: PathBuf,
    sessions: Pool<Session>,
}

impl Encoder {
    /// Loads the model at `path` for use on `threads` threads. Weights in files beside the model are found as well. Each
    /// further copy of a small model is loaded when one more picture is encoded at the same time as others.
    pub fn open(runtime: &Runtime, path: &Path, threads: usize) -> Result<Self, SegmentError> {
        let copies = copies(path, threads)?;
        let session = runtime::session_of_file(runtime, path).map_err(unloadable(path, ENCODER))?;
        check(&session).map_err(not_sam(path, ENCODER))?;
        Ok(Self { runtime: runtime.clone(), path: path.to_owned(), sessions: Pool::growing(session, copies) })
    }

    /// Encodes a preprocessed picture.
    pub fn run(&self, input: &[f32]) -> Result<Embedding, Mismatch> {
        // Without another copy, for instance because memory is scarce, threads take turns.
        let open = || {
            let opened = runtime::session_of_file(&self.runtime, &self.path);
            opened.inspect_err(|error| debug!("no further copy of the SAM encoder: {error}")).ok()
        };
        let encode = |session: &mut Session| -> Result<Embedding, Mismatch> {
            let input = TensorRef::from_array_view((INPUT, input))?;
            let outputs = session.run(ort::inputs![input])?;
            let (shape, values) = outputs[0].try_extract_tensor::<f32>()?;
            if **shape == EMBEDDING {
                Ok(Embedding(values.to_vec()))
            } else {
                Err(Mismatch::Embedding { given: shape.to_string(), expected: EMBEDDING })
            }
        };
        self.sessions.with_or_make(open, encode)
    }
}

/// The most copies of the model at `path` that `threads` threads may use.
fn copies(path: &Path, threads: usize) -> Result<usize, SegmentError> {
    let is_large = || Ok(fs::metadata(path)?.len() > COPIED_BYTES || external::size(path)? > COPIED_BYTES);
    let is_large = is_large().map_err(|source| SegmentError::Read { path: path.to_owned(), source })?;
    Ok(if is_large { 1 } else { threads })
}

fn check(session: &Session) -> Result<(), Mismatch> {
    let has_shape = |dtype: &ValueType, expected: &[i64]| {
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
            if !has_shape(input.dtype(), &INPUT) {
                return Err(tensor("input", input));
            }
            if !has_shape(output.dtype(), &EMBEDDING) {
                return Err(tensor("output", output));
            }
            Ok(())
        }
        (inputs, _) => Err(Mismatch::Inputs { inputs: inputs.iter().map(|input| input.name().to_owned()).collect() }),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use super::*;

    #[test]
    fn a_model_with_large_weights_in_another_file_is_loaded_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("encoder.onnx");
        fs::write(&path, external::model_with_weights_in("weights.bin")).unwrap();
        let weights = File::create(folder.path().join("weights.bin")).unwrap();
        for (bytes, expected) in [(COPIED_BYTES / 2, 8), (COPIED_BYTES, 1)] {
            weights.set_len(bytes).unwrap();
            assert_eq!(copies(&path, 8).unwrap(), expected, "{bytes}");
        }
    }
}
