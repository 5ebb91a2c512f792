//! A quick look at a few views, for every run: whether the splat can be that of the photos at all.

use std::borrow::Cow;
use std::sync::OnceLock;

use image::imageops::{FilterType, resize};

use super::compare::{covered, overlap};
use super::verdict::{self, LEAST_CORRELATION};
use crate::gaussians::Gaussians;
use crate::numeric::{evenly, upper_median};
use crate::parallel;
use crate::render::{RenderOptions, render};
use crate::scene::{Scene, SceneError, View};
use crate::words::progress::Progress;

/// Number of views looked at.
const VIEWS: usize = 4;
/// Longest side of the small masks in pixels.
const SIDE: u32 = 192;
/// Minimum overlap of the object's outline in the photos and in the splat: below it, most of what either shows is not
/// in the other. On the fixtures and the six objects that thresholds were fitted on, the median over all views is 0.95 or more.
const LEAST_IOU: f64 = 0.5;

/// A warning if the photos show another object than the splat, or the same one from other sides. Photos with a mask or
/// alpha are judged by the object's outline, others by their correlation with the splat.
///
/// # Errors
/// If a photo or a mask cannot be read.
pub fn misfit(scene: &Scene, views: &[View]) -> Result<Option<String>, SceneError> {
    let few: Vec<View> = evenly(views, VIEWS).cloned().collect();
    let whole = OnceLock::new();
    let overlaps: Vec<Option<f64>> = parallel::try_map(&few, |view| overlap_in(scene, view, &whole))?;
    let problem = match upper_median(overlaps.into_iter().flatten().collect()) {
        Some(iou) if iou < LEAST_IOU => {
            format!("the object's outlines in the photos and in the splat overlap by only {:.0} %", 100.0 * iou)
        }
        Some(_) => return Ok(None),
        None => match verdict::of(scene, &few, &[], Progress::HIDDEN)? {
            Some(verdict) if verdict.correlation < LEAST_CORRELATION => {
                format!("photos and splat differ: their correlation is only {:.2}", verdict.correlation)
            }
            Some(verdict) if !verdict.aligned => {
                "the photos fit the splat no better from their own cameras than from those of other views".to_owned()
            }
            _ => return Ok(None),
        },
    };
    Ok(Some(format!(
        "{problem}: either they show different objects, or cameras and splat do not share a coordinate frame. In \
         both cases all results are meaningless; see `gprop inspect`, which tries what could mend it"
    )))
}

/// The [`overlap`] in a small picture; `None` if the photo has neither mask nor alpha. `whole` is all of the splat, once it
/// is needed.
fn overlap_in<'a>(
    scene: &'a Scene,
    view: &View,
    whole: &OnceLock<Cow<'a, Gaussians>>,
) -> Result<Option<f64>, SceneError> {
    let Some(coverage) = view.coverage()? else { return Ok(None) };
    let camera = verdict::resized(&view.camera, SIDE.min(coverage.width().max(coverage.height())));
    let small = resize(&coverage, camera.intrinsics.width, camera.intrinsics.height, FilterType::Triangle);
    let shown = |cloud: &Gaussians| covered(&render(cloud, &camera, &RenderOptions::default()));
    let object = shown(&scene.gaussians);
    let all =
        if scene.surroundings.is_empty() { object.clone() } else { shown(whole.get_or_init(|| scene.whole_cloud())) };
    Ok(overlap(&small, &object, &all))
}
