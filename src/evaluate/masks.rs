//! Compares gprop's masks with those that a reference generator made from the same picture with the same settings.
//!
//! The reference is JSON: the generator's settings, and a list `all` of masks as uncompressed COCO run lengths (column
//! by column, starting with the run of zeros) with their scores; also `small`, `middle`, `large` if the generator keeps
//! the levels apart.

use std::collections::BTreeMap;

use image::RgbImage;
use serde::{Deserialize, Serialize};

use crate::files::json;
use crate::segment::automatic::{Candidates, Request};
use crate::segment::mask::Mask;
use crate::segment::sam::Sam;
use crate::segment::{Candidate, GeneratorOptions, Level, Observer, SegmentError};

/// Two masks that overlap less than this are not the same mask.
const LEAST_IOU_OF_A_MATCH: f64 = 0.5;

/// A reference file.
#[derive(Debug, Clone, Deserialize)]
pub struct Reference {
    pub width: u32,
    pub height: u32,
    points_per_side: u32,
    crop_n_layers: u32,
    pred_iou_thresh: f32,
    stability_score_thresh: f32,
    stability_score_offset: f32,
    box_nms_thresh: f32,
    min_mask_region_area: u32,
    all: Vec<ReferenceMask>,
    small: Option<Vec<ReferenceMask>>,
    middle: Option<Vec<ReferenceMask>>,
    large: Option<Vec<ReferenceMask>>,
}

#[derive(Debug, Clone, Deserialize)]
struct ReferenceMask {
    segmentation: ColumnRuns,
    predicted_iou: f32,
    stability_score: f32,
}

/// COCO's uncompressed run lengths.
#[derive(Debug, Clone, Deserialize)]
struct ColumnRuns {
    /// Height, width.
    size: [u32; 2],
    counts: Vec<u32>,
}

/// Why a comparison could not be made.
#[derive(Debug, thiserror::Error)]
pub enum MasksError {
    #[error("the reference does not hold settings and masks as JSON")]
    Json(#[from] serde_json::Error),
    #[error(
        "the reference was made from a picture of {} x {} pixels, but this one is {} x {}: give the same picture",
        expected.0, expected.1, found.0, found.1
    )]
    Size { expected: (u32, u32), found: (u32, u32) },
    #[error("mask {index} of list {list:?} has run lengths that do not add up to its size")]
    Runs { list: &'static str, index: usize },
    #[error(transparent)]
    Segment(#[from] SegmentError),
}

/// The comparison of one list of masks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    pub count: usize,
    pub reference_count: usize,
    /// Over the pairs, as is the minimum; without pairs, both are 1 if both lists are empty, else 0.
    pub matched_mean_iou: f64,
    pub matched_min_iou: f64,
    /// Masks without a partner, on both sides.
    pub unmatched: usize,
    /// Largest differences within the pairs.
    pub predicted_iou_max_difference: f64,
    pub stability_max_difference: f64,
}

impl Reference {
    /// Reads a reference file.
    pub fn from_json(json: &str) -> Result<Self, MasksError> {
        Ok(json::read(json.as_bytes())?)
    }

    /// The settings with which it was made. Those that no reference holds have the public generator's defaults.
    pub fn generator_options(&self) -> GeneratorOptions {
        GeneratorOptions {
            points_per_side: self.points_per_side,
            min_predicted_iou: self.pred_iou_thresh,
            min_stability: self.stability_score_thresh,
            stability_offset: self.stability_score_offset,
            box_nms: self.box_nms_thresh,
            crop_layers: self.crop_n_layers,
            min_region_area: self.min_mask_region_area,
            ..GeneratorOptions::default()
        }
    }

    /// The lists that it holds, with their level; `None` for the list of all levels together.
    fn lists(&self) -> impl Iterator<Item = (&'static str, Option<Level>, &[ReferenceMask])> {
        let lists = [
            ("small", Some(Level::Small), self.small.as_ref()),
            ("middle", Some(Level::Middle), self.middle.as_ref()),
            ("large", Some(Level::Large), self.large.as_ref()),
            ("all", None, Some(&self.all)),
        ];
        lists.into_iter().filter_map(|(list, level, masks)| Some((list, level, masks?.as_slice())))
    }

    fn decoded<'a>(
        &self,
        list: &'static str,
        masks: &'a [ReferenceMask],
    ) -> Result<Vec<(Mask, &'a ReferenceMask)>, MasksError> {
        let decode = |(index, mask): (usize, &'a ReferenceMask)| {
            let decoded = mask.segmentation.decode((self.width, self.height));
            Ok((decoded.ok_or(MasksError::Runs { list, index })?, mask))
        };
        masks.iter().enumerate().map(decode).collect()
    }
}

impl ColumnRuns {
    fn decode(&self, (width, height): (u32, u32)) -> Option<Mask> {
        let total: u64 = self.counts.iter().map(|&count| u64::from(count)).sum();
        if self.size != [height, width] || total != u64::from(width) * u64::from(height) {
            return None;
        }
        let mut pixels = Vec::with_capacity(total as usize);
        for (index, &count) in self.counts.iter().enumerate() {
            pixels.extend(std::iter::repeat_n(index % 2 == 1, count as usize));
        }
        Some(Mask::from_fn(width, height, |x, y| pixels[x as usize * height as usize + y as usize]))
    }
}

