//! The object's Gaussians for the page's viewer: few and small enough for a file that is passed around.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::Point3;

use crate::gaussians::Gaussians;
use crate::gaussians::SH_C0;
use crate::scene::{Bounds, robust_bounds};
use crate::vote::MaterialField;

/// Most Gaussians of an object, or of all objects, on a page: with 20 bytes each, 1.1 MB in base64 before compression, beside 1.4 MB
/// of viewer.
const LIMIT: usize = 40_000;
/// Most Gaussians around the objects of a capture.
const SURROUNDINGS_LIMIT: usize = 30_000;
/// Distance from the middle of the objects within which their surroundings are shown, in radii of the sphere around the objects:
/// the table shows, and no wall stands before it.
const SURROUNDINGS_REACH: f64 = 1.5;
/// Largest standard deviation of a Gaussian of the surroundings, in the same radii: larger ones are haze.
const SURROUNDINGS_LARGEST: f64 = 0.25;
/// Logarithm of the ratio of the largest scale to the smallest one drawn: Gaussians below e^-10 times the largest are
/// drawn at that size.
pub(super) const LOG_SCALE_SPAN: f32 = 10.0;
/// Fainter Gaussians change no 8-bit pixel.
const FAINTEST: f64 = 1.0 / 255.0;

/// Distance outside the bounds without strays from which a Gaussian counts as a stray, as a share of their diagonal.
const STRAY_MARGIN: f64 = 0.1;

/// A ball around the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// World frame, scene units.
    pub center: Point3<f64>,
    pub radius: f64,
}

/// The cloud of a page.
#[derive(Debug, Clone, PartialEq)]
pub struct Cloud {
    /// Number of Gaussians in it.
    pub count: usize,
    /// Number of visible Gaussians of the object; the cloud has all of them or an evenly chosen share.
    pub of: usize,
    /// Lowest and highest centre, world frame, scene units.
    pub corners: [[f32; 3]; 2],
    /// Logarithms of the standard deviations (scene units) that the bytes 0 and 255 stand for.
    pub log_scales: [f32; 2],
    /// Contains the object without strays, so a camera that shows the sphere shows the object from every side.
    pub sphere: Sphere,
    /// From where the page looks at the cloud first, world frame, scene units.
    pub eye: Point3<f64>,
    /// Gzip of columns, little endian: centre (3 u16), log scale (3 u8), quaternion x y z w (4 i8), opacity (u8), sRGB
    /// colour (3 u8), label (u16), confidence (u8).
    pub gzip: Vec<u8>,
    /// The Gaussians in it, by their index in the scene, and the label of each.
    pub(super) chosen: Vec<usize>,
    pub(super) labels: Vec<u32>,
}

impl Cloud {
    /// The cloud of `gaussians` with the labels of `field`, to be viewed from `eye` first.
    pub fn new(gaussians: &Gaussians, field: &MaterialField, eye: Point3<f64>) -> Self {
        Self::of_at_most(LIMIT, gaussians, field, eye)
    }

    fn of_at_most(limit: usize, gaussians: &Gaussians, field: &MaterialField, eye: Point3<f64>) -> Self {
        let visible = visible(gaussians);
        let shown = thinned(&visible, limit);
        let sphere = sphere(gaussians, shown.iter().map(|one| one.index));
        let labels = Labels { of: &field.part_index, confidence: &field.confidence };
        Self::of_shown(gaussians, &shown, visible.len(), &labels, Viewpoint { sphere, eye })
    }

    /// The objects of a capture on what they stand on, with the number of each as its label, 0 for what is of no object;
    /// `number_of` has one for each of the `gaussians`.
    pub fn of_objects(gaussians: &Gaussians, number_of: &[u32], eye: Point3<f64>) -> Self {
        let visible = visible(gaussians);
        let (objects, around): (Vec<usize>, Vec<usize>) = visible.iter().partition(|&&i| number_of[i] > 0);
        let mut alone = gaussians.clone();
        let is_object: Vec<bool> = number_of.iter().map(|number| *number > 0).collect();
        alone.retain(&is_object);
        let sphere = sphere(&alone, 0..alone.len());
        let is_near = |&&i: &&usize| {
            (gaussians.center(i) - sphere.center).norm() < SURROUNDINGS_REACH * sphere.radius
                && gaussians.scale(i).max() < SURROUNDINGS_LARGEST * sphere.radius
        };
        let around: Vec<usize> = around.iter().filter(is_near).copied().collect();
        let shown = [thinned(&objects, LIMIT), thinned(&around, SURROUNDINGS_LIMIT)].concat();
        let labels = Labels { of: number_of, confidence: &vec![1.0; gaussians.len()] };
        Self::of_shown(gaussians, &shown, objects.len() + around.len(), &labels, Viewpoint { sphere, eye })
    }

