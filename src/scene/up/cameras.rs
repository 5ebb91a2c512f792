//! Which way is up, as the cameras suggest. Photographers hold their cameras level: the photos' horizontal axes lie in a plane,
//! and up is its normal. If all cameras look the same way, so that the axes span no plane, it is the mean of the cameras' own up
//! directions, which is as far from up as the cameras look down.

use nalgebra::{Matrix3, Vector3};

use crate::numeric::principal;
use crate::scene::View;

/// Fewer cameras may all be tilted alike.
const FEWEST: usize = 3;
/// Least length of the mean of the cameras' up directions, which is 1 if they are all the same: if it is shorter, the cameras do
/// not agree about what is up.
const LEAST_AGREEMENT: f64 = 0.5;
/// The horizontal axes span a plane if their mean square across it is at most this share of that along its narrower direction:
/// 0.002 to 0.011 in captures all around an object.
const FLATNESS: f64 = 0.1;
/// Least mean square of the horizontal axes along that narrower direction for them to span a plane: they spread by 6 degrees.
const LEAST_SPREAD: f64 = 0.01;
/// Least cosine between the plane's normal and the mean up direction (75 degrees, beyond which all cameras would look nearly
/// straight down).
const LEAST_COSINE: f64 = 0.26;

/// The unit vector that the cameras suggest; `None` if there are too few, or they do not agree.
pub(in crate::scene) fn up(views: &[View]) -> Option<Vector3<f64>> {
    if views.len() < FEWEST {
        return None;
    }
    let of_all = |axis: Vector3<f64>| {
        views.iter().map(move |view| view.camera.camera_from_world.inverse_transform_vector(&axis))
    };
    let count = views.len() as f64;
    // OpenCV: y points down in the photo.
    let mean = -of_all(Vector3::y()).sum::<Vector3<f64>>() / count;
    if mean.norm() < LEAST_AGREEMENT {
        return None;
    }
    let mean = mean.normalize();
    let spread: Matrix3<f64> =
        of_all(Vector3::x()).map(|right| right * right.transpose()).sum::<Matrix3<f64>>() / count;
    Some(
        normal(&spread)
            .map(|normal| normal * normal.dot(&mean).signum())
            .filter(|up| up.dot(&mean) > LEAST_COSINE)
            .unwrap_or(mean),
    )
}

/// The normal of the plane in which vectors with these mean products lie; `None` if they span no plane.
fn normal(spread: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let axes = principal(spread)?;
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| axes.eigenvalues[*a].total_cmp(&axes.eigenvalues[*b]));
    let [least, middle, _] = order.map(|n| axes.eigenvalues[n]);
    (middle > LEAST_SPREAD && least < FLATNESS * middle).then(|| axes.eigenvectors.column(order[0]).into_owned())
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, UnitQuaternion};

    use super::*;
    use crate::camera::{Camera, Distortion, Intrinsics};
    use crate::scene::Upright;

    /// Views from a part of a circle, all looking down at its middle, the photo turned about the optical axis by `roll`.
    fn around(turns: f64, roll: f64) -> Vec<View> {
        const COUNT: usize = 20;
        let view = |n: usize| {
            let (sin, cos) = (std::f64::consts::TAU * turns * n as f64 / COUNT as f64).sin_cos();
            let eye = Point3::new(cos, sin, 1.0);
            let pose = Isometry3::face_towards(&eye, &Point3::origin(), &-Vector3::z()).inverse();
            let sway = if n.is_multiple_of(2) { roll } else { -roll };
            let camera_from_world = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sway) * pose;
            let intrinsics =
                Intrinsics { width: 8, height: 6, fx: 8.0, fy: 8.0, cx: 4.0, cy: 3.0, distortion: Distortion::None };
            View {
                name: n.to_string(),
                camera: Camera { intrinsics, camera_from_world },
                image: "photo.jpg".into(),
                upright: Upright::AsStored,
                mask: None,
            }
        };
        (0..COUNT).map(view).collect()
    }

    #[test]
    fn cameras_on_a_part_of_a_circle_tell_which_way_is_up() {
        for turns in [1.0, 0.5, 0.25] {
            let angle = up(&around(turns, 0.05)).unwrap().angle(&Vector3::z());
            // Each camera sways by 3 degrees; the swings nearly cancel.
            assert!(angle < 0.02, "{turns} turns: {angle} rad");
        }
    }

    #[test]
    fn cameras_that_look_the_same_way_give_their_own_up() {
        // They look down by 45 degrees, from one place.
        let angle = up(&around(0.0, 0.0)).unwrap().angle(&Vector3::z());
        assert!((angle - 0.25 * std::f64::consts::PI).abs() < 1e-9, "{angle}");
    }

    #[test]
    fn cameras_that_do_not_agree_suggest_nothing() {
        assert_eq!(up(&around(1.0, 0.0)[..2]), None);
        let mut views = around(1.0, 0.0);
        for view in views.iter_mut().step_by(2) {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
            view.camera.camera_from_world = turn * view.camera.camera_from_world;
        }
        assert_eq!(up(&views), None);
    }
}
