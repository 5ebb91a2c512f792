//! Computes the logits of masks from the picture's embedding: two transposed convolutions, and for each mask a product
//! of every pixel with the mask's vector.

use super::layers::gelu;
use super::weights::Weights;
use super::{CHANNELS, LOGITS_SIDE, PIXELS, SIDE, UPSCALED, UPSCALED_TWICE};
use crate::simd::Vector;

/// Number of pixels of the embedding that are upscaled at once: their results stay in the first-level cache.
const BLOCK: usize = 16;

/// Far below every threshold.
const NO_MASK: f32 = -1e4;

/// The logits of the masks with these vectors, each `LOGITS_SIDE` x `LOGITS_SIDE`, row by row: [`NO_MASK`] outside of the
/// first `shown` columns and rows of the embedding.
#[inline(always)]
pub fn upscale<V: Vector>(
    weights: &Weights,
    picture: &[f32],
    [columns, rows]: [usize; 2],
    masks: &[[f32; UPSCALED_TWICE]],
    logits: &mut [[f32; LOGITS_SIDE * LOGITS_SIDE]],
) {
    let [first, second] = &weights.upscaling;
    let mut once = [0.0; BLOCK * 4 * UPSCALED];
    let mut twice = [0.0; BLOCK * 16 * UPSCALED_TWICE];
    let is_shown = |start: &usize| start % SIDE < columns && start / SIDE < rows;
    if columns < SIDE || rows < SIDE {
        logits.iter_mut().for_each(|logits| logits.fill(NO_MASK));
    }
    for start in (0..PIXELS).step_by(BLOCK).filter(is_shown) {
        first.apply::<V>(&picture[start * CHANNELS..][..BLOCK * CHANNELS], &mut once, BLOCK);
        weights.upscaling_norm.apply::<V>(&mut once);
        gelu::<V>(&mut once);
        second.apply::<V>(&once, &mut twice, BLOCK * 4);
        gelu::<V>(&mut twice);
        for (index, pixel) in twice.chunks_exact(UPSCALED_TWICE).enumerate() {
            // Pixel of the embedding, quarter of it, sixteenth of it.
            let (large, middle, small) = (start + index / 16, index / 4 % 4, index % 4);
            let y = large / SIDE * 4 + middle / 2 * 2 + small / 2;
            let x = large % SIDE * 4 + middle % 2 * 2 + small % 2;
            for (mask, logits) in masks.iter().zip(&mut *logits) {
                let mut product = V::splat(0.0);
                for i in (0..UPSCALED_TWICE).step_by(V::WIDTH) {
                    product = V::load(&pixel[i..]).mul_add(V::load(&mask[i..]), product);
                }
                logits[y * LOGITS_SIDE + x] = product.sum();
            }
        }
    }
}
