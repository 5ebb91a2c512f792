//! The Gaussians as glTF with Khronos's extension `KHR_gaussian_splatting`: points with a rotation (x y z w), standard
//! deviations, an opacity from 0 to 1, and spherical harmonics, a colour for each coefficient. The numbers of their
//! parts are the attribute `_PART`; a plain viewer shows coloured points.

use serde_json::{Map, json};

use super::gltf::Gltf;
use super::placement::Placement;
use super::{ExportError, Files, Model, Splat, asset_extras, identifier};
use crate::gaussians::SH_C0;
use crate::vote::FieldPart;

const EXTENSION: &str = "KHR_gaussian_splatting";

/// In metres if the scale is known, in scene units otherwise.
pub(super) fn write(model: &Model, placement: &Placement, files: &mut Files) -> Result<(), ExportError> {
    let mut gltf = Gltf::default();
    let node = add_node(&mut gltf, model, placement);
    let (name, extras) = (identifier(model.name), asset_extras(model, placement));
    gltf.node_z_up(&name, &[node], &placement.place());
    files.write(format!("{name}_splat.glb"), |out| gltf.write(&extras, out))
}

/// Adds a node with the model's Gaussians.
pub(super) fn add_node(gltf: &mut Gltf, model: &Model, placement: &Placement) -> usize {
    let mesh = add(gltf, &model.splat(placement));
    let of_label =
        |label: &FieldPart| json!({ "part": label.id, "caption": label.caption, "material": label.material });
    let labels: Vec<_> = model.field.parts.iter().map(of_label).collect();
    gltf.node(json!({ "name": "splat", "mesh": mesh, "extras": { "parts": labels } }))
}

/// Adds the Gaussians as a mesh, and returns its index.
pub(super) fn add(gltf: &mut Gltf, splat: &Splat) -> usize {
    gltf.uses(EXTENSION);
    let Splat { gaussians, meters_per_unit: meters, origin, field } = *splat;
    let all = || 0..gaussians.len();
    let mut attributes = Map::new();
    let positions: Vec<[f32; 3]> =
        all().map(|i| (gaussians.center(i) * meters - origin).map(|c| c as f32).into()).collect();
    attributes.insert("POSITION".to_owned(), json!(gltf.floats(&positions, true)));
    let byte = |dc: f32| ((0.5 + SH_C0 * dc).clamp(0.0, 1.0) * 255.0).round() as u8;
    let colors: Vec<[u8; 3]> = gaussians.sh_dc.iter().map(|dc| dc.map(byte)).collect();
    attributes.insert("COLOR_0".to_owned(), json!(gltf.colors(&colors, |i| gaussians.opacity(i))));
    let rotations: Vec<[f32; 4]> =
        all().map(|i| gaussians.rotation(i)).map(|q| [q.i, q.j, q.k, q.w].map(|v| v as f32)).collect();
    let scales: Vec<[f32; 3]> = all().map(|i| gaussians.scale(i).map(|s| (s * meters) as f32).into()).collect();
    let opacities: Vec<[f32; 1]> = all().map(|i| [gaussians.opacity(i) as f32]).collect();
    attributes.insert(format!("{EXTENSION}:ROTATION"), json!(gltf.floats(&rotations, false)));
    attributes.insert(format!("{EXTENSION}:SCALE"), json!(gltf.floats(&scales, false)));
    attributes.insert(format!("{EXTENSION}:OPACITY"), json!(gltf.floats(&opacities, false)));
    if let Some(field) = field {
        let parts: Vec<[f32; 1]> = field.part_ids().map(|id| [id as f32]).collect();
        attributes.insert("_PART".to_owned(), json!(gltf.floats(&parts, false)));
    }
    attributes.insert(format!("{EXTENSION}:SH_DEGREE_0_COEF_0"), json!(gltf.floats(&gaussians.sh_dc, false)));
    let count = gaussians.sh_rest_per_channel();
    let mut first = 0;
    for degree in 1..=usize::from(gaussians.sh_degree) {
        for n in 0..2 * degree + 1 {
            let coefficients_of =
                |i: usize| [0, 1, 2].map(|channel| gaussians.sh_rest_of(i)[channel * count + first + n]);
            let values: Vec<[f32; 3]> = all().map(coefficients_of).collect();
            attributes.insert(format!("{EXTENSION}:SH_DEGREE_{degree}_COEF_{n}"), json!(gltf.floats(&values, false)));
        }
        first += 2 * degree + 1;
    }
    gltf.meshes.push(json!({ "primitives": [{
        "mode": 0,
        "attributes": attributes,
        "extensions": { EXTENSION: {
            "kernel": "ellipse",
            "colorSpace": "srgb_rec709_display",
            "projection": "perspective",
        } },
    }] }));
    gltf.meshes.len() - 1
}
