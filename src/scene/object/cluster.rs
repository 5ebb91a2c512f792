//! The densest cluster that the cameras look at.
//!
//! Of the Gaussians around the [focus](super::support), those of the support go, together with what is below it. The rest is
//! divided into clusters of touching voxels; the largest is the object.
//!
//! All lengths are fractions of the cameras' median distance from the focus.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;

use super::support::{Focus, Plane, THICKNESS, poses};
use crate::gaussians::Gaussians;
use crate::scene::{View, up};

/// Side of a voxel: gaps smaller than this do not split an object.
const VOXEL: f64 = 1.0 / 40.0;
/// The object must have at least this share of the Gaussians around the focus; otherwise nothing stands out.
const LEAST_OBJECT: f64 = 0.02;

/// For each of `count` Gaussians, whether it belongs to the object; `None` if no cluster stands out.
pub(in crate::scene) fn around(focus: &Focus, support: Option<&Plane>, count: usize) -> Option<Vec<bool>> {
    let is_above = |point: &Point3<f64>| support.is_none_or(|plane| plane.height(point) > THICKNESS * focus.unit);
    let above: Vec<usize> = (0..focus.points.len()).filter(|i| is_above(&focus.points[*i])).collect();
    let cluster = largest_cluster(&focus.points, &above, &focus.point, VOXEL * focus.unit);
    if (cluster.len() as f64) < LEAST_OBJECT * focus.indices.len() as f64 || cluster.is_empty() {
        return None;
    }
    let mut kept = vec![false; count];
    for index in cluster {
        kept[focus.indices[index]] = true;
    }
    Some(kept)
}

/// For each Gaussian, whether it belongs to the densest cluster that the cameras look at; `None` if there is none.
pub(in crate::scene) fn looked_at(gaussians: &Gaussians, views: &[View]) -> Option<Vec<bool>> {
    let focus = Focus::of(gaussians, &poses(views))?;
    let support = focus.support(up::cameras::up(views).as_ref());
    around(&focus, support.as_ref(), gaussians.len())
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
    use nalgebra::{Isometry3, Vector3};

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
        let on_sphere = |radius: f64, count: usize| {
            sphere_directions(count).map(move |to| -> [f32; 3] { (radius * to).map(|side| side as f32).into() })
        };
        let positions: Vec<[f32; 3]> = on_sphere(0.3, BALL).chain(on_sphere(4.0, 1000)).collect();
        let count = positions.len();
        let cloud = Gaussians {
            positions,
            log_scales: vec![[0.005_f32.ln(); 3]; count],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
            opacity_logits: vec![4.0; count],
            sh_dc: vec![[0.0; 3]; count],
            ..Gaussians::default()
        };
        let focus = Focus::of(&cloud, &ring(true)).unwrap();
        let kept = around(&focus, focus.support(None).as_ref(), count).unwrap();
        assert!(kept.iter().enumerate().all(|(i, kept)| *kept == (i < BALL)));
        assert!(Focus::of(&cloud, &ring(false)).is_none());
    }
}
