//! Views whose segments are merged with neighbours at random, as SAM merges them if it takes two things for one.

use std::collections::{BTreeMap, BTreeSet};

use fastrand::Rng;

use crate::segment::{LabelMap, Segment, ViewSegments};

/// Merges each segment with one of its neighbours in the picture with this probability.
///
/// The parent of a merged segment is the smallest other segment that holds everything it was made of.
pub fn merged(view: &ViewSegments, probability: f64, random: &mut Rng) -> ViewSegments {
    let count = view.segments.len();
    let mut group: Vec<usize> = (0..=count).collect();
    for (id, around) in neighbors(&view.map) {
        if random.f64() < probability {
            let other = around[random.usize(..around.len())];
            let (a, b) = (group[usize::from(id)], group[usize::from(other)]);
            group.iter_mut().filter(|group| **group == a).for_each(|group| *group = b);
        }
    }
    let members = |of: usize| (1..=count).filter(|&id| group[id] == of).collect::<Vec<_>>();
    let names: BTreeSet<usize> = group[1..].iter().copied().collect();
    // The segment that holds all of a group, and whether it is one of them: groups outside others come first.
    let placed = |name: usize| {
        let members = members(name);
        let top = members[1..].iter().fold(members[0], |top, &id| common(view, top, id));
        (ancestors(view, top).len(), usize::from(!members.contains(&top)), members[0], top)
    };
    let mut order: Vec<((usize, usize, usize, usize), usize)> =
        names.iter().map(|&name| (placed(name), name)).collect();
    order.sort_unstable();
    let new_id: BTreeMap<usize, u16> = order.iter().map(|&(_, name)| name).zip(1..).collect();
    let id_of = |id: u16| if id == 0 { 0 } else { new_id[&group[usize::from(id)]] };
    let map = LabelMap { labels: view.map.labels.iter().map(|&id| id_of(id)).collect(), ..view.map };
    let segments = order.iter().map(|&((_, _, first, top), name)| {
        let outside = ancestors(view, top).into_iter().find(|&id| group[id] != name).unwrap_or(0);
        Segment { id: new_id[&name], parent: id_of(outside as u16), ..view.segments[first - 1].clone() }
    });
    let mut found = ViewSegments { view: view.view.clone(), segments: segments.collect(), map };
    measure(&mut found);
    found
}

/// By id, the ids of the segments that touch it.
fn neighbors(map: &LabelMap) -> BTreeMap<u16, Vec<u16>> {
    let mut around: BTreeMap<u16, BTreeSet<u16>> = BTreeMap::new();
    let mut touch = |a: u16, b: u16| {
        if a != b && a > 0 && b > 0 {
            around.entry(a).or_default().insert(b);
            around.entry(b).or_default().insert(a);
        }
    };
    for y in 0..map.height {
        for x in 0..map.width {
            if x + 1 < map.width {
                touch(map.at(x, y), map.at(x + 1, y));
            }
            if y + 1 < map.height {
                touch(map.at(x, y), map.at(x, y + 1));
            }
        }
    }
    around.into_iter().map(|(id, others)| (id, others.into_iter().collect())).collect()
}

/// A segment and those that it lies in, from inside out.
fn ancestors(view: &ViewSegments, id: usize) -> Vec<usize> {
    let outer = |&id: &usize| Some(usize::from(view.parent(id as u16))).filter(|&parent| parent > 0);
    std::iter::successors(Some(id).filter(|&id| id > 0), outer).collect()
}

/// The smallest segment that holds both; 0 if there is none.
fn common(view: &ViewSegments, a: usize, b: usize) -> usize {
    let of_a = ancestors(view, a);
    ancestors(view, b).into_iter().find(|id| of_a.contains(id)).unwrap_or(0)
}

/// Areas and boxes, each with the segments inside.
fn measure(view: &mut ViewSegments) {
    let mut around = vec![(0u32, [u32::MAX, u32::MAX, 0, 0]); view.segments.len() + 1];
    for y in 0..view.map.height {
        for x in 0..view.map.width {
            for id in ancestors(view, usize::from(view.map.at(x, y))) {
                let (area, [x0, y0, x1, y1]) = &mut around[id];
                *area += 1;
                (*x0, *y0, *x1, *y1) = ((*x0).min(x), (*y0).min(y), (*x1).max(x + 1), (*y1).max(y + 1));
            }
        }
    }
    for (segment, (area, [x0, y0, x1, y1])) in view.segments.iter_mut().zip(&around[1..]) {
        segment.area = *area;
        segment.bbox = [*x0, *y0, x1 - x0, y1 - y0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::Level;

    /// 1 holds 2 and 3, 3 holds 4; 5 stands beside them: a row of pixels 1 1 2 3 4 5 5 0.
    fn row() -> ViewSegments {
        let segment = |(id, parent)| Segment {
            id,
            area: 0,
            bbox: [0; 4],
            predicted_iou: 0.9,
            stability_score: 0.9,
            level: Level::Middle,
            parent,
        };
        let segments = [(1, 0), (2, 1), (3, 1), (4, 3), (5, 0)].into_iter().map(segment).collect();
        let map = LabelMap { width: 8, height: 1, labels: vec![1, 1, 2, 3, 4, 5, 5, 0] };
        let mut row = ViewSegments { view: "a".to_owned(), map, segments };
        measure(&mut row);
        row
    }

    #[test]
    fn nothing_is_merged_at_probability_0() {
        // Only the numbers may change: around each pixel, segments of the same areas lie in each other.
        let nested = |view: &ViewSegments| -> Vec<Vec<u32>> {
            let areas =
                |&id: &u16| ancestors(view, usize::from(id)).into_iter().map(|id| view.segments[id - 1].area).collect();
            view.map.labels.iter().map(areas).collect()
        };
        assert_eq!(nested(&merged(&row(), 0.0, &mut Rng::with_seed(1))), nested(&row()));
    }

    #[test]
    fn merged_segments_are_a_tree_over_the_same_pixels() {
        for seed in 0..200 {
            let view = merged(&row(), 0.5, &mut Rng::with_seed(seed));
            let ids: BTreeSet<u16> = view.segments.iter().map(|segment| segment.id).collect();
            assert_eq!(ids, (1..=view.segments.len() as u16).collect());
            for segment in &view.segments {
                assert!(segment.parent < segment.id, "{view:?}");
                assert!(segment.area > 0, "{view:?}");
            }
            let covered = |view: &ViewSegments| view.map.labels.iter().map(|&id| id > 0).collect::<Vec<_>>();
            assert_eq!(covered(&view), covered(&row()));
            // Pixels that were in one segment still are.
            assert_eq!(view.map.labels[0], view.map.labels[1]);
            assert_eq!(view.map.labels[5], view.map.labels[6]);
        }
        let all = merged(&row(), 1.0, &mut Rng::with_seed(7));
        assert!(all.segments.len() <= 2, "each has joined another: {all:?}");
    }
}
