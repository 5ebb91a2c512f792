//! `gprop audit`: one small input for each kind of finding, what `--fix` changes, hostile inputs, JSON and exit codes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use clap::{Args, FromArgMatches};
use gprop::audit::{self, AuditError, Kind, Report};
use serde_json::Value;
use tempfile::TempDir;

use crate::run::gprop;

/// A folder with files.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let home = TempDir::new().unwrap();
    for (name, text) in files {
        let path = home.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    home
}

pub fn report(paths: &[&Path], flags: &[&str]) -> Result<Report, AuditError> {
    let command = audit::Args::augment_args(clap::Command::new("audit").no_binary_name(true));
    let typed = flags.iter().map(std::ffi::OsString::from).chain(paths.iter().map(Into::into));
    audit::audit(&audit::Args::from_arg_matches(&command.get_matches_from(typed)).unwrap())
}

/// The kinds of the findings about the links of one file, without missing friction unless it is the only one.
fn kinds(text: &str, others: &[(&str, &str)]) -> Vec<Kind> {
    findings(text, others).into_iter().map(|(kind, _, _)| kind).collect()
}

/// Kind, line and text of every finding about one file.
fn findings(text: &str, others: &[(&str, &str)]) -> Vec<(Kind, usize, String)> {
    let name = if text.contains("<mujoco") { "model.xml" } else { "robot.urdf" };
    let home = folder(&[&[(name, text)], others].concat());
    let report = report(&[&home.path().join(name)], &[]).unwrap();
    let file = &report.files[0];
    assert_eq!(file.error, None);
    let of_links = file.links.iter().flat_map(|link| &link.findings);
    file.findings.iter().chain(of_links).map(|finding| (finding.kind, finding.line, finding.text())).collect()
}

/// A URDF with one box of 8 x 8 x 5 cm, with friction.
fn mug(inertial: &str) -> String {
    of_box(inertial, "0.08 0.08 0.05")
}

fn of_box(inertial: &str, size: &str) -> String {
    format!(
        "<robot name=\"r\">\n<link name=\"mug\">\n{inertial}\n\
         <contact><lateral_friction value=\"0.6\"/></contact>\n\
         <visual><geometry><box size=\"{size}\"/></geometry></visual>\n\
         <collision><geometry><box size=\"{size}\"/></geometry></collision>\n</link>\n</robot>\n"
    )
}

fn inertial(mass: f64, moments: [f64; 3], xyz: &str) -> String {
    let [x, y, z] = moments;
    format!(
        "<inertial><origin xyz=\"{xyz}\" rpy=\"0 0 0\"/><mass value=\"{mass}\"/>\
         <inertia ixx=\"{x}\" ixy=\"0\" ixz=\"0\" iyy=\"{y}\" iyz=\"0\" izz=\"{z}\"/></inertial>"
    )
}

/// m (b^2 + c^2) / 12 for the box of [`mug`].
fn right_moments(mass: f64) -> [f64; 3] {
    let across = mass * (0.08f64.powi(2) + 0.05f64.powi(2)) / 12.0;
    [across, across, mass * 2.0 * 0.08f64.powi(2) / 12.0]
}

#[test]
fn what_is_right_has_no_finding() {
    assert_eq!(kinds(&mug(&inertial(0.35, right_moments(0.35), "0 0 0")), &[]), []);
    let mjcf = "<mujoco><worldbody><body name='b'><freejoint/><geom type='box' size='.04 .04 .025' density='600' \
                friction='.5'/></body></worldbody></mujoco>";
    assert_eq!(kinds(mjcf, &[]), []);
}

#[test]
fn a_mass_must_be_there() {
    assert_eq!(kinds(&mug(""), &[]), [Kind::MassMissing]);
    assert_eq!(kinds(&mug("<inertial><mass value='0'/></inertial>"), &[]), [Kind::MassMissing]);
    let found = findings(
        "<mujoco>\n<worldbody>\n<body name='b'><freejoint/><geom size='.1' friction='1'/></body></worldbody></mujoco>",
        &[],
    );
    assert_eq!((found[0].0, found[0].1), (Kind::MassMissing, 3));
    // 4/3 pi 0.1^3 times 1000 kg/m3.
    assert!(found[0].2.contains("density of water, which makes about 4.19 kg"), "{found:?}");
    // Frames, decorations and what is fixed to the world need none.
    let fixed = "<robot><link name='world'/><link name='a'><collision><geometry><sphere radius='1'/></geometry></collision>\
                 </link><joint name='j' type='fixed'><parent link='world'/><child link='a'/></joint><link name='frame'/></robot>";
    assert_eq!(kinds(fixed, &[]), []);
}

