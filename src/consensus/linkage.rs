//! Average linkage on a graph: groups are joined across the weakest border first, and a border's strength is a mean
//! over all pairs that cross it.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::ops::AddAssign;

use super::PRIOR_PAIRS;
use crate::numeric::forest::Forest;

/// Stands for no group.
pub(super) const NONE: u32 = u32::MAX;

/// Sums over the pairs that cross the border of two groups.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Border {
    /// Sum of the shares of membership that views split, and of the views' weights.
    pub split: f64,
    pub weight: f64,
    /// The weight without that of the agreement of under-segmented views.
    pub trusted: f64,
    /// Sum of the angles between normals over pairs that are far enough apart, and their number.
    pub angle_deg: f64,
    pub angles: u32,
    /// Number of those pairs with a plane at either end, and of those whose planes agree.
    pub planes: u32,
    pub smooth: u32,
    /// Number of pairs of nearest neighbours: without any, the groups lie a few Gaussians apart.
    pub near: u32,
}

impl Border {
    /// The mean share of a pair's membership that a view splits, 0 to 1.
    pub fn split(&self) -> f64 {
        self.split / self.weight
    }

    /// As [`Self::split`], without the agreement of under-segmented views.
    pub fn trusted_split(&self) -> f64 {
        if self.split > 0.0 { self.split / self.trusted } else { 0.0 }
    }

    /// The share of its pairs that lie on one smooth surface, 0 to 1.
    pub fn smooth_share(&self) -> f64 {
        f64::from(self.smooth) / (f64::from(self.planes) + PRIOR_PAIRS)
    }
}

impl AddAssign for Border {
    fn add_assign(&mut self, other: Self) {
        self.split += other.split;
        self.weight += other.weight;
        self.trusted += other.trusted;
        self.angle_deg += other.angle_deg;
        self.angles += other.angles;
        self.planes += other.planes;
        self.smooth += other.smooth;
        self.near += other.near;
    }
}

/// A border that may be the weakest.
#[derive(Debug, PartialEq)]
struct Weakest {
    strength: f64,
    a: u32,
    b: u32,
}

impl Eq for Weakest {}

impl Ord for Weakest {
    /// The weakest is the greatest; among equals, the one with the lowest numbers.
    fn cmp(&self, other: &Self) -> Ordering {
        other.strength.total_cmp(&self.strength).then((other.a, other.b).cmp(&(self.a, self.b)))
    }
}

