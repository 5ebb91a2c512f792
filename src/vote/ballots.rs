//! The votes of each view for each Gaussian: its ballots.
//!
//! Under [`Rule::Frequency`] a view gives a Gaussian that it sees one vote for the segment at its centre (the paper's
//! rule). Under [`Rule::Contribution`] every pixel gives each Gaussian that it shows a vote for the pixel's segment,
//! weighted by the Gaussian's share of the pixel's light, alpha times transmittance. This is correct at the border of
//! two segments, where the centre of a large Gaussian says nothing about the rest of it, and needs no depth test:
//! hidden Gaussians add no light.

use rayon::prelude::*;

use super::answered_segments::AnsweredSegments;
use super::options::Rule;
use super::{Progress, ViewInput};
use crate::render::depth_test::{DepthMap, DepthTest};
use crate::render::{LANES, Projected, RenderOptions, Sink, Splat, TILE, TRANSMITTANCE_MIN, TileRect, pixels};
use crate::scene::gaussians::Gaussians;
use crate::segment::LabelMap;

/// A view sees a Gaussian if at least this share of its light arrives; the rest is blocked by what is in front. A
/// closed surface of trained Gaussians lets a few hundredths through; an unobstructed Gaussian sends all of its light.
const VISIBLE_SHARE: f32 = 0.1;

/// Votes of one view for one segment to one Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ballot {
    /// Index of the view's segment.
    pub segment: u32,
    /// 1, or the light in pixels.
    pub weight: f32,
}

/// The ballots of all Gaussians.
pub(super) struct Ballots {
    /// Gaussian `i` has `ballots[starts[i]..starts[i + 1]]`.
    starts: Vec<u32>,
    /// Sorted by Gaussian, then by view, then by segment.
    ballots: Vec<Ballot>,
}

