//! The best views in which to ask about a part: those that show it large, sharp and from different sides.

use image::RgbImage;
use nalgebra::{Point3, Vector3};

use super::Parts;
use crate::camera::Camera;
use crate::gaussians::Gaussians;
use crate::parallel;
use crate::segment::LabelMap;

/// A view shows a part if this many of the part's pixels lie inside its mask, not on the mask's edge: a line two pixels
/// wide has none.
const LEAST_INSIDE: u32 = 16;
/// Even the most blurred view still counts this much of a sharp one: a blurred picture of the whole part shows more
/// than a sharp one of its rim.
const BLURRED_WORTH: f64 = 0.5;
/// Two views this far apart show different sides of a part; nearer ones count less, down to [`SAME_SIDE_WORTH`].
const OTHER_SIDE_DEG: f64 = 60.0;
const SAME_SIDE_WORTH: f64 = 0.25;

/// A view that shows a part.
#[derive(Debug, Clone, PartialEq)]
pub struct PartView {
    /// Index of the view.
    pub view: usize,
    /// Number of pixels that show the part.
    pub pixels: u32,
}

/// For every part and piece, by id - 1, the views that show it, the best ones to ask about it in first.
pub fn best_views(
    gaussians: &Gaussians,
    parts: &Parts,
    cameras: &[&Camera],
    maps: &[&LabelMap],
    sharpness: &[impl AsRef<[f32]> + Sync],
) -> Vec<Vec<PartView>> {
    let shown: Vec<Vec<Shown>> =
        parallel::map_range(maps.len(), |view| shown(parts, maps[view], sharpness[view].as_ref()));
    let centers = centers(gaussians, parts);
    (0..parts.parts.len()).map(|index| order(centers[index], cameras, &shown, index)).collect()
}

/// The gradient of the picture's brightness at every pixel, from which blur is judged.
pub fn sharpness(photo: &RgbImage) -> Vec<f32> {
    let (width, height) = photo.dimensions();
    let grey = |x: u32, y: u32| photo.get_pixel(x, y).0.iter().map(|&value| f32::from(value)).sum::<f32>() / 3.0;
    let mut gradient = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let here = grey(x, y);
            let right = grey((x + 1).min(width - 1), y) - here;
            let below = grey(x, (y + 1).min(height - 1)) - here;
            gradient.push(right.abs() + below.abs());
        }
    }
    gradient
}

/// How one view shows one part.
#[derive(Debug, Clone, Copy, Default)]
struct Shown {
    pixels: u32,
    /// Pixels whose eight neighbours show the part too.
    inside: u32,
    /// Sum over these.
    sharpness: f64,
}

fn shown(parts: &Parts, map: &LabelMap, sharpness: &[f32]) -> Vec<Shown> {
    let mut found = vec![Shown::default(); parts.parts.len()];
    let part = |id: u16| if id == 0 { 0 } else { parts.part_of(id) };
    for y in 0..map.height {
        for x in 0..map.width {
            let id = map.at(x, y);
            if id == 0 {
                continue;
            }
            let mut around = (y.saturating_sub(1)..=(y + 1).min(map.height - 1))
                .flat_map(|y| (x.saturating_sub(1)..=(x + 1).min(map.width - 1)).map(move |x| (x, y)));
            let is_at_edge = x == 0 || y == 0 || x + 1 == map.width || y + 1 == map.height;
            let whole = part(id);
            let in_part = !is_at_edge && around.clone().all(|(x, y)| part(map.at(x, y)) == whole);
            let in_piece = in_part && around.all(|(x, y)| map.at(x, y) == id);
            let sharp = f64::from(sharpness[y as usize * map.width as usize + x as usize]);
            for (id, is_inside) in [(id, in_piece), (whole, in_part)].iter().take(1 + usize::from(whole != id)) {
                let shown = &mut found[usize::from(*id) - 1];
                shown.pixels += 1;
                if *is_inside {
                    shown.inside += 1;
                    shown.sharpness += sharp;
                }
            }
        }
    }
    found
}

