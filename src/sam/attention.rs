//! Attention between the tokens of a prompt and the pixels of the picture's embedding.
//!
//! The tokens are few and the pixels many, so every projection is moved from the pixels to the tokens: with x a pixel,
//! q a token's query and W the matrix of keys of one head, `q (x W)ᵀ = x (W qᵀ)`, and with p the weights of the pixels
//! and W the matrix of values, `p (x W) = (p x) W`. Instead of each head's projection of all pixels there is one
//! product with one column per pair of token and head: column `token * HEADS + head`. A key's bias adds the same value
//! to all pixels of a column, which does not change a softmax over pixels.

use super::layers::{exp, increase};
use super::matrix::{Left, Product, Right, Start, multiply};
use super::tokens::Projected;
use super::weights::{Attention, Linear, Norm};
use super::{BLOCK, CHANNELS, HEADS, INNER, PAIRS, TOKENS, WIDTH};
use crate::simd::Vector;

/// The matrix that turns pixels into the scores of the pairs, `[CHANNELS, PAIRS]`, and the value added to each column.
pub struct Scores {
    columns: Vec<f32>,
    added: [f32; PAIRS],
}

impl Scores {
    /// Computes the matrix from the projected tokens and the projection for the pixels.
    #[inline(always)]
    pub fn new<V: Vector>(tokens: &Projected, pixels: &Linear) -> Self {
        let scale = 1.0 / (WIDTH as f32).sqrt();
        let mut by_head = [0.0; INNER * PAIRS];
        let mut added = [0.0; PAIRS];
        for token in 0..TOKENS {
            for i in 0..INNER {
                let pair = token * HEADS + i / WIDTH;
                by_head[i * PAIRS + pair] = tokens[token * INNER + i] * scale;
                added[pair] += tokens[token * INNER + i] * scale * pixels.bias[i];
            }
        }
        let mut columns = vec![0.0; CHANNELS * PAIRS];
        multiply::<V>(
            Left { values: &pixels.weight, row: INNER, column: 1 },
            Right { values: &by_head, row: PAIRS },
            Start::Zero,
            Product { values: &mut columns, row: PAIRS },
            [CHANNELS, INNER, PAIRS],
        );
        Self { columns, added }
    }

    /// Maps pixels, `[BLOCK, CHANNELS]`, to scores, `[BLOCK, PAIRS]`.
    #[inline(always)]
    pub fn of<V: Vector>(&self, block: &[f32], scores: &mut [f32; BLOCK * PAIRS]) {
        multiply::<V>(
            Left { values: block, row: CHANNELS, column: 1 },
            Right { values: &self.columns, row: PAIRS },
            Start::Row(&self.added),
            Product { values: scores, row: PAIRS },
            [BLOCK, CHANNELS, PAIRS],
        );
    }
}

/// The weighted sums of pixels that each pair has collected so far. The softmax over all pixels is computed
/// incrementally (the sums are scaled to the greatest score so far).
pub struct OnlineSoftmax {
    most: [f32; PAIRS],
    sums: [f32; PAIRS],
    /// `[PAIRS, CHANNELS]`.
    values: Vec<f32>,
}

impl OnlineSoftmax {
    pub fn new() -> Self {
        Self { most: [f32::NEG_INFINITY; PAIRS], sums: [0.0; PAIRS], values: vec![0.0; PAIRS * CHANNELS] }
    }

    /// Adds the pixels of `block`, `[BLOCK, CHANNELS]`, weighted by their `scores`, `[BLOCK, PAIRS]`, which are turned
    /// into weights in place.
    #[inline(always)]
    pub fn add<V: Vector>(&mut self, scores: &mut [f32; BLOCK * PAIRS], block: &[f32]) {
        let mut factors = [0.0; PAIRS];
        for pair in (0..PAIRS).step_by(V::WIDTH) {
            let before = V::load(&self.most[pair..]);
            let mut most = before;
            for pixel in 0..BLOCK {
                most = most.max(V::load(&scores[pixel * PAIRS + pair..]));
            }
            let factor = exp(before - most);
            let mut sum = V::load(&self.sums[pair..]).mul(factor);
            for pixel in 0..BLOCK {
                let weight = exp(V::load(&scores[pixel * PAIRS + pair..]) - most);
                weight.store(&mut scores[pixel * PAIRS + pair..]);
                sum = sum.add(weight);
            }
            most.store(&mut self.most[pair..]);
            sum.store(&mut self.sums[pair..]);
            factor.store(&mut factors[pair..]);
        }
        for (row, factor) in self.values.chunks_exact_mut(CHANNELS).zip(factors) {
            if factor != 1.0 {
                for i in (0..CHANNELS).step_by(V::WIDTH) {
                    V::load(&row[i..]).mul(V::splat(factor)).store(&mut row[i..]);
                }
            }
        }
        multiply::<V>(
            Left { values: scores, row: 1, column: PAIRS },
            Right { values: block, row: CHANNELS },
            Start::There,
            Product { values: &mut self.values, row: CHANNELS },
            [PAIRS, BLOCK, CHANNELS],
        );
    }

