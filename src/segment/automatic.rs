//! SAM's automatic mask generator: a grid of point prompts, the masks that are good enough, without duplicates.
//!
//! For each crop of the picture (only the whole of it by default):
//! 1. encode it, then decode the points of its grid, all at once or in passes (see [`super::adaptive`]);
//! 2. drop masks by predicted IoU (before anything is enlarged), stability, and nearness to the crop's edge;
//! 3. suppress duplicates by their boxes.
//!
//! Then, over all crops: suppress duplicates between crops, remove small holes and islands, and suppress the masks that
//! have thereby become duplicates. The order and every comparison are those of the public `SamAutomaticMaskGenerator`,
//! in the variant that keeps the three levels apart (LangSplat's, which the paper uses).

use image::RgbImage;

use super::Level;
use super::adaptive::{self, Adaptive};
use super::candidate::Candidate;
use super::error::SegmentError;
use super::mask::Rect;
use super::nms::box_nms;
use super::observer::Observer;
use super::options::GeneratorOptions;
use super::preprocess::{Prepared, prepare};
use super::prompts::{self, Crop};
use super::regions::remove_small_regions;
use super::resize::cropped;
use super::sam::{Decoded, PreparedEmbedding, Sam};
use super::upsample::Upsampler;
use crate::parallel;

/// Distance from a crop's edge, in pixels, within which a box counts as cut off (`is_box_near_crop_edge`).
const EDGE_TOLERANCE: u32 = 20;

/// In the order of SAM's masks.
const LEVELS: [Level; 3] = [Level::Small, Level::Middle, Level::Large];

/// The masks that passed the filters, crop by crop, in the order of prompts and levels, still with duplicates.
#[derive(Debug)]
pub struct Candidates {
    by_crop: Vec<Vec<Candidate>>,
}

/// The settings for segmenting a picture.
pub struct Request<'a> {
    pub picture: &'a RgbImage,
    /// Selects the grid points that are prompts; all points if `None`.
    pub adaptive: Option<Adaptive<'a>>,
    /// The levels to keep.
    pub levels: &'a [Level],
    pub options: &'a GeneratorOptions,
    pub observer: &'a dyn Observer,
}

