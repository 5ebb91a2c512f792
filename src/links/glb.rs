//! A link as a GLB with the looks of its meshes, as a scene that gprop reads.

use std::collections::HashMap;
use std::io;

use serde_json::{Value, json};

use super::shape::{LinkShape, PlacedShape};
use crate::export::gltf::Gltf;
use crate::scene::mesh::gltf::physics::EXTENSION;
use crate::scene::mesh::{Alpha, Face, Material, Mesh, Wrapping};

/// The base colour of simple shapes: light grey.
const GREY: f32 = 0.6;

/// Writes the file of a link's shape. What the link is said to weigh is stated in the form that gprop reads, so that its report
/// has it.
///
/// # Errors
/// If it cannot be written, or would have more than 4 GB.
pub fn write(shape: &LinkShape, claimed_mass_kg: Option<f64>, out: &mut dyn io::Write) -> io::Result<()> {
    let mut gltf = Gltf::default();
    let mut nodes = Vec::new();
    for placed in &shape.shapes {
        let primitives = match &placed.mesh {
            Some(mesh) => of_mesh(&mut gltf, placed, mesh),
            None => {
                let look = Material { base_color: [GREY, GREY, GREY, 1.0], ..Material::default() };
                let material = add_material(&mut gltf, &look, None);
                vec![primitive(&mut gltf, placed, None, (0..placed.surface.triangles.len()).collect(), material)]
            }
        };
        gltf.meshes.push(json!({ "primitives": primitives }));
        let mesh = gltf.meshes.len() - 1;
        nodes.push(gltf.node(json!({ "mesh": mesh })));
    }
    let Some(mass) = claimed_mass_kg else {
        gltf.node_z_up("link", &nodes, &nalgebra::Vector3::zeros());
        return gltf.write(&Value::Null, out);
    };
    gltf.node_z_up_with(
        "link",
        &nodes,
        &nalgebra::Vector3::zeros(),
        &json!({ EXTENSION: { "motion": { "mass": mass } } }),
    );
    gltf.uses(EXTENSION);
    gltf.write(&Value::Null, out)
}

/// One primitive for each material that is used.
fn of_mesh(gltf: &mut Gltf, placed: &PlacedShape, mesh: &Mesh) -> Vec<Value> {
    let mut of_material: Vec<Vec<usize>> = vec![Vec::new(); mesh.materials.len()];
    mesh.faces.iter().enumerate().for_each(|(n, face)| of_material[face.material as usize].push(n));
    let mut textures: HashMap<u32, usize> = HashMap::new();
    let used = mesh.materials.iter().zip(of_material).filter(|(_, triangles)| !triangles.is_empty());
    used.map(|(material, triangles)| {
        let texture = material.texture.and_then(|texture| {
            let key = texture.picture;
            let number = textures.get(&key).copied().or_else(|| {
                let picture = mesh.pictures[texture.picture as usize].encoded_for_gltf().ok()?;
                Some(gltf.texture(&picture.bytes, picture.kind, texture.wrapping.map(wrapping)))
            })?;
            textures.insert(key, number);
            Some(number)
        });
        let material = add_material(gltf, material, texture);
        primitive(gltf, placed, Some(mesh), triangles, material)
    })
    .collect()
}

fn add_material(gltf: &mut Gltf, material: &Material, texture: Option<usize>) -> usize {
    let mut look = json!({ "baseColorFactor": material.base_color, "metallicFactor": 0.0 });
    if let Some(texture) = texture {
        look["baseColorTexture"] = json!({ "index": texture });
    }
    let mut written = json!({ "pbrMetallicRoughness": look, "doubleSided": true });
    match material.alpha {
        Alpha::Opaque => {}
        Alpha::CutBelow(cutoff) => {
            written["alphaMode"] = json!("MASK");
            written["alphaCutoff"] = json!(cutoff);
        }
        Alpha::Blend => written["alphaMode"] = json!("BLEND"),
    }
    gltf.materials.push(written);
    gltf.materials.len() - 1
}

/// Triangles with one material; corners that share position and texture coordinates become one vertex.
fn primitive(
    gltf: &mut Gltf,
    placed: &PlacedShape,
    mesh: Option<&Mesh>,
    triangles: Vec<usize>,
    material: usize,
) -> Value {
    let faces: &[Face] = mesh.map_or(&[], |mesh| &mesh.faces);
    let vertex_colors: &[[f32; 4]] = mesh.map_or(&[], |mesh| &mesh.vertex_colors);
    let (mut numbers, mut corners) = (HashMap::new(), Vec::new());
    let (mut positions, mut coordinates, mut colors) = (Vec::new(), Vec::new(), Vec::new());
    let has_texture = triangles.iter().any(|n| faces.get(*n).is_some_and(|face| face.texture_coordinates.is_some()));
    for n in triangles {
        let of_corners = faces.get(n).and_then(|face| face.texture_coordinates).unwrap_or_default();
        let corner = |corner: usize| {
            let (vertex, at) = (placed.surface.triangles[n][corner], of_corners[corner]);
            *numbers.entry((vertex, at.map(f32::to_bits))).or_insert_with(|| {
                positions.push(placed.surface.vertices[vertex as usize].map(|value| value as f32));
                coordinates.push(at);
                colors.extend(vertex_colors.get(vertex as usize).copied());
                positions.len() as u32 - 1
            })
        };
        corners.push([0, 1, 2].map(corner));
    }
    let mut attributes = json!({ "POSITION": gltf.floats(&positions, true) });
    if has_texture {
        attributes["TEXCOORD_0"] = json!(gltf.floats(&coordinates, false));
    }
    if !colors.is_empty() {
        attributes["COLOR_0"] = json!(gltf.floats(&colors, false));
    }
    json!({ "attributes": attributes, "indices": gltf.triangles(&corners), "material": material })
}

/// OpenGL's number of a wrapping, as glTF uses it.
fn wrapping(wrapping: Wrapping) -> u32 {
    match wrapping {
        Wrapping::Repeat => 10497,
        Wrapping::MirroredRepeat => 33648,
        Wrapping::ClampToEdge => 33071,
    }
}