#[test]
fn a_density_must_be_that_of_something() {
    for (mass, words) in [
        (0.016, "0.016 kg for 320 cm3 is 50 kg/m3: as light as foam; it would have to be made of"),
        (0.001, "lighter than foam and than everything in the library"),
        (5.0, "5 kg for 320 cm3 is 15,600 kg/m3: heavier than lead; it would have to be made of"),
        (50.0, "heavier than everything in the library (the heaviest, platinum"),
    ] {
        let found = findings(&mug(&inertial(mass, right_moments(mass), "0 0 0")), &[]);
        assert_eq!(found.iter().map(|finding| finding.0).collect::<Vec<_>>(), [Kind::Density], "{found:?}");
        assert!(found[0].2.contains(words) && found[0].1 == 3, "{found:?}");
    }
    // Foam and steel are.
    for mass in [0.02, 2.5] {
        assert_eq!(kinds(&mug(&inertial(mass, right_moments(mass), "0 0 0")), &[]), []);
    }
}

#[test]
fn an_inertia_must_be_possible_and_that_of_the_shape() {
    let [x, y, z] = right_moments(0.35);
    for (moments, kind, words) in [
        ([x, -y, z], Kind::InertiaImpossible, "not positive"),
        ([0.0; 3], Kind::InertiaImpossible, "its inertia is 0"),
        ([x, y, 2.1 * z], Kind::InertiaImpossible, "triangle inequality"),
        ([1e-3; 3], Kind::InertiaPlaceholder, "a placeholder (0.001 kg m2 about every axis), up to"),
        ([1.0; 3], Kind::InertiaPlaceholder, "a placeholder (1 kg m2"),
        // All mass at the corners has three times the second moments of the box, and no mass within it has more.
        ([4.0 * x, 4.01 * y, 4.0 * z], Kind::InertiaImpossible, "no distribution of 0.35 kg within its shape"),
        ([x / 3.2, y / 3.2, z / 3.2], Kind::InertiaOff, "up to 3.2 times too small"),
    ] {
        let found = findings(&mug(&inertial(0.35, moments, "0 0 0")), &[]);
        assert_eq!(found.iter().map(|finding| finding.0).collect::<Vec<_>>(), [kind], "{moments:?}: {found:?}");
        assert!(found[0].2.contains(words) && found[0].1 == 3, "{found:?}");
    }
    // A shell has up to 5/3 times as much, and a dense core less.
    for factor in [0.4, 1.66, 2.5] {
        assert_eq!(kinds(&mug(&inertial(0.35, [x, y, z].map(|moment| moment * factor), "0 0 0")), &[]), [], "{factor}");
    }
    assert_eq!(kinds(&mug("<inertial><mass value='0.35'/></inertial>"), &[]), [Kind::InertiaMissing]);
    // Equal moments that a ball has are no placeholder.
    let ball = "<robot><link name='b'><inertial><mass value='2.5'/><inertia ixx='1e-2' iyy='1e-2' izz='1e-2' ixy='0' ixz='0' \
                iyz='0'/></inertial><visual><geometry><sphere radius='0.1'/></geometry></visual></link></robot>";
    assert_eq!(kinds(ball, &[]), []);
}

#[test]
fn the_centre_must_lie_within_the_shape() {
    let found = findings(&mug(&inertial(0.35, right_moments(0.35), "0 0.06 0")), &[]);
    assert_eq!(found.iter().map(|finding| finding.0).collect::<Vec<_>>(), [Kind::InertiaImpossible, Kind::Center]);
    assert!(found[1].2.contains("lies 2 cm outside of its shape"), "{found:?}");
    assert_eq!(kinds(&mug(&inertial(0.35, right_moments(0.35), "0 0.02 0")), &[]), []);
}

#[test]
fn friction_must_be_stated_and_possible() {
    let right = inertial(0.35, right_moments(0.35), "0 0 0");
    let without = mug(&right).replace("<contact><lateral_friction value=\"0.6\"/></contact>", "");
    assert_eq!(kinds(&without, &[]), [Kind::FrictionMissing]);
    for impossible in ["-0.1", "0", "9"] {
        let found = findings(&mug(&right).replace("\"0.6\"", &format!("\"{impossible}\"")), &[]);
        assert_eq!((found.len(), found[0].0, found[0].1), (1, Kind::FrictionRange, 4), "{found:?}");
    }
}

