//! Exports, loaded by the programs that they are for. A test whose program is not installed says so.

// The mesh itself again, with its physics.
mod asset;
// Soft parts that deform.
mod deformable;
// The GLB: its physics and what it shows.
mod glb;
// Each part as a link of its own; pairs with a gripper's pads; names.
mod links;
// The origin and place of an object; SDF; friction on steel.
mod placement;
// All formats at once, their list, and the file that says what was written.
mod summary;
// Several objects of a capture as one scene.
mod table;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock, PoisonError};

use clap::ValueEnum;
use gprop::export::{Credits, ExportError, Format, GlbLook, Links, Model, Origin, export};
use gprop::gaussians::Gaussians;
use gprop::grasp::Reason;
use gprop::grasp::candidates::Candidate;
use gprop::grasp::gripper::GripperProfile;
use gprop::parts::{FILLING, Object, PartsError};
use gprop::vote::field_ply;
use nalgebra::Vector3;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::grasp::scenes::{Measured, folders};
use crate::support::{self, Shared, parsed, python_has, shared_folder, skipped};

/// The user said nothing.
const CREDITS: Credits = Credits { license: None, author: None, wikidata: None, semantic_label: None };

fn model(measured: &Measured) -> Model<'_> {
    Model {
        name: &measured.scene.name,
        gaussians: &measured.scene.gaussians,
        as_read: measured.scene.gaussians_as_read(),
        world_from_input: measured.scene.up.world_from_input(),
        field: measured.field,
        interior: &measured.result.interior,
        scale: measured.scene.scale.as_ref(),
        parts: Some(measured.parts()),
        support: None,
        cameras: &measured.cameras,
        samples: &[],
        grasps: &[],
        on_steel: None,
        origin: Origin::Input,
        at: Vector3::zeros(),
        floating: false,
        links: Links::One,
        deformable: false,
        glb_look: GlbLook::Meshes,
        mjcf_splats: false,
        pad_geoms: &[],
        credits: &CREDITS,
        source: "point_cloud.ply",
        answered_by: &[],
        inputs: &[],
        asset: None,
    }
}

fn exported(measured: &Measured, format: Format) -> (TempDir, Vec<PathBuf>) {
    let folder = TempDir::new().unwrap();
    let files = export(&model(measured), &[format], folder.path()).unwrap();
    (folder, files)
}

/// The files of a scene in the formats with colliders, which are written once for all tests.
struct Rigid {
    measured: &'static Measured,
    folder: PathBuf,
    files: Vec<PathBuf>,
}

impl Rigid {
    const FORMATS: [Format; 6] = [Format::Mjcf, Format::Urdf, Format::Sdf, Format::Usda, Format::Usdz, Format::Glb];

    fn of(scene: &Path) -> &'static Self {
        static RIGID: Shared<Rigid> = Shared::new();
        RIGID.of(scene, || {
            let measured = Measured::of(scene);
            Self::new(measured, &measured.scene.name)
        })
    }

    /// Of [`Measured::small`].
    fn small() -> &'static Self {
        static SMALL: OnceLock<Rigid> = OnceLock::new();
        SMALL.get_or_init(|| Self::new(Measured::small(), "small"))
    }

    fn new(measured: &'static Measured, folder: &str) -> Self {
        let mut rigid = Self { measured, folder: shared_folder(&format!("export/{folder}")), files: Vec::new() };
        rigid.files = export(&rigid.model(), &Self::FORMATS, &rigid.folder).unwrap();
        rigid
    }

    fn model(&self) -> Model<'_> {
        Model { grasps: &self.measured.with_paper().candidates, floating: true, ..model(self.measured) }
    }

    fn name(&self) -> &str {
        &self.measured.scene.name
    }

    fn object(&self) -> &Object {
        &self.measured.parts().object
    }

    /// The file with this ending.
    fn file(&self, ending: &str) -> &Path {
        let name = format!("{}{ending}", self.name());
        self.files.iter().find(|file| file.file_name().is_some_and(|found| *found == *name)).unwrap()
    }
}

