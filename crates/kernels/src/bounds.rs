//! The position and size of the object.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::gaussians::Gaussians;

/// An axis-aligned box in the world frame, scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    pub min: Point3<f64>,
    pub max: Point3<f64>,
}

impl Bounds {
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }

    pub fn diagonal(&self) -> f64 {
        self.size().norm()
    }
}

/// Length of the object's longest side in scene units: of the box of least volume among those along the world's axes
/// and along the principal axes of the centres, each as in [`robust_bounds`].
pub fn longest_side(gaussians: &Gaussians) -> f64 {
    let chosen = opaque(gaussians);
    let center = |&i: &usize| gaussians.center(i).coords;
    // A single far stray would turn the principal axes.
    let near = robust_bounds(gaussians);
    let is_near = |center: &Vector3<f64>| *center >= near.min.coords && *center <= near.max.coords;
    let core: Vec<Vector3<f64>> = chosen.iter().map(center).filter(is_near).collect();
    let mean = core.iter().sum::<Vector3<f64>>() / core.len().max(1) as f64;
    let spread: Matrix3<f64> = core.iter().map(|center| (center - mean) * (center - mean).transpose()).sum();
    let sizes = [Matrix3::identity(), spread.symmetric_eigen().eigenvectors].map(|axes| {
        let along = |axis: usize| {
            let (low, high) = between_strays(chosen.iter().map(|i| axes.column(axis).dot(&center(i))).collect());
            high - low
        };
        [along(0), along(1), along(2)]
    });
    let volume = |size: &[f64; 3]| size.iter().product::<f64>();
    let smallest = sizes.into_iter().min_by(|a, b| volume(a).total_cmp(&volume(b)));
    smallest.into_iter().flatten().fold(0.0, f64::max)
}

/// Share of the centres that are left out at each end of an axis: trained splats have floaters, and one of them would
/// stretch the full box.
const STRAY_SHARE: f64 = 0.005;

/// The box between the 0.5 and the 99.5 percentile of the centres of the `opaque` Gaussians.
pub fn robust_bounds(gaussians: &Gaussians) -> Bounds {
    let chosen = opaque(gaussians);
    let mut bounds = Bounds { min: Point3::origin(), max: Point3::origin() };
    for axis in 0..3 {
        let values = chosen.iter().map(|&i| f64::from(gaussians.positions[i][axis])).collect();
        (bounds.min[axis], bounds.max[axis]) = between_strays(values);
    }
    bounds
}

/// The Gaussians that are at least half opaque (all if none is), excluding those set aside.
fn opaque(gaussians: &Gaussians) -> Vec<usize> {
    let kept = || (0..gaussians.len()).filter(|&i| !gaussians.is_set_aside(i));
    let chosen: Vec<usize> = kept().filter(|&i| gaussians.opacity_logits[i] >= 0.0).collect();
    if chosen.is_empty() { kept().collect() } else { chosen }
}

/// The least and the greatest of these values, apart from strays; zeros if there are no values.
fn between_strays(mut values: Vec<f64>) -> (f64, f64) {
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let strays = (values.len() as f64 * STRAY_SHARE) as usize;
    values.sort_unstable_by(f64::total_cmp);
    (values[strays], values[values.len() - 1 - strays])
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    /// A rod of 10 x 1 x 1, turned by this angle, with one stray Gaussian.
    fn rod(angle: f64) -> Gaussians {
        let turned = Rotation3::from_euler_angles(0.3 * angle, angle, 0.7 * angle);
        let ends = |index: usize, count: usize| index as f64 / (count - 1) as f64 - 0.5;
        let places = (0..201 * 25).map(|i| [10.0 * ends(i / 25, 201), ends(i / 5 % 5, 5), ends(i % 5, 5)]);
        let turn = |place: [f64; 3]| (turned * Vector3::from(place)).map(|v| v as f32).into();
        let positions: Vec<[f32; 3]> = places.map(turn).chain([[500.0, 0.0, 0.0]]).collect();
        Gaussians { opacity_logits: vec![3.0; positions.len()], positions, ..Gaussians::default() }
    }

    #[test]
    fn the_longest_side_does_not_depend_on_how_the_object_lies() {
        for angle in [0.0, 0.4, 1.0, 2.0] {
            let length = longest_side(&rod(angle));
            assert!((length / 10.0 - 1.0).abs() < 0.03, "turned by {angle}: {length}");
        }
        assert_eq!(longest_side(&Gaussians::default()), 0.0);
    }
}
