//! Numerical functions for several modules: medians, directions spread evenly over a sphere, and the light of colours.

use std::f64::consts::PI;

use nalgebra::Vector3;

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

/// The light of a channel of sRGB, 0 to 1 (IEC 61966-2-1).
pub fn srgb_light(channel: u8) -> f64 {
    let c = f64::from(channel) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
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
}
