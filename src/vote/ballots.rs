//! What each view says of each Gaussian: its ballots.
//!
//! Under [`Rule::Frequency`] a view gives a Gaussian that it sees one vote for the part at its centre (the paper's rule).
//! Under [`Rule::Contribution`] every pixel gives each Gaussian that it shows a vote for its part as large as the
//! Gaussian's share of the pixel's light, alpha times transmittance. That is right at the border of two parts, where the
//! centre of a large Gaussian says nothing about the rest of it, and needs no depth test: what is hidden adds no light.

use rayon::prelude::*;

use super::depth::{DepthMap, DepthTest};
use super::options::Rule;
use super::parts_of_views::ViewParts;
use super::raster::{LANES, Projected, RenderOptions, Sink, Splat, TILE, TileRect};
use super::{Progress, ViewInput};
use crate::scene::gaussians::Gaussians;
use crate::segment::LabelMap;

/// Votes of one view for one part to one Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ballot {
    /// Index of the view's part.
    pub part: u32,
    /// 1, or the light in pixels.
    pub weight: f32,
}

/// The ballots of all Gaussians.
pub(super) struct Ballots {
    /// Gaussian `i` has `ballots[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    /// By Gaussian, then by view, then by part.
    ballots: Vec<Ballot>,
}

impl Ballots {
    /// Lets every view vote.
    pub fn cast(gaussians: &Gaussians, views: &[ViewInput], parts: &ViewParts, rule: Rule, progress: Progress) -> Self {
        let bar = progress.bar("vote", views.len() as u64);
        let test = DepthTest::new(gaussians);
        let mut of_views = Vec::new();
        for (number, view) in views.iter().enumerate() {
            let projected = Projected::new(gaussians, view.camera, &RenderOptions::default());
            let find = |label| parts.find(number, label);
            of_views.push(match rule {
                Rule::Frequency => by_center(&projected, test, view.map, find),
                Rule::Contribution => by_light(&projected, view.map, find),
            });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Self::sorted(gaussians.len(), &of_views)
    }

    /// The ballots for Gaussian `i`, by view, then by part.
    pub fn of(&self, i: usize) -> &[Ballot] {
        &self.ballots[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    pub fn gaussians(&self) -> usize {
        self.starts.len() - 1
    }

    /// Sorts by Gaussian (counting sort, so the order of the views stays) and adds up what a tile border has split.
    fn sorted(gaussians: usize, of_views: &[Vec<(u32, Ballot)>]) -> Self {
        let mut starts = vec![0u32; gaussians + 1];
        for (gaussian, _) in of_views.iter().flatten() {
            starts[*gaussian as usize + 1] += 1;
        }
        for i in 0..gaussians {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut scattered = vec![Ballot { part: 0, weight: 0.0 }; starts[gaussians] as usize];
        for &(gaussian, ballot) in of_views.iter().flatten() {
            let place = &mut next[gaussian as usize];
            scattered[*place as usize] = ballot;
            *place += 1;
        }
        let mut ballots: Vec<Ballot> = Vec::with_capacity(scattered.len());
        let mut from = 0;
        for i in 0..gaussians {
            let to = starts[i + 1] as usize;
            let own = &mut scattered[from..to];
            // Parts are numbered by view, so this keeps the views in order; equal parts stay in the order of the tiles.
            own.sort_by_key(|ballot| ballot.part);
            let first = ballots.len();
            for ballot in own {
                match ballots[first..].last_mut() {
                    Some(last) if last.part == ballot.part => last.weight += ballot.weight,
                    _ => ballots.push(*ballot),
                }
            }
            from = to;
            starts[i + 1] = ballots.len() as u32;
        }
        Self { starts, ballots }
    }
}

/// [`Rule::Frequency`].
fn by_center(
    projected: &Projected,
    test: DepthTest,
    map: &LabelMap,
    find: impl Fn(u16) -> Option<u32> + Sync,
) -> Vec<(u32, Ballot)> {
    let depth_map = DepthMap::new(projected);
    let vote = |splat: &Splat| {
        let (pixel, depth) = depth_map.at(splat)?;
        let part = find(map.labels[pixel])?;
        test.passes(splat, depth).then_some((splat.gaussian, Ballot { part, weight: 1.0 }))
    };
    projected.splats().par_iter().filter_map(vote).collect()
}

/// [`Rule::Contribution`].
fn by_light(projected: &Projected, map: &LabelMap, find: impl Fn(u16) -> Option<u32> + Sync) -> Vec<(u32, Ballot)> {
    let width = projected.size().0;
    let sinks = projected.visit(|rect| LightSink::new(rect, map, width));
    let mut ballots = Vec::new();
    for (_, sink) in sinks {
        let cast = sink.finished().into_iter();
        ballots.extend(
            cast.filter_map(|(gaussian, label, weight)| Some((gaussian, Ballot { part: find(label)?, weight }))),
        );
    }
    ballots
}

/// Light by Gaussian and label within one tile.
struct LightSink {
    /// Label of every pixel of the tile; background outside the picture.
    labels: [u16; TILE * TILE],
    /// The Gaussian being blended and its light so far, by label in order of first sight: rarely more than two.
    current: u32,
    light: Vec<(u16, f32)>,
    done: Vec<(u32, u16, f32)>,
}

impl LightSink {
    fn new(rect: TileRect, map: &LabelMap, width: usize) -> Self {
        let mut labels = [0; TILE * TILE];
        for (inside, outside) in super::raster::pixels(rect, width) {
            labels[inside] = map.labels[outside];
        }
        Self { labels, current: u32::MAX, light: Vec::new(), done: Vec::new() }
    }

    fn count(&mut self, label: u16, light: f32) {
        match self.light.iter_mut().find(|(known, _)| *known == label) {
            Some((_, sum)) => *sum += light,
            None => self.light.push((label, light)),
        }
    }

    fn flush(&mut self) {
        let gaussian = self.current;
        self.done.extend(self.light.drain(..).map(|(label, light)| (gaussian, label, light)));
    }

    /// Gaussian, label, light in pixels.
    fn finished(mut self) -> Vec<(u32, u16, f32)> {
        self.flush();
        self.done
    }
}

impl Sink for LightSink {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], _: &[f32; LANES]) {
        if splat.gaussian != self.current {
            self.flush();
            self.current = splat.gaussian;
        }
        let label = self.labels[first];
        if self.labels[first..first + LANES].iter().all(|other| *other == label) {
            self.count(label, weights.iter().sum());
            return;
        }
        for (lane, &weight) in weights.iter().enumerate() {
            if weight > 0.0 {
                self.count(self.labels[first + lane], weight);
            }
        }
    }
}