impl Request<'_> {
    /// Prompts SAM and filters the resulting masks. Runs on the ambient rayon pool.
    pub fn run(&self, sam: &Sam) -> Result<Candidates, SegmentError> {
        let options = self.options;
        let mut crops = prompts::crops(
            self.picture.width(),
            self.picture.height(),
            options.points_per_side,
            options.crop_layers,
            options.crop_overlap,
            options.crop_points_downscale,
        );
        let is_sparse = self.adaptive.as_ref().is_some_and(|adaptive| adaptive.is_sparse);
        for crop in crops.iter_mut().filter(|_| is_sparse) {
            crop.points_per_side = prompts::worth_asking(crop.points_per_side, &crop.rect, options.min_region_area);
        }
        Ok(Candidates { by_crop: parallel::try_map(&crops, |crop| self.run_crop(sam, crop))? })
    }

    /// For each of the `points`, in pixels of the picture and within the crop `rect` of it, the masks of one prompt there that pass the
    /// filters.
    pub fn at(&self, sam: &Sam, rect: Rect, points: &[[f64; 2]]) -> Result<Vec<Vec<Candidate>>, SegmentError> {
        if points.is_empty() {
            return Ok(Vec::new());
        }
        let frame = self.frame(sam, rect)?;
        let in_crop = |[x, y]: &[f64; 2]| [x - f64::from(rect.x0), y - f64::from(rect.y0)];
        let points: Vec<[f64; 2]> = points.iter().map(in_crop).collect();
        let batches = points.chunks(sam.batch()).map(|points| self.run_prompts(sam, &frame, points));
        Ok(batches.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
    }

    fn run_crop(&self, sam: &Sam, crop: &Crop) -> Result<Vec<Candidate>, SegmentError> {
        let grid = prompts::grid(crop.rect.width(), crop.rect.height(), crop.points_per_side);
        let passes = match self.adaptive {
            Some(_) => adaptive::passes(crop.points_per_side as usize),
            None => vec![(0..grid.len()).collect()],
        };
        let mut frame = None;
        // The result of each point's prompt; `None` if SAM was not prompted there.
        let mut answers: Vec<Option<Vec<Candidate>>> = vec![None; grid.len()];
        for pass in passes {
            let asked = self.worth_asking(&pass, &grid, crop, &answers);
            self.observer.announced(asked.len());
            if asked.is_empty() {
                continue;
            }
            if frame.is_none() {
                frame = Some(self.frame(sam, crop.rect)?);
            }
            let Some(frame) = &frame else { continue };
            let points: Vec<[f64; 2]> = asked.iter().map(|&index| grid[index]).collect();
            let batches: Vec<&[[f64; 2]]> = points.chunks(sam.batch()).collect();
            let new = parallel::try_map(&batches, |points| self.run_prompts(sam, frame, points))?;
            for (index, candidates) in asked.into_iter().zip(new.into_iter().flatten()) {
                answers[index] = Some(candidates);
            }
        }
        Ok(answers.into_iter().flatten().flatten().collect())
    }

    /// The points of a pass that are worth prompting, given the results so far.
    fn worth_asking(
        &self,
        pass: &[usize],
        grid: &[[f64; 2]],
        crop: &Crop,
        answers: &[Option<Vec<Candidate>>],
    ) -> Vec<usize> {
        let Some(adaptive) = &self.adaptive else { return pass.to_vec() };
        let is_worth_asking = |&index: &usize| {
            let (x, y) = (crop.rect.x0 + grid[index][0] as u32, crop.rect.y0 + grid[index][1] as u32);
            let around = adaptive::neighbours(index, crop.points_per_side as usize);
            let known: Vec<&[Candidate]> = around.filter_map(|neighbour| answers[neighbour].as_deref()).collect();
            adaptive.is_worth_asking(x, y, &known)
        };
        pass.iter().copied().filter(is_worth_asking).collect()
    }

    fn frame(&self, sam: &Sam, rect: Rect) -> Result<Frame, SegmentError> {
        let Prepared { input, scaled } = prepare(&cropped(self.picture, &rect));
        Ok(Frame {
            rect,
            scale: [f64::from(scaled.0) / f64::from(rect.width()), f64::from(scaled.1) / f64::from(rect.height())],
            upsampler: Upsampler::new(rect.width(), rect.height(), scaled.0, scaled.1),
            embedding: sam.prepare(&sam.encode(&input)?, scaled)?,
        })
    }

    /// Returns the masks that passed the filters, prompt by prompt.
    fn run_prompts(&self, sam: &Sam, frame: &Frame, points: &[[f64; 2]]) -> Result<Vec<Vec<Candidate>>, SegmentError> {
        let scaled = |point: &[f64; 2]| [(point[0] * frame.scale[0]) as f32, (point[1] * frame.scale[1]) as f32];
        let scaled_points: Vec<[f32; 2]> = points.iter().map(scaled).collect();
        let mut found = Vec::with_capacity(points.len());
        let wanted = |predicted_iou: &[f32; 3]| self.wanted(predicted_iou);
        sam.decode(&frame.embedding, &scaled_points, &wanted, |_, decoded| {
            found.push(self.filter(frame, &decoded));
            self.observer.prompted();
        })?;
        Ok(found)
    }

    /// The masks of a prompt that are to be examined. As in the public generator, a minimum of 0 is none: SAM may predict
    /// a little less than 0.
    fn wanted(&self, predicted_iou: &[f32; 3]) -> [bool; 3] {
        let least = self.options.min_predicted_iou;
        std::array::from_fn(|index| {
            self.levels.contains(&LEVELS[index]) && (least == 0.0 || predicted_iou[index] > least)
        })
    }

    fn filter(&self, frame: &Frame, decoded: &Decoded<'_>) -> Vec<Candidate> {
        let options = self.options;
        let mut found = Vec::new();
        for (index, level) in LEVELS.into_iter().enumerate() {
            let Some(logits) = decoded.logits[index] else { continue };
            let predicted_iou = decoded.predicted_iou[index];
            let scored = frame.upsampler.score(logits, options.stability_offset);
            // Also false if the stability is NaN.
            let is_stable = scored.stability >= options.min_stability;
            let (true, Some(bounds)) = (is_stable, scored.mask.bounds()) else { continue };
            let (x0, y0) = (frame.rect.x0, frame.rect.y0);
            let bounds = Rect { x0: bounds.x0 + x0, y0: bounds.y0 + y0, x1: bounds.x1 + x0, y1: bounds.y1 + y0 };
            let (width, height) = self.picture.dimensions();
            if is_cut_off(&bounds, &frame.rect, &Rect::of_size(width, height)) {
                continue;
            }
            found.push(Candidate {
                mask: scored.mask.placed(x0, y0, width, height),
                bounds,
                predicted_iou,
                stability: scored.stability,
                level,
                crop: frame.rect,
            });
        }
        found
    }
}

/// One encoded crop and how its pixels relate to the model's.
struct Frame {
    rect: Rect,
    /// Model pixels per crop pixel, x and y.
    scale: [f64; 2],
    upsampler: Upsampler,
    embedding: PreparedEmbedding,
}

