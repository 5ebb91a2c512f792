//! From SAM's 256 x 256 logits to a mask at picture size and its stability, in one pass.
//!
//! The public predictor enlarges the logits bilinearly to 1024 x 1024, cuts off the padding, and resizes the rest
//! bilinearly (without antialiasing) to the picture. Both steps are linear and work on rows and columns separately, so
//! per axis they fold into one table of three neighbouring weights per output pixel. Pixels that depend only on logits
//! below the lowest threshold affect no count and are never computed.

use super::mask::{Mask, MaskBuilder};
use super::sam::{LOGITS_SIDE, MODEL_SIDE};

/// SAM's `mask_threshold`: logits above it are the mask.
const MASK_THRESHOLD: f32 = 0.0;

/// The weights with which one output row or column mixes three neighbouring ones of the logits.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Taps {
    first: usize,
    weights: [f32; 3],
}

/// Computes masks of one picture size.
#[derive(Debug, Clone)]
pub struct Upsampler {
    columns: Vec<Taps>,
    rows: Vec<Taps>,
}

/// A mask and its stability when the threshold changes.
#[derive(Debug, Clone)]
pub struct ScoredMask {
    pub mask: Mask,
    /// Area above the threshold plus the offset, over area above the threshold minus the offset; NaN if the latter is
    /// zero. As in the public `calculate_stability_score`.
    pub stability: f32,
}

impl Upsampler {
    /// Prepares for a picture of `width` x `height` whose scaled copy fills `scaled_width` x `scaled_height` of the
    /// model's input.
    pub fn new(width: u32, height: u32, scaled_width: u32, scaled_height: u32) -> Self {
        Self { columns: taps(width, scaled_width), rows: taps(height, scaled_height) }
    }

    /// Enlarges, thresholds and scores `logits` (256 x 256, row by row). `offset` is the distance of the two stability
    /// thresholds from the mask's.
    pub fn score(&self, logits: &[f32], offset: f32) -> ScoredMask {
        let (high, low) = (MASK_THRESHOLD + offset, MASK_THRESHOLD - offset);
        let mut builder = MaskBuilder::new(self.columns.len() as u32);
        let Some(live) = Live::find(logits, low.min(MASK_THRESHOLD)) else {
            self.rows.iter().for_each(|_| builder.end_row());
            return ScoredMask { mask: builder.finish(), stability: f32::NAN };
        };
        let columns = touching(&self.columns, live.columns);
        let rows = touching(&self.rows, live.rows);
        let stretched = self.stretch_columns(logits, &columns, live.rows);
        let (mut above_high, mut above_low) = (0_u64, 0_u64);
        let mut line = vec![0.0_f32; columns.len()];
        for (y, taps) in self.rows.iter().enumerate() {
            if rows.contains(&y) {
                mix_rows(&stretched, taps, &mut line);
                above_high += count_above(&line, high);
                above_low += count_above(&line, low);
                push_runs(&mut builder, &line, columns.start as u32);
            }
            builder.end_row();
        }
        ScoredMask { mask: builder.finish(), stability: above_high as f32 / above_low as f32 }
    }

    /// The logits with their columns interpolated to the output's `columns`. Rows that no live output row needs stay
    /// zero.
    fn stretch_columns(&self, logits: &[f32], columns: &std::ops::Range<usize>, live_rows: (usize, usize)) -> Vec<f32> {
        let width = columns.len();
        let mut stretched = vec![0.0; LOGITS_SIDE * width];
        let first = live_rows.0.saturating_sub(2);
        let last = (live_rows.1 + 2).min(LOGITS_SIDE - 1);
        for row in first..=last {
            let source = &logits[row * LOGITS_SIDE..(row + 1) * LOGITS_SIDE];
            let target = &mut stretched[row * width..(row + 1) * width];
            for (value, taps) in target.iter_mut().zip(&self.columns[columns.clone()]) {
                let samples = &source[taps.first..taps.first + 3];
                *value = samples[0] * taps.weights[0] + samples[1] * taps.weights[1] + samples[2] * taps.weights[2];
            }
        }
        stretched
    }
}

/// The first and last row and column with a logit above a threshold.
struct Live {
    rows: (usize, usize),
    columns: (usize, usize),
}

impl Live {
    fn find(logits: &[f32], threshold: f32) -> Option<Self> {
        let mut found: Option<Self> = None;
        for (y, row) in logits.chunks_exact(LOGITS_SIDE).enumerate() {
            let Some(first) = row.iter().position(|&logit| logit > threshold) else { continue };
            let last = row.iter().rposition(|&logit| logit > threshold).unwrap_or(first);
            found = Some(match found {
                None => Self { rows: (y, y), columns: (first, last) },
                Some(so_far) => Self {
                    rows: (so_far.rows.0, y),
                    columns: (so_far.columns.0.min(first), so_far.columns.1.max(last)),
                },
            });
        }
        found
    }
}

/// The outputs that depend on any of the logits `live.0..=live.1`.
fn touching(taps: &[Taps], live: (usize, usize)) -> std::ops::Range<usize> {
    let start = taps.partition_point(|taps| taps.first + 2 < live.0);
    let end = taps.partition_point(|taps| taps.first <= live.1);
    start..end
}

fn mix_rows(stretched: &[f32], taps: &Taps, line: &mut [f32]) {
    let width = line.len();
    let row = |index: usize| &stretched[(taps.first + index) * width..(taps.first + index + 1) * width];
    for (((value, a), b), c) in line.iter_mut().zip(row(0)).zip(row(1)).zip(row(2)) {
        *value = a * taps.weights[0] + b * taps.weights[1] + c * taps.weights[2];
    }
}

