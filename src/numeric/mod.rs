//! Numerical functions and constants for several modules: medians, intervals, directions and rotations spread evenly, the
//! point where lines meet, rigid motions, convex hulls, lists, disjoint sets, and the linear light of sRGB colours.

pub mod forest;
pub mod hull;
pub mod lists;
pub mod nearest;

use std::f64::consts::PI;

use nalgebra::{
    Isometry3, Matrix3, Point3, Quaternion, Rotation3, SVD, SymmetricEigen, Translation3, U3, UnitQuaternion, Vector3,
};

/// Half-width of a 90 % interval of a normal distribution, in standard deviations.
pub const NORMAL_90: f64 = 1.645;

/// The median; for an even number of values the mean of the two in the middle. `None` if there are none.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    let upper = *values.get(half)?;
    Some(if values.len() % 2 == 1 { upper } else { 0.5 * (values[half - 1] + upper) })
}

/// The median as one of the values: for an even number of them, the larger of the two in the middle. `None` if there
/// are none.
pub fn upper_median(mut values: Vec<f64>) -> Option<f64> {
    let half = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(half, f64::total_cmp).1)
}

/// The mean of points, and the sum of the outer products of their distances from it.
pub fn scatter<'a>(points: impl ExactSizeIterator<Item = &'a Vector3<f64>> + Clone) -> (Vector3<f64>, Matrix3<f64>) {
    let mean = points.clone().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    (mean, points.map(|point| (point - mean) * (point - mean).transpose()).sum())
}

/// At most `most` of the values, evenly spread.
pub fn evenly<T>(values: &[T], most: usize) -> impl Iterator<Item = &T> {
    values.iter().step_by(values.len().div_ceil(most).max(1))
}

/// Unit vectors spread evenly over the sphere: a Fibonacci lattice (Gonzalez 2010).
pub fn sphere_directions(count: usize) -> impl Iterator<Item = Vector3<f64>> {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (sin, cos) = (golden_angle * i as f64).sin_cos();
        let across = (1.0 - z * z).sqrt();
        Vector3::new(across * cos, across * sin, z)
    })
}

/// Rotations spread evenly over all of them: super-Fibonacci spirals (Alexa 2022).
pub fn all_rotations(count: usize) -> impl Iterator<Item = UnitQuaternion<f64>> {
    /// The positive root of x^4 = x + 4, which the paper derives; the other irrational is the square root of two.
    const PSI: f64 = 1.533_751_168_755_204_3;
    (0..count).map(move |i| {
        let at = i as f64 + 0.5;
        let (inner, outer) = ((at / count as f64).sqrt(), (1.0 - at / count as f64).sqrt());
        let (alpha, beta) = (2.0 * PI * at / 2.0_f64.sqrt(), 2.0 * PI * at / PSI);
        let (x, y) = (inner * alpha.sin(), inner * alpha.cos());
        UnitQuaternion::new_normalize(Quaternion::new(outer * beta.cos(), x, y, outer * beta.sin()))
    })
}

/// The point with the least sum of squared distances from all lines (through `centers` along `axes`); `None` if the
/// lines are parallel.
pub fn nearest_to_lines(centers: &[Point3<f64>], axes: &[Vector3<f64>]) -> Option<Point3<f64>> {
    let mut sum = Matrix3::zeros();
    let mut weighted = Vector3::zeros();
    for (center, axis) in centers.iter().zip(axes) {
        let across = Matrix3::identity() - axis * axis.transpose();
        sum += across;
        weighted += across * center.coords;
    }
    let least = sum.symmetric_eigenvalues().min();
    (least > 1e-3 * centers.len() as f64).then(|| sum.try_inverse().map(|inverse| (inverse * weighted).into()))?
}

