//! URDF keeps the centre in `<origin>` and six numbers in `<inertia>`, along the axes of that origin.

use super::Target;
use super::edit::{Edits, numbers};
use crate::scene::mesh::containers::xml::Node;

pub fn write(edits: &mut Edits, inertial: Node, target: &Target) {
    if let Some(center) = target.center_m {
        let position = numbers(center.iter().copied());
        match (inertial.child("origin"), inertial.children().next()) {
            (Some(origin), _) => edits.set(origin, "xyz", &position),
            (None, Some(first)) => edits.add_before(first, &format!(r#"<origin xyz="{position}" rpy="0 0 0"/>"#)),
            (None, None) => {}
        }
    }
    let Some(inertia) = target.inertia_as_stated() else { return };
    let moments = [
        ("ixx", inertia[(0, 0)]),
        ("ixy", inertia[(0, 1)]),
        ("ixz", inertia[(0, 2)]),
        ("iyy", inertia[(1, 1)]),
        ("iyz", inertia[(1, 2)]),
        ("izz", inertia[(2, 2)]),
    ];
    if let Some(node) = inertial.child("inertia") {
        for (name, moment) in moments {
            edits.set(node, name, &numbers([moment]));
        }
    } else if let Some(mass) = inertial.child("mass") {
        let written = moments.map(|(name, moment)| format!(r#"{name}="{}""#, numbers([moment])));
        edits.add_behind(mass, &format!("<inertia {}/>", written.join(" ")));
    }
}
