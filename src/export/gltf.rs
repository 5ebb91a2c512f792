//! The container of glTF 2.0: JSON that describes arrays, and the arrays' bytes after it in one `.glb` file.
//!
//! glTF is in metres with y up; [`Gltf::node_z_up`] turns gprop's z up into that.

use std::collections::BTreeSet;
use std::io::{self, Write};

use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

use super::gltf_physics;
use crate::numeric::srgb_light;
use crate::scene::mesh::gltf::physics::EXTENSION as PHYSICS;
use crate::scene::mesh::gltf::{binary_chunk, write_glb};

/// `GL_FLOAT`, `GL_UNSIGNED_INT`, `GL_UNSIGNED_SHORT`.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_SHORT: u32 = 5123;
/// `GL_ARRAY_BUFFER`, `GL_ELEMENT_ARRAY_BUFFER`.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// What a file has already, behind which new arrays stand.
#[derive(Debug, Clone, Copy, Default)]
pub struct Behind {
    /// The index of the buffer that holds the arrays.
    pub buffer: usize,
    /// Its bytes so far, a multiple of 4.
    pub bytes: usize,
    pub views: usize,
    pub accessors: usize,
}

/// New arrays for a file.
pub struct Added {
    pub views: Vec<Value>,
    pub accessors: Vec<Value>,
    pub bytes: Vec<u8>,
    /// The length of the buffer with them.
    pub end: usize,
}

/// A glTF file under construction, or arrays for one.
#[derive(Default)]
pub struct Gltf {
    behind: Behind,
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    pub meshes: Vec<Value>,
    pub materials: Vec<Value>,
    images: Vec<Value>,
    samplers: Vec<Value>,
    textures: Vec<Value>,
    nodes: Vec<Value>,
    roots: Vec<usize>,
    physics_materials: Vec<Value>,
    /// The extensions that the file uses.
    extensions: BTreeSet<String>,
}

impl Gltf {
    /// Arrays for a file that has others.
    pub fn behind(behind: Behind) -> Self {
        Self { behind, ..Self::default() }
    }

    /// The arrays.
    pub fn added(self) -> Added {
        let end = self.behind.bytes + self.bytes.len();
        Added { views: self.views, accessors: self.accessors, bytes: self.bytes, end }
    }

