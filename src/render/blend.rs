//! Front-to-back alpha blending of one tile: `weight = alpha T`, then `T *= 1 - alpha` (3DGS, Kerbl et al. 2023, eq.
//! 3).
//!
//! The loop runs splat by splat over rows of [`LANES`] pixels, so that the compiler turns it into vector code. It only
//! computes weights; a [`Sink`] uses them.

use std::ops::Range;

use rayon::prelude::*;

use super::project::{ALPHA_MIN, Splat};
use super::tiles::{TILE, Tiles};

/// Pixels blended together.
pub const LANES: usize = 8;
/// Maximum alpha: no splat hides completely what is behind it (3DGS).
pub const ALPHA_MAX: f32 = 0.99;
/// A pixel is finished once less than this share of its light comes from further back (3DGS).
pub const TRANSMITTANCE_MIN: f32 = 1e-4;
/// Number of splats between checks whether the whole tile is finished: a check costs about as much as one splat.
const CHECK_EVERY: usize = 16;

/// The position of a tile in the picture.
#[derive(Debug, Clone, Copy)]
pub struct TileRect {
    /// Upper left pixel.
    pub x: usize,
    pub y: usize,
    /// Width in pixels, smaller than [`TILE`] at the picture's right border; the height likewise at the lower border.
    pub width: usize,
    pub height: usize,
}

impl TileRect {
    /// The position in the picture of the centre of the tile's pixel `pixel` (`y * TILE + x`), px.
    pub fn pixel_center(&self, pixel: usize) -> [f32; 2] {
        [(self.x + pixel % TILE) as f32 + 0.5, (self.y + pixel / TILE) as f32 + 0.5]
    }
}

/// Receives the blend weights of one tile.
pub trait Sink: Send {
    /// Adds `splat`, which covers the [`LANES`] pixels starting at pixel `first` (`y * TILE + x` within the tile,
    /// `first % LANES == 0`) with `weights` (alpha times transmittance; zero where it does not reach) and leaves
    /// `transmittance`.
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], transmittance: &[f32; LANES]);
}

/// Blends every tile of these rows of tiles into its own sink; the sinks are returned row by row, whatever thread
/// computed them.
pub(super) fn blend<S: Sink>(
    tiles: &Tiles,
    rows: Range<usize>,
    (width, height): (usize, usize),
    new_sink: impl Fn(TileRect) -> S + Sync,
) -> Vec<(TileRect, S)> {
    (tiles.columns * rows.start..tiles.columns * rows.end)
        .into_par_iter()
        .map(|t| {
            let (x, y) = (t % tiles.columns * TILE, t / tiles.columns * TILE);
            let rect = TileRect { x, y, width: TILE.min(width - x), height: TILE.min(height - y) };
            let mut sink = new_sink(rect);
            blend_tile(rect, tiles.of(t), &mut sink);
            (rect, sink)
        })
        .collect()
}

fn blend_tile<'a, S: Sink>(rect: TileRect, splats: impl Iterator<Item = &'a Splat>, sink: &mut S) {
    let mut transmittance = [[0.0f32; LANES]; TILE * TILE / LANES];
    for y in 0..rect.height {
        for x in 0..rect.width {
            transmittance[(y * TILE + x) / LANES][x % LANES] = 1.0;
        }
    }
    for (n, splat) in splats.enumerate() {
        if n % CHECK_EVERY == 0 && transmittance.iter().flatten().all(|&t| t < TRANSMITTANCE_MIN) {
            break;
        }
        let columns = covered(splat.center[0] - rect.x as f32, splat.reach[0], rect.width);
        for y in covered(splat.center[1] - rect.y as f32, splat.reach[1], rect.height) {
            let dy = (rect.y + y) as f32 + 0.5 - splat.center[1];
            for group in columns.start / LANES..columns.end.div_ceil(LANES) {
                let dx = (rect.x + group * LANES) as f32 + 0.5 - splat.center[0];
                let left = &mut transmittance[y * (TILE / LANES) + group];
                if left.iter().all(|&t| t < TRANSMITTANCE_MIN) {
                    continue;
                }
                let weights = absorb(splat, dx, dy, left);
                if weights.iter().any(|&w| w > 0.0) {
                    sink.add(splat, y * TILE + group * LANES, &weights, left);
                }
            }
        }
    }
}

/// The pixels of `0..length` whose centres lie within `reach` of `center`.
fn covered(center: f32, reach: f32, length: usize) -> std::ops::Range<usize> {
    let start = (center - reach - 0.5).ceil().max(0.0) as usize;
    let end = (center + reach + 0.5).floor().clamp(0.0, length as f32) as usize;
    start..end
}

/// Weights of a splat on the pixels, the first of whose centres is at (`dx`, `dy`) px from the splat's; reduces the
/// transmittance `left` accordingly.
#[inline(always)]
fn absorb(splat: &Splat, dx: f32, dy: f32, left: &mut [f32; LANES]) -> [f32; LANES] {
    let [a, b, c] = splat.conic;
    let (along, across) = (-0.5 * c * dy * dy, b * dy);
    std::array::from_fn(|lane| {
        let dx = dx + lane as f32;
        let alpha = (splat.opacity * exp(along - dx * (0.5 * a * dx + across))).min(ALPHA_MAX);
        let alpha = if alpha >= ALPHA_MIN && left[lane] >= TRANSMITTANCE_MIN { alpha } else { 0.0 };
        let weight = alpha * left[lane];
        left[lane] -= weight;
        weight
    })
}

/// `exp(x)` for x <= 0 to two units in the last place, without a call, so that it vectorises and gives the same bits on
/// every machine: 2^n times the Taylor polynomial of the remainder, |remainder| <= ln(2)/2.
#[inline(always)]
fn exp(x: f32) -> f32 {
    /// 1.5 * 2^23: adding it rounds a small float to an integer, which is then in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    /// Below this the result underflows; alpha falls below its minimum long before.
    const LOWEST: f32 = -80.0;
    // ln 2 in two parts, the first exact in few bits, so that n ln 2 loses nothing (Cody and Waite).
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(LOWEST, 0.0);
    let rounded = x * std::f32::consts::LOG2_E + ROUND;
    let n = rounded - ROUND;
    let r = (x - n * LN2_HIGH) - n * LN2_LOW;
    let tail = 1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0)));
    let series = 1.0 + r * (1.0 + r * (0.5 + r * tail));
    let power = f32::from_bits(((rounded.to_bits() as i32 - ROUND.to_bits() as i32 + 127) << 23) as u32);
    series * power
}

#[cfg(test)]
mod tests {
    use super::exp;

    #[test]
    fn exp_is_close_to_the_library() {
        for n in 0..80_000 {
            let x = -(n as f32) * 1e-3;
            let (ours, exact) = (f64::from(exp(x)), f64::from(x).exp());
            // Two units in the last place of f32.
            assert!((ours / exact - 1.0).abs() < 2.4e-7, "exp({x}) = {ours}, not {exact}");
        }
    }
}
