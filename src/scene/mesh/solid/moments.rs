//! Volume, first and second moments of bodies of density 1.

use std::ops::{Add, Mul, Sub};

use nalgebra::{Matrix3, Point3, Vector3};

/// Integrals over a body. They add up over bodies, and a void counts negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    pub volume: f64,
    /// The integral of x.
    pub first: Vector3<f64>,
    /// The integral of x x^T.
    pub second: Matrix3<f64>,
}

impl Moments {
    pub const ZERO: Self = Self {
        volume: 0.0,
        first: Vector3::new(0.0, 0.0, 0.0),
        second: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Those of the tetrahedron between the origin and a triangle, negative if the triangle faces the origin. Over a
    /// closed surface they add up to those of its inside, by the divergence theorem (Mirtich 1996, "Fast and Accurate
    /// Computation of Polyhedral Mass Properties"; in this form Blow and Binstock 2004).
    ///
    /// With `det` the determinant of the corners a, b, c, volume is det / 6, the first moment det / 24 times the sum s of
    /// the corners, and the second det / 120 times (a a^T + b b^T + c c^T + s s^T).
    pub fn of_cone(corners: &[Point3<f64>; 3]) -> Self {
        let [a, b, c] = corners.map(|p| p.coords);
        let det = a.dot(&b.cross(&c));
        let sum = a + b + c;
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose();
        Self { volume: det / 6.0, first: sum * (det / 24.0), second: squares * (det / 120.0) }
    }

    /// Those of a cube with this centre and side.
    pub fn of_cube(center: Point3<f64>, side: f64) -> Self {
        let volume = side.powi(3);
        let own = Matrix3::identity() * (side * side / 12.0);
        let second = (center.coords * center.coords.transpose() + own) * volume;
        Self { volume, first: center.coords * volume, second }
    }

    /// The centre of mass; of a body without volume, not finite.
    pub fn center(&self) -> Point3<f64> {
        Point3::from(self.first / self.volume)
    }

    /// The inertia about the centre: trace(S) I - S, with S the second moment about the centre.
    pub fn inertia(&self) -> Matrix3<f64> {
        let center = self.center().coords;
        let about_center = self.second - center * center.transpose() * self.volume;
        Matrix3::identity() * about_center.trace() - about_center
    }
}

impl Add for Moments {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { volume: self.volume + other.volume, first: self.first + other.first, second: self.second + other.second }
    }
}

impl Sub for Moments {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + other * -1.0
    }
}

impl Mul<f64> for Moments {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self { volume: self.volume * factor, first: self.first * factor, second: self.second * factor }
    }
}
