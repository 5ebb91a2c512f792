//! The numbers of an asset in the frame and unit of its file.

use nalgebra::{Matrix3, Point3, Rotation3};
use serde::Serialize;
use serde_json::Value;

use super::super::{Model, least_friction, least_restitution, part_facts};
use crate::parts::Parts;
use crate::scene::mesh::{Mesh, MeshFormat, y_up_from_z_up};
use crate::units::Estimate;
use crate::vote::field_ply::material_names;

/// How a file's frame lies in the world, whose z points up and whose unit is the metre.
#[derive(Debug, Clone, Copy)]
pub struct FileFrame {
    file_from_world: Rotation3<f64>,
    pub meters_per_unit: f64,
}

impl FileFrame {
    pub fn of(model: &Model, format: &MeshFormat) -> Self {
        let input_from_world = model.world_from_input.inverse().to_rotation_matrix();
        let file_from_input = if format.is_y_up { y_up_from_z_up() } else { Rotation3::identity() };
        Self {
            file_from_world: file_from_input * input_from_world,
            meters_per_unit: model.scale.map_or(1.0, |scale| scale.meters_per_unit),
        }
    }

    /// A place in the file's axes and unit.
    pub fn point(&self, in_world_m: Point3<f64>) -> Point3<f64> {
        self.file_from_world * in_world_m / self.meters_per_unit
    }

    /// An inertia along the file's axes, kg m2.
    pub fn inertia(&self, in_world: [[f64; 3]; 3]) -> Matrix3<f64> {
        let in_world = Matrix3::from_fn(|row, column| in_world[row][column]);
        self.file_from_world.matrix() * in_world * self.file_from_world.matrix().transpose()
    }
}

/// What gprop found, and what the file claims.
#[derive(Debug, Clone, Serialize)]
pub struct Facts {
    generator: &'static str,
    pub mass_kg: Estimate,
    volume_m3: Estimate,
    /// In the axes and unit of the file.
    pub center_of_mass: [f64; 3],
    /// About the centre of mass, along the axes of the file.
    inertia_kg_m2: [[f64; 3]; 3],
    /// 1 for a glTF, unless the user said otherwise.
    meters_per_unit: f64,
    /// The least of all parts.
    pub friction_rubber: f64,
    /// The least of all parts, on a hard surface; `None` if the library says none.
    pub restitution: Option<f64>,
    /// What the file said; `None` if it said nothing.
    claimed_mass_kg: Option<f64>,
    /// By `material_id`.
    materials: Vec<String>,
    parts: Vec<Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<&'static str>,
}

impl Facts {
    pub fn of(model: &Model, parts: &Parts, mesh: &Mesh, frame: &FileFrame) -> Self {
        let object = &parts.object;
        let inertia = frame.inertia(object.inertia_kg_m2);
        Self {
            generator: concat!("gprop ", env!("CARGO_PKG_VERSION")),
            mass_kg: object.mass_kg,
            volume_m3: object.volume_m3,
            center_of_mass: frame.point(object.center_of_mass_m.into()).into(),
            inertia_kg_m2: std::array::from_fn(|row| std::array::from_fn(|column| inertia[(row, column)])),
            meters_per_unit: frame.meters_per_unit,
            friction_rubber: least_friction(&model.field.parts, parts, None),
            restitution: least_restitution(&model.field.parts),
            claimed_mass_kg: mesh.claimed_mass_kg,
            materials: material_names(&model.field.parts).into_iter().map(str::to_owned).collect(),
            parts: model.field.parts.iter().map(|label| part_facts(model, label.id)).collect(),
            note: model.note_on_scale(),
        }
    }
}
