//! How well the parts found in 3D match true ones, in views that were not used to find them.

use std::collections::{BTreeMap, BTreeSet};

use image::GrayImage;
use serde::Serialize;

use crate::camera::Camera;
use crate::output::one_line;
use crate::render::{RenderOptions, render_labels};
use crate::scene::gaussians::Gaussians;

/// Value in a true part map for pixels without a part.
pub const NO_PART: u8 = 255;
/// A found part shows a true one if at least this share of its pixels lies on it.
const SHOWN_SHARE: f64 = 0.1;

/// A view with the true part of each of its pixels.
pub struct TrueView {
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
    pub pieces: usize,
}

/// Pixels by what they show: found part, then true part.
#[derive(Default)]
struct Pixels {
    both: BTreeMap<(Option<u32>, Option<u8>), u64>,
}

impl Pixels {
    fn add(&mut self, gaussians: &Gaussians, part_of_gaussian: &[u16], view: &TrueView) {
        let labels: Vec<u32> = part_of_gaussian.iter().map(|&part| u32::from(part)).collect();
        let drawn = render_labels(gaussians, &view.camera, &labels, &RenderOptions::default());
        for (found, truth) in drawn.into_iter().zip(view.parts.as_raw()) {
            *self.both.entry((found, (*truth != NO_PART).then_some(*truth))).or_default() += 1;
        }
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

/// Compares the parts with the true ones in the views that were not segmented. The views that were segmented decide as
/// which true part a found part counts; if none of them has a true map, the compared views themselves do.
pub fn compare(scene: &str, gaussians: &Gaussians, part_of_gaussian: &[u16], views: &[TrueView]) -> PartsEvaluation {
    let (mut known, mut compared) = (Pixels::default(), Pixels::default());
    for view in views {
        if view.segmented { &mut known } else { &mut compared }.add(gaussians, part_of_gaussian, view);
    }
    let counts_as = if known.both.is_empty() { compared.most_shown() } else { known.most_shown() };
    let object = compared.count(|_, truth| truth.is_some());
    let values: BTreeSet<u8> = compared.both.keys().filter_map(|(_, truth)| *truth).collect();
    let of_value = |&value: &u8| {
        let pieces: Vec<u32> = counts_as.iter().filter(|(_, of)| **of == value).map(|(&found, _)| found).collect();
        let single = counts_as.keys().map(|&found| compared.iou(value, |other| other == found));
        let scored = TruePart {
            share: compared.count(|_, truth| truth == Some(value)) as f64 / object as f64,
            iou: compared.iou(value, |found| pieces.contains(&found)),
            best_iou: single.fold(0.0, f64::max),
            pieces: pieces.len(),
        };
        (value, scored)
    };
    let true_parts: BTreeMap<u8, TruePart> = values.iter().map(of_value).collect();
    let shown_by = |found: u32| {
        let all = compared.count(|of, truth| of == Some(found) && truth.is_some()) as f64;
        let shows = |value: &&u8| {
            compared.count(|of, truth| of == Some(found) && truth == Some(**value)) as f64 >= SHOWN_SHARE * all
        };
        (all > 0.0).then(|| values.iter().filter(shows).count())
    };
    let shown: Vec<usize> = counts_as.keys().filter_map(|&found| shown_by(found)).collect();
    let mean = |sum: f64, count: usize| (count > 0).then(|| sum / count as f64);
    PartsEvaluation {
        scene: scene.to_owned(),
        views: views.iter().filter(|view| !view.segmented).count(),
        parts: part_of_gaussian.iter().collect::<BTreeSet<_>>().len(),
        mean_iou: mean(true_parts.values().map(|part| part.iou).sum(), true_parts.len()),
        true_parts_per_part: mean(shown.iter().sum::<usize>() as f64, shown.len()),
        true_parts,
    }
}

impl PartsEvaluation {
    /// A table for people.
    pub fn text(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        let mut text = format!(
            "{}: {} parts found, mean IoU {} in {} other views, {} true parts per found part\n",
            one_line(&self.scene),
            self.parts,
            number(self.mean_iou),
            self.views,
            number(self.true_parts_per_part)
        );
        text += &format!("{:>10} {:>10} {:>8} {:>10} {:>8}\n", "true part", "share", "IoU", "best IoU", "pieces");
        for (value, part) in &self.true_parts {
            let TruePart { share, iou, best_iou, pieces } = part;
            text += &format!("{value:>10} {:>8.2} % {iou:>8.3} {best_iou:>10.3} {pieces:>8}\n", 100.0 * share);
        }
        text
    }
}
