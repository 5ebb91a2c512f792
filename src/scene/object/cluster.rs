//! The densest cluster that the cameras look at.
//!
//! 1. The focus: the point nearest to all optical axes. A photographer who walks around an object keeps it in the
//!    middle.
//! 2. The ball around the focus in which the object could lie, sized by the cameras' distance. Gaussians larger than
//!    any object detail are walls.
//! 3. The support (table, bed, floor): the plane with most of these Gaussians close to it, almost none beyond it and
//!    almost all cameras on one side. It is removed together with what is below it.
//! 4. The rest is divided into clusters of touching voxels; the largest is the object.
//!
//! All lengths are fractions of the cameras' median distance from the focus.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Point3, Vector3};

use crate::gaussians::Gaussians;
use crate::numeric::{nearest_to_lines, upper_median};

/// Radius of the ball: with the usual field of view of 50 to 60 degrees, an object that fills the picture has a radius
/// of about half the distance.
const REACH: f64 = 0.6;
/// Standard deviation of the largest Gaussian that may show a detail.
const LARGEST: f64 = 0.03;
/// Distance from the support within which a Gaussian belongs to it: cloth wrinkles, and trained surfaces are thick.
const SUPPORT_THICKNESS: f64 = 0.03;
/// A support holds at least this share of the ball's Gaussians.
const LEAST_SUPPORT: f64 = 0.12;
/// Share of the Gaussians that may lie beyond the support: some always leak through it.
const MOST_BEYOND: f64 = 0.05;
/// Share of the cameras that must stand on one side of it.
const LEAST_ON_ONE_SIDE: f64 = 0.9;
/// Side of a voxel: gaps smaller than this do not split an object.
const VOXEL: f64 = 1.0 / 40.0;
/// Below this opacity a Gaussian is haze.
const LEAST_OPACITY_LOGIT: f32 = -2.2;
/// The object must have at least this share of the ball's Gaussians; otherwise nothing stands out.
const LEAST_OBJECT: f64 = 0.02;

/// Per Gaussian, whether it belongs to the object; `None` if no cluster stands out or the cameras do not look at a
/// common point.
pub(in crate::scene) fn around_focus(gaussians: &Gaussians, cameras: &[Isometry3<f64>]) -> Option<Vec<bool>> {
    let world_from_camera: Vec<_> = cameras.iter().map(Isometry3::inverse).collect();
    let centers: Vec<Point3<f64>> = world_from_camera.iter().map(|pose| pose.translation.vector.into()).collect();
    let axes: Vec<Vector3<f64>> = world_from_camera.iter().map(|pose| pose.rotation * Vector3::z()).collect();
    let focus = nearest_to_lines(&centers, &axes).filter(|focus| is_before_most(focus, &centers, &axes))?;
    let unit =
        upper_median(centers.iter().map(|center| (center - focus).norm()).collect()).filter(|unit| *unit > 0.0)?;
    let in_ball = |i: &usize| {
        gaussians.opacity_logits[*i] >= LEAST_OPACITY_LOGIT
            && (gaussians.center(*i) - focus).norm() < REACH * unit
            && gaussians.scale(*i).max() < LARGEST * unit
    };
    let ball: Vec<usize> = (0..gaussians.len()).filter(in_ball).collect();
    let points: Vec<Point3<f64>> = ball.iter().map(|i| gaussians.center(*i)).collect();
    let above: Vec<usize> = match support(&points, &centers, SUPPORT_THICKNESS * unit) {
        Some(plane) => (0..points.len()).filter(|i| plane.height(&points[*i]) > SUPPORT_THICKNESS * unit).collect(),
        None => (0..points.len()).collect(),
    };
    let cluster = largest_cluster(&points, &above, &focus, VOXEL * unit);
    if (cluster.len() as f64) < LEAST_OBJECT * ball.len() as f64 || cluster.is_empty() {
        return None;
    }
    let mut kept = vec![false; gaussians.len()];
    for index in cluster {
        kept[ball[index]] = true;
    }
    Some(kept)
}

/// Whether more than half of the cameras look towards a point. The axes of cameras that look outwards, from the middle of a
/// room, meet behind them.
fn is_before_most(point: &Point3<f64>, centers: &[Point3<f64>], axes: &[Vector3<f64>]) -> bool {
    let before = centers.iter().zip(axes).filter(|(center, axis)| axis.dot(&(point - *center)) > 0.0).count();
    2 * before > centers.len()
}

/// The points x with normal . x = offset; the cameras are on the side where normal . x is larger.
struct Plane {
    normal: Vector3<f64>,
    offset: f64,
}

impl Plane {
    fn through(points: [&Point3<f64>; 3]) -> Option<Self> {
        let normal = (points[1] - points[0]).cross(&(points[2] - points[0])).try_normalize(1e-12)?;
        Some(Self { normal, offset: normal.dot(&points[0].coords) })
    }

