//! Where an object's axes are and where it stands, and the frictions of the two surfaces that may touch it.

use std::path::Path;
use std::process::Command;

use gprop::export::{Format, Model, Origin, export};
use gprop::materials::MaterialLibrary;
use gprop::units::Estimate;
use nalgebra::{Point3, Vector3};
use serde_json::Value;
use tempfile::TempDir;

use crate::grasp::scenes::Measured;
use crate::support::{python_has, skipped};

/// Vertices are written to a micrometre; sizes and centres are of two of them.
const ROUNDING_M: f64 = 2e-6;

/// The numbers of an attribute of the first element with this beginning.
fn attribute(text: &str, element: &str, name: &str) -> Option<Vec<f64>> {
    let start = text.find(element)? + element.len();
    let element = &text[start..start + text[start..].find('>')?];
    let value = element.split(&format!(" {name}=\"")).nth(1)?;
    Some(value[..value.find('"')?].split(' ').map(|number| number.parse().unwrap()).collect())
}

/// The corners of the box around the colliders of an exported object, as its files have them.
fn collider_box(folder: &Path, name: &str) -> (Point3<f64>, Point3<f64>) {
    let meshes = std::fs::read_dir(folder.join("meshes")).unwrap().map(|file| file.unwrap().path());
    let is_collider = |path: &Path| {
        let file = path.file_name().unwrap().to_string_lossy().into_owned();
        file.starts_with(&format!("{name}__")) && file.ends_with(".obj")
    };
    let mut vertices = Vec::new();
    for path in meshes.filter(|path| is_collider(path)) {
        let text = std::fs::read_to_string(path).unwrap();
        for line in text.lines().filter(|line| line.starts_with("v ")) {
            let at: Vec<f64> = line.split(' ').skip(1).map(|number| number.parse().unwrap()).collect();
            vertices.push(Point3::new(at[0], at[1], at[2]));
        }
    }
    vertices.iter().fold((vertices[0], vertices[0]), |(low, high), v| (low.inf(v), high.sup(v)))
}

fn exported(model: &Model, formats: &[Format]) -> TempDir {
    let folder = TempDir::new().unwrap();
    export(model, formats, folder.path()).unwrap();
    folder
}

#[test]
fn an_object_has_the_origin_that_was_chosen() {
    let measured = Measured::small();
    let model = super::model(measured);
    let body = |origin| {
        let folder = exported(&Model { origin, ..model }, &[Format::Mjcf]);
        let text = std::fs::read_to_string(folder.path().join("hammer.xml")).unwrap();
        let scene = std::fs::read_to_string(folder.path().join("scene.xml")).unwrap();
        let floor = attribute(&scene, "<geom name=\"floor\"", "pos").unwrap()[2];
        let center = Vector3::from_vec(attribute(&text, "<inertial", "pos").unwrap());
        (collider_box(folder.path(), "hammer"), center, floor)
    };
    let (input, center, floor) = body(Origin::Input);
    assert_eq!(center, Vector3::from(measured.parts().object.center_of_mass_m));
    assert!((floor - input.0.z).abs() < ROUNDING_M, "it stands on its floor: {floor}, {input:?}");
    let (base, of_base, floor) = body(Origin::Base);
    assert!(floor.abs() < ROUNDING_M && base.0.z.abs() < ROUNDING_M, "{base:?}");
    assert!((base.0 + base.1.coords).xy().coords.norm() < ROUNDING_M, "{base:?}");
    let (com, of_com, floor) = body(Origin::Com);
    assert!(of_com.norm() < ROUNDING_M && (floor - com.0.z).abs() < ROUNDING_M, "{com:?}");
    // The object is the same, whatever its origin.
    for (other, of_other) in [(base, of_base), (com, of_com)] {
        let size = (other.1 - other.0) - (input.1 - input.0);
        let to_center = (of_other - other.0.coords) - (center - input.0.coords);
        assert!(size.norm() < ROUNDING_M && to_center.norm() < ROUNDING_M, "{other:?}");
    }
}

