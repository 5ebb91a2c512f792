//! The frame in which a surface is measured: moved to the middle of its box, scaled to a size of about 1, and turned.
//!
//! So tolerances are the same for every mesh, no digits are lost far from the origin, and no face that is parallel to the
//! mesh's axes is parallel to the cells or rays of the measurement, whose errors would then add up.

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

use super::moments::Moments;
use crate::scene::mesh::Triangles;

/// Euler angles of the turn, radians: any that are far from all multiples of 45 degrees.
const TURN: [f64; 3] = [0.37, 0.59, 0.23];

/// From the mesh's own frame to that of the measurement.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    middle: Point3<f64>,
    /// A power of two, so that scaling is exact.
    scale: f64,
    turn: Rotation3<f64>,
}

impl Frame {
    /// The frame of the vertices that triangles use, of which there is at least one.
    pub fn of(surface: &Triangles) -> Self {
        let used = surface.triangles.iter().flatten().map(|&v| Point3::from(surface.vertices[v as usize]));
        let (mut low, mut high) = (Point3::from([f64::INFINITY; 3]), Point3::from([f64::NEG_INFINITY; 3]));
        for point in used {
            (low, high) = (low.inf(&point), high.sup(&point));
        }
        let size = (high - low).norm();
        let scale = if size > 0.0 { (-size.log2().ceil()).exp2() } else { 1.0 };
        let [roll, pitch, yaw] = TURN;
        Self { middle: nalgebra::center(&low, &high), scale, turn: Rotation3::from_euler_angles(roll, pitch, yaw) }
    }

    pub fn point(&self, position: [f64; 3]) -> Point3<f64> {
        self.turn * Point3::from((Point3::from(position) - self.middle) * self.scale)
    }

    /// A length of the measurement, in the mesh's unit.
    pub fn length(&self, length: f64) -> f64 {
        length / self.scale
    }

    pub fn area(&self, area: f64) -> f64 {
        area / self.scale.powi(2)
    }

    pub fn volume(&self, volume: f64) -> f64 {
        volume / self.scale.powi(3)
    }

    pub fn point_back(&self, point: Point3<f64>) -> Point3<f64> {
        self.middle + self.direction_back(point.coords) / self.scale
    }

    pub fn direction_back(&self, direction: Vector3<f64>) -> Vector3<f64> {
        self.turn.inverse() * direction
    }

    /// The inertia per unit density about the centre, in the mesh's unit and axes.
    pub fn inertia(&self, moments: &Moments) -> Matrix3<f64> {
        let turn = self.turn.matrix();
        turn.transpose() * moments.inertia() * turn / self.scale.powi(5)
    }
}
