//! The object's Gaussians for the page's viewer: few and small enough for a file that is passed around.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use nalgebra::Point3;

use crate::gaussians::Gaussians;
use crate::gaussians::SH_C0;
use crate::scene::{Bounds, robust_bounds};
use crate::vote::MaterialField;

/// Most Gaussians on a page: with 20 bytes each, 1.1 MB in base64 before compression, beside 1.4 MB of viewer.
const LIMIT: usize = 40_000;
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
        let visible: Vec<usize> = (0..gaussians.len()).filter(|&i| gaussians.opacity(i) >= FAINTEST).collect();
        let count = visible.len().min(limit);
        let chosen: Vec<usize> = (0..count).map(|k| visible[k * visible.len() / count]).collect();
        // Fewer Gaussians on the same surface must be larger: their areas are inversely proportional to their number.
        let growth = 0.5 * (visible.len().max(1) as f32 / count.max(1) as f32).ln();
        let axes = [0, 1, 2].map(|axis| extent(chosen.iter().map(|&i| gaussians.positions[i][axis])));
        let largest_of = |&i: &usize| gaussians.log_scales[i].into_iter().fold(f32::NEG_INFINITY, f32::max);
        let [_, largest] = extent(chosen.iter().map(largest_of)).map(|largest| largest + growth);
        let log_scales = [largest - LOG_SCALE_SPAN, largest];

        let mut bytes = Vec::new();
        for (axis, [low, high]) in axes.into_iter().enumerate() {
            let share = |i: usize| (gaussians.positions[i][axis] - low) / (high - low).max(f32::MIN_POSITIVE);
            bytes.extend(chosen.iter().flat_map(|&i| ((share(i) * 65535.0).round() as u16).to_le_bytes()));
        }
        for axis in 0..3 {
            let share = |i: usize| (gaussians.log_scales[i][axis] + growth - log_scales[0]) / LOG_SCALE_SPAN;
            bytes.extend(chosen.iter().map(|&i| byte(share(i))));
        }
        for axis in 0..4 {
            let turn = |i: usize| (gaussians.rotation(i).coords[axis] * 127.0).round() as i8;
            bytes.extend(chosen.iter().map(|&i| turn(i).cast_unsigned()));
        }
        bytes.extend(chosen.iter().map(|&i| byte(gaussians.opacity(i) as f32)));
        for channel in 0..3 {
            bytes.extend(chosen.iter().map(|&i| byte(0.5 + SH_C0 * gaussians.sh_dc[i][channel])));
        }
        bytes.extend(chosen.iter().flat_map(|&i| (field.part_index[i] as u16).to_le_bytes()));
        bytes.extend(chosen.iter().map(|&i| byte(field.confidence[i])));
        Self {
            count,
            of: visible.len(),
            corners: [axes.map(|axis| axis[0]), axes.map(|axis| axis[1])],
            log_scales,
            sphere: sphere(gaussians, &chosen),
            eye,
            gzip: gzip(&bytes),
            labels: chosen.iter().map(|&i| field.part_index[i]).collect(),
            chosen,
        }
    }
}

/// The ball around the middle of the bounds that holds every Gaussian in or near them, to one standard deviation.
fn sphere(gaussians: &Gaussians, chosen: &[usize]) -> Sphere {
    let Bounds { min, max } = robust_bounds(gaussians);
    let (center, margin) = (nalgebra::center(&min, &max), STRAY_MARGIN * (max - min).norm());
    let is_near = |at: &Point3<f64>| (0..3).all(|a| at[a] >= min[a] - margin && at[a] <= max[a] + margin);
    let reach = |&i: &usize| {
        let at = gaussians.center(i);
        is_near(&at).then(|| (at - center).norm() + gaussians.scale(i).max().min(margin))
    };
    let radius = chosen.iter().filter_map(reach).fold(0.0, f64::max);
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
    fn nothing_visible_is_an_empty_cloud() {
        let (gaussians, field) = line(1);
        let cloud = Cloud::new(&gaussians, &field, Point3::origin());
        assert_eq!((cloud.count, cloud.of, unpacked(&cloud).len()), (0, 0, 0));
    }
}
