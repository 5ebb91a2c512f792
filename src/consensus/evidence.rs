//! The evidence from the views that the two Gaussians of a pair belong to different parts.

use std::collections::BTreeMap;

use super::linkage::Border;
use super::membership::{Membership, SEEN_LIGHT, Share};
use super::neighbors::Pairs;
use super::normals::Normals;
use super::structure;
use super::undersegmentation::Regions;
use crate::parallel;
use crate::scene::Origin;
use crate::segment::ViewSegments;

/// The evidence from all views about each pair.
pub(super) struct Evidence {
    sums: Vec<Sums>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// Sum over the views that see both: the difference in membership times the view's weight.
    split: f32,
    weight: f32,
    /// The weight without that of under-segmented views' agreement.
    trusted: f32,
}

impl Evidence {
    pub fn new(pairs: &Pairs) -> Self {
        Self { sums: vec![Sums::default(); pairs.pairs.len()] }
    }

    /// Adds one view. Its weight is the square root of the light of the fainter Gaussian of the pair.
    pub fn add(&mut self, pairs: &Pairs, membership: &Membership, segments: &ViewSegments, regions: &Regions) {
        parallel::for_each_mut(&mut self.sums, |pair, sums| {
            let (a, b) = pairs.pairs[pair];
            let (a, b) = (membership.of(a as usize), membership.of(b as usize));
            let (of_a, of_b) = (light(a), light(b));
            let light = of_a.min(of_b);
            if light > SEEN_LIGHT {
                let split = light.sqrt() * difference(a, of_a, b, of_b, segments);
                sums.split += split;
                sums.weight += light.sqrt();
                sums.trusted += if regions.is_undersegmented_at(a, b) { split } else { light.sqrt() };
            }
        });
    }

    /// Adds what the file of a mesh says, as that of a view would be; `light` is the mean light of a Gaussian in the views that
    /// see it. Pairs that no view sees are left out.
    pub fn add_structure(&mut self, pairs: &Pairs, origins: &[Origin], light: impl Fn(usize) -> f32 + Sync) {
        if origins.is_empty() {
            return;
        }
        parallel::for_each_mut(&mut self.sums, |pair, sums| {
            let (a, b) = pairs.pairs[pair];
            let (a, b) = (a as usize, b as usize);
            if sums.weight > 0.0 && structure::tells_apart(origins[a], origins[b]) {
                // Never more than that share of what the views say: alone, it parts nothing.
                let weight = structure::VIEWS * light(a).min(light(b)).sqrt().min(sums.weight);
                sums.split += weight * structure::SPLIT;
                sums.weight += weight;
                sums.trusted += weight;
            }
        });
    }

    /// Every pair as the border of its two Gaussians; pairs that no view sees are left out.
    pub fn borders(&self, pairs: &Pairs, normals: &Normals) -> impl Iterator<Item = (u32, u32, Border)> {
        let border = |((&(a, b), &is_far), sums): ((&(u32, u32), &bool), &Sums)| {
            let angle_deg = if is_far { f64::from(normals.angle_deg(a, b)) } else { 0.0 };
            let border = Border {
                split: f64::from(sums.split),
                weight: f64::from(sums.weight),
                trusted: f64::from(sums.trusted),
                angle_deg,
                angles: u32::from(is_far),
                near: u32::from(!is_far),
                ..Border::default()
            };
            (sums.weight > 0.0).then_some((a, b, border))
        };
        pairs.pairs.iter().zip(&pairs.is_far).zip(&self.sums).filter_map(border)
    }
}

fn light(shares: &[Share]) -> f32 {
    shares.iter().map(|share| share.light).sum()
}

/// The largest difference, over all segments of the view, between the shares of light that the two have in it.
fn difference(a: &[Share], of_a: f32, b: &[Share], of_b: f32, segments: &ViewSegments) -> f32 {
    if let ([a], [b]) = (a, b)
        && a.segment == b.segment
    {
        return 0.0;
    }
    // Differences by segment; a segment's parent has a lower number, so that each is complete when its turn comes.
    let mut open: BTreeMap<u16, f32> = BTreeMap::new();
    a.iter().for_each(|share| *open.entry(share.segment).or_default() += share.light / of_a);
    b.iter().for_each(|share| *open.entry(share.segment).or_default() -= share.light / of_b);
    let mut largest = 0.0f32;
    while let Some((segment, value)) = open.pop_last().filter(|(segment, _)| *segment != 0) {
        largest = largest.max(value.abs());
        *open.entry(segments.parent(segment)).or_default() += value;
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::{LabelMap, Level, Segment};

    #[test]
    fn what_the_file_tells_apart_counts_as_a_third_of_a_view() {
        let pairs = Pairs { pairs: vec![(0, 1), (0, 2), (1, 2)], is_far: vec![false; 3] };
        let seen = Sums { split: 0.0, weight: 2.0, trusted: 2.0 };
        let mut evidence = Evidence { sums: vec![seen, Sums::default(), seen] };
        let origin = |look| Origin { look, shape: 0, surface: 0 };
        evidence.add_structure(&pairs, &[origin(0), origin(1), origin(1)], |_| 4.0);
        let [apart, unseen, alike] = evidence.sums.try_into().unwrap();
        let split = f64::from(apart.split / apart.weight);
        assert!((split - 0.6 * 0.56 / 2.6).abs() < 1e-6 && apart.trusted == apart.weight, "{apart:?}");
        assert_eq!([unseen.weight, alike.weight, alike.split], [0.0, 2.0, 0.0]);
    }

    /// A Gaussian that is as large as the picture, in a map that a user brought with as many segments as a map can hold,
    /// each within the last.
    #[test]
    fn two_gaussians_in_65_535_nested_segments_are_compared() {
        let segment = |id| Segment {
            id,
            area: 1,
            bbox: [0, 0, 1, 1],
            predicted_iou: 0.9,
            stability_score: 0.9,
            level: Level::Small,
            parent: id - 1,
        };
        let map = LabelMap { width: u32::from(u16::MAX), height: 1, labels: (1..=u16::MAX).collect() };
        let segments = ViewSegments { view: "view".into(), map, segments: (1..=u16::MAX).map(segment).collect() };
        let shares =
            |from: u16| -> Vec<Share> { (from..=u16::MAX).map(|segment| Share { segment, light: 1.0 }).collect() };
        let (all, deep) = (shares(1), shares(1 << 15));
        assert_eq!(difference(&all, light(&all), &all, light(&all), &segments), 0.0);
        // All of one Gaussian and half of the other lie in the segment in the middle; f32 rounds 65,535 sums.
        let found = difference(&all, light(&all), &deep, light(&deep), &segments);
        assert!((found - 0.5).abs() < 0.01, "{found}");
    }
}
