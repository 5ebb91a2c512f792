//! Segments that hold more than one thing: most of the other views split them.
//!
//! The test is that of MaskClustering (Yan et al., CVPR 2024, section 3.3), on a tree of segments instead of a flat map:
//! a view does not split a region if any of its segments holds it, however finely the view divides that segment. So
//! details that one view shows and another does not are no sign of under-segmentation.

use rayon::prelude::*;

use super::membership::{Membership, SEEN_LIGHT};
use crate::segment::ViewSegments;

/// A view judges a region if it sees at least this share of the region's light (MaskClustering's visibility threshold).
const SEEN_SHARE: f32 = 0.3;
/// A view holds a region if one of its segments has at least this share of what it sees of the region (MaskClustering's
/// containment threshold).
const HELD_SHARE: f32 = 0.8;
/// A region is under-segmented if more than this share of the views that judge it split it: the majority.
const SPLIT_SHARE: f64 = 0.5;

/// The regions of one view: what each Gaussian belongs to, by the smallest segment that has most of its light.
pub(super) struct Regions {
    /// By Gaussian; 0 for none.
    segment: Vec<u16>,
    /// By Gaussian, in pixels.
    pub light: Vec<f32>,
    /// By segment.
    is_undersegmented: Vec<bool>,
}

impl Regions {
    pub fn new(membership: &Membership, segments: &ViewSegments) -> Self {
        let light: Vec<f32> = membership.light().collect();
        let main =
            |i| membership.of(i).iter().max_by(|a, b| a.light.total_cmp(&b.light)).map_or(0, |most| most.segment);
        let segment = (0..light.len()).map(main).collect();
        Self { segment, light, is_undersegmented: vec![false; segments.segments.len() + 1] }
    }

    /// True if both Gaussians lie in one region that most other views split: the view cannot tell whether they belong
    /// together.
    pub fn is_undersegmented_at(&self, a: u32, b: u32) -> bool {
        let [a, b] = [a, b].map(|i| self.segment[i as usize]);
        a == b && self.is_undersegmented[usize::from(a)]
    }

    fn sees(&self, i: usize) -> bool {
        self.light[i] > SEEN_LIGHT
    }

    /// By region, its light in this view that `seen` is true for.
    fn light_of(&self, seen: impl Fn(usize) -> bool) -> Vec<f32> {
        let mut light = vec![0.0; self.is_undersegmented.len()];
        for i in (0..self.light.len()).filter(|&i| self.sees(i) && seen(i)) {
            light[usize::from(self.segment[i])] += self.light[i];
        }
        light
    }

    /// By region, whether `other` splits it; `None` if `other` does not see enough of it.
    fn split_by(&self, other: &Self, segments: &ViewSegments, all: &[f32]) -> Vec<Option<bool>> {
        let seen = self.light_of(|i| other.sees(i));
        let count = other.is_undersegmented.len();
        // The light of each region in each of the other view's segments.
        let mut shared = vec![0.0f32; self.is_undersegmented.len() * count];
        for i in (0..self.light.len()).filter(|&i| self.sees(i) && other.sees(i)) {
            shared[usize::from(self.segment[i]) * count + usize::from(other.segment[i])] += self.light[i];
        }
        let judged = |(of, (&seen, &all)): (&mut [f32], (&f32, &f32))| {
            // A segment's parent has a lower number, so that each is complete when its turn comes.
            for segment in (1..count).rev() {
                let parent = usize::from(segments.parent(segment as u16));
                if parent > 0 {
                    of[parent] += of[segment];
                }
            }
            let most = of.iter().copied().fold(0.0, f32::max);
            (seen > 0.0 && seen >= SEEN_SHARE * all).then_some(most < HELD_SHARE * seen)
        };
        shared.chunks_mut(count).zip(seen.iter().zip(all)).map(judged).collect()
    }
}

/// Marks the regions that most other views split. `segments` are those of the same views.
pub(super) fn mark(views: &mut [Regions], segments: &[&ViewSegments]) {
    let of_view = |n: usize| {
        let regions = &views[n];
        let all = regions.light_of(|_| true);
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
    let marks: Vec<Vec<bool>> = (0..views.len()).into_par_iter().map(of_view).collect();
    views.iter_mut().zip(marks).for_each(|(regions, marks)| regions.is_undersegmented = marks);
}
