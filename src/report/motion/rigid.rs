//! Rigid motions: the Gaussians of a part that keep their distances share its path.
//!
//! The path is fitted to the Gaussians themselves, frame by frame: first to all Gaussians of a part, then to the half
//! of them that fit best, so that a few that stay behind do not spoil the fit.

use nalgebra::{Isometry3, Point3};
use serde::Serialize;

use super::Still;
use crate::numeric;

/// For each frame: a unit quaternion x y z w, then the position of the pivot (world frame, scene units).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Path(pub Vec<[f32; 7]>);

/// The path of every label from `at_rest` through `stills`, with rotations about `pivot`; and for each Gaussian whether
/// it stays within `tolerance` of its part's path throughout.
pub(super) fn paths(
    at_rest: &Still,
    stills: &[Still],
    labels: &[u32],
    pivot: Point3<f64>,
    tolerance: f64,
) -> (Vec<Path>, Vec<bool>) {
    let mut follows = vec![true; labels.len()];
    let count = labels.iter().max().map_or(0, |&last| last + 1);
    let path = |label: u32| {
        let members: Vec<usize> = (0..labels.len()).filter(|&i| labels[i] == label).collect();
        let poses = stills.iter().map(|still| {
            let motion = fitted(&at_rest.centers, &still.centers, &members);
            for &i in &members {
                follows[i] &= distance(&motion, at_rest.centers[i], still.centers[i]) <= tolerance;
            }
            let (q, to) = (motion.rotation.coords, motion * pivot);
            [q.x, q.y, q.z, q.w, to.x, to.y, to.z].map(|x| x as f32)
        });
        Path(poses.collect())
    };
    ((0..count).map(path).collect(), follows)
}

fn distance(motion: &Isometry3<f64>, from: Point3<f64>, to: Point3<f64>) -> f64 {
    (motion * from - to).norm()
}

/// The rigid motion that most of `members` follow.
fn fitted(from: &[Point3<f64>], to: &[Point3<f64>], members: &[usize]) -> Isometry3<f64> {
    let motion_of = |members: &[usize]| numeric::rigid_motion(members.iter().map(|&i| (from[i], to[i])));
    let first = motion_of(members);
    let mut by_distance: Vec<(f64, usize)> = members.iter().map(|&i| (distance(&first, from[i], to[i]), i)).collect();
    by_distance.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let best: Vec<usize> = by_distance.iter().take(members.len().div_ceil(2)).map(|&(_, i)| i).collect();
    motion_of(&best)
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    fn still(centers: Vec<Point3<f64>>) -> Still {
        let count = centers.len();
        Still { centers, log_scales: vec![[0.0; 3]; count], rotations: vec![UnitQuaternion::identity(); count] }
    }

    fn cube() -> Vec<Point3<f64>> {
        (0..27).map(|i| Point3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9))).collect()
    }

    #[test]
    fn a_part_that_turns_has_one_path_and_the_gaussian_left_behind_does_not_spoil_it() {
        let motion = Isometry3::new(Vector3::new(1.0, -2.0, 3.0), Vector3::new(0.3, -0.7, 0.2));
        let mut moved: Vec<_> = cube().iter().map(|p| motion * p).collect();
        moved[5] = cube()[5];
        let pivot = Point3::new(0.5, 0.5, 0.5);
        let (paths, follows) = paths(&still(cube()), &[still(moved)], &[0; 27], pivot, 1e-6);
        let [x, y, z, w, to @ ..] = paths[0].0[0].map(f64::from);
        let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        assert!(turn.angle_to(&motion.rotation) < 1e-6, "the same rotation");
        assert!((Point3::from(to) - motion * pivot).norm() < 1e-6, "the pivot goes along");
        assert_eq!(follows.iter().filter(|follows| !**follows).count(), 1);
        assert!(!follows[5]);
    }

    #[test]
    fn what_stretches_does_not_follow() {
        let stretched: Vec<_> = cube().iter().map(|p| Point3::new(1.5 * p.x, p.y, p.z)).collect();
        let (_, follows) = paths(&still(cube()), &[still(stretched)], &[0; 27], Point3::origin(), 1e-3);
        assert!(follows.iter().filter(|follows| **follows).count() <= 9, "at most the layer in the middle");
    }

    #[test]
    fn parts_without_gaussians_have_a_path_that_stays() {
        let (paths, _) = paths(&still(cube()), &[still(cube())], &[2; 27], Point3::origin(), 1e-3);
        assert_eq!(paths.len(), 3);
        assert_eq!(paths[0].0[0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    }
}
