//! PSNR and mask overlap between each photo and the splat seen from its camera.

use image::{GrayImage, Rgb, RgbImage};

use super::ViewFit;
use crate::from_splat::foreground;
use crate::render::{FOREGROUND_ALPHA, Render, RenderOptions, render};
use crate::scene::{ForegroundSource, ObjectSource, Photo, Scene, SceneError, View};
use crate::words::progress::Progress;

/// The least value of a pixel that is at least half covered by the object.
const HALF: u8 = 128;

/// The PSNR that stands for equal pictures.
pub(super) const EQUAL_DB: f64 = 99.0;

/// Compares every view, one after the other: the rasteriser uses all threads. Flaws are not looked for.
pub(super) fn compare(scene: &Scene, views: &[View], progress: Progress) -> Result<Vec<ViewFit>, SceneError> {
    let cloud = scene.whole_cloud();
    let bar = progress.bar("inspect", views.len() as u64).with_message("views");
    let fit = |view: &View| {
        let photo = as_the_splat_shows(scene, view.photo()?);
        let picture = render(&cloud, &view.camera, &RenderOptions::default());
        let all = covered(&picture);
        let object = match scene.object_source {
            ObjectSource::Whole => all.clone(),
            // Surroundings may hide some of the object.
            ObjectSource::Box | ObjectSource::Standing | ObjectSource::Cluster => {
                foreground(scene, &view.camera).as_raw().iter().map(|value| *value > 0).collect()
            }
        };
        let knows_foreground = photo.foreground_source != ForegroundSource::Whole;
        let known = |iou: Option<f64>| knows_foreground.then_some(iou.unwrap_or(1.0));
        let fit = ViewFit {
            name: view.name.clone(),
            flaw: None,
            psnr_db: psnr_db(&photo.rgb, &picture),
            mask_iou: known(mask_iou(&photo.foreground, &object)),
            overlap: known(overlap(&photo.foreground, &object, &all)),
        };
        bar.inc(1);
        Ok(fit)
    };
    let fits = views.iter().map(fit).collect();
    bar.finish_and_clear();
    fits
}

/// The photo, white outside its mask if the splat shows the object alone: like a photo with alpha, which is over white.
pub(super) fn as_the_splat_shows(scene: &Scene, mut photo: Photo) -> Photo {
    const WHITE: Rgb<u8> = Rgb([255; 3]);
    if scene.object_source == ObjectSource::Whole && photo.foreground_source == ForegroundSource::Mask {
        for (pixel, inside) in photo.rgb.pixels_mut().zip(photo.foreground.as_raw()) {
            if *inside == 0 {
                *pixel = WHITE;
            }
        }
    }
    photo
}

/// 10 log10(1 / mean squared error) of the colours (each channel 0 to 1), with the picture over white like the photo; at
/// most [`EQUAL_DB`].
pub(super) fn psnr_db(photo: &RgbImage, picture: &Render) -> f64 {
    let mut sum = 0.0;
    for ((photo, color), alpha) in photo.pixels().zip(&picture.rgb).zip(&picture.alpha) {
        for (channel, value) in photo.0.iter().zip(color) {
            let shown = (value + 1.0 - alpha).clamp(0.0, 1.0);
            let error = f64::from(shown) - f64::from(*channel) / 255.0;
            sum += error * error;
        }
    }
    let mean = sum / (3 * picture.rgb.len()).max(1) as f64;
    (-10.0 * mean.log10()).min(EQUAL_DB)
}

/// Whether each pixel shows the splat.
pub(super) fn covered(picture: &Render) -> Vec<bool> {
    picture.alpha.iter().map(|alpha| *alpha >= FOREGROUND_ALPHA).collect()
}

/// [`mask_iou`] of the object or, if that is larger, of all Gaussians: `--object-box` may hold only some of what the
/// photos' masks or alpha show. But then the object lies inside the foreground, so the share of its area that does is a
/// limit for the latter. `None` if neither the photo nor the splat shows the object, whatever surrounds it.
pub(super) fn overlap(coverage: &GrayImage, object: &[bool], all: &[bool]) -> Option<f64> {
    let inside =
        coverage.as_raw().iter().zip(object).filter(|(coverage, object)| **object && **coverage >= HALF).count();
    let share = inside as f64 / object.iter().filter(|object| **object).count().max(1) as f64;
    let of_object = mask_iou(coverage, object)?;
    Some(mask_iou(coverage, all).map_or(of_object, |of_all| of_object.max(of_all.min(share))))
}

/// Intersection over union of the object in a photo, at least half covered there, and in the splat; `None` if neither
/// shows it.
fn mask_iou(coverage: &GrayImage, in_splat: &[bool]) -> Option<f64> {
    let (mut both, mut either) = (0usize, 0usize);
    for (coverage, splat) in coverage.as_raw().iter().zip(in_splat) {
        let photo = *coverage >= HALF;
        both += usize::from(photo && *splat);
        either += usize::from(photo || *splat);
    }
    (either > 0).then(|| both as f64 / either as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Foreground in the left six of ten pixels, a splat that is everywhere.
    #[test]
    fn a_splat_that_is_everywhere_vouches_for_no_object_beside_the_foreground() {
        let coverage = GrayImage::from_fn(10, 1, |x, _| image::Luma([if x < 6 { 255 } else { 0 }]));
        let between = |from: usize, to: usize| -> Vec<bool> { (0..10).map(|x| (from..to).contains(&x)).collect() };
        let all = between(0, 10);
        assert_eq!(overlap(&coverage, &between(6, 10), &all), Some(0.0));
        assert_eq!(overlap(&coverage, &between(0, 2), &all), Some(0.6), "of all");
        assert_eq!(overlap(&coverage, &between(0, 5), &all), Some(5.0 / 6.0), "of the object");
        assert_eq!(overlap(&coverage, &between(0, 0), &all), Some(0.0), "the object is only in the photo");
        assert_eq!(overlap(&GrayImage::new(10, 1), &between(0, 0), &all), None, "the object is out of the picture");
    }
}
