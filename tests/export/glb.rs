//! The GLB: its physics by `KHR_physics_rigid_bodies`, and its Gaussians.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use gprop::export::{Format, GlbLook, Model, Origin, export};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{Rigid, numbers, valid_glbs};
use crate::grasp::scenes::Measured;

const PHYSICS: &str = "KHR_physics_rigid_bodies";

fn json_of(glb: &Path) -> Value {
    let bytes = fs::read(glb).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&bytes[20..20 + length]).unwrap()
}

/// The GLB of [`Measured::small`] with this look and the centre of mass as its origin.
fn written(glb_look: GlbLook) -> (TempDir, PathBuf) {
    let out = TempDir::new().unwrap();
    let model = Model { glb_look, origin: Origin::Com, ..super::model(Measured::small()) };
    let files = export(&model, &[Format::Glb], out.path()).unwrap();
    (out, files[0].clone())
}

/// The node that moves, and the indices of its children.
fn body(glb: &Value) -> (&Value, Vec<usize>) {
    let root = glb["scenes"][0]["nodes"][0].as_u64().unwrap() as usize;
    let children = glb["nodes"][root]["children"].as_array().unwrap();
    (&glb["nodes"][root], children.iter().map(|child| child.as_u64().unwrap() as usize).collect())
}

#[test]
fn the_glb_moves_as_the_body_that_was_weighed() {
    let rigid = Rigid::small();
    let (object, glb) = (rigid.object(), json_of(rigid.file(".glb")));
    let (root, children) = body(&glb);
    let motion = &root["extensions"][PHYSICS]["motion"];
    assert_eq!(motion["mass"], object.mass_kg.mid);
    assert_eq!(numbers(&motion["centerOfMass"]), object.center_of_mass_m);
    let [x, y, z, w] = numbers(&motion["inertiaOrientation"]).try_into().unwrap();
    let axes = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
    let moments = Matrix3::from_diagonal(&Vector3::from_vec(numbers(&motion["inertiaDiagonal"])));
    let inertia = axes.matrix() * moments * axes.matrix().transpose();
    let expected = Matrix3::from_fn(|row, column| object.inertia_kg_m2[row][column]);
    assert!((inertia - expected).norm() < 1e-9 * expected.norm(), "{inertia} is not {expected}");
    // Each part is drawn and collides: as the hulls of meshes that are not drawn, with its friction.
    let drawn: BTreeSet<u64> =
        glb["nodes"].as_array().unwrap().iter().filter_map(|node| node["mesh"].as_u64()).collect();
    let (mut parts, mut frictions) = (0, BTreeSet::new());
    for node in children.iter().map(|child| &glb["nodes"][*child]) {
        let collider = &node["extensions"][PHYSICS]["collider"];
        if collider.is_null() {
            parts += 1;
            continue;
        }
        assert_eq!(collider["geometry"]["convexHull"], true);
        assert!(!drawn.contains(&collider["geometry"]["mesh"].as_u64().unwrap()), "{node}");
        let material = collider["physicsMaterial"].as_u64().unwrap() as usize;
        let material = &glb["extensions"][PHYSICS]["physicsMaterials"][material];
        assert_eq!(material["staticFriction"], material["dynamicFriction"]);
        assert!(material["restitution"].as_f64().is_some_and(|restitution| restitution > 0.0), "{material}");
        frictions.insert(material["staticFriction"].to_string());
    }
    let labels = &rigid.measured.field.parts;
    assert_eq!(parts, labels.len());
    assert_eq!(frictions, labels.iter().map(|label| json!(label.friction_rubber.mid).to_string()).collect());
    let report = crate::audit::report(&[rigid.file(".glb")], &[]).unwrap();
    assert!(report.require_sound().is_ok(), "{}", report.text());
    valid_glbs("the_glb_moves_as_the_body_that_was_weighed", &[rigid.file(".glb"), rigid.file("_colliders.glb")]);
}

#[test]
fn the_gaussians_move_with_the_body() {
    let measured = Measured::small();
    for (look, meshes) in [(GlbLook::Splat, 0), (GlbLook::Both, measured.field.parts.len())] {
        let (_out, file) = written(look);
        let glb = json_of(&file);
        assert_eq!(glb["extensionsUsed"], json!(["KHR_gaussian_splatting", PHYSICS]));
        let (root, children) = body(&glb);
        let center = numbers(&root["extensions"][PHYSICS]["motion"]["centerOfMass"]);
        assert!(center.iter().all(|c| c.abs() < 1e-12), "{center:?}");
        let nodes: Vec<&Value> = children.iter().map(|child| &glb["nodes"][*child]).collect();
        assert_eq!(nodes.iter().filter(|node| node["mesh"].is_u64()).count(), meshes + 1);
        let splat = nodes.iter().find(|node| node["name"] == "splat").unwrap();
        let primitive = &glb["meshes"][splat["mesh"].as_u64().unwrap() as usize]["primitives"][0];
        let count = &glb["accessors"][primitive["attributes"]["POSITION"].as_u64().unwrap() as usize]["count"];
        assert_eq!(*count, measured.scene.gaussians.len());
        valid_glbs("the_gaussians_move_with_the_body", &[&file]);
    }
}
