//! An upper bound for any vote: the best labels that the splat's Gaussians could have for the held-out views, found
//! with the true maps of these views. The remaining error is due to the splat and its rendering, not to the vote.
//!
//! Coordinate ascent: a pixel shows the label with the largest sum of blend weights; a Gaussian takes another label
//! if that makes more pixels right, until no change does. It starts from the vote of the held-out views themselves and
//! finds a local optimum, so the true bound may lie a little higher.

use gprop::evaluate::segmentation::IouTally;
use gprop::render::{FOREGROUND_ALPHA, LANES, RenderOptions, Sink, Splat, TileRect, pixels, visit};

use super::scenes::{HeldOut, Measured};

/// Part ids of the scenes are lower than this.
const PARTS: usize = 4;

/// The weight of each splat on each pixel of one tile.
struct Weights {
    rect: TileRect,
    /// Gaussian, pixel within the tile, weight.
    found: Vec<(u32, u16, f32)>,
}

impl Sink for Weights {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], _: &[f32; LANES]) {
        let lanes = (0..LANES).filter(|&lane| weights[lane] > 0.0);
        self.found.extend(lanes.map(|lane| (splat.gaussian, (first + lane) as u16, weights[lane])));
    }
}

/// The pixels of all held-out views in one row.
struct Pixels {
    /// Sum of weights by label.
    sums: Vec<[f32; PARTS]>,
    /// True part; `None` outside.
    truth: Vec<Option<u32>>,
    /// By Gaussian: pixels it touches and its weight there.
    touched: Vec<Vec<(u32, f32)>>,
}

impl Pixels {
    fn new(measured: &Measured, labels: &[u32]) -> Self {
        let mut all = Self { sums: vec![], truth: vec![], touched: vec![Vec::new(); labels.len()] };
        measured.held_out.iter().for_each(|view| all.add(measured, view));
        for (label, touched) in labels.iter().zip(&all.touched) {
            touched.iter().for_each(|&(pixel, weight)| all.sums[pixel as usize][*label as usize] += weight);
        }
        all
    }

    fn add(&mut self, measured: &Measured, view: &HeldOut) {
        let (start, width) = (self.sums.len(), view.parts.width() as usize);
        self.truth.extend(view.parts.pixels().map(|p| (p.0[0] != 255).then_some(u32::from(p.0[0]))));
        self.sums.resize(self.truth.len(), [0.0; PARTS]);
        let new = |rect| Weights { rect, found: Vec::new() };
        for (_, tile) in visit(&measured.scene.gaussians, &view.camera, &RenderOptions::default(), new) {
            let places: std::collections::BTreeMap<usize, usize> = pixels(tile.rect, width).collect();
            for (gaussian, inside, weight) in tile.found {
                let Some(outside) = places.get(&usize::from(inside)) else { continue };
                self.touched[gaussian as usize].push(((start + outside) as u32, weight));
            }
        }
    }

    fn shown(sums: &[f32; PARTS]) -> Option<u32> {
        let best = (0..PARTS).reduce(|best, next| if sums[next] > sums[best] { next } else { best });
        best.filter(|_| sums.iter().sum::<f32>() >= FOREGROUND_ALPHA).map(|label| label as u32)
    }

    /// How many more pixels are right when `gaussian` changes its label.
    fn gain(&self, gaussian: usize, from: u32, to: u32) -> i32 {
        let touched = self.touched[gaussian].iter();
        touched
            .map(|&(pixel, weight)| {
                let (truth, before) = (self.truth[pixel as usize], self.sums[pixel as usize]);
                let mut after = before;
                after[from as usize] -= weight;
                after[to as usize] += weight;
                i32::from(Self::shown(&after) == truth) - i32::from(Self::shown(&before) == truth)
            })
            .sum()
    }

    fn is_right(&self, pixel: u32) -> bool {
        Self::shown(&self.sums[pixel as usize]) == self.truth[pixel as usize]
    }

    fn climb(&mut self, labels: &mut [u32]) {
        let mut right: Vec<bool> = (0..self.sums.len() as u32).map(|pixel| self.is_right(pixel)).collect();
        // The number of changes so far, by pixel at its last change, and by Gaussian when it was last looked at.
        let (mut changes, mut changed) = (1, vec![1u32; right.len()]);
        let mut looked = vec![0u32; labels.len()];
        loop {
            let before = changes;
            for (gaussian, label) in labels.iter_mut().enumerate() {
                let since = std::mem::replace(&mut looked[gaussian], changes);
                // A change can only make pixels right that are wrong, and what made none right still makes none.
                let touched = &self.touched[gaussian];
                let any = |is: &dyn Fn(usize) -> bool| touched.iter().any(|&(pixel, _)| is(pixel as usize));
                if !any(&|pixel| !right[pixel]) || !any(&|pixel| changed[pixel] > since) {
                    continue;
                }
                let from = *label;
                let others = (0..PARTS as u32).filter(|&to| to != from);
                let best = others
                    .map(|to| (self.gain(gaussian, from, to), to))
                    .max_by_key(|&(gain, to)| (gain, PARTS as u32 - to));
                let Some((1.., to)) = best else { continue };
                changes += 1;
                for n in 0..self.touched[gaussian].len() {
                    let (pixel, weight) = self.touched[gaussian][n];
                    let sums = &mut self.sums[pixel as usize];
                    sums[from as usize] -= weight;
                    sums[to as usize] += weight;
                    right[pixel as usize] = self.is_right(pixel);
                    changed[pixel as usize] = changes;
                }
                *label = to;
            }
            if changes == before {
                return;
            }
        }
    }

    fn tally(&self) -> IouTally<u32> {
        let mut tally = IouTally::default();
        tally.add(self.truth.iter().copied().zip(self.sums.iter().map(Self::shown)));
        tally
    }
}

/// IoU by part of the best labels found when starting from `labels`.
pub fn best(measured: &Measured, mut labels: Vec<u32>) -> IouTally<u32> {
    let mut pixels = Pixels::new(measured, &labels);
    pixels.climb(&mut labels);
    pixels.tally()
}