impl Candidates {
    /// The masks of one level, or of all levels together if `level` is `None`, without duplicates.
    pub fn distinct(&self, level: Option<Level>, options: &GeneratorOptions) -> Vec<Candidate> {
        let mut chosen: Vec<Candidate> = Vec::new();
        for crop in &self.by_crop {
            let of_level: Vec<&Candidate> =
                crop.iter().filter(|c| level.is_none_or(|level| c.level == level)).collect();
            let bounds: Vec<Rect> = of_level.iter().map(|candidate| candidate.bounds).collect();
            let scores: Vec<f32> = of_level.iter().map(|candidate| candidate.predicted_iou).collect();
            chosen.extend(box_nms(&bounds, &scores, options.box_nms).into_iter().map(|i| of_level[i].clone()));
        }
        if self.by_crop.len() > 1 {
            // Masks of smaller crops are better resolved.
            let scores = chosen.iter().map(|c| 1.0 / (c.crop.width() as f32 * c.crop.height() as f32)).collect();
            chosen = suppressed(chosen, scores, options.crop_nms);
        }
        if options.min_region_area > 0 {
            chosen = without_small_regions(chosen, options);
        }
        chosen
    }
}

/// Removes small regions, then masks that this made duplicates; masks that did not change are preferred.
fn without_small_regions(candidates: Vec<Candidate>, options: &GeneratorOptions) -> Vec<Candidate> {
    let mend = |mut candidate: Candidate| {
        let (mask, changed) = remove_small_regions(candidate.mask, u64::from(options.min_region_area));
        candidate.bounds = mask.bounds().unwrap_or(candidate.bounds);
        candidate.mask = mask;
        (candidate, if changed { 0.0 } else { 1.0 })
    };
    let (mended, scores): (Vec<Candidate>, Vec<f32>) = candidates.into_iter().map(mend).unzip();
    suppressed(mended, scores, options.box_nms.max(options.crop_nms))
}

fn suppressed(candidates: Vec<Candidate>, scores: Vec<f32>, max_iou: f32) -> Vec<Candidate> {
    let bounds: Vec<Rect> = candidates.iter().map(|candidate| candidate.bounds).collect();
    let mut candidates: Vec<Option<Candidate>> = candidates.into_iter().map(Some).collect();
    box_nms(&bounds, &scores, max_iou).into_iter().filter_map(|i| candidates[i].take()).collect()
}

/// True if a box ends near an edge of its crop that is not an edge of the picture. A box's right and lower edges are
/// its last pixels, but those of the crop and the picture are one past the last (`is_box_near_crop_edge`).
fn is_cut_off(bounds: &Rect, crop: &Rect, picture: &Rect) -> bool {
    let near = |a: u32, b: u32| a.abs_diff(b) <= EDGE_TOLERANCE;
    let sides = [
        (bounds.x0, crop.x0, picture.x0),
        (bounds.y0, crop.y0, picture.y0),
        (bounds.x1 - 1, crop.x1, picture.x1),
        (bounds.y1 - 1, crop.y1, picture.y1),
    ];
    sides.into_iter().any(|(side, crop, picture)| near(side, crop) && !near(side, picture))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minimum_of_zero_keeps_masks_of_any_predicted_iou() {
        let wanted = |min_predicted_iou: f32| {
            let options = GeneratorOptions { min_predicted_iou, ..GeneratorOptions::default() };
            let (picture, levels) = (RgbImage::new(1, 1), [Level::Small, Level::Middle]);
            let request =
                Request { picture: &picture, adaptive: None, levels: &levels, options: &options, observer: &() };
            request.wanted(&[-0.01, 0.7, 0.9])
        };
        assert_eq!(wanted(0.7), [false, false, false], "it must be above the minimum");
        assert_eq!(wanted(0.1), [false, true, false]);
        assert_eq!(wanted(0.0), [true, true, false]);
    }

    #[test]
    fn a_box_at_an_inner_edge_of_its_crop_is_cut_off() {
        let rect = |x0, y0, x1, y1| Rect { x0, y0, x1, y1 };
        let (crop, picture) = (rect(100, 0, 300, 200), rect(0, 0, 800, 600));
        assert!(is_cut_off(&rect(120, 50, 200, 100), &crop, &picture), "20 pixels from the left edge");
        assert!(!is_cut_off(&rect(121, 50, 200, 100), &crop, &picture), "21 pixels from it");
        assert!(!is_cut_off(&rect(150, 0, 200, 100), &crop, &picture), "the upper edge is the picture's");
        assert!(is_cut_off(&rect(150, 50, 281, 100), &crop, &picture), "last pixel 20 from the right end");
        assert!(!is_cut_off(&rect(150, 50, 280, 100), &crop, &picture));
    }
}