impl PartialOrd for Weakest {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Joins nodes `0..nodes` while the strength of the weakest border is at most `limit`. Groups without a border are not
/// joined. Returns the group of every node, named by one of its nodes.
pub(super) fn link(
    nodes: usize,
    borders: &[(u32, u32, Border)],
    limit: f64,
    strength: impl Fn(&Border) -> f64,
) -> Vec<u32> {
    let mut group: Vec<u32> = (0..nodes as u32).collect();
    let mut around: Vec<BTreeMap<u32, Border>> = vec![BTreeMap::new(); nodes];
    let mut heap = BinaryHeap::new();
    let push = |heap: &mut BinaryHeap<Weakest>, a: u32, b: u32, border: &Border| {
        let weakest = Weakest { strength: strength(border), a: a.min(b), b: a.max(b) };
        heap.extend((weakest.strength <= limit).then_some(weakest));
    };
    for &(a, b, border) in borders {
        push(&mut heap, a, b, &border);
        around[a as usize].insert(b, border);
        around[b as usize].insert(a, border);
    }
    while let Some(Weakest { strength: joined_at, a, b }) = heap.pop() {
        // The border may have changed since it was listed, or one of the groups may be gone.
        let now = around[a as usize].get(&b).map(&strength);
        if now != Some(joined_at) {
            continue;
        }
        let (into, from) = if around[a as usize].len() >= around[b as usize].len() { (a, b) } else { (b, a) };
        group[from as usize] = into;
        for (other, border) in std::mem::take(&mut around[from as usize]) {
            around[other as usize].remove(&from);
            if other == into {
                continue;
            }
            let sum = around[into as usize].entry(other).or_default();
            *sum += border;
            let sum = *sum;
            around[other as usize].insert(into, sum);
            push(&mut heap, into, other, &sum);
        }
    }
    roots(group)
}

/// Replaces the group of every node by the group that it finally ended up in.
fn roots(mut group: Vec<u32>) -> Vec<u32> {
    for n in 0..group.len() {
        let mut root = n as u32;
        while group[root as usize] != root {
            root = group[root as usize];
        }
        let mut at = n as u32;
        while group[at as usize] != root {
            at = std::mem::replace(&mut group[at as usize], root);
        }
    }
    group
}

/// Joins nodes that touch and that views split by at most `limit`, however much views split other nodes of their
/// groups. Returns the group of every node, named by its first node.
pub(super) fn contract(nodes: usize, borders: impl Iterator<Item = (u32, u32, Border)>, limit: f64) -> Vec<u32> {
    let mut groups = Forest::of(nodes);
    for (a, b, _) in borders.filter(|(.., border)| border.near > 0 && border.split() <= limit) {
        groups.join(a as usize, b as usize, false);
    }
    (0..nodes).map(|node| groups.root(node).0 as u32).collect()
}

/// The borders between groups, from those between their members; members in no group are left out.
pub(super) fn between(
    group: &[u32],
    groups: usize,
    borders: impl Iterator<Item = (u32, u32, Border)>,
) -> Vec<(u32, u32, Border)> {
    let is_group = |group: u32| (group as usize) < groups;
    let mut sums: BTreeMap<(u32, u32), Border> = BTreeMap::new();
    for (a, b, border) in borders {
        let (a, b) = (group[a as usize], group[b as usize]);
        if a != b && is_group(a) && is_group(b) {
            *sums.entry((a.min(b), a.max(b))).or_default() += border;
        }
    }
    sums.into_iter().map(|((a, b), border)| (a, b, border)).collect()
}

/// Lets every group with less than `share` of all light join the neighbour from which views split it least, the
/// smallest first. One without neighbours is dissolved: its nodes get [`NONE`]. If no group is large enough, all become
/// one. `part` names the group of every node by one of its nodes, or is [`NONE`].
pub(super) fn absorb(part: Vec<u32>, borders: &[(u32, u32, Border)], light: &[f64], share: f64) -> Vec<u32> {
    let least = share * light.iter().sum::<f64>();
    let mut of_part = vec![0.0; part.len()];
    for (&part, &light) in part.iter().zip(light).filter(|(part, _)| **part != NONE) {
        of_part[part as usize] += light;
    }
    let mut around: Vec<BTreeMap<u32, Border>> = vec![BTreeMap::new(); part.len()];
    for (a, b, border) in between(&part, part.len(), borders.iter().copied()) {
        around[a as usize].insert(b, border);
        around[b as usize].insert(a, border);
    }
    let mut joined: Vec<u32> = (0..part.len() as u32).collect();
    let mut crumbs: Vec<usize> = (0..part.len()).filter(|&n| part[n] as usize == n && of_part[n] < least).collect();
    crumbs.sort_by(|&a, &b| of_part[a].total_cmp(&of_part[b]));
    for crumb in crumbs {
        let weaker = |a: &(&u32, &Border), b: &(&u32, &Border)| a.1.split().total_cmp(&b.1.split());
        let Some(into) = around[crumb].iter().min_by(weaker).map(|(&into, _)| into) else { continue };
        if of_part[crumb] >= least {
            continue;
        }
        joined[crumb] = into;
        of_part[into as usize] += of_part[crumb];
        for (other, border) in std::mem::take(&mut around[crumb]) {
            around[other as usize].remove(&(crumb as u32));
            if other != into {
                *around[into as usize].entry(other).or_default() += border;
                *around[other as usize].entry(into).or_default() += border;
            }
        }
    }
    let joined = roots(joined);
    let group = |&part: &u32| joined.get(part as usize).copied();
    let is_large = |group: u32| of_part[group as usize] >= least;
    let any_large = part.iter().filter_map(group).any(is_large);
    let first = part.iter().find_map(group);
    let kept = |group: u32| if any_large { is_large(group).then_some(group) } else { first };
    part.iter().map(|part| group(part).and_then(kept).unwrap_or(NONE)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn border(split: f64, near: u32) -> Border {
        Border { split, weight: 1.0, near, ..Border::default() }
    }

    fn groups(nodes: usize, borders: &[(u32, u32, Border)], limit: f64) -> Vec<u32> {
        link(nodes, borders, limit, Border::split)
    }

    #[test]
    fn a_chain_of_weak_borders_does_not_leak_through_a_strong_one() {
        // 0 and 1 are one group, 3 and 4 another. Node 2 lies between: half of it seems to belong to each.
        let near = [(0, 1, 0.0), (1, 2, 0.3), (2, 3, 0.35), (3, 4, 0.0)];
        let far = [(0, 2, 0.3), (1, 3, 1.0), (2, 4, 0.35), (0, 3, 1.0), (1, 4, 1.0)];
        let mut all: Vec<_> = near.iter().map(|&(a, b, split)| (a, b, border(split, 1))).collect();
        all.extend(far.iter().map(|&(a, b, split)| (a, b, border(split, 0))));
        let found = groups(5, &all, 0.5);
        assert_eq!(found[0], found[2], "the weaker side takes it");
        assert_eq!(found[3], found[4]);
        assert_ne!(found[0], found[3]);
    }

    #[test]
    fn what_no_view_splits_is_contracted() {
        let borders = [(1, 2, border(0.01, 1)), (2, 4, border(0.0, 1)), (0, 3, border(0.0, 0)), (3, 4, border(0.5, 1))];
        assert_eq!(contract(5, borders.into_iter(), 0.02), [0, 1, 1, 3, 1]);
    }

    #[test]
    fn groups_are_joined_only_across_a_border_that_is_weak() {
        assert_eq!(groups(2, &[], 0.5), [0, 1]);
        assert_eq!(groups(2, &[(0, 1, border(0.6, 1))], 0.5), [0, 1]);
        let joined = groups(2, &[(0, 1, border(0.5, 1))], 0.5);
        assert_eq!(joined[0], joined[1]);
    }

    #[test]
    fn crumbs_join_the_neighbour_that_is_split_from_them_least() {
        let borders = [(0, 1, border(0.9, 1)), (1, 2, border(0.4, 1)), (0, 3, border(0.9, 1))];
        let light = [1000.0, 1.0, 500.0, 800.0];
        assert_eq!(absorb(vec![0, 1, 2, 3], &borders, &light, 0.01), [0, 2, 2, 3]);
        assert_eq!(absorb(vec![0, 1, 2, 3], &borders, &light, 0.0), [0, 1, 2, 3]);
        assert_eq!(absorb(vec![0, 1], &[], &light[..2], 0.01), [0, NONE], "no neighbour to join");
        assert_eq!(absorb(vec![NONE, 1, 2, 3], &borders, &light, 0.01), [NONE, 2, 2, 3]);
        assert_eq!(absorb(vec![0], &[], &[0.0], 0.01), [0], "nothing else is there");
    }

    #[test]
    fn crumbs_alone_become_one_group() {
        let borders = [(1, 2, border(0.4, 1))];
        let found = absorb(vec![NONE, 1, 2, 3, 4], &borders, &[1.0; 5], 0.5);
        assert_eq!(found[0], NONE, "it was in no group before");
        assert!((1..5).contains(&found[1]) && found[2..].iter().all(|group| *group == found[1]), "{found:?}");
    }
}
