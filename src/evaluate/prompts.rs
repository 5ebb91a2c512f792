//! The savings and costs of prompting SAM adaptively: the same views are segmented both ways and compared with true
//! part maps.
//!
//! A segment counts as the part that it covers most of, so the IoU of a part tells how well labels that are correct for
//! every segment would separate it from the others.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use image::GrayImage;
use serde::Serialize;

use super::parts::NO_PART;
use super::segmentation::IouTally;
use crate::scene::Photo;
use crate::segment::{LabelMap, Observer, Options, PointPrompts, SegmentError, Segmenter};

/// Comparison of the two ways on one scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    pub scene: String,
    pub views: usize,
    pub grid: Outcome,
    pub adaptive: Outcome,
}

/// The cost and the result of one way.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    pub prompts: usize,
    pub seconds: f64,
    /// Mean over the true parts, each over all views; `None` if there are none.
    pub mean_iou: Option<f64>,
    pub per_part: BTreeMap<u8, f64>,
}

/// A photo and the true part of each of its pixels.
pub struct TruePhoto {
    pub name: String,
    pub photo: Photo,
    /// 255 for pixels without a part.
    pub parts: GrayImage,
}

/// Segments the views both ways, one view after the other.
pub fn compare(
    segmenter: &Segmenter,
    scene: &str,
    views: &[TruePhoto],
    options: &Options,
) -> Result<Comparison, SegmentError> {
    let run = |point_prompts| segment(segmenter, views, &Options { point_prompts, ..options.clone() });
    Ok(Comparison {
        scene: scene.to_owned(),
        views: views.len(),
        grid: run(PointPrompts::Grid)?,
        adaptive: run(PointPrompts::Adaptive)?,
    })
}

fn segment(segmenter: &Segmenter, views: &[TruePhoto], options: &Options) -> Result<Outcome, SegmentError> {
    let (asked, started, mut tally) = (Asked::default(), Instant::now(), IouTally::default());
    for view in views {
        let segments = segmenter.segment_view(&view.name, &view.photo, options, &asked)?;
        add_view(&mut tally, &segments.map, &view.parts);
    }
    let (prompts, seconds) = (asked.0.load(Ordering::Relaxed), started.elapsed().as_secs_f64());
    Ok(Outcome { prompts, seconds, mean_iou: tally.mean(), per_part: tally.per_label() })
}

fn add_view(tally: &mut IouTally<u8>, map: &LabelMap, truth: &GrayImage) {
    let pixels = || map.labels.iter().copied().zip(truth.as_raw().iter().copied());
    let mut shared: BTreeMap<u16, BTreeMap<u8, u32>> = BTreeMap::new();
    for (label, part) in pixels().filter(|&(label, part)| label > 0 && part != NO_PART) {
        *shared.entry(label).or_default().entry(part).or_default() += 1;
    }
    // Among parts of which a segment covers equally many pixels, the one with the lower number.
    let most = |parts: &BTreeMap<u8, u32>| parts.iter().rev().max_by_key(|(_, count)| **count).map(|(part, _)| *part);
    let part_of: BTreeMap<u16, Option<u8>> = shared.iter().map(|(label, parts)| (*label, most(parts))).collect();
    let taken_for = |label: u16| part_of.get(&label).copied().flatten();
    tally.add(pixels().map(|(label, part)| ((part != NO_PART).then_some(part), taken_for(label))));
}

/// Counts prompts.
#[derive(Default)]
struct Asked(AtomicUsize);

impl Observer for Asked {
    fn planned(&self, _: usize) {}

    fn prompted(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
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
        let mut tally = IouTally::default();
        add_view(&mut tally, &map, &truth);
        assert_eq!(tally.per_label(), BTreeMap::from([(0, 3.0 / 4.0), (7, 2.0 / 4.0)]));
    }
}
