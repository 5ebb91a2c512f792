//! How well the parts found in 3D match true ones, in views that were not used to find them; and how well the segments
//! of each segmented view match them in that view.

use std::collections::{BTreeMap, BTreeSet};

use image::GrayImage;
use serde::Serialize;

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::render::{RenderOptions, render_labels};
use crate::segment::LabelMap;
use crate::words::output::{counted, one_line};

/// Value in a true part map for pixels without a part.
pub const NO_PART: u8 = 255;
/// A found part shows a true one if at least this share of the found part's pixels on true parts lies on that one.
const SHOWN_SHARE: f64 = 0.1;

/// A view with the true part of each of its pixels.
pub struct TrueView {
    pub name: String,
    pub camera: Camera,
    /// [`NO_PART`] for pixels without a part.
    pub parts: GrayImage,
    /// True if the parts were found with the help of this view.
    pub segmented: bool,
}

/// How well the parts of one scene match.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartsEvaluation {
    pub scene: String,
    /// Number of views that were compared.
    pub views: usize,
    /// Number of parts found.
    pub parts: usize,
    /// Mean over the true parts of [`TruePart::iou`]; `None` if there are none.
    pub mean_iou: Option<f64>,
    /// Mean number of true parts that a found part shows.
    pub true_parts_per_part: Option<f64>,
    /// By the value in the true part maps.
    pub true_parts: BTreeMap<u8, TruePart>,
    /// The segments of the segmented views, each view by itself; `None` if none of them has a true map.
    pub segments: Option<SegmentsEvaluation>,
}

/// How well the smallest segments of single views match the true parts that the same view shows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SegmentsEvaluation {
    pub views: usize,
    /// Mean number of segments of a view.
    pub segments: f64,
    /// Mean over the true parts of [`TruePart::iou`].
    pub mean_iou: Option<f64>,
    /// Mean number of true parts that a segment shows.
    pub true_parts_per_segment: Option<f64>,
    /// By the value in the true part maps. For each part, the pixels of all views are counted together; the best segment
    /// and the number of found parts are means over the views that show it.
    pub true_parts: BTreeMap<u8, TruePart>,
}

/// One true part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TruePart {
    /// Share of the object's pixels.
    pub share: f64,
    /// IoU of all found parts together that show more of this true part than of any other.
    pub iou: f64,
    /// IoU of the best single found part.
    pub best_iou: f64,
    /// Number of found parts that show more of it than of any other.
    pub found_parts: f64,
}

/// Pixels by what they show: found part, then true part.
#[derive(Default)]
struct Pixels {
    both: BTreeMap<(Option<u32>, Option<u8>), u64>,
}

impl Pixels {
    fn add(&mut self, gaussians: &Gaussians, label_of_gaussian: &[u32], view: &TrueView) {
        let found = render_labels(gaussians, &view.camera, label_of_gaussian, &RenderOptions::default());
        self.count_all(found, &view.parts);
    }

    fn count_all(&mut self, found: impl IntoIterator<Item = Option<u32>>, parts: &GrayImage) {
        for (found, truth) in found.into_iter().zip(parts.as_raw()) {
            *self.both.entry((found, (*truth != NO_PART).then_some(*truth))).or_default() += 1;
        }
    }

    /// The true parts, sorted.
    fn values(&self) -> BTreeSet<u8> {
        self.both.keys().filter_map(|(_, truth)| *truth).collect()
    }

    fn share(&self, value: u8) -> f64 {
        self.count(|_, truth| truth == Some(value)) as f64 / self.count(|_, truth| truth.is_some()) as f64
    }

    /// The largest IoU of one of `found`.
    fn best_iou(&self, value: u8, found: impl Iterator<Item = u32>) -> f64 {
        found.map(|found| self.iou(value, |other| other == found)).fold(0.0, f64::max)
    }

    /// The mean number of true parts that each of `found` shows; `None` if none shows any.
    fn shown_by_each(&self, found: impl Iterator<Item = u32>) -> Option<f64> {
        let shown: Vec<usize> = found.filter_map(|found| self.shown_by(found)).collect();
        mean(shown.iter().sum::<usize>() as f64, shown.len())
    }

