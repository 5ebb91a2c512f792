//! URDF keeps the centre in `<origin>` and six numbers in `<inertia>`, along the axes of that origin.

use super::super::Inertial;
use super::super::xml::Node;
use super::Statement;
use super::edit::{Edits, numbers};
use nalgebra::Matrix3;

/// Changes the inertial properties that the element `inertial` states.
pub fn change(edits: &mut Edits, inertial: Node, stated: &Inertial, statement: &Statement) {
    if let (Some(mass), Some(node)) = (statement.mass_kg, inertial.child("mass")) {
        edits.set(node, "value", &numbers([mass]));
    }
    if let Some(center) = statement.center_m {
        let position = numbers(center.iter().copied());
        match (inertial.child("origin"), inertial.children().next()) {
            (Some(origin), _) => edits.set(origin, "xyz", &position),
            (None, Some(first)) => edits.add_before(first, &format!(r#"<origin xyz="{position}" rpy="0 0 0"/>"#)),
            (None, None) => {}
        }
    }
    let Some(inertia) = statement.inertia_as_stated(stated) else { return };
    let moments = moments(&inertia);
    if let Some(node) = inertial.child("inertia") {
        for (name, moment) in moments {
            edits.set(node, name, &numbers([moment]));
        }
    } else if let Some(mass) = inertial.child("mass") {
        edits.add_behind(mass, &inertia_element(&inertia));
    }
}

/// Gives a link that states none its inertial properties.
pub fn add(edits: &mut Edits, link: Node, statement: &Statement) {
    let Statement { mass_kg: Some(mass), center_m: Some(center), inertia_kg_m2: Some(inertia), .. } = statement else {
        return;
    };
    let Some(first) = link.children().next() else { return };
    let origin = format!(r#"<origin xyz="{}" rpy="0 0 0"/>"#, numbers(center.iter().copied()));
    let mass = format!(r#"<mass value="{}"/>"#, numbers([*mass]));
    edits.add_before(first, &format!("<inertial>{origin}{mass}{}</inertial>", inertia_element(inertia)));
}

/// Sets the friction of a link in the form that PyBullet reads; URDF itself has none.
pub fn set_friction(edits: &mut Edits, link: Node, friction: f64) {
    let value = numbers([friction]);
    let contact = link.child("contact");
    match (contact.and_then(|contact| contact.child("lateral_friction")), contact, link.children().next()) {
        (Some(stated), ..) => edits.set(stated, "value", &value),
        (None, Some(contact), _) => {
            if let Some(first) = contact.children().next() {
                edits.add_before(first, &format!(r#"<lateral_friction value="{value}"/>"#));
            }
        }
        (None, None, Some(first)) => {
            edits.add_before(first, &format!(r#"<contact><lateral_friction value="{value}"/></contact>"#));
        }
        (None, None, None) => {}
    }
}

fn moments(inertia: &Matrix3<f64>) -> [(&'static str, f64); 6] {
    [
        ("ixx", inertia[(0, 0)]),
        ("ixy", inertia[(0, 1)]),
        ("ixz", inertia[(0, 2)]),
        ("iyy", inertia[(1, 1)]),
        ("iyz", inertia[(1, 2)]),
        ("izz", inertia[(2, 2)]),
    ]
}

fn inertia_element(inertia: &Matrix3<f64>) -> String {
    let written = moments(inertia).map(|(name, moment)| format!(r#"{name}="{}""#, numbers([moment])));
    format!("<inertia {}/>", written.join(" "))
}
