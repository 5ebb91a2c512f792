//! Rigid bodies in glTF, by the draft extension `KHR_physics_rigid_bodies` as it is since 2026: a node that moves has a `motion`, and the
//! nodes below it that have a `collider` are its shapes, each the hull of a mesh that no node draws.

use serde_json::{Value, json};

use super::links::Inertial;
use crate::files::json_patch::Patch;
use crate::scene::mesh::gltf::physics::{EXTENSION, NodeStatement};

/// What a node has that moves, along its own axes.
pub fn motion(inertial: &Inertial) -> Value {
    let mut motion = Patch::default();
    let Inertial { mass_kg, center_m, inertia } = *inertial;
    let statement = NodeStatement { mass_kg: Some(mass_kg), center: Some(center_m.into()), inertia: Some(inertia) };
    statement.state(&mut motion);
    json!({ EXTENSION: { "motion": motion.into_value() } })
}

/// What a node has that collides as the hull of a mesh, with a physics material if it has one.
pub fn collider(mesh: usize, material: Option<usize>) -> Value {
    let mut collider = json!({ "geometry": { "mesh": mesh, "convexHull": true } });
    if let Some(material) = material {
        collider["physicsMaterial"] = json!(material);
    }
    json!({ EXTENSION: { "collider": collider } })
}

/// A physics material. Of two materials that touch, the larger restitution counts, since that of a hard floor is not known to the file.
pub fn material(friction: f64, restitution: Option<f64>) -> Value {
    let mut material = json!({ "staticFriction": friction, "dynamicFriction": friction });
    if let Some(restitution) = restitution {
        material["restitution"] = json!(restitution);
        material["restitutionCombine"] = json!("maximum");
    }
    material
}
