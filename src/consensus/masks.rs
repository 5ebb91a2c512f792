//! The parts in one view: which pixels show which, and whether the view's segments agree.

use std::collections::BTreeMap;

use super::{Parts, SegmentedView};
use crate::render::{RenderOptions, render_labels};
use crate::segment::LabelMap;

/// If at least this share of a segment's pixels shows one part, the part takes over the segment's border.
const SNAP_SHARE: f64 = 0.6;
/// Another part in that segment stays there only if more than this share of it lies in the segment; otherwise it is a
/// fringe that the Gaussians' softness left.
const FRINGE_SHARE: f64 = 0.25;
/// Pixels of a part that touch each other, but are fewer than this share of all its pixels in the view, are a speck.
const SPECK_SHARE: f64 = 0.02;
/// A segment with at least this IoU shows the part.
const SHOWS_IOU: f64 = 0.5;

/// The parts in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct PartMasks {
    /// The id of each pixel's piece, or of its part if that has no pieces; 0 if it shows none.
    pub map: LabelMap,
    /// By id - 1: the view's largest IoU of one of its segments with the part; `None` if it does not see the part.
    pub agreement: Vec<Option<f64>>,
}

/// Draws the parts by the Gaussians' contributions and moves their borders to those of the view's segments.
///
/// Which pixels show a part does not depend on its pieces.
pub fn part_masks(parts: &Parts, view: &SegmentedView) -> PartMasks {
    let drawn = drawn(parts, view);
    let agreement = agreement(parts, view, &shared_pixels(&drawn, view));
    let part_of = |&id: &u16| if id == 0 { 0 } else { parts.part_of(id) };
    let whole = LabelMap { labels: drawn.labels.iter().map(part_of).collect(), ..drawn };
    let (whole, mut map) = (cleaned(&whole, view), cleaned(&drawn, view));
    let largest = largest_pieces(parts, &drawn);
    for ((id, drawn), whole) in map.labels.iter_mut().zip(&drawn.labels).zip(&whole.labels) {
        if part_of(id) != *whole {
            *id = if part_of(drawn) == *whole { *drawn } else { largest.get(whole).copied().unwrap_or(*whole) };
        }
    }
    PartMasks { map, agreement }
}

/// The map with its borders moved to those of the view's segments, without specks.
fn cleaned(map: &LabelMap, view: &SegmentedView) -> LabelMap {
    let shared = shared_pixels(map, view);
    let last = map.labels.iter().copied().max().unwrap_or(0);
    let mut of_id = vec![0u64; usize::from(last) + 1];
    shared.iter().for_each(|(&(_, id), &pixels)| of_id[usize::from(id)] += pixels);
    let snapped = snapped(&shared, &of_id);
    let mut moved = map.clone();
    for (id, segment) in moved.labels.iter_mut().zip(&view.segments.map.labels).filter(|(id, _)| **id > 0) {
        *id = snapped.get(&(*segment, *id)).copied().unwrap_or(*id);
    }
    without_specks(&moved)
}

/// By part, the piece of which the view shows most; the part itself if it has no pieces.
fn largest_pieces(parts: &Parts, map: &LabelMap) -> BTreeMap<u16, u16> {
    let mut of_id: BTreeMap<u16, u64> = BTreeMap::new();
    map.labels.iter().filter(|id| **id > 0).for_each(|&id| *of_id.entry(id).or_default() += 1);
    let mut largest: BTreeMap<u16, (u64, u16)> = BTreeMap::new();
    for (id, pixels) in of_id {
        let most = largest.entry(parts.part_of(id)).or_insert((pixels, id));
        if pixels > most.0 {
            *most = (pixels, id);
        }
    }
    largest.into_iter().map(|(part, (_, id))| (part, id)).collect()
}

impl PartMasks {
    /// True if one of the view's segments shows the part; `None` if the view does not see it.
    pub fn backs(&self, id: u16) -> Option<bool> {
        self.agreement[usize::from(id) - 1].map(|iou| iou >= SHOWS_IOU)
    }
}

fn drawn(parts: &Parts, view: &SegmentedView) -> LabelMap {
    let camera = view.camera;
    let mut ids: Vec<u32> = parts.id_of_gaussian.iter().map(|&id| u32::from(id)).collect();
    // No part for the surroundings.
    ids.resize(view.cloud.len(), 0);
    let pixels = render_labels(view.cloud, camera, &ids, &RenderOptions::default());
    let labels = pixels.into_iter().map(|id| id.map_or(0, |id| id as u16)).collect();
    LabelMap { width: camera.intrinsics.width, height: camera.intrinsics.height, labels }
}

/// The number of pixels of each smallest segment (0: none) that show each id.
fn shared_pixels(map: &LabelMap, view: &SegmentedView) -> BTreeMap<(u16, u16), u64> {
    let mut shared = BTreeMap::new();
    for (&id, &segment) in map.labels.iter().zip(&view.segments.map.labels).filter(|(id, _)| **id > 0) {
        *shared.entry((segment, id)).or_default() += 1;
    }
    shared
}

