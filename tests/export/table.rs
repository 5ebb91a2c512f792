//! All objects of a capture as one scene, in each format, loaded by the programs that it is for: the objects are at their places,
//! weigh what they weigh, and stand still.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::{listed, mujoco, newton, python, valid_glbs};
use crate::query::{a, completion, good_answer_about_part};
use crate::scene::objects::Table;
use crate::support::server::{MockServer, Request, Response};
use crate::support::{Shared, python_has};

/// Metres per scene unit.
const SCALE: f64 = 0.5;
/// How far the middles of brick and cup are apart along the table, in scene units: 0.3 - (-0.42) and -0.2 - (-0.02).
const APART: [f64; 2] = [0.72, 0.18];
const FORMATS: &str = "mjcf,urdf,usda,usdz,glb,gltf-splat,ply-parts";

/// A brick and a cup on a table, exported together.
struct Exported {
    table: Table,
    /// What the command printed.
    listed: String,
}

/// How far a program's bodies may be off.
struct Limits {
    /// Relative.
    mass: f64,
    moved_m: f64,
    turned_rad: f64,
}

impl Exported {
    fn get() -> &'static Self {
        static EXPORTED: Shared<Exported> = Shared::new();
        EXPORTED.of(Path::new("table"), || {
            let table = Table::new();
            let listed = export(&table, "exported");
            Self { table, listed }
        })
    }

    fn file(&self, name: &str) -> PathBuf {
        self.table.path().join("exported").join(name)
    }

    fn mass_kg(&self, object: &str) -> f64 {
        mass_kg(&self.table, object)
    }

    /// Both bodies weigh what `parts.json` says, are as far apart as in the capture, and stay there. Their undersides are flat:
    /// nothing tilts by more than what contacts give.
    fn assert_stand_still(&self, bodies: &[Value], limits: &Limits) {
        assert_eq!(bodies.len(), 2, "{bodies:?}");
        for (body, object) in bodies.iter().zip(["object_1", "object_2"]) {
            let number = |key: &str| body[key].as_f64().unwrap();
            assert!((number("mass_kg") / self.mass_kg(object) - 1.0).abs() < limits.mass, "{body}");
            assert!(number("moved_m") < limits.moved_m && number("turned_rad") < limits.turned_rad, "{body}");
        }
        let place = |n: usize, axis: usize| bodies[n]["place_m"][axis].as_f64().unwrap();
        let apart = (place(0, 0) - place(1, 0)).hypot(place(0, 1) - place(1, 1));
        assert!((apart - SCALE * APART[0].hypot(APART[1])).abs() < 0.01, "{apart}: {bodies:?}");
    }
}

/// Exports all objects into a folder of the capture, and returns what is printed.
fn export(table: &Table, out: &str) -> String {
    let labels = table.path().join("labels");
    if !labels.exists() {
        table.write_labels();
    }
    let server = MockServer::new(|_: &Request| {
        Response::new(200).json(completion(&good_answer_about_part(a("wood")).to_string()))
    });
    let (url, scale) = (format!("{}/v1", server.uri()), SCALE.to_string());
    let out = table.path().join(out);
    let what = ["export", "--object", "all", "--format", FORMATS, "--out", out.to_str().unwrap()];
    let coarse = ["--volume-cells", "20000", "--sheet-size", "256", "--scale", &scale];
    let asked = ["--segments", labels.to_str().unwrap(), "--lmm-url", &url, "--lmm-model", "test-model"];
    let (code, text, error) = table.run(&[&what[..], &coarse, &asked].concat());
    assert_eq!(code, Some(0), "{error}");
    text
}

fn mass_kg(table: &Table, object: &str) -> f64 {
    let path = table.path().join("gprop/objects").join(object).join("parts.json");
    let parts: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    parts["object"]["mass_kg"]["mid"].as_f64().unwrap()
}

#[test]
fn each_scene_is_listed_first_and_once_and_is_the_same_again() {
    let exported = Exported::get();
    let scenes = ["xml", "sdf", "usda", "usdz", "glb"].map(|ending| format!("scene.{ending}"));
    for scene in scenes.iter().map(String::as_str).chain([
        "scene_splat.glb",
        "scene_surroundings.ply",
        "scene_surroundings.usda",
    ]) {
        assert_eq!(exported.listed.lines().filter(|line| line.ends_with(&format!("/{scene}"))).count(), 1, "{scene}");
    }
    assert!(exported.listed.lines().next().unwrap().ends_with("scene.xml"), "{}", exported.listed);
    let again = export(&exported.table, "again");
    assert_eq!(again.lines().count(), exported.listed.lines().count());
    for line in exported.listed.lines() {
        let (_, file) = line.trim_start().split_once("  ").unwrap();
        let other = file.replace("/exported/", "/again/");
        assert!(std::fs::read(file).unwrap() == std::fs::read(other).unwrap(), "{file}");
    }
}