    /// The attention's result for each token, with this projection of the pixels.
    #[inline(always)]
    pub fn found<V: Vector>(&self, pixels: &Linear) -> Projected {
        let mut projected = [0.0; PAIRS * INNER];
        multiply::<V>(
            Left { values: &self.values, row: CHANNELS, column: 1 },
            Right { values: &pixels.weight, row: INNER },
            Start::Zero,
            Product { values: &mut projected, row: INNER },
            [PAIRS, CHANNELS, INNER],
        );
        let mut found = [0.0; TOKENS * INNER];
        for token in 0..TOKENS {
            for i in 0..INNER {
                let pair = token * HEADS + i / WIDTH;
                found[token * INNER + i] = projected[pair * INNER + i] / self.sums[pair] + pixels.bias[i];
            }
        }
        found
    }
}

/// The values that pixels receive from the tokens: a row for each pair of token and head, `[PAIRS, CHANNELS]`.
pub struct TokenValues<'a> {
    rows: Vec<f32>,
    bias: &'a [f32],
    norm: &'a Norm,
}

impl<'a> TokenValues<'a> {
    /// Computes the rows from the projected values of the tokens.
    #[inline(always)]
    pub fn new<V: Vector>(tokens: &Projected, attention: &'a Attention, norm: &'a Norm) -> Self {
        let mut by_head = [0.0; PAIRS * INNER];
        for token in 0..TOKENS {
            for i in 0..INNER {
                by_head[(token * HEADS + i / WIDTH) * INNER + i] = tokens[token * INNER + i];
            }
        }
        let mut rows = vec![0.0; PAIRS * CHANNELS];
        multiply::<V>(
            Left { values: &by_head, row: INNER, column: 1 },
            Right { values: &attention.out.weight, row: CHANNELS },
            Start::Zero,
            Product { values: &mut rows, row: CHANNELS },
            [PAIRS, INNER, CHANNELS],
        );
        Self { rows, bias: &attention.out.bias, norm }
    }

    /// Adds the bias and the rows, weighted by `weights` (`[BLOCK, PAIRS]` with the given strides), to the pixels of
    /// `block`, `[BLOCK, CHANNELS]`, and normalises each pixel.
    #[inline(always)]
    pub fn add_to<V: Vector>(&self, weights: Left<'_>, block: &mut [f32]) {
        for row in block.chunks_exact_mut(CHANNELS) {
            increase::<V>(row, self.bias);
        }
        multiply::<V>(
            weights,
            Right { values: &self.rows, row: CHANNELS },
            Start::There,
            Product { values: block, row: CHANNELS },
            [BLOCK, PAIRS, CHANNELS],
        );
        self.norm.apply::<V>(block);
    }
}

/// Softmax over the first `count` tokens of each head, `[BLOCK, PAIRS]`; the weights of the others become zero.
#[inline(always)]
pub fn softmax_over_tokens<V: Vector>(scores: &mut [f32; BLOCK * PAIRS], count: usize) {
    for row in scores.chunks_exact_mut(PAIRS) {
        let mut most = [f32::NEG_INFINITY; HEADS];
        for token in 0..count {
            for head in 0..HEADS {
                let score = row[token * HEADS + head];
                most[head] = if score > most[head] { score } else { most[head] };
            }
        }
        for token in 0..count {
            for head in 0..HEADS {
                row[token * HEADS + head] -= most[head];
            }
        }
        for pair in (0..PAIRS).step_by(V::WIDTH) {
            exp(V::load(&row[pair..])).store(&mut row[pair..]);
        }
        row[count * HEADS..].fill(0.0);
        let mut sums = [0.0; HEADS];
        for token in 0..count {
            for head in 0..HEADS {
                sums[head] += row[token * HEADS + head];
            }
        }
        for token in 0..count {
            for head in 0..HEADS {
                row[token * HEADS + head] /= sums[head];
            }
        }
    }
}