    /// The number of true parts that a found part shows; `None` if it lies on none.
    fn shown_by(&self, found: u32) -> Option<usize> {
        let all = self.count(|of, truth| of == Some(found) && truth.is_some()) as f64;
        let shows =
            |value: &u8| self.count(|of, truth| of == Some(found) && truth == Some(*value)) as f64 >= SHOWN_SHARE * all;
        (all > 0.0).then(|| self.values().iter().filter(|value| shows(value)).count())
    }

    fn count(&self, holds: impl Fn(Option<u32>, Option<u8>) -> bool) -> u64 {
        self.both.iter().filter(|((found, truth), _)| holds(*found, *truth)).map(|(_, pixels)| pixels).sum()
    }

    /// The true part that each found part shows most of; among equals, the one with the lower value.
    fn most_shown(&self) -> BTreeMap<u32, u8> {
        let mut most: BTreeMap<u32, (u64, u8)> = BTreeMap::new();
        for (key, &pixels) in &self.both {
            let (Some(found), Some(truth)) = *key else { continue };
            let best = most.entry(found).or_insert((pixels, truth));
            if pixels > best.0 {
                *best = (pixels, truth);
            }
        }
        most.into_iter().map(|(found, (_, truth))| (found, truth)).collect()
    }

    fn iou(&self, truth: u8, is_found: impl Fn(u32) -> bool) -> f64 {
        let of_found = |found: Option<u32>| found.is_some_and(&is_found);
        let both = self.count(|found, of| of == Some(truth) && of_found(found));
        let either = self.count(|found, of| of == Some(truth) || of_found(found));
        both as f64 / either as f64
    }
}

/// Compares the parts with the true ones in the views that were not segmented. The views that were segmented decide
/// which true part a found part counts as; if none of them has a true map, the compared views themselves do.
pub fn compare(scene: &str, gaussians: &Gaussians, part_of_gaussian: &[u16], views: &[TrueView]) -> PartsEvaluation {
    let (mut known, mut compared) = (Pixels::default(), Pixels::default());
    let labels = widened(part_of_gaussian);
    for view in views {
        if view.segmented { &mut known } else { &mut compared }.add(gaussians, &labels, view);
    }
    let counts_as = if known.both.is_empty() { compared.most_shown() } else { known.most_shown() };
    let of_value = |&value: &u8| {
        let found_parts: Vec<u32> = counts_as.iter().filter(|(_, of)| **of == value).map(|(&found, _)| found).collect();
        let scored = TruePart {
            share: compared.share(value),
            iou: compared.iou(value, |found| found_parts.contains(&found)),
            best_iou: compared.best_iou(value, counts_as.keys().copied()),
            found_parts: found_parts.len() as f64,
        };
        (value, scored)
    };
    let true_parts: BTreeMap<u8, TruePart> = compared.values().iter().map(of_value).collect();
    PartsEvaluation {
        scene: scene.to_owned(),
        views: views.iter().filter(|view| !view.segmented).count(),
        parts: part_of_gaussian.iter().collect::<BTreeSet<_>>().len(),
        mean_iou: mean_of_ious(&true_parts),
        true_parts_per_part: compared.shown_by_each(counts_as.keys().copied()),
        true_parts,
        segments: None,
    }
}

/// Compares the label maps of single views with their true maps. A segment counts as the true part that it mostly shows.
pub fn compare_segments(views: &[(&LabelMap, &GrayImage)]) -> Option<SegmentsEvaluation> {
    let (mut all, mut count, mut shown) = (Pixels::default(), 0, Vec::new());
    let mut of_part: BTreeMap<u8, (f64, f64, usize)> = BTreeMap::new();
    for (map, truth) in views {
        let mut own = Pixels::default();
        own.count_all(map.labels.iter().map(|&id| (id > 0).then_some(u32::from(id))), truth);
        let counts_as = own.most_shown();
        all.count_all(map.labels.iter().map(|&id| counts_as.get(&u32::from(id)).map(|&of| u32::from(of))), truth);
        count += map.labels.iter().filter(|id| **id > 0).collect::<BTreeSet<_>>().len();
        shown.extend(counts_as.keys().filter_map(|&segment| own.shown_by(segment)));
        for value in own.values() {
            let (best, found_parts, views) = of_part.entry(value).or_default();
            *best += own.best_iou(value, counts_as.keys().copied());
            *found_parts += counts_as.values().filter(|of| **of == value).count() as f64;
            *views += 1;
        }
    }
    let of_value = |(&value, &(best, found_parts, views)): (&u8, &(f64, f64, usize))| {
        let scored = TruePart {
            share: all.share(value),
            iou: all.iou(value, |found| found == u32::from(value)),
            best_iou: best / views as f64,
            found_parts: found_parts / views as f64,
        };
        (value, scored)
    };
    let true_parts: BTreeMap<u8, TruePart> = of_part.iter().map(of_value).collect();
    (!views.is_empty()).then(|| SegmentsEvaluation {
        views: views.len(),
        segments: count as f64 / views.len() as f64,
        mean_iou: mean_of_ious(&true_parts),
        true_parts_per_segment: mean(shown.iter().sum::<usize>() as f64, shown.len()),
        true_parts,
    })
}

