//! The viewpoint and the cropping of a picture: the view that shows most of the object, cropped to it.

use std::collections::BTreeMap;

use image::{DynamicImage, RgbImage, imageops};

use crate::camera::{Camera, Intrinsics};
use crate::gaussians::Gaussians;
use crate::query::question::sheet::panel::{Area, bounding_box};
use crate::render::{Colors, FOREGROUND_ALPHA, RenderOptions, render, render_labels};
use crate::scene::Photo;

/// Longest side of the pictures that measure how much a camera sees, px.
const LOOK_PX: u32 = 160;
/// A part shows in such a picture if it has this many pixels.
const SHOWN_PX: usize = 12;

/// The camera that shows most of the object: the largest product of the area of its outline, in scene units, and the
/// number of parts in sight; `parts[i]` is the part of Gaussian `i`. A camera that is so near that the object does not
/// fit into its picture sees less of the outline. Among equals the first; `None` if there is no camera.
pub fn shows_most<'a>(
    cameras: impl Iterator<Item = &'a Camera>,
    gaussians: &Gaussians,
    parts: &[u32],
) -> Option<usize> {
    let shown: Vec<f64> = cameras.map(|camera| shown(camera, gaussians, parts)).collect();
    (0..shown.len()).rev().max_by(|a, b| shown[*a].total_cmp(&shown[*b]))
}

fn shown(camera: &Camera, gaussians: &Gaussians, parts: &[u32]) -> f64 {
    let i = camera.intrinsics;
    let longest = i.width.max(i.height).max(1);
    let side = |length: u32| (length * LOOK_PX / longest).max(1);
    let small = Camera { intrinsics: i.resized(side(i.width), side(i.height)), ..camera.clone() };
    let colors = vec![[0.0; 3]; gaussians.len()];
    let options = RenderOptions { colors: Colors::Fixed(&colors), ..RenderOptions::default() };
    let seen = render(gaussians, &small, &options);
    let pixels = seen.alpha.iter().zip(&seen.median_depth);
    let covered = pixels.filter(|(alpha, depth)| **alpha >= FOREGROUND_ALPHA && depth.is_finite());
    let area: f64 = covered.map(|(_, depth)| f64::from(*depth).powi(2)).sum();
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    for part in render_labels(gaussians, &small, parts, &options).into_iter().flatten() {
        *counts.entry(part).or_default() += 1;
    }
    let in_sight = counts.values().filter(|count| **count >= SHOWN_PX).count();
    area / (small.intrinsics.fx * small.intrinsics.fy) * in_sight as f64
}

/// A camera's picture cropped to the object.
pub struct Framing {
    /// The area of the photo that the picture shows.
    area: Area,
    /// The camera of the picture.
    pub camera: Camera,
}

impl Framing {
    /// The object in `photo`, which `camera` took, with a margin; the longest side of the picture is `longest_side`
    /// pixels, and a narrow object gets surroundings until the picture is `narrowest` times as wide as high, as far as
    /// the photo reaches.
    pub fn new(camera: &Camera, photo: &Photo, longest_side: u32, narrowest: f64) -> Self {
        let (width, height) = photo.rgb.dimensions();
        let whole = Area { x0: 0, y0: 0, x1: width, y1: height };
        let object = bounding_box(&photo.foreground).map_or(whole, |object| object.with_margin(width, height));
        let area = widened(object, narrowest, width);
        let longest = area.width().max(area.height());
        let fitted = |length: u32| (u64::from(length) * u64::from(longest_side) / u64::from(longest)).max(1) as u32;
        let seen = Intrinsics {
            width: area.width(),
            height: area.height(),
            cx: camera.intrinsics.cx - f64::from(area.x0),
            cy: camera.intrinsics.cy - f64::from(area.y0),
            ..camera.intrinsics
        };
        let intrinsics = seen.resized(fitted(area.width()), fitted(area.height()));
        Self { area, camera: Camera { intrinsics, ..camera.clone() } }
    }

    /// Width and height of the picture.
    pub fn size(&self) -> (u32, u32) {
        (self.camera.intrinsics.width, self.camera.intrinsics.height)
    }

    pub fn photo(&self, photo: &Photo) -> RgbImage {
        let Area { x0, y0, .. } = self.area;
        let cut = imageops::crop_imm(&photo.rgb, x0, y0, self.area.width(), self.area.height()).to_image();
        let (width, height) = self.size();
        if width < cut.width() {
            return imageops::thumbnail(&cut, width, height);
        }
        imageops::resize(&cut, width, height, imageops::FilterType::CatmullRom)
    }

    /// The Gaussians in these colours, on white.
    pub fn colored(&self, gaussians: &Gaussians, colors: &[[f32; 3]]) -> RgbImage {
        let options = RenderOptions { colors: Colors::Fixed(colors), ..RenderOptions::default() };
        DynamicImage::ImageRgba8(render(gaussians, &self.camera, &options).to_image([1.0; 3])).into_rgb8()
    }

    /// The label on every pixel, row by row.
    pub fn labels(&self, gaussians: &Gaussians, labels: &[u32]) -> Vec<Option<u32>> {
        render_labels(gaussians, &self.camera, labels, &RenderOptions::default())
    }

    /// Pixels per metre at the depth of the middle of the object.
    pub fn pixels_per_meter(&self, gaussians: &Gaussians, meters_per_unit: f64) -> f64 {
        let middle = crate::scene::robust_bounds(gaussians).center();
        self.camera.intrinsics.fx / (self.camera.point_in_camera(middle).z * meters_per_unit)
    }
}