#[test]
fn one_summary_tells_of_all_objects() {
    let exported = Exported::get();
    assert!(exported.listed.lines().last().unwrap().ends_with("/asset.json"), "{}", exported.listed);
    let summary: Value = serde_json::from_slice(&std::fs::read(exported.file("asset.json")).unwrap()).unwrap();
    let objects = listed(summary["objects"].clone());
    assert_eq!(objects.len(), 2);
    for (object, name) in objects.iter().zip(["object_1", "object_2"]) {
        assert!(object["name"].as_str().unwrap().ends_with(name), "{object}");
        assert_eq!(object["mass_kg"]["mid"], exported.mass_kg(name));
    }
    let files = listed(summary["files"].clone());
    let scene = files.iter().find(|file| file["path"] == "scene.xml").unwrap();
    assert_eq!(
        (&scene["formats"], &scene["bytes"]),
        (&json!(["mjcf"]), &json!(exported.file("scene.xml").metadata().unwrap().len()))
    );
}

#[test]
fn mujoco_keeps_the_objects_where_they_stand() {
    if python_has("mujoco_keeps_the_objects_where_they_stand", "mujoco", "mujoco") {
        let exported = Exported::get();
        let found = mujoco("table", &[&exported.file("scene.xml")]);
        exported
            .assert_stand_still(&listed(found[0].clone()), &Limits { mass: 1e-3, moved_m: 0.001, turned_rad: 0.005 });
    }
}

#[test]
fn pybullet_keeps_the_objects_where_they_stand() {
    if python_has("pybullet_keeps_the_objects_where_they_stand", "pybullet", "pybullet") {
        let exported = Exported::get();
        let found = &python("pybullet_check.py", &[&exported.file("scene.sdf")])[0];
        assert_eq!(found["static"], 1, "{found}");
        // Bodies sink by the margin of their colliders, a millimetre.
        let limits = Limits { mass: 1e-6, moved_m: 0.002, turned_rad: 0.005 };
        exported.assert_stand_still(&listed(found["bodies"].clone()), &limits);
    }
}

#[test]
fn newton_keeps_the_objects_where_they_stand() {
    const PACKAGES: &str = "newton warp-lang newton-usd-schemas usd-core scipy";
    if !python_has("newton_keeps_the_objects_where_they_stand", PACKAGES, "newton, newton_usd_schemas, pxr, scipy") {
        return;
    }
    let exported = Exported::get();
    let found = newton(&[&exported.file("scene.usda"), Path::new("table")]);
    // Of the brick, the cup and the surroundings.
    assert_eq!(found["gaussians"], 3, "{found}");
    // The solver lets contacts sink a little, and computes in 32 bits.
    let limits = Limits { mass: 1e-6, moved_m: 0.001, turned_rad: 0.01 };
    exported.assert_stand_still(&listed(found["table"].clone()), &limits);
}

#[test]
fn usd_core_opens_the_scene_with_all_that_it_refers_to() {
    if !python_has("usd_core_opens_the_scene_with_all_that_it_refers_to", "usd-core", "pxr.UsdValidation") {
        return;
    }
    let exported = Exported::get();
    let files = ["scene.usda", "scene.usdz"].map(|name| exported.file(name));
    for found in python("usd_scene_check.py", &[&files[0], &files[1]]) {
        assert_eq!(found["errors"], json!([]), "{found}");
        assert_eq!(found["bodies"].as_array().unwrap().len(), 2, "{found}");
        assert_eq!((&found["support"], &found["textures"]), (&json!(true), &json!(true)), "{found}");
        assert_eq!(found["gravity"], json!(["physics"]));
        // Every Gaussian of the capture is in one of the splats, apart from a few that were set aside.
        let gaussians: u64 = found["gaussians"].as_array().unwrap().iter().map(|count| count.as_u64().unwrap()).sum();
        let all = exported.table.gaussians() as u64;
        assert!(
            found["gaussians"].as_array().unwrap().len() == 3 && gaussians <= all && gaussians + 20 > all,
            "{found}"
        );
        assert_eq!(found["visible"], json!({ "skin": ["skin", "support"], "splat": ["splat"] }));
    }
}

