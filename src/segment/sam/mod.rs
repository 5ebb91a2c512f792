//! SAM's two networks: a picture is encoded as an embedding once, then each prompt is decoded to three nested masks.
//!
//! [`encoder`] and [`decoder`] implement the two networks; `graph` reads and reduces ONNX files, `external` finds the
//! files with their weights; `runtime` and `pool` run them; `cache` stores embeddings.

mod cache;
mod decoder;
mod encoder;
mod external;
mod graph;
pub mod mismatch;
mod pool;
mod runtime;

use std::path::Path;

use super::error::SegmentError;
use super::options::DecoderRuntime;
use crate::files;
use crate::parallel;
pub use crate::sam::LOGITS_SIDE;
use crate::sam::SIDE;
use crate::setup::{self, Doctor, ModelFiles};
use cache::Cache;
pub use decoder::Wanted;
use decoder::{Decoder, Prepared};
use encoder::Encoder;
pub use external::digest as model_digest;
use mismatch::Mismatch;

/// Side of the square picture that the encoder sees.
pub const MODEL_SIDE: usize = 1024;

const EMBEDDING: [i64; 4] = [1, 256, 64, 64];

/// The networks, ready to run on several threads at once.
pub struct Sam {
    encoder: Encoder,
    decoder: Decoder,
    cache: Option<Cache>,
}

/// The encoder's output for one picture, `[1,256,64,64]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Embedding(Vec<f32>);

/// The data that the decoder needs for one picture, whatever the prompt.
pub struct PreparedEmbedding(Prepared);

/// The three nested masks of one prompt: small, middle, large.
#[derive(Debug, Clone, Copy)]
pub struct Decoded<'a> {
    /// Each 256 x 256, row by row; `None` if it was not wanted.
    pub logits: [Option<&'a [f32]>; 3],
    pub predicted_iou: [f32; 3],
}

impl Sam {
    /// Loads the networks for use on `threads` threads at once. Without a `decoder`, gprop computes the mask decoder
    /// itself if possible.
    ///
    /// # Errors
    /// If ONNX Runtime or a model cannot be loaded, a model does not have SAM's tensors, or gprop cannot compute the
    /// mask decoder although [`DecoderRuntime::Native`] is asked for.
    pub fn open(models: &ModelFiles, decoder: Option<DecoderRuntime>, threads: usize) -> Result<Self, SegmentError> {
        let runtime = runtime::load(&models.onnxruntime)?;
        let read = |path: &Path| {
            files::read_large(path).map_err(|source| SegmentError::Read { path: path.to_owned(), source })
        };
        let threads = threads.max(1);
        let (encoder, decoder) = parallel::join(
            || Encoder::open(&runtime, &models.encoder, threads),
            || Decoder::open(&runtime, &models.decoder, &read(&models.decoder)?, decoder, threads),
        );
        Ok(Self { encoder: encoder?, decoder: decoder?, cache: None })
    }

    /// True if gprop computes the mask decoder itself; otherwise ONNX Runtime runs the whole export.
    pub fn decodes_natively(&self) -> bool {
        self.decoder.is_native()
    }

    /// Stores embeddings in `folder`, and reads them from there if the same encoder has already encoded the same
    /// picture.
    ///
    /// # Errors
    /// If the encoder's file cannot be read.
    pub fn caching_embeddings(self, folder: &Path, models: &ModelFiles) -> Result<Self, SegmentError> {
        let cache = Cache::open(folder, &models.encoder);
        let cache = cache.map_err(|source| SegmentError::Read { path: models.encoder.clone(), source })?;
        Ok(Self { cache: Some(cache), ..self })
    }

    /// Encodes a preprocessed picture, `[3,1024,1024]`, made by [`super::preprocess`].
    pub fn encode(&self, input: &[f32]) -> Result<Embedding, SegmentError> {
        let encode = || self.encoder.run(input).map_err(|source| SegmentError::Run { what: "the SAM encoder", source });
        let Some(cache) = &self.cache else { return encode() };
        let path = cache.path(input);
        if let Some(embedding) = Cache::read(&path) {
            return Ok(embedding);
        }
        let embedding = encode()?;
        Cache::write(&path, &embedding).map_err(|source| SegmentError::Write { path, source })?;
        Ok(embedding)
    }

    /// Does the decoder's work that does not depend on the prompt, for a picture whose scaled copy has this width and
    /// height. Logits beyond it are of no use.
    pub fn prepare(&self, embedding: &Embedding, scaled: (u32, u32)) -> Result<PreparedEmbedding, SegmentError> {
        // Enlarging mixes the picture's last logits with their neighbours.
        let logits = |length: u32| (length as usize * LOGITS_SIDE).div_ceil(MODEL_SIDE) + 1;
        let shown = [scaled.0, scaled.1].map(|length| (logits(length) * SIDE).div_ceil(LOGITS_SIDE).min(SIDE));
        self.decoder.prepare(embedding, shown).map(PreparedEmbedding).map_err(decoder_failed)
    }

    /// Number of prompts to decode at once, for which the decoder was exported. More would gain nothing on a CPU.
    pub fn batch(&self) -> usize {
        self.decoder.batch()
    }

    /// Decodes up to [`Self::batch`] point prompts, (x, y) in the frame of the scaled picture (its longest side is
    /// 1024), and passes those masks of each that are `wanted`, given their predicted IoU, to `take`, with the prompt's
    /// index.
    pub fn decode(
        &self,
        embedding: &PreparedEmbedding,
        points: &[[f32; 2]],
        wanted: &Wanted<'_>,
        take: impl FnMut(usize, Decoded<'_>),
    ) -> Result<(), SegmentError> {
        self.decoder.run(&embedding.0, points, wanted, take).map_err(decoder_failed)
    }
}

/// [`setup::doctor()`], which also opens SAM if the user named one of its files: such a file may be anything,
/// whereas those in the cache are verified by their hashes.
pub fn doctor(options: &setup::Options) -> Doctor {
    let found = setup::doctor(options);
    let has_own = options.sam_encoder.is_some() || options.sam_decoder.is_some();
    match found.files().filter(|_| has_own).and_then(|files| Sam::open(&files, None, 1).err()) {
        Some(error) => found.with_problem(error.to_string()),
        None => found,
    }
}

/// Checks that the bytes are the ONNX file of a decoder that gprop can compute itself, without running any of it.
///
/// # Errors
/// [`Mismatch`], which says how they differ from SAM's.
pub fn check_decoder(bytes: &[u8]) -> Result<(), Mismatch> {
    decoder::check(bytes)
}

impl Embedding {
    fn blank() -> Self {
        Self(vec![0.0; EMBEDDING.iter().product::<i64>() as usize])
    }
}

fn decoder_failed(source: Mismatch) -> SegmentError {
    SegmentError::Run { what: "the SAM decoder", source }
}

fn unloadable<E: Into<Mismatch>>(path: &Path, what: &'static str) -> impl Fn(E) -> SegmentError {
    move |source| SegmentError::Model { path: path.to_owned(), what, source: source.into() }
}

fn not_sam(path: &Path, what: &'static str) -> impl Fn(Mismatch) -> SegmentError {
    move |source| SegmentError::NotSam { path: path.to_owned(), what, source }
}
