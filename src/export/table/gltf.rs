//! `scene.glb`: the meshes of all objects on a slab that stands for the support, with their physics by the draft extension
//! `KHR_physics_rigid_bodies`. `scene_splat.glb`: the Gaussians of all objects and of the surroundings.
//!
//! glTF refers to no other glTF, so the files of the objects are joined, each with the node at its root.

use nalgebra::{Matrix3, Point3};
use serde_json::{Value, json};

use super::super::gltf::Gltf;
use super::super::gltf_splat;
use super::super::names::within;
use super::super::placement::Axes;
use super::super::{ExportError, Files, gltf_physics_material, identifier};
use super::{Body, BodyCollider, Square, Table};
use crate::files::json_patch::Patch;
use crate::files::{json as strict_json, read_large};
use crate::numeric::hull::Hull;
use crate::scene::mesh::gltf::GltfFile;
use crate::scene::mesh::gltf::physics::{EXTENSION, NodeStatement};

/// Thickness of the slab: no object of a table falls through it in one time step.
const SLAB_M: f64 = 0.05;

pub fn write(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    let mut scene = Scene::default();
    for body in table.bodies {
        scene.add_body(body, files)?;
    }
    scene.add_support(table);
    let Scene { mut gltf, materials } = scene;
    gltf.extensions = json!({ EXTENSION: { "physicsMaterials": materials } });
    files.write("scene.glb", |out| gltf.write(&[EXTENSION], &extras(table), out))
}

pub fn write_splat(table: &Table, files: &mut Files) -> Result<(), ExportError> {
    let mut gltf = Gltf::default();
    for name in table.objects {
        joined(&mut gltf, files, &format!("{}_splat.glb", identifier(name)))?;
    }
    if !table.surroundings.is_empty() {
        let mesh = gltf_splat::add(&mut gltf, &table.splat_of_surroundings());
        let node = gltf.node(json!({ "name": "splat", "mesh": mesh }));
        gltf.node_z_up("surroundings", &[node], &table.placement().place());
    }
    files.write("scene_splat.glb", |out| gltf.write(&[gltf_splat::EXTENSION], &extras(table), out))
}

/// What the file says of the whole scene.
fn extras(table: &Table) -> Value {
    let mut extras = json!({ "input_from_asset": table.placement().input_from_asset(Axes::YUp) });
    if let Some(note) = table.note_on_scale() {
        extras["note"] = json!(note);
    }
    extras
}

/// Adds the file of an object, and returns the node at its root.
fn joined(gltf: &mut Gltf, files: &Files, name: &str) -> Result<usize, ExportError> {
    let path = files.folder.join(name);
    let join = |gltf: &mut Gltf| -> Option<usize> {
        let bytes = read_large(&path).ok()?;
        let file = GltfFile::of(&bytes)?;
        let document: Value = strict_json::parse(file.text.as_bytes()).ok()?;
        gltf.join(&document, file.own_chunk()?)
    };
    join(gltf).ok_or(ExportError::Changed { path: path.clone() })
}

/// The scene under construction.
#[derive(Default)]
struct Scene {
    gltf: Gltf,
    /// Of physics.
    materials: Vec<Value>,
}

impl Scene {
    /// An object that moves, with its colliders below it.
    fn add_body(&mut self, body: &Body, files: &Files) -> Result<(), ExportError> {
        let root = joined(&mut self.gltf, files, &format!("{}.glb", body.name))?;
        let mut motion = Patch::default();
        let statement = NodeStatement {
            mass_kg: Some(body.mass_kg),
            center: Some(body.center_m.into()),
            inertia: Some(Matrix3::from_fn(|row, column| body.inertia_kg_m2[row][column])),
        };
        statement.state(&mut motion);
        let colliders: Vec<usize> =
            body.colliders.iter().map(|collider| self.add_collider(&body.name, collider)).collect();
        let node = self.gltf.node_mut(root);
        node["extensions"] = json!({ EXTENSION: { "motion": motion.into_value() } });
        if let Some(children) = node["children"].as_array_mut() {
            children.extend(colliders.into_iter().map(Value::from));
        }
        Ok(())
    }

    /// A node that collides as the hull of a mesh that is not drawn.
    fn add_collider(&mut self, object: &str, BodyCollider { shape, friction, restitution }: &BodyCollider) -> usize {
        let name = within(object, &shape.name);
        let mesh = self.add_mesh(&shape.vertices, &shape.triangles, &json!({}));
        let hull = self.gltf.node(json!({ "name": format!("{name} hull"), "mesh": mesh }));
        let material = gltf_physics_material(*friction, *restitution);
        let index = self.materials.iter().position(|known| *known == material).unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        });
        let collider =
            json!({ "collider": { "geometry": { "node": hull, "convexHull": true }, "physicsMaterial": index } });
        self.gltf.node(json!({ "name": name, "extensions": { EXTENSION: collider } }))
    }

    /// The slab, which collides and does not move.
    fn add_support(&mut self, table: &Table) {
        let Square { center, side, turn } = table.drawn_support();
        let half = 0.5 * side;
        let corners: Vec<Point3<f64>> = (0..8)
            .map(|n| {
                let side_of = |bit: usize| if n >> bit & 1 == 0 { -half } else { half };
                center + turn * nalgebra::Vector3::new(side_of(0), side_of(1), if n < 4 { -SLAB_M } else { 0.0 })
            })
            .collect();
        let Some(slab) = Hull::of(&corners) else { return };
        self.gltf.materials.push(
            json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1.0], "metallicFactor": 0.0 } }),
        );
        let material = self.gltf.materials.len() - 1;
        let mesh = self.add_mesh(&slab.vertices, &slab.triangles, &json!({ "material": material }));
        let node = self.gltf.node(json!({ "name": "support", "mesh": mesh }));
        let collider = json!({ "collider": { "geometry": { "node": node, "convexHull": true } } });
        self.gltf.node_mut(node)["extensions"] = json!({ EXTENSION: collider });
        self.gltf.node_z_up("table", &[node], &nalgebra::Vector3::zeros());
    }

    /// A mesh of one primitive, which also has the members of `look`.
    fn add_mesh(&mut self, vertices: &[Point3<f64>], triangles: &[[u32; 3]], look: &Value) -> usize {
        let positions: Vec<[f32; 3]> = vertices.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect();
        let mut primitive = look.clone();
        primitive["attributes"] = json!({ "POSITION": self.gltf.floats(&positions, true) });
        primitive["indices"] = json!(self.gltf.triangles(triangles));
        self.gltf.meshes.push(json!({ "primitives": [primitive] }));
        self.gltf.meshes.len() - 1
    }
}
