//! The votes of each view for each Gaussian: its ballots.
//!
//! Under [`Rule::Frequency`] a view gives a Gaussian that it sees one vote for the segment at its centre (the paper's
//! rule). Under [`Rule::Contribution`] every pixel gives each Gaussian that it shows a vote for the pixel's segment,
//! weighted by the Gaussian's share of the pixel's light, alpha times transmittance. This is correct at the border of
//! two segments, where the centre of a large Gaussian says nothing about the rest of it, and needs no depth test:
//! hidden Gaussians add no light.

use super::answered_subjects::AnsweredSubjects;
use super::options::Rule;
use super::{Progress, VotingView};
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::render::depth_test::{DepthMap, DepthTest};
use crate::render::{Projected, RenderOptions, Splat, contributions};
use crate::segment::LabelMap;

/// Votes of one view for one segment to one Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ballot {
    /// Index into [`AnsweredSubjects::subjects`].
    pub segment: u32,
    /// 1, or the light in pixels.
    pub weight: f32,
}

/// The ballots of all Gaussians.
pub(super) struct Ballots {
    /// Gaussian `i` has `ballots[starts[i]..starts[i + 1]]`.
    starts: Vec<usize>,
    /// Sorted by Gaussian, then by view, then by segment.
    ballots: Vec<Ballot>,
}

impl Ballots {
    /// Collects the votes of every view.
    pub fn cast(
        gaussians: &Gaussians,
        views: &[VotingView],
        subjects: &AnsweredSubjects,
        rule: Rule,
        progress: Progress,
    ) -> Self {
        let bar = progress.bar("vote", views.len() as u64).with_message("views");
        let test = DepthTest::new(gaussians);
        let mut of_views = Vec::new();
        for (number, view) in views.iter().enumerate() {
            let projected = Projected::new(gaussians, view.camera, &RenderOptions::default());
            let find = |label| subjects.find(number, label);
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
        &self.ballots[self.starts[i]..self.starts[i + 1]]
    }

    pub fn gaussians(&self) -> usize {
        self.starts.len() - 1
    }

    /// Sorts by Gaussian with a counting sort, so the order by view and segment stays within a Gaussian. Each view is
    /// dropped as soon as it is read.
    pub fn sorted(gaussians: usize, of_views: Vec<Vec<(u32, Ballot)>>) -> Self {
        let mut starts = vec![0; gaussians + 1];
        for (gaussian, _) in of_views.iter().flatten() {
            starts[*gaussian as usize + 1] += 1;
        }
        for i in 0..gaussians {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut ballots = vec![Ballot { segment: 0, weight: 0.0 }; starts[gaussians]];
        for (gaussian, ballot) in of_views.into_iter().flatten() {
            let place = &mut next[gaussian as usize];
            ballots[*place] = ballot;
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
    parallel::flat_map(projected.splats(), vote)
}

/// Ballots under [`Rule::Contribution`].
fn by_light(
    gaussians: usize,
    projected: Projected,
    map: &LabelMap,
    find: impl Fn(u16) -> Option<u32> + Sync,
) -> Vec<(u32, Ballot)> {
    let of_segment = |(gaussian, segment, weight)| (gaussian, Ballot { segment, weight });
    contributions(gaussians, projected, &map.labels, find).into_iter().map(of_segment).collect()
}
