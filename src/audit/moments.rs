//! Volume, centre and second moments of shapes of density 1.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::scene::mesh::containers::Geometry;

/// The mass properties of a body of density 1 (or, of a sheet, of area density 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Volume; of a sheet, area.
    pub amount: f64,
    pub center: Vector3<f64>,
    /// The integral of x x^T about the centre.
    pub second: Matrix3<f64>,
}

impl Moments {
    /// From an inertia about the centre: J = tr(I) / 2 - I.
    pub fn from_inertia(amount: f64, center: Vector3<f64>, inertia: Matrix3<f64>) -> Self {
        Self { amount, center, second: Matrix3::identity() * (inertia.trace() / 2.0) - inertia }
    }

    /// Of a simple shape in its own frame; `None` for planes and meshes.
    ///
    /// The closed forms are those of any table of moments of inertia. A capsule is a cylinder of half length h and two
    /// half balls, whose own second moment along the axis about their flat side is V r^2 / 5 and whose centre lies 3 r / 8
    /// beyond it.
    pub fn of_simple(geometry: &Geometry) -> Option<Self> {
        let diagonal = |volume: f64, x: f64, y: f64, z: f64| Self {
            amount: volume,
            center: Vector3::zeros(),
            second: Matrix3::from_diagonal(&Vector3::new(x, y, z)) * volume,
        };
        Some(match *geometry {
            Geometry::Box { half: [a, b, c] } => diagonal(8.0 * a * b * c, a * a / 3.0, b * b / 3.0, c * c / 3.0),
            Geometry::Sphere { radius } => Self::of_simple(&Geometry::Ellipsoid { half: [radius; 3] })?,
            Geometry::Ellipsoid { half: [a, b, c] } => {
                diagonal(4.0 / 3.0 * PI * a * b * c, a * a / 5.0, b * b / 5.0, c * c / 5.0)
            }
            Geometry::Cylinder { radius: r, half_length: h } => {
                diagonal(2.0 * PI * r * r * h, r * r / 4.0, r * r / 4.0, h * h / 3.0)
            }
            Geometry::Capsule { radius: r, half_length: h } => {
                let (tube, ball) = (2.0 * PI * r * r * h, 4.0 / 3.0 * PI * r * r * r);
                let across = tube * r * r / 4.0 + ball * r * r / 5.0;
                let along = tube * h * h / 3.0 + ball * (r * r / 5.0 + h * h + 0.75 * h * r);
                Self {
                    amount: tube + ball,
                    center: Vector3::zeros(),
                    second: Matrix3::from_diagonal(&Vector3::new(across, across, along)),
                }
            }
            Geometry::Plane | Geometry::Mesh(_) | Geometry::Own(_) | Geometry::Other(_) => return None,
        })
    }

    /// Of the body after a linear map and a rigid motion.
    pub fn mapped(&self, linear: &Matrix3<f64>, pose: &Isometry3<f64>) -> Self {
        let rotation = pose.rotation.to_rotation_matrix();
        let whole = rotation.matrix() * linear;
        let factor = linear.determinant().abs();
        Self {
            amount: self.amount * factor,
            center: whole * self.center + pose.translation.vector,
            second: whole * self.second * whole.transpose() * factor,
        }
    }

    /// Of several bodies together; `None` if there is nothing of them.
    pub fn sum(all: impl IntoIterator<Item = Self>) -> Option<Self> {
        let all: Vec<Self> = all.into_iter().collect();
        let amount: f64 = all.iter().map(|one| one.amount).sum();
        let center = all.iter().map(|one| one.center * one.amount).sum::<Vector3<f64>>() / amount;
        let second = |one: &Self| one.second + (one.center - center) * (one.center - center).transpose() * one.amount;
        let second = all.iter().map(second).sum();
        (amount > 0.0 && amount.is_finite()).then_some(Self { amount, center, second })
    }

    /// The inertia about the centre of a body of this mass and one density: I = tr(J) - J.
    pub fn inertia_kg_m2(&self, mass_kg: f64) -> Matrix3<f64> {
        (Matrix3::identity() * self.second.trace() - self.second) * (mass_kg / self.amount)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};

    use super::*;

    #[test]
    fn shapes_have_the_inertia_of_the_tables() {
        let inertia = |geometry: &Geometry| Moments::of_simple(geometry).unwrap().inertia_kg_m2(3.0).diagonal();
        let close = |a: Vector3<f64>, b: [f64; 3]| assert!((a - Vector3::from(b)).norm() < 1e-12, "{a} {b:?}");
        // Solid ball: 2/5 m r^2.
        close(inertia(&Geometry::Sphere { radius: 2.0 }), [4.8; 3]);
        // Box: m (b^2 + c^2) / 12 with whole sides.
        close(inertia(&Geometry::Box { half: [1.0, 2.0, 3.0] }), [13.0, 10.0, 5.0]);
        // Cylinder: m (3 r^2 + l^2) / 12 and m r^2 / 2.
        close(inertia(&Geometry::Cylinder { radius: 1.0, half_length: 2.0 }), [4.75, 4.75, 1.5]);
        // A capsule without a tube is a ball.
        close(inertia(&Geometry::Capsule { radius: 2.0, half_length: 0.0 }), [4.8; 3]);
        // Capsule of r = 1, h = 1: with cylinder 2 pi and ball 4 pi / 3, J along = 2/3 + 4/3 (1/5 + 1 + 3/4) per pi.
        let capsule = Moments::of_simple(&Geometry::Capsule { radius: 1.0, half_length: 1.0 }).unwrap();
        assert!((capsule.second[(2, 2)] / PI - (2.0 / 3.0 + 4.0 / 3.0 * 1.95)).abs() < 1e-12);
    }

    #[test]
    fn two_halves_of_a_box_are_the_box() {
        let half = Moments::of_simple(&Geometry::Box { half: [1.0, 1.0, 1.0] }).unwrap();
        let half_at = |x: f64| {
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
            half.mapped(
                &Matrix3::from_diagonal(&Vector3::new(2.0, 0.5, 1.0)),
                &Isometry3::from_parts(Translation3::new(x, 1.0, 0.0), turn),
            )
        };
        let both = Moments::sum([half_at(0.0), half_at(1.0)]).unwrap();
        let whole = Moments::of_simple(&Geometry::Box { half: [1.0, 2.0, 1.0] }).unwrap();
        assert!((both.center - Vector3::new(0.5, 1.0, 0.0)).norm() < 1e-12);
        assert!((both.second - whole.second).norm() < 1e-12, "{both:?}");
        assert_eq!(Moments::sum([]), None);
    }
}