    fn of_shown(gaussians: &Gaussians, shown: &[Shown], of: usize, labels: &Labels, from: Viewpoint) -> Self {
        let chosen: Vec<usize> = shown.iter().map(|one| one.index).collect();
        let axes = [0, 1, 2].map(|axis| extent(chosen.iter().map(|&i| gaussians.positions[i][axis])));
        let largest_of =
            |one: &Shown| gaussians.log_scales[one.index].into_iter().fold(f32::NEG_INFINITY, f32::max) + one.growth;
        let [_, largest] = extent(shown.iter().map(largest_of));
        let log_scales = [largest - LOG_SCALE_SPAN, largest];

        let mut bytes = Vec::new();
        for (axis, [low, high]) in axes.into_iter().enumerate() {
            let share = |i: usize| (gaussians.positions[i][axis] - low) / (high - low).max(f32::MIN_POSITIVE);
            bytes.extend(chosen.iter().flat_map(|&i| ((share(i) * 65535.0).round() as u16).to_le_bytes()));
        }
        for axis in 0..3 {
            let share =
                |one: &Shown| (gaussians.log_scales[one.index][axis] + one.growth - log_scales[0]) / LOG_SCALE_SPAN;
            bytes.extend(shown.iter().map(|one| byte(share(one))));
        }
        for axis in 0..4 {
            let turn = |i: usize| (gaussians.rotation(i).coords[axis] * 127.0).round() as i8;
            bytes.extend(chosen.iter().map(|&i| turn(i).cast_unsigned()));
        }
        bytes.extend(chosen.iter().map(|&i| byte(gaussians.opacity(i) as f32)));
        for channel in 0..3 {
            bytes.extend(chosen.iter().map(|&i| byte(0.5 + SH_C0 * gaussians.sh_dc[i][channel])));
        }
        bytes.extend(chosen.iter().flat_map(|&i| (labels.of[i] as u16).to_le_bytes()));
        bytes.extend(chosen.iter().map(|&i| byte(labels.confidence[i])));
        Self {
            count: shown.len(),
            of,
            corners: [axes.map(|axis| axis[0]), axes.map(|axis| axis[1])],
            log_scales,
            sphere: from.sphere,
            eye: from.eye,
            gzip: gzip(&bytes),
            labels: chosen.iter().map(|&i| labels.of[i]).collect(),
            chosen,
        }
    }
}

/// A Gaussian of the cloud.
#[derive(Clone, Copy)]
struct Shown {
    index: usize,
    /// By how much the logarithms of its scales grow, since others near it are left out.
    growth: f32,
}

/// What is known of each Gaussian of the scene.
struct Labels<'a> {
    of: &'a [u32],
    confidence: &'a [f32],
}

/// What the page looks at first, and from where.
struct Viewpoint {
    sphere: Sphere,
    eye: Point3<f64>,
}

fn visible(gaussians: &Gaussians) -> Vec<usize> {
    (0..gaussians.len()).filter(|&i| gaussians.opacity(i) >= FAINTEST).collect()
}

/// Evenly chosen ones, at most `limit`.
fn thinned(indices: &[usize], limit: usize) -> Vec<Shown> {
    let count = indices.len().min(limit);
    // Fewer Gaussians on the same surface must be larger: their areas are inversely proportional to their number.
    let growth = 0.5 * (indices.len().max(1) as f32 / count.max(1) as f32).ln();
    (0..count).map(|k| Shown { index: indices[k * indices.len() / count], growth }).collect()
}

/// The ball around the middle of the bounds that holds every Gaussian in or near them, to one standard deviation.
fn sphere(gaussians: &Gaussians, chosen: impl Iterator<Item = usize>) -> Sphere {
    let Bounds { min, max } = robust_bounds(gaussians);
    let (center, margin) = (nalgebra::center(&min, &max), STRAY_MARGIN * (max - min).norm());
    let is_near = |at: &Point3<f64>| (0..3).all(|a| at[a] >= min[a] - margin && at[a] <= max[a] + margin);
    let reach = |i: usize| {
        let at = gaussians.center(i);
        is_near(&at).then(|| (at - center).norm() + gaussians.scale(i).max().min(margin))
    };
    let radius = chosen.filter_map(reach).fold(0.0, f64::max);
    Sphere { center, radius: if radius > 0.0 { radius } else { 1.0 } }
}

