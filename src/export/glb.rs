//! Meshes as glTF: `NAME.glb` has a closed mesh for each part, in the splat's colours, below the node that moves, which also has the
//! colliders and, if they are asked for, the Gaussians. In `NAME_colliders.glb`, the colliders are drawn, below a node for each part. A part's
//! node has its properties as `extras`.

use serde_json::{Value, json};

use super::gltf::Gltf;
use super::names::{self, within};
use super::shape::PartMesh;
use super::table::{Body, BodyCollider};
use super::{
    ExportError, Files, GlbLook, Meshes, Model, Shared, asset_extras, body_name, gltf_physics, gltf_splat, identifier,
    part_facts,
};
use crate::pictures::palette;

pub(super) fn write(shared: &Shared, files: &mut Files) -> Result<(), ExportError> {
    let (model, meshes) = (shared.model, shared.meshes()?);
    let (name, extras) = (identifier(model.name), asset_extras(model, &meshes.placement));
    let object = object(model, &meshes, shared.body()?);
    files.write(format!("{name}.glb"), |out| object.write(&extras, out))?;
    let colliders = colliders(model, &meshes);
    files.write(format!("{name}_colliders.glb"), |out| colliders.write(&extras, out))
}

/// The file of the object; without physics, if it is no rigid body.
fn object(model: &Model, meshes: &Meshes, body: Option<Body>) -> Gltf {
    let mut gltf = Gltf::default();
    let mut nodes = Vec::new();
    if model.glb_look != GlbLook::Splat {
        add_parts(&mut gltf, model, meshes, &mut nodes);
    }
    if model.glb_look != GlbLook::Meshes {
        nodes.push(gltf_splat::add_node(&mut gltf, model, &meshes.placement));
    }
    let name = body_name(model.name);
    let mut extensions = Value::Null;
    if let Some(Body { inertial, colliders, .. }) = body {
        extensions = gltf_physics::motion(&inertial);
        for BodyCollider { shape, friction, restitution } in colliders {
            let mesh = gltf.mesh(&shape.vertices, &shape.triangles, &json!({}));
            let material = gltf_physics::material(friction, restitution);
            nodes.push(gltf.collider_node(&within(&name, &shape.name), mesh, material));
        }
    }
    gltf.node_z_up_with(&name, &nodes, &meshes.placement.place(), &extensions);
    gltf
}

fn add_parts(gltf: &mut Gltf, model: &Model, meshes: &Meshes, nodes: &mut Vec<usize>) {
    gltf.materials.push(json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.7 } }));
    let name_of = name_of(model);
    for PartMesh { part, mesh, colors } in meshes.parts {
        let normals: Vec<[f32; 3]> =
            mesh.shading_normals().iter().map(|n| [n.x as f32, n.y as f32, n.z as f32]).collect();
        let attributes = json!({
            "NORMAL": gltf.floats(&normals, false),
            "COLOR_0": gltf.colors(colors, |_| 1.0),
        });
        let mesh = gltf.mesh(&mesh.vertices, &mesh.triangles, &json!({ "attributes": attributes, "material": 0 }));
        nodes.push(gltf.node(json!({ "name": name_of(*part), "mesh": mesh, "extras": part_facts(model, *part) })));
    }
}

/// The file that shows the colliders.
fn colliders(model: &Model, meshes: &Meshes) -> Gltf {
    let (mut gltf, body, name_of) = (Gltf::default(), body_name(model.name), name_of(model));
    let mut nodes = Vec::new();
    for of_part in meshes.shape.colliders.chunk_by(|a, b| a.part == b.part) {
        let part = of_part[0].part;
        let [r, g, b] = palette::part(part);
        gltf.materials
            .push(json!({ "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0 } }));
        let material = gltf.materials.len() - 1;
        let mut children = Vec::new();
        for collider in of_part {
            let mesh = gltf.mesh(&collider.vertices, &collider.triangles, &json!({ "material": material }));
            children.push(gltf.node(json!({ "name": within(&body, &collider.name), "mesh": mesh })));
        }
        let node = json!({ "name": name_of(part), "children": children, "extras": part_facts(model, part) });
        nodes.push(gltf.node(node));
    }
    gltf.node_z_up(&body, &nodes, &meshes.placement.place());
    gltf
}

/// The name of each part's node.
fn name_of(model: &Model) -> impl Fn(u32) -> String {
    let (body, names) = (body_name(model.name), names::of_parts(&model.field.parts));
    move |part| within(&body, &names[&part])
}
