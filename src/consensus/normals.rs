//! The surface's normal at every Gaussian.

use nalgebra::Vector3;

use crate::gaussians::Gaussians;
use crate::numeric::nearest::Nearest;
use crate::parallel;

/// Number of Gaussians, with itself, over which a normal is smoothed.
const SMOOTHED_OVER: usize = 12;
/// Gaussians weigh by their light in pixels, up to this much.
const MOST_LIGHT: f32 = 20.0;

/// The surface's normals at the Gaussians that views see.
pub(super) struct Normals {
    /// Per Gaussian; zero if there is none.
    normals: Vec<Vector3<f32>>,
}

impl Normals {
    /// `toward_views` points from each Gaussian to the views that see it, and `light` is what they see of it, in pixels.
    ///
    /// `nearest` holds the positions of `seen`.
    pub fn new(
        gaussians: &Gaussians,
        seen: &[u32],
        nearest: &Nearest,
        light: &[f32],
        toward_views: &[Vector3<f32>],
    ) -> Self {
        let normal_of = |&i: &u32| own_normal(gaussians, i as usize, &toward_views[i as usize]);
        let own: Vec<Vector3<f32>> = parallel::map(seen, normal_of);
        let smoothed = |&i: &u32| {
            let i = i as usize;
            let around = nearest.find(gaussians.positions[i], SMOOTHED_OVER).into_iter();
            let sum = around.fold(Vector3::zeros(), |sum, (_, n)| {
                let other = seen[n as usize] as usize;
                // The other side of a thin wall is seen from elsewhere.
                let same_side = toward_views[other].dot(&toward_views[i]) > 0.0;
                if same_side { sum + own[n as usize] * light[other].min(MOST_LIGHT) } else { sum }
            });
            sum.try_normalize(0.0).unwrap_or_default()
        };
        let smoothed: Vec<Vector3<f32>> = parallel::map(seen, smoothed);
        let mut normals = vec![Vector3::zeros(); gaussians.len()];
        seen.iter().zip(smoothed).for_each(|(&i, normal)| normals[i as usize] = normal);
        Self { normals }
    }

    /// The angle between the normals of two Gaussians, 0 to 180 degrees.
    pub fn angle_deg(&self, a: u32, b: u32) -> f32 {
        self.normals[a as usize].dot(&self.normals[b as usize]).clamp(-1.0, 1.0).acos().to_degrees()
    }
}

/// The Gaussian's shortest axis on the side of the views, times its flatness: 0 if its two shorter axes are equal, 1 if
/// the shortest is zero.
fn own_normal(gaussians: &Gaussians, i: usize, toward_views: &Vector3<f32>) -> Vector3<f32> {
    let scale = gaussians.scale(i);
    let shortest = scale.imin();
    let second = (0..3).filter(|&axis| axis != shortest).map(|axis| scale[axis]).fold(f64::INFINITY, f64::min);
    let flatness = if second > 0.0 { 1.0 - scale[shortest] / second } else { 0.0 };
    let axis = (gaussians.rotation(i) * Vector3::ith(shortest, 1.0)).map(|value| value as f32);
    let side = if axis.dot(toward_views) < 0.0 { -1.0 } else { 1.0 };
    axis * (side * flatness as f32)
}
