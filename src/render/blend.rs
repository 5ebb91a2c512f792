//! Front-to-back alpha blending of one tile: `weight = alpha T`, then `T *= 1 - alpha` (3DGS, Kerbl et al. 2023, eq.
//! 3).
//!
//! The loop runs splat by splat over rows of [`LANES`] pixels, in one register each if the processor has AVX2. It uses
//! no fused multiply-add, so every machine computes the same bits. It only computes weights; a [`Sink`] uses them.

use std::ops::Range;

use super::project::{ALPHA_MIN, Splat};
use super::tiles::{TILE, Tiles};
use crate::parallel;
use crate::simd::{self, Lanes, LanesKernel, run_lanes};

/// Pixels blended together.
pub const LANES: usize = simd::LANES;
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

/// Blends every tile of these rows of tiles into its own sink; the sinks are returned row by row, whichever thread
/// computed them.
pub(super) fn blend<S: Sink>(
    tiles: &Tiles,
    rows: Range<usize>,
    (width, height): (usize, usize),
    new_sink: impl Fn(TileRect) -> S + Sync,
) -> Vec<(TileRect, S)> {
    parallel::map_range(tiles.columns * rows.len(), |n| {
        let t = tiles.columns * rows.start + n;
        let (x, y) = (t % tiles.columns * TILE, t / tiles.columns * TILE);
        let rect = TileRect { x, y, width: TILE.min(width - x), height: TILE.min(height - y) };
        let mut sink = new_sink(rect);
        run_lanes(TileBlend { rect, splats: tiles.of(t), sink: &mut sink });
        (rect, sink)
    })
}

/// The splats of one tile, front to back, and the sink of their weights.
struct TileBlend<'a, I, S> {
    rect: TileRect,
    splats: I,
    sink: &'a mut S,
}

impl<'s, I: Iterator<Item = &'s Splat>, S: Sink> LanesKernel for TileBlend<'_, I, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { rect, splats, sink } = self;
        let mut transmittance = [[0.0f32; LANES]; TILE * TILE / LANES];
        for y in 0..rect.height {
            for x in 0..rect.width {
                transmittance[(y * TILE + x) / LANES][x % LANES] = 1.0;
            }
        }
        for (n, splat) in splats.enumerate() {
            if n % CHECK_EVERY == 0 && !any_unfinished::<L>(&transmittance) {
                break;
            }
            let columns = covered(splat.center[0] - rect.x as f32, splat.reach[0], rect.width);
            for y in covered(splat.center[1] - rect.y as f32, splat.reach[1], rect.height) {
                let dy = (rect.y + y) as f32 + 0.5 - splat.center[1];
                for group in columns.start / LANES..columns.end.div_ceil(LANES) {
                    let dx = (rect.x + group * LANES) as f32 + 0.5 - splat.center[0];
                    let left = &mut transmittance[y * (TILE / LANES) + group];
                    let before = L::load(left);
                    if !L::any(unfinished(before)) {
                        continue;
                    }
                    let absorbed = absorb(splat, dx, dy, before);
                    if L::any(L::splat(0.0).less(absorbed)) {
                        (before - absorbed).store(left);
                        let mut weights = [0.0; LANES];
                        absorbed.store(&mut weights);
                        sink.add(splat, y * TILE + group * LANES, &weights, left);
                    }
                }
            }
        }
    }
}

/// The pixels to which splats further back still add light: those with at least [`TRANSMITTANCE_MIN`].
#[inline(always)]
fn unfinished<L: Lanes>(transmittance: L) -> L::Mask {
    let (no, yes) = (L::splat(0.0), L::splat(1.0));
    no.less(L::select(transmittance.less(L::splat(TRANSMITTANCE_MIN)), no, yes))
}

#[inline(always)]
fn any_unfinished<L: Lanes>(transmittance: &[[f32; LANES]]) -> bool {
    for left in transmittance {
        if L::any(unfinished(L::load(left))) {
            return true;
        }
    }
    false
}

/// The pixels of `0..length` whose centres lie within `reach` of `center`.
#[inline(always)]
fn covered(center: f32, reach: f32, length: usize) -> std::ops::Range<usize> {
    let start = (center - reach - 0.5).ceil().max(0.0) as usize;
    let end = (center + reach + 0.5).floor().clamp(0.0, length as f32) as usize;
    start..end
}

/// Weights of a splat on pixels with the transmittance `left`, the first of whose centres is at (`dx`, `dy`) px from
/// the splat's.
#[inline(always)]
fn absorb<L: Lanes>(splat: &Splat, dx: f32, dy: f32, left: L) -> L {
    let [a, b, c] = splat.conic;
    let (along, across) = (L::splat(-0.5 * c * dy * dy), L::splat(b * dy));
    let dx = L::splat(dx) + L::load(&COLUMNS);
    let exponent = along - dx * (L::splat(0.5 * a) * dx + across);
    let alpha = (L::splat(splat.opacity) * exp(exponent)).min(L::splat(ALPHA_MAX));
    let none = L::splat(0.0);
    let visible = L::select(alpha.less(L::splat(ALPHA_MIN)), none, alpha);
    L::select(left.less(L::splat(TRANSMITTANCE_MIN)), none, visible) * left
}

/// Distance of each of the pixels from the first, px.
const COLUMNS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// `exp(x)` for x <= 0 to two units in the last place, without a call, so that it stays in registers and gives the same
/// bits on every machine: 2^n times the Taylor polynomial of the remainder, |remainder| <= ln(2)/2.
#[inline(always)]
fn exp<L: Lanes>(x: L) -> L {
    /// 1.5 * 2^23: adding it rounds a small float to an integer.
    const ROUND: f32 = 12_582_912.0;
    /// Below this the result underflows; alpha falls below its minimum long before.
    const LOWEST: f32 = -80.0;
    // ln 2 in two parts, the first exact in few bits, so that n ln 2 loses nothing (Cody and Waite).
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    let number = L::splat;
    let x = x.max(number(LOWEST)).min(number(0.0));
    let n = (x * number(std::f32::consts::LOG2_E) + number(ROUND)) - number(ROUND);
    let r = (x - n * number(LN2_HIGH)) - n * number(LN2_LOW);
    let tail = number(1.0 / 6.0) + r * (number(1.0 / 24.0) + r * (number(1.0 / 120.0) + r * number(1.0 / 720.0)));
    let series = number(1.0) + r * (number(1.0) + r * (number(0.5) + r * tail));
    series * n.exp2_of_whole()
}

#[cfg(test)]
mod tests {
    use super::exp;
    use crate::simd::{Lanes, LanesKernel, Plain, Vector, run_lanes};

    /// `exp` of one number, with the registers of this processor.
    struct Exp(f32);

    impl LanesKernel for Exp {
        type Output = f32;

        #[inline(always)]
        fn run<L: Lanes>(self) -> f32 {
            first(exp(L::splat(self.0)))
        }
    }

    fn first<L: Lanes>(lanes: L) -> f32 {
        let mut values = [0.0; super::LANES];
        lanes.store(&mut values);
        values[0]
    }

    #[test]
    fn exp_is_close_to_the_library_and_the_same_in_any_registers() {
        for n in 0..80_000 {
            let x = -(n as f32) * 1e-3;
            let (ours, exact) = (run_lanes(Exp(x)), f64::from(x).exp());
            // Two units in the last place of f32.
            assert!((f64::from(ours) / exact - 1.0).abs() < 2.4e-7, "exp({x}) = {ours}, not {exact}");
            assert_eq!(ours, first(exp(Plain::splat(x))));
        }
    }
}
