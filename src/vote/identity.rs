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

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::ops::Range;

use super::AnsweredPart;
use super::answered_subjects::AnsweredSubjects;
use super::ballots::{Ballot, Ballots};
use super::plurality::{Tally, add, winner};
use crate::parallel;
use crate::query::Answer;

/// Overlap above which two groups are one 3D part. Above one half, a segment has at most one partner in another view,
/// because that view's segments are disjoint; so this is the lowest threshold that leaves no choice.
pub(super) const SAME_PART_OVERLAP: f64 = 0.5;

/// The 3D part of every view's segment.
pub(super) struct Identity<'a> {
    /// Numbered in the order of their first view's segment.
    pub part_of_segment: Vec<u32>,
    /// The ids of the 3D parts, if the parts were known before the vote.
    pub ids: Option<Vec<u32>>,
    /// The material of each 3D part: index into [`AnsweredSubjects::materials`].
    pub material_of_part: Vec<u32>,
    /// The answers about each 3D part with their weights, the heaviest first.
    pub answers_of_part: Vec<Vec<(&'a Answer, f64)>>,
    /// Per view's segment: the light of the Gaussians in it, in [`LIGHT_STEPS`] per pixel (or vote).
    pub seen: Vec<u64>,
}

impl<'a> Identity<'a> {
    /// Finds out which segments are one part.
    pub fn new(ballots: &Ballots, subjects: &AnsweredSubjects<'a>) -> Self {
        let view_of: Vec<usize> = subjects.subjects.iter().map(|segment| segment.view).collect();
        let shared = shared_light(ballots, &view_of);
        let seen: Vec<u64> =
            shared.iter().enumerate().map(|(own, light)| light.get(&own).copied().unwrap_or(0)).collect();
        let mut groups = Groups::new(shared, &view_of);
        groups.join_while(jaccard, |_, _| true);
        let materials = materials(&groups.group, subjects, &seen);
        groups.join_while(containment, |a, b| materials[a] == materials[b]);

        let firsts: Vec<usize> = (0..view_of.len()).filter(|&n| groups.group[n] == n).collect();
        let number = |of: &usize| firsts.binary_search(of).expect("every group is alive") as u32;
        let part_of_segment: Vec<u32> = groups.group.iter().map(number).collect();
        let mut answers_of_part = vec![Vec::new(); firsts.len()];
        for ((segment, &part), &seen) in subjects.subjects.iter().zip(&part_of_segment).zip(&seen) {
            answers_of_part[part as usize].push((segment.answer, seen as f64));
        }
        answers_of_part.iter_mut().for_each(|answers| answers.sort_by(|a, b| b.1.total_cmp(&a.1)));
        let material_of_part = firsts.iter().map(|&first| materials[first]).collect();
        Self { part_of_segment, ids: None, material_of_part, answers_of_part, seen }
    }

