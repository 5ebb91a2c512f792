//! Segments that hold more than one thing: most of the other views split them.
//!
//! The test is that of MaskClustering (Yan et al., CVPR 2024, section 3.3), on a tree of segments instead of a flat map:
//! a view does not split a region if any of its segments holds it, however finely the view divides that segment. So
//! details that one view shows and another does not are no sign of under-segmentation.

use std::collections::BTreeMap;

use super::membership::{Membership, SEEN_LIGHT, Share};
use crate::parallel;
use crate::segment::ViewSegments;

/// A view judges a region if its segments show at least this share of the region's light (MaskClustering's visibility
/// threshold).
const SEEN_SHARE: f32 = 0.3;
/// A view holds a region if one of its segments has at least this share of what all of them show of the region
/// (MaskClustering's containment threshold).
const HELD_SHARE: f32 = 0.8;
/// A region is under-segmented if more than this share of the views that judge it split it: the majority.
const SPLIT_SHARE: f64 = 0.5;

/// The regions of one view: what each Gaussian belongs to, by the smallest segment that has most of its light.
pub(super) struct Regions {
    /// The Gaussians that the view sees, in order.
    seen: Vec<Seen>,
    /// By segment.
    is_undersegmented: Vec<bool>,
}

/// A Gaussian that a view sees.
struct Seen {
    gaussian: u32,
    /// 0 for none.
    segment: u16,
    /// In pixels.
    light: f32,
}

impl Regions {
    pub fn new(membership: &Membership, segments: &ViewSegments) -> Self {
        let seen = (0..)
            .zip(membership.light())
            .filter(|(_, light)| *light > SEEN_LIGHT)
            .map(|(gaussian, light)| Seen { gaussian, segment: main_segment(membership.of(gaussian as usize)), light });
        Self { seen: seen.collect(), is_undersegmented: vec![false; segments.segments.len() + 1] }
    }

    /// True if two Gaussians with these shares of light lie in one region that most other views split: the view cannot
    /// tell whether they belong together.
    pub fn is_undersegmented_at(&self, a: &[Share], b: &[Share]) -> bool {
        let [a, b] = [a, b].map(main_segment);
        a == b && self.is_undersegmented[usize::from(a)]
    }

    /// By region, its light in this view.
    fn light(&self) -> Vec<f32> {
        let mut light = vec![0.0; self.is_undersegmented.len()];
        self.seen.iter().for_each(|seen| light[usize::from(seen.segment)] += seen.light);
        light
    }

    /// The Gaussians that both views see, as each sees them.
    fn also_seen_by<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = (&'a Seen, &'a Seen)> {
        let mut theirs = other.seen.iter().peekable();
        self.seen.iter().filter_map(move |own| {
            while theirs.next_if(|their| their.gaussian < own.gaussian).is_some() {}
            Some((own, theirs.next_if(|their| their.gaussian == own.gaussian)?))
        })
    }

    /// By region, whether `other` splits it; `None` if `other` does not see enough of it.
    fn split_by(&self, other: &Self, segments: &ViewSegments, all: &[f32]) -> Vec<Option<bool>> {
        // The light of each region that the other view sees too, in all and in each of the other view's segments. Few
        // regions and segments share light; imported maps may have tens of thousands of both.
        let mut seen = vec![0.0f32; self.is_undersegmented.len()];
        let mut shared: Vec<BTreeMap<u16, f32>> = vec![BTreeMap::new(); self.is_undersegmented.len()];
        for (own, their) in self.also_seen_by(other) {
            let region = usize::from(own.segment);
            seen[region] += own.light;
            *shared[region].entry(their.segment).or_default() += own.light;
        }
        let judged = |(mut of, (seen, &all)): (BTreeMap<u16, f32>, (f32, &f32))| {
            // Pixels without a segment neither hold nor split.
            let seen = (seen - of.remove(&0).unwrap_or(0.0)).max(0.0);
            let mut most = 0.0f32;
            // A segment's parent has a lower number, so that each is complete when its turn comes.
            while let Some((segment, light)) = of.pop_last() {
                most = most.max(light);
                let parent = segments.parent(segment);
                if parent > 0 {
                    *of.entry(parent).or_default() += light;
                }
            }
            (seen > 0.0 && seen >= SEEN_SHARE * all).then_some(most < HELD_SHARE * seen)
        };
        shared.into_iter().zip(seen.into_iter().zip(all)).map(judged).collect()
    }
}

