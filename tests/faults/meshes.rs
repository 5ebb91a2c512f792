//! Meshes that nobody should try to weigh: one clear error, and nothing is written.

use std::fs;

use super::assert_refused;
use super::bombs::png_that_claims;
use crate::batch::contents;
use crate::run::gprop;

const CORNER: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
const FACES: &str = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

#[test]
fn a_broken_mesh_gets_one_error_and_nothing_is_written() {
    let with_texture = "newmtl a\nmap_Kd bomb.png\n";
    let gltf = |nodes: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":{nodes},"meshes":[{{"primitives":[]}}]}}"#
        )
    };
    let stl = |corner: &str| {
        format!(
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex {corner}\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n"
        )
    };
    let cases = [
        ("points.obj", CORNER.to_owned(), "has no triangles"),
        ("empty.glb", String::new(), "is not glTF"),
        ("nothing.gltf", gltf(r#"[{"mesh":0}]"#), "has no triangles"),
        ("endless.gltf", gltf(r#"[{"mesh":0,"children":[0]}]"#), "reached twice"),
        ("nan.obj", format!("{CORNER}v nan 0 0\n{FACES}"), "not a finite number"),
        ("infinite.stl", stl("1e999 0 0"), "not a finite number"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n".to_owned(), "no area"),
        ("range.obj", format!("{CORNER}f 1 2 9\n"), "index 9 is out of range"),
        ("bomb.obj", format!("mtllib bomb.mtl\n{CORNER}vt 0 0\nusemtl a\nf 1/1 3/1 2/1\n"), "60000 x 60000 pixels"),
        ("outside.obj", format!("mtllib ../../../../etc/passwd\n{CORNER}{FACES}"), "outside"),
        (
            "cloud.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                       element face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
                .to_owned(),
            "is a file but not a mesh",
        ),
    ];
    for (name, text, expected) in cases {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        fs::write(folder.path().join("bomb.mtl"), with_texture).unwrap();
        fs::write(folder.path().join("bomb.png"), png_that_claims(60_000, 60_000)).unwrap();
        let before = contents(folder.path());
        for command in [&["run"][..], &["export", "--out", "filled"]] {
            let output = gprop().args(command).arg(&path).current_dir(folder.path()).output().unwrap();
            println!("{name}");
            assert_refused(&output, 3, &[expected]);
            assert!(contents(folder.path()) == before, "{name}: something was written");
        }
    }
}

#[test]
fn commands_about_one_object_say_where_the_links_of_a_robot_are() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("robot.urdf"), "<robot name=\"r\"/>").unwrap();
    for command in [&["query", "--export", "q"][..], &["answer"], &["inspect"], &["segment"], &["parts"]] {
        let output = gprop().args(command).arg("robot.urdf").current_dir(folder.path()).output().unwrap();
        assert_refused(&output, 3, &["`gprop run robot.urdf --to consensus`", "robot.gprop/links"]);
    }
}
