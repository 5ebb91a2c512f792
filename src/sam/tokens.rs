//! The few tokens of a prompt, and the layers of the transformer that involve only tokens.

use super::layers::{add, increase, relu};
use super::weights::{Attention, HIDDEN, Linear, Norm};
use super::{CHANNELS, HEADS, INNER, TOKENS};
use crate::simd::Vector;

/// Tokens, `[TOKENS, CHANNELS]`; those after the first `count` are meaningless.
pub struct Tokens {
    pub values: [f32; TOKENS * CHANNELS],
    /// The initial tokens, which the transformer uses as their positions.
    positions: [f32; TOKENS * CHANNELS],
    pub count: usize,
}

/// One vector with the width of the cross-attention for each token, `[TOKENS, INNER]`.
pub type Projected = [f32; TOKENS * INNER];

impl Tokens {
    /// Makes tokens from `values`, `[count, CHANNELS]`.
    pub fn new(values: &[f32]) -> Self {
        let mut padded = [0.0; TOKENS * CHANNELS];
        padded[..values.len()].copy_from_slice(values);
        Self { values: padded, positions: padded, count: values.len() / CHANNELS }
    }

    /// The first layer's self-attention, which uses no positions and replaces the tokens.
    #[inline(always)]
    pub fn begin<V: Vector>(&mut self, attention: &Attention, norm: &Norm) {
        let values = self.values;
        self.values = attend::<V>(attention, &values, &values, self.count);
        norm.apply::<V>(&mut self.values);
    }

    #[inline(always)]
    pub fn attend_to_themselves<V: Vector>(&mut self, attention: &Attention, norm: &Norm) {
        let placed = self.placed::<V>();
        let attended = attend::<V>(attention, &placed, &self.values, self.count);
        increase::<V>(&mut self.values, &attended);
        norm.apply::<V>(&mut self.values);
    }

    /// The feed-forward layer.
    #[inline(always)]
    pub fn transform<V: Vector>(&mut self, layers: &[Linear; 2], norm: &Norm) {
        let mut hidden = [0.0; TOKENS * HIDDEN];
        layers[0].apply::<V>(&self.values, &mut hidden, TOKENS);
        relu::<V>(&mut hidden);
        let mut change = [0.0; TOKENS * CHANNELS];
        layers[1].apply::<V>(&hidden, &mut change, TOKENS);
        increase::<V>(&mut self.values, &change);
        norm.apply::<V>(&mut self.values);
    }

    /// Adds the result of attention to the picture.
    #[inline(always)]
    pub fn add_attended<V: Vector>(&mut self, found: &Projected, out: &Linear, norm: &Norm) {
        let mut change = [0.0; TOKENS * CHANNELS];
        out.apply::<V>(found, &mut change, TOKENS);
        increase::<V>(&mut self.values, &change);
        norm.apply::<V>(&mut self.values);
    }

    /// The tokens with their positions added, projected.
    #[inline(always)]
    pub fn project_placed<V: Vector>(&self, by: &Linear) -> Projected {
        let mut projected = [0.0; TOKENS * INNER];
        by.apply::<V>(&self.placed::<V>(), &mut projected, TOKENS);
        projected
    }

    #[inline(always)]
    pub fn project<V: Vector>(&self, by: &Linear) -> Projected {
        let mut projected = [0.0; TOKENS * INNER];
        by.apply::<V>(&self.values, &mut projected, TOKENS);
        projected
    }

    #[inline(always)]
    fn placed<V: Vector>(&self) -> [f32; TOKENS * CHANNELS] {
        let mut placed = [0.0; TOKENS * CHANNELS];
        add::<V>(&self.values, &self.positions, &mut placed);
        placed
    }
}

/// Attention of the first `count` tokens to each other.
#[inline(always)]
fn attend<V: Vector>(
    attention: &Attention,
    placed: &[f32; TOKENS * CHANNELS],
    values: &[f32; TOKENS * CHANNELS],
    count: usize,
) -> [f32; TOKENS * CHANNELS] {
    const WIDTH: usize = CHANNELS / HEADS;
    let [mut query, mut key, mut value, mut found, mut out] = [[0.0; TOKENS * CHANNELS]; 5];
    attention.query.apply::<V>(placed, &mut query, TOKENS);
    attention.key.apply::<V>(placed, &mut key, TOKENS);
    attention.value.apply::<V>(values, &mut value, TOKENS);
    let scale = 1.0 / (WIDTH as f32).sqrt();
    for head in 0..HEADS {
        for token in 0..count {
            let start_of = |token: usize| token * CHANNELS + head * WIDTH;
            let mut scores = [0.0; TOKENS];
            let mut most = f32::NEG_INFINITY;
            for other in 0..count {
                let mut product = V::splat(0.0);
                for i in (0..WIDTH).step_by(V::WIDTH) {
                    product =
                        V::load(&query[start_of(token) + i..]).mul_add(V::load(&key[start_of(other) + i..]), product);
                }
                scores[other] = product.sum() * scale;
                most = most.max(scores[other]);
            }
            let mut sum = 0.0;
            for score in &mut scores[..count] {
                *score = (*score - most).exp();
                sum += *score;
            }
            for i in (0..WIDTH).step_by(V::WIDTH) {
                let mut mean = V::splat(0.0);
                for other in 0..count {
                    mean = V::splat(scores[other] / sum).mul_add(V::load(&value[start_of(other) + i..]), mean);
                }
                mean.store(&mut found[start_of(token) + i..]);
            }
        }
    }
    attention.out.apply::<V>(&found, &mut out, TOKENS);
    out
}
