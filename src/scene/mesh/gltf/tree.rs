//! The nodes of the scene in the order of the file's tree, each with its place in the world.

use gltf::json::{Index, Node, Root};
use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};

use super::Problem;

/// A node of the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedNode {
    /// Its index in the file.
    pub index: usize,
    /// Where its parent stands in the list.
    pub parent: Option<usize>,
    /// glTF's axes, metres.
    pub world_from_node: Matrix4<f64>,
}

/// The nodes of the scene (the default one, else the first, else every node that no other has), parents before their children.
pub fn placed(root: &Root) -> Result<Vec<PlacedNode>, Problem> {
    below(root, roots(root)?)
}

/// These nodes and those below them, parents before their children.
pub fn below(root: &Root, tops: Vec<usize>) -> Result<Vec<PlacedNode>, Problem> {
    let mut seen = vec![false; root.nodes.len()];
    let mut placed: Vec<PlacedNode> = Vec::new();
    let mut open: Vec<(usize, Option<usize>)> = tops.into_iter().rev().map(|node| (node, None)).collect();
    while let Some((index, parent)) = open.pop() {
        let no_such = || Problem::NoSuch { place: "the scene".to_owned(), what: "node", index };
        let node = root.nodes.get(index).ok_or_else(no_such)?;
        if std::mem::replace(&mut seen[index], true) {
            return Err(Problem::NotATree { node: index });
        }
        let world_from_parent = parent.map_or_else(Matrix4::identity, |parent| placed[parent].world_from_node);
        let world_from_node = world_from_parent * parent_from_node(node);
        if world_from_node.iter().any(|value| !value.is_finite()) {
            return Err(Problem::Transform { node: index });
        }
        let at = placed.len();
        placed.push(PlacedNode { index, parent, world_from_node });
        open.extend(node.children.iter().flatten().rev().map(|child| (child.value(), Some(at))));
    }
    Ok(placed)
}

/// The nodes of the scene that have no parent.
fn roots(root: &Root) -> Result<Vec<usize>, Problem> {
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
pub fn transform(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> Matrix4<f64> {
    let linear: Matrix3<f64> = self::rotation(rotation).to_rotation_matrix() * Matrix3::from_diagonal(&scale.into());
    let mut matrix = linear.to_homogeneous();
    matrix.set_column(3, &Vector4::from([translation[0], translation[1], translation[2], 1.0]));
    matrix
}

/// The rotation of a quaternion x y z w; none if that has no length.
pub fn rotation([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-12).unwrap_or_else(UnitQuaternion::identity)
}

/// The rotation of a transform without its scale and mirroring.
pub fn rotation_of(transform: &Matrix4<f64>) -> UnitQuaternion<f64> {
    let linear: Matrix3<f64> = transform.fixed_view::<3, 3>(0, 0).into_owned();
    let mirrored = if linear.determinant() < 0.0 { -linear } else { linear };
    let column = |n: usize| -> Vector3<f64> { mirrored.column(n).try_normalize(0.0).unwrap_or_else(Vector3::zeros) };
    UnitQuaternion::from_matrix(&Matrix3::from_columns(&[column(0), column(1), column(2)]))
}