#[test]
fn colliders_must_be_like_what_is_seen() {
    let right = inertial(0.35, right_moments(0.35), "0 0 0");
    let collider = |size: &str| {
        let mug = mug(&right);
        let at = mug.rfind("0.08 0.08 0.05").unwrap();
        format!("{}{size}{}", &mug[..at], &mug[at + "0.08 0.08 0.05".len()..])
    };
    let found = findings(&collider("0.08 0.08 0.08"), &[]);
    assert_eq!((found.len(), found[0].0, found[0].1), (1, Kind::Collider, 6), "{found:?}");
    assert!(
        found[0].2.contains("the colliders stand out from what is seen by 1.5 cm (18.8 % of its size)"),
        "{found:?}"
    );
    let found = findings(&collider("0.07 0.07 0.02"), &[]);
    assert!(found[0].2.contains("the colliders have 3.27 times less volume"), "{found:?}");
    assert_eq!(kinds(&collider("0.085 0.08 0.05"), &[]), []);
}

/// A box as an OBJ in some unit; `sides` of its twelve triangles.
fn box_obj(half: [f64; 3], sides: usize, is_inside_out: bool) -> String {
    let mut text = String::new();
    for n in 0..8 {
        let at: Vec<String> =
            (0..3).map(|axis| (if n >> axis & 1 == 1 { half[axis] } else { -half[axis] }).to_string()).collect();
        text += &format!("v {}\n", at.join(" "));
    }
    let quads = [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]];
    let triangles = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    for [a, b, c] in triangles.take(sides) {
        text += &if is_inside_out { format!("f {a} {c} {b}\n") } else { format!("f {a} {b} {c}\n") };
    }
    text
}

/// A URDF of a mesh, with the mass of the box of [`mug`].
fn of_mesh(attributes: &str) -> String {
    let shape = format!("<geometry><mesh {attributes}/></geometry>");
    format!(
        "<robot>\n<link name='a'>{}<contact><lateral_friction value='1'/></contact>\n<visual>{shape}</visual>\n\
         <collision>{shape}</collision></link></robot>",
        inertial(0.35, right_moments(0.35), "0 0 0")
    )
}

#[test]
fn millimetres_are_told_from_metres() {
    let in_mm = box_obj([40.0, 40.0, 25.0], 12, false);
    let found = findings(&of_mesh("filename='box.obj'"), &[("box.obj", &in_mm)]);
    assert_eq!((found.len(), found[0].0, found[0].1), (1, Kind::Units, 3), "{found:?}");
    assert!(
        found[0].2.contains("its longest side is 80 m; in mm it would be 8 cm; give the mesh a scale of 0.001"),
        "{found:?}"
    );
    assert_eq!(kinds(&of_mesh("filename='box.obj' scale='.001 .001 .001'"), &[("box.obj", &in_mm)]), []);
    let found = findings(&of_mesh("filename='box.obj' scale='1e-6 1e-6 1e-6'"), &[("box.obj", &in_mm)]);
    assert!(found[0].0 == Kind::Units && found[0].2.contains("leave out the scale"), "{found:?}");
}

#[test]
fn meshes_must_be_closed_and_face_outward() {
    let half = [0.04, 0.04, 0.025];
    let findings_with = |mesh: &str| findings(&of_mesh("filename='box.obj'"), &[("box.obj", mesh)]);
    assert_eq!(findings_with(&box_obj(half, 12, false)), []);
    let open = findings_with(&box_obj(half, 10, false));
    assert!(open[0].0 == Kind::Surface && open[0].2.contains("is open (4 edges have only one triangle)"), "{open:?}");
    let inverted = findings_with(&box_obj(half, 12, true));
    assert!(inverted.len() == 1 && inverted[0].2.contains("is turned inside out"), "{inverted:?}");
    let fin = box_obj(half, 12, false) + "v 0 0 1\nf 1 2 9\n";
    assert!(findings_with(&fin).iter().any(|finding| finding.2.contains("1 edge of more than two triangles")));
}

