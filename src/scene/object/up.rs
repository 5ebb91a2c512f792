//! Which way is up, as the cameras suggest. gprop takes z as up, and COLMAP does not: its world has the axes of whichever
//! photo it started from. Photographers hold their cameras upright, so the mean of the cameras' up directions tells.

use nalgebra::Vector3;

use crate::scene::View;

/// Fewer cameras may all be tilted alike.
const FEWEST_CAMERAS: usize = 3;
/// Least length of the mean of the cameras' up directions, which is 1 if they are all the same: if it is shorter, the
/// cameras do not agree about what is up.
const LEAST_AGREEMENT: f64 = 0.5;

/// A warning if the axis nearest to the cameras' mean up direction is not +z.
pub(in crate::scene) fn warning(views: &[View]) -> Option<String> {
    if views.len() < FEWEST_CAMERAS {
        return None;
    }
    // OpenCV: y points down in the photo.
    let up_in_camera = -Vector3::<f64>::y();
    let ups = views.iter().map(|view| view.camera.camera_from_world.inverse_transform_vector(&up_in_camera));
    let mean = ups.fold(Vector3::zeros(), |sum: Vector3<f64>, up| sum + up) / views.len() as f64;
    if mean.norm() < LEAST_AGREEMENT {
        return None;
    }
    let axis = mean.iamax();
    let sign = if mean[axis] < 0.0 { '-' } else { '+' };
    let lying = match (sign, axis) {
        ('+', 2) => return None,
        ('-', 2) => "upside down",
        _ => "lying on its side",
    };
    Some(format!(
        "the cameras suggest that {sign}{} is up, but gprop takes z as up: the simulation, its film and the exports will have \
         the object {lying}; turn splat and cameras together so that z points up",
        ["x", "y", "z"][axis]
    ))
}
