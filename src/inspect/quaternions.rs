//! Notices a splat whose quaternions have their real part last: the photos fit better if it is read so.

use super::ViewFit;
use super::compare::{as_the_splat_shows, psnr_db};
use crate::render::{RenderOptions, render};
use crate::scene::{Options, QuaternionOrder, Scene, SceneError, View};

/// Number of views that are drawn in the other order.
const VIEWS: usize = 3;
/// By how much each of them must gain, in dB. A trained splat loses by being read in the wrong order.
const LEAST_GAIN_DB: f64 = 1.0;

/// A warning if the photos fit the splat better with its quaternions read as x y z w. `fits`: how the views fit as it is.
pub(super) fn warning(
    scene: &Scene,
    views: &[View],
    fits: &[ViewFit],
    options: &Options,
) -> Result<Option<String>, SceneError> {
    if options.quaternions != QuaternionOrder::Wxyz || views.is_empty() {
        return Ok(None);
    }
    // The order is that of the file, in whose frame the numbers are.
    let mut cloud = scene.in_input_frame().whole_cloud().into_owned();
    QuaternionOrder::Xyzw.apply(&mut cloud);
    let (mut before, mut after) = (0.0, 0.0);
    let few: Vec<(&View, &ViewFit)> = views.iter().zip(fits).step_by(views.len().div_ceil(VIEWS)).collect();
    for (view, fit) in &few {
        let photo = as_the_splat_shows(scene, view.photo()?);
        let psnr_db =
            psnr_db(&photo.rgb, &render(&cloud, &scene.camera_in_input(&view.camera), &RenderOptions::default()));
        if psnr_db < fit.psnr_db + LEAST_GAIN_DB {
            return Ok(None);
        }
        before += fit.psnr_db / few.len() as f64;
        after += psnr_db / few.len() as f64;
    }
    Ok(Some(format!(
        "the splat's quaternions look like x y z w instead of w x y z: read so, its pictures fit the photos with a PSNR of \
         {after:.1} instead of {before:.1} dB. Add --quaternions xyzw to every command, or export the splat again"
    )))
}