/// The mean position of the Gaussians of each part and piece, without those set aside, which may lie anywhere.
fn centers(gaussians: &Gaussians, parts: &Parts) -> Vec<Point3<f64>> {
    let mut sums = vec![(Vector3::zeros(), 0.0f64); parts.parts.len()];
    for (i, &id) in parts.id_of_gaussian.iter().enumerate().filter(|(i, _)| !gaussians.is_set_aside(*i)) {
        let whole = parts.part_of(id);
        for id in [Some(id), (whole != id).then_some(whole)].into_iter().flatten() {
            let (sum, count) = &mut sums[usize::from(id) - 1];
            *sum += gaussians.center(i).coords;
            *count += 1.0;
        }
    }
    sums.into_iter().map(|(sum, count)| Point3::from(sum / count.max(1.0))).collect()
}

/// Takes one view after the other: always the one that adds most to what the views before it show.
fn order(center: Point3<f64>, cameras: &[&Camera], shown: &[Vec<Shown>], index: usize) -> Vec<PartView> {
    let mean_sharpness = |shown: &Shown| shown.sharpness / f64::from(shown.inside.max(1));
    let mut left: Vec<usize> = (0..shown.len()).filter(|&view| shown[view][index].inside >= LEAST_INSIDE).collect();
    let sharpest = left.iter().map(|&view| mean_sharpness(&shown[view][index])).fold(0.0, f64::max);
    let worth = |view: usize| {
        let shown = &shown[view][index];
        let sharp = if sharpest > 0.0 { mean_sharpness(shown) / sharpest } else { 1.0 };
        f64::from(shown.inside) * (BLURRED_WORTH + (1.0 - BLURRED_WORTH) * sharp)
    };
    let toward: Vec<Vector3<f64>> = cameras
        .iter()
        .map(|camera| (camera.center_in_world() - center).try_normalize(0.0).unwrap_or_default())
        .collect();
    // By view: the angle to the nearest of those taken, up to OTHER_SIDE_DEG.
    let mut nearest = vec![OTHER_SIDE_DEG; shown.len()];
    let mut taken: Vec<usize> = Vec::new();
    while !left.is_empty() {
        let newness = |view: usize| SAME_SIDE_WORTH + (1.0 - SAME_SIDE_WORTH) * nearest[view] / OTHER_SIDE_DEG;
        let value = |view: usize| worth(view) * newness(view);
        // Among equals, the first view.
        let best = (0..left.len()).rev().max_by(|&a, &b| value(left[a]).total_cmp(&value(left[b])));
        let view = left.remove(best.expect("some are left"));
        for &other in &left {
            let angle = toward[other].dot(&toward[view]).clamp(-1.0, 1.0).acos().to_degrees();
            nearest[other] = nearest[other].min(angle);
        }
        taken.push(view);
    }
    taken.into_iter().map(|view| PartView { view, pixels: shown[view][index].pixels }).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::camera::{Distortion, Intrinsics};

    /// This takes an hour if each view that is left is compared anew with all that were taken.
    #[test]
    fn thousands_of_views_are_ordered() {
        const VIEWS: usize = 6000;
        let distortion = Distortion::None;
        let intrinsics = Intrinsics { width: 8, height: 8, fx: 8.0, fy: 8.0, cx: 4.0, cy: 4.0, distortion };
        let camera = |n: usize| {
            let (sin, cos) = (n as f64 / VIEWS as f64 * std::f64::consts::TAU).sin_cos();
            Camera { intrinsics, camera_from_world: Isometry3::translation(cos, sin, 0.0) }
        };
        let cameras: Vec<Camera> = (0..VIEWS).map(camera).collect();
        // All show as much of the part, but the second a little more.
        let shown: Vec<Vec<Shown>> =
            (0..VIEWS).map(|n| vec![Shown { pixels: 40, inside: 30 + u32::from(n == 1), sharpness: 0.0 }]).collect();
        let order = order(Point3::origin(), &cameras.iter().collect::<Vec<_>>(), &shown, 0);
        let views: Vec<usize> = order.iter().map(|shown| shown.view).collect();
        // 60 degrees are a sixth of the views: the first views are that far apart, each the first that is.
        assert_eq!(views[0], 1);
        assert!(views[1].abs_diff(1 + VIEWS / 6) <= 1, "{}", views[1]);
        let mut all = views;
        all.sort_unstable();
        assert!(all.into_iter().eq(0..VIEWS), "every view once");
    }
}
