//! `scene.glb`: all objects, each with its physics, on a slab that stands for the support. `scene_splat.glb`: the Gaussians of all
//! objects and of the surroundings.
//!
//! glTF refers to no other glTF, so the files of the objects are joined.

use nalgebra::Point3;
use serde_json::{Value, json};

use super::super::gltf::Gltf;
use super::super::gltf_splat;
use super::super::placement::Axes;
use super::super::{ExportError, Files, identifier};
use super::{Square, Table};
use crate::files::{json as strict_json, read_large};
use crate::numeric::hull::Hull;
use crate::scene::mesh::gltf::GltfFile;

/// Thickness of the slab: no object of a table falls through it in one time step.
const SLAB_M: f64 = 0.05;

pub fn write(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    let mut gltf = Gltf::default();
    for body in table.bodies {
        join(&mut gltf, files, &format!("{}.glb", body.name))?;
    }
    add_support(&mut gltf, table);
    files.write("scene.glb", |out| gltf.write(&extras(table), out))
}

pub fn write_splat(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    let mut gltf = Gltf::default();
    for name in table.objects {
        join(&mut gltf, files, &format!("{}_splat.glb", identifier(name)))?;
    }
    if !table.surroundings.is_empty() {
        let mesh = gltf_splat::add(&mut gltf, &table.splat_of_surroundings());
        let node = gltf.node(json!({ "name": "splat", "mesh": mesh }));
        gltf.node_z_up("surroundings", &[node], &table.placement().place());
    }
    files.write("scene_splat.glb", |out| gltf.write(&extras(table), out))
}

/// What the file says of the whole scene.
fn extras(table: &Table) -> Value {
    let mut extras = json!({ "input_from_asset": table.placement().input_from_asset(Axes::YUp) });
    if let Some(note) = table.note_on_scale() {
        extras["note"] = json!(note);
    }
    extras
}

/// Adds the file of an object.
fn join(gltf: &mut Gltf, files: &Files, name: &str) -> Result<(), ExportError> {
    let path = files.folder.join(name);
    let mut joined = || -> Option<()> {
        let bytes = read_large(&path).ok()?;
        let file = GltfFile::of(&bytes)?;
        let document: Value = strict_json::parse(file.text.as_bytes()).ok()?;
        gltf.join(&document, file.own_chunk()?)
    };
    joined().ok_or(ExportError::Changed { path: path.clone() })
}

/// The slab, which collides and does not move.
fn add_support(gltf: &mut Gltf, table: &Table) {
    let Square { center, side, turn } = table.drawn_support();
    let half = 0.5 * side;
    let corners: Vec<Point3<f64>> = (0..8)
        .map(|n| {
            let side_of = |bit: usize| if n >> bit & 1 == 0 { -half } else { half };
            center + turn * nalgebra::Vector3::new(side_of(0), side_of(1), if n < 4 { -SLAB_M } else { 0.0 })
        })
        .collect();
    let Some(slab) = Hull::of(&corners) else { return };
    gltf.materials
        .push(json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0 } }));
    let material = gltf.materials.len() - 1;
    let mesh = gltf.mesh(&slab.vertices, &slab.triangles, &json!({ "material": material }));
    let drawn = gltf.node(json!({ "name": "support slab", "mesh": mesh }));
    let collider = gltf.collider_node("support", mesh, Value::Null);
    gltf.node_z_up("table", &[drawn, collider], &nalgebra::Vector3::zeros());
}
