//! PSNR and mask overlap between each photo and the splat seen from its camera.

use image::{GrayImage, Rgb, RgbImage};

use super::ViewFit;
use crate::from_splat::foreground;
use crate::progress::Progress;
use crate::render::{FOREGROUND_ALPHA, Render, RenderOptions, render};
use crate::scene::{ForegroundSource, ObjectSource, Photo, Scene, SceneError, View};

/// Compares every view, one after the other: the rasteriser uses all threads.
pub(super) fn compare(scene: &Scene, views: &[View], progress: Progress) -> Result<Vec<ViewFit>, SceneError> {
    let cloud = scene.whole_cloud();
    let bar = progress.bar("inspect", views.len() as u64).with_message("views");
    let fit = |view: &View| {
        let photo = as_the_splat_shows(scene, view.photo()?);
        let picture = render(&cloud, &view.camera, &RenderOptions::default());
        let of_all = || mask_iou(&photo.foreground, covered(&picture)).unwrap_or(1.0);
        let of_object = || match scene.object_source {
            ObjectSource::Whole => of_all(),
            // Surroundings may hide some of the object.
            ObjectSource::Box | ObjectSource::Cluster => {
                let object = foreground(scene, &view.camera);
                mask_iou(&photo.foreground, object.as_raw().iter().map(|value| *value > 0)).unwrap_or(1.0)
            }
        };
        let knows_foreground = photo.foreground_source != ForegroundSource::Whole;
        let iou = knows_foreground.then(of_object);
        let fit = ViewFit {
            name: view.name.clone(),
            psnr_db: psnr_db(&photo.rgb, &picture),
            mask_iou: iou,
            overlap: iou.map(|iou| iou.max(of_all())),
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
/// most 99, which stands for equal pictures.
fn psnr_db(photo: &RgbImage, picture: &Render) -> f64 {
    const EQUAL: f64 = 99.0;
    let mut sum = 0.0;
    for ((photo, color), alpha) in photo.pixels().zip(&picture.rgb).zip(&picture.alpha) {
        for (channel, value) in photo.0.iter().zip(color) {
            let shown = (value + 1.0 - alpha).clamp(0.0, 1.0);
            let error = f64::from(shown) - f64::from(*channel) / 255.0;
            sum += error * error;
        }
    }
    let mean = sum / (3 * picture.rgb.len()).max(1) as f64;
    (-10.0 * mean.log10()).min(EQUAL)
}

/// Whether each pixel shows the splat.
pub(super) fn covered(picture: &Render) -> impl Iterator<Item = bool> {
    picture.alpha.iter().map(|alpha| *alpha >= FOREGROUND_ALPHA)
}

/// Intersection over union of the object in a photo, at least half covered there, and in the splat; `None` if neither
/// shows it.
pub(super) fn mask_iou(coverage: &GrayImage, in_splat: impl Iterator<Item = bool>) -> Option<f64> {
    let (mut both, mut either) = (0usize, 0usize);
    for (coverage, splat) in coverage.as_raw().iter().zip(in_splat) {
        let photo = *coverage >= 128;
        both += usize::from(photo && splat);
        either += usize::from(photo || splat);
    }
    (either > 0).then(|| both as f64 / either as f64)
}
