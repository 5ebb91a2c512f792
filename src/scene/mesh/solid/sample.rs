//! Places spread evenly over triangles.

use nalgebra::{Point3, Unit, Vector3};

use super::connected::area_of;

/// Steps of a sequence that fills the unit square evenly: the reciprocal of the plastic number and its square (Roberts 2018).
const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_2];

/// A place on a triangle.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Number of the triangle in the surface.
    pub triangle: u32,
    pub point: Point3<f64>,
    /// To the triangle's front.
    pub normal: Unit<Vector3<f64>>,
}

/// `count` places on the `triangles`, each for the same area; none if they have no area. `corners` are those of all
/// triangles of the surface.
pub fn places(corners: &[[Point3<f64>; 3]], triangles: &[u32], count: usize) -> Vec<Place> {
    let area: f64 = triangles.iter().map(|n| area_of(&corners[*n as usize])).sum();
    let mut places = Vec::with_capacity(count);
    let mut passed = 0.0;
    for &triangle in triangles {
        let [a, b, c] = corners[triangle as usize];
        passed += area_of(&[a, b, c]);
        let Some(normal) = Unit::try_new((b - a).cross(&(c - a)), 0.0) else { continue };
        while places.len() < count && passed > area * (places.len() as f64 + 0.5) / count as f64 {
            let [along, across] = STEPS.map(|step| (step * (places.len() + 1) as f64).fract());
            // Uniform within the triangle (Osada et al. 2002).
            let root = along.sqrt();
            let point = a + (b - a) * (root * (1.0 - across)) + (c - a) * (root * across);
            places.push(Place { triangle, point, normal });
        }
    }
    places
}
