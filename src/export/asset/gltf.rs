//! A GLB or glTF with its physics, by the draft extension `KHR_physics_rigid_bodies`:
//!
//! 1. the node that moves gets `motion` (mass, centre, inertia) and, as `extras`, all that gprop found;
//! 2. the colliders get a physics material with their friction. Restitution is left to the reader: the library has none;
//! 3. each vertex gets its `material_id` as the attribute `_MATERIAL`.
//!
//! New arrays stand behind those of the file, whose own bytes and numbers stay.

use std::collections::BTreeMap;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Matrix3, Matrix4, Point3};
use serde_json::{Value, json};

use super::super::gltf::{Added, Behind, Gltf};
use super::super::names::within;
use super::super::{ExportError, Files, Shared, body_name, gltf_physics, label_of, restitution};
use super::facts::{Facts, FileFrame};
use super::labels::SurfaceLabels;
use super::{Asset, Colliders};
use crate::files::json_patch::Patch;
use crate::files::{self, json as strict_json};
use crate::parts::Parts;
use crate::scene::mesh::gltf::physics::{EXTENSION, NodeStatement, Outline};
use crate::scene::mesh::gltf::{GltfFile, PlacedNode, rotation_of};
use crate::vote::field_ply::material_names;

/// The `material_id` of a vertex of no triangle.
const NO_MATERIAL: u16 = u16::MAX;
/// By how much the columns of a rotation may be off.
const RIGID: f64 = 1e-5;

/// A glTF and what is written into it.
pub struct Filled<'a, 'm> {
    pub asset: &'a Asset<'a>,
    pub shared: &'a Shared<'m>,
    pub parts: &'a Parts,
    pub frame: FileFrame,
    pub facts: Facts,
    pub labels: SurfaceLabels,
}

pub fn write(filled: &Filled, files: &mut Files) -> Result<(), ExportError> {
    let path = &filled.asset.mesh.painted.mesh.files[0];
    let changed = || ExportError::Changed { path: path.clone() };
    let bytes = files::read_large(path).map_err(|_| changed())?;
    let file = GltfFile::of(&bytes).ok_or_else(changed)?;
    let outline = Outline::of(&bytes).map_err(|_| changed())?;
    let document: Value = strict_json::parse(file.text.as_bytes()).map_err(|_| changed())?;
    let mut editor = Editor::new(filled, &document, &file);
    let body = editor.body(&outline)?;
    editor.state_motion(&body, &document);
    editor.state_colliders(&outline, &body)?;
    editor.state_materials(&document).ok_or_else(changed)?;
    let (patch, added) = editor.finished();
    let text = patch.applied(file.text).ok_or_else(changed)?;
    files.write(path.file_name().unwrap_or_default(), |out| file.write_with(&text, &added, out))
}

/// The node that moves.
struct Body {
    index: usize,
    world_from_node: Matrix4<f64>,
}

impl Body {
    /// A place of the file's world in the node's frame.
    fn point(&self, in_world: Point3<f64>) -> Point3<f64> {
        let node_from_world = self.world_from_node.try_inverse().unwrap_or_else(Matrix4::identity);
        node_from_world.transform_point(&in_world)
    }
}

/// The changes of a file.
struct Editor<'a, 'm> {
    filled: &'a Filled<'a, 'm>,
    patch: Patch,
    /// A node that is to stand above all others, and its index.
    above: Option<(usize, Patch)>,
    added_nodes: Vec<Value>,
    arrays: Gltf,
    /// Numbers of nodes, meshes and physics materials, with those that are added.
    nodes: usize,
    meshes: usize,
    physics_materials: usize,
    /// The index of the buffer for new arrays; `None` if they stand in the GLB's own chunk.
    new_buffer: Option<usize>,
    /// What the file says that it uses.
    extensions: Vec<Value>,
}

impl<'a, 'm> Editor<'a, 'm> {
    fn new(filled: &'a Filled<'a, 'm>, document: &Value, file: &GltfFile) -> Self {
        let count = |name: &str| document[name].as_array().map_or(0, Vec::len);
        let own_chunk = file.own_chunk();
        let buffers = count("buffers");
        let behind = Behind {
            buffer: if own_chunk.is_some() { 0 } else { buffers },
            bytes: own_chunk.map_or(0, |bytes| bytes.len().next_multiple_of(4)),
            views: count("bufferViews"),
            accessors: count("accessors"),
        };
        Self {
            filled,
            patch: Patch::default(),
            above: None,
            added_nodes: Vec::new(),
            arrays: Gltf::behind(behind),
            nodes: count("nodes"),
            meshes: count("meshes"),
            physics_materials: document["extensions"][EXTENSION]["physicsMaterials"].as_array().map_or(0, Vec::len),
            new_buffer: own_chunk.is_none().then_some(buffers),
            extensions: document["extensionsUsed"].as_array().cloned().unwrap_or_default(),
        }
    }

