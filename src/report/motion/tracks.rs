//! The tracks of Gaussians that move on their own, as bytes.
//!
//! A covariance has 24 sets of axes. Of these, a track takes the set nearest to that of the frame before, so that axes
//! turn little from frame to frame, can be interpolated, and compress well.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::Still;
use crate::parallel;
use crate::report::cloud::{LOG_SCALE_SPAN, byte, extent};

/// How a Gaussian moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// With its part.
    Rigid = 0,
    /// On a track of its own.
    Track = 1,
    /// Not shown while the object moves, to keep the page small.
    Hidden = 2,
}

/// The tracks of a cloud, with the meaning of their numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracks {
    /// For each Gaussian of the cloud.
    kinds: Vec<Kind>,
    /// The Gaussians with a track, ascending.
    pub shown: Vec<usize>,
    /// Number of Gaussians that move on their own, shown or not.
    pub of: usize,
    /// Lowest and highest centre, world frame, scene units.
    pub corners: [[f32; 3]; 2],
    /// Logarithms of the standard deviations (scene units) that the bytes 0 and 255 stand for.
    pub log_scales: [f32; 2],
    /// Added to every log scale: fewer Gaussians on the same surface must be larger.
    growth: f32,
    /// For each Gaussian with a track, log scale and rotation in each frame.
    axes: Vec<Vec<Axes>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Axes {
    log_scales: [f32; 3],
    rotation: UnitQuaternion<f64>,
}

impl Tracks {
    /// The tracks of every `share`-th Gaussian that does not follow its part.
    pub(super) fn new(follows: &[bool], share: usize, at_rest: &Still, stills: &[Still]) -> Self {
        let alone: Vec<usize> = (0..follows.len()).filter(|&i| !follows[i]).collect();
        let shown: Vec<usize> = alone.iter().skip(share / 2).step_by(share).copied().collect();
        let mut kinds: Vec<Kind> =
            follows.iter().map(|follows| if *follows { Kind::Rigid } else { Kind::Hidden }).collect();
        shown.iter().for_each(|&i| kinds[i] = Kind::Track);
        let growth = 0.5 * (alone.len().max(1) as f32 / shown.len().max(1) as f32).ln();
        let in_all = |value: &dyn Fn(&Still, usize) -> f32| {
            extent(stills.iter().flat_map(|still| shown.iter().map(move |&i| value(still, i))))
        };
        let corners = [0, 1, 2].map(|axis| in_all(&|still, i| still.centers[i][axis] as f32));
        let [_, largest] =
            in_all(&|still, i| still.log_scales[i].into_iter().fold(f32::NEG_INFINITY, f32::max) + growth);
        let of_one = |&i: &usize| {
            let mut last = Axes { log_scales: at_rest.log_scales[i], rotation: at_rest.rotations[i] };
            let next = |still: &Still| {
                last = Axes { log_scales: still.log_scales[i], rotation: still.rotations[i] }.nearest_to(&last);
                last
            };
            stills.iter().map(next).collect::<Vec<_>>()
        };
        Self {
            kinds,
            axes: parallel::map(&shown, of_one),
            shown,
            of: alone.len(),
            corners: [corners.map(|[low, _]| low), corners.map(|[_, high]| high)],
            log_scales: [largest - LOG_SCALE_SPAN, largest],
            growth,
        }
    }

    /// One byte per Gaussian, then for each frame 13 columns: low and high byte of x, y, z (u16), log scales (3 u8),
    /// quaternion x y z w (4 i8). Columns hold the differences from the frame before, modulo 2^8 or 2^16.
    pub(super) fn bytes(&self, stills: &[Still]) -> Vec<u8> {
        let mut bytes: Vec<u8> = self.kinds.iter().map(|&kind| kind as u8).collect();
        let mut last = vec![[0_u16; 10]; self.shown.len()];
        for (frame, still) in stills.iter().enumerate() {
            let now: Vec<[u16; 10]> =
                self.shown.iter().enumerate().map(|(at, &i)| self.numbers(still, i, &self.axes[at][frame])).collect();
            for column in 0..10 {
                let steps = || now.iter().zip(&last).map(|(now, last)| now[column].wrapping_sub(last[column]));
                bytes.extend(steps().map(|step| step as u8));
                if column < 3 {
                    bytes.extend(steps().map(|step| (step >> 8) as u8));
                }
            }
            last = now;
        }
        bytes
    }

    fn numbers(&self, still: &Still, i: usize, axes: &Axes) -> [u16; 10] {
        let [lows, highs] = &self.corners;
        std::array::from_fn(|column| match column {
            0..3 => {
                let width = (highs[column] - lows[column]).max(f32::MIN_POSITIVE);
                ((still.centers[i][column] as f32 - lows[column]) / width * 65535.0).round() as u16
            }
            3..6 => u16::from(byte((axes.log_scales[column - 3] + self.growth - self.log_scales[0]) / LOG_SCALE_SPAN)),
            _ => u16::from(((axes.rotation.coords[column - 6] * 127.0).round() as i8).cast_unsigned()),
        })
    }
}

