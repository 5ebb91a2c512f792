//! One view's segments: the foreground's bounding box, SAM's masks in it, painted.

use std::path::Path;

use image::GrayImage;

use super::adaptive::Adaptive;
use super::automatic::Request;
use super::candidate::Candidate;
use super::error::SegmentError;
use super::mask::{Mask, Rect};
use super::observer::Observer;
use super::options::{DecoderRuntime, GeneratorOptions, Options, PointPrompts, SelectionOptions};
use super::paint::paint;
use super::resize::cropped;
use super::sam::Sam;
use super::tree::tree;
use super::{LabelMap, Level, ViewSegments};
use crate::scene::{ForegroundSource, Photo};
use crate::setup::ModelFiles;

/// Least value of [`Photo::foreground`] that counts as the object.
const FOREGROUND: u8 = 128;

const ALL_LEVELS: [Level; 3] = [Level::Small, Level::Middle, Level::Large];
/// The side of the enlarged crop around a prompt, as a share of that of the whole foreground.
const ENLARGED: f64 = 0.5;
/// Least predicted IoU and stability of the masks of a prompt: below it, a mask is as likely wrong as right.
const WEAK: f32 = 0.5;

/// SAM, loaded and ready.
pub struct Segmenter {
    sam: Sam,
}

impl Segmenter {
    /// Loads SAM for use on `threads` threads at once.
    ///
    /// # Errors
    /// As [`Sam::open`].
    pub fn new(files: &ModelFiles, decoder: Option<DecoderRuntime>, threads: usize) -> Result<Self, SegmentError> {
        Ok(Self { sam: Sam::open(files, decoder, threads)? })
    }

    /// Keeps embeddings in `folder` (see [`Sam::caching_embeddings`]).
    pub fn caching_embeddings(self, folder: &Path, files: &ModelFiles) -> Result<Self, SegmentError> {
        Ok(Self { sam: self.sam.caching_embeddings(folder, files)? })
    }

    /// SAM itself, for uses that need its masks rather than segments.
    pub fn sam(&self) -> &Sam {
        &self.sam
    }