/// The id that pixels of a segment take in place of the one drawn there.
fn snapped(shared: &BTreeMap<(u16, u16), u64>, of_id: &[u64]) -> BTreeMap<(u16, u16), u16> {
    let mut main: BTreeMap<u16, (u64, u16, u64)> = BTreeMap::new();
    for (&(segment, id), &pixels) in shared {
        let (all, most, of_most) = main.entry(segment).or_default();
        *all += pixels;
        if pixels > *of_most {
            (*most, *of_most) = (id, pixels);
        }
    }
    let moves = |(&(segment, id), &pixels): (&(u16, u16), &u64)| {
        let (all, most, of_most) = main[&segment];
        let fills = segment > 0 && of_most as f64 >= SNAP_SHARE * all as f64;
        let is_fringe = pixels as f64 <= FRINGE_SHARE * of_id[usize::from(id)] as f64;
        (fills && id != most && is_fringe).then_some(((segment, id), most))
    };
    shared.iter().filter_map(moves).collect()
}

/// The map in which specks have the label that most of the pixels around them have; among equals, the lowest.
fn without_specks(map: &LabelMap) -> LabelMap {
    let mut of_id: BTreeMap<u16, usize> = BTreeMap::new();
    map.labels.iter().for_each(|&id| *of_id.entry(id).or_default() += 1);
    let mut cleaned = map.clone();
    let mut visited = vec![false; map.labels.len()];
    for start in 0..map.labels.len() {
        let id = map.labels[start];
        if id == 0 || visited[start] {
            continue;
        }
        let (mut patch, mut next) = (vec![start], 0);
        let mut around: BTreeMap<u16, usize> = BTreeMap::new();
        visited[start] = true;
        while let Some(&at) = patch.get(next) {
            next += 1;
            for other in map.beside(at) {
                if map.labels[other] != id {
                    *around.entry(map.labels[other]).or_default() += 1;
                } else if !visited[other] {
                    visited[other] = true;
                    patch.push(other);
                }
            }
        }
        if (patch.len() as f64) < SPECK_SHARE * of_id[&id] as f64
            && let Some((&label, _)) = around.iter().rev().max_by_key(|(_, count)| **count)
        {
            patch.iter().for_each(|&at| cleaned.labels[at] = label);
        }
    }
    cleaned
}

/// By id - 1: the largest IoU of a segment, whether or not others lie in it, with the part's pixels.
fn agreement(parts: &Parts, view: &SegmentedView, shared: &BTreeMap<(u16, u16), u64>) -> Vec<Option<f64>> {
    // Pixels of a segment include those of the segments in it, and pixels of a part those of its pieces.
    let mut both: BTreeMap<(u16, u16), u64> = BTreeMap::new();
    let mut of_id = vec![0u64; parts.parts.len() + 1];
    let mut of_segment: BTreeMap<u16, u64> = BTreeMap::new();
    for (&(smallest, id), &pixels) in shared {
        let part = parts.part_of(id);
        let ids = [Some(id), (part != id).then_some(part)];
        ids.iter().flatten().for_each(|&id| of_id[usize::from(id)] += pixels);
        let mut segment = smallest;
        while segment > 0 {
            *of_segment.entry(segment).or_default() += pixels;
            ids.iter().flatten().for_each(|&id| *both.entry((segment, id)).or_default() += pixels);
            segment = view.segments.parent(segment);
        }
    }
    let mut best: Vec<Option<f64>> = of_id[1..].iter().map(|&pixels| (pixels > 0).then_some(0.0)).collect();
    for (&(segment, id), &pixels) in &both {
        let iou = pixels as f64 / (of_segment[&segment] + of_id[usize::from(id)] - pixels) as f64;
        let best = &mut best[usize::from(id) - 1];
        *best = best.map(|best| best.max(iou));
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fringe_goes_to_the_part_that_fills_the_segment() {
        // Part 1 fills segment 5 but for a fringe of part 2, most of which lies elsewhere; part 3 lies in it whole.
        let shared = BTreeMap::from([((5, 1), 80), ((5, 2), 8), ((5, 3), 12), ((6, 2), 100), ((0, 2), 1)]);
        let moved = snapped(&shared, &[0, 80, 109, 12]);
        assert_eq!(moved, BTreeMap::from([((5, 2), 1)]));
        // Without a part that fills most of it, a segment says nothing about borders.
        let shared = BTreeMap::from([((5, 1), 50), ((5, 2), 40), ((6, 2), 400)]);
        assert!(snapped(&shared, &[0, 50, 440]).is_empty());
    }

    #[test]
    fn specks_take_the_label_around_them() {
        let mut map = LabelMap { width: 40, height: 20, labels: vec![1; 800] };
        for y in 0..20 {
            map.labels[y * 40..y * 40 + 15].fill(2);
            map.labels[y * 40 + 38..y * 40 + 40].fill(0);
        }
        let clean = map.clone();
        map.labels[5 * 40 + 30] = 2;
        map.labels[9 * 40 + 3] = 1;
        assert_eq!(without_specks(&map), clean);
        // A part that is small in the view is not a speck: all of it is there.
        map = clean.clone();
        map.labels[5 * 40 + 30] = 3;
        assert_eq!(without_specks(&map), map);
    }
}