impl Axes {
    /// The same covariance, with the axes, and the sign of the quaternion, that are nearest to `last`'s.
    fn nearest_to(self, last: &Self) -> Self {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        let (own, wanted) = (self.rotation.to_rotation_matrix(), last.rotation.to_rotation_matrix());
        let cosines: Matrix3<f64> = wanted.matrix().transpose() * own.matrix();
        let likeness = |order: &[usize; 3]| (0..3).map(|axis| cosines[(axis, order[axis])].abs()).sum::<f64>();
        let order =
            ORDERS.iter().copied().reduce(|best, next| if likeness(&next) > likeness(&best) { next } else { best });
        let order = order.expect("there are six");
        let columns: [Vector3<f64>; 3] = [0, 1, 2].map(|axis| {
            let sign = if cosines[(axis, order[axis])] < 0.0 { -1.0 } else { 1.0 };
            sign * own.matrix().column(order[axis])
        });
        let mut matrix = Matrix3::from_columns(&columns);
        if matrix.determinant() < 0.0 {
            // The axis that fits least is turned round.
            let worst = (0..3).min_by(|&a, &b| cosines[(a, order[a])].abs().total_cmp(&cosines[(b, order[b])].abs()));
            matrix.column_mut(worst.expect("there are three")).neg_mut();
        }
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
        let is_opposite = turn.coords.dot(&last.rotation.coords) < 0.0;
        Self {
            log_scales: order.map(|axis| self.log_scales[axis]),
            rotation: if is_opposite { UnitQuaternion::new_unchecked(-turn.into_inner()) } else { turn },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn covariance(axes: &Axes) -> Matrix3<f64> {
        let scales = Matrix3::from_diagonal(&Vector3::from(axes.log_scales.map(|s| f64::from(s).exp())));
        let a = axes.rotation.to_rotation_matrix() * scales;
        a * a.transpose()
    }

    #[test]
    fn axes_are_reordered_without_changing_the_covariance() {
        let last = Axes { log_scales: [0.0, -1.0, -2.0], rotation: UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3) };
        // The same Gaussian, a little turned, as another decomposition: axes permuted, two of them reversed.
        let own = UnitQuaternion::from_euler_angles(0.12, 0.18, 0.33).to_rotation_matrix();
        let [x, y, z] = [0, 1, 2].map(|axis| own.matrix().column(axis).into_owned());
        let permuted = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[-y, -z, x]));
        let now = Axes { log_scales: [-1.0, -2.0, 0.0], rotation: UnitQuaternion::from_rotation_matrix(&permuted) };
        let nearest = now.nearest_to(&last);
        assert_eq!(nearest.log_scales, last.log_scales);
        assert!(nearest.rotation.angle_to(&last.rotation) < 0.05, "{}", nearest.rotation.angle_to(&last.rotation));
        assert!(nearest.rotation.coords.dot(&last.rotation.coords) > 0.0);
        assert!((covariance(&nearest) - covariance(&now)).norm() < 1e-12, "the same shape");
    }

    #[test]
    fn tracks_are_differences_that_add_up() {
        let still = |x: f64| Still {
            centers: vec![Point3::origin(), Point3::new(x, 0.0, 0.0), Point3::new(x, 1.0, 0.0)],
            log_scales: vec![[-1.0; 3]; 3],
            rotations: vec![UnitQuaternion::identity(); 3],
        };
        let stills = [still(0.0), still(2.0), still(1.0)];
        let tracks = Tracks::new(&[true, false, false], 1, &stills[0], &stills);
        assert_eq!((tracks.shown.clone(), tracks.of), (vec![1, 2], 2));
        let bytes = tracks.bytes(&stills);
        assert_eq!(bytes[..3], [0, 1, 1], "one follows its part, two have tracks");
        assert_eq!(bytes.len(), 3 + 3 * 13 * 2);
        let x = |frame: usize| {
            let at = 3 + frame * 26;
            u16::from_le_bytes([bytes[at], bytes[at + 2]])
        };
        assert_eq!(x(0), 0);
        assert_eq!(x(0).wrapping_add(x(1)), 65535);
        assert_eq!(x(0).wrapping_add(x(1)).wrapping_add(x(2)), 32768);
        // Every second one, with twice the area.
        let thinned = Tracks::new(&[true, false, false], 2, &stills[0], &stills);
        assert_eq!((thinned.shown.clone(), thinned.of), (vec![2], 2));
        assert!((thinned.log_scales[1] - (-1.0 + 0.5 * 2.0_f32.ln())).abs() < 1e-6);
        assert_eq!(thinned.bytes(&stills)[..3], [0, 2, 1]);
    }
}