    /// The segments of one photo: none if it has no foreground, and the whole foreground if SAM finds none. They are
    /// nested unless the options name a level. Runs on the ambient rayon pool; the result does not depend on its size.
    pub fn segment_view(
        &self,
        view: &str,
        photo: &Photo,
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<ViewSegments, SegmentError> {
        let foreground = mask_of(&photo.foreground);
        let (width, height) = (foreground.width(), foreground.height());
        let levels = match &options.level {
            Some(level) => std::slice::from_ref(level),
            None => &ALL_LEVELS,
        };
        let masks = self.masks(photo, levels, options, observer)?;
        let (map, segments) = match masks.as_slice() {
            [] => (LabelMap { width, height, labels: vec![0; width as usize * height as usize] }, Vec::new()),
            [masks] => paint(masks, &foreground, options),
            levels => match tree(levels, &foreground, options) {
                (_, none) if none.is_empty() => paint(&[], &foreground, options),
                nested => nested,
            },
        };
        Ok(ViewSegments { view: view.to_owned(), map, segments })
    }

    /// The flat segments of one photo at each of SAM's levels, from the same prompts.
    pub fn segment_levels(&self, photo: &Photo, options: &Options) -> Result<Vec<(Level, LabelMap)>, SegmentError> {
        let foreground = mask_of(&photo.foreground);
        let masks = self.masks(photo, &ALL_LEVELS, options, &())?;
        let painted = ALL_LEVELS.into_iter().zip(masks).map(|(level, masks)| {
            let flat = Options { level: Some(level), ..options.clone() };
            (level, paint(&masks, &foreground, &flat).0)
        });
        Ok(painted.collect())
    }

    /// SAM's masks of each of the levels, found in the foreground's bounding box with its margin, at the photo's size.
    /// The masks of one level contain no duplicates. Empty if the photo has no foreground.
    ///
    /// Adaptive prompts are chosen by the masks of the first level.
    pub fn masks(
        &self,
        photo: &Photo,
        levels: &[Level],
        options: &Options,
        observer: &dyn Observer,
    ) -> Result<Vec<Vec<Candidate>>, SegmentError> {
        let (width, height) = photo.rgb.dimensions();
        let foreground = mask_of(&photo.foreground);
        let (Some(bounds), Some(&level)) = (foreground.bounds(), levels.first()) else { return Ok(Vec::new()) };
        let region = if options.selection.crop_to_foreground {
            with_margin(&bounds, options.selection.crop_margin, width, height)
        } else {
            Rect::of_size(width, height)
        };
        let object = foreground.cropped(&region);
        let request = Request {
            picture: &cropped(&photo.rgb, &region),
            adaptive: (options.point_prompts == PointPrompts::Adaptive).then_some(Adaptive {
                foreground: &object,
                whole_object: options.selection.whole_object,
                level,
                is_sparse: photo.foreground_source == ForegroundSource::Gaussians,
            }),
            levels,
            options: &options.generator,
            observer,
        };
        let found = request.run(&self.sam)?;
        let in_photo = |found: Candidate| {
            let mask = found.mask.placed(region.x0, region.y0, width, height);
            Candidate { bounds: mask.bounds().unwrap_or(found.bounds), mask, ..found }
        };
        let of_level =
            |&level: &Level| found.distinct(Some(level), &options.generator).into_iter().map(in_photo).collect();
        Ok(levels.iter().map(of_level).collect())
    }

    /// For each point of the photo, in pixels, SAM's masks of all levels for one prompt there. None if the photo has no foreground, or the
    /// point is outside of what is shown. Weak masks are among them.
    pub fn prompted(
        &self,
        photo: &Photo,
        points: &[[f64; 2]],
        shown: Shown,
        selection: &SelectionOptions,
    ) -> Result<Vec<Vec<Candidate>>, SegmentError> {
        let (width, height) = photo.rgb.dimensions();
        let mut found = vec![Vec::new(); points.len()];
        let Some(bounds) = mask_of(&photo.foreground).bounds() else { return Ok(found) };
        let whole = with_margin(&bounds, selection.crop_margin, width, height);
        let reach = 0.5 * ENLARGED * f64::from(whole.width().max(whole.height()));
        let around = |[x, y]: [f64; 2]| {
            let [x0, y0] = [x, y].map(|at| (at - reach).max(0.0) as u32);
            Rect { x0, y0, x1: ((x + reach) as u32 + 1).min(width), y1: ((y + reach) as u32 + 1).min(height) }
        };
        let request = Request {
            picture: &photo.rgb,
            adaptive: None,
            levels: &ALL_LEVELS,
            options: &GeneratorOptions { min_predicted_iou: WEAK, min_stability: WEAK, ..GeneratorOptions::default() },
            observer: &(),
        };
        let crops: Vec<(Rect, Vec<usize>)> = match shown {
            Shown::Whole => vec![(whole, (0..points.len()).collect())],
            Shown::Enlarged => points.iter().enumerate().map(|(n, point)| (around(*point), vec![n])).collect(),
        };
        for (crop, mut within) in crops {
            within.retain(|n| crop.contains(points[*n]));
            let prompts: Vec<[f64; 2]> = within.iter().map(|n| points[*n]).collect();
            for (n, masks) in within.into_iter().zip(request.at(&self.sam, crop, &prompts)?) {
                found[n] = masks;
            }
        }
        Ok(found)
    }
}

/// What SAM sees of a photo when it is prompted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// All of the foreground.
    Whole,
    /// A crop around the point: what is thin is wider there.
    Enlarged,
}

fn mask_of(foreground: &GrayImage) -> Mask {
    let raw = foreground.as_raw();
    let width = foreground.width() as usize;
    Mask::from_fn(foreground.width(), foreground.height(), |x, y| raw[y as usize * width + x as usize] >= FOREGROUND)
}

/// `bounds` widened on each side by `margin` times their longer side, clipped to the picture.
fn with_margin(bounds: &Rect, margin: f64, width: u32, height: u32) -> Rect {
    let margin = (margin.max(0.0) * f64::from(bounds.width().max(bounds.height()))).round() as u32;
    Rect {
        x0: bounds.x0.saturating_sub(margin),
        y0: bounds.y0.saturating_sub(margin),
        x1: bounds.x1.saturating_add(margin).min(width),
        y1: bounds.y1.saturating_add(margin).min(height),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_margin_is_a_share_of_the_longer_side_and_ends_at_the_picture() {
        let bounds = Rect { x0: 5, y0: 50, x1: 55, y1: 150 };
        assert_eq!(with_margin(&bounds, 0.1, 200, 155), Rect { x0: 0, y0: 40, x1: 65, y1: 155 });
    }
}