    fn node(&mut self, index: usize) -> &mut Patch {
        match &mut self.above {
            Some((above, patch)) if *above == index => patch,
            _ => self.patch.member("nodes").item(index),
        }
    }

    fn physics_of(&mut self, node: usize) -> &mut Patch {
        self.node(node).member("extensions").member(EXTENSION)
    }

    fn add_node(&mut self, node: Value) -> usize {
        self.added_nodes.push(node);
        self.nodes += 1;
        self.nodes - 1
    }

    fn add_physics_material(&mut self, friction: f64, restitution: Option<f64>) -> usize {
        let material = gltf_physics::material(friction, restitution);
        self.patch.member("extensions").member(EXTENSION).member("physicsMaterials").add(material);
        self.physics_materials += 1;
        self.physics_materials - 1
    }

    /// The node that moves: the one that moves already, the only root, or else a new node above all roots.
    fn body(&mut self, outline: &Outline) -> Result<Body, ExportError> {
        match outline.motions.as_slice() {
            [] => {}
            [only] if outline.with_meshes.iter().all(|node| outline.motion_of(*node) == Some(0)) => {
                let placed = &outline.nodes[only.node];
                return Ok(Body { index: placed.index, world_from_node: placed.world_from_node });
            }
            several => return Err(ExportError::Bodies { count: several.len() }),
        }
        let roots: Vec<&PlacedNode> = outline.nodes.iter().filter(|node| node.parent.is_none()).collect();
        if let [root] = roots.as_slice()
            && is_rigid(&root.world_from_node)
        {
            return Ok(Body { index: root.index, world_from_node: root.world_from_node });
        }
        let index = self.nodes;
        self.nodes += 1;
        let mut above = Patch::default();
        above.member("name").set(body_name(self.filled.shared.model.name));
        roots.iter().for_each(|root| above.member("children").add(root.index.into()));
        self.above = Some((index, above));
        match outline.scene {
            Some(scene) => self.patch.member("scenes").item(scene).member("nodes").set(json!([index])),
            None => self.patch.member("scenes").add(json!({ "nodes": [index] })),
        }
        Ok(Body { index, world_from_node: Matrix4::identity() })
    }

    /// Mass, centre and inertia; and all that was found as `extras`, unless the node has some that are not an object.
    fn state_motion(&mut self, body: &Body, document: &Value) {
        let Filled { frame, parts, facts, .. } = self.filled;
        let object = &parts.object;
        let statement = NodeStatement {
            mass_kg: Some(object.mass_kg.mid),
            center: Some(body.point(frame.point(object.center_of_mass_m.into()))),
            inertia: Some(in_node(&body.world_from_node, &frame.inertia(object.inertia_kg_m2))),
        };
        statement.state(self.physics_of(body.index).member("motion"));
        let extras = &document["nodes"][body.index]["extras"];
        if extras.is_null() || extras.is_object() {
            let facts = serde_json::to_value(facts).expect("facts are plain data");
            self.node(body.index).member("extras").member("gprop").set(facts);
        }
    }

    /// The file's own colliders get the least friction of all parts; new ones stand below the node that moves.
    ///
    /// # Errors
    /// If colliders are to be made and the object has no shape.
    fn state_colliders(&mut self, outline: &Outline, body: &Body) -> Result<(), ExportError> {
        let wanted = self.filled.asset.colliders;
        let own: Vec<usize> = outline.with_colliders.iter().map(|node| outline.nodes[*node].index).collect();
        if wanted == Colliders::Make {
            own.iter().for_each(|node| *self.physics_of(*node).member("collider") = Patch::Remove);
        } else if !own.is_empty() {
            let material = self.add_physics_material(self.filled.facts.friction_rubber, self.filled.facts.restitution);
            own.iter().for_each(|node| {
                self.physics_of(*node).member("collider").member("physicsMaterial").set(material);
            });
        }
        if wanted == Colliders::Make || wanted == Colliders::Add && own.is_empty() {
            self.add_colliders(body)?;
        }
        Ok(())
    }

