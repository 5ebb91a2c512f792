//! Colour, alpha and depth of every pixel.

use super::FOREGROUND_ALPHA;
use super::blend::{LANES, Sink, TileRect};
use super::project::Splat;
use super::tiles::TILE;

/// True if a splat with this weight, behind which `after` of the light is left, is the surface at which half of the
/// light is reached: the median depth is its depth.
#[inline(always)]
pub(super) fn is_median(weight: f32, after: f32) -> bool {
    const MEDIAN: f32 = 1.0 - FOREGROUND_ALPHA;
    after < MEDIAN && after + weight >= MEDIAN
}

type Plane = [f32; TILE * TILE];

/// Sums of one tile.
pub(super) struct ColorSink<'a> {
    rect: TileRect,
    colors: &'a [[f32; 3]],
    pub rgb: [Plane; 3],
    pub alpha: Plane,
    /// Sum of weight times depth.
    pub weighted_depth: Plane,
    pub median_depth: Plane,
}

impl<'a> ColorSink<'a> {
    /// `colors[i]` is the colour of Gaussian `i`.
    pub fn new(rect: TileRect, colors: &'a [[f32; 3]]) -> Self {
        let zero = [0.0; TILE * TILE];
        let median_depth = [f32::INFINITY; TILE * TILE];
        Self { rect, colors, rgb: [zero; 3], alpha: zero, weighted_depth: zero, median_depth }
    }
}

impl Sink for ColorSink<'_> {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], transmittance: &[f32; LANES]) {
        let color = self.colors[splat.gaussian as usize];
        for (plane, value) in self.rgb.iter_mut().zip(color) {
            for (sum, weight) in plane[first..first + LANES].iter_mut().zip(weights) {
                *sum += weight * value;
            }
        }
        let depth_at_first = splat.surface_at(self.rect.pixel_center(first));
        for lane in 0..LANES {
            let depth = depth_at_first + splat.depth_slope[0] * lane as f32;
            let (weight, after) = (weights[lane], transmittance[lane]);
            self.alpha[first + lane] += weight;
            self.weighted_depth[first + lane] += weight * depth;
            if is_median(weight, after) {
                self.median_depth[first + lane] = depth;
            }
        }
    }
}
