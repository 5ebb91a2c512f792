//! The pixels on which the object's Gaussians are seen, taking surroundings in front of them into account.

use image::{GrayImage, Luma};

use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::render::{Colors, FOREGROUND_ALPHA, RenderOptions, close_holes, render};
use crate::scene::{ForegroundSource, Photo, Scene, SceneError, View};

/// 255 where at least half of the pixel's light comes from the object's Gaussians, and in [highlights](close_holes) that they enclose; 0
/// elsewhere.
pub fn foreground(scene: &Scene, camera: &Camera) -> GrayImage {
    foreground_of(&scene.whole_cloud(), |i| i < scene.gaussians.len(), camera)
}

/// The same for those of the Gaussians of `cloud` that `is_own` chooses by index.
pub fn foreground_of(cloud: &Gaussians, is_own: impl Fn(usize) -> bool, camera: &Camera) -> GrayImage {
    // The object is rendered white, the rest black, so the brightness is the object's share of the light.
    let glow = |i: usize| if is_own(i) { [1.0; 3] } else { [0.0; 3] };
    let colors: Vec<[f32; 3]> = (0..cloud.len()).map(glow).collect();
    let options = RenderOptions { colors: Colors::Fixed(&colors), ..RenderOptions::default() };
    let picture = render(cloud, camera, &options);
    let mut share: Vec<f32> = picture.rgb.iter().map(|[share, ..]| *share).collect();
    close_holes(&mut share, picture.width as usize);
    GrayImage::from_fn(picture.width, picture.height, |x, y| {
        let share = share[(y * picture.width + x) as usize];
        Luma([if share >= FOREGROUND_ALPHA { 255 } else { 0 }])
    })
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
