//! Meshes as glTF: `NAME.glb` has a closed mesh for each part, in the splat's colours; `NAME_colliders.glb` has the
//! colliders, below a node for each part. A part's node has its properties as `extras`.

use nalgebra::Point3;
use serde_json::json;

use super::gltf::Gltf;
use super::names::{self, within};
use super::shape::PartMesh;
use super::{ExportError, Files, Meshes, Model, asset_extras, body_name, identifier, part_facts};
use crate::pictures::palette;

pub(super) fn write(model: &Model, meshes: &Meshes, files: &mut Files) -> Result<(), ExportError> {
    let (name, extras_of_asset) = (identifier(model.name), asset_extras(model, &meshes.placement));
    let (body, names) = (body_name(model.name), names::of_parts(&model.field.parts));
    let name_of = |part: u32| within(&body, &names[&part]);
    let mut visual = Gltf::default();
    visual.materials.push(json!({ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.7 } }));
    let mut nodes = Vec::new();
    for PartMesh { part, mesh, colors } in meshes.parts {
        let positions: Vec<[f32; 3]> = floats(&mesh.vertices);
        let normals: Vec<[f32; 3]> =
            mesh.shading_normals().iter().map(|n| [n.x as f32, n.y as f32, n.z as f32]).collect();
        let attributes = json!({
            "POSITION": visual.floats(&positions, true),
            "NORMAL": visual.floats(&normals, false),
            "COLOR_0": visual.colors(colors, |_| 1.0),
        });
        let primitive =
            json!({ "attributes": attributes, "indices": visual.triangles(&mesh.triangles), "material": 0 });
        visual.meshes.push(json!({ "primitives": [primitive] }));
        let mesh = visual.meshes.len() - 1;
        nodes.push(visual.node(json!({ "name": name_of(*part), "mesh": mesh, "extras": part_facts(model, *part) })));
    }
    visual.node_z_up(&body, &nodes, &meshes.placement.place());
    files.write(format!("{name}.glb"), |out| visual.write(&[], &extras_of_asset, out))?;

    let mut colliders = Gltf::default();
    let mut nodes = Vec::new();
    for of_part in meshes.shape.colliders.chunk_by(|a, b| a.part == b.part) {
        let part = of_part[0].part;
        let [r, g, b] = palette::part(part);
        colliders
            .materials
            .push(json!({ "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0 } }));
        let material = colliders.materials.len() - 1;
        let mut children = Vec::new();
        for collider in of_part {
            let attributes = json!({ "POSITION": colliders.floats(&floats(&collider.vertices), true) });
            let indices = colliders.triangles(&collider.triangles);
            colliders.meshes.push(
                json!({ "primitives": [{ "attributes": attributes, "indices": indices, "material": material }] }),
            );
            let mesh = colliders.meshes.len() - 1;
            children.push(colliders.node(json!({ "name": within(&body, &collider.name), "mesh": mesh })));
        }
        let node = json!({ "name": name_of(part), "children": children, "extras": part_facts(model, part) });
        nodes.push(colliders.node(node));
    }
    colliders.node_z_up(&body, &nodes, &meshes.placement.place());
    files.write(format!("{name}_colliders.glb"), |out| colliders.write(&[], &extras_of_asset, out))
}

fn floats(points: &[Point3<f64>]) -> Vec<[f32; 3]> {
    points.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect()
}