/// The rigid motion that brings the first point of each pair nearest to the second: the one with the least sum of squared
/// distances (Kabsch 1976).
pub fn rigid_motion(pairs: impl Iterator<Item = (Point3<f64>, Point3<f64>)> + Clone) -> Isometry3<f64> {
    let (count, from, to) = pairs.clone().fold((0, Vector3::zeros(), Vector3::zeros()), |(count, from, to), (a, b)| {
        (count + 1, from + a.coords, to + b.coords)
    });
    if count == 0 {
        return Isometry3::identity();
    }
    let (from, to) = (from / f64::from(count), to / f64::from(count));
    let correlation: Matrix3<f64> = pairs.map(|(a, b)| (b.coords - to) * (a.coords - from).transpose()).sum();
    let svd = SVD::new(correlation, true, true);
    let (u, v_t) = (svd.u.expect("asked for"), svd.v_t.expect("asked for"));
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * flip * v_t));
    Isometry3::from_parts(Translation3::from(to - turn * from), turn)
}

/// The linear light of an sRGB byte, 0 to 1.
pub fn srgb_light(channel: u8) -> f64 {
    linear(f64::from(channel) / 255.0)
}

/// The linear light of an sRGB value, both 0 to 1 (IEC 61966-2-1).
pub fn linear(srgb: f64) -> f64 {
    if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB value of linear light, both 0 to 1 (IEC 61966-2-1); what lies outside counts as the nearer end.
pub fn srgb(light: f32) -> f32 {
    let light = light.clamp(0.0, 1.0);
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}

/// The principal moments of an inertia and their axes, in no order; `None` for numbers so large that computing with them ends in
/// none.
pub fn principal(inertia: &Matrix3<f64>) -> Option<SymmetricEigen<f64, U3>> {
    /// More sweeps than any matrix of numbers of ordinary size takes.
    const MOST_SWEEPS: usize = 1000;
    let is_finite = inertia.iter().all(|number| number.is_finite());
    SymmetricEigen::try_new(is_finite.then_some(*inertia)?, f64::EPSILON, MOST_SWEEPS)
}

/// The principal moments of an inertia, and the rotation from their axes to its own; `None` as for [`principal`].
pub fn principal_axes(inertia: &Matrix3<f64>) -> Option<(Vector3<f64>, UnitQuaternion<f64>)> {
    let eigen = principal(inertia)?;
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    Some((eigen.eigenvalues, UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_and_even_numbers() {
        let both = |values: &[f64]| (median(values.to_vec()), upper_median(values.to_vec()));
        assert_eq!(both(&[]), (None, None));
        assert_eq!(both(&[3.0]), (Some(3.0), Some(3.0)));
        assert_eq!(both(&[5.0, 1.0, 3.0]), (Some(3.0), Some(3.0)));
        assert_eq!(both(&[4.0, 1.0, 2.0, 9.0]), (Some(3.0), Some(4.0)));
    }

    #[test]
    fn directions_are_units_and_even() {
        let directions: Vec<_> = sphere_directions(500).collect();
        assert!(directions.iter().all(|direction| (direction.norm() - 1.0).abs() < 1e-12));
        // Their mean is the origin, and every direction has its share of neighbours within a tenth of the sphere.
        assert!(directions.iter().sum::<Vector3<f64>>().norm() / 500.0 < 1e-3);
        let within = |axis: Vector3<f64>| directions.iter().filter(|one| one.dot(&axis) > 0.8).count();
        for axis in [Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::z()] {
            // A cap with cosine 0.8 is a tenth of the sphere.
            assert!((45..=55).contains(&within(axis)), "{}", within(axis));
        }
    }

    #[test]
    fn rotations_are_spread_over_all() {
        let rotations: Vec<_> = all_rotations(2000).collect();
        // A ball of 30 degrees around a rotation is (a - sin a) / pi of all, 0.75 %: 15 of 2000.
        for center in [UnitQuaternion::identity(), UnitQuaternion::from_euler_angles(1.0, 2.0, 3.0)] {
            let near = rotations.iter().filter(|one| one.angle_to(&center) < 30f64.to_radians()).count();
            assert!((10..=20).contains(&near), "{near}");
        }
    }
}
