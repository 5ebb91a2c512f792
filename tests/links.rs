//! Robots and scenes of simulators: their links as objects, and the same file back with what was found.

use std::fs;
use std::path::Path;
use std::process::Output;

use gprop::files::read_scope::ReadScope;
use gprop::links::{Claimed, Found, Link, Links, Prepared};
use gprop::scene::Options;
use gprop::scene::mesh::containers::{self, Container};
use gprop::scene::mesh::{self, Axes, solid};
use gprop::units::Estimate;
use serde_json::Value;

use crate::export;
use crate::run::{for_python, gprop};
use crate::support::python_has;

/// A tetrahedron of 1/6 cubic units.
const CORNER: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

/// Two fingers alike, a mirrored one, and a palm of simple shapes.
const HAND: &str = r#"<?xml version="1.0"?>
<!-- a hand: é -->
<robot name="hand">
  <link name="palm">
    <visual><origin xyz="0 0 0.1" rpy="0 0 0"/><geometry><box size="0.1 0.2 0.05"/></geometry></visual>
    <visual><origin xyz="0 0 -0.2"/><geometry><cylinder radius="0.03" length="0.1"/></geometry></visual>
    <collision><geometry><box size="0.1 0.2 0.4"/></geometry></collision>
  </link>
  <link name="left finger">
	<inertial><origin xyz="0 0 0" rpy="0 0 1.5707963267948966"/><mass value = '0.016' /><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="meshes/finger.obj" scale="0.1 0.1 0.1"/></geometry></visual>
  </link>
  <link name="right finger"><visual><geometry><mesh filename="meshes/finger.obj" scale="0.1 0.1 0.1"/></geometry></visual></link>
  <link name="thumb"><visual><geometry><mesh filename="meshes/finger.obj" scale="-0.1 0.1 0.1"/></geometry></visual></link>
  <joint name="a" type="revolute"><parent link="palm"/><child link="left finger"/><axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="b" type="revolute"><parent link="palm"/><child link="right finger"/><axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="c" type="fixed"><parent link="palm"/><child link="thumb"/></joint>
</robot>
"#;

const CUP: &str = r#"<mujoco model="cup">
  <compiler angle="radian" meshdir="meshes" inertiafromgeom="true" settotalmass="3"/>
  <default><default class="seen"><geom contype="0" conaffinity="0" group="2" mass="0"/></default></default>
  <asset><mesh name="finger" file="finger.obj" scale="0.1 0.1 0.1"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 0.1"/>
    <body name="cup"> <!-- no mass -->
      <freejoint/>
      <geom class="seen" type="mesh" mesh="finger"/>
      <geom type="capsule" size="0.02 0.05" friction="1 0.01 0.002"/>
      <geom type="sphere" size="0.01"/>
    </body>
  </worldbody>
</mujoco>
"#;

/// A folder with a container and its mesh.
fn written(name: &str, text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("meshes")).unwrap();
    fs::write(folder.path().join("meshes/finger.obj"), CORNER).unwrap();
    fs::write(folder.path().join(name), text).unwrap();
    folder
}

fn run(path: &Path, flags: &[&str]) -> Output {
    gprop().arg("run").arg(path).args(flags).output().unwrap()
}

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

fn volume(glb: &Path) -> f64 {
    let mesh = mesh::read(glb, Axes::ZUp, &ReadScope::new(glb.parent().unwrap())).unwrap();
    solid::measure(&mesh.surface).unwrap().volume.mid
}

#[test]
fn python_runs_each_link() {
    let folder = written("hand.urdf", HAND);
    let hand = folder.path().join("hand.urdf");
    let (output, works) = for_python(&hand, &["--to", "scene", "--for-python", "one"]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && error.contains("run each with gprop.run_all"), "{error}");
    assert!(works.is_empty() && !folder.path().join("hand.gprop").exists(), "{works:?}");
    let (_, works) = for_python(&hand, &["--to", "scene", "--render-views", "4", "--for-python", "all"]);
    let each = ["left_finger", "palm", "thumb"];
    let folder_of = |name: &str| folder.path().join("hand.gprop/links").join(name).with_extension("gprop");
    assert_eq!(works, each.map(|name| (name.to_owned(), folder_of(name))));
    assert!(works.iter().all(|(_, work)| work.join("views.json").exists()));
}