    /// Adds vectors of `N` floats, one for each vertex; `with_bounds` for positions.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]], with_bounds: bool) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let mut accessor = json!({ "componentType": FLOAT, "count": values.len(), "type": kind(N) });
        if with_bounds {
            let bound = |pick: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
                (0..N).map(|k| values.iter().map(|value| value[k]).fold(start, pick)).collect()
            };
            accessor["min"] = json!(bound(f32::min, f32::INFINITY));
            accessor["max"] = json!(bound(f32::max, f32::NEG_INFINITY));
        }
        self.add(&bytes, VERTICES, accessor)
    }

    /// Adds colours of vertices: sRGB, which glTF stores as linear light, with the opacity of each vertex, 0 to 1.
    pub fn colors(&mut self, colors: &[[u8; 3]], opacity: impl Fn(usize) -> f64) -> usize {
        let short = |value: f64| (value * 65535.0).round() as u16;
        let linear = |channel: u8| short(srgb_light(channel));
        let with_alpha = |(vertex, color): (usize, &[u8; 3])| {
            [linear(color[0]), linear(color[1]), linear(color[2]), short(opacity(vertex))]
        };
        let bytes: Vec<u8> = colors.iter().enumerate().flat_map(with_alpha).flat_map(u16::to_le_bytes).collect();
        let accessor =
            json!({ "componentType": UNSIGNED_SHORT, "normalized": true, "count": colors.len(), "type": "VEC4" });
        self.add(&bytes, VERTICES, accessor)
    }

    /// Adds triangles, given by the numbers of their vertices.
    pub fn triangles(&mut self, triangles: &[[u32; 3]]) -> usize {
        let bytes: Vec<u8> = triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let accessor = json!({ "componentType": UNSIGNED_INT, "count": 3 * triangles.len(), "type": "SCALAR" });
        self.add(&bytes, INDICES, accessor)
    }

    /// Adds a whole number for each vertex.
    pub fn numbers(&mut self, numbers: &[u16]) -> usize {
        // Each value of a vertex begins at a multiple of 4 bytes.
        const STRIDE: usize = 4;
        let padded = |number: &u16| [number.to_le_bytes(), [0; 2]];
        let bytes: Vec<u8> = numbers.iter().flat_map(padded).flatten().collect();
        let accessor = json!({ "componentType": UNSIGNED_SHORT, "count": numbers.len(), "type": "SCALAR" });
        let accessor = self.add(&bytes, VERTICES, accessor);
        self.views.last_mut().expect("the array has just been added")["byteStride"] = json!(STRIDE);
        accessor
    }

    fn add(&mut self, bytes: &[u8], target: u32, mut accessor: Value) -> usize {
        // Every array begins at a multiple of 4 bytes, the size of its largest numbers.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (buffer, offset) = (self.behind.buffer, self.behind.bytes + self.bytes.len());
        self.views.push(json!({ "buffer": buffer, "byteOffset": offset, "byteLength": bytes.len(), "target": target }));
        self.bytes.extend_from_slice(bytes);
        accessor["bufferView"] = json!(self.behind.views + self.views.len() - 1);
        self.accessors.push(accessor);
        self.behind.accessors + self.accessors.len() - 1
    }

    /// Adds an encoded picture of a MIME type that glTF knows, with OpenGL's numbers of its wrapping along u and v.
    pub fn texture(&mut self, picture: &[u8], mime_type: &str, wrapping: [u32; 2]) -> usize {
        let offset = self.bytes.len().next_multiple_of(4);
        self.bytes.resize(offset, 0);
        self.bytes.extend_from_slice(picture);
        self.views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": picture.len() }));
        self.images.push(json!({ "bufferView": self.views.len() - 1, "mimeType": mime_type }));
        self.samplers.push(json!({ "wrapS": wrapping[0], "wrapT": wrapping[1] }));
        self.textures.push(json!({ "source": self.images.len() - 1, "sampler": self.samplers.len() - 1 }));
        self.textures.len() - 1
    }

    /// Notes that the file uses an extension.
    pub fn uses(&mut self, extension: &str) {
        self.extensions.insert(extension.to_owned());
    }

    /// The index of a physics material, which is added if there is none like it.
    pub fn physics_material(&mut self, material: Value) -> usize {
        self.physics_materials.iter().position(|known| *known == material).unwrap_or_else(|| {
            self.physics_materials.push(material);
            self.physics_materials.len() - 1
        })
    }

    /// Adds a mesh of one primitive, which also has the members of `look`, and returns its index.
    pub fn mesh(&mut self, vertices: &[Point3<f64>], triangles: &[[u32; 3]], look: &Value) -> usize {
        let positions: Vec<[f32; 3]> = vertices.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect();
        let mut primitive = look.clone();
        primitive["attributes"]["POSITION"] = json!(self.floats(&positions, true));
        primitive["indices"] = json!(self.triangles(triangles));
        self.meshes.push(json!({ "primitives": [primitive] }));
        self.meshes.len() - 1
    }

    /// Adds a node that collides as the hull of a mesh; it has a physics material unless `material` is null.
    pub fn collider_node(&mut self, name: &str, mesh: usize, material: Value) -> usize {
        self.uses(PHYSICS);
        let material = (!material.is_null()).then(|| self.physics_material(material));
        self.node(json!({ "name": name, "extensions": gltf_physics::collider(mesh, material) }))
    }

    /// Adds a node of the tree.
    pub fn node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Adds all of a file that gprop wrote without pictures: its JSON and its bytes. `None` if it is not such a file.
    pub fn join(&mut self, file: &Value, bytes: &[u8]) -> Option<()> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let behind = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        let [views, accessors, meshes, materials, nodes] =
            [&self.views, &self.accessors, &self.meshes, &self.materials, &self.nodes].map(Vec::len);
        let list = |name: &str| file[name].as_array().into_iter().flatten().cloned();
        self.views.extend(list("bufferViews").map(|view| moved(view, "byteOffset", behind)));
        self.accessors.extend(list("accessors").map(|accessor| moved(accessor, "bufferView", views)));
        self.materials.extend(list("materials"));
        for mut mesh in list("meshes") {
            for primitive in mesh["primitives"].as_array_mut()? {
                let own = moved(primitive.take(), "indices", accessors);
                *primitive = moved(own, "material", materials);
                let attributes = primitive["attributes"].as_object_mut()?;
                attributes.values_mut().for_each(|index| shift(index, accessors));
            }
            self.meshes.push(mesh);
        }
        let materials_of_file = file["extensions"][PHYSICS]["physicsMaterials"].as_array().cloned().unwrap_or_default();
        let physics_materials: Vec<usize> =
            materials_of_file.into_iter().map(|material| self.physics_material(material)).collect();
        self.extensions.extend(list("extensionsUsed").filter_map(|name| Some(name.as_str()?.to_owned())));
        for node in list("nodes") {
            let mut node = moved(node, "mesh", meshes);
            if let Some(collider) = node.pointer_mut(&format!("/extensions/{PHYSICS}/collider")) {
                shift(&mut collider["geometry"]["mesh"], meshes);
                if let Some(material) = collider.get_mut("physicsMaterial") {
                    *material = json!(physics_materials.get(index(material)?)?);
                }
            }
            let children = node.get_mut("children").and_then(Value::as_array_mut);
            children.into_iter().flatten().for_each(|child| shift(child, nodes));
            self.nodes.push(node);
        }
        self.roots.extend(file["scenes"][0]["nodes"].as_array()?.iter().filter_map(index).map(|at| nodes + at));
        Some(())
    }

    /// Adds a node without parent, whose children are in axes with z up and moved to `place`.
    pub fn node_z_up(&mut self, name: &str, children: &[usize], place: &Vector3<f64>) {
        self.node_z_up_with(name, children, place, &Value::Null);
    }

    /// The same with extensions, if there are any.
    pub fn node_z_up_with(&mut self, name: &str, children: &[usize], place: &Vector3<f64>, extensions: &Value) {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mut root = json!({ "name": name, "rotation": [-half, 0.0, 0.0, half], "children": children });
        if *place != Vector3::zeros() {
            // Subtracted, so that there is no -0.
            root["translation"] = json!([place.x, place.z, 0.0 - place.y]);
        }
        if !extensions.is_null() {
            root["extensions"] = extensions.clone();
        }
        let root = self.node(root);
        self.roots.push(root);
    }

    /// The file. `extras`: what it says of the whole asset; nothing if null.
    pub fn write(mut self, extras: &Value, out: &mut dyn Write) -> io::Result<()> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut json = json!({
            "asset": { "version": "2.0", "generator": concat!("gprop ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [{ "nodes": self.roots }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.bytes.len() }],
        });
        if !extras.is_null() {
            json["asset"]["extras"] = extras.clone();
        }
        let others = [
            ("materials", self.materials),
            ("images", self.images),
            ("samplers", self.samplers),
            ("textures", self.textures),
        ];
        // glTF allows no empty list.
        for (name, list) in others.into_iter().filter(|(_, list)| !list.is_empty()) {
            json[name] = json!(list);
        }
        if !self.physics_materials.is_empty() {
            json["extensions"] = json!({ PHYSICS: { "physicsMaterials": self.physics_materials } });
        }
        if !self.extensions.is_empty() {
            json["extensionsUsed"] = json!(self.extensions);
        }
        write_glb(json.to_string().as_bytes(), &[binary_chunk(self.bytes)], out)
    }
}

/// The object with one of its members, if it has it, increased by a number.
fn moved(mut object: Value, member: &str, by: usize) -> Value {
    if let Some(member) = object.get_mut(member) {
        shift(member, by);
    }
    object
}

fn shift(value: &mut Value, by: usize) {
    if let Some(before) = index(value) {
        *value = json!(before + by);
    }
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|index| usize::try_from(index).ok())
}

fn kind(length: usize) -> &'static str {
    match length {
        1 => "SCALAR",
        2 => "VEC2",
        3 => "VEC3",
        _ => "VEC4",
    }
}