/// Segments `picture` with the reference's settings and compares each of its lists: `small`, `middle`, `large`, `all`.
pub fn compare(
    sam: &Sam,
    picture: &RgbImage,
    reference: &Reference,
    observer: &dyn Observer,
) -> Result<BTreeMap<&'static str, Comparison>, MasksError> {
    let expected = (reference.width, reference.height);
    if picture.dimensions() != expected {
        return Err(MasksError::Size { expected, found: picture.dimensions() });
    }
    let options = reference.generator_options();
    let levels = [Level::Small, Level::Middle, Level::Large];
    let request = Request { picture, adaptive: None, levels: &levels, options: &options, observer };
    compare_candidates(&request.run(sam)?, reference)
}

fn compare_candidates(
    found: &Candidates,
    reference: &Reference,
) -> Result<BTreeMap<&'static str, Comparison>, MasksError> {
    let options = reference.generator_options();
    let compare_one = |(list, level, masks): (&'static str, Option<Level>, &[ReferenceMask])| {
        Ok((list, compare_list(&found.distinct(level, &options), &reference.decoded(list, masks)?)))
    };
    reference.lists().map(compare_one).collect()
}

/// Pairs the masks one to one, the best overlap first.
fn compare_list(ours: &[Candidate], theirs: &[(Mask, &ReferenceMask)]) -> Comparison {
    let mut overlaps = Vec::new();
    for (i, our) in ours.iter().enumerate() {
        for (j, (their, _)) in theirs.iter().enumerate() {
            let iou = our.mask.iou(their);
            if iou >= LEAST_IOU_OF_A_MATCH {
                overlaps.push((iou, i, j));
            }
        }
    }
    overlaps.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut our_taken, mut their_taken) = (vec![false; ours.len()], vec![false; theirs.len()]);
    let mut pairs = Vec::new();
    for (iou, i, j) in overlaps {
        if !our_taken[i] && !their_taken[j] {
            (our_taken[i], their_taken[j]) = (true, true);
            pairs.push((iou, i, j));
        }
    }
    let largest = |difference: &dyn Fn(&Candidate, &ReferenceMask) -> f32| {
        let differences = pairs.iter().map(|&(_, i, j)| f64::from(difference(&ours[i], theirs[j].1).abs()));
        differences.fold(0.0, f64::max)
    };
    let without_pairs = f64::from(u8::from(ours.is_empty() && theirs.is_empty()));
    Comparison {
        count: ours.len(),
        reference_count: theirs.len(),
        matched_mean_iou: if pairs.is_empty() {
            without_pairs
        } else {
            pairs.iter().map(|pair| pair.0).sum::<f64>() / pairs.len() as f64
        },
        matched_min_iou: pairs.iter().map(|pair| pair.0).reduce(f64::min).unwrap_or(without_pairs),
        unmatched: ours.len() + theirs.len() - 2 * pairs.len(),
        predicted_iou_max_difference: largest(&|our, their| our.predicted_iou - their.predicted_iou),
        stability_max_difference: largest(&|our, their| our.stability - their.stability_score),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::mask::Rect;

    fn candidate(mask: Mask, predicted_iou: f32) -> Candidate {
        let bounds = mask.bounds().unwrap();
        let crop = Rect::of_size(mask.width(), mask.height());
        Candidate { mask, bounds, predicted_iou, stability: 0.9, level: Level::Small, crop }
    }

    fn columns(start: u32, end: u32) -> Mask {
        Mask::from_fn(40, 2, |x, _| (start..end).contains(&x))
    }

    fn reference_mask(predicted_iou: f32) -> ReferenceMask {
        let segmentation = ColumnRuns { size: [2, 40], counts: vec![] };
        ReferenceMask { segmentation, predicted_iou, stability_score: 0.9 }
    }

    #[test]
    fn run_lengths_go_column_by_column() {
        let runs = ColumnRuns { size: [2, 3], counts: vec![1, 2, 3] };
        let mask = runs.decode((3, 2)).unwrap();
        assert_eq!((mask.row(0), mask.row(1)), ([(1, 2)].as_slice(), [(0, 1)].as_slice()));
        assert!(runs.decode((2, 3)).is_none());
        assert!(ColumnRuns { size: [2, 3], counts: vec![1, 2, 2] }.decode((3, 2)).is_none());
    }

    #[test]
    fn pairs_are_one_to_one_and_what_is_left_is_counted() {
        let ours = [candidate(columns(0, 10), 0.8), candidate(columns(1, 10), 0.9), candidate(columns(30, 40), 0.7)];
        let (near, better, worse) = (reference_mask(0.8), reference_mask(0.95), reference_mask(0.7));
        let theirs = [(columns(0, 9), &near), (columns(1, 10), &better), (columns(20, 25), &worse)];
        let comparison = compare_list(&ours, &theirs);
        // The equal masks pair first; then columns 0..10 with 0..9.
        assert!((comparison.matched_mean_iou - 0.95).abs() < 1e-12, "{comparison:?}");
        assert!((comparison.matched_min_iou - 0.9).abs() < 1e-12);
        assert_eq!(comparison.unmatched, 2);
        assert!((comparison.predicted_iou_max_difference - 0.05).abs() < 1e-6);
    }

    #[test]
    fn nothing_found_is_no_agreement_unless_nothing_was_there() {
        let reference = reference_mask(0.8);
        let nothing = compare_list(&[], &[(columns(0, 9), &reference)]);
        assert_eq!((nothing.matched_mean_iou, nothing.matched_min_iou), (0.0, 0.0));
        let both = compare_list(&[], &[]);
        assert_eq!((both.matched_mean_iou, both.matched_min_iou), (1.0, 1.0));
    }
}
