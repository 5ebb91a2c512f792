//! The first layer's attention in both directions. Its pixels come directly from the encoder, so their projections do
//! not depend on the prompt.

use super::layers::exp;
use super::matrix::{Left, Product, Right, Start, multiply};
use super::tokens::Projected;
use super::weights::Attention;
use super::{BLOCK, HEADS, INNER, PAIRS, PIXELS, TOKENS, WIDTH};
use crate::simd::{MOST_LANES, Vector};

/// The projections of one picture's pixels.
pub struct FirstLayer {
    /// Keys of the pixels, `[INNER, PIXELS]`, and their values, `[PIXELS, INNER]`.
    keys: Vec<f32>,
    values: Vec<f32>,
    /// Queries of the pixels, `[INNER, PIXELS]`.
    queries: Vec<f32>,
}

impl FirstLayer {
    /// Both `picture` and `placed`, the picture with its positions added, are `[PIXELS, CHANNELS]`.
    #[inline(always)]
    pub fn new<V: Vector>(picture: &[f32], placed: &[f32], tokens: &Attention, pixels: &Attention) -> Self {
        let mut projected = vec![0.0; PIXELS * INNER];
        tokens.key.apply::<V>(placed, &mut projected, PIXELS);
        let keys = transposed(&projected);
        pixels.query.apply::<V>(placed, &mut projected, PIXELS);
        let queries = transposed(&projected);
        tokens.value.apply::<V>(picture, &mut projected, PIXELS);
        Self { keys, values: projected, queries }
    }

    /// The attention's result for each token, given the tokens' `queries`.
    #[inline(always)]
    pub fn found<V: Vector>(&self, queries: &Projected, scores: &mut [f32]) -> Projected {
        let scale = 1.0 / (WIDTH as f32).sqrt();
        let mut found = [0.0; TOKENS * INNER];
        for head in 0..HEADS {
            multiply::<V>(
                Left { values: &queries[head * WIDTH..], row: INNER, column: 1 },
                Right { values: &self.keys[head * WIDTH * PIXELS..], row: PIXELS },
                Start::Zero,
                Product { values: scores, row: PIXELS },
                [TOKENS, WIDTH, PIXELS],
            );
            let mut sums = [0.0; TOKENS];
            for token in 0..TOKENS {
                sums[token] = exponentials::<V>(&mut scores[token * PIXELS..][..PIXELS], scale);
            }
            multiply::<V>(
                Left { values: scores, row: PIXELS, column: 1 },
                Right { values: &self.values[head * WIDTH..], row: INNER },
                Start::Zero,
                Product { values: &mut found[head * WIDTH..], row: INNER },
                [TOKENS, PIXELS, WIDTH],
            );
            for token in 0..TOKENS {
                for i in 0..WIDTH {
                    found[token * INNER + head * WIDTH + i] /= sums[token];
                }
            }
        }
        found
    }

    /// The weights that the pixels starting at `first` give to the tokens, given the tokens' `keys`: `[PAIRS, BLOCK]`.
    #[inline(always)]
    pub fn weights<V: Vector>(&self, keys: &Projected, count: usize, first: usize, weights: &mut [f32; PAIRS * BLOCK]) {
        let scale = V::splat(1.0 / (WIDTH as f32).sqrt());
        for head in 0..HEADS {
            multiply::<V>(
                Left { values: &keys[head * WIDTH..], row: INNER, column: 1 },
                Right { values: &self.queries[head * WIDTH * PIXELS + first..], row: PIXELS },
                Start::Zero,
                Product { values: &mut weights[head * BLOCK..], row: HEADS * BLOCK },
                [TOKENS, WIDTH, BLOCK],
            );
            for pixel in (0..BLOCK).step_by(V::WIDTH) {
                let mut most = V::splat(f32::NEG_INFINITY);
                for token in 0..count {
                    most = most.max(V::load(&weights[(token * HEADS + head) * BLOCK + pixel..]));
                }
                let mut sum = V::splat(0.0);
                for token in 0..count {
                    let place = &mut weights[(token * HEADS + head) * BLOCK + pixel..];
                    let weight = exp((V::load(place) - most) * scale);
                    weight.store(place);
                    sum = sum.add(weight);
                }
                let norm = V::splat(1.0).div(sum);
                for token in 0..count {
                    let place = &mut weights[(token * HEADS + head) * BLOCK + pixel..];
                    V::load(place).mul(norm).store(place);
                }
                for token in count..TOKENS {
                    V::splat(0.0).store(&mut weights[(token * HEADS + head) * BLOCK + pixel..]);
                }
            }
        }
    }
}

/// Replaces scores with exponentials of `scale` times their difference from the greatest, and returns the sum.
#[inline(always)]
fn exponentials<V: Vector>(scores: &mut [f32], scale: f32) -> f32 {
    let mut most = V::splat(f32::NEG_INFINITY);
    for scores in scores.chunks_exact(V::WIDTH) {
        most = most.max(V::load(scores));
    }
    let mut lanes = [f32::NEG_INFINITY; MOST_LANES];
    most.store(&mut lanes);
    let mut greatest = lanes[0];
    for lane in lanes {
        greatest = if lane > greatest { lane } else { greatest };
    }
    let (greatest, scale, mut sum) = (V::splat(greatest), V::splat(scale), V::splat(0.0));
    for scores in scores.chunks_exact_mut(V::WIDTH) {
        let value = exp((V::load(scores) - greatest) * scale);
        value.store(scores);
        sum = sum.add(value);
    }
    sum.sum()
}

/// Transposes `[PIXELS, INNER]` to `[INNER, PIXELS]`.
fn transposed(values: &[f32]) -> Vec<f32> {
    (0..values.len()).map(|i| values[i % PIXELS * INNER + i / PIXELS]).collect()
}
