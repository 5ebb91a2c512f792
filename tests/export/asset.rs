//! The mesh itself again: what a file keeps, what it gains, and that its physics are those of closed forms.

use std::fs;
use std::path::{Path, PathBuf};

use gprop::export::{Asset, Colliders, ExportError, Format, GlbLook, Links, Model, Origin, export};
use gprop::files::read_scope::ReadScope;
use gprop::materials::MaterialLibrary;
use gprop::parts::{Options, PartsResult, parts_of_mesh};
use gprop::scene::mesh::containers::{self, Container};
use gprop::scene::mesh::solid::Measured;
use gprop::scene::mesh::{self, Axes, Mesh};
use gprop::scene::{self, Scene};
use gprop::vote::{FieldPart, MaterialField};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{listed, mujoco, python};
use crate::scene::shapes::cuboid;
use crate::support::python_has;

/// Sides of the box along x, y (up) and z, m.
const SIDES: [f64; 3] = [0.1, 0.2, 0.06];
/// Where the box's middle lies in its own mesh, m.
const MIDDLE: [f64; 3] = [0.3, 0.1, 0.0];

/// A GLB with a box, whose JSON is `text`, with LENGTH for the bytes of its buffer. Eight positions and 36 indices.
fn glb(text: &str) -> Vec<u8> {
    let low = [0, 1, 2].map(|axis| MIDDLE[axis] - 0.5 * SIDES[axis]);
    let high = [0, 1, 2].map(|axis| MIDDLE[axis] + 0.5 * SIDES[axis]);
    let surface = cuboid(low, high);
    assert_eq!((surface.vertices.len(), surface.triangles.len()), (8, 12));
    let mut binary: Vec<u8> = surface.vertices.as_flattened().iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
    binary.extend(surface.triangles.as_flattened().iter().flat_map(|index| (*index as u16).to_le_bytes()));
    let mut text = text.replace("LENGTH", &binary.len().to_string()).into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + text.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

/// A document with these nodes, in an order and with numbers that no serialiser writes.
fn document(nodes: &str, scene: &str) -> String {
    format!(
        r#"{{
  "scenes" : [ {{ "nodes": {scene}, "name":"é" }} ],
  "asset": {{"version":"2.0", "generator": "by hand"}},
  "nodes": {nodes},
  "meshes": [{{"primitives": [{{"indices": 1, "attributes": {{"POSITION": 0}}, "material" : 0}}]}}],
  "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [0.50, 1e-1, 0.250, 1.0]}}}}],
  "accessors": [
    {{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0.25,0.0,-0.03], "max": [0.35,0.2,0.03]}},
    {{"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}}
  ],
  "bufferViews": [{{"buffer": 0, "byteLength": 96}}, {{"buffer": 0, "byteOffset": 96, "byteLength": 72}}],
  "buffers": [{{"byteLength": LENGTH}}]
}}"#
    )
}

