//! Finds which segments of different views are the same part of the object, and its material.
//!
//! Two views' segments are compared on the Gaussians for which both views vote: how much of their light is in both
//! segments, and how much is in either. Groups of segments are joined by average linkage, always the two with the
//! largest overlap; all counts are summed over their views:
//!
//! 1. while more than half of what is in either group is in both (Jaccard index above [`SAME_PART_OVERLAP`]): the same
//!    part seen from different sides;
//! 2. then, among groups whose views agree on one material, while more than half of the smaller lies within the larger
//!    (containment): the same part, segmented more finely in some views than in others.
//!
//! Two segments of one view share nothing, so they count against a union of their groups: touching segments of one
//! material remain two as long as most views separate them, and one view that merged them does not join them.
//!
//! The material of a 3D part is the one that most of its views' answers name, each weighted by how much of the part the
//! view sees.

use rayon::prelude::*;

use super::AnsweredPart;
use super::answered_segments::AnsweredSegments;
use super::ballots::{Ballot, Ballots};
use super::plurality::{Tally, add, winner};
use crate::query::Answer;

/// Overlap above which two groups are one 3D part. Above one half, a segment has at most one partner in another view,
/// because that view's segments are disjoint; so this is the lowest threshold that leaves no choice.
pub(super) const SAME_PART_OVERLAP: f64 = 0.5;

/// The 3D part of every view's segment.
pub(super) struct Identity<'a> {
    /// Numbered in the order of their first view's segment.
    pub part_of_segment: Vec<u32>,
    /// The material of each 3D part: index into [`AnsweredSegments::materials`].
    pub material_of_part: Vec<u32>,
    /// The answers about each 3D part with their weights, the heaviest first.
    pub answers_of_part: Vec<Vec<(&'a Answer, f64)>>,
    /// Per view's segment: the light of the Gaussians in it, in [`LIGHT_STEPS`] per pixel (or vote).
    pub seen: Vec<u64>,
}

impl<'a> Identity<'a> {
    /// Finds out which segments are one part.
    pub fn new(ballots: &Ballots, segments: &AnsweredSegments<'a>) -> Self {
        let view_of: Vec<usize> = segments.segments.iter().map(|segment| segment.view).collect();
        let shared = Shared::of(ballots, &view_of);
        let seen: Vec<u64> = (0..view_of.len()).map(|p| shared.get(p, p)).collect();
        let mut groups = Groups::new(&shared, &view_of);
        groups.join_while(jaccard, |_, _| true);
        let materials = materials(&groups.group, segments, &seen);
        groups.join_while(containment, |a, b| materials[a] == materials[b]);

        let mut firsts = groups.alive;
        firsts.sort_unstable();
        let number = |of: &usize| firsts.binary_search(of).expect("every group is alive") as u32;
        let part_of_segment: Vec<u32> = groups.group.iter().map(number).collect();
        let mut answers_of_part = vec![Vec::new(); firsts.len()];
        for ((segment, &part), &seen) in segments.segments.iter().zip(&part_of_segment).zip(&seen) {
            answers_of_part[part as usize].push((segment.answer, seen as f64));
        }
        answers_of_part.iter_mut().for_each(|answers| answers.sort_by(|a, b| b.1.total_cmp(&a.1)));
        let material_of_part = firsts.iter().map(|&first| materials[first]).collect();
        Self { part_of_segment, material_of_part, answers_of_part, seen }
    }

    /// Takes the parts as they are: ids are the same in all views. `parts` is not empty.
    pub fn of_parts(ballots: &Ballots, segments: &AnsweredSegments<'a>, parts: &[AnsweredPart<'a>]) -> Self {
        let number = |id: u16| parts.iter().position(|part| part.id == id).expect("segments are those of parts") as u32;
        let mut seen = vec![0.0f64; segments.segments.len()];
        for i in 0..ballots.gaussians() {
            ballots.of(i).iter().for_each(|ballot| seen[ballot.segment as usize] += f64::from(ballot.weight));
        }
        let material = |part: &AnsweredPart| {
            let mut tally: Tally = Vec::new();
            for (answer, weight) in &part.answers {
                add(&mut tally, segments.material(&answer.material), *weight, answer.confidence);
            }
            winner(&tally).map_or(0, |(material, _)| material)
        };
        Self {
            part_of_segment: segments.segments.iter().map(|segment| number(segment.segment)).collect(),
            material_of_part: parts.iter().map(material).collect(),
            answers_of_part: parts.iter().map(|part| part.answers.clone()).collect(),
            seen: seen.into_iter().map(|seen| (seen * f64::from(LIGHT_STEPS)) as u64).collect(),
        }
    }

    /// The share of the weight of a part's answers that name this material, 0 to 1.
    pub fn agreement(&self, part: u32, material: &str) -> f64 {
        let answers = &self.answers_of_part[part as usize];
        let of_material = answers.iter().filter(|(answer, _)| answer.material == material);
        let agreeing: f64 = of_material.map(|(_, weight)| weight).sum();
        let all: f64 = answers.iter().map(|(_, weight)| weight).sum();
        if all > 0.0 { agreeing / all } else { 1.0 }
    }
}

/// The material of each group, indexed by the group's name.
fn materials(group: &[usize], segments: &AnsweredSegments, seen: &[u64]) -> Vec<u32> {
    let mut tallies: Vec<Tally> = vec![Vec::new(); group.len()];
    for (n, segment) in segments.segments.iter().enumerate() {
        add(&mut tallies[group[n]], segment.material, seen[n] as f64, segment.answer.confidence);
    }
    tallies.iter().map(|tally| winner(tally).map_or(0, |(material, _)| material)).collect()
}

