//! SAM's mask decoder, written for many prompts about one picture on a CPU.
//!
//! It computes what the exported graph computes, in an order that saves most of the work: projections move from the
//! 4096 pixels to the few tokens (`attention`, `first_layer`), every pixel is read once per layer while it is in the
//! cache, and masks that are not wanted are not computed, since their predicted IoU is known beforehand. [`weights`]
//! are the parameters, `tokens` and `upscale` the rest of the network, and `layers` and `matrix` their building blocks.
//!
//! The network is that of Kirillov et al., Segment Anything (2023), section A; layer names are those of the public
//! implementation (`TwoWayTransformer`, `MaskDecoder`).

mod attention;
mod first_layer;
mod layers;
mod matrix;
mod tokens;
mod upscale;
pub mod weights;

use attention::{OnlineSoftmax, Scores, TokenValues, softmax_over_tokens};
use first_layer::FirstLayer;
use layers::{add, perceptron};
use matrix::Left;
use tokens::Tokens;
use weights::Weights;

use crate::simd::{Instructions, Kernel, MOST_LANES, Vector};

/// Side of the square of logits of one mask.
pub const LOGITS_SIDE: usize = 256;
/// Side of the picture's embedding.
pub const SIDE: usize = 64;
const PIXELS: usize = SIDE * SIDE;
/// Width of a token, and of a pixel of the embedding.
pub const CHANNELS: usize = 256;
/// Width of the attention between tokens and pixels, its heads, and the width of each.
pub const INNER: usize = 128;
const HEADS: usize = 8;
const WIDTH: usize = INNER / HEADS;
/// Maximum number of tokens of a prompt: one for the predicted IoU, one per mask, and those of its points.
pub const TOKENS: usize = 8;
/// Number of pairs of token and head.
const PAIRS: usize = TOKENS * HEADS;
/// Number of pixels that go through a layer at once: together with the matrices they are multiplied with, they fill
/// half of a second-level cache.
const BLOCK: usize = 64;
/// Number of masks that the network computes.
pub const MASKS: usize = 4;
/// Channels after one and two transposed convolutions.
pub const UPSCALED: usize = 64;
pub const UPSCALED_TWICE: usize = 32;

/// Selects the masks to compute, given the predicted IoU of all.
pub type Wanted<'a> = dyn Fn(&[f32; MASKS]) -> [bool; MASKS] + 'a;

/// The mask decoder.
pub struct MaskDecoder {
    weights: Weights,
    instructions: Instructions,
}

/// An image's embedding with the parts of the decoder's work that do not depend on the prompt.
pub struct PreparedEmbedding {
    /// `[PIXELS, CHANNELS]`.
    embedding: Vec<f32>,
    positions: Vec<f32>,
    first_layer: FirstLayer,
    /// Columns and rows for which logits are wanted.
    shown: [usize; 2],
}

/// Scratch buffers, reused between prompts.
pub struct Scratch {
    /// `[PIXELS, CHANNELS]`.
    pixels: Vec<f32>,
    /// Scores of one head of the first layer: `[TOKENS, PIXELS]`.
    scores: Vec<f32>,
    /// Logits of the masks that were wanted, in order.
    pub logits: Vec<[f32; LOGITS_SIDE * LOGITS_SIDE]>,
}

impl MaskDecoder {
    pub fn new(weights: Weights) -> Self {
        Self { weights, instructions: Instructions::of_this_processor() }
    }

    /// Does the work that does not depend on the prompt. `embedding` and `positions`, its positional encoding, are
    /// `[PIXELS, CHANNELS]`. Only the first `shown` columns and rows show the picture: logits elsewhere will be far below
    /// zero.
    pub fn prepare(&self, embedding: Vec<f32>, positions: Vec<f32>, shown: [usize; 2]) -> PreparedEmbedding {
        assert!(embedding.len() == PIXELS * CHANNELS && positions.len() == PIXELS * CHANNELS);
        let kernel = FirstLayerOf { weights: &self.weights, embedding: &embedding, positions: &positions };
        let first_layer = self.instructions.run(kernel);
        PreparedEmbedding { embedding, positions, first_layer, shown }
    }

