//! The pixels on which the object's Gaussians are seen, taking surroundings in front of them into account.

use image::{GrayImage, Luma};

use crate::camera::Camera;
use crate::render::render_foregrounds;
use crate::scene::{ForegroundSource, Photo, Scene, SceneError, View};

/// 255 on the [pixels](render_foregrounds) that show the object, 0 elsewhere.
pub fn foreground(scene: &Scene, camera: &Camera) -> GrayImage {
    let cloud = scene.whole_cloud();
    let labels: Vec<u32> = (0..cloud.len()).map(|i| u32::from(i < scene.gaussians.len())).collect();
    let shown = render_foregrounds(&cloud, camera, &labels);
    let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
    let value = |x, y| if shown[(y * width + x) as usize].is_some() { 255 } else { 0 };
    GrayImage::from_fn(width, height, |x, y| Luma([value(x, y)]))
}

/// The photo of a view; if neither alpha nor a mask gives its foreground, it is taken from the Gaussians.
///
/// # Errors
/// [`SceneError`] as in [`View::photo`].
pub fn photo_with_foreground(scene: &Scene, view: &View) -> Result<Photo, SceneError> {
    let mut photo = view.photo()?;
    if photo.foreground_source == ForegroundSource::Whole {
        photo.foreground = foreground(scene, &view.camera);
        photo.foreground_source = ForegroundSource::Gaussians;
    }
    Ok(photo)
}