/// Light is counted in whole steps, so that sums do not depend on their order.
const LIGHT_STEPS: f32 = 256.0;

/// Light of the Gaussians that are in segment `a` in one view and in segment `b` in another, the smaller of the two; on
/// the diagonal, of those that are in `a`.
struct Shared {
    segments: usize,
    light: Vec<u64>,
}

impl Shared {
    fn of(ballots: &Ballots, view_of: &[usize]) -> Self {
        /// Number of Gaussians counted together: large enough that their table is small in comparison.
        const RUN: usize = 1 << 17;
        let segments = view_of.len();
        let runs = ballots.gaussians().div_ceil(RUN);
        let tables = (0..runs).into_par_iter().map(|run| {
            let mut light = vec![0u64; segments * segments];
            let mut carried = Vec::new();
            for i in run * RUN..ballots.gaussians().min((run + 1) * RUN) {
                main_segments(ballots.of(i), view_of, &mut carried);
                for a in &carried {
                    for b in &carried {
                        let steps = (a.weight.min(b.weight) * LIGHT_STEPS) as u64;
                        light[a.segment as usize * segments + b.segment as usize] += steps;
                    }
                }
            }
            light
        });
        let sum = |mut sum: Vec<u64>, other: Vec<u64>| {
            sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
            sum
        };
        Self { segments, light: tables.reduce(|| vec![0; segments * segments], sum) }
    }

    fn get(&self, a: usize, b: usize) -> u64 {
        self.light[a * self.segments + b]
    }
}

/// For every view that votes on a Gaussian, the segment with most of its votes; among equals, the first.
fn main_segments(ballots: &[Ballot], view_of: &[usize], main: &mut Vec<Ballot>) {
    main.clear();
    let same_view = |a: &Ballot, b: &Ballot| view_of[a.segment as usize] == view_of[b.segment as usize];
    for of_view in ballots.chunk_by(same_view) {
        main.extend(of_view.iter().reduce(|best, next| if next.weight > best.weight { next } else { best }));
    }
}

/// The light in both groups over the light in either: from `both`, and from the light of each group that the other's
/// views vote on.
fn jaccard(both: f64, of_a: f64, of_b: f64) -> f64 {
    both / (of_a + of_b - both)
}

/// The light in both groups over that in the smaller of the two.
fn containment(both: f64, of_a: f64, of_b: f64) -> f64 {
    both / of_a.min(of_b)
}

/// Groups of segments while they are being joined; a group is named by its first segment.
struct Groups {
    /// `both[a * segments + b]`: light that is in a segment of `a` in one view and in a segment of `b` in another.
    both: Vec<f64>,
    /// `visible[a * segments + b]`: light of `a` that the views of `b` vote on, for whatever segment.
    visible: Vec<f64>,
    /// The group of every segment.
    group: Vec<usize>,
    alive: Vec<usize>,
}

impl Groups {
    fn new(shared: &Shared, view_of: &[usize]) -> Self {
        let segments = view_of.len();
        let views = view_of.iter().max().map_or(0, |last| last + 1);
        let mut voted_on = vec![0u64; segments * views];
        for a in 0..segments {
            for b in 0..segments {
                voted_on[a * views + view_of[b]] += shared.get(a, b);
            }
        }
        let pairs = || (0..segments).flat_map(|a| (0..segments).map(move |b| (a, b)));
        let both = |(a, b): (usize, usize)| if view_of[a] == view_of[b] { 0 } else { shared.get(a, b) };
        Self {
            both: pairs().map(|pair| both(pair) as f64).collect(),
            visible: pairs().map(|(a, b)| voted_on[a * views + view_of[b]] as f64).collect(),
            group: (0..segments).collect(),
            alive: (0..segments).collect(),
        }
    }

    /// Joins the pair of groups with the largest overlap (among equals, the first) while it exceeds the threshold.
    fn join_while(&mut self, overlap: fn(f64, f64, f64) -> f64, may_join: impl Fn(usize, usize) -> bool) {
        while let Some((a, b)) = self.best_pair(overlap, &may_join) {
            self.join(a, b);
        }
    }

    fn best_pair(
        &self,
        overlap: fn(f64, f64, f64) -> f64,
        may_join: &impl Fn(usize, usize) -> bool,
    ) -> Option<(usize, usize)> {
        let segments = self.group.len();
        let mut best = (SAME_PART_OVERLAP, None);
        for (n, &a) in self.alive.iter().enumerate() {
            for &b in self.alive[n + 1..].iter().filter(|&&b| may_join(a, b)) {
                let (ab, ba) = (a * segments + b, b * segments + a);
                // Without common Gaussians this is 0 / 0, which is NaN and exceeds nothing.
                let overlap = overlap(self.both[ab], self.visible[ab], self.visible[ba]);
                if overlap > best.0 {
                    best = (overlap, Some((a, b)));
                }
            }
        }
        best.1
    }

    fn join(&mut self, a: usize, b: usize) {
        let segments = self.group.len();
        self.alive.retain(|&group| group != b);
        for &c in self.alive.iter().filter(|&&c| c != a) {
            for table in [&mut self.both, &mut self.visible] {
                table[a * segments + c] += table[b * segments + c];
                table[c * segments + a] += table[c * segments + b];
            }
        }
        for group in self.group.iter_mut().filter(|group| **group == b) {
            *group = a;
        }
    }
}
