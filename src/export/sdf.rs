//! SDFormat: the model of one object, as [`table`](super::table) writes each of a scene, in a file of its own; or a link for each part,
//! with joints that fix them.

use std::fmt::Write;

use super::table::sdf::{Link, LinkCollider, open_model, write_body, write_link};
use super::{ExportError, Files, Rigid, Shared, obj, restitution};

pub(super) fn write(shared: &Shared, files: &mut Files) -> Result<(), ExportError> {
    let rigid = shared.rigid()?;
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n{}<sdf version=\"1.9\" xmlns:drake=\"http://drake.mit.edu\">\n",
        rigid.comments()
    );
    if rigid.links.is_empty() {
        write_body(&mut text, &shared.body()?.ok_or(ExportError::NoShape)?);
    } else {
        write_parts(&mut text, &rigid);
    }
    text.push_str("</sdf>\n");
    files.write(format!("{}.sdf", rigid.name), |out| out.write_all(text.as_bytes()))?;
    obj::write_meshes(&rigid, files)
}

fn write_parts(text: &mut String, rigid: &Rigid) {
    open_model(text, &rigid.name, &rigid.placement.place());
    for (n, link) in rigid.links.iter().enumerate() {
        let colliders = rigid.colliders_of(n).map(|collider| LinkCollider {
            name: rigid.collider_name(collider),
            friction: rigid.friction(collider),
            restitution: restitution(rigid.label(collider)),
        });
        let written =
            Link { name: &link.name, origin: link.joint, inertial: link.inertial, colliders: colliders.collect() };
        write_link(text, &written);
    }
    for link in rigid.links {
        if let Some(parent) = link.parent {
            let (name, parent) = (&link.name, &rigid.links[parent].name);
            let _ = writeln!(
                text,
                r#"      <joint name="{name}_fixed" type="fixed"><parent>{parent}</parent><child>{name}</child></joint>"#
            );
        }
    }
    text.push_str("    </model>\n");
}