#[test]
fn links_that_look_alike_are_one_object() {
    let folder = written("hand.urdf", HAND);
    let output = run(&folder.path().join("hand.urdf"), &["--to", "scene", "--render-views", "4", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let links: Value = serde_json::from_slice(&output.stdout).unwrap();
    let stored: Value =
        serde_json::from_slice(&fs::read(folder.path().join("hand.gprop/links.json")).unwrap()).unwrap();
    assert_eq!(links, stored);
    let objects: Vec<&str> =
        links["links"].as_array().unwrap().iter().map(|link| link["object"].as_str().unwrap()).collect();
    assert_eq!(objects, ["palm", "left_finger", "left_finger", "thumb"]);
    assert_eq!(links["links"][1]["claimed"]["mass_kg"], 0.016);
    assert_eq!(links["links"][2]["claimed"]["mass_kg"], Value::Null);
    let made = folder.path().join("hand.gprop/links");
    for (name, expected) in [
        ("palm.glb", 0.1 * 0.2 * 0.05 + std::f64::consts::PI * 0.03 * 0.03 * 0.1),
        ("left_finger.glb", 1e-3 / 6.0),
        ("thumb.glb", 1e-3 / 6.0),
    ] {
        let volume = volume(&made.join(name));
        // Positions are stored as 32-bit numbers.
        assert!((volume / expected - 1.0).abs() < 1e-5, "{name}: {volume}, not {expected}");
    }
    let palm = mesh::read(&made.join("palm.glb"), Axes::ZUp, &ReadScope::new(&made)).unwrap();
    let heights = palm.surface.vertices.iter().map(|vertex| vertex[2]);
    let [low, high] = [f64::min, f64::max].map(|end| heights.clone().reduce(end).unwrap());
    assert!((low + 0.25).abs() < 1e-6 && (high - 0.125).abs() < 1e-6, "{low} to {high}");
    // Each is a scene of its own.
    assert!(made.join("thumb.gprop/views.json").is_file());
    assert_eq!(fs::read_to_string(folder.path().join("hand.urdf")).unwrap(), HAND);
}

/// What a run would have found of every link.
fn found(container: &Container) -> Links {
    let found = Found {
        volume_m3: Estimate::exactly(1e-3),
        mass_kg: Estimate::new(0.4, 0.5, 0.6),
        center_of_mass_m: [0.01, 0.02, 0.03],
        inertia_kg_m2: [[3e-3, 1e-4, 0.0], [1e-4, 2.5e-3, 0.0], [0.0, 0.0, 1e-3]],
        materials: vec!["oak".to_owned()],
        friction_rubber: 0.7,
    };
    let link = |name: &str| Link {
        name: name.to_owned(),
        object: Some("a".to_owned()),
        claimed: Claimed::default(),
        found: (name != "world").then(|| found.clone()),
    };
    Links { format: container.format.name(), links: container.bodies.iter().map(|body| link(&body.name)).collect() }
}

/// The container with what was found, as text and as gprop reads it, and its folder.
fn filled(name: &str, text: &str) -> (String, Container, tempfile::TempDir) {
    let folder = written(name, text);
    let path = folder.path().join(name);
    let prepared = Prepared::of(&path, None, &Options::default()).unwrap();
    let container = containers::read(&path, &ReadScope::new(folder.path())).unwrap();
    let out = folder.path().join("out");
    let written = prepared.export(&found(&container), &out).unwrap();
    assert_eq!(written.files, [out.join(name), out.join("meshes/finger.obj")]);
    assert!(written.warnings.is_empty(), "{:?}", written.warnings);
    let filled = fs::read_to_string(out.join(name)).unwrap();
    let container = containers::read(&out.join(name), &ReadScope::new(&out)).unwrap();
    assert!(container.problems.is_empty() && container.bodies.iter().all(|body| body.problems.is_empty()));
    (filled, container, folder)
}

fn assert_stated(container: &Container, name: &str) {
    let body = container.bodies.iter().find(|body| body.name == name).unwrap();
    let inertial = body.inertial.as_ref().unwrap_or_else(|| panic!("{name} states nothing"));
    assert_eq!(inertial.mass_kg, Some(0.5), "{name}");
    assert!((inertial.center_m() - nalgebra::Vector3::new(0.01, 0.02, 0.03)).norm() < 1e-9, "{name}");
    let inertia = inertial.inertia_in_body().unwrap();
    let expected = nalgebra::Matrix3::new(3e-3, 1e-4, 0.0, 1e-4, 2.5e-3, 0.0, 0.0, 0.0, 1e-3);
    assert!((inertia - expected).norm() < 1e-9, "{name}: {inertia}");
}

#[test]
fn a_urdf_comes_back_with_its_masses() {
    let (text, container, folder) = filled("hand.urdf", HAND);
    for name in ["palm", "left finger", "right finger", "thumb"] {
        assert_stated(&container, name);
        let body = container.bodies.iter().find(|body| body.name == name).unwrap();
        assert_eq!(body.friction.as_ref().map(|friction| friction.coefficient), Some(0.7), "{name}");
    }
    assert_eq!(container.joints.len(), 3);
    // The comment, the spaces in the tag of the mass and every other line are as they were.
    let start = "<?xml version=\"1.0\"?>\n<!-- a hand: é -->\n";
    assert!(text.starts_with(start) && text.contains("<mass value = '0.5' />"), "{text}");
    for line in HAND.lines().filter(|line| line.contains("<joint") || line.contains("<visual><origin")) {
        assert!(text.contains(line.trim()), "{line}");
    }
    // Its own folder is not written into.
    let prepared = Prepared::of(&folder.path().join("hand.urdf"), None, &Options::default()).unwrap();
    let error = prepared.export(&found(&container), folder.path()).unwrap_err();
    assert!(error.to_string().contains("choose another folder"), "{error}");
    assert_eq!(fs::read_to_string(folder.path().join("hand.urdf")).unwrap(), HAND);
}

#[test]
fn pybullet_and_mujoco_load_what_comes_back() {
    let test = "pybullet_and_mujoco_load_what_comes_back";
    if !python_has(test, "pybullet", "pybullet") || !python_has(test, "mujoco", "mujoco") {
        return;
    }
    let (_, _, folder) = filled("hand.urdf", HAND);
    let found = export::python("pybullet_check.py", &[&folder.path().join("out/hand.urdf")]);
    let links = found[0]["links"].as_array().unwrap();
    // A palm, and three fingers on their joints.
    assert_eq!(links.len(), 4, "{found:?}");
    for link in links {
        assert!((link["mass_kg"].as_f64().unwrap() - 0.5).abs() < 1e-9, "{link}");
        assert!((link["friction"].as_f64().unwrap() - 0.7).abs() < 1e-6, "{link}");
    }
    let (_, _, folder) = filled("cup.xml", CUP);
    let cup = &export::mujoco("load", &[&folder.path().join("out/cup.xml")])[0];
    assert!((cup["mass_kg"].as_f64().unwrap() - 0.5).abs() < 1e-9, "{cup}");
}

#[test]
fn an_mjcf_comes_back_with_its_masses() {
    let (text, container, _folder) = filled("cup.xml", CUP);
    assert_stated(&container, "cup");
    // MuJoCo would take neither the mass of the body nor its own sum otherwise.
    assert!(text.contains("inertiafromgeom=\"auto\" settotalmass=\"-1\""), "{text}");
    assert!(text.contains("friction=\"0.7 0.01 0.002\""), "{text}");
    assert!(text.contains("size=\"0.01\" friction=\"0.7 0.005 0.0001\""), "{text}");
    assert!(text.contains("<!-- no mass -->"), "{text}");
    assert!(text.contains("<geom class=\"seen\" type=\"mesh\" mesh=\"finger\"/>"), "{text}");
    assert!(text.contains("<geom name=\"floor\" type=\"plane\" size=\"1 1 0.1\"/>"), "{text}");
}

#[test]
fn broken_containers_get_one_error_and_nothing_is_written() {
    let link = |geometry: &str| {
        format!("<robot name='a'><link name='b'><visual><geometry>{geometry}</geometry></visual></link></robot>")
    };
    let outside = "<link name='c'><visual><geometry><mesh filename='../../../etc/passwd'/></geometry></visual></link>";
    let both = link("<box size='1 1 1'/>").replace("</robot>", &format!("{outside}</robot>"));
    let many = format!("<robot name='a'>{}</robot>", "<link name='b'/>".repeat(1_000_000));
    let bomb = "<!DOCTYPE robot [<!ENTITY a 'aaaaaaaa'><!ENTITY b '&a;&a;&a;&a;'>]><robot name='&b;'/>";
    let cases = [
        ("outside.urdf", both, "lies outside"),
        ("bomb.urdf", bomb.to_owned(), "defines entities"),
        ("many.urdf", many, "more than 500000 elements"),
        ("none.urdf", "<robot name='a'><link name='b'/></robot>".to_owned(), "has no link with a shape"),
        ("missing.urdf", link("<mesh filename='meshes/none.stl'/>"), "does not exist"),
        ("html.xml", "<html><body/></html>".to_owned(), "its root element is <html>"),
        ("cut.urdf", "<robot name='a'>\n<link>".to_owned(), "line 2: <link> is never closed"),
    ];
    for (name, text, expected) in cases {
        let folder = written(name, &text);
        let output = run(&folder.path().join(name), &[]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{name}: {message}");
        assert!(message.contains(expected) && message.matches("error:").count() == 1, "{name}: {message}");
        let mut expected = vec!["meshes".to_owned(), name.to_owned()];
        expected.sort();
        assert_eq!(names(folder.path()), expected, "{name}");
    }
}
