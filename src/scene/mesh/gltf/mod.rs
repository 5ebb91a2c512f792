//! glTF 2.0, as GLB or with its buffers and pictures in files or data URIs.
//!
//! 1. The `gltf` crate splits a GLB and reads the JSON into its types. Its own checks and readers are not used: they refuse what
//!    does not matter here (unknown attributes, missing bounds), and read positions only as floats (not
//!    `KHR_mesh_quantization`).
//! 2. `buffers` finds the bytes, `accessor` reads numbers out of them: everything is checked against what is there.
//! 3. `look` reads materials, textures and their pictures.
//! 4. `tree` lists the nodes of the scene, `nodes` places their meshes and instances; `primitive` reads their triangles.
//! 5. [`physics`] reads what the file says of rigid bodies.

mod accessor;
mod buffers;
mod file;
mod look;
mod nodes;
pub mod physics;
mod primitive;
mod tree;

use super::assembly::Assembly;
use super::beside::Beside;
pub use super::problems::GltfProblem as Problem;
use super::{Mesh, Problem as MeshProblem, Triangles};
use crate::files::json;
use buffers::Buffers;
use gltf::Glb;
use gltf::json::Root;
use nalgebra::Matrix4;
use serde_json::Value;

use physics::Outline;

pub use file::{GltfFile, binary_chunk, write_glb};
pub use tree::{PlacedNode, rotation as quaternion, rotation_of};

/// The JSON and its buffers.
pub(super) struct Document<'a> {
    pub root: Root,
    buffers: Buffers<'a>,
}

impl<'a> Document<'a> {
    /// The glTF or GLB in these bytes.
    pub fn open(bytes: &'a [u8], beside: &mut Beside<'_>) -> Result<Self, MeshProblem> {
        let (json, binary) = split(bytes)?;
        let root: Root = json::parse(json).map_err(Problem::Json)?;
        if !root.asset.version.starts_with("2.") {
            return Err(Problem::Version { version: root.asset.version.chars().take(20).collect() }.into());
        }
        let buffers = Buffers::open(&root, binary, beside)?;
        Ok(Self { root, buffers })
    }

    /// An extension of the whole file.
    pub fn extension(&self, name: &str) -> Option<&Value> {
        self.root.extensions.as_ref()?.others.get(name)
    }

    /// A node and those below it, with their places if its own is `place`.
    pub fn below(&self, index: usize, place: Matrix4<f64>) -> Result<Vec<(usize, Matrix4<f64>)>, Problem> {
        let nodes = tree::below(&self.root, vec![index])?;
        let Some(top) = nodes.first().and_then(|top| top.world_from_node.try_inverse()) else { return Ok(Vec::new()) };
        Ok(nodes.iter().map(|node| (node.index, place * top * node.world_from_node)).collect())
    }

    /// The triangles of the meshes of these nodes, each at its place.
    pub fn surface(&self, nodes: &[(usize, Matrix4<f64>)]) -> Result<Triangles, MeshProblem> {
        let mut assembly = Assembly::default();
        // Looks do not matter.
        let looks = vec![None; self.root.materials.len() + 1];
        for (index, place) in nodes {
            nodes::place(self, *index, place, &looks, &mut assembly)?;
        }
        Ok(assembly.into_surface())
    }

    /// The triangles of a mesh at a place.
    pub fn surface_of_mesh(&self, mesh: usize, place: Matrix4<f64>) -> Result<Triangles, MeshProblem> {
        let mut assembly = Assembly::default();
        let looks = vec![None; self.root.materials.len() + 1];
        nodes::place_mesh(self, mesh, &[place], "", &looks, &mut assembly)?;
        Ok(assembly.into_surface())
    }
}

pub(super) fn read(bytes: &[u8], beside: &mut Beside<'_>) -> Result<Mesh, MeshProblem> {
    let document = Document::open(bytes, beside)?;
    let mut assembly = Assembly::default();
    assembly.claimed_mass_kg = Outline::of_root(&document.root)?.mass_kg();
    note_unused(&document.root, &mut assembly);
    let materials = look::read(&document, beside, &mut assembly)?;
    nodes::place_all(&document, &materials, &mut assembly)?;
    assembly.finished(Some(1.0))
}

/// The JSON and the binary chunk; a file that does not begin like a GLB is JSON.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Problem> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    // A version of 1 has other chunks.
    if let Some(version) = bytes.get(4..8).filter(|version| *version != [2, 0, 0, 0]) {
        return Err(Problem::Version { version: version[0].to_string() });
    }
    match Glb::from_slice(bytes).map_err(Problem::Container)? {
        Glb { json: std::borrow::Cow::Borrowed(json), bin: None, .. } => Ok((json, None)),
        Glb { json: std::borrow::Cow::Borrowed(json), bin: Some(std::borrow::Cow::Borrowed(bin)), .. } => {
            Ok((json, Some(bin)))
        }
        _ => unreachable!("chunks of a slice are borrowed from it"),
    }
}

/// Extensions whose data gprop reads, or that change nothing of a surface's shape and base colour.
const KNOWN_EXTENSIONS: [&str; 16] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_collision_shapes",
    "KHR_draco_mesh_compression",
    "KHR_implicit_shapes",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_physics_rigid_bodies",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
    "MSFT_lod",
    "EXT_texture_avif",
];

/// Says what the file has that a still surface has no use for, and which extensions it requires that gprop does not know.
fn note_unused(root: &Root, assembly: &mut Assembly) {
    let mut note = |count: usize, what: &str| {
        if count > 0 {
            assembly.notes.push(format!("{what} are not used ({count})"));
        }
    };
    note(root.animations.len(), "animations");
    note(root.cameras.len(), "cameras");
    note(root.skins.len(), "skins: the mesh is shown as it is stored, without its skeleton's pose; they");
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    note(primitives.filter(|primitive| primitive.targets.is_some()).count(), "morph targets");
    let is_known = |name: &str| KNOWN_EXTENSIONS.contains(&name) || name.starts_with("KHR_materials_");
    for name in root.extensions_required.iter().filter(|name| !is_known(name)) {
        let name: String = name.chars().take(60).collect();
        assembly.warnings.push(format!(
            "the file requires the extension {name}, which gprop does not know; something may be missing: look at the pictures \
             of `gprop inspect --html`"
        ));
    }
}
