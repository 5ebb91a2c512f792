//! Where an asset is in the frame of the scene's files. The results are in the world's frame, whose z is up; an asset of a scene
//! that was turned for that has lost its place among other things, so it is also raised until it stands on z = 0. If z was up
//! already, it stays where it is. An asset may also have an [`Origin`] of its own, and stand elsewhere. Every file of an asset
//! says how to get back.

use nalgebra::{Matrix3, Matrix4, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::spaced;

/// The axes of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axes {
    ZUp,
    /// As glTF has them: gprop's (x, y, z) is (x, z, -y) there.
    YUp,
}

/// The origin of an asset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// That of the scene, so that objects of one capture keep their places; below the object if the scene had to be turned
    #[default]
    Input,
    /// The middle of the object's base: it stands on z = 0 around the origin
    Base,
    /// The centre of mass
    Com,
}

/// The place of an asset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placement {
    /// How far the asset is raised in the world's frame, m; in scene units if the scale is unknown.
    pub rise: f64,
    /// Its own origin in the world's frame, m; 0 for [`Origin::Input`].
    pub origin: Vector3<f64>,
    /// Where it stands by default, m.
    pub at: Vector3<f64>,
    input_from_world: UnitQuaternion<f64>,
    meters_per_unit: f64,
}

impl Placement {
    /// Of an asset whose lowest point in the world's frame is at `lowest`, called only if the scene was turned.
    pub fn new(world_from_input: UnitQuaternion<f64>, meters_per_unit: f64, lowest: impl FnOnce() -> f64) -> Self {
        let is_turned = world_from_input != UnitQuaternion::identity();
        let rise = if is_turned { -lowest() } else { 0.0 };
        Self {
            rise,
            origin: Vector3::zeros(),
            at: Vector3::zeros(),
            input_from_world: world_from_input.inverse(),
            meters_per_unit,
        }
    }

    /// Of an asset with an origin of its own, which is in the world's frame, m; it is not raised.
    pub fn around(origin: Vector3<f64>, world_from_input: UnitQuaternion<f64>, meters_per_unit: f64) -> Self {
        Self { rise: 0.0, origin, ..Self::new(world_from_input, meters_per_unit, || 0.0) }
    }

    /// Where the asset's axes are by default.
    pub fn place(&self) -> Vector3<f64> {
        self.at + Vector3::z() * self.rise
    }

    /// The matrix, by rows, that maps a point of the asset to the frame and the unit of the scene's files.
    pub fn input_from_asset(&self, axes: Axes) -> [f64; 16] {
        let unit_from_meter = Matrix3::identity() / self.meters_per_unit;
        let lowered = Matrix4::new_translation(&(self.origin - self.place()));
        let turned = (self.input_from_world.to_rotation_matrix().matrix() * unit_from_meter).to_homogeneous();
        let z_up_from_file = match axes {
            Axes::ZUp => Matrix4::identity(),
            Axes::YUp => Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0).to_homogeneous(),
        };
        let matrix = turned * lowered * z_up_from_file;
        // Without the negative zeros that products have.
        std::array::from_fn(|n| matrix[(n / 4, n % 4)] + 0.0)
    }

    /// A line that says so in a text file.
    pub fn comment(&self) -> String {
        format!("input_from_asset (4 x 4, by rows): {}", spaced(self.input_from_asset(Axes::ZUp)))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn an_asset_leads_back_to_the_input() {
        let world_from_input = UnitQuaternion::from_euler_angles(0.4, -1.2, 2.0);
        let in_input = Point3::new(3.0, -1.0, 0.5);
        let in_world_m = world_from_input * in_input * 0.25;
        let placement = Placement::new(world_from_input, 0.25, || -7.0);
        let [x, y, z] = [in_world_m.x, in_world_m.y, in_world_m.z + 7.0];
        for (axes, in_asset) in [(Axes::ZUp, Point3::new(x, y, z)), (Axes::YUp, Point3::new(x, z, -y))] {
            let matrix = Matrix4::from_row_slice(&placement.input_from_asset(axes));
            assert!((matrix.transform_point(&in_asset) - in_input).norm() < 1e-12, "{axes:?}");
        }
        let around = Placement::around(in_world_m.coords - Vector3::x(), world_from_input, 0.25);
        let placement = Placement { at: Vector3::new(0.0, 2.0, 0.0), ..around };
        let matrix = Matrix4::from_row_slice(&placement.input_from_asset(Axes::ZUp));
        assert!((matrix.transform_point(&Point3::new(1.0, 2.0, 0.0)) - in_input).norm() < 1e-12);
        assert_eq!(Placement::new(UnitQuaternion::identity(), 1.0, || -7.0).rise, 0.0);
    }
}
