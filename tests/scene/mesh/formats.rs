//! OBJ with MTL, STL and PLY.

use std::fs;

use gprop::scene::mesh::{Alpha, Wrapping};

use super::{parse, read, six_volumes, survives_damage};

/// A cube of two metres a side in quads, seen from outside anticlockwise.
const CUBE: &str = "\
v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
f 4/1 3/2 2/3 1/4\nf 5/1 6/2 7/3 8/4\nf 1/1 2/2 6/3 5/4\nf 2/1 3/2 7/3 6/4\nf 3/1 4/2 8/3 7/4\nf 4/1 1/2 5/3 8/4\n";

#[test]
fn polygons_of_an_obj_are_cut_into_triangles() {
    let mesh = parse("a.obj", CUBE.as_bytes()).unwrap();
    assert_eq!((mesh.surface.vertices.len(), mesh.surface.triangles.len()), (8, 12));
    assert!((six_volumes(&mesh) - 48.0).abs() < 1e-12);
    assert_eq!(mesh.meters_per_unit, None);
    // OBJ counts v upwards, a Face downwards.
    assert_eq!(mesh.faces[0].texture_coordinates, Some([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]));
    let backwards = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 \\\n 0 0 0 255 # blue\nvn 0 0 1\nf -3//1 -2//-1 -1//1\n";
    let mesh = parse("a.obj", backwards.as_bytes()).unwrap();
    assert_eq!(mesh.surface.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.vertex_colors, [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]);
}

#[test]
fn materials_of_an_obj_come_from_its_mtl() {
    let outside = tempfile::tempdir().unwrap();
    let folder = outside.path().join("mug");
    fs::create_dir_all(folder.join("maps")).unwrap();
    image::RgbImage::new(2, 2).save(folder.join("maps/old wood.png")).unwrap();
    let mtl = "newmtl Wood\nKd 0 0 0\nmap_Kd -s 1 1 1 -clamp on maps\\old wood.png\nnewmtl Glass\nKd 0.5\nd 0.25\n";
    fs::write(folder.join("a.mtl"), mtl).unwrap();
    let path = folder.join("a.obj");
    let faces = "usemtl Wood\nf 1/1 2/1 3/1\no lid\nusemtl Glass\nf 1 2 3\nusemtl Gone\nf 3 2 1\n";
    let vertices = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    fs::write(&path, format!("{vertices}o body\n{faces}")).unwrap();
    let mesh = read(&path).unwrap();
    assert_eq!(mesh.faces.iter().map(|face| (face.material, face.shape)).collect::<Vec<_>>(), [(0, 0), (1, 1), (2, 1)]);
    assert_eq!((mesh.names.shapes, mesh.names.materials[2].as_str()), (vec!["body".into(), "lid".into()], "Gone"));
    let texture = mesh.materials[0].texture.unwrap();
    assert_eq!((texture.wrapping, mesh.materials[0].base_color), ([Wrapping::ClampToEdge; 2], [1.0; 4]));
    let glass = &mesh.materials[1];
    assert!((glass.base_color[0] - 0.214).abs() < 1e-3, "0.5 in sRGB: {:?}", glass.base_color);
    assert_eq!((glass.base_color[3], glass.alpha), (0.25, Alpha::Blend));
    assert!(mesh.warnings[0].contains("`usemtl Gone`"), "{:?}", mesh.warnings);

    image::RgbImage::new(2, 2).save(outside.path().join("secret.png")).unwrap();
    fs::write(folder.join("a.mtl"), "newmtl Wood\nmap_Kd ../secret.png\n").unwrap();
    assert!(read(&path).unwrap_err().contains("texture"), "outside");
    fs::write(folder.join("a.mtl"), "newmtl Wood\nmap_Kd gone.png\n").unwrap();
    assert!(read(&path).unwrap().warnings[0].contains("`gone.png` is not there"));
    fs::remove_file(folder.join("a.mtl")).unwrap();
    assert!(read(&path).unwrap().warnings[0].contains("`a.mtl` is not there"));
}

#[test]
fn wrong_lines_of_an_obj_are_named() {
    for (text, expected) in [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "line 4: index 9 is out of range, there are 3 vertices"),
        ("v 0 0 0\nf 1 1 0\n", "line 2: index 0 is out of range"),
        ("v 0 0 0\nf 1 1 -2\n", "line 2: index -2 is out of range"),
        ("v 0 0 0\nf 1 1/3 1\n", "line 2: index 3 is out of range, there are 0 texture coordinates"),
        ("v 0 0\n", "line 1: `v 0 0`: a vertex has three numbers"),
        ("v 0 nan 0\n", "line 1: a position is not a finite number"),
        ("v 0 0 0\nf 1 x 1\n", "line 2: `f 1 x 1`: a corner is written"),
        ("v 0 0 0\nf 1 1\n", "a face has at least three corners"),
        ("# nothing\n", "has no triangles"),
        ("", "has no triangles"),
    ] {
        let error = parse("a.obj", text.as_bytes()).unwrap_err();
        assert!(error.contains(expected), "{error}\nnot: {expected}");
    }
    survives_damage("a.obj", CUBE.as_bytes());
}