#[test]
fn meshes_are_read_only_from_named_folders() {
    let mesh = box_obj([0.04, 0.04, 0.025], 12, false);
    let home = folder(&[("robots/a.urdf", &of_mesh("filename='../meshes/box.obj'")), ("meshes/box.obj", &mesh)]);
    let (robot, meshes) = (home.path().join("robots/a.urdf"), home.path().join("meshes"));
    let alone = report(&[&robot], &[]).unwrap();
    let finding = &alone.files[0].links[0].findings[0];
    assert!(finding.kind == Kind::Mesh && finding.text().contains("lies outside of the folders that you named"));
    let report = report(&[&robot, &meshes], &[]).unwrap();
    assert_eq!((report.problems(), report.files.len()), (0, 1));
    let missing = findings(&of_mesh("filename='none.obj'"), &[]);
    assert!(missing[0].0 == Kind::Mesh && missing[0].2.contains("does not exist"), "{missing:?}");
    let broken = findings(&of_mesh("filename='box.obj'"), &[("box.obj", "v 1 2 3\nf 1 2 3\n")]);
    assert_eq!(broken[0].0, Kind::Mesh, "{broken:?}");
}

#[test]
fn fix_writes_what_follows_and_leaves_every_other_byte() {
    let before = "<?xml version='1.0'?>\r\n<!-- caf\u{e9} -->\r\n<robot name='r' >\r\n  <link name=\"mug\">\r\n    <inertial>\r\n\
                  \x20     <mass value=\"0.35\" />\r\n      <inertia ixx='1e-3' ixy='0' ixz='0' iyy='1e-3' iyz='0' izz='1e-3'/>\r\n\
                  \x20   </inertial><contact><lateral_friction value='0.6'/></contact>\r\n\
                  <visual><origin xyz='0 0 0.1'/><geometry><box size=\"0.08 0.08 0.05\"/></geometry></visual>\r\n  </link>\r\n</robot>";
    let home = folder(&[("a/mug.urdf", before)]);
    let report = report(&[home.path()], &["--fix"]).unwrap();
    let [x, _, z] = right_moments(0.35);
    let nine = |value: f64| format!("{value:.8e}").parse::<f64>().unwrap().to_string();
    let expected = before
        .replace("ixx='1e-3'", &format!("ixx='{}'", nine(x)))
        .replace("iyy='1e-3'", &format!("iyy='{}'", nine(x)))
        .replace("izz='1e-3'", &format!("izz='{}'", nine(z)))
        .replace("      <mass", "      <origin xyz=\"0 0 0.1\" rpy=\"0 0 0\"/>\r\n      <mass");
    assert_eq!(fs::read_to_string(home.path().join("a/mug.urdf")).unwrap(), expected);
    assert_eq!((report.problems(), report.files[0].fixed.len()), (0, 1));
    assert!(report.files[0].fixed[0].contains("mug: inertia and centre of mass of its shape"));
}

#[test]
fn fix_turns_an_inertia_into_the_axes_that_mjcf_states_it_in() {
    let model = |inertia: &str| {
        format!(
            "<mujoco><worldbody><body name='b'><freejoint/><inertial pos='0 0 0' mass='20' {inertia}/>\n\
             <geom type='box' size='.1 .2 .3' euler='0 0 30' friction='1'/></body></worldbody></mujoco>"
        )
    };
    for inertia in ["diaginertia='1 1 1'", "diaginertia='1 1 1' axisangle='0 0 1 5'", "fullinertia='1 1 1 0 0 0'"] {
        let home = folder(&[("m.xml", &model(inertia))]);
        let path = home.path().join("m.xml");
        assert_eq!(report(&[&path], &[]).unwrap().problems(), 1);
        assert_eq!(report(&[&path], &["--fix"]).unwrap().problems(), 0, "{inertia}");
        // m (a^2 + b^2) / 3 with half sides, about the box's own axes.
        let text = fs::read_to_string(&path).unwrap();
        let moments: Vec<f64> = text
            .split("inertia='")
            .nth(1)
            .unwrap()
            .split('\'')
            .next()
            .unwrap()
            .split(' ')
            .map(|n| n.parse().unwrap())
            .collect();
        let sum: f64 = moments[..3].iter().sum();
        assert!((sum - 20.0 * 2.0 * (0.01 + 0.04 + 0.09) / 3.0).abs() < 1e-6, "{text}");
        assert!(text.ends_with("friction='1'/></body></worldbody></mujoco>"));
    }
}

