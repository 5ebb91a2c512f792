//! Turns Gaussians and views from one frame into another about the origin.

use nalgebra::{Similarity3, Translation3, UnitQuaternion};

use super::Up;
use crate::gaussians::{Gaussians, wxyz};
use crate::parallel;
use crate::render::sh_rotation::ShRotation;
use crate::scene::View;
use crate::scene::cameras::align::moved;

/// Turns a scene into the world's frame, and returns the Gaussians as they were; `None` if that is the same frame.
pub(in crate::scene) fn upright(up: &Up, cloud: &mut Gaussians, of_scene: &mut [View]) -> Option<Gaussians> {
    if up.is_z() {
        return None;
    }
    let as_read = cloud.clone();
    let turn = up.world_from_input();
    gaussians(cloud, &turn);
    views(of_scene, &turn);
    Some(as_read)
}

/// Turns places, orientations and view-dependent colours. Properties of the file that gprop does not know stay as they are.
pub(in crate::scene) fn gaussians(cloud: &mut Gaussians, turn: &UnitQuaternion<f64>) {
    let rotation = turn.to_rotation_matrix();
    let turned: Vec<([f32; 3], [f32; 4])> = parallel::map_range(cloud.len(), |i| {
        let own = turn * cloud.rotation(i);
        let position = (rotation * cloud.center(i)).map(|side| side as f32);
        (position.into(), wxyz(&own))
    });
    (cloud.positions, cloud.rotations) = turned.into_iter().unzip();
    let (degree, count) = (cloud.sh_degree, 3 * cloud.sh_rest_per_channel());
    if count > 0 {
        let turned = ShRotation::new(degree, &rotation);
        parallel::for_each_chunk_mut(&mut cloud.sh_rest, count, |_, rest| turned.rotate(rest));
    }
}

/// Turns the cameras.
pub(in crate::scene) fn views(views: &mut [View], turn: &UnitQuaternion<f64>) {
    let turn = Similarity3::from_parts(Translation3::identity(), *turn, 1.0);
    for view in views {
        view.camera.camera_from_world = moved(&view.camera.camera_from_world, &turn);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::numeric::sphere_directions;
    use crate::render::sh_color;

    #[test]
    fn a_turned_gaussian_looks_the_same_from_the_turned_side() {
        let turn = UnitQuaternion::from_euler_angles(0.7, -1.9, 2.6);
        let values = |count: usize, salt: f32| (0..count).map(move |n| (salt * n as f32).sin());
        for degree in 0..=3_u8 {
            let before = Gaussians {
                positions: vec![[1.0, -2.0, 3.0]],
                log_scales: vec![[-1.0, -2.0, -3.0]],
                rotations: vec![[0.9, 0.3, -0.4, 0.6]],
                opacity_logits: vec![2.0],
                sh_dc: vec![[3.0, 4.0, 5.0]],
                sh_degree: degree,
                sh_rest: values(3 * (usize::from(degree + 1).pow(2) - 1), 1.7).collect(),
                ..Gaussians::default()
            };
            let mut after = before.clone();
            gaussians(&mut after, &turn);
            assert!((turn * before.center(0) - after.center(0)).norm() < 1e-6);
            let matrix = turn.to_rotation_matrix();
            let turned = matrix.matrix() * before.covariance(0) * matrix.matrix().transpose();
            assert!((turned - after.covariance(0)).norm() < 1e-6);
            for direction in sphere_directions(50) {
                let seen = |cloud: &Gaussians, along: Vector3<f64>| sh_color(cloud, 0, along.map(|c| c as f32).into());
                let (one, other) = (seen(&before, direction), seen(&after, turn * direction));
                for (one, other) in one.into_iter().zip(other) {
                    assert!((one - other).abs() < 1e-5, "degree {degree}: {one} and {other} along {direction}");
                }
            }
        }
    }
}