    fn add_colliders(&mut self, body: &Body) -> Result<(), ExportError> {
        let Filled { frame, shared, .. } = self.filled;
        let colliders = &shared.shape()?.colliders;
        if colliders.is_empty() {
            return Err(ExportError::NoShape);
        }
        let mut material_of: BTreeMap<u32, usize> = BTreeMap::new();
        for collider in colliders {
            let in_node = collider.vertices.iter().map(|vertex| body.point(frame.point(*vertex)));
            let positions: Vec<[f32; 3]> =
                in_node.map(|point| [point.x as f32, point.y as f32, point.z as f32]).collect();
            let attributes = json!({ "POSITION": self.arrays.floats(&positions, true) });
            let indices = self.arrays.triangles(&collider.triangles);
            let mesh = json!({ "primitives": [{ "attributes": attributes, "indices": indices }] });
            self.patch.member("meshes").add(mesh);
            self.meshes += 1;
            let name = within(&body_name(shared.model.name), &collider.name);
            let label = label_of(&shared.model.field.parts, collider.part);
            let material = match material_of.get(&collider.part) {
                Some(material) => *material,
                None => self.add_physics_material(shared.model.friction(label), restitution(label)),
            };
            material_of.insert(collider.part, material);
            let collider = gltf_physics::collider(self.meshes - 1, Some(material));
            let node = self.add_node(json!({ "name": name, "extensions": collider }));
            self.node(body.index).member("children").add(node.into());
        }
        Ok(())
    }

    /// The `material_id` of each vertex; `None` if the file has other vertices than those that were read.
    fn state_materials(&mut self, document: &Value) -> Option<()> {
        let labels = &self.filled.shared.model.field.parts;
        let names = material_names(labels);
        let id_of = |label: u32| names.iter().position(|name| *name == labels[label as usize].material);
        let ids: Vec<u16> =
            (0..labels.len() as u32).map(|label| id_of(label).map_or(NO_MATERIAL, |id| id as u16)).collect();
        for (source, of_vertices) in self.filled.labels.of_primitives(&self.filled.asset.mesh.painted.mesh) {
            let primitive = &document["meshes"][source.mesh]["primitives"][source.primitive];
            let position = primitive["attributes"]["POSITION"].as_u64()?;
            let count = document["accessors"][usize::try_from(position).ok()?]["count"].as_u64()?;
            if count != of_vertices.len() as u64 {
                return None;
            }
            let ids: Vec<u16> =
                of_vertices.iter().map(|label| label.map_or(NO_MATERIAL, |label| ids[label as usize])).collect();
            let accessor = self.arrays.numbers(&ids);
            let primitive = self.patch.member("meshes").item(source.mesh).member("primitives").item(source.primitive);
            primitive.member("attributes").member("_MATERIAL").set(accessor);
        }
        Some(())
    }

    /// All changes of the JSON, and the bytes of the new arrays.
    fn finished(mut self) -> (Patch, Vec<u8>) {
        let above = self.above.and_then(|(_, above)| above.into_value());
        for node in above.into_iter().chain(self.added_nodes) {
            self.patch.member("nodes").add(node);
        }
        let Added { views, accessors, bytes, end } = self.arrays.added();
        views.into_iter().for_each(|view| self.patch.member("bufferViews").add(view));
        accessors.into_iter().for_each(|accessor| self.patch.member("accessors").add(accessor));
        match self.new_buffer {
            None => self.patch.member("buffers").item(0).member("byteLength").set(end),
            Some(_) => {
                let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&bytes));
                self.patch.member("buffers").add(json!({ "byteLength": bytes.len(), "uri": uri }));
            }
        }
        if !self.extensions.contains(&json!(EXTENSION)) {
            self.patch.member("extensionsUsed").add(json!(EXTENSION));
        }
        (self.patch, bytes)
    }
}

fn is_rigid(transform: &Matrix4<f64>) -> bool {
    let linear: Matrix3<f64> = transform.fixed_view::<3, 3>(0, 0).into_owned();
    (linear.transpose() * linear - Matrix3::identity()).norm() < RIGID && linear.determinant() > 0.0
}

/// An inertia along the axes of the file, along those of a node.
fn in_node(world_from_node: &Matrix4<f64>, inertia: &Matrix3<f64>) -> Matrix3<f64> {
    let node_from_world = rotation_of(world_from_node).inverse().to_rotation_matrix();
    node_from_world.matrix() * inertia * node_from_world.matrix().transpose()
}