#[cfg(unix)]
#[test]
fn fix_writes_through_no_link() {
    let text = mug(&inertial(0.35, [1e-3; 3], "0 0 0"));
    let home = folder(&[("real/mug.urdf", &text), ("named/readme.txt", "")]);
    let link = home.path().join("named/mug.urdf");
    std::os::unix::fs::symlink(home.path().join("real/mug.urdf"), &link).unwrap();
    let report = report(&[&link], &["--fix"]).unwrap_or_else(|error| panic!("{error}"));
    assert!(report.files[0].fixed.iter().all(|text| text.starts_with("not ")));
    assert_eq!(fs::read_to_string(home.path().join("real/mug.urdf")).unwrap(), text);
    assert!(link.is_symlink());
}

#[test]
fn hostile_files_have_one_clear_error_and_the_others_go_on() {
    let links: String = (0..300_000).map(|n| format!("<link name='l{n}'/><x/>")).collect();
    let hostile = [
        (
            "a.urdf",
            "<!DOCTYPE r [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;&a;'>]><robot name='&b;'/>".to_owned(),
            "defines entities",
        ),
        ("b.urdf", format!("<robot>{links}</robot>"), "more than 500000 elements"),
        ("c.urdf", format!("<robot>{}", "<link name='a'>".repeat(100_000)), "256 deep"),
        ("d.urdf", "<robot><link>".to_owned(), "never closed"),
        ("e.xml", "<mujoco><include file='e.xml'/></mujoco>".to_owned(), "includes itself"),
        ("f.xml", "<mujoco><include file='/etc/passwd'/></mujoco>".to_owned(), "outside"),
    ];
    let mut files: Vec<(&str, &str)> = hostile.iter().map(|(name, text, _)| (*name, text.as_str())).collect();
    files.push(("g/part.xml", "<mujocoinclude/>"));
    files.push(("g/notes.xml", "<html/>"));
    let right = mug(&inertial(0.35, right_moments(0.35), "0 0 0"));
    files.push(("z.urdf", &right));
    let home = folder(&files);
    let report = report(&[home.path()], &[]).unwrap();
    assert_eq!(report.files.len(), hostile.len() + 1, "parts and other XML in a folder are no containers");
    for (file, (name, _, words)) in report.files.iter().zip(&hostile) {
        let error = file.error.as_ref().unwrap();
        assert!(file.path.ends_with(name) && error.contains(words), "{error}");
    }
    assert!(report.files.last().unwrap().error.is_none());
    assert!(matches!(report.require_sound(), Err(AuditError::Unreadable { .. })));
}

fn run(arguments: &[&str], paths: &[PathBuf]) -> Output {
    gprop().arg("audit").args(arguments).args(paths).output().unwrap()
}