    /// Decodes a prompt of `[count, CHANNELS]` tokens. Leaves the logits of the masks that are `wanted`, given the
    /// predicted IoU of all, in `scratch`, and returns the predicted IoU.
    pub fn decode(
        &self,
        image: &PreparedEmbedding,
        tokens: &[f32],
        wanted: &Wanted<'_>,
        scratch: &mut Scratch,
    ) -> [f32; MASKS] {
        assert!(tokens.len().is_multiple_of(CHANNELS) && (MASKS + 1..=TOKENS).contains(&(tokens.len() / CHANNELS)));
        self.instructions.run(Decoding { weights: &self.weights, image, tokens, wanted, scratch })
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self { pixels: vec![0.0; PIXELS * CHANNELS], scores: vec![0.0; TOKENS * PIXELS], logits: Vec::new() }
    }
}

/// The first layer, prepared for a picture.
struct FirstLayerOf<'a> {
    weights: &'a Weights,
    embedding: &'a [f32],
    positions: &'a [f32],
}

impl Kernel for FirstLayerOf<'_> {
    type Output = FirstLayer;

    #[inline(always)]
    fn run<V: Vector>(self) -> FirstLayer {
        let mut placed = vec![0.0; PIXELS * CHANNELS];
        add::<V>(self.embedding, self.positions, &mut placed);
        let layer = &self.weights.layers[0];
        FirstLayer::new::<V>(self.embedding, &placed, &layer.token_to_image, &layer.image_to_token)
    }
}

/// The decoding of a prompt.
struct Decoding<'a> {
    weights: &'a Weights,
    image: &'a PreparedEmbedding,
    tokens: &'a [f32],
    wanted: &'a Wanted<'a>,
    scratch: &'a mut Scratch,
}

impl Kernel for Decoding<'_> {
    type Output = [f32; MASKS];

    #[inline(always)]
    fn run<V: Vector>(self) -> [f32; MASKS] {
        let Self { weights, image, tokens, wanted, scratch } = self;
        let tokens = transform::<V>(weights, image, tokens, scratch);
        let mut padded = [0.0; MOST_LANES];
        perceptron::<V>(&weights.predicted_iou, &tokens.values[..CHANNELS], &mut padded);
        let mut predicted_iou = [0.0; MASKS];
        predicted_iou.copy_from_slice(&padded[..MASKS]);

        let mut masks = Vec::with_capacity(MASKS);
        for (mask, is_wanted) in wanted(&predicted_iou).into_iter().enumerate() {
            if is_wanted {
                let mut vector = [0.0; UPSCALED_TWICE];
                let token = &tokens.values[(1 + mask) * CHANNELS..][..CHANNELS];
                perceptron::<V>(&weights.hypernetworks[mask], token, &mut vector);
                masks.push(vector);
            }
        }
        scratch.logits.resize(masks.len(), [0.0; LOGITS_SIDE * LOGITS_SIDE]);
        if !masks.is_empty() {
            upscale::upscale::<V>(weights, &scratch.pixels, image.shown, &masks, &mut scratch.logits);
        }
        predicted_iou
    }
}