#[test]
fn two_exports_stand_side_by_side() {
    if !python_has("two_exports_stand_side_by_side", "mujoco", "mujoco") {
        return;
    }
    let measured = Measured::small();
    let together = |at: Vector3<f64>| {
        let folder = TempDir::new().unwrap();
        let model = Model { origin: Origin::Base, ..super::model(measured) };
        for model in [model, Model { name: "other", at, ..model }] {
            export(&model, &[Format::Mjcf, Format::Urdf], folder.path()).unwrap();
        }
        let both = "<mujoco><include file=\"hammer.xml\"/><include file=\"other.xml\"/></mujoco>";
        std::fs::write(folder.path().join("both.xml"), both).unwrap();
        let found: Value = super::mujoco("contacts", &[&folder.path().join("both.xml")]);
        let urdf = std::fs::read_to_string(folder.path().join("other.urdf")).unwrap();
        (found[0].as_u64().unwrap(), attribute(&urdf, "type=\"floating\"><origin", "xyz"))
    };
    let (overlapping, _) = together(Vector3::zeros());
    assert!(overlapping > 0, "two objects on one base touch");
    let (contacts, of_joint) = together(Vector3::new(0.5, 0.0, 0.0));
    assert_eq!((contacts, of_joint), (0, Some(vec![0.5, 0.0, 0.0])));
}

#[test]
fn sdf_is_one_free_model_that_pybullet_reads() {
    let measured = Measured::small();
    let folder = exported(&super::model(measured), &[Format::Sdf]);
    let path = folder.path().join("hammer.sdf");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(!text.contains("<world") && !text.contains("<static>"), "{text}");
    for mesh in text.split("<uri>").skip(1).map(|rest| &rest[..rest.find('<').unwrap()]) {
        assert!(folder.path().join(mesh).is_file(), "{mesh}");
    }
    for part in &measured.field.parts {
        assert!(text.contains(&format!("<mu>{}</mu>", part.friction_rubber.mid)), "{}", part.caption);
    }
    if python_has("sdf_is_one_free_model_that_pybullet_reads", "pybullet", "pybullet") {
        let found = &super::python("pybullet_check.py", &[&path])[0];
        let bodies = found["bodies"].as_array().unwrap();
        assert_eq!((bodies.len(), &found["static"]), (1, &Value::from(0)), "{found}");
        // Bullet reads some numbers in 32 bits.
        let mass = bodies[0]["mass_kg"].as_f64().unwrap() / measured.parts().object.mass_kg.mid;
        assert!((mass - 1.0).abs() < 1e-6, "{found}");
    }
}

/// ROS's reader takes both; that PyBullet moves the one link, and MuJoCo the one that floats, other tests show.
#[test]
fn a_urdf_is_one_link_unless_it_is_to_float() {
    let model = super::model(Measured::small());
    let test = "a_urdf_is_one_link_unless_it_is_to_float";
    let has_reader = Command::new("check_urdf").output().is_ok();
    if !has_reader {
        skipped(test, "no check_urdf; `apt-get install liburdfdom-tools` brings it");
    }
    let at = Vector3::new(0.5, 0.0, 0.0);
    for (model, root) in
        [(model, "hammer"), (Model { floating: true, ..model }, "hammer_root"), (Model { at, ..model }, "hammer_root")]
    {
        let folder = exported(&model, &[Format::Urdf]);
        let path = folder.path().join("hammer.urdf");
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.contains("<joint") && text.contains("type=\"floating\""), root != "hammer", "{text}");
        if has_reader {
            let read = Command::new("check_urdf").arg(&path).output().unwrap();
            let said = String::from_utf8_lossy(&read.stdout);
            assert!(read.status.success() && said.contains(&format!("root Link: {root} ")), "{said}");
        }
    }
}

