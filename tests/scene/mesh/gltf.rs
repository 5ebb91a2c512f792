//! GLB and glTF: nodes, instances, accessors, compression, textures.

use std::fs;

use gprop::files::read_scope::ReadScope;
use gprop::scene::mesh::{self, Alpha, Axes};
use serde_json::{Value, json};

use super::{parse, read, six_volumes, survives_damage};

/// The corners of a tetrahedron with a right angle of unit sides at the origin: its volume is 1/6.
const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const FACES: [[u16; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

/// A document with the tetrahedron as mesh 0, accessor 0 its positions, accessor 1 its indices, and its buffer.
fn tetrahedron() -> (Value, Vec<u8>) {
    let mut bytes: Vec<u8> = CORNERS.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend(FACES.as_flattened().iter().flat_map(|value| value.to_le_bytes()));
    let document = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "Ceramic_Mug"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "buffers": [{"byteLength": bytes.len()}],
    });
    (document, bytes)
}

fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, binary) = (padded(document.to_string().as_bytes(), b' '), padded(binary, 0));
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

/// Adds bytes as a buffer view, and says which it is.
fn add_view(document: &mut Value, bytes: &mut Vec<u8>, added: &[u8]) -> usize {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let views = document["bufferViews"].as_array_mut().unwrap();
    views.push(json!({"buffer": 0, "byteOffset": bytes.len(), "byteLength": added.len()}));
    bytes.extend(added);
    document["buffers"][0]["byteLength"] = json!(bytes.len());
    document["bufferViews"].as_array().unwrap().len() - 1
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    let picture = image::RgbaImage::from_fn(width, height, |x, y| image::Rgba([x as u8, y as u8, 0, 255]));
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

#[test]
fn nodes_place_their_meshes_and_mirrors_keep_the_outside_out() {
    let (mut document, bytes) = tetrahedron();
    document["scenes"][0]["nodes"] = json!([0, 2]);
    document["nodes"] = json!([
        {"children": [1], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        // A quarter turn about z and a mirror: x to y, y to x.
        {"mesh": 0, "rotation": [0, 0, 0.5_f64.sqrt(), 0.5_f64.sqrt()], "scale": [1, -1, 1]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 7, 1]},
        {"mesh": 0, "translation": [99, 0, 0], "name": "of no scene"},
    ]);
    let mesh = parse("a.glb", &glb(&document, &bytes)).unwrap();
    assert_eq!((mesh.surface.triangles.len(), mesh.shapes), (8, 2));
    let close = |index: usize, expected: [f64; 3]| {
        let found = mesh.surface.vertices[index];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{index}: {found:?} {expected:?}");
    };
    close(1, [10.0, 2.0, 0.0]);
    close(2, [12.0, 0.0, 0.0]);
    close(7, [0.0, 0.0, 8.0]);
    assert!((six_volumes(&mesh) - 9.0).abs() < 1e-5, "{}", six_volumes(&mesh));
    assert_eq!(mesh.faces.iter().map(|face| face.shape).collect::<Vec<_>>(), [0, 0, 0, 0, 1, 1, 1, 1]);
    assert_eq!(mesh.meters_per_unit, Some(1.0));
}

#[test]
fn y_up_becomes_z_up() {
    let (document, bytes) = tetrahedron();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    fs::write(&path, glb(&document, &bytes)).unwrap();
    let mesh = mesh::read(&path, Axes::ZUp, &ReadScope::new(folder.path())).unwrap();
    assert_eq!(mesh.surface.vertices[2], [0.0, 0.0, 1.0]);
    assert_eq!(mesh.surface.vertices[3], [0.0, -1.0, 0.0]);
    assert!((six_volumes(&mesh) - 1.0).abs() < 1e-12);
    assert_eq!(read(&path).unwrap().surface.vertices[2], [0.0, 1.0, 0.0]);
    assert_eq!(mesh.names.shapes, ["Ceramic_Mug"]);
}

#[test]
fn instances_are_placed_one_by_one() {
    let (mut document, mut bytes) = tetrahedron();
    let moved = add_view(&mut document, &mut bytes, &floats(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]));
    let scaled = add_view(&mut document, &mut bytes, &floats(&[1.0, 1.0, 1.0, -1.0, 1.0, 1.0]));
    let accessors = document["accessors"].as_array_mut().unwrap();
    for view in [moved, scaled] {
        accessors.push(json!({"bufferView": view, "componentType": 5126, "count": 2, "type": "VEC3"}));
    }
    document["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2, "SCALE": 3}}});
    document["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let mesh = parse("a.glb", &glb(&document, &bytes)).unwrap();
    assert_eq!((mesh.shapes, mesh.surface.vertices[5]), (2, [4.0, 0.0, 0.0]));
    assert!((six_volumes(&mesh) - 2.0).abs() < 1e-12);
    assert!(mesh.warnings.is_empty(), "{:?}", mesh.warnings);
    document["accessors"][2]["count"] = json!(2_000_000);
    let error = parse("a.glb", &glb(&document, &bytes)).unwrap_err();
    assert!(error.contains("more than 1,000,000 instances"), "{error}");
}

#[test]
fn strips_fans_and_lists_without_indices_are_triangles() {
    for (mode, indices, expected) in [
        (5, json!(1), vec![[0, 2, 1], [1, 2, 0], [1, 0, 1]]),
        (6, json!(1), vec![[0, 2, 1], [0, 1, 0], [0, 0, 1]]),
        (4, Value::Null, vec![[0, 1, 2]]),
    ] {
        let (mut document, bytes) = tetrahedron();
        document["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        if indices.is_null() {
            document["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
        }
        let mesh = parse("a.glb", &glb(&document, &bytes)).unwrap();
        assert_eq!(mesh.surface.triangles[..expected.len()], expected);
    }
    let (mut document, bytes) = tetrahedron();
    document["meshes"][0]["primitives"][0]["mode"] = json!(1);
    assert!(parse("a.glb", &glb(&document, &bytes)).unwrap_err().starts_with("has no triangles"));
}

#[test]
fn quantised_and_sparse_accessors_are_read() {
    let (mut document, mut bytes) = tetrahedron();
    let short: Vec<u8> = CORNERS
        .iter()
        .flat_map(|corner| [corner[0], corner[1], corner[2], 0.0])
        .flat_map(|v| ((v * 32_767.0) as i16).to_le_bytes())
        .collect();
    let view = add_view(&mut document, &mut bytes, &short);
    document["bufferViews"][view]["byteStride"] = json!(8);
    document["accessors"][0] =
        json!({"bufferView": view, "componentType": 5122, "normalized": true, "count": 4, "type": "VEC3"});
    document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let mesh = parse("a.glb", &glb(&document, &bytes)).unwrap();
    assert_eq!(mesh.surface.vertices, CORNERS.map(|corner| corner.map(f64::from)));
    // The fourth corner is moved to (0, 0, 3).
    let index = add_view(&mut document, &mut bytes, &[3]);
    let value = add_view(&mut document, &mut bytes, &floats(&[0.0, 0.0, 3.0]));
    let mut sparse = json!({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"});
    sparse["sparse"] =
        json!({"count": 1, "indices": {"bufferView": index, "componentType": 5121}, "values": {"bufferView": value}});
    document["accessors"][0] = sparse;
    let mesh = parse("a.glb", &glb(&document, &bytes)).unwrap();
    assert_eq!(mesh.surface.vertices[2..], [[0.0, 1.0, 0.0], [0.0, 0.0, 3.0]]);
}

#[test]
fn buffers_and_pictures_lie_beside_the_file_or_in_it_and_nowhere_else() {
    let (mut document, bytes) = tetrahedron();
    let outside = tempfile::tempdir().unwrap();
    let folder = outside.path().join("mug");
    fs::create_dir(&folder).unwrap();
    let path = folder.join("a.gltf");
    let mut with_buffer = |uri: &str| {
        document["buffers"][0]["uri"] = json!(uri);
        fs::write(&path, document.to_string()).unwrap();
        read(&path)
    };
    use base64::Engine;
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    assert!(with_buffer(&format!("data:application/octet-stream;base64,{data}")).is_ok());
    assert!(with_buffer("data:application/octet-stream;base64,%%%").unwrap_err().contains("not base64"));
    fs::write(folder.join("a b.bin"), &bytes).unwrap();
    let mesh = with_buffer("a%20b.bin").unwrap();
    assert_eq!(mesh.files, [path.clone(), folder.join("a b.bin")]);
    fs::write(outside.path().join("secret.bin"), &bytes).unwrap();
    let error = with_buffer("../secret.bin").unwrap_err();
    assert!(error.contains("lies outside") && error.contains("--allow-read"), "{error}");
    assert!(mesh::read(&path, Axes::ZUp, &ReadScope::new(outside.path())).is_ok(), "the user allowed it");
    assert!(with_buffer("gone.bin").unwrap_err().contains("buffer `gone.bin`: cannot be read"));
    assert!(with_buffer("https://example.com/a.bin").unwrap_err().contains("fetches nothing"));
    fs::write(folder.join("short.bin"), &bytes[..50]).unwrap();
    assert!(with_buffer("short.bin").unwrap_err().contains("buffer 0 has 50 bytes"), "truncated");
}

#[test]
fn compressed_data_is_named_unless_the_file_has_it_plain_too() {
    let (mut document, bytes) = tetrahedron();
    let draco = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    document["meshes"][0]["primitives"][0]["extensions"] = draco;
    assert!(parse("a.glb", &glb(&document, &bytes)).is_ok(), "with plain accessors");
    document["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    let error = parse("a.glb", &glb(&document, &bytes)).unwrap_err();
    assert!(error.contains("mesh 0, primitive 0 is compressed with KHR_draco_mesh_compression"), "{error}");
    let (mut document, bytes) = tetrahedron();
    document["bufferViews"][0]["extensions"] = json!({"EXT_meshopt_compression": {"buffer": 0, "byteLength": 4}});
    assert!(parse("a.glb", &glb(&document, &bytes)).is_ok(), "with a fallback buffer that has bytes");
    document["bufferViews"][0]["buffer"] = json!(1);
    document["buffers"] = json!([{"byteLength": bytes.len()}, {"byteLength": 48}]);
    let error = parse("a.glb", &glb(&document, &bytes)).unwrap_err();
    assert!(error.contains("compressed with EXT_meshopt_compression"), "{error}");
}

#[test]
fn textures_are_placed_and_replaced_by_their_fallback() {
    let (mut document, mut bytes) = tetrahedron();
    let picture = add_view(&mut document, &mut bytes, &png(4, 2));
    let ktx = add_view(&mut document, &mut bytes, b"\xABKTX 20\xBB\r\n\x1A\n........");
    let coordinates = add_view(&mut document, &mut bytes, &floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]));
    let accessors = document["accessors"].as_array_mut().unwrap();
    accessors.push(json!({"bufferView": coordinates, "componentType": 5126, "count": 4, "type": "VEC2"}));
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(2);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    let transform = json!({"KHR_texture_transform": {"offset": [0.5, 0], "scale": [2, 3], "texCoord": 1}});
    document["materials"] = json!([{
        "name": "Leather_Black", "alphaMode": "MASK",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": {"index": 0, "extensions": transform}
        },
    }]);
    document["images"] = json!([
        {"bufferView": picture, "mimeType": "image/png"}, {"bufferView": ktx, "mimeType": "image/ktx2"},
    ]);
    document["textures"] = json!([{"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}}]);
    let mesh = parse("a.glb", &glb(&document, &bytes)).unwrap();
    let material = &mesh.materials[0];
    assert_eq!((material.base_color[0], material.alpha), (0.5, Alpha::CutBelow(0.5)));
    let picture = &mesh.pictures[material.texture.unwrap().picture as usize];
    assert_eq!(picture.decode().unwrap().dimensions(), (4, 2));
    // The first face has the corners 0, 2, 1.
    assert_eq!(mesh.faces[0].texture_coordinates, Some([[0.5, 0.0], [0.5, 3.0], [2.5, 0.0]]));
    assert_eq!(mesh.names.materials[0], "Leather_Black");
    assert!(mesh.warnings.is_empty(), "{:?}", mesh.warnings);
    document["textures"][0].as_object_mut().unwrap().remove("source");
    let mesh = parse("a.glb", &glb(&document, &bytes)).unwrap();
    assert_eq!(mesh.materials[0].texture, None);
    assert!(mesh.warnings[0].contains("KHR_texture_basisu") && mesh.warnings[0].contains("PNG"), "{:?}", mesh.warnings);
}

#[test]
fn broken_files_get_one_clear_error() {
    type Change = &'static dyn Fn(&mut Value, &mut Vec<u8>);
    let broken = |change: Change| {
        let (mut document, mut bytes) = tetrahedron();
        change(&mut document, &mut bytes);
        parse("a.glb", &glb(&document, &bytes)).unwrap_err()
    };
    let cases: [(Change, &str); 10] = [
        (
            &|_, b| b[48..50].fill(0xff),
            "mesh 0, primitive 0, indices: index 65535 is out of range, there are 4 vertices",
        ),
        (&|_, b| b[0..4].copy_from_slice(&f32::NAN.to_le_bytes()), "vertex 0: a position is not a finite number"),
        (&|d, _| d["accessors"][0]["count"] = json!(5), "goes beyond the end of its buffer view"),
        (&|d, _| d["bufferViews"][1]["byteLength"] = json!(1_u64 << 40), "buffer 0 has 72 bytes"),
        (&|d, _| d["nodes"] = json!([{"children": [1]}, {"children": [0]}]), "node 0 is reached twice"),
        (&|d, _| d["meshes"][0]["primitives"][0]["material"] = json!(3), "names material 3, which is not there"),
        (&|d, _| d["nodes"][0]["mesh"] = json!(9), "node 0 names mesh 9"),
        (&|d, _| d["scenes"][0]["nodes"] = json!([]), "has no triangles"),
        (&|d, _| d["accessors"][0]["componentType"] = json!(5130), "a type of number that glTF 2 does not have"),
        (&|d, _| d["asset"]["version"] = json!("1.0"), "is glTF 1.0"),
    ];
    for (change, expected) in cases {
        let error = broken(change);
        assert!(error.contains(expected), "{error}\nnot: {expected}");
    }
    let error = parse("a.gltf", b"{\"asset\": {\"version\": \"2.0\"},}").unwrap_err();
    assert!(error.contains("line 1 column"), "{error}");
}

#[test]
fn a_texture_bomb_is_refused_before_it_is_decoded() {
    let (mut document, mut bytes) = tetrahedron();
    let mut bomb = png(1, 1);
    bomb[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
    // The checksum of the header, which names 60,000 pixels a side.
    let sum = crc32(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&sum.to_be_bytes());
    let view = add_view(&mut document, &mut bytes, &bomb);
    document["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    document["images"] = json!([{"bufferView": view}]);
    document["textures"] = json!([{"source": 0}]);
    let error = parse("a.glb", &glb(&document, &bytes)).unwrap_err();
    assert!(error.contains("texture image 0: is 60000 x 60000 pixels"), "{error}");
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

#[test]
fn damage_anywhere_is_survived() {
    let (document, bytes) = tetrahedron();
    survives_damage("a.glb", &glb(&document, &bytes));
}