/// Runs the two-way transformer: returns the tokens and leaves the pixels in `scratch`.
#[inline(always)]
fn transform<V: Vector>(weights: &Weights, image: &PreparedEmbedding, tokens: &[f32], scratch: &mut Scratch) -> Tokens {
    let [first, second] = &weights.layers;
    let last = &weights.final_attention;
    let mut tokens = Tokens::new(tokens);

    tokens.begin::<V>(&first.self_attention, &first.norm1);
    let queries = tokens.project_placed::<V>(&first.token_to_image.query);
    let found = image.first_layer.found::<V>(&queries, &mut scratch.scores);
    tokens.add_attended::<V>(&found, &first.token_to_image.out, &first.norm2);
    tokens.transform::<V>(&first.hidden, &first.norm3);
    let keys = tokens.project_placed::<V>(&first.image_to_token.key);
    let values = tokens.project::<V>(&first.image_to_token.value);
    let token_values = TokenValues::new::<V>(&values, &first.image_to_token, &first.norm4);
    tokens.attend_to_themselves::<V>(&second.self_attention, &second.norm1);
    let queries = tokens.project_placed::<V>(&second.token_to_image.query);
    let scores = Scores::new::<V>(&queries, &second.token_to_image.key);

    // The pixels attend to the tokens of the first layer; then the tokens of the second layer attend to the pixels.
    let mut softmax = OnlineSoftmax::new();
    let (mut weighed, mut placed) = ([0.0; BLOCK * PAIRS], [0.0; BLOCK * CHANNELS]);
    for start in (0..PIXELS).step_by(BLOCK) {
        let range = start * CHANNELS..(start + BLOCK) * CHANNELS;
        let block = &mut scratch.pixels[range.clone()];
        block.copy_from_slice(&image.embedding[range.clone()]);
        image.first_layer.weights::<V>(&keys, tokens.count, start, &mut weighed);
        token_values.add_to::<V>(Left { values: &weighed, row: 1, column: BLOCK }, block);
        add::<V>(block, &image.positions[range], &mut placed);
        scores.of::<V>(&placed, &mut weighed);
        softmax.add::<V>(&mut weighed, block);
    }

    let found = softmax.found::<V>(&second.token_to_image.value);
    tokens.add_attended::<V>(&found, &second.token_to_image.out, &second.norm2);
    tokens.transform::<V>(&second.hidden, &second.norm3);
    let keys = tokens.project_placed::<V>(&second.image_to_token.key);
    let shares = Scores::new::<V>(&keys, &second.image_to_token.query);
    let values = tokens.project::<V>(&second.image_to_token.value);
    let token_values = TokenValues::new::<V>(&values, &second.image_to_token, &second.norm4);
    let queries = tokens.project_placed::<V>(&last.query);
    let scores = Scores::new::<V>(&queries, &last.key);

    // The same for the second layer and the final attention.
    let mut softmax = OnlineSoftmax::new();
    for start in (0..PIXELS).step_by(BLOCK) {
        let range = start * CHANNELS..(start + BLOCK) * CHANNELS;
        let block = &mut scratch.pixels[range.clone()];
        let positions = &image.positions[range];
        add::<V>(block, positions, &mut placed);
        shares.of::<V>(&placed, &mut weighed);
        softmax_over_tokens::<V>(&mut weighed, tokens.count);
        token_values.add_to::<V>(Left { values: &weighed, row: PAIRS, column: 1 }, block);
        add::<V>(block, positions, &mut placed);
        scores.of::<V>(&placed, &mut weighed);
        softmax.add::<V>(&mut weighed, block);
    }
    let found = softmax.found::<V>(&last.value);
    tokens.add_attended::<V>(&found, &last.out, &weights.final_norm);
    tokens
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::weights::{Attention, HIDDEN, Layer, Linear, Norm};
    use super::*;

    /// Pseudo-random numbers in [-1, 1], the same every time.
    struct Numbers(Cell<u32>);

    impl Numbers {
        fn take(&self, count: usize, scale: f32) -> Vec<f32> {
            let next = || {
                self.0.set(self.0.get().wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
                (self.0.get() >> 8) as f32 / (1 << 23) as f32 - 1.0
            };
            (0..count).map(|_| next() * scale).collect()
        }

        fn linear(&self, inputs: usize, outputs: usize) -> Linear {
            let weight = self.take(inputs * outputs, (3.0 / inputs as f32).sqrt());
            Linear { weight, bias: self.take(outputs, 0.1), inputs, outputs }
        }

        fn norm(&self, channels: usize) -> Norm {
            let weight = self.take(channels, 0.3).into_iter().map(|value| 1.0 + value).collect();
            Norm { weight, bias: self.take(channels, 0.1), epsilon: 1e-5 }
        }

        fn attention(&self, inner: usize) -> Attention {
            let into = || self.linear(CHANNELS, inner);
            Attention { query: into(), key: into(), value: into(), out: self.linear(inner, CHANNELS) }
        }

        fn layer(&self) -> Layer {
            Layer {
                self_attention: self.attention(CHANNELS),
                norm1: self.norm(CHANNELS),
                token_to_image: self.attention(INNER),
                norm2: self.norm(CHANNELS),
                hidden: [self.linear(CHANNELS, HIDDEN), self.linear(HIDDEN, CHANNELS)],
                norm3: self.norm(CHANNELS),
                image_to_token: self.attention(INNER),
                norm4: self.norm(CHANNELS),
            }
        }

        fn perceptron(&self, outputs: usize) -> [Linear; 3] {
            [self.linear(CHANNELS, CHANNELS), self.linear(CHANNELS, CHANNELS), self.linear(CHANNELS, outputs)]
        }

        fn weights(&self) -> Weights {
            Weights {
                layers: [self.layer(), self.layer()],
                final_attention: self.attention(INNER),
                final_norm: self.norm(CHANNELS),
                upscaling: [self.linear(CHANNELS, 4 * UPSCALED), self.linear(UPSCALED, 4 * UPSCALED_TWICE)],
                upscaling_norm: self.norm(UPSCALED),
                hypernetworks: std::array::from_fn(|_| self.perceptron(UPSCALED_TWICE)),
                predicted_iou: self.perceptron(MOST_LANES),
            }
        }
    }

    /// Numbers of tokens: the least, and around the width of the registers.
    const COUNTS: [usize; 3] = [MASKS + 1, TOKENS - 1, TOKENS];

    /// Logits and scores for each of [`COUNTS`].
    fn decoded(instructions: Instructions) -> [(Vec<f32>, [f32; MASKS]); COUNTS.len()] {
        let decoder = MaskDecoder { weights: Numbers(Cell::new(1)).weights(), instructions };
        let numbers = Numbers(Cell::new(7));
        let image =
            decoder.prepare(numbers.take(PIXELS * CHANNELS, 1.0), numbers.take(PIXELS * CHANNELS, 1.0), [SIDE; 2]);
        let mut scratch = Scratch::default();
        let tokens = numbers.take(TOKENS * CHANNELS, 1.0);
        COUNTS.map(|count| {
            let tokens = &tokens[..count * CHANNELS];
            let scores = decoder.decode(&image, tokens, &|_| [true; MASKS], &mut scratch);
            let all = scratch.logits.concat();
            decoder.decode(&image, tokens, &|_| [false, true, false, true], &mut scratch);
            let side = LOGITS_SIDE * LOGITS_SIDE;
            assert_eq!(scratch.logits.concat(), [&all[side..2 * side], &all[3 * side..]].concat(), "only those wanted");
            (all, scores)
        })
    }

    #[test]
    fn logits_of_the_picture_are_the_same_without_those_beyond_it() {
        let decoder = MaskDecoder { weights: Numbers(Cell::new(1)).weights(), instructions: Instructions::ANY };
        let numbers = Numbers(Cell::new(7));
        let [embedding, positions] = [(); 2].map(|()| numbers.take(PIXELS * CHANNELS, 1.0));
        let tokens = numbers.take(TOKENS * CHANNELS, 1.0);
        let mut scratch = Scratch::default();
        let mut logits = |shown: [usize; 2]| {
            let image = decoder.prepare(embedding.clone(), positions.clone(), shown);
            decoder.decode(&image, &tokens, &|_| [true; MASKS], &mut scratch);
            scratch.logits.concat()
        };
        let whole = logits([SIDE; 2]);
        let [columns, rows] = [33, 20];
        for (i, (part, whole)) in logits([columns, rows]).into_iter().zip(whole).enumerate() {
            let (x, y) = (i % LOGITS_SIDE, i / LOGITS_SIDE % LOGITS_SIDE);
            // Pixels of the embedding are upscaled in blocks of 16.
            if x < 4 * columns && y < 4 * rows {
                assert_eq!(part, whole, "({x}, {y})");
            } else if x >= 4 * columns.next_multiple_of(16) || y >= 4 * rows {
                assert!(part < -1e3, "({x}, {y})");
            }
        }
    }

    #[test]
    fn all_instructions_give_the_same_to_rounding() {
        let plain = decoded(Instructions::ANY);
        for instructions in Instructions::all_of_this_processor() {
            if instructions == Instructions::ANY {
                continue;
            }
            for (((logits, scores), other), count) in plain.iter().zip(decoded(instructions)).zip(COUNTS) {
                let greatest = logits.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
                assert!(greatest > 0.1 && scores.iter().all(|score| score.is_finite()), "{greatest} {scores:?}");
                let (other_logits, other_scores) = other;
                let apart = logits.iter().zip(&other_logits).fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
                assert!(apart < 1e-4 * greatest, "{instructions:?} {count}: {apart} of {greatest}");
                for (score, other) in scores.iter().zip(other_scores) {
                    assert!((score - other).abs() < 1e-4, "{instructions:?} {count}: {score} and {other}");
                }
            }
        }
    }
}