    /// Takes the parts as they are: ids are the same in all views. `parts` is not empty.
    pub fn of_parts(ballots: &Ballots, subjects: &AnsweredSubjects<'a>, parts: &[AnsweredPart<'a>]) -> Self {
        let number = |id: u16| parts.iter().position(|part| part.id == id).expect("segments are those of parts") as u32;
        let mut seen = vec![0.0f64; subjects.subjects.len()];
        for i in 0..ballots.gaussians() {
            ballots.of(i).iter().for_each(|ballot| seen[ballot.segment as usize] += f64::from(ballot.weight));
        }
        let material = |part: &AnsweredPart| {
            let mut tally: Tally = Vec::new();
            for (answer, weight) in &part.answers {
                add(&mut tally, subjects.material(&answer.material), *weight, answer.confidence);
            }
            winner(&tally).map_or(0, |(material, _)| material)
        };
        Self {
            part_of_segment: subjects.subjects.iter().map(|subject| number(subject.id)).collect(),
            ids: Some(parts.iter().map(|part| u32::from(part.id)).collect()),
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
fn materials(group: &[usize], subjects: &AnsweredSubjects, seen: &[u64]) -> Vec<u32> {
    let mut tallies: Vec<Tally> = vec![Vec::new(); group.len()];
    for (n, segment) in subjects.subjects.iter().enumerate() {
        add(&mut tallies[group[n]], segment.material, seen[n] as f64, segment.answer.confidence);
    }
    tallies.iter().map(|tally| winner(tally).map_or(0, |(material, _)| material)).collect()
}

/// Light is counted in whole steps, so that sums do not depend on their order.
const LIGHT_STEPS: f32 = 256.0;

/// For every segment, the segments with which it shares Gaussians: the light of those that are in it in its view and in the
/// other in the other's view, the smaller of the two; with itself, its own light.
type Shared = Vec<BTreeMap<usize, u64>>;

/// Counts the shared light for each view by itself, so that there is never a table of all pairs of segments, of which most
/// share nothing.
fn shared_light(ballots: &Ballots, view_of: &[usize]) -> Shared {
    let segments = view_of.len();
    let of_view = |own: &Range<usize>| -> Shared {
        let mut light = vec![0u64; own.len() * segments];
        let mut carried = Vec::new();
        for i in 0..ballots.gaussians() {
            let ballots = ballots.of(i);
            // Ballots are sorted by view, and so are segments.
            let first = ballots.partition_point(|ballot| (ballot.segment as usize) < own.start);
            if ballots.get(first).is_none_or(|ballot| ballot.segment as usize >= own.end) {
                continue;
            }
            main_segments(ballots, view_of, &mut carried);
            let of_own = |ballot: &&Ballot| own.contains(&(ballot.segment as usize));
            let a = carried.iter().find(of_own).expect("one of the view's ballots is the main one");
            let row = &mut light[(a.segment as usize - own.start) * segments..][..segments];
            for b in &carried {
                row[b.segment as usize] += (a.weight.min(b.weight) * LIGHT_STEPS) as u64;
            }
        }
        let rows = light.chunks_exact(segments);
        rows.map(|row| row.iter().copied().enumerate().filter(|(_, light)| *light > 0).collect()).collect()
    };
    let of_views: Vec<Shared> = parallel::map(&segments_of_views(view_of), of_view);
    of_views.into_iter().flatten().collect()
}

/// The segments of each view that has any. Segments are sorted by view.
fn segments_of_views(view_of: &[usize]) -> Vec<Range<usize>> {
    let mut next = 0;
    let range = |of_view: &[usize]| {
        let first = next;
        next += of_view.len();
        first..next
    };
    view_of.chunk_by(|a, b| a == b).map(range).collect()
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

/// Groups of segments while they are being joined; a group is named by its first segment. Only pairs of groups that share light
/// are listed, as no others can be joined.
struct Groups {
    /// Of each group, the groups with which it shares light: light that is in a segment of one in one view and in a segment of
    /// the other in another.
    both: Vec<BTreeMap<usize, u64>>,
    /// `voted_on[a * views + v]`: light of `a` that view `v` votes on, for whatever segment.
    voted_on: Vec<u64>,
    views: usize,
    /// Of each group, the view of each of its segments.
    views_of: Vec<Vec<usize>>,
    /// The group of every segment.
    group: Vec<usize>,
}

/// Two groups that may be joined.
#[derive(Debug, PartialEq)]
struct Pair {
    overlap: f64,
    a: usize,
    b: usize,
}

impl Eq for Pair {}

impl Ord for Pair {
    /// The greatest is the pair with the largest overlap; among equals, the first.
    fn cmp(&self, other: &Self) -> Ordering {
        self.overlap.total_cmp(&other.overlap).then((other.a, other.b).cmp(&(self.a, self.b)))
    }
}

impl PartialOrd for Pair {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Groups {
    fn new(mut shared: Shared, view_of: &[usize]) -> Self {
        let views = view_of.iter().max().map_or(0, |last| last + 1);
        let mut voted_on = vec![0; view_of.len() * views];
        for (a, with) in shared.iter_mut().enumerate() {
            with.iter().for_each(|(b, light)| voted_on[a * views + view_of[*b]] += light);
            with.remove(&a);
        }
        let views_of = view_of.iter().map(|&view| vec![view]).collect();
        Self { both: shared, voted_on, views, views_of, group: (0..view_of.len()).collect() }
    }

    /// Joins the pair of groups with the largest overlap (among equals, the first) while it exceeds the threshold.
    fn join_while(&mut self, overlap: fn(f64, f64, f64) -> f64, may_join: impl Fn(usize, usize) -> bool) {
        let pair = |groups: &Self, a: usize, b: usize| {
            let (a, b) = (a.min(b), a.max(b));
            let both = *groups.both[a].get(&b)?;
            let overlap = overlap(both as f64, groups.visible(a, b), groups.visible(b, a));
            (overlap > SAME_PART_OVERLAP && may_join(a, b)).then_some(Pair { overlap, a, b })
        };
        let mut heap = BinaryHeap::new();
        for (a, with) in self.both.iter().enumerate() {
            heap.extend(with.range(a + 1..).filter_map(|(&b, _)| pair(self, a, b)));
        }
        while let Some(best) = heap.pop() {
            // The overlap may have changed since the pair was listed, or one of the groups may be gone.
            if pair(self, best.a, best.b).as_ref() != Some(&best) {
                continue;
            }
            self.join(best.a, best.b);
            heap.extend(self.both[best.a].keys().filter_map(|&other| pair(self, best.a, other)));
        }
    }

    /// Light of `a` that the views of `b` vote on, for whatever segment, as often as `b` has segments in them.
    fn visible(&self, a: usize, b: usize) -> f64 {
        let of_views = &self.voted_on[a * self.views..][..self.views];
        self.views_of[b].iter().map(|&view| of_views[view]).sum::<u64>() as f64
    }

    fn join(&mut self, a: usize, b: usize) {
        for (c, light) in std::mem::take(&mut self.both[b]) {
            self.both[c].remove(&b);
            if c != a {
                *self.both[a].entry(c).or_default() += light;
                *self.both[c].entry(a).or_default() += light;
            }
        }
        for view in 0..self.views {
            self.voted_on[a * self.views + view] += self.voted_on[b * self.views + view];
        }
        let joined = std::mem::take(&mut self.views_of[b]);
        self.views_of[a].extend(joined);
        for group in self.group.iter_mut().filter(|group| **group == b) {
            *group = a;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Overlap = fn(f64, f64, f64) -> f64;
    type MayJoin = fn(usize, usize) -> bool;

    /// Joins groups as [`Groups`] does, but with tables of all pairs, every one of which it compares for each join.
    fn joined_by_tables(
        shared: &[BTreeMap<usize, u64>],
        view_of: &[usize],
        overlap: Overlap,
        may_join: MayJoin,
    ) -> Vec<usize> {
        let all = 0..view_of.len();
        let light = |a: usize, b: usize| shared[a].get(&b).copied().unwrap_or(0) as f64;
        let in_view =
            |a: usize, view: usize| all.clone().filter(|&b| view_of[b] == view).map(|b| light(a, b)).sum::<f64>();
        let table = |value: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            all.clone().map(|a| all.clone().map(|b| value(a, b)).collect()).collect()
        };
        let mut both = table(&|a, b| if view_of[a] == view_of[b] { 0.0 } else { light(a, b) });
        let mut visible = table(&|a, b| in_view(a, view_of[b]));
        let (mut group, mut alive): (Vec<usize>, Vec<usize>) = (all.clone().collect(), all.clone().collect());
        loop {
            let mut best = (SAME_PART_OVERLAP, None);
            for (n, &a) in alive.iter().enumerate() {
                for &b in alive[n + 1..].iter().filter(|&&b| may_join(a, b)) {
                    let overlap = overlap(both[a][b], visible[a][b], visible[b][a]);
                    if overlap > best.0 {
                        best = (overlap, Some((a, b)));
                    }
                }
            }
            let Some((a, b)) = best.1 else { return group };
            alive.retain(|&group| group != b);
            for &c in alive.iter().filter(|&&c| c != a) {
                for table in [&mut both, &mut visible] {
                    table[a][c] += table[b][c];
                    table[c][a] += table[c][b];
                }
            }
            group.iter_mut().filter(|group| **group == b).for_each(|group| *group = a);
        }
    }

    /// Six views of up to five segments, 300 Gaussians: each is in one of five parts, of which each view shows most as a
    /// segment, and puts some Gaussians into another. Small weights, so that overlaps are often equal.
    fn made_up(seed: u64) -> (Ballots, Vec<usize>) {
        let mut random = fastrand::Rng::with_seed(seed);
        let view_of: Vec<usize> = (0..6).flat_map(|view| [view; 5]).collect();
        let mut of_views = vec![Vec::new(); 6];
        for gaussian in 0..300 {
            let part = random.u32(0..5);
            for (view, ballots) in (0..).zip(&mut of_views) {
                if random.u32(0..3) > 0 {
                    let shown = if random.u32(0..6) == 0 { random.u32(0..5) } else { part };
                    let weight = f32::from(random.u8(0..3));
                    ballots.push((gaussian, Ballot { segment: 5 * view + shown, weight }));
                }
            }
        }
        (Ballots::sorted(300, of_views), view_of)
    }

    #[test]
    fn groups_are_those_that_comparing_all_pairs_finds() {
        let rules: [(Overlap, MayJoin); 2] = [(jaccard, |_, _| true), (containment, |a, b| a % 2 == b % 2)];
        let mut joined = 0;
        for seed in 0..50 {
            let (ballots, view_of) = made_up(seed);
            let shared = shared_light(&ballots, &view_of);
            for (overlap, may_join) in rules {
                let mut groups = Groups::new(shared.clone(), &view_of);
                groups.join_while(overlap, may_join);
                assert_eq!(groups.group, joined_by_tables(&shared, &view_of, overlap, may_join), "seed {seed}");
                joined += groups.group.iter().enumerate().filter(|(n, group)| n != *group).count();
            }
        }
        assert!(joined > 100, "most of them join segments: {joined}");
    }

    #[test]
    fn segments_share_the_lesser_light_of_two_views() {
        let ballot = |segment, weight| Ballot { segment, weight };
        // View 0 has segments 0 and 1, view 1 has segment 2. View 0 puts most of Gaussian 0 into segment 1.
        let first = vec![(0, ballot(0, 0.25)), (0, ballot(1, 0.5)), (1, ballot(0, 1.0))];
        let second = vec![(0, ballot(2, 0.25)), (2, ballot(2, 2.0))];
        let shared = shared_light(&Ballots::sorted(3, vec![first, second]), &[0, 0, 1]);
        let expected: [Vec<(usize, u64)>; 3] = [vec![(0, 256)], vec![(1, 128), (2, 64)], vec![(1, 64), (2, 64 + 512)]];
        assert_eq!(shared, expected.map(BTreeMap::from_iter));
    }
}