#[test]
fn the_glb_is_valid_and_its_bodies_are_sound() {
    let exported = Exported::get();
    let files = ["scene.glb", "scene_splat.glb"].map(|name| exported.file(name));
    // Every body has a mass that fits its volume, an inertia and colliders.
    let report = crate::audit::report(&[&files[0]], &[]).unwrap();
    assert!(report.require_sound().is_ok(), "{}", report.text());
    let audited = serde_json::to_value(&report).unwrap();
    let masses: Vec<f64> =
        listed(audited["files"][0]["links"].clone()).iter().filter_map(|link| link["mass_kg"].as_f64()).collect();
    for object in ["object_1", "object_2"] {
        let expected = exported.mass_kg(object);
        assert!(masses.iter().any(|mass| (mass / expected - 1.0).abs() < 1e-6), "{expected} is not in {masses:?}");
    }
    // Brick, cup and surroundings.
    if let Some(found) = valid_glbs("the_glb_is_valid_and_its_bodies_are_sound", &[&files[0], &files[1]]) {
        assert_eq!(found[1]["meshes"], 3, "{found:?}");
    }
}

/// The scale of the brick follows from its weight, and that of the cup from the brick's.
#[test]
fn the_weight_of_one_object_gives_the_scale_of_all() {
    let table = Table::new();
    let labels = table.write_labels();
    let server = MockServer::new(|_: &Request| {
        Response::new(200).json(completion(&good_answer_about_part(a("wood")).to_string()))
    });
    let url = format!("{}/v1", server.uri());
    let run = |more: &[&str]| {
        let coarse = ["--volume-cells", "20000", "--sheet-size", "256", "--segments", &labels, "--answers", "record"];
        table.run(
            &[&["run", "--to", "parts"][..], &coarse, &["--lmm-url", &url, "--lmm-model", "test-model"], more].concat(),
        )
    };
    let parts = |object: &str| -> Value {
        let path = table.path().join("gprop/objects").join(object).join("parts.json");
        serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
    };
    // Not without the other's.
    let (code, _, error) = run(&["--object", "1", "--known-mass", "object_2=200g"]);
    assert!(code == Some(2) && error.contains("run it first, with --object object_2"), "{error}");
    let (code, _, error) = run(&["--known-mass", "object_2=200g"]);
    assert_eq!(code, Some(0), "{error}");
    let [brick, cup] = ["object_1", "object_2"].map(parts);
    assert_eq!(cup["known_mass"]["reading_kg"], 0.2);
    assert!((cup["object"]["mass_kg"]["mid"].as_f64().unwrap() / 0.2 - 1.0).abs() < 0.02, "{cup}");
    // The other has no weight of its own, and the same scale.
    assert_eq!(brick["known_mass"], Value::Null);
    for end in ["low", "mid", "high"] {
        let [brick, cup] = [&brick, &cup].map(|of| of["meters_per_unit"][end].as_f64().unwrap());
        assert!((brick / cup - 1.0).abs() < 1e-12, "{end}: {brick}, {cup}");
    }
    // Another weight is another scale for both; nothing else of the brick was given.
    let (code, _, error) = run(&["--known-mass", "2=1.6kg"]);
    assert_eq!(code, Some(0), "{error}");
    let ratio = mass_kg(&table, "object_1") / brick["object"]["mass_kg"]["mid"].as_f64().unwrap();
    assert!((ratio / 8.0 - 1.0).abs() < 0.05, "{ratio}");
    // With a scale, only that object is weighed.
    let (code, _, error) = run(&["--known-mass", "2=1.6kg", "--scale", "0.5"]);
    assert_eq!(code, Some(0), "{error}");
    assert_eq!((&parts("object_1")["meters_per_unit"], &parts("object_1")["known_mass"]), (&Value::Null, &Value::Null));
    assert_eq!(parts("object_2")["known_mass"]["reading_kg"], 1.6);
    // What names no object, or none that is there.
    for (given, message) in
        [("3=1kg", "object_3"), ("mug=1kg", "no object is called \"mug\""), ("1kg", "--known-mass 2=1")]
    {
        let (code, _, error) = run(&["--known-mass", given]);
        assert!(code.is_some_and(|code| code != 0) && error.contains(message), "{given}: {error}");
    }
}