/// One node with the mesh.
fn plain() -> String {
    document(r#"[ { "mesh": 0, "name": "A box" } ]"#, "[0]")
}

/// A mesh that has been weighed: every part of it is oak.
struct Weighed {
    folder: TempDir,
    scene: Scene,
    field: MaterialField,
    result: PartsResult,
}

impl Weighed {
    fn of(name: &str, bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        Self::at(folder, &path, &scene::Options::default())
    }

    fn at(folder: TempDir, path: &Path, options: &scene::Options) -> Self {
        let scene = scene::load(path, options).unwrap();
        let oak = MaterialLibrary::builtin().get("oak, white").unwrap();
        let field = MaterialField::known(vec![FieldPart::of(1, oak)], vec![0; scene.gaussians.len()]);
        let solid = Measured::of(&scene.mesh.as_ref().unwrap().painted.mesh.surface).unwrap();
        let options = Options { volume_cells: 20_000, ..Options::default() };
        let result = parts_of_mesh(&scene.gaussians, &field, &solid, scene.scale.as_ref(), &options).unwrap();
        Self { folder, scene, field, result }
    }

    fn export(&self, format: Format, colliders: Colliders) -> Result<Vec<PathBuf>, ExportError> {
        let mesh = self.scene.mesh.as_ref().unwrap();
        let model = Model {
            name: &self.scene.name,
            gaussians: &self.scene.gaussians,
            as_read: &self.scene.gaussians,
            world_from_input: UnitQuaternion::identity(),
            field: &self.field,
            interior: &self.result.interior,
            scale: self.scene.scale.as_ref(),
            parts: Some(self.result.metric().unwrap()),
            support: None,
            cameras: &[],
            samples: &[],
            grasps: &[],
            on_steel: None,
            origin: Origin::Input,
            at: Vector3::zeros(),
            floating: false,
            glb_look: GlbLook::Meshes,
            mjcf_splats: false,
            links: Links::One,
            deformable: false,
            pad_geoms: &[],
            credits: &super::CREDITS,
            source: "box.glb",
            answered_by: &[],
            inputs: &self.scene.files,
            asset: Some(Asset { mesh, colliders }),
        };
        export(&model, &[format], &self.out())
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    fn mass_kg(&self) -> f64 {
        self.result.metric().unwrap().object.mass_kg.mid
    }

    /// The file that was written, as a container and as its JSON.
    fn filled(&self, colliders: Colliders) -> (Container, Value, Vec<u8>) {
        let files = self.export(Format::Asset, colliders).unwrap();
        let bytes = fs::read(&files[0]).unwrap();
        let container = containers::read(&files[0], &ReadScope::new(&self.out())).unwrap();
        let json = serde_json::from_slice(json_of(&bytes)).unwrap();
        (container, json, bytes)
    }
}

fn json_of(glb: &[u8]) -> &[u8] {
    &glb[20..20 + u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize]
}

fn binary_of(glb: &[u8]) -> &[u8] {
    &glb[28 + json_of(glb).len()..]
}

/// Mass, centre and inertia of the only body are those of the box, whose middle is at `center` in the body's frame.
#[track_caller]
fn assert_is_box(container: &Container, mass_kg: f64, center: [f64; 3], sides: [f64; 3]) {
    let [body] = container.bodies.as_slice() else { panic!("{} bodies", container.bodies.len()) };
    let inertial = body.inertial.as_ref().unwrap();
    assert!((inertial.mass_kg.unwrap() / mass_kg - 1.0).abs() < 1e-9);
    let off = inertial.center_m() - Vector3::from(center);
    // A hundredth of the width of a cell: 20,000 cells approximate the centre.
    assert!(off.norm() < 5e-5, "{:?} is not {center:?}", inertial.center_m());
    let squares = Vector3::from(sides.map(|side| side * side / 12.0));
    let expected = Matrix3::from_diagonal(&(Vector3::repeat(squares.sum()) - squares)) * mass_kg;
    let found = inertial.inertia_in_body().unwrap();
    // Cells approximate the inertia.
    assert!((found - expected).norm() < 0.02 * expected.norm(), "{found} is not {expected}");
}

fn mesh_of(path: &Path) -> Mesh {
    mesh::read(path, Axes::OfFile, &ReadScope::new(path.parent().unwrap())).unwrap()
}

#[test]
fn a_glb_gains_its_physics_and_keeps_every_other_byte() {
    let before = glb(&plain());
    let weighed = Weighed::of("box.glb", &before);
    let (container, json, after) = weighed.filled(Colliders::Keep);
    assert_is_box(&container, weighed.mass_kg(), MIDDLE, SIDES);
    let volume: f64 = SIDES.iter().product();
    let density = MaterialLibrary::builtin().get("oak, white").unwrap().density_kg_m3.mid();
    assert!((weighed.mass_kg() / (volume * density) - 1.0).abs() < 1e-3);
    // What is taken out again leaves what was there, order and numbers included.
    let text = std::str::from_utf8(json_of(&after)).unwrap();
    for kept in [
        "\"é\" } ],\n  \"asset\": {\"version\":\"2.0\", \"generator\": \"by hand\"}",
        "[0.50, 1e-1, 0.250, 1.0]",
        "\"material\" : 0}",
    ] {
        assert!(text.contains(kept), "{kept} is not in {text}");
    }
    let mut without = json.clone();
    let node = without["nodes"][0].as_object_mut().unwrap();
    let motion = node["extensions"]["KHR_physics_rigid_bodies"]["motion"].clone();
    assert_eq!(motion["mass"], weighed.mass_kg());
    let found = node["extras"]["gprop"].clone();
    assert_eq!(found["mass_kg"]["mid"], weighed.mass_kg());
    assert_eq!(found["materials"], json!(["oak, white"]));
    assert!(["extensions", "extras"].iter().all(|key| node.shift_remove(*key).is_some()));
    without.as_object_mut().unwrap().shift_remove("extensionsUsed").unwrap();
    let attributes = without["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap();
    assert_eq!(attributes.shift_remove("_MATERIAL").unwrap(), 2);
    for list in ["accessors", "bufferViews"] {
        without[list].as_array_mut().unwrap().truncate(2);
    }
    without["buffers"][0]["byteLength"] = json!(168);
    assert_eq!(without, serde_json::from_slice::<Value>(json_of(&before)).unwrap());
    assert_eq!(&binary_of(&after)[..168], binary_of(&before));
    // Eight vertices of the first material.
    let accessor = &json["accessors"][2];
    assert_eq!((&accessor["count"], &accessor["componentType"]), (&json!(8), &json!(5123)));
    assert_eq!(binary_of(&after)[168..], [0; 32]);
    // It says now what it weighs, and is the same mesh.
    let again = mesh_of(&weighed.out().join("box.glb"));
    assert_eq!(again.claimed_mass_kg, Some(weighed.mass_kg()));
    assert_eq!(again.surface, mesh_of(&weighed.folder.path().join("box.glb")).surface);
}

#[test]
fn the_centre_is_in_the_frame_of_the_node_that_moves() {
    // A quarter turn about x, then a shift.
    let half = 0.5_f64.sqrt();
    let root = format!(r#"[{{"mesh": 0, "rotation": [{half}, 0, 0, {half}], "translation": [1, 2, 3]}}]"#);
    let weighed = Weighed::of("box.glb", &glb(&document(&root, "[0]")));
    let (container, json, _) = weighed.filled(Colliders::Keep);
    assert_is_box(&container, weighed.mass_kg(), MIDDLE, SIDES);
    assert_eq!(json["nodes"].as_array().unwrap().len(), 1);
    // A node with a scale cannot be a body; one above it is, and everything is twice as large.
    let scaled = r#"[{"mesh": 0, "scale": [2, 2, 2]}]"#;
    let weighed = Weighed::of("box.glb", &glb(&document(scaled, "[0]")));
    let (container, json, _) = weighed.filled(Colliders::Keep);
    assert_is_box(&container, weighed.mass_kg(), MIDDLE.map(|x| 2.0 * x), SIDES.map(|x| 2.0 * x));
    assert_eq!(json["nodes"][1]["children"], json!([0]));
    assert_eq!(json["scenes"][0]["nodes"], json!([1]));
    // Two halves of one body.
    let two = r#"[{"mesh": 0}, {"mesh": 0, "translation": [0, 0.2, 0]}]"#;
    let weighed = Weighed::of("box.glb", &glb(&document(two, "[0, 1]")));
    let (container, json, _) = weighed.filled(Colliders::Keep);
    let [x, y, z] = SIDES;
    assert_is_box(&container, weighed.mass_kg(), [0.3, 0.2, 0.0], [x, 2.0 * y, z]);
    assert_eq!(json["nodes"][2]["children"], json!([0, 1]));
}

#[test]
fn a_body_that_is_stated_is_stated_anew_and_several_are_refused() {
    let body = |mass: f64| {
        format!(
            r#""extensions": {{"KHR_physics_rigid_bodies": {{"motion": {{"mass": {mass}, "linearVelocity": [1,0,0]}}}}}}"#
        )
    };
    let one = format!(r#"[{{"children": [1], {}}}, {{"mesh": 0, "translation": [0, 5, 0]}}]"#, body(0.05));
    let weighed = Weighed::of("box.glb", &glb(&document(&one, "[0]")));
    assert_eq!(weighed.scene.mesh.as_ref().unwrap().painted.mesh.claimed_mass_kg, Some(0.05));
    let (container, json, _) = weighed.filled(Colliders::Keep);
    assert_is_box(&container, weighed.mass_kg(), [MIDDLE[0], MIDDLE[1] + 5.0, MIDDLE[2]], SIDES);
    let motion = &json["nodes"][0]["extensions"]["KHR_physics_rigid_bodies"]["motion"];
    assert_eq!(motion["linearVelocity"], json!([1, 0, 0]));
    assert_eq!(json["nodes"][0]["extras"]["gprop"]["claimed_mass_kg"], 0.05);
    let two = format!(r#"[{{"mesh": 0, {}}}, {{"mesh": 0, "translation": [0, 5, 0], {}}}]"#, body(1.0), body(2.0));
    let weighed = Weighed::of("box.glb", &glb(&document(&two, "[0, 1]")));
    assert_eq!(weighed.scene.mesh.as_ref().unwrap().painted.mesh.claimed_mass_kg, Some(3.0));
    let error = weighed.export(Format::Asset, Colliders::Keep).unwrap_err();
    assert!(matches!(error, ExportError::Bodies { count: 2 }), "{error}");
    assert!(!weighed.out().exists());
}

#[test]
fn colliders_are_kept_added_or_made() {
    let count = |container: &Container| container.bodies[0].shapes.iter().filter(|shape| shape.role.collides()).count();
    let frictions = |container: &Container| -> Vec<f64> {
        let shapes = container.bodies[0].shapes.iter();
        shapes.filter_map(|shape| Some(shape.friction.as_ref()?.coefficient)).collect()
    };
    let oak = MaterialLibrary::builtin().get("oak, white").unwrap().friction_rubber.mid();
    let bare = Weighed::of("box.glb", &glb(&plain()));
    assert_eq!(count(&bare.filled(Colliders::Keep).0), 0);
    let (added, json, _) = bare.filled(Colliders::Add);
    assert_eq!((count(&added), frictions(&added)), (1, vec![oak]));
    // The hull is not seen: no node draws its mesh.
    assert_eq!(json["nodes"][0]["children"], json!([1]));
    assert!(json["nodes"][1].get("mesh").is_none());
    let collider = &json["nodes"][1]["extensions"]["KHR_physics_rigid_bodies"]["collider"];
    assert_eq!(collider["geometry"], json!({ "mesh": 1, "convexHull": true }));
    assert_eq!(mesh_of(&bare.out().join("box.glb")).surface.triangles.len(), 12);
    let own = r#"[{"mesh": 0, "extensions": {"KHR_physics_rigid_bodies": {"collider": {"geometry": {"node": 0, "convexHull": true}}}}}]"#;
    let own = Weighed::of("box.glb", &glb(&document(own, "[0]")));
    for kept in [Colliders::Keep, Colliders::Add] {
        let (kept, json, _) = own.filled(kept);
        assert_eq!((count(&kept), frictions(&kept)), (1, vec![oak]));
        assert_eq!(json["nodes"].as_array().unwrap().len(), 1);
    }
    let (made, json, _) = own.filled(Colliders::Make);
    assert_eq!((count(&made), frictions(&made)), (1, vec![oak]));
    assert!(json["nodes"][0]["extensions"]["KHR_physics_rigid_bodies"].get("collider").is_none());
    // The audit finds nothing to complain of in what was filled in.
    let report = crate::audit::report(&[&own.out().join("box.glb")], &[]).unwrap();
    assert!(report.require_sound().is_ok(), "{}", report.text());
}

#[test]
fn a_gltf_keeps_its_files_beside_it() {
    let whole = glb(&plain());
    let folder = tempfile::tempdir().unwrap();
    let text = String::from_utf8(json_of(&whole).to_vec()).unwrap();
    let text = text.replace("\"byteLength\": 168}]\n", "\"byteLength\": 168, \"uri\": \"data/box.bin\"}]\n");
    fs::create_dir(folder.path().join("data")).unwrap();
    fs::write(folder.path().join("data/box.bin"), binary_of(&whole)).unwrap();
    let path = folder.path().join("box.gltf");
    fs::write(&path, text).unwrap();
    let weighed = Weighed::at(folder, &path, &scene::Options::default());
    let files = weighed.export(Format::Asset, Colliders::Add).unwrap();
    assert_eq!(files, [weighed.out().join("box.gltf"), weighed.out().join("data/box.bin")]);
    assert_eq!(fs::read(&files[1]).unwrap(), binary_of(&whole));
    let container = containers::read(&files[0], &ReadScope::new(&weighed.out())).unwrap();
    assert_is_box(&container, weighed.mass_kg(), MIDDLE, SIDES);
    // Never over itself.
    let mesh = weighed.scene.mesh.as_ref().unwrap();
    assert_eq!(mesh.painted.mesh.files, [path.clone(), weighed.folder.path().join("data/box.bin")]);
}

/// A box in mm as an OBJ with its material, weighed and exported, and the text of the OBJ.
fn exported_obj() -> (Weighed, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("oak box.obj");
    let cube = cuboid([0.0; 3], [100.0, 200.0, 60.0]);
    let vertices: String = cube.vertices.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let faces: String = cube.triangles.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1)).collect();
    let text = format!("# mm\nmtllib box.mtl\n{vertices}{faces}");
    fs::write(&path, &text).unwrap();
    fs::write(folder.path().join("box.mtl"), "newmtl a\nKd 1 0 0\n").unwrap();
    let options = scene::Options { scale: "0.001".parse().unwrap(), ..scene::Options::default() };
    let weighed = Weighed::at(folder, &path, &options);
    weighed.export(Format::Asset, Colliders::Add).unwrap();
    (weighed, text)
}

/// What a simulator finds of the box: its mass, and where its centre is.
fn assert_is_oak_box(found: &Value, weighed: &Weighed) {
    println!("{found}");
    assert!((found["mass_kg"].as_f64().unwrap() / weighed.mass_kg() - 1.0).abs() < 1e-6, "{found}");
    let center: Vec<f64> = serde_json::from_value(found["center_of_mass_m"].clone()).unwrap();
    assert!((Vector3::from_column_slice(&center) - Vector3::new(0.05, 0.1, 0.03)).norm() < 5e-5, "{found}");
}

#[test]
fn mujoco_loads_what_comes_with_an_obj() {
    if !python_has("mujoco_loads_what_comes_with_an_obj", "mujoco", "mujoco") {
        return;
    }
    let (weighed, _) = exported_obj();
    let found = listed(mujoco("load", &[&weighed.out().join("oak_box.xml")])).remove(0);
    assert_is_oak_box(&found, &weighed);
    assert_eq!(found["free_joints"], 1);
}

#[test]
fn pybullet_loads_what_comes_with_an_obj() {
    if !python_has("pybullet_loads_what_comes_with_an_obj", "pybullet", "pybullet") {
        return;
    }
    let (weighed, _) = exported_obj();
    let found = python("pybullet_check.py", &[&weighed.out().join("oak_box.urdf")]).remove(0);
    let [link] = found["links"].as_array().unwrap().as_slice() else { panic!("{found}") };
    // 1/2 g t^2, and it falls freely.
    assert!((found["falls_m"].as_f64().unwrap() - 0.5 * 9.8 * 0.25).abs() < 0.02, "{found}");
    assert_is_oak_box(link, &weighed);
    // It shows the OBJ itself, in metres, and collides with convex parts of it.
    assert_eq!(link["shown"], json!([{ "file": "oak box.obj", "scale": [0.001, 0.001, 0.001] }]));
    assert!(link["colliders"].as_u64().unwrap() > 0, "{link}");
    let size: Vec<f64> = serde_json::from_value(link["collider_size_m"].clone()).unwrap();
    // Around the convex hull, PyBullet has a margin of several mm.
    assert!((Vector3::from_column_slice(&size) - Vector3::new(0.1, 0.2, 0.06)).amax() < 0.013, "{link}");
}

#[test]
fn other_meshes_come_with_a_urdf_an_mjcf_and_a_json() {
    let (weighed, text) = exported_obj();
    let out = weighed.out();
    assert_eq!(fs::read_to_string(out.join("oak box.obj")).unwrap(), text);
    assert!(out.join("box.mtl").is_file());
    for name in ["oak_box.urdf", "oak_box.xml"] {
        let container = containers::read(&out.join(name), &ReadScope::new(&out)).unwrap();
        assert!(container.problems.is_empty(), "{:?}", container.problems);
        let body = container.bodies.iter().find(|body| body.name == "oak_box").unwrap();
        let inertial = body.inertial.as_ref().unwrap();
        assert!((inertial.mass_kg.unwrap() / weighed.mass_kg() - 1.0).abs() < 1e-9, "{name}");
        assert!((inertial.center_m() - Vector3::new(0.05, 0.1, 0.03)).norm() < 5e-5, "{name}");
    }
    assert!(
        fs::read_to_string(out.join("oak_box.urdf"))
            .unwrap()
            .contains(r#"filename="oak box.obj" scale="0.001 0.001 0.001""#)
    );
    let json: Value = serde_json::from_slice(&fs::read(out.join("oak_box.json")).unwrap()).unwrap();
    // In the unit of the file.
    let center: Vec<f64> = serde_json::from_value(json["center_of_mass"].clone()).unwrap();
    assert!((Vector3::from_column_slice(&center) - Vector3::new(50.0, 100.0, 30.0)).norm() < 0.05, "{center:?}");
    assert_eq!(json["mass_kg"]["mid"], weighed.mass_kg());
}

#[test]
fn tables_have_a_row_for_each_face_and_vertex() {
    let weighed = Weighed::of("box.glb", &glb(&plain()));
    let files = weighed.export(Format::Csv, Colliders::Keep).unwrap();
    assert_eq!(files, ["box_faces.csv", "box_vertices.csv"].map(|name| weighed.out().join(name)));
    for (file, what, rows) in [(&files[0], "face", 12), (&files[1], "vertex", 8)] {
        let text = fs::read_to_string(file).unwrap();
        let mut lines = text.lines();
        let header = format!("{what},part_label,material_id,density,E,nu,yield_stress,friction,hardness,material");
        assert_eq!(lines.next(), Some(header.as_str()));
        assert_eq!(lines.clone().count(), rows);
        assert!(
            lines
                .enumerate()
                .all(|(n, line)| line.starts_with(&format!("{n},1,0,")) && line.ends_with(",\"oak, white\"")),
            "{text}"
        );
    }
}
