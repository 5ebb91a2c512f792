//! glTF keeps a body's numbers in the `motion` of its node.

use nalgebra::{Matrix3, Matrix4, Point3};

use super::super::Body;
use super::Statement;
use crate::files::json_patch::{Patch, places_of_items};
use crate::scene::mesh::gltf::physics::{EXTENSION, NodeStatement, Outline};
use crate::scene::mesh::gltf::{GltfFile, rotation_of};

/// The file with these statements in it; frictions stay. `None` as for [`super::with_statements`].
pub fn with_statements(bytes: &[u8], statements: &[(&Body, Statement)]) -> Option<Vec<u8>> {
    let file = GltfFile::of(bytes)?;
    let outline = Outline::of(bytes).ok()?;
    let places = places_of_items(file.text, "nodes");
    let mut patch = Patch::default();
    for (body, statement) in statements {
        let index = places.iter().position(|place| *place == body.place.bytes)?;
        let placed = outline.nodes.iter().find(|node| node.index == index)?;
        let motion = patch.member("nodes").item(index).member("extensions").member(EXTENSION).member("motion");
        let node_from_world = placed.world_from_node.try_inverse()?;
        let center = |center| node_from_world.transform_point(&in_world(&placed.world_from_node, center));
        NodeStatement {
            mass_kg: statement.mass_kg,
            center: statement.center_m.map(|in_body| center(Point3::from(in_body))),
            // The body's axes are those of the node.
            inertia: statement.inertia_kg_m2.map(symmetric),
        }
        .state(motion);
    }
    let text = patch.applied(file.text)?;
    let mut changed = Vec::new();
    file.write_with(&text, &[], &mut changed).ok()?;
    Some(changed)
}

/// A place in the frame of a body, which is that of its node without scale.
fn in_world(world_from_node: &Matrix4<f64>, in_body: Point3<f64>) -> Point3<f64> {
    rotation_of(world_from_node) * in_body + world_from_node.fixed_view::<3, 1>(0, 3)
}

fn symmetric(inertia: Matrix3<f64>) -> Matrix3<f64> {
    (inertia + inertia.transpose()) * 0.5
}