fn count_above(line: &[f32], threshold: f32) -> u64 {
    u64::from(line.iter().map(|&value| u32::from(value > threshold)).sum::<u32>())
}

fn push_runs(builder: &mut MaskBuilder, line: &[f32], first_column: u32) {
    let mut start = None;
    for (x, &value) in line.iter().enumerate() {
        match (start, value > MASK_THRESHOLD) {
            (None, true) => start = Some(x as u32),
            (Some(begin), false) => {
                builder.push(first_column + begin, first_column + x as u32);
                start = None;
            }
            _ => {}
        }
    }
    if let Some(begin) = start {
        builder.push(first_column + begin, first_column + line.len() as u32);
    }
}

/// Both resizings of one axis as one table: logits to the model's side, its first `scaled` samples to `size`.
fn taps(size: u32, scaled: u32) -> Vec<Taps> {
    let outer_scale = scaled as f32 / size as f32;
    let inner_scale = LOGITS_SIDE as f32 / MODEL_SIDE as f32;
    let taps_at = |index: u32| {
        let outer = neighbours(index, outer_scale, scaled as usize);
        let mut weights = [(0, 0.0); 4];
        for (slot, (sample, share)) in outer.into_iter().enumerate() {
            for (inner_slot, (logit, weight)) in
                neighbours(sample as u32, inner_scale, LOGITS_SIDE).into_iter().enumerate()
            {
                weights[2 * slot + inner_slot] = (logit, share * weight);
            }
        }
        let first = weights[0].0.min(LOGITS_SIDE - 3);
        let mut taps = Taps { first, weights: [0.0; 3] };
        for (logit, weight) in weights {
            taps.weights[logit - first] += weight;
        }
        taps
    };
    (0..size).map(taps_at).collect()
}

/// The two samples that bilinear interpolation mixes for output `index`, and their shares (PyTorch `interpolate` with
/// `align_corners=False`).
fn neighbours(index: u32, scale: f32, size: usize) -> [(usize, f32); 2] {
    let position = ((index as f32 + 0.5) * scale - 0.5).max(0.0);
    let first = (position as usize).min(size - 1);
    let share = position - first as f32;
    [(first, 1.0 - share), ((first + 1).min(size - 1), share)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The predictor's two steps, one after the other, in double precision.
    fn two_steps(logits: &[f32], size: (u32, u32), scaled: (u32, u32)) -> Vec<f64> {
        let bilinear = |source: &[f64], from: (usize, usize), used: (u32, u32), to: (u32, u32)| -> Vec<f64> {
            let mut result = Vec::new();
            for y in 0..to.1 {
                for x in 0..to.0 {
                    let columns = neighbours(x, used.0 as f32 / to.0 as f32, used.0 as usize);
                    let rows = neighbours(y, used.1 as f32 / to.1 as f32, used.1 as usize);
                    let mut sum = 0.0;
                    for (row, row_share) in rows {
                        for (column, share) in columns {
                            sum += source[row * from.0 + column] * f64::from(row_share) * f64::from(share);
                        }
                    }
                    result.push(sum);
                }
            }
            result
        };
        let logits: Vec<f64> = logits.iter().map(|&logit| f64::from(logit)).collect();
        let side = MODEL_SIDE as u32;
        let whole =
            bilinear(&logits, (LOGITS_SIDE, LOGITS_SIDE), (LOGITS_SIDE as u32, LOGITS_SIDE as u32), (side, side));
        bilinear(&whole, (MODEL_SIDE, MODEL_SIDE), scaled, size)
    }

    fn wavy_logits() -> Vec<f32> {
        (0..LOGITS_SIDE * LOGITS_SIDE)
            .map(|i| {
                let (x, y) = ((i % LOGITS_SIDE) as f32, (i / LOGITS_SIDE) as f32);
                let distance = ((x - 90.0).powi(2) + (y - 110.0).powi(2)).sqrt();
                (60.0 - distance) * 0.1 + (x * 0.31).sin() * (y * 0.17).cos()
            })
            .collect()
    }

    #[test]
    fn one_pass_equals_the_two_steps_of_the_public_predictor() {
        // A smaller picture, a larger one, and one of the size that the model sees.
        for (size, scaled) in [((50, 37), (1024, 758)), ((300, 400), (768, 1024)), ((1024, 700), (1024, 700))] {
            let logits = wavy_logits();
            let scored = Upsampler::new(size.0, size.1, scaled.0, scaled.1).score(&logits, 1.0);
            let expected = two_steps(&logits, size, scaled);
            // Pixels within rounding error of the threshold may fall on either side.
            let mut decided = 0;
            for (i, &value) in expected.iter().enumerate().filter(|(_, value)| value.abs() > 1e-4) {
                let (x, y) = (i as u32 % size.0, i as u32 / size.0);
                let is_set = scored.mask.row(y).iter().any(|&(start, end)| (start..end).contains(&x));
                assert_eq!(is_set, value > 0.0, "pixel {x},{y} of {size:?}: {value}");
                decided += 1;
            }
            assert!(decided > expected.len() * 9 / 10);
            let above = |threshold: f64| expected.iter().filter(|&&value| value > threshold).count() as f32;
            let stability = above(1.0) / above(-1.0);
            assert!((scored.stability - stability).abs() < 1e-3, "{} {stability}", scored.stability);
        }
    }

    #[test]
    fn no_logit_above_the_threshold_is_an_empty_mask() {
        let scored = Upsampler::new(20, 10, 1024, 512).score(&vec![-5.0; LOGITS_SIDE * LOGITS_SIDE], 1.0);
        assert_eq!((scored.mask.area(), scored.mask.height()), (0, 10));
        assert!(scored.stability.is_nan());
    }
}