/// The area, at least `narrowest` times as wide as high if a picture of `width` pixels has the room.
fn widened(area: Area, narrowest: f64, width: u32) -> Area {
    let wanted = ((f64::from(area.height()) * narrowest) as u32).clamp(area.width(), width.max(area.width()));
    let left = (wanted - area.width()) / 2;
    let x0 = area.x0.saturating_sub(left).min(width.saturating_sub(wanted));
    Area { x0, x1: x0 + wanted, ..area }
}

/// For each label, a pixel as far inside a place that shows it as possible. `None` for a label without a pixel, apart
/// from those on the picture's edge. `labels` are those of the pixels of a picture of `width` pixels, row by row.
pub fn middles(labels: &[Option<u32>], width: usize, count: usize) -> Vec<Option<(u32, u32)>> {
    let height = labels.len() / width.max(1);
    let mut depth = vec![0u32; labels.len()];
    let index_at = |x: usize, y: usize| y * width + x;
    // City-block distance to the next other label or to the picture's edge: forwards, then backwards.
    for y in 1..height.saturating_sub(1) {
        for x in 1..width - 1 {
            let here = labels[index_at(x, y)];
            let near = |other: usize| if labels[other] == here { depth[other] } else { 0 };
            depth[index_at(x, y)] = 1 + near(index_at(x - 1, y)).min(near(index_at(x, y - 1)));
        }
    }
    let mut best: Vec<Option<(u32, usize)>> = vec![None; count];
    for y in (1..height.saturating_sub(1)).rev() {
        for x in (1..width - 1).rev() {
            let here = labels[index_at(x, y)];
            let near = |other: usize| if labels[other] == here { depth[other] } else { 0 };
            let least = 1 + near(index_at(x + 1, y)).min(near(index_at(x, y + 1)));
            depth[index_at(x, y)] = depth[index_at(x, y)].min(least);
            let Some(best) = here.and_then(|label| best.get_mut(label as usize)) else { continue };
            if best.is_none_or(|(most, _)| depth[index_at(x, y)] >= most) {
                *best = Some((depth[index_at(x, y)], index_at(x, y)));
            }
        }
    }
    best.into_iter().map(|found| found.map(|(_, at)| ((at % width) as u32, (at / width) as u32))).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, Vector3};

    use super::*;
    use crate::camera::Distortion;

    /// A camera at `eye` that looks at `target`.
    fn camera(eye: [f64; 3], target: [f64; 3]) -> Camera {
        let intrinsics = Intrinsics {
            width: 400,
            height: 300,
            fx: 400.0,
            fy: 400.0,
            cx: 200.0,
            cy: 150.0,
            distortion: Distortion::default(),
        };
        let world_from_camera = Isometry3::face_towards(&Point3::from(eye), &Point3::from(target), &-Vector3::z());
        Camera { intrinsics, camera_from_world: world_from_camera.inverse() }
    }

    #[test]
    fn the_view_of_the_whole_object_is_chosen() {
        // A plate of 2 x 1 in the plane y = 0: a body and, to the right, a leg.
        let places = (0..40).flat_map(|x| (0..20).map(move |z| [0.05 * x as f32 - 1.0, 0.0, 0.05 * z as f32 - 0.5]));
        let mut gaussians = Gaussians { positions: places.collect(), ..Gaussians::default() };
        let count = gaussians.positions.len();
        gaussians.log_scales = vec![[(0.03f32).ln(); 3]; count];
        gaussians.rotations = vec![[1.0, 0.0, 0.0, 0.0]; count];
        gaussians.opacity_logits = vec![4.0; count];
        gaussians.sh_dc = vec![[0.0; 3]; count];
        let parts: Vec<u32> = gaussians.positions.iter().map(|place| u32::from(place[0] > 0.7)).collect();
        let near_the_leg = camera([0.9, -0.6, 0.0], [0.9, 0.0, 0.0]);
        let from_the_edge = camera([4.0, -0.3, 0.0], [0.0, 0.0, 0.0]);
        let whole = camera([0.0, -4.0, 0.5], [0.0, 0.0, 0.0]);
        let cameras = [near_the_leg, from_the_edge, whole.clone(), whole];
        assert_eq!(shows_most(cameras.iter(), &gaussians, &parts), Some(2));
        assert_eq!(shows_most([].iter(), &gaussians, &parts), None);
    }

    #[test]
    fn a_narrow_area_is_widened_within_the_picture() {
        let area = Area { x0: 10, y0: 0, x1: 30, y1: 100 };
        assert_eq!(widened(area, 0.5, 400), Area { x0: 0, y0: 0, x1: 50, y1: 100 });
        assert_eq!(widened(area, 0.5, 40), Area { x0: 0, y0: 0, x1: 40, y1: 100 });
        assert_eq!(widened(area, 0.1, 400), area);
        let right = Area { x0: 380, y0: 0, x1: 400, y1: 100 };
        assert_eq!(widened(right, 0.5, 400), Area { x0: 350, y0: 0, x1: 400, y1: 100 });
    }

    #[test]
    fn the_middle_of_a_label_is_inside_its_largest_place() {
        // Label 0 is a square of 9 and a square of 3; label 1 a stripe; label 2 is nowhere.
        let (width, height) = (40, 20);
        let label = |x: usize, y: usize| match (x, y) {
            (2..=10, 4..=12) | (30..=32, 4..=6) => Some(0),
            (1..=38, 16..=17) => Some(1),
            _ => None,
        };
        let labels: Vec<_> = (0..height).flat_map(|y| (0..width).map(move |x| label(x, y))).collect();
        let found = middles(&labels, width, 3);
        assert_eq!(found[0], Some((6, 8)));
        assert!(matches!(found[1], Some((_, 16..=17))));
        assert_eq!(found[2], None);
        assert_eq!(middles(&[], 0, 1), [None]);
    }
}
