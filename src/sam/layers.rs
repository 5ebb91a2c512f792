//! Layers that are applied row by row.

use super::matrix::{Left, Product, Right, Start, multiply};
use super::weights::{Linear, Norm};
use crate::simd::{self, Vector};

impl Linear {
    /// Linear layer from `[rows, inputs]` to `[rows, outputs]`.
    #[inline(always)]
    pub fn apply<V: Vector>(&self, from: &[f32], to: &mut [f32], rows: usize) {
        multiply::<V>(
            Left { values: from, row: self.inputs, column: 1 },
            Right { values: &self.weight, row: self.outputs },
            Start::Row(&self.bias),
            Product { values: to, row: self.outputs },
            [rows, self.inputs, self.outputs],
        );
    }
}

impl Norm {
    /// Layer norm of each row of `values`, in place.
    #[inline(always)]
    pub fn apply<V: Vector>(&self, values: &mut [f32]) {
        let channels = self.weight.len();
        for row in values.chunks_exact_mut(channels) {
            let mut sum = V::splat(0.0);
            for values in row.chunks_exact(V::WIDTH) {
                sum = sum.add(V::load(values));
            }
            let mean = V::splat(sum.sum() / channels as f32);
            let mut squares = V::splat(0.0);
            for values in row.chunks_exact(V::WIDTH) {
                let deviation = V::load(values).sub(mean);
                squares = deviation.mul_add(deviation, squares);
            }
            let variance = squares.sum() / channels as f32;
            let scale = V::splat(1.0 / (variance + self.epsilon).sqrt());
            let parameters = self.weight.chunks_exact(V::WIDTH).zip(self.bias.chunks_exact(V::WIDTH));
            for (values, (weight, bias)) in row.chunks_exact_mut(V::WIDTH).zip(parameters) {
                let normed = V::load(values).sub(mean).mul(scale);
                normed.mul_add(V::load(weight), V::load(bias)).store(values);
            }
        }
    }
}

/// Exponential; arguments are clamped to +-[`MOST_EXPONENT`](simd::MOST_EXPONENT), between which it is a normal number.
#[inline(always)]
pub fn exp<V: Vector>(x: V) -> V {
    simd::exp(x, simd::MOST_EXPONENT)
}

/// `a + b`.
#[inline(always)]
pub fn add<V: Vector>(a: &[f32], b: &[f32], sum: &mut [f32]) {
    let terms = a.chunks_exact(V::WIDTH).zip(b.chunks_exact(V::WIDTH));
    for (sum, (a, b)) in sum.chunks_exact_mut(V::WIDTH).zip(terms) {
        V::load(a).add(V::load(b)).store(sum);
    }
}

/// Adds `b` to `a`.
#[inline(always)]
pub fn increase<V: Vector>(a: &mut [f32], b: &[f32]) {
    for (a, b) in a.chunks_exact_mut(V::WIDTH).zip(b.chunks_exact(V::WIDTH)) {
        V::load(a).add(V::load(b)).store(a);
    }
}

#[inline(always)]
pub fn relu<V: Vector>(values: &mut [f32]) {
    for values in values.chunks_exact_mut(V::WIDTH) {
        V::load(values).max(V::splat(0.0)).store(values);
    }
}

#[inline(always)]
pub fn gelu<V: Vector>(values: &mut [f32]) {
    for values in values.chunks_exact_mut(V::WIDTH) {
        simd::gelu(V::load(values)).store(values);
    }
}

/// A perceptron of three layers applied to one row, with ReLU between them.
#[inline(always)]
pub fn perceptron<V: Vector>(layers: &[Linear; 3], from: &[f32], to: &mut [f32]) {
    let [mut first, mut second] = [[0.0; super::CHANNELS]; 2];
    layers[0].apply::<V>(from, &mut first, 1);
    relu::<V>(&mut first);
    layers[1].apply::<V>(&first, &mut second, 1);
    relu::<V>(&mut second);
    layers[2].apply::<V>(&second, to, 1);
}