#[test]
fn the_program_prints_json_and_ends_with_the_code_that_fits() {
    let home = folder(&[
        ("right.urdf", &mug(&inertial(0.35, right_moments(0.35), "0 0 0"))),
        ("wrong.urdf", &mug(&inertial(0.016, right_moments(0.016), "0 0 0"))),
        ("broken.urdf", "<robot>"),
    ]);
    let path = |name: &str| home.path().join(name);
    let codes = [
        (vec![path("right.urdf")], 0),
        (vec![path("wrong.urdf")], 1),
        (vec![path("right.urdf"), path("wrong.urdf")], 1),
        (vec![path("broken.urdf"), path("wrong.urdf")], 3),
        (vec![path("nowhere.urdf")], 3),
        (vec![], 2),
    ];
    for (paths, code) in codes {
        let output = run(&[], &paths);
        assert_eq!(output.status.code(), Some(code), "{paths:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let output = run(&["--json"], &[path("wrong.urdf")]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let link = &json["files"][0]["links"][0];
    assert!(json["files"][0]["path"].as_str().unwrap().ends_with("wrong.urdf"));
    assert_eq!((link["name"].as_str(), link["mass_kg"].as_f64()), (Some("mug"), Some(0.016)));
    assert!((link["volume_m3"].as_f64().unwrap() - 3.2e-4).abs() < 1e-12);
    assert!((link["density_kg_m3"].as_f64().unwrap() - 50.0).abs() < 1e-9);
    assert!(link["problems"][0].as_str().unwrap().contains("as light as foam"));
    assert_eq!(
        (link["findings"][0]["kind"].as_str(), link["findings"][0]["line"].as_u64()),
        (Some("density"), Some(3))
    );
    let text = String::from_utf8(run(&[], &[path("wrong.urdf")]).stdout).unwrap();
    assert!(text.contains("wrong.urdf:3: mug: 0.016 kg for 320 cm3 is 50 kg/m3"), "{text}");
    assert_eq!(run(&["--ignore", "density,friction-missing"], &[path("wrong.urdf")]).status.code(), Some(0));
}

#[test]
fn threads_change_nothing_and_meshes_are_read_once_for_all_links() {
    let mesh = box_obj([0.04, 0.04, 0.025], 12, false);
    let link =
        |n: usize| format!("<link name='l{n}'><visual><geometry><mesh filename='box.obj'/></geometry></visual></link>");
    let many: String = (0..200).map(link).collect();
    let robot = format!("<robot>{many}</robot>");
    let home = folder(&[("box.obj", &mesh), ("a.urdf", &robot), ("b.urdf", &robot)]);
    let audit_on = |threads: &str| run(&["--json", "--threads", threads], &[home.path().to_owned()]).stdout;
    assert_eq!(audit_on("1"), audit_on("4"));
}

#[test]
fn a_folder_without_containers_is_an_error() {
    let home = folder(&[("notes.xml", "<html/>"), ("a.txt", "")]);
    assert!(matches!(report(&[home.path()], &[]), Err(AuditError::NoContainers { .. })));
}

/// A glTF with a box of 8 x 8 x 5 cm in a node that moves with this motion, above a node with this collider.
fn gltf(motion: &str, collider: &str) -> String {
    let sides = (0..8_u8).flat_map(|n| [n & 1, n >> 1 & 1, n >> 2].into_iter().zip([0.08_f32, 0.08, 0.05]));
    let corners: Vec<u8> = sides.flat_map(|(side, length)| ((f32::from(side) - 0.5) * length).to_le_bytes()).collect();
    let faces: [[u8; 3]; 12] = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    let bytes = [corners, faces.concat()].concat();
    let uri = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &bytes);
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_physics_rigid_bodies", "KHR_implicit_shapes"],
"extensions": {{
  "KHR_implicit_shapes": {{"shapes": [{{"type": "box", "box": {{"size": [0.08, 0.08, 0.05]}}}}, {{"type": "sphere", "sphere": {{"radius": 0.2}}}}]}},
  "KHR_physics_rigid_bodies": {{"physicsMaterials": [{{"staticFriction": 0.6, "dynamicFriction": 0.5}}, {{"staticFriction": 60}}]}}
}},
"scenes": [{{"nodes": [0]}}],
"nodes": [
  {{"name": "mug", "mesh": 0, "translation": [1, 2, 3], "rotation": [0, 0.6, 0, 0.8], "children": [1],
    "extensions": {{"KHR_physics_rigid_bodies": {{"motion": {motion}}}}}}},
  {{"extensions": {{"KHR_physics_rigid_bodies": {{"collider": {collider}}}}}}}
],
"meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}}]}}],
"accessors": [{{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"}}, {{"bufferView": 1, "componentType": 5121, "count": 36, "type": "SCALAR"}}],
"bufferViews": [{{"buffer": 0, "byteLength": 96}}, {{"buffer": 0, "byteOffset": 96, "byteLength": 36}}],
"buffers": [{{"byteLength": 132, "uri": "data:application/octet-stream;base64,{uri}"}}]}}"#
    )
}

const BOX: &str = r#"{"geometry": {"shape": 0}, "physicsMaterial": 0}"#;

/// The text of the motion that a box of this mass has.
fn motion(mass: f64, center: [f64; 3]) -> String {
    format!(r#"{{"mass": {mass}, "centerOfMass": {center:?}, "inertiaDiagonal": {:?}}}"#, right_moments(mass))
}

/// Kind and line of what is wrong with a file of this name.
fn kinds_of(name: &str, text: &str) -> Vec<(Kind, usize)> {
    let home = folder(&[(name, text)]);
    let report = report(&[home.path()], &[]).unwrap();
    let file = &report.files[0];
    assert_eq!(file.error, None);
    println!("{}", report.text());
    let of_links = file.links.iter().flat_map(|link| &link.findings);
    file.findings.iter().chain(of_links).map(|finding| (finding.kind, finding.line)).collect()
}

#[test]
fn physics_of_a_gltf_are_judged() {
    assert_eq!(kinds_of("mug.gltf", &gltf(&motion(0.35, [0.0; 3]), BOX)), []);
    // An engine makes up what is left out.
    assert_eq!(kinds_of("mug.gltf", &gltf(r#"{"mass": 0.35}"#, BOX)), []);
    assert_eq!(kinds_of("mug.gltf", &gltf("{}", BOX)), [(Kind::MassMissing, 8)]);
    assert_eq!(kinds_of("mug.gltf", &gltf(r#"{"mass": 0}"#, BOX)), [(Kind::MassMissing, 8)]);
    assert_eq!(kinds_of("mug.gltf", &gltf(r#"{"mass": 0.005}"#, BOX)), [(Kind::Density, 8)]);
    // No mass within the box has its centre there.
    let outside = kinds_of("mug.gltf", &gltf(&motion(0.35, [0.0, 0.1, 0.0]), BOX));
    assert_eq!(outside, [(Kind::InertiaImpossible, 8), (Kind::Center, 8)]);
    let placeholder = r#"{"mass": 0.35, "inertiaDiagonal": [0.001, 0.001, 0.001]}"#;
    assert_eq!(kinds_of("mug.gltf", &gltf(placeholder, BOX)), [(Kind::InertiaPlaceholder, 8)]);
    let large = r#"{"geometry": {"shape": 1}, "physicsMaterial": 1}"#;
    let found = kinds_of("mug.gltf", &gltf(&motion(0.35, [0.0; 3]), large));
    assert_eq!(found, [(Kind::FrictionRange, 10), (Kind::Collider, 10)]);
    // The draft names a mesh; before 2026, it named a node.
    for named in ["mesh", "node"] {
        let bare = format!(r#"{{"geometry": {{"{named}": 0, "convexHull": true}}}}"#);
        assert_eq!(kinds_of("mug.gltf", &gltf(&motion(0.35, [0.0; 3]), &bare)), [(Kind::FrictionMissing, 8)]);
    }
}

#[test]
fn fix_states_the_inertia_of_a_gltf_in_the_frame_of_its_node() {
    let text = gltf(r#"{"mass": 0.35, "inertiaDiagonal": [1, 1, 9], "linearVelocity": [1, 0, 0]}"#, BOX);
    let home = folder(&[("mug.gltf", &text)]);
    let path = home.path().join("mug.gltf");
    let fixed = report(&[&path], &["--fix"]).unwrap();
    assert!(fixed.require_sound().is_ok(), "{}", fixed.text());
    let after: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let motion = &after["nodes"][0]["extensions"]["KHR_physics_rigid_bodies"]["motion"];
    let mut moments: Vec<f64> = serde_json::from_value(motion["inertiaDiagonal"].clone()).unwrap();
    moments.sort_by(f64::total_cmp);
    let [x, y, z] = right_moments(0.35);
    assert!(
        moments.iter().zip([x, y, z]).all(|(found, expected)| (found / expected - 1.0).abs() < 1e-6),
        "{moments:?}"
    );
    // All else is as it was.
    let unchanged = fs::read_to_string(&path).unwrap();
    let (before, behind) = text.split_once("[1, 1, 9]").unwrap();
    assert!(unchanged.starts_with(before) && unchanged.contains(behind.split_once('}').unwrap().1), "{unchanged}");
}

/// A USD with a box of 8 x 8 x 5 cm in cm, as a mesh that collides, with these attributes of its mass.
fn usda(attributes: &str, material: &str) -> String {
    format!(
        r#"#usda 1.0
(
    defaultPrim = "mug"
    metersPerUnit = 0.01
    upAxis = "Z"
)

def Xform "mug" (
    prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    doc = """A "mug" ) of """
)
{{
    {attributes}
    double3 xformOp:translate = (1, 2, 3)
    quatf xformOp:orient = (0.8, 0, 0.6, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]

    # The body }} itself.
    def Mesh "body" (
        prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMeshCollisionAPI", "MaterialBindingAPI"]
    )
    {{
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
        point3f[] points = [(-4, -4, -2.5), (4, -4, -2.5), (-4, 4, -2.5), (4, 4, -2.5), (-4, -4, 2.5), (4, -4, 2.5), (-4, 4, 2.5), (4, 4, 2.5)] (
            interpolation = "vertex"
        )
        texCoord2f[] primvars:st.timeSamples = {{ 0: [(0, 0)], 1: [(1, 1)] }}
        uniform token physics:approximation = "convexHull"
        rel material:binding:physics = </mug/glazed>
    }}

    def Material "glazed" (
        prepend apiSchemas = ["PhysicsMaterialAPI"]
    )
    {{
        {material}
        token outputs:surface.connect = </mug/glazed/surface.outputs:surface>
    }}
}}
"#
    )
}

#[test]
fn physics_of_a_usd_are_judged() {
    let stated = |mass: f64, center: &str, moments: [f64; 3]| {
        let [x, y, z] = moments.map(|moment| moment * 1e4);
        format!(
            "float physics:mass = {mass}\n    point3f physics:centerOfMass = {center}\n    float3 physics:diagonalInertia = ({x}, {y}, {z})\n    \
             quatf physics:principalAxes = (1, 0, 0, 0)"
        )
    };
    let friction = "float physics:staticFriction = 0.6";
    let right = stated(0.35, "(0, 0, 0)", right_moments(0.35));
    assert_eq!(kinds_of("mug.usda", &usda(&right, friction)), []);
    assert_eq!(kinds_of("mug.usda", &usda("float physics:mass = 0.35", friction)), []);
    // What states no mass has the density of its material, or else of water.
    assert_eq!(kinds_of("mug.usda", &usda("", friction)), [(Kind::MassMissing, 8)]);
    assert_eq!(kinds_of("mug.usda", &usda("", &format!("{friction}\n        float physics:density = 0.0024"))), []);
    assert_eq!(kinds_of("mug.usda", &usda("float physics:mass = 0.005", friction)), [(Kind::Density, 8)]);
    let off = stated(0.35, "(0, 9, 0)", right_moments(0.35));
    assert_eq!(kinds_of("mug.usda", &usda(&off, friction)), [(Kind::InertiaImpossible, 8), (Kind::Center, 8)]);
    let impossible = stated(0.35, "(0, 0, 0)", [1e-4, 1e-4, 1e-3]);
    assert_eq!(kinds_of("mug.usda", &usda(&impossible, friction)), [(Kind::InertiaImpossible, 8)]);
    assert_eq!(kinds_of("mug.usda", &usda(&right, "")), [(Kind::FrictionMissing, 8)]);
    // Metres instead of centimetres.
    let large = usda(&right, friction).replace("metersPerUnit = 0.01", "metersPerUnit = 1");
    assert_eq!(kinds_of("mug.usda", &large)[0].0, Kind::Units);
    // The volume is that of the box: 320 cm3.
    let home = folder(&[("mug.usda", &usda(&right, friction))]);
    let volume = report(&[home.path()], &[]).unwrap().files[0].links[0].volume_m3.unwrap();
    assert!((volume / 3.2e-4 - 1.0).abs() < 1e-9, "{volume}");
}

#[test]
fn a_usd_or_gltf_that_is_broken_has_one_error_with_its_place() {
    let deep = format!("#usda 1.0\n{}", "def Xform \"a\" {\n".repeat(10_000));
    let out_of_range = usda("float physics:mass = 1", "").replace("[0, 2, 3, 1,", "[0, 2, 3, 99,");
    for (name, text, expected) in [
        ("a.usda", "#usda 1.0\ndef Xform \"a\"\n{".to_owned(), "line 3"),
        ("b.usda", deep, "nested too deep"),
        ("c.usda", "#usda 1.0\n(\n  doc = \"\n".to_owned(), "ends within quotes"),
        ("d.gltf", gltf("{\"mass\": 1}", BOX).replace("\"count\": 36", "\"count\": 3600"), "beyond the end"),
    ] {
        let home = folder(&[(name, &text)]);
        let report = report(&[home.path()], &[]).unwrap();
        let error = report.files[0].error.as_ref().unwrap();
        assert!(error.contains(expected), "{error}");
    }
    let found = kinds_of("e.usda", &out_of_range);
    assert!(found.contains(&(Kind::Invalid, 19)), "{found:?}");
    // What has no physics is passed over in a folder, and an error if it is named.
    let plain = gltf("{}", "{}").replace("motion", "nothing");
    let home = folder(&[("plain.gltf", &plain), ("broken.glb", "glTF"), ("mug.urdf", &mug(""))]);
    assert_eq!(report(&[home.path()], &[]).unwrap().files.len(), 1);
    let named = report(&[&home.path().join("plain.gltf")], &[]).unwrap();
    assert!(named.files[0].error.as_ref().unwrap().contains("no node of it moves"), "{:?}", named.files[0].error);
}
