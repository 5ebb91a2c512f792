//! Photos reduced once, from which the search takes pictures of any smaller size, and the splat to compare with them.

use image::imageops::{FilterType, crop_imm, resize};
use image::{GrayImage, Luma, Rgb, Rgb32FImage, RgbImage, buffer::ConvertBuffer};
use nalgebra::{Point2, Similarity3, Vector2, Vector3};

use crate::camera::{Camera, Intrinsics};
use crate::gaussians::Gaussians;
use crate::inspect::compare::as_the_splat_shows;
use crate::inspect::verdict::{Small, picture, resized};
use crate::render::{RenderOptions, render};
use crate::scene::cameras::align::moved;
use crate::scene::{ForegroundSource, ObjectSource, Photo, Scene, SceneError, View};

/// Longest side of a reduced photo in pixels: the largest that the search looks at.
pub(super) const LARGEST: u32 = 192;
/// A photo with an outline is cut to a square of so many radii of the outline on each side of its centre: that holds the
/// outline of a rod, which reaches to 1.7, in a wrong place too.
const KEPT_RADII: f64 = 3.0;

/// A photo as the splat should show it, reduced.
pub(super) struct Reduced {
    /// Of the reduced picture, in the cameras' world.
    pub camera: Camera,
    rgb: Rgb32FImage,
    /// Where the photo shows what the splat shows; `None` if it does not tell.
    pub outline: Option<Blob>,
}

impl Reduced {
    pub fn new(scene: &Scene, view: &View) -> Result<Self, SceneError> {
        let photo = as_the_splat_shows(scene, view.photo()?);
        let whole = Window { x: 0, y: 0, width: photo.rgb.width(), height: photo.rgb.height() };
        let outline = outline(scene, &photo).and_then(|outline| Blob::of(&outline));
        let kept = outline.as_ref().map_or(whole, |blob| whole.around(blob));
        let camera = smaller(&kept.camera(&view.camera), LARGEST);
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let cut = crop_imm(&photo.rgb, kept.x, kept.y, kept.width, kept.height).to_image();
        let rgb: Rgb32FImage = resize(&cut, width, height, FilterType::Triangle).convert();
        let outline = outline.map(|blob| blob.within(&kept, f64::from(width) / f64::from(kept.width)));
        Ok(Self { camera, rgb, outline })
    }

    /// The photo with `side` pixels along the longer side.
    pub fn at(&self, side: u32) -> Small {
        let camera = smaller(&self.camera, side);
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        Small { camera, picture: resize(&self.rgb, width, height, FilterType::Triangle).into_raw() }
    }
}

/// A part of a photo, in pixels.
#[derive(Clone, Copy)]
struct Window {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl Window {
    /// The part of this one around the outline.
    fn around(&self, blob: &Blob) -> Self {
        let span = |center: f64, length: u32| {
            let (low, high) = (center - KEPT_RADII * blob.radius, center + KEPT_RADII * blob.radius);
            let first = (low.max(0.0) as u32).min(length - 1);
            (first, (high.ceil() as u32).clamp(first + 1, length) - first)
        };
        let ((x, width), (y, height)) = (span(blob.center.x, self.width), span(blob.center.y, self.height));
        Self { x, y, width, height }
    }

    /// The camera of this part of its photo.
    fn camera(&self, camera: &Camera) -> Camera {
        let i = camera.intrinsics;
        let (cx, cy) = (i.cx - f64::from(self.x), i.cy - f64::from(self.y));
        Camera { intrinsics: Intrinsics { width: self.width, height: self.height, cx, cy, ..i }, ..camera.clone() }
    }
}

fn smaller(camera: &Camera, side: u32) -> Camera {
    resized(camera, side.min(camera.intrinsics.width.max(camera.intrinsics.height)))
}

/// The splat as the camera sees it after the similarity, from the cameras' world to the splat's.
pub(super) fn drawn(cloud: &Gaussians, camera: &Camera, similarity: &Similarity3<f64>) -> Vec<f32> {
    picture(cloud, &after(camera, similarity), &RenderOptions::default())
}

/// As [`drawn`], in a quarter of the pixels: thin things are wider than they should be, but move as they do there.
pub(super) fn sketched(cloud: &Gaussians, camera: &Camera, similarity: &Similarity3<f64>) -> Vec<f32> {
    let picture = render(cloud, &after(camera, similarity), &RenderOptions::default());
    picture.rgb.iter().zip(&picture.alpha).flat_map(|(color, alpha)| color.map(|value| value + 1.0 - alpha)).collect()
}

/// The camera in the splat's world.
pub(super) fn after(camera: &Camera, similarity: &Similarity3<f64>) -> Camera {
    Camera { camera_from_world: moved(&camera.camera_from_world, similarity), ..camera.clone() }
}

/// The outline of something in a picture: its centre and its root mean square radius in pixels.
pub(super) struct Blob {
    center: Point2<f64>,
    radius: f64,
}

impl Blob {
    /// `None` if the picture is black.
    fn of(outline: &GrayImage) -> Option<Self> {
        let pixels = || {
            let place = |x: u32, y: u32| Vector2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            outline.enumerate_pixels().map(move |(x, y, value)| (place(x, y), f64::from(value[0]) / 255.0))
        };
        let sum: f64 = pixels().map(|(_, weight)| weight).sum();
        let center = pixels().map(|(place, weight)| place * weight).sum::<Vector2<f64>>() / sum;
        let square = pixels().map(|(place, weight)| (place - center).norm_squared() * weight).sum::<f64>() / sum;
        (sum >= 1.0 && square > 0.0).then(|| Self { center: center.into(), radius: square.sqrt() })
    }

