//! Rotation of spherical harmonics.
//!
//! The rotated colour function at direction d is the old one at R^T d. A band of degree l is a space of 2l + 1
//! dimensions that is closed under rotation, so its new coefficients follow from the values in as many fixed
//! directions.

use std::sync::OnceLock;

use nalgebra::{DMatrix, Rotation3, Vector3};

use super::sh_basis;

/// The sampling of one band.
struct Band {
    degree: usize,
    /// Unit vectors, 2l + 1 of them.
    directions: Vec<Vector3<f64>>,
    /// Matrix that gives the coefficients from the values in these directions.
    from_values: DMatrix<f64>,
}

impl Band {
    fn new(degree: usize) -> Self {
        let count = 2 * degree + 1;
        // A golden spiral over a hemisphere: no two directions are opposite, so no band's values are repeated.
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let directions: Vec<Vector3<f64>> = (0..count)
            .map(|k| {
                let z = (k as f64 + 0.5) / count as f64;
                let radius = (1.0 - z * z).sqrt();
                Vector3::new(radius * (golden * k as f64).cos(), radius * (golden * k as f64).sin(), z)
            })
            .collect();
        let values = DMatrix::from_fn(count, count, |k, c| basis(degree, &directions[k])[c]);
        let from_values = values.try_inverse().expect("the directions tell the basis functions apart");
        Self { degree, directions, from_values }
    }
}

/// The 2l + 1 basis functions of degree l in direction `d`.
fn basis(degree: usize, d: &Vector3<f64>) -> Vec<f64> {
    let all = sh_basis(3, d.map(|x| x as f32).into());
    all[degree * degree - 1..(degree + 1) * (degree + 1) - 1].iter().map(|b| f64::from(*b)).collect()
}

/// Rotates a Gaussian's coefficients beyond the constant one (channel-major, as in a PLY) by `rotation`.
pub fn rotate(sh_degree: u8, coefficients: &mut [f32], rotation: &Rotation3<f64>) {
    static BANDS: OnceLock<[Band; 3]> = OnceLock::new();
    let per_channel = coefficients.len() / 3;
    for band in &BANDS.get_or_init(|| [1, 2, 3].map(Band::new))[..usize::from(sh_degree)] {
        let first = band.degree * band.degree - 1;
        let count = band.directions.len();
        let old: Vec<Vec<f64>> =
            band.directions.iter().map(|d| basis(band.degree, &rotation.inverse_transform_vector(d))).collect();
        for channel in coefficients.chunks_exact_mut(per_channel) {
            let channel = &mut channel[first..first + count];
            let values: Vec<f64> =
                old.iter().map(|b| b.iter().zip(&*channel).map(|(b, c)| b * f64::from(*c)).sum()).collect();
            for (c, row) in channel.iter_mut().zip(band.from_values.row_iter()) {
                *c = row.iter().zip(&values).map(|(m, v)| m * v).sum::<f64>() as f32;
            }
        }
    }
}
