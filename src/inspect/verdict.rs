//! Decides whether photos and Gaussians line up, on small pictures, which are insensitive to noise and exposure.

use image::imageops::{FilterType, resize};
use image::{Rgb32FImage, buffer::ConvertBuffer};

use super::ViewFit;
use super::compare::as_the_splat_shows;
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::numeric::upper_median;
use crate::parallel;
use crate::render::{RenderOptions, render};
use crate::scene::{Scene, SceneError, View};
use crate::words::progress::Progress;

/// Longest side of the small pictures in pixels.
const SIDE: u32 = 96;

/// Minimum correlation of a photo with the splat seen from its own camera for the two to line up. Trained splats reach
/// 0.95 and more on their photos; the frames broken on purpose in `tests/inspect.rs` stay below 0.75.
pub(super) const LEAST_CORRELATION: f64 = 0.85;

/// Minimum difference by which a photo must fit its own camera better than that of a view on the other side, but no more
/// than half of what a perfect photo has: one minus the correlation of the splat's pictures from the two sides, next to
/// nothing for a ball or a bottle.
const LEAST_ADVANTAGE: f64 = 0.05;
/// A smaller difference is noise.
const ADVANTAGE_NOISE: f64 = 0.005;

/// Minimum overlap (IoU) of the masks. A rotated or shifted frame does not reach it; a slightly wrong scale may.
const LEAST_MASK_IOU: f64 = 0.7;

/// Maximum number of views judged.
pub(super) const MOST_VIEWS: usize = 12;

/// The agreement of the photos' and the splat's frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Verdict {
    pub aligned: bool,
    /// Median correlation of the views with the splat from their own cameras, -1 to 1.
    pub correlation: f64,
}

/// A reduced photo with its camera.
pub(super) struct Small {
    pub camera: Camera,
    pub picture: Vec<f32>,
}

/// `None` if there are no views.
pub(super) fn of(
    scene: &Scene,
    views: &[View],
    fits: &[ViewFit],
    progress: Progress,
) -> Result<Option<Verdict>, SceneError> {
    if views.is_empty() {
        return Ok(None);
    }
    let small = small_views(scene, views)?;
    let cloud = scene.whole_cloud();
    let options = RenderOptions::default();
    let bar = progress.bar("inspect", small.len() as u64).with_message("small views");
    let drawn = |view: &Small| {
        let picture = picture(&cloud, &view.camera, &options);
        bar.inc(1);
        picture
    };
    let rendered: Vec<Vec<f32>> = small.iter().map(drawn).collect();
    bar.finish_and_clear();
    let correlations = small.iter().zip(&rendered).map(|(view, rendered)| correlation(&view.picture, rendered));
    let correlation_with_own = upper_median(correlations.collect()).unwrap_or_default();
    let center = scene.object_bounds().center();
    let from_object = |index: usize| {
        let offset = small[index].camera.center_in_world() - center;
        offset.try_normalize(f64::EPSILON).unwrap_or_default()
    };
    let advantage = |index: usize| {
        let photo = &small[index].picture;
        let cosine = |other: &usize| from_object(index).dot(&from_object(*other));
        // Pictures of a different size cannot be compared with this one.
        let size = |index: usize| (small[index].camera.intrinsics.width, small[index].camera.intrinsics.height);
        let others = (0..small.len()).filter(|other| *other != index && size(*other) == size(index));
        let opposite = &rendered[others.min_by(|a, b| cosine(a).total_cmp(&cosine(b)))?];
        let needed = LEAST_ADVANTAGE.min(0.5 * (1.0 - correlation(&rendered[index], opposite)));
        Some(correlation(photo, &rendered[index]) - correlation(photo, opposite) - needed)
    };
    let fits_own_best = upper_median((0..small.len()).filter_map(advantage).collect())
        .is_none_or(|more_than_needed| more_than_needed >= -ADVANTAGE_NOISE);
    let overlaps: Vec<f64> = fits.iter().filter_map(|fit| fit.overlap).collect();
    let masks_agree = upper_median(overlaps).is_none_or(|overlap| overlap >= LEAST_MASK_IOU);
    let aligned = correlation_with_own >= LEAST_CORRELATION && fits_own_best && masks_agree;
    Ok(Some(Verdict { aligned, correlation: correlation_with_own }))
}

/// Up to [`MOST_VIEWS`] of the views, evenly spread, with photos reduced to [`SIDE`] pixels along the longer side.
pub(super) fn small_views(scene: &Scene, views: &[View]) -> Result<Vec<Small>, SceneError> {
    let step = views.len().div_ceil(MOST_VIEWS);
    let small = |view: &View| {
        let photo = as_the_splat_shows(scene, view.photo()?);
        let camera = resized(&view.camera, SIDE.min(view.camera.intrinsics.width.max(view.camera.intrinsics.height)));
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let small: Rgb32FImage = resize(&photo.rgb, width, height, FilterType::Triangle).convert();
        Ok(Small { camera, picture: small.into_raw() })
    };
    let chosen: Vec<&View> = views.iter().step_by(step.max(1)).collect();
    parallel::try_map(&chosen, |view| small(view))
}

/// The camera of a picture of the same view whose longer side has `longer` pixels.
pub(super) fn resized(camera: &Camera, longer: u32) -> Camera {
    let intrinsics = camera.intrinsics;
    let factor = f64::from(longer) / f64::from(intrinsics.width.max(intrinsics.height));
    let side = |length: u32| ((f64::from(length) * factor).round() as u32).max(1);
    Camera { intrinsics: intrinsics.resized(side(intrinsics.width), side(intrinsics.height)), ..camera.clone() }
}

/// The splat over white from a reduced camera, three values per pixel. It is rendered at twice the size and averaged:
/// at the reduced size the rasteriser's low-pass filter would widen everything thin.
pub(super) fn picture(cloud: &Gaussians, camera: &Camera, options: &RenderOptions) -> Vec<f32> {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let intrinsics = camera.intrinsics.resized(2 * camera.intrinsics.width, 2 * camera.intrinsics.height);
    let large = render(cloud, &Camera { intrinsics, ..camera.clone() }, options);
    let over_white = |at: usize| large.rgb[at].map(|value| value + 1.0 - large.alpha[at]);
    let averaged = |pixel: usize| {
        let at = 4 * width * (pixel / width) + 2 * (pixel % width);
        let four = [at, at + 1, at + 2 * width, at + 2 * width + 1].map(over_white);
        std::array::from_fn::<f32, 3, _>(|channel| 0.25 * four.iter().map(|color| color[channel]).sum::<f32>())
    };
    (0..width * height).flat_map(averaged).collect()
}

/// Pearson's correlation of two pictures of the same size; 0 if one of them has a single colour.
pub(super) fn correlation(a: &[f32], b: &[f32]) -> f64 {
    let mean = |values: &[f32]| values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len().max(1) as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (f64::from(*a) - mean_a, f64::from(*b) - mean_b);
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    let scale = (aa * bb).sqrt();
    if scale > 1e-9 { ab / scale } else { 0.0 }
}