impl Ballots {
    /// Collects the votes of every view.
    pub fn cast(
        gaussians: &Gaussians,
        views: &[ViewInput],
        segments: &AnsweredSegments,
        rule: Rule,
        progress: Progress,
    ) -> Self {
        let bar = progress.bar("vote", views.len() as u64);
        let test = DepthTest::new(gaussians);
        let mut of_views = Vec::new();
        for (number, view) in views.iter().enumerate() {
            let projected = Projected::new(gaussians, view.camera, &RenderOptions::default());
            let find = |label| segments.find(number, label);
            of_views.push(match rule {
                Rule::Frequency => by_center(&projected, test, view.map, find),
                Rule::Contribution => by_light(gaussians.len(), projected, view.map, find),
            });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Self::sorted(gaussians.len(), of_views)
    }

    /// The ballots for Gaussian `i`, by view, then by segment.
    pub fn of(&self, i: usize) -> &[Ballot] {
        &self.ballots[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    pub fn gaussians(&self) -> usize {
        self.starts.len() - 1
    }

    /// Sorts by Gaussian with a counting sort, so the order by view and segment stays within a Gaussian. Each view is
    /// dropped as soon as it is read.
    fn sorted(gaussians: usize, of_views: Vec<Vec<(u32, Ballot)>>) -> Self {
        let mut starts = vec![0u32; gaussians + 1];
        for (gaussian, _) in of_views.iter().flatten() {
            starts[*gaussian as usize + 1] += 1;
        }
        for i in 0..gaussians {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut ballots = vec![Ballot { segment: 0, weight: 0.0 }; starts[gaussians] as usize];
        for (gaussian, ballot) in of_views.into_iter().flatten() {
            let place = &mut next[gaussian as usize];
            ballots[*place as usize] = ballot;
            *place += 1;
        }
        Self { starts, ballots }
    }
}

/// Ballots under [`Rule::Frequency`].
fn by_center(
    projected: &Projected,
    test: DepthTest,
    map: &LabelMap,
    find: impl Fn(u16) -> Option<u32> + Sync,
) -> Vec<(u32, Ballot)> {
    let depth_map = DepthMap::new(projected);
    let vote = |splat: &Splat| {
        let (pixel, depth) = depth_map.at(splat)?;
        let segment = find(map.labels[pixel])?;
        test.passes(splat, depth).then_some((splat.gaussian, Ballot { segment, weight: 1.0 }))
    };
    projected.splats().par_iter().filter_map(vote).collect()
}

/// Ballots under [`Rule::Contribution`].
fn by_light(
    gaussians: usize,
    projected: Projected,
    map: &LabelMap,
    find: impl Fn(u16) -> Option<u32> + Sync,
) -> Vec<(u32, Ballot)> {
    let width = projected.size().0;
    // Light that arrives and light that is emitted, by Gaussian.
    let mut light = vec![[0.0f32; 2]; gaussians];
    // Capacity for four tiles or segments per Gaussian: a growing list would leave holes of its former sizes in memory.
    let mut ballots: Vec<(u32, Ballot)> = Vec::with_capacity(4 * gaussians);
    projected.visit_in_bands(
        |rect| LightSink::new(rect, map, width),
        |tile| {
            for Contribution { gaussian, label, arrived, sent } in tile.contributions {
                let of_gaussian = &mut light[gaussian as usize];
                of_gaussian[0] += arrived;
                of_gaussian[1] += sent;
                ballots.extend(find(label).map(|segment| (gaussian, Ballot { segment, weight: arrived })));
            }
        },
    );
    drop(projected);
    ballots.retain(|(gaussian, _)| {
        let [arrived, sent] = light[*gaussian as usize];
        arrived >= VISIBLE_SHARE * sent
    });
    // A stable sort: contributions that a tile border has split are added up in the order of the tiles.
    ballots.par_sort_by_key(|(gaussian, ballot)| (*gaussian, ballot.segment));
    ballots.dedup_by(|next, kept| {
        let same = (next.0, next.1.segment) == (kept.0, kept.1.segment);
        kept.1.weight += if same { next.1.weight } else { 0.0 };
        same
    });
    ballots.shrink_to_fit();
    ballots
}

/// How much the pixels of one label within one tile see of one Gaussian, in pixels.
#[derive(Debug, Clone, Copy)]
struct Contribution {
    gaussian: u32,
    label: u16,
    /// Sum of alpha times transmittance.
    arrived: f32,
    /// Sum of alpha.
    sent: f32,
}

/// The contributions of one tile.
struct LightSink {
    /// Label of every pixel of the tile; background outside the picture.
    labels: [u16; TILE * TILE],
    contributions: Vec<Contribution>,
    /// Where the contributions of the Gaussian being blended start: rarely more than two labels.
    current: usize,
}

impl LightSink {
    fn new(rect: TileRect, map: &LabelMap, width: usize) -> Self {
        let mut labels = [0; TILE * TILE];
        for (inside, outside) in pixels(rect, width) {
            labels[inside] = map.labels[outside];
        }
        Self { labels, contributions: Vec::new(), current: 0 }
    }

    fn count(&mut self, gaussian: u32, label: u16, arrived: f32, sent: f32) {
        match self.contributions[self.current..].iter_mut().find(|contribution| contribution.label == label) {
            Some(contribution) => {
                contribution.arrived += arrived;
                contribution.sent += sent;
            }
            None => self.contributions.push(Contribution { gaussian, label, arrived, sent }),
        }
    }
}

impl Sink for LightSink {
    fn add(&mut self, splat: &Splat, first: usize, weights: &[f32; LANES], transmittance: &[f32; LANES]) {
        let gaussian = splat.gaussian;
        if self.contributions.last().is_none_or(|last| last.gaussian != gaussian) {
            self.current = self.contributions.len();
        }
        // The light before the splat is the sum of what it takes and what it leaves; a finished pixel counts as
        // neither.
        let sent: [f32; LANES] =
            std::array::from_fn(|lane| weights[lane] / (weights[lane] + transmittance[lane]).max(TRANSMITTANCE_MIN));
        let labels: [u16; LANES] = std::array::from_fn(|lane| self.labels[first + lane]);
        if labels.iter().all(|label| *label == labels[0]) {
            self.count(gaussian, labels[0], weights.iter().sum(), sent.iter().sum());
            return;
        }
        for lane in (0..LANES).filter(|&lane| weights[lane] > 0.0) {
            self.count(gaussian, labels[lane], weights[lane], sent[lane]);
        }
    }
}
