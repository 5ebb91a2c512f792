//! The scenario `drop`: the object, tilted, falls from a small height onto the ground.
//!
//! Up is +z of the world frame. The ground is at the height of the object's lowest point in the scene, where it stood.
//! The tilt is a rotation about the horizontal axis across the object's longer side, and slightly about the other one,
//! so that it lands on a corner.

use nalgebra::{Rotation3, Vector3};

use crate::mpm::boundary::{Boundary, Contact};
use crate::scene::Bounds;

/// Share of the tilt about the other horizontal axis.
const SECOND_AXIS: f64 = 0.4;

/// Grid cells between the ground and the plane on which the grid stops falling material. A particle pushes against the
/// plane through nodes up to 1.5 cells away; a body's face comes to rest this far above it (measured by the test
/// `rests_on_the_ground`), so the plane lies lower by this distance.
pub const CONTACT_DEPTH_CELLS: f64 = 0.9;

/// Space around the object, in multiples of its longest side: how far it may roll before the run stops. It costs
/// no memory, because the grid surrounds only the object. Positions far from the origin are rounded to a coarser step, but
/// moves add up correctly: see [`Particle::compensation_m`](crate::mpm::particles::Particle::compensation_m).
const ROOM: f64 = 8.0;

/// The object's first pose and the ground below it, in metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Drop {
    /// Rotates the object about [`Self::center_m`].
    pub rotation: Rotation3<f64>,
    pub center_m: Vector3<f64>,
    /// Lifts it after the rotation.
    pub lift_m: f64,
    /// World z of the ground.
    pub ground_z_m: f64,
    /// World position of the simulation's origin.
    pub origin_m: Vector3<f64>,
    /// Edge of the cubic domain.
    pub domain_m: f64,
    /// Height above the origin of the plane that stops falling material.
    plane_m: f64,
}

impl Drop {
    /// The drop from `height` (in multiples of the longest side), tilted, of an object that lies within `object` and may
    /// touch the ground with the points `solid_m` (both in metres, world frame).
    pub fn new(object: &Bounds, solid_m: &[[f64; 3]], spacing_m: f64, [height, tilt_deg]: [f64; 2]) -> Self {
        let size = object.size();
        let longest = size.max();
        let center_m = object.center().coords;
        let (mut about_x, mut about_y) = (tilt_deg.to_radians() * SECOND_AXIS, tilt_deg.to_radians());
        if size.y > size.x {
            (about_x, about_y) = (about_y, about_x);
        }
        let rotation = Rotation3::from_axis_angle(&Vector3::y_axis(), about_y)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), about_x);
        let tilted_z = |p: &[f64; 3]| (rotation * (Vector3::from(*p) - center_m)).z + center_m.z;
        let lowest = solid_m.iter().map(tilted_z).fold(f64::INFINITY, f64::min);
        let ground_z_m = object.min.z;
        let lift_m = ground_z_m + height * longest - lowest;
        let domain_m = longest * (2.0 * ROOM + 1.0 + height);
        // The plane acts on whole nodes: it lies on a layer of them, slightly above to allow for rounding.
        let layer = (ROOM * longest / spacing_m).ceil();
        let floor = ground_z_m - (layer + CONTACT_DEPTH_CELLS) * spacing_m;
        let origin_m = Vector3::new(center_m.x - domain_m / 2.0, center_m.y - domain_m / 2.0, floor);
        let plane_m = (layer + 0.01) * spacing_m;
        Self { rotation, center_m, lift_m, ground_z_m, origin_m, domain_m, plane_m }
    }

    /// Initial position of a point of the object, in the simulation's frame.
    pub fn placed(&self, position_m: [f64; 3]) -> Vector3<f64> {
        let turned = self.rotation * (Vector3::from(position_m) - self.center_m) + self.center_m;
        turned + Vector3::z() * self.lift_m - self.origin_m
    }

    /// The ground as rigid bodies meet it, in the simulation's frame: at its own height.
    pub fn ground_of_bodies(&self, contact: Contact) -> Boundary {
        let height = self.ground_z_m - self.origin_m.z;
        Boundary { point_m: [0.0, 0.0, height as f32], ..self.ground(contact) }
    }

    /// The ground, in the simulation's frame.
    pub fn ground(&self, contact: Contact) -> Boundary {
        Boundary { point_m: [0.0, 0.0, self.plane_m as f32], normal: [0.0, 0.0, 1.0], contact }
    }
}
