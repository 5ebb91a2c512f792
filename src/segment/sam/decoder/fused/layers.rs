//! Layers that are applied row by row.

use super::matrix::{Left, Product, Right, Start, multiply};
use super::vector::Vector;
use super::weights::{Linear, Norm};

impl Linear {
    /// `[rows, inputs]` to `[rows, outputs]`.
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
            let mean = V::splat(sum::<V>(row) / channels as f32);
            let mut squares = V::splat(0.0);
            for i in (0..channels).step_by(V::WIDTH) {
                let deviation = V::load(&row[i..]).sub(mean);
                squares = deviation.mul_add(deviation, squares);
            }
            let variance = squares.sum() / channels as f32;
            let scale = V::splat(1.0 / (variance + self.epsilon).sqrt());
            for i in (0..channels).step_by(V::WIDTH) {
                let normed = V::load(&row[i..]).sub(mean).mul(scale);
                normed.mul_add(V::load(&self.weight[i..]), V::load(&self.bias[i..])).store(&mut row[i..]);
            }
        }
    }
}

#[inline(always)]
fn sum<V: Vector>(values: &[f32]) -> f32 {
    let mut sum = V::splat(0.0);
    for i in (0..values.len()).step_by(V::WIDTH) {
        sum = sum.add(V::load(&values[i..]));
    }
    sum.sum()
}

/// `a + b`.
#[inline(always)]
pub fn add<V: Vector>(a: &[f32], b: &[f32], sum: &mut [f32]) {
    for i in (0..sum.len()).step_by(V::WIDTH) {
        V::load(&a[i..]).add(V::load(&b[i..])).store(&mut sum[i..]);
    }
}

/// Adds `b` to `a`.
#[inline(always)]
pub fn increase<V: Vector>(a: &mut [f32], b: &[f32]) {
    for i in (0..a.len()).step_by(V::WIDTH) {
        V::load(&a[i..]).add(V::load(&b[i..])).store(&mut a[i..]);
    }
}

#[inline(always)]
pub fn relu<V: Vector>(values: &mut [f32]) {
    for i in (0..values.len()).step_by(V::WIDTH) {
        V::load(&values[i..]).max(V::splat(0.0)).store(&mut values[i..]);
    }
}

#[inline(always)]
pub fn gelu<V: Vector>(values: &mut [f32]) {
    for i in (0..values.len()).step_by(V::WIDTH) {
        V::load(&values[i..]).gelu().store(&mut values[i..]);
    }
}

/// A perceptron of three layers on one row, ReLU between them.
#[inline(always)]
pub fn perceptron<V: Vector>(layers: &[Linear; 3], from: &[f32], to: &mut [f32]) {
    let [mut first, mut second] = [[0.0; super::CHANNELS]; 2];
    layers[0].apply::<V>(from, &mut first, 1);
    relu::<V>(&mut first);
    layers[1].apply::<V>(&first, &mut second, 1);
    relu::<V>(&mut second);
    layers[2].apply::<V>(&second, to, 1);
}