/// The lowest and the highest value.
pub(super) fn extent(values: impl Iterator<Item = f32>) -> [f32; 2] {
    values.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

/// Maps 0 to 1 to 0 to 255.
pub(super) fn byte(share: f32) -> u8 {
    (share * 255.0).round() as u8
}

pub(super) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).expect("writing to memory cannot fail");
    encoder.finish().expect("writing to memory cannot fail")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    fn line(count: usize) -> (Gaussians, MaterialField) {
        let gaussians = Gaussians {
            positions: (0..count).map(|i| [i as f32, 0.0, -1.0]).collect(),
            log_scales: vec![[-3.0, -5.0, -20.0]; count],
            rotations: vec![[2.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: (0..count).map(|i| if i == 0 { -20.0 } else { 20.0 }).collect(),
            sh_dc: vec![[0.0, 10.0, -10.0]; count],
            ..Gaussians::default()
        };
        let field = MaterialField {
            parts: Vec::new(),
            part_index: (0..count as u32).collect(),
            confidence: vec![1.0; count],
            votes: vec![1.0; count],
            views: vec![1; count],
            warnings: Vec::new(),
            notes: Vec::new(),
        };
        (gaussians, field)
    }

    fn unpacked(cloud: &Cloud) -> Vec<u8> {
        let mut bytes = Vec::new();
        flate2::read::GzDecoder::new(cloud.gzip.as_slice()).read_to_end(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn columns_hold_what_was_put_in() {
        let (gaussians, field) = line(3);
        let cloud = Cloud::new(&gaussians, &field, Point3::origin());
        // The first is invisible.
        assert_eq!((cloud.count, cloud.of), (2, 2));
        assert_eq!(cloud.corners, [[1.0, 0.0, -1.0], [2.0, 0.0, -1.0]]);
        assert_eq!(cloud.log_scales, [-13.0, -3.0]);
        let bytes = unpacked(&cloud);
        assert_eq!(bytes.len(), 2 * 20);
        assert_eq!(bytes[..4], [0, 0, 255, 255], "x at both ends");
        assert_eq!(bytes[12..18], [255, 255, 204, 204, 0, 0], "log scales -3, -5, below the span");
        assert_eq!(bytes[18..26], [0, 0, 0, 0, 0, 0, 127, 127], "no turn, w last");
        assert_eq!(bytes[26..34], [255, 255, 128, 128, 255, 255, 0, 0], "opaque; grey, above 1, below 0");
        assert_eq!(bytes[34..40], [1, 0, 2, 0, 255, 255], "labels, confidence");
    }

    #[test]
    fn a_large_cloud_is_thinned_evenly_and_grows_to_cover_the_same() {
        let (gaussians, field) = line(401);
        let cloud = Cloud::of_at_most(100, &gaussians, &field, Point3::origin());
        assert_eq!((cloud.count, cloud.of), (100, 400));
        assert!((cloud.log_scales[1] - (-3.0 + 2.0f32.ln())).abs() < 1e-6, "a quarter of them, twice as large");
        let labels: Vec<u8> = unpacked(&cloud)[100 * 17..].chunks(2).take(3).map(|label| label[0]).collect();
        assert_eq!(labels, [1, 5, 9]);
    }

    #[test]
    fn the_ball_holds_the_ends_of_a_rod_and_leaves_a_stray_out() {
        let (mut gaussians, field) = line(1001);
        gaussians.positions.push([5000.0, 0.0, -1.0]);
        gaussians.log_scales.push([-3.0; 3]);
        gaussians.rotations.push([1.0, 0.0, 0.0, 0.0]);
        gaussians.opacity_logits.push(20.0);
        gaussians.sh_dc.push([0.0; 3]);
        let field = MaterialField { part_index: vec![0; 1002], confidence: vec![1.0; 1002], ..field };
        let Sphere { center, radius } = Cloud::new(&gaussians, &field, Point3::origin()).sphere;
        assert!((499.0..=503.0).contains(&center.x), "{center}");
        assert!(center.x - radius <= 1.0 && center.x + radius >= 1000.0 && radius < 510.0, "{radius}");
    }

    #[test]
    fn a_table_ends_where_its_objects_are_far_away() {
        // Along a line of 101: an object in the middle, ten long.
        let (mut gaussians, _) = line(101);
        gaussians.opacity_logits[0] = 20.0;
        let numbers: Vec<u32> = (0..101).map(|i| if (46..=55).contains(&i) { 3 } else { 0 }).collect();
        let cloud = Cloud::of_objects(&gaussians, &numbers, Point3::origin());
        assert!((cloud.sphere.center.x - 50.5).abs() < 1.0 && (4.0..6.0).contains(&cloud.sphere.radius));
        let (objects, around) = cloud.labels.split_at(10);
        assert_eq!(objects, [3; 10]);
        assert!((3..=8).contains(&around.len()) && around.iter().all(|label| *label == 0), "{around:?}");
        assert_eq!(cloud.of, cloud.count);
    }

    #[test]
    fn nothing_visible_is_an_empty_cloud() {
        let (gaussians, field) = line(1);
        let cloud = Cloud::new(&gaussians, &field, Point3::origin());
        assert_eq!((cloud.count, cloud.of, unpacked(&cloud).len()), (0, 0, 0));
    }
}