/// Gazebo's own reader, which turns a URDF into SDF first.
#[test]
fn gazebo_reads_one_free_link_with_its_mass_and_frictions() {
    let test = "gazebo_reads_one_free_link_with_its_mass_and_frictions";
    let ign = |option: &str, path: &Path| Command::new("ign").args(["sdf", option]).arg(path).output();
    if ign("--versions", Path::new("")).is_err() {
        return skipped(test, "no ign; `apt-get install ignition-tools libsdformat-dev` brings it");
    }
    let measured = Measured::small();
    let folder = exported(&super::model(measured), &[Format::Sdf, Format::Urdf]);
    let frictions = || measured.field.parts.iter().map(|label| label.friction_rubber.mid);
    let least = frictions().fold(f64::INFINITY, f64::min);
    for (file, frictions) in [("hammer.sdf", frictions().collect()), ("hammer.urdf", vec![least])] {
        let path = folder.path().join(file);
        let checked = ign("--check", &path).unwrap();
        assert!(String::from_utf8_lossy(&checked.stdout).contains("Valid."), "{checked:?}");
        let read = String::from_utf8(ign("--print", &path).unwrap().stdout).unwrap();
        let numbers = |tag: &str| -> Vec<f64> {
            read.split(&format!("<{tag}>"))
                .skip(1)
                .map(|rest| rest.split('<').next().unwrap().parse().unwrap())
                .collect()
        };
        assert_eq!((read.matches("<link ").count(), read.matches("<joint ").count()), (1, 0), "{read}");
        let mass = measured.parts().object.mass_kg.mid;
        assert!(numbers("mass").iter().all(|read| (read / mass - 1.0).abs() < 1e-12), "{read}");
        let has = |friction: f64| numbers("mu").iter().any(|read| (read - friction).abs() < 1e-12);
        assert!(
            frictions.iter().all(|friction: &f64| has(*friction))
                && numbers("mu").iter().all(|mu| *mu >= least - 1e-12),
            "{read}"
        );
        assert!(!read.contains("<static>true") && !read.contains("<static>1"), "{read}");
    }
}

#[test]
fn on_steel_frictions_are_those_of_the_library() {
    let measured = Measured::small();
    let library = MaterialLibrary::builtin();
    // This scene's materials are those of its ground truth, of which the library has not all.
    let model = Model { on_steel: Some(library), ..super::model(measured) };
    let unknown = export(&model, &[Format::Mjcf], TempDir::new().unwrap().path()).unwrap_err().to_string();
    assert!(unknown.contains("friction on steel is unknown") && unknown.contains("--materials"), "{unknown}");
    let mut field = measured.field.clone();
    for (label, material) in field.parts.iter_mut().zip(library.materials()) {
        label.material = material.name.clone();
    }
    let folder = exported(&Model { field: &field, ..model }, &[Format::Mjcf]);
    let text = std::fs::read_to_string(folder.path().join("hammer.xml")).unwrap();
    for label in &field.parts {
        let steel = library.get(&label.material).unwrap().friction_steel.mid();
        assert!(text.contains(&format!("friction=\"{steel} ")), "{}: {steel} is not in {text}", label.material);
    }
    let on_rubber = exported(&super::model(measured), &[Format::Mjcf]);
    assert_ne!(std::fs::read_to_string(on_rubber.path().join("hammer.xml")).unwrap(), text);
}

/// Each part's own where a format has it by collider or material; the least where it has one for the whole body.
#[test]
fn restitutions_are_stated_where_a_format_has_them() {
    let measured = Measured::small();
    let mut field = measured.field.clone();
    for (label, restitution) in field.parts.iter_mut().zip([0.45, 0.25]) {
        label.restitution = Some(Estimate::exactly(restitution));
    }
    let model = Model { field: &field, ..super::model(measured) };
    let folder = exported(&model, &[Format::Sdf, Format::Urdf, Format::Usda]);
    let text = |path: &str| std::fs::read_to_string(folder.path().join(path)).unwrap();
    let (sdf, usd) = (text("hammer.sdf"), text("hammer/usd/hammer.usda"));
    for label in &field.parts {
        let stated = label.restitution.unwrap().mid;
        let bounce = format!("<restitution_coefficient>{stated}</restitution_coefficient><threshold>0.01</threshold>");
        assert!(sdf.contains(&bounce), "{bounce} is not in {sdf}");
        assert!(usd.contains(&format!("float physics:restitution = {stated}\n")), "{stated} is not in {usd}");
    }
    if python_has("restitutions_are_stated_where_a_format_has_them", "pybullet", "pybullet") {
        let found = &super::python("pybullet_check.py", &[&folder.path().join("hammer.urdf")])[0];
        let links = found["links"].as_array().unwrap();
        let of_body = links.iter().find(|link| link["name"] == "hammer").unwrap();
        assert!((of_body["restitution"].as_f64().unwrap() - 0.25).abs() < 1e-6, "{found}");
    }
    // A library that says nothing leaves it to the engine.
    field.parts.iter_mut().for_each(|label| label.restitution = None);
    let silent = exported(&Model { field: &field, ..super::model(measured) }, &[Format::Sdf, Format::Urdf]);
    for file in ["hammer.sdf", "hammer.urdf"] {
        let text = std::fs::read_to_string(silent.path().join(file)).unwrap();
        assert!(!text.contains("restitution"), "{text}");
    }
}
