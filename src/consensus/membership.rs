//! The light of every Gaussian in each segment of one view.

use super::SegmentedView;
use crate::render::{Projected, RenderOptions, contributions};

/// A view sees a Gaussian that has more light than this in it, in pixels. It counts for a pair if it sees both.
pub(super) const SEEN_LIGHT: f32 = 0.3;

/// The light of one Gaussian in one segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Share {
    /// The smallest segment; 0 for pixels without one.
    pub segment: u16,
    /// Pixels of light.
    pub light: f32,
}

/// The Gaussians that one view sees.
pub(super) struct Membership {
    /// Gaussian `i` has `shares[starts[i]..starts[i + 1]]`, by segment.
    starts: Vec<usize>,
    shares: Vec<Share>,
}

impl Membership {
    /// That of the first `count` Gaussians of the view's cloud, which are the object's.
    pub fn new(count: usize, view: &SegmentedView) -> Self {
        let projected = Projected::new(view.cloud, view.camera, &RenderOptions::default());
        let mut found = contributions(view.cloud.len(), projected, &view.segments.map.labels, Some);
        found.truncate(found.partition_point(|(gaussian, ..)| (*gaussian as usize) < count));
        let mut starts = vec![0; count + 1];
        found.iter().for_each(|(gaussian, ..)| starts[*gaussian as usize + 1] += 1);
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        Self { starts, shares: found.into_iter().map(|(_, segment, light)| Share { segment, light }).collect() }
    }

    pub fn of(&self, i: usize) -> &[Share] {
        &self.shares[self.starts[i]..self.starts[i + 1]]
    }

    /// The light of every Gaussian in the view, in pixels.
    pub fn light(&self) -> impl Iterator<Item = f32> {
        (0..self.starts.len() - 1).map(|i| self.of(i).iter().map(|share| share.light).sum())
    }
}