    fn height(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) - self.offset
    }

    fn facing(self, cameras: &[Point3<f64>]) -> Option<Self> {
        let before = cameras.iter().filter(|camera| self.height(camera) > 0.0).count();
        let enough = LEAST_ON_ONE_SIDE * cameras.len() as f64;
        if before as f64 >= enough {
            Some(self)
        } else if (cameras.len() - before) as f64 >= enough {
            Some(Self { normal: -self.normal, offset: -self.offset })
        } else {
            None
        }
    }
}

/// RANSAC (Fischler and Bolles 1981) with a fixed sequence of samples.
fn support(points: &[Point3<f64>], cameras: &[Point3<f64>], thickness: f64) -> Option<Plane> {
    const TRIALS: usize = 500;
    /// Enough to estimate shares to within a percent or two.
    const SAMPLES: usize = 1500;
    let samples: Vec<&Point3<f64>> = points.iter().step_by((points.len() / SAMPLES).max(1)).collect();
    if samples.len() < 3 {
        return None;
    }
    let mut random = Sequence(0x9e37_79b9_7f4a_7c15);
    let mut best: Option<(usize, Plane)> = None;
    for _ in 0..TRIALS {
        let three = [(); 3].map(|()| samples[random.below(samples.len())]);
        let Some(plane) = Plane::through(three).and_then(|plane| plane.facing(cameras)) else { continue };
        let heights = samples.iter().map(|point| plane.height(point));
        let beyond = heights.clone().filter(|height| *height < -thickness).count();
        let close = heights.filter(|height| height.abs() < thickness).count();
        let is_border = beyond as f64 <= MOST_BEYOND * samples.len() as f64;
        if is_border && best.as_ref().is_none_or(|(most, _)| close > *most) {
            best = Some((close, plane));
        }
    }
    best.filter(|(close, _)| *close as f64 >= LEAST_SUPPORT * samples.len() as f64).map(|(_, plane)| plane)
}

/// A linear congruential generator (Knuth's MMIX), so that the samples are the same in every run.
struct Sequence(u64);

impl Sequence {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }
}

/// The largest set of the points `among` whose voxels are connected by touching; ties go to the first.
fn largest_cluster(points: &[Point3<f64>], among: &[usize], origin: &Point3<f64>, side: f64) -> Vec<usize> {
    let voxel = |point: &Point3<f64>| -> [i64; 3] { ((point - origin) / side).map(|v| v.floor() as i64).into() };
    let mut voxels: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for index in among {
        voxels.entry(voxel(&points[*index])).or_default().push(*index);
    }
    let mut left: BTreeSet<[i64; 3]> = voxels.keys().copied().collect();
    let mut largest = Vec::new();
    while let Some(start) = left.pop_first() {
        let mut cluster = Vec::new();
        let mut open = vec![start];
        while let Some([x, y, z]) = open.pop() {
            cluster.extend(&voxels[&[x, y, z]]);
            let around =
                (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [x + i, y + j, z + k])));
            open.extend(around.filter(|neighbour| left.remove(neighbour)));
        }
        if cluster.len() > largest.len() {
            largest = cluster;
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::sphere_directions;

    /// A ring of 12 cameras at a distance of 1 from the middle, which look inwards or outwards.
    fn ring(inwards: bool) -> Vec<Isometry3<f64>> {
        let camera = |n: usize| {
            let (sin, cos) = (std::f64::consts::TAU * n as f64 / 12.0).sin_cos();
            let eye = Point3::new(cos, sin, 0.2);
            let ahead = if inwards { -eye.coords } else { eye.coords };
            Isometry3::face_towards(&eye, &(eye + ahead), &Vector3::z()).inverse()
        };
        (0..12).map(camera).collect()
    }

    #[test]
    fn cameras_that_look_outwards_have_no_object_in_their_middle() {
        // A ball in the middle, too large for a plane to hold much of it, and a wall far around it.
        const BALL: usize = 4000;
        let around = |radius: f64, count: usize| {
            sphere_directions(count).map(move |to| -> [f32; 3] { (radius * to).map(|side| side as f32).into() })
        };
        let positions: Vec<[f32; 3]> = around(0.3, BALL).chain(around(4.0, 1000)).collect();
        let count = positions.len();
        let cloud = Gaussians {
            positions,
            log_scales: vec![[0.005_f32.ln(); 3]; count],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: vec![4.0; count],
            sh_dc: vec![[0.0; 3]; count],
            ..Gaussians::default()
        };
        let kept = around_focus(&cloud, &ring(true)).unwrap();
        assert!(kept.iter().enumerate().all(|(i, kept)| *kept == (i < BALL)));
        assert_eq!(around_focus(&cloud, &ring(false)), None);
    }
}