/// A tetrahedron of volume 1/6.
const TETRAHEDRON: [[[f32; 3]; 3]; 4] = {
    const O: [f32; 3] = [0.0, 0.0, 0.0];
    const X: [f32; 3] = [1.0, 0.0, 0.0];
    const Y: [f32; 3] = [0.0, 1.0, 0.0];
    const Z: [f32; 3] = [0.0, 0.0, 1.0];
    [[O, Y, X], [O, X, Z], [O, Z, Y], [X, Y, Z]]
};

fn binary_stl(header: &str) -> Vec<u8> {
    let mut file = header.as_bytes().to_vec();
    file.resize(80, b' ');
    file.extend((TETRAHEDRON.len() as u32).to_le_bytes());
    for triangle in TETRAHEDRON {
        file.extend([f32::NAN; 3].iter().chain(triangle.as_flattened()).flat_map(|value| value.to_le_bytes()));
        file.extend([0, 0]);
    }
    file
}

#[test]
fn both_kinds_of_stl_join_their_corners() {
    let facet = |corners: [[f32; 3]; 3]| {
        let vertex = |[x, y, z]: [f32; 3]| format!("  vertex {x} {y} {z:e}\r\n");
        format!(" facet normal nan 0 0\r\n outer loop\r\n{} endloop\n endfacet\n", corners.map(vertex).concat())
    };
    let [a, b, c, d] = TETRAHEDRON.map(facet);
    let text = format!("solid first part\n{a}{b}endsolid\nSOLID second\n{c}{d}endsolid second\n");
    let from_text = parse("a.stl", text.as_bytes()).unwrap();
    assert_eq!(from_text.names.shapes, ["first part", "second"]);
    for header in ["made by hand", "solid made by a CAD program"] {
        let mesh = parse("a.STL", &binary_stl(header)).unwrap();
        assert_eq!(mesh.surface, from_text.surface, "{header}");
        assert_eq!(mesh.surface.vertices.len(), 4);
        assert!((six_volumes(&mesh) - 1.0).abs() < 1e-12);
    }
    let binary = binary_stl("");
    let error = parse("a.stl", &binary[..150]).unwrap_err();
    assert!(error.contains("claims 4 triangles, for which it needs 284 bytes, but it has 150"), "{error}");
    assert!(parse("a.stl", b"solid a\nfacet\nouter loop\nvertex 1 2\n").unwrap_err().contains("line 4: `vertex 1 2`"));
    let cut = text.rfind("endloop").unwrap();
    assert!(parse("a.stl", &text.as_bytes()[..cut]).unwrap_err().contains("ends within a facet"));
    assert!(parse("a.stl", b"solid empty\nendsolid\n").unwrap_err().contains("has no triangles"));
    survives_damage("a.stl", &binary);
    survives_damage("a.stl", text.as_bytes());
}

const PLY_HEADER: &str = "\nelement vertex 4\nproperty float x\nproperty double y\nproperty float z\nproperty uchar red\n\
    property uchar green\nproperty uchar blue\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n";

fn ply(encoding: &str, bytes: impl Fn(&mut Vec<u8>, f64, usize)) -> Vec<u8> {
    let mut file = format!("ply\nformat {encoding} 1.0{PLY_HEADER}").into_bytes();
    for corner in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
        for (value, size) in corner.into_iter().zip([4, 8, 4]) {
            bytes(&mut file, value, size);
        }
        for color in [255.0, 0.0, 255.0] {
            bytes(&mut file, color, 1);
        }
    }
    for face in [&[0.0, 2.0, 1.0][..], &[0.0, 1.0, 3.0], &[0.0, 3.0, 2.0, 1.0]] {
        bytes(&mut file, face.len() as f64, 1);
        for index in face {
            bytes(&mut file, *index, 5);
        }
    }
    file
}

#[test]
fn ply_with_faces_is_read_in_every_encoding() {
    let text = ply("ascii", |file, value, _| file.extend(format!("{value} ").bytes()));
    let encode = |value: f64, size: usize| match size {
        1 => vec![value as u8],
        4 => (value as f32).to_le_bytes().to_vec(),
        5 => (value as i32).to_le_bytes().to_vec(),
        _ => value.to_le_bytes().to_vec(),
    };
    let little = ply("binary_little_endian", |file, value, size| file.extend(encode(value, size)));
    let big = ply("binary_big_endian", |file, value, size| file.extend(encode(value, size).iter().rev()));
    let mesh = parse("a.ply", &text).unwrap();
    assert_eq!(mesh.surface.triangles.len(), 4);
    assert_eq!(mesh.vertex_colors[0], [1.0, 0.0, 1.0, 1.0]);
    for other in [&little, &big] {
        assert_eq!(parse("a.ply", other).unwrap().surface, mesh.surface);
        survives_damage("a.ply", other);
    }
    let error = parse("a.ply", &little[..little.len() - 1]).unwrap_err();
    assert!(error.contains("element `face`, row 3 of 3: the file ends there"), "{error}");
    let claims = String::from_utf8_lossy(&text).replace("element face 3", "element face 4000000000");
    assert!(parse("a.ply", claims.as_bytes()).unwrap_err().contains("row 4 of 4000000000"));
    let splat = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n";
    assert!(parse("a.ply", splat.as_bytes()).unwrap_err().contains("has no faces"));
}

#[test]
fn formats_without_a_reader_are_named_with_a_way_out() {
    let error = read(std::path::Path::new("table.usdz")).unwrap_err();
    assert!(error.contains(".glb, .gltf, .obj, .stl, .ply") && error.contains("export GLB"), "{error}");
}
