//! The nodes of the scene: where each mesh stands, and how often.

use gltf::json::{Index, Node};
use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};
use serde_json::Value;

use super::look::Placement;
use super::primitive::Primitive;
use super::{Document, Problem};
use crate::scene::mesh::assembly::Assembly;
use crate::scene::mesh::{MOST_PIECES, Problem as MeshProblem};

const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// Places the meshes of every node of the scene (the default one, else the first, else every node that no other has).
pub(super) fn place_all(
    document: &Document<'_>,
    placements: &[Option<Placement>],
    assembly: &mut Assembly,
) -> Result<(), MeshProblem> {
    let mut seen = vec![false; document.root.nodes.len()];
    let mut open: Vec<(usize, Matrix4<f64>)> =
        roots(document)?.into_iter().rev().map(|node| (node, Matrix4::identity())).collect();
    while let Some((index, world_from_parent)) = open.pop() {
        let place = format!("node {index}");
        let no_such = || Problem::NoSuch { place: "the scene".to_owned(), what: "node", index };
        let node = document.root.nodes.get(index).ok_or_else(no_such)?;
        if std::mem::replace(&mut seen[index], true) {
            return Err(Problem::NotATree { node: index }.into());
        }
        let world_from_node = world_from_parent * parent_from_node(node);
        if world_from_node.iter().any(|value| !value.is_finite()) {
            return Err(Problem::Transform { node: index }.into());
        }
        if let Some(mesh) = node.mesh {
            let no_such = || Problem::NoSuch { place: place.clone(), what: "mesh", index: mesh.value() };
            let shape = document.root.meshes.get(mesh.value()).ok_or_else(no_such)?;
            let name = node.name.as_deref().or(shape.name.as_deref()).unwrap_or_default();
            for (number, from) in shape.primitives.iter().enumerate() {
                let place = format!("mesh {}, primitive {number}", mesh.value());
                let Some(primitive) = Primitive::read(document, from, placements, &place, assembly)? else { continue };
                for instance in instances(document, node, &format!("node {index}"))? {
                    primitive.place(&(world_from_node * instance), name, assembly)?;
                }
            }
        }
        open.extend(node.children.iter().flatten().rev().map(|child| (child.value(), world_from_node)));
    }
    Ok(())
}

fn roots(document: &Document<'_>) -> Result<Vec<usize>, Problem> {
    let root = &document.root;
    let default = root.scene.map_or(0, |scene| scene.value());
    match root.scenes.get(default) {
        Some(scene) => Ok(scene.nodes.iter().map(Index::value).collect()),
        None if root.scene.is_some() => {
            Err(Problem::NoSuch { place: "the file".to_owned(), what: "scene", index: default })
        }
        None => {
            let mut is_root = vec![true; root.nodes.len()];
            for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
                if let Some(is_root) = is_root.get_mut(child.value()) {
                    *is_root = false;
                }
            }
            Ok((0..root.nodes.len()).filter(|node| is_root[*node]).collect())
        }
    }
}

fn parent_from_node(node: &Node) -> Matrix4<f64> {
    if let Some(matrix) = &node.matrix {
        return Matrix4::from_column_slice(&matrix.map(f64::from));
    }
    let translation = node.translation.unwrap_or([0.0; 3]).map(f64::from);
    let rotation = node.rotation.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation.0).map(f64::from);
    let scale = node.scale.unwrap_or([1.0; 3]).map(f64::from);
    transform(translation, rotation, scale)
}

/// T R S; `rotation` is a quaternion x y z w.
fn transform(translation: [f64; 3], [x, y, z, w]: [f64; 4], scale: [f64; 3]) -> Matrix4<f64> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-12).unwrap_or_else(UnitQuaternion::identity);
    let linear: Matrix3<f64> = rotation.to_rotation_matrix() * Matrix3::from_diagonal(&Vector3::from(scale));
    let mut matrix = linear.to_homogeneous();
    matrix.set_column(3, &Vector4::from([translation[0], translation[1], translation[2], 1.0]));
    matrix
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
    if count > MOST_PIECES as u64 {
        return Err(MeshProblem::TooMany { place: place.to_owned(), what: "instances", most: MOST_PIECES as u64 });
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