/// The smallest segment that has most of a Gaussian's light; 0 for none.
fn main_segment(shares: &[Share]) -> u16 {
    shares.iter().max_by(|a, b| a.light.total_cmp(&b.light)).map_or(0, |most| most.segment)
}

/// Marks the regions that most other views split. `segments` are those of the same views.
pub(super) fn mark(views: &mut [Regions], segments: &[&ViewSegments]) {
    let of_view = |n: usize| {
        let regions = &views[n];
        let all = regions.light();
        let mut votes = vec![[0u32; 2]; regions.is_undersegmented.len()];
        for other in (0..views.len()).filter(|&other| other != n) {
            let judged = regions.split_by(&views[other], segments[other], &all);
            for ([split, judges], is_split) in votes.iter_mut().zip(judged).filter_map(|(v, j)| Some((v, j?))) {
                *split += u32::from(is_split);
                *judges += 1;
            }
        }
        // Pixels without a segment are not a region.
        let is_undersegmented = |(region, [split, judges]): (usize, [u32; 2])| {
            region > 0 && f64::from(split) > SPLIT_SHARE * f64::from(judges)
        };
        votes.into_iter().enumerate().map(is_undersegmented).collect()
    };
    let marks: Vec<Vec<bool>> = parallel::map_range(views.len(), of_view);
    views.iter_mut().zip(marks).for_each(|(regions, marks)| regions.is_undersegmented = marks);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::{LabelMap, Level, Segment};

    /// A view with `count` segments that sees Gaussians of equal light, each in one of these segments or in none.
    fn regions(count: u16, segments: &[u16]) -> Regions {
        let seen = (0..).zip(segments).map(|(gaussian, &segment)| Seen { gaussian, segment, light: 1.0 });
        Regions { seen: seen.collect(), is_undersegmented: vec![false; usize::from(count) + 1] }
    }

    /// Segments of which none lies in another.
    fn side_by_side(count: u16) -> ViewSegments {
        let segment = |id| Segment {
            id,
            area: 1,
            bbox: [0, 0, 1, 1],
            predicted_iou: 0.9,
            stability_score: 0.9,
            level: Level::Small,
            parent: 0,
        };
        let map = LabelMap { width: u32::from(count), height: 1, labels: (1..=count).collect() };
        ViewSegments { view: "view".into(), map, segments: (1..=count).map(segment).collect() }
    }

    #[test]
    fn pixels_without_a_segment_neither_hold_nor_split() {
        let (region, segments) = (regions(2, &[1; 10]), side_by_side(2));
        let all = region.light();
        let judged = |other: [u16; 10]| region.split_by(&regions(2, &other), &segments, &all)[1];
        assert_eq!(judged([1, 1, 1, 1, 0, 0, 0, 0, 0, 0]), Some(false), "one segment holds all that has a segment");
        assert_eq!(judged([1, 1, 2, 2, 0, 0, 0, 0, 0, 0]), Some(true), "either segment holds half of it");
        assert_eq!(judged([1, 1, 0, 0, 0, 0, 0, 0, 0, 0]), None, "only a fifth has a segment");
        assert_eq!(judged([0; 10]), None);
    }

    /// As many as a label map can hold. For each of the 90 pairs of views, a table of all segments of one by all of the
    /// other would take 17 GB.
    #[test]
    fn views_with_65_535_segments_are_compared_in_little_memory() {
        let segments = side_by_side(u16::MAX);
        let mut views = vec![regions(u16::MAX, &[u16::MAX; 10])];
        views.extend((1..10).map(|_| regions(u16::MAX, &[1, 1, 1, 1, 1, 2, 2, 2, 2, 2])));
        mark(&mut views, &[&segments; 10]);
        let marked = |view: usize| (0..=u16::MAX).zip(&views[view].is_undersegmented).filter(|(_, marked)| **marked);
        assert!(marked(0).map(|(region, _)| region).eq([u16::MAX]), "all others split it");
        assert!((1..10).all(|view| marked(view).next().is_none()));
    }
}
