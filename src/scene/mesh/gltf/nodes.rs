//! Where each mesh of the scene stands, and how often.

use gltf::json::Node;
use nalgebra::Matrix4;
use serde_json::Value;

use super::look::Placement;
use super::primitive::Primitive;
use super::tree::{self, transform};
use super::{Document, Problem};
use crate::scene::mesh::assembly::Assembly;
use crate::scene::mesh::{GltfPrimitive, MOST_SHAPES, Problem as MeshProblem};

const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Places the meshes of every node of the scene.
pub(super) fn place_all(
    document: &Document<'_>,
    placements: &[Option<Placement>],
    assembly: &mut Assembly,
) -> Result<(), MeshProblem> {
    for placed in tree::placed(&document.root)? {
        place(document, placed.index, &placed.world_from_node, placements, assembly)?;
    }
    Ok(())
}

/// Places the mesh of one node, if it has one.
pub(super) fn place(
    document: &Document<'_>,
    index: usize,
    world_from_node: &Matrix4<f64>,
    placements: &[Option<Placement>],
    assembly: &mut Assembly,
) -> Result<(), MeshProblem> {
    let node = &document.root.nodes[index];
    let Some(mesh) = node.mesh else { return Ok(()) };
    let no_such = || Problem::NoSuch { place: format!("node {index}"), what: "mesh", index: mesh.value() };
    let shape = document.root.meshes.get(mesh.value()).ok_or_else(no_such)?;
    let name = node.name.as_deref().or(shape.name.as_deref()).unwrap_or_default();
    let instances = instances(document, node, &format!("node {index}"))?;
    let places: Vec<Matrix4<f64>> = instances.iter().map(|instance| world_from_node * instance).collect();
    place_mesh(document, mesh.value(), &places, name, placements, assembly)
}

/// Places a mesh of the file, which has it, under this name.
pub(super) fn place_mesh(
    document: &Document<'_>,
    mesh: usize,
    places: &[Matrix4<f64>],
    name: &str,
    placements: &[Option<Placement>],
    assembly: &mut Assembly,
) -> Result<(), MeshProblem> {
    for (number, from) in document.root.meshes[mesh].primitives.iter().enumerate() {
        let source = GltfPrimitive { mesh, primitive: number };
        let place = format!("mesh {mesh}, primitive {number}");
        let Some(primitive) = Primitive::read(document, from, placements, &place, assembly)? else { continue };
        for world_from_mesh in places {
            primitive.place(world_from_mesh, name, source, assembly)?;
        }
    }
    Ok(())
}

/// The transforms of the node's instances into the node; only the identity unless `EXT_mesh_gpu_instancing` says otherwise.
fn instances(document: &Document<'_>, node: &Node, place: &str) -> Result<Vec<Matrix4<f64>>, MeshProblem> {
    let extension = node.extensions.as_ref().and_then(|all| all.others.get(INSTANCING));
    let Some(attributes) = extension.and_then(|extension| extension.get("attributes")) else {
        return Ok(vec![Matrix4::identity()]);
    };
    let accessor = |name: &str| attributes.get(name).and_then(Value::as_u64).map(|index| index as usize);
    let names = ["TRANSLATION", "ROTATION", "SCALE"];
    let count = names.iter().filter_map(|name| document.count(accessor(name)?)).max().unwrap_or(0);
    if count > MOST_SHAPES as u64 {
        return Err(MeshProblem::TooMany { place: place.to_owned(), what: "instances", most: MOST_SHAPES as u64 });
    }
    let place = format!("{place}, {INSTANCING}");
    let count = count as usize;
    let translations = values(document, accessor("TRANSLATION"), &place, [0.0; 3], count)?;
    let rotations = values(document, accessor("ROTATION"), &place, [0.0, 0.0, 0.0, 1.0], count)?;
    let scales = values(document, accessor("SCALE"), &place, [1.0; 3], count)?;
    let of_instance = |instance: usize| transform(translations[instance], rotations[instance], scales[instance]);
    Ok((0..count).map(of_instance).collect())
}

/// `count` values of an attribute of instances, `default` where it has none.
fn values<const N: usize>(
    document: &Document<'_>,
    accessor: Option<usize>,
    place: &str,
    default: [f64; N],
    count: usize,
) -> Result<Vec<[f64; N]>, MeshProblem> {
    let mut values = match accessor {
        Some(index) => document.vectors(index, place, default)?,
        None => Vec::new(),
    };
    values.resize(count, default);
    Ok(values)
}