    /// The same outline in the window, reduced by `factor`.
    fn within(&self, window: &Window, factor: f64) -> Self {
        let corner = Vector2::new(f64::from(window.x), f64::from(window.y));
        Self { center: ((self.center.coords - corner) * factor).into(), radius: self.radius * factor }
    }

    /// The direction of its centre in the frame of the camera, with z = 1; without lens distortion, which moves little in the
    /// middle of a photo.
    pub fn direction(&self, camera: &Camera) -> Vector3<f64> {
        let i = &camera.intrinsics;
        Vector3::new((self.center.x - i.cx) / i.fx, (self.center.y - i.cy) / i.fy, 1.0)
    }

    /// Its radius at a depth of 1.
    pub fn tangent(&self, camera: &Camera) -> f64 {
        self.radius / camera.intrinsics.fx
    }
}

/// White on what the splat shows: the photo's foreground if the splat is of that alone, or else what is not white in a photo
/// on white; `None` if the photo is neither.
fn outline(scene: &Scene, photo: &Photo) -> Option<GrayImage> {
    match (scene.object_source, photo.foreground_source) {
        (ObjectSource::Box, _) => None,
        (ObjectSource::Whole, ForegroundSource::Alpha | ForegroundSource::Mask) => Some(photo.foreground.clone()),
        _ => on_white(&photo.rgb),
    }
}

/// White on every pixel that is not, if nearly all pixels at the photo's border are white.
fn on_white(photo: &RgbImage) -> Option<GrayImage> {
    /// Compression changes white a little.
    const WHITE: u8 = 248;
    /// Share of the border's pixels.
    const NEARLY_ALL: f64 = 0.95;
    let (width, height) = photo.dimensions();
    let is_white = |pixel: &Rgb<u8>| pixel.0.iter().all(|channel| *channel >= WHITE);
    let at_border = |x: u32, y: u32| x == 0 || y == 0 || x + 1 == width || y + 1 == height;
    let border: Vec<bool> =
        photo.enumerate_pixels().filter(|(x, y, _)| at_border(*x, *y)).map(|(_, _, pixel)| is_white(pixel)).collect();
    let white = border.iter().filter(|white| **white).count();
    (white as f64 >= NEARLY_ALL * border.len() as f64).then(|| {
        GrayImage::from_fn(width, height, |x, y| Luma([if is_white(photo.get_pixel(x, y)) { 0 } else { 255 }]))
    })
}

/// Blurs a picture of three values per pixel: `passes` times by the weights 1, 2, 1 along both axes, each of which adds half
/// a square pixel to the variance of the blur.
pub(super) fn blur(picture: &mut [f32], width: usize, passes: usize) {
    let row = 3 * width;
    let height = picture.len() / row.max(1);
    for _ in 0..passes {
        for y in 0..height {
            smooth(picture, y * row, 3, width);
        }
        for x in 0..width {
            smooth(picture, 3 * x, row, height);
        }
    }
}

/// One pass along `count` pixels, `step` values apart, of which the first begins at `first`. Beyond the ends the picture
/// goes on as it ends.
fn smooth(picture: &mut [f32], first: usize, step: usize, count: usize) {
    for channel in first..first + 3 {
        let mut before = picture[channel];
        for index in 0..count {
            let at = channel + index * step;
            let here = picture[at];
            let after = if index + 1 < count { picture[at + step] } else { here };
            picture[at] = 0.25 * (before + after) + 0.5 * here;
            before = here;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blur_keeps_the_light_and_spreads_it_by_half_a_square_pixel_per_pass() {
        const SIDE: usize = 21;
        const PASSES: usize = 4;
        let mut picture = vec![0.0; 3 * SIDE * SIDE];
        picture[3 * (SIDE * SIDE / 2) + 1] = 1.0;
        blur(&mut picture, SIDE, PASSES);
        let lit = || picture.iter().enumerate().filter(|(_, value)| **value > 0.0);
        assert!(lit().all(|(at, _)| at % 3 == 1), "channels stay apart");
        let sum: f32 = lit().map(|(_, value)| value).sum();
        let off = |at: usize| (at / 3 % SIDE) as f32 - (SIDE / 2) as f32;
        let variance: f32 = lit().map(|(at, value)| value * off(at).powi(2)).sum();
        // Sums of powers of two, exact in f32.
        assert_eq!((sum, variance), (1.0, 0.5 * PASSES as f32));
        let mut even = vec![0.5; 3 * 4 * 2];
        blur(&mut even, 4, PASSES);
        assert_eq!(even, [0.5; 3 * 4 * 2]);
    }

    #[test]
    fn only_a_photo_on_white_shows_an_outline_by_itself() {
        let square = |background: u8| {
            RgbImage::from_fn(40, 40, |x, y| {
                let inside = (10..20).contains(&x) && (20..30).contains(&y);
                Rgb([if inside { 90 } else { background }; 3])
            })
        };
        assert!(on_white(&square(200)).is_none());
        let blob = Blob::of(&on_white(&square(255)).unwrap()).unwrap();
        assert_eq!((blob.center.x, blob.center.y), (15.0, 25.0));
        // Of a square of 10 x 10 pixels: the root of 2 (10^2 - 1) / 12.
        assert!((blob.radius - 16.5f64.sqrt()).abs() < 1e-9, "{}", blob.radius);
    }
}