/// What a script finds in each of the files. One process reads them all: a script spends most of its time on starting.
pub fn python(script: &str, files: &[&Path]) -> Vec<Value> {
    listed(support::python(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/export").join(script), files))
}

/// What Khronos's validator finds in GLBs that it accepts; `None` if it is not installed.
fn valid_glbs(test: &str, files: &[&Path]) -> Option<Vec<Value>> {
    let has_validator = Command::new("node").args(["-e", "require('gltf-validator')"]).output();
    if !has_validator.is_ok_and(|output| output.status.success()) {
        skipped(test, "node has no gltf-validator; `npm install gltf-validator` brings it");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/export/gltf_check.cjs");
    let found = listed(parsed(Command::new("node").arg(script).args(files).output().unwrap()));
    for report in &found {
        // The validator does not know the attributes of KHR_gaussian_splatting yet.
        let messages: Vec<String> = serde_json::from_value(report["messages"].clone()).unwrap();
        let is_known =
            |text: &String| text.contains("KHR_gaussian_splatting:") && text.ends_with("Invalid attribute name.");
        let others: Vec<&String> = messages.iter().filter(|text| !is_known(text)).collect();
        assert!(others.is_empty(), "{others:?}");
    }
    Some(found)
}

/// What a script that reads a single file finds.
fn python_of_one(script: &str, arguments: &[&Path]) -> Value {
    support::python(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/export").join(script), arguments)
}

/// Newton compiles its kernels when it first runs, which takes most of a minute, and keeps them: whoever comes next waits for them
/// instead of compiling the same.
fn newton(arguments: &[&Path]) -> Value {
    static COMPILED: Mutex<()> = Mutex::new(());
    let _turn = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    python_of_one("newton_check.py", arguments)
}

pub fn mujoco(what: &str, arguments: &[&Path]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/export/mujoco_check.py");
    parsed(Command::new("python3").arg(script).arg(what).args(arguments).output().unwrap())
}

fn listed(found: Value) -> Vec<Value> {
    serde_json::from_value(found).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

/// Mass, centre of mass and inertia are those of `parts.json`, relative to their own size.
fn assert_same_body(found: &Value, object: &Object, tolerance: f64) {
    let expected = [
        ("mass_kg", vec![object.mass_kg.mid]),
        ("center_of_mass_m", object.center_of_mass_m.to_vec()),
        ("inertia_kg_m2", object.inertia_kg_m2.concat()),
    ];
    for (key, expected) in expected {
        let found = numbers(&found[key]);
        let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let off: Vec<f64> = found.iter().zip(&expected).map(|(a, b)| a - b).collect();
        let relative = norm(&off) / norm(&expected);
        assert!(found.len() == expected.len() && relative < tolerance, "{key}: {found:?} is not {expected:?}");
    }
}

#[test]
fn mujoco_loads_mjcf_and_urdf_with_the_same_body() {
    if !python_has("mujoco_loads_mjcf_and_urdf_with_the_same_body", "mujoco", "mujoco") {
        return;
    }
    for folder in folders() {
        let rigid = Rigid::of(&folder);
        let endings = [".xml", ".urdf"];
        let loaded = listed(mujoco("load", &endings.map(|ending| rigid.file(ending))));
        for (ending, found) in endings.into_iter().zip(loaded) {
            println!("{}{ending} {found}", rigid.name());
            assert_same_body(&found, rigid.object(), 1e-6);
            assert_eq!(found["free_joints"], 1);
            assert_eq!(found["total_mass_kg"], found["mass_kg"], "nothing else weighs");
            assert!(found["geoms"].as_u64().unwrap() >= rigid.measured.parts().parts.len() as u64);
        }
    }
}

/// Dropped from 2 cm, it rests after 2 s and stays where it is for 2 s more; a scene with a floor comes along.
#[test]
fn exported_objects_come_to_rest_on_a_plane() {
    if !python_has("exported_objects_come_to_rest_on_a_plane", "mujoco", "mujoco") {
        return;
    }
    for (n, folder) in folders().iter().enumerate() {
        let rigid = Rigid::of(folder);
        // The body is the same in both.
        let endings = if n == 0 { &[".xml", ".urdf"][..] } else { &[".xml"] };
        let files: Vec<&Path> = endings.iter().map(|ending| rigid.file(ending)).collect();
        for (ending, found) in endings.iter().zip(listed(mujoco("rest", &files))) {
            println!("{}{ending} {found}", rigid.name());
            assert!(found["moved_m"].as_f64().unwrap() < 0.002, "{found}");
            assert!(found["contacts"].as_u64().unwrap() > 0, "{found}");
        }
        let scene = rigid.file(".xml").with_file_name("scene.xml");
        assert!(rigid.files.contains(&scene));
        let found = &mujoco("load", &[&scene])[0];
        assert_same_body(found, rigid.object(), 1e-6);
    }
}

/// How far MuJoCo raises the object when a hand grasps it at a place with this force of one finger and rises by 0.1 m.
fn raised_m(rigid: &Rigid, place: &Candidate, side_m: f64, force_n: f64) -> f64 {
    let grasp = json!({
        "name": rigid.name(), "contacts_m": place.contacts_m, "approach": place.approach,
        "finger_side_m": side_m, "force_n": force_n,
    });
    let home = TempDir::new().unwrap();
    let path = home.path().join("grasp.json");
    std::fs::write(&path, grasp.to_string()).unwrap();
    let found = mujoco("lift", &[rigid.file(".xml"), &path]);
    println!("{} at the {}, {force_n:.2} N: {found}", rigid.name(), place.part);
    assert!((found["hand_raised_m"].as_f64().unwrap() - 0.1).abs() < 0.01, "the hand rises by 0.1 m: {found}");
    found["raised_m"].as_f64().unwrap()
}

/// A scene that six tenths of F_min hold too at the place that gprop proposes: F_min is derived for flat, upright surfaces,
/// but the flange of the lamp's neck rests on the pads.
const HELD_BY_ITS_SHAPE: &str = "table_lamp";

/// At the place that gprop proposes, whatever it is. docs/grasp.md has the outcomes.
#[test]
fn f_star_lifts_in_mujoco_and_six_tenths_of_f_min_slips_unless_the_shape_holds() {
    const TEST: &str = "f_star_lifts_in_mujoco_and_six_tenths_of_f_min_slips_unless_the_shape_holds";
    if !python_has(TEST, "mujoco", "mujoco") {
        return;
    }
    for folder in folders() {
        let rigid = Rigid::of(&folder);
        let name = rigid.name();
        // At the joints of the chair's legs, hulls reach 8 to 28 mm into the place of a pad, which they would push away.
        // `scripts/verify_grasps.py` lifts the chair by its visual mesh.
        if name == "chair" {
            continue;
        }
        let gripper = GripperProfile::load("paper").unwrap();
        let report = rigid.measured.with_paper();
        // MuJoCo lifts straight up; that the object may turn when it is tilted does not matter here.
        let why = report.infeasible.as_ref().map(|why| why.reason);
        assert!(why.is_none_or(|reason| reason == Reason::Turns), "{report:?}");
        let place = &report.candidates[0];
        let held = raised_m(rigid, place, gripper.finger_side_m(), place.f_star_n);
        assert!(held > 0.09, "{name} is held: raised by {held} m");
        // The mug slides only until the rim of its lid rests on the pads.
        let weakly = raised_m(rigid, place, gripper.finger_side_m(), 0.6 * place.f_min_n);
        assert_eq!(weakly < 0.08, name != HELD_BY_ITS_SHAPE, "{name} is raised by {weakly} m");
    }
}

#[test]
fn usd_core_opens_the_usd_and_its_validators_pass() {
    if !python_has("usd_core_opens_the_usd_and_its_validators_pass", "usd-core", "pxr.UsdValidation") {
        return;
    }
    for folder in folders() {
        let rigid = Rigid::of(&folder);
        let endings = [".usda", ".usdz"];
        let checked = python("usd_check.py", &endings.map(|ending| rigid.file(ending)));
        for (ending, found) in endings.into_iter().zip(checked) {
            println!("{}{ending} {found}", rigid.name());
            assert_eq!(found["errors"], json!([]));
            assert!(found["validators"].as_u64().unwrap() > 10);
            assert_eq!((&found["up_axis"], &found["meters_per_unit"]), (&json!("Z"), &json!(1.0)));
            assert_eq!((&found["rigid"], &found["bound"]), (&json!(true), &json!(true)));
            let scene = rigid.measured.scene;
            let gaussians = scene.gaussians.len();
            let harmonics = gaussians * (scene.gaussians.sh_rest_per_channel() + 1);
            assert_eq!(found["kind"], "ParticleField3DGaussianSplat");
            assert_eq!((&found["gaussians"], &found["harmonics"]), (&json!(gaussians), &json!(harmonics)));
            assert_eq!((&found["skin_closed"], &found["texture"]), (&json!(true), &json!(true)));
            assert_eq!(found["subset_faces"], found["skin_triangles"], "every face belongs to a part");
            assert_eq!(found["visible"], json!({ "skin": ["skin"], "splat": ["splat"] }));
            assert_eq!(found["grasps"], json!([2, 2, 2, 2, 2]), "points of a line");
            // USD keeps mass properties in 32 bits.
            assert_same_body(&found, rigid.object(), 1e-6);
        }
    }
}

/// No requirement of a required feature fails, and the optional ones that gprop writes pass too.
#[test]
fn simready_accepts_the_usd_as_a_prop() {
    const PACKAGES: &str = "simready-validate simready-foundation-tier-core";
    if !python_has("simready_accepts_the_usd_as_a_prop", PACKAGES, "simready.foundation.tier_core") {
        return;
    }
    let rigid = Rigid::small();
    let endings = [".usda", ".usdz"];
    let checked = python("simready_check.py", &endings.map(|ending| rigid.file(ending)));
    for (ending, found) in endings.iter().zip(checked) {
        println!("{ending} {found}");
        let features = found["features"].as_object().unwrap();
        assert_eq!(found["version"], "4.0.0");
        assert!(features.len() >= 10, "{features:?}");
        for (name, feature) in features {
            assert_eq!(feature["blocking"], false, "{name}: {}", feature["failing"]);
        }
        for number in ["000", "001", "003", "005", "006", "033"] {
            let name = format!("FET_{number}_STANDARD");
            assert_eq!(features[&name]["passed"], true, "{name}");
        }
    }
}

#[test]
fn newton_imports_the_usd_with_its_gaussians_and_it_comes_to_rest() {
    const TEST: &str = "newton_imports_the_usd_with_its_gaussians_and_it_comes_to_rest";
    const PACKAGES: &str = "newton warp-lang newton-usd-schemas usd-core scipy";
    if !python_has(TEST, PACKAGES, "newton, newton_usd_schemas, pxr, scipy") {
        return;
    }
    let rigid = Rigid::of(&folders()[0]);
    let found = newton(&[rigid.file(".usda")]);
    println!("{found}");
    assert_eq!((&found["bodies"], &found["gaussians"]), (&json!(1), &json!(1)));
    assert!(found["colliders"].as_u64().unwrap() >= rigid.measured.parts().parts.len() as u64);
    let object = rigid.object();
    // Newton's numbers have 32 bits.
    assert!((found["mass_kg"].as_f64().unwrap() / object.mass_kg.mid - 1.0).abs() < 1e-6, "{found}");
    for (center, expected) in numbers(&found["center_of_mass_m"]).iter().zip(object.center_of_mass_m) {
        assert!((center - expected).abs() < 1e-6, "{found}");
    }
    // It was dropped from 2 cm.
    assert!((found["fell_m"].as_f64().unwrap() - 0.02).abs() < 0.005, "{found}");
    assert!(found["moved_m"].as_f64().unwrap() < 0.002, "{found}");
}

#[test]
fn trimesh_finds_the_glb_closed_with_the_parts_properties() {
    if !python_has("trimesh_finds_the_glb_closed_with_the_parts_properties", "trimesh", "trimesh") {
        return;
    }
    for folder in folders() {
        let rigid = Rigid::of(&folder);
        let endings = [".glb", "_colliders.glb"];
        let checked = python("glb_check.py", &endings.map(|ending| rigid.file(ending)));
        for (ending, found) in endings.iter().zip(&checked) {
            for (mesh, of_mesh) in found.as_object().unwrap() {
                assert_eq!(of_mesh["closed"], true, "{}{ending}: {mesh}", rigid.name());
                assert!(of_mesh["volume_m3"].as_f64().unwrap() > 0.0, "{}{ending}: {mesh}", rigid.name());
            }
        }
        let [found, colliders] = checked.as_slice() else { panic!("two files") };
        let measured = rigid.measured;
        assert!(colliders.as_object().unwrap().len() >= measured.parts().parts.len(), "{colliders}");
        let parts: Vec<_> = measured.parts().parts.iter().filter(|part| part.volume_m3.is_some()).collect();
        assert_eq!(found.as_object().unwrap().len(), parts.len());
        for part in parts {
            let node = found.as_object().unwrap().values().find(|node| node["extras"]["part"] == part.id).unwrap();
            assert_eq!(node["extras"]["material"], part.material.as_str(), "{found}");
            let mass = node["extras"]["mass_kg"].as_f64().unwrap();
            assert!((mass - part.mass_kg.unwrap().mid).abs() < 1e-9, "{mass}");
        }
    }
}

#[test]
fn the_splats_parts_are_all_of_it() {
    let measured = Measured::of(&folders()[0]);
    let (_folder, files) = exported(measured, Format::PlyParts);
    let read: Vec<_> = files.iter().map(|file| gprop::scene::splat::ply::read(file).unwrap().gaussians).collect();
    assert_eq!(read.len(), measured.field.parts.len());
    assert_eq!(read.iter().map(Gaussians::len).sum::<usize>(), measured.scene.gaussians.len());
    for (label, gaussians) in measured.field.parts.iter().zip(&read) {
        let column = gaussians.extra.iter().find(|extra| extra.name == "part_label").unwrap();
        assert!(column.values.iter().all(|part| *part == label.id as f32), "{}", label.caption);
    }
}

#[test]
fn no_export_replaces_a_file_of_the_scene() {
    let measured = Measured::of(&folders()[0]);
    let (folder, files) = exported(measured, Format::PlyParts);
    std::fs::write(&files[1], "a splat").unwrap();
    let model = Model { inputs: &files[1..2], ..model(measured) };
    let error = export(&model, &[Format::PlyParts], folder.path()).unwrap_err();
    assert!(matches!(error, ExportError::Input { .. }) && error.to_string().contains("--out"), "{error}");
    assert_eq!(std::fs::read_to_string(&files[1]).unwrap(), "a splat");
}

#[test]
fn the_gltf_splat_has_every_gaussian_and_harmonic() {
    let measured = Measured::of(&folders()[0]);
    let (_folder, files) = exported(measured, Format::GltfSplat);
    let bytes = std::fs::read(&files[0]).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    assert_eq!(u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize, bytes.len());
    let primitive = &json["meshes"][0]["primitives"][0];
    assert_eq!((&primitive["mode"], &json["extensionsUsed"]), (&json!(0), &json!(["KHR_gaussian_splatting"])));
    let attributes = primitive["attributes"].as_object().unwrap();
    let gaussians = &measured.scene.gaussians;
    // Position, colour, rotation, scale, opacity, part, and the harmonics.
    assert_eq!(attributes.len(), 6 + gaussians.sh_rest_per_channel() + 1);
    for accessor in attributes.values() {
        assert_eq!(json["accessors"][accessor.as_u64().unwrap() as usize]["count"], gaussians.len());
    }
    let end_of = |attribute: &str| {
        let accessor = &json["accessors"][attributes[attribute].as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        20 + length + 8 + (view["byteOffset"].as_u64().unwrap() + view["byteLength"].as_u64().unwrap()) as usize
    };
    // The last harmonic of the last Gaussian, as it is in the PLY.
    let degree = gaussians.sh_degree;
    let end = end_of(&format!("KHR_gaussian_splatting:SH_DEGREE_{degree}_COEF_{}", 2 * degree));
    let value = f32::from_le_bytes(bytes[end - 4..end].try_into().unwrap());
    assert_eq!(value, *gaussians.sh_rest.last().unwrap());
    // The alpha of the last Gaussian's colour is its opacity.
    let end = end_of("COLOR_0");
    let alpha = u16::from_le_bytes(bytes[end - 2..end].try_into().unwrap());
    assert_eq!(f64::from(alpha), (gaussians.opacity(gaussians.len() - 1) * 65535.0).round());
}

#[test]
fn splat_transform_opens_field_ply_and_keeps_the_properties() {
    const TEST: &str = "splat_transform_opens_field_ply_and_keeps_the_properties";
    if Command::new("splat-transform").arg("--version").output().is_err() {
        skipped(TEST, "no splat-transform; `npm install --global @playcanvas/splat-transform` brings it");
        return;
    }
    let measured = Measured::of(&folders()[0]);
    let folder = TempDir::new().unwrap();
    let [from, to] = ["field.ply", "copy.ply"].map(|name| folder.path().join(name));
    let columns = field_ply::columns(measured.field);
    let file = std::fs::File::create(&from).unwrap();
    gprop::scene::splat::ply::write(std::io::BufWriter::new(file), &measured.scene.gaussians, &columns).unwrap();
    let output = Command::new("splat-transform").args([&from, &to]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let copy = gprop::scene::splat::ply::read(&to).unwrap().gaussians;
    assert_eq!(copy.len(), measured.scene.gaussians.len());
    for column in &columns {
        let kept = copy.extra.iter().find(|extra| extra.name == column.name);
        let sum = |values: &[f32]| values.iter().filter(|v| !v.is_nan()).map(|v| f64::from(*v)).sum::<f64>();
        let (kept, own) = (sum(&kept.unwrap_or_else(|| panic!("{} is lost", column.name)).values), sum(&column.values));
        // Its writer may reorder Gaussians, so sums are compared.
        assert!((kept - own).abs() <= 1e-9 * own.abs(), "{}: {kept} is not {own}", column.name);
    }
}

#[test]
fn a_body_without_a_mass_is_refused() {
    let measured = Measured::of(&folders()[0]);
    let mut parts = measured.parts().clone();
    parts.object.mass_kg = gprop::units::Estimate::exactly(0.0);
    let model = Model { parts: Some(&parts), ..model(measured) };
    for format in [Format::Mjcf, Format::Urdf, Format::Usda, Format::Usdz] {
        let folder = TempDir::new().unwrap();
        let error = export(&model, &[format], folder.path()).unwrap_err();
        assert!(matches!(error, ExportError::NoMass), "{format:?}: {error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn numpy_reads_the_npz() {
    if !python_has("numpy_reads_the_npz", "numpy", "numpy") {
        return;
    }
    let measured = Measured::of(&folders()[0]);
    let (_folder, files) = exported(measured, Format::Npz);
    let found = python_of_one("npz_check.py", &[&files[0]]);
    let (count, parts) = (measured.scene.gaussians.len(), measured.parts());
    assert_eq!(found["gaussian_position"]["shape"], json!([count, 3]));
    assert_eq!(found["gaussian_density"]["dtype"], "float32");
    assert_eq!(found["part_mass_kg"]["shape"], json!([parts.parts.len(), 3]));
    assert_eq!(found["meters_per_unit"], json!({ "dtype": "float64", "shape": [], "sum": 1.0 }));
    let mass = parts.object.mass_kg;
    let sum = found["object_mass_kg"]["sum"].as_f64().unwrap();
    assert!((sum - (mass.low + mass.mid + mass.high)).abs() < 1e-12, "{sum}");
}

#[test]
fn physgaussian_gets_its_folder() {
    let measured = Measured::of(&folders()[0]);
    let (folder, files) = exported(measured, Format::Physgaussian);
    let model = folder.path().join("hammer/physgaussian");
    assert_eq!(files[0], model.join("config.json"));
    let config: Value = serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap();
    // The requirements of decode_param.py: a known material, nu within 0 to 0.5, boxes with point, size, E, nu.
    assert!(["jelly", "metal", "sand", "foam", "snow", "plasticine"].contains(&config["material"].as_str().unwrap()));
    assert!((0.0..0.5).contains(&config["nu"].as_f64().unwrap()));
    let boxes = config["additional_material_params"].as_array().unwrap();
    assert_eq!(boxes.len(), measured.field.parts.len() - 1);
    for part in boxes {
        let middle = numbers(&part["point"]);
        assert!(middle.iter().all(|c| (0.5..=1.5).contains(c)), "within the unit box around 1: {middle:?}");
        assert!(numbers(&part["size"]).iter().all(|s| (0.0..=0.5).contains(s)));
        assert!(part["E"].is_number() && part["nu"].is_number() && part["density"].is_number());
    }
    let steps = config["frame_dt"].as_f64().unwrap() / config["substep_dt"].as_f64().unwrap();
    assert!((steps - steps.round()).abs() < 1e-9, "whole steps a frame: {steps}");
    let cloud = gprop::scene::splat::ply::read(&model.join("point_cloud/iteration_30000/point_cloud.ply")).unwrap();
    let names: Vec<&str> = cloud.gaussians.extra.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["part_label", "density", "E", "nu", "material_id", "conf"]);
}

#[test]
fn boxes_leave_out_the_gaussians_that_physgaussian_drops() {
    /// An opacity of 0.00005; PhysGaussian keeps those above 0.02.
    const FAINT: f32 = -10.0;
    let measured = Measured::of(&folders()[0]);
    let boxes = |gaussians: &Gaussians| -> Vec<Value> {
        let folder = TempDir::new().unwrap();
        let files = export(&Model { gaussians, ..model(measured) }, &[Format::Physgaussian], folder.path()).unwrap();
        let config: Value = serde_json::from_slice(&std::fs::read(&files[0]).unwrap()).unwrap();
        listed(config["additional_material_params"].clone())
    };
    let (all, part_index) = (&measured.scene.gaussians, &measured.field.part_index);
    let mut faint = all.clone();
    faint.opacity_logits[0] = FAINT;
    let mut astray = faint.clone();
    astray.positions[0] = [1e3; 3];
    assert_eq!(boxes(&astray), boxes(&faint), "wherever it lies");
    let count = |label: u32| part_index.iter().filter(|&&of| of == label).count();
    let least = (0..measured.field.parts.len() as u32).min_by_key(|&label| count(label)).unwrap();
    let of_least = |(i, _): &(usize, &mut f32)| part_index[*i] == least;
    faint.opacity_logits.iter_mut().enumerate().filter(of_least).for_each(|(_, logit)| *logit = FAINT);
    assert_eq!(boxes(&faint).len(), boxes(all).len() - 1, "no box for a part without a Gaussian");
}

#[test]
fn exports_are_the_same_bytes_again() {
    let rigid = Rigid::small();
    let (first, second) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    // The files with colliders are there already.
    let all: Vec<Format> = Format::value_variants().iter().copied().filter(|format| !format.needs_mesh()).collect();
    let others: Vec<Format> = all.iter().copied().filter(|format| !Rigid::FORMATS.contains(format)).collect();
    let others = export(&rigid.model(), &others, first.path()).unwrap();
    let all = export(&rigid.model(), &all, second.path()).unwrap();
    assert_eq!(all.len(), rigid.files.len() + others.len());
    // Another object can be exported into the same folder, and included in the same scene of MuJoCo.
    let name = rigid.name();
    for file in all.iter().filter(|file| !file.ends_with("scene.xml")) {
        let mut components = file.strip_prefix(second.path()).unwrap().iter();
        assert!(components.any(|component| component.to_string_lossy().starts_with(name)), "{file:?}");
    }
    let body = std::fs::read_to_string(rigid.file(".xml")).unwrap();
    let names: Vec<&str> = body.split(" name=\"").skip(1).collect();
    assert!(names.len() > 10 && names.iter().all(|given| given.starts_with(name)), "{names:?}");
    for (folder, files) in [(rigid.folder.as_path(), &rigid.files), (first.path(), &others)] {
        for one in files {
            let two = second.path().join(one.strip_prefix(folder).unwrap());
            assert!(std::fs::read(one).unwrap() == std::fs::read(two).unwrap(), "{one:?}");
        }
    }
}

/// What fills a shell is solid to the touch: the colliders are those of a solid part.
#[test]
fn a_filling_collides_as_its_shell() {
    let rigid = Rigid::small();
    let measured = rigid.measured;
    let mut interior = measured.result.interior.clone();
    let shell = measured.parts().parts.last().unwrap().id;
    let mut filled = 0;
    for part in interior.part.iter_mut().filter(|part| **part == shell).step_by(2) {
        *part += FILLING;
        filled += 1;
    }
    assert!(filled > 0);
    let folder = TempDir::new().unwrap();
    let model = Model { interior: &interior, ..rigid.model() };
    let full = export(&model, &[Format::Mjcf, Format::Glb], folder.path()).unwrap();
    assert!(full.len() > 4, "{full:?}");
    for file in full {
        // The XML and the GLB name the colliders, of which there are as many in both.
        let solid = rigid.folder.join(file.strip_prefix(folder.path()).unwrap());
        assert!(std::fs::read(&file).unwrap() == std::fs::read(solid).unwrap(), "{file:?} differs");
    }
}

#[test]
fn without_a_scale_rigid_bodies_are_refused_and_fields_are_not() {
    let measured = Measured::of(&folders()[0]);
    let unscaled = Model { scale: None, parts: None, ..model(measured) };
    for format in [Format::Mjcf, Format::Urdf, Format::Usda, Format::Usdz, Format::Glb] {
        let folder = TempDir::new().unwrap();
        let error = export(&unscaled, &[format], folder.path()).unwrap_err();
        assert!(matches!(error, ExportError::Scale(PartsError::ScaleUnknown)), "{error}");
        assert!(error.to_string().contains("--scale"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
    }
    // A splat is no mesh.
    for format in [Format::Asset, Format::Csv] {
        let error = export(&unscaled, &[format], TempDir::new().unwrap().path()).unwrap_err();
        assert!(matches!(error, ExportError::NotAMesh), "{error}");
    }
    for format in [Format::Npz, Format::Physgaussian, Format::GltfSplat, Format::PlyParts] {
        export(&unscaled, &[format], TempDir::new().unwrap().path()).unwrap();
    }
}
