//! For every pixel, the label that owns most of it.

use super::blend::{LANES, Sink, TileRect};
use super::project::Splat;
use super::tiles::TILE;

/// Weight of every label on the pixels of one tile.
pub(super) struct LabelSink<'a> {
    labels: &'a [u32],
    /// The labels seen in this tile, in order of first appearance. They are few, so a linear search is fast.
    pub planes: Vec<(u32, [f32; TILE * TILE])>,
}

impl<'a> LabelSink<'a> {
    /// `labels[i]` is the label of Gaussian `i`.
    pub fn new(labels: &'a [u32]) -> Self {
        Self { labels, planes: Vec::new() }
    }

    /// The label with the largest weight on `pixel` and the weight of all; ties go to the lower label.
    pub fn winner(&self, pixel: usize) -> (Option<u32>, f32) {
        let mut best: Option<(u32, f32)> = None;
        let mut alpha = 0.0;
        for (label, weights) in &self.planes {
            let weight = weights[pixel];
            alpha += weight;
            if best.is_none_or(|(other, most)| weight > most || (weight == most && *label < other)) {
                best = Some((*label, weight));
            }
        }
        (best.map(|(label, _)| label), alpha)
    }
}

impl Sink for LabelSink<'_> {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], _: &[f32; LANES]) {
        let label = self.labels[splat.gaussian as usize];
        let plane = match self.planes.iter().position(|(known, _)| *known == label) {
            Some(at) => &mut self.planes[at].1,
            None => {
                self.planes.push((label, [0.0; TILE * TILE]));
                &mut self.planes.last_mut().expect("pushed just now").1
            }
        };
        for (sum, weight) in plane[first..first + LANES].iter_mut().zip(weights) {
            *sum += weight;
        }
    }
}

/// The weights of several labelings on the pixels of one tile.
pub(super) struct LabelingsSink<'a> {
    pub rect: TileRect,
    pub sinks: Vec<LabelSink<'a>>,
}

impl<'a> LabelingsSink<'a> {
    /// `labelings[n][i]` is the label of Gaussian `i` in labeling `n`.
    pub fn new(rect: TileRect, labelings: &[&'a [u32]]) -> Self {
        Self { rect, sinks: labelings.iter().map(|labels| LabelSink::new(labels)).collect() }
    }
}

impl Sink for LabelingsSink<'_> {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], transmittance: &[f32; LANES]) {
        for sink in &mut self.sinks {
            sink.add(splat, first, weights, transmittance);
        }
    }
}
