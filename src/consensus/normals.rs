//! The surface's normal at every Gaussian, and the angle between those of a pair.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::neighbors::Pairs;
use crate::scene::gaussians::Gaussians;
use crate::scene::nearest::Nearest;

/// Number of Gaussians, with itself, over which a normal is smoothed.
const SMOOTHED_OVER: usize = 12;
/// Light in pixels above which a Gaussian weighs no more in the mean.
const MOST_LIGHT: f32 = 20.0;

/// The angle in degrees between the normals of every pair. `toward_views` points from each Gaussian to the views that
/// see it.
pub(super) fn angles(
    gaussians: &Gaussians,
    seen: &[u32],
    light: &[f32],
    toward_views: &[Vector3<f64>],
    pairs: &Pairs,
) -> Vec<f32> {
    let own: Vec<Vector3<f32>> =
        seen.par_iter().map(|&i| own_normal(gaussians, i as usize, &toward_views[i as usize])).collect();
    let nearest = Nearest::new(seen.iter().map(|&i| gaussians.positions[i as usize]));
    let smooth_one = |&i: &u32| {
        let i = i as usize;
        let sum =
            nearest.find(gaussians.positions[i], SMOOTHED_OVER).into_iter().fold(Vector3::zeros(), |sum, (_, n)| {
                let other = seen[n as usize] as usize;
                // The other side of a thin wall is seen from elsewhere.
                let same_side = toward_views[other].dot(&toward_views[i]) > 0.0;
                if same_side { sum + own[n as usize] * light[other].min(MOST_LIGHT) } else { sum }
            });
        sum.try_normalize(0.0).unwrap_or_default()
    };
    let smooth: Vec<Vector3<f32>> = seen.par_iter().map(smooth_one).collect();
    let mut place = vec![0u32; gaussians.len()];
    (0..).zip(seen).for_each(|(n, &i)| place[i as usize] = n);
    let normal = |i: u32| smooth[place[i as usize] as usize];
    pairs.pairs.par_iter().map(|&(a, b)| normal(a).dot(&normal(b)).clamp(-1.0, 1.0).acos().to_degrees()).collect()
}

/// The Gaussian's shortest axis on the side of the views, times its flatness: 0 if its two shorter axes are equal, 1 if
/// the shortest is zero.
fn own_normal(gaussians: &Gaussians, i: usize, toward_views: &Vector3<f64>) -> Vector3<f32> {
    let scale = gaussians.scale(i);
    let shortest = scale.imin();
    let second = (0..3).filter(|&axis| axis != shortest).map(|axis| scale[axis]).fold(f64::INFINITY, f64::min);
    let flatness = if second > 0.0 { 1.0 - scale[shortest] / second } else { 0.0 };
    let axis = gaussians.rotation(i) * Vector3::ith(shortest, 1.0);
    let side = if axis.dot(toward_views) < 0.0 { -flatness } else { flatness };
    (axis * side).map(|value| value as f32)
}
