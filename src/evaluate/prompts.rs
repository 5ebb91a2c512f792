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

use super::parts::compare_segments;
use crate::scene::Photo;
use crate::segment::{Observer, Options, PointPrompts, SegmentError, Segmenter, ViewSegments};

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
    let (asked, started) = (Asked::default(), Instant::now());
    let found = views.iter().map(|view| segmenter.segment_view(&view.name, &view.photo, options, &asked));
    let found: Vec<ViewSegments> = found.collect::<Result<_, _>>()?;
    let (prompts, seconds) = (asked.0.load(Ordering::Relaxed), started.elapsed().as_secs_f64());
    let maps: Vec<_> = found.iter().zip(views).map(|(found, view)| (&found.map, &view.parts)).collect();
    let compared = compare_segments(&maps);
    let mean_iou = compared.as_ref().and_then(|compared| compared.mean_iou);
    let per_part = compared.map(|compared| compared.true_parts).unwrap_or_default();
    Ok(Outcome { prompts, seconds, mean_iou, per_part: per_part.iter().map(|(&part, of)| (part, of.iou)).collect() })
}

/// Counts prompts.
#[derive(Default)]
struct Asked(AtomicUsize);

impl Observer for Asked {
    fn announced(&self, _: usize) {}

    fn prompted(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}