/// By label of the Gaussians, the true part that it mostly shows in the views.
pub fn most_shown(gaussians: &Gaussians, label_of_gaussian: &[u32], views: &[TrueView]) -> BTreeMap<u32, u8> {
    let mut pixels = Pixels::default();
    views.iter().for_each(|view| pixels.add(gaussians, label_of_gaussian, view));
    pixels.most_shown()
}

/// By true part, the IoU of the Gaussians labelled as this part: `label_of_gaussian` is the true part plus 1, or 0 for
/// none.
pub(super) fn label_ious(gaussians: &Gaussians, label_of_gaussian: &[u16], views: &[TrueView]) -> BTreeMap<u8, f64> {
    let mut pixels = Pixels::default();
    let labels = widened(label_of_gaussian);
    views.iter().for_each(|view| pixels.add(gaussians, &labels, view));
    let iou = |value| (value, pixels.iou(value, |found| found == u32::from(value) + 1));
    pixels.values().into_iter().map(iou).collect()
}

fn widened(labels: &[u16]) -> Vec<u32> {
    labels.iter().map(|&label| u32::from(label)).collect()
}

fn mean(sum: f64, count: usize) -> Option<f64> {
    (count > 0).then(|| sum / count as f64)
}

fn mean_of_ious(true_parts: &BTreeMap<u8, TruePart>) -> Option<f64> {
    mean(true_parts.values().map(|part| part.iou).sum(), true_parts.len())
}

impl PartsEvaluation {
    /// A table for people.
    pub fn text(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        let mut text = format!(
            "{}: {} found, mean IoU {} in {} other views, {} true parts per found part\n",
            one_line(&self.scene),
            counted(self.parts, "part"),
            number(self.mean_iou),
            self.views,
            number(self.true_parts_per_part)
        );
        text += &table(&self.true_parts);
        if let Some(SegmentsEvaluation { views, segments, mean_iou, true_parts_per_segment, true_parts }) =
            &self.segments
        {
            text += &format!(
                "the {views} segmented views, each by itself: {segments:.1} segments, mean IoU {}, {} true parts per \
                 segment\n",
                number(*mean_iou),
                number(*true_parts_per_segment)
            );
            text += &table(true_parts);
        }
        text
    }
}

fn table(true_parts: &BTreeMap<u8, TruePart>) -> String {
    let mut text = format!("{:>10} {:>10} {:>8} {:>10} {:>8}\n", "true part", "share", "IoU", "best IoU", "parts");
    for (value, TruePart { share, iou, best_iou, found_parts }) in true_parts {
        text += &format!("{value:>10} {:>8.2} % {iou:>8.3} {best_iou:>10.3} {found_parts:>8.1}\n", 100.0 * share);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segments_count_as_the_part_they_cover_most_of() {
        // Segments 1 and 2 lie on part 0; segment 3 lies on two pixels of part 7 and one of part 0; one pixel of part 7
        // has no segment.
        let map = LabelMap { width: 4, height: 2, labels: vec![1, 1, 2, 3, 3, 3, 0, 0] };
        let truth = GrayImage::from_raw(4, 2, vec![0, 0, 0, 0, 7, 7, 7, NO_PART]).unwrap();
        let found = compare_segments(&[(&map, &truth)]).unwrap();
        let ious: Vec<(u8, f64)> = found.true_parts.iter().map(|(&value, part)| (value, part.iou)).collect();
        assert_eq!(ious, [(0, 3.0 / 4.0), (7, 2.0 / 4.0)]);
        // Segment 3 shows both parts.
        assert_eq!((found.segments, found.true_parts_per_segment), (3.0, Some(4.0 / 3.0)));
    }
}
