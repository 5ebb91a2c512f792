//! Rotation of spherical harmonics.
//!
//! The rotated colour function at direction d is the old one at R^T d. A band of degree l is a space of 2l + 1
//! dimensions that is closed under rotation, so its new coefficients follow from the values in as many fixed
//! directions.

use std::sync::OnceLock;

use nalgebra::{DMatrix, Rotation3, Vector3};

use super::sh_basis;

/// Number of functions of the highest band.
const MOST: usize = 7;

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

/// A rotation of the coefficients beyond the constant one.
pub struct ShRotation {
    /// For each band, the rows of its matrix, one after the other.
    bands: Vec<Vec<f64>>,
}

impl ShRotation {
    /// The rotation of functions up to this degree, at most 3.
    pub fn new(sh_degree: u8, rotation: &Rotation3<f64>) -> Self {
        static BANDS: OnceLock<[Band; 3]> = OnceLock::new();
        let bands = &BANDS.get_or_init(|| [1, 2, 3].map(Band::new))[..usize::from(sh_degree)];
        let matrix = |band: &Band| {
            let count = band.directions.len();
            let values = |d: &Vector3<f64>| basis(band.degree, &rotation.inverse_transform_vector(d));
            let old: Vec<Vec<f64>> = band.directions.iter().map(values).collect();
            let values = DMatrix::from_fn(count, count, |k, c| old[k][c]);
            (&band.from_values * values).transpose().as_slice().to_vec()
        };
        Self { bands: bands.iter().map(matrix).collect() }
    }

    /// Rotates a Gaussian's coefficients, channel-major as in a PLY.
    pub fn rotate(&self, coefficients: &mut [f32]) {
        let per_channel = coefficients.len() / 3;
        if per_channel == 0 {
            return;
        }
        for channel in coefficients.chunks_exact_mut(per_channel) {
            let mut rest = channel;
            for (degree, matrix) in (1..).zip(&self.bands) {
                let count = 2 * degree + 1;
                let (band, further) = rest.split_at_mut(count);
                let mut old = [0.0; MOST];
                old[..count].copy_from_slice(band);
                for (new, row) in band.iter_mut().zip(matrix.chunks_exact(count)) {
                    *new = row.iter().zip(old).map(|(factor, value)| factor * f64::from(value)).sum::<f64>() as f32;
                }
                rest = further;
            }
        }
    }
}
