//! `--links parts`, `--pad-geom` and the names of things.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use gprop::export::{Format, Links, Model, Origin, export};
use gprop::gaussians::Gaussians;
use gprop::parts::Parts;
use gprop::scene::splat::ply;
use gprop::units::Estimate;
use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{Rigid, assert_same_body, listed, mujoco, numbers, python};
use crate::grasp::scenes::Measured;
use crate::run::gprop;
use crate::support::{changed, python_has, shared_folder};

const FORMATS: [Format; 4] = [Format::Mjcf, Format::Urdf, Format::Sdf, Format::Usda];

/// The hammer with a link for each part, written once for all tests. The sleeve is filled with something, and all of it is believed to
/// be half as heavy again as its parts and the filling together.
struct Linked {
    out: PathBuf,
    parts: Parts,
}

const FILLING_KG: f64 = 0.1;
const BELIEVED: f64 = 1.5;

impl Linked {
    fn get() -> &'static Self {
        static LINKED: OnceLock<Linked> = OnceLock::new();
        LINKED.get_or_init(|| {
            let (measured, out) = (Measured::small(), shared_folder("export/links"));
            let mut parts = measured.parts().clone();
            let first = parts.parts[0].clone();
            let filling = json!({
                "inside_of": first.id,
                "caption": "sand",
                "filling": "sand",
                "unseen": true,
                "share_of_hollow": Estimate::exactly(1.0),
                "volume_m3": Estimate::exactly(1e-5),
                "density_kg_m3": Estimate::exactly(1e4),
                "mass_kg": Estimate::exactly(FILLING_KG),
                "width": [],
                "center_of_mass_m": first.center_of_mass_m,
                "inertia_kg_m2": [[1e-5, 0.0, 0.0], [0.0, 1e-5, 0.0], [0.0, 0.0, 1e-5]],
            });
            parts.fillings.push(serde_json::from_value(filling).unwrap());
            let object = &mut parts.object;
            object.mass_kg = Estimate::exactly((object.mass_kg.mid + FILLING_KG) * BELIEVED);
            let model = Model { links: Links::Parts, parts: Some(&parts), ..super::model(measured) };
            export(&model, &FORMATS, &out).unwrap();
            Self { out, parts }
        })
    }
}

/// The texts between two marks.
fn between(text: &str, before: &str) -> Vec<String> {
    text.split(before).skip(1).map(|rest| rest.split('"').next().unwrap().to_owned()).collect()
}

#[test]
fn links_together_are_the_one_body() {
    if !python_has("links_together_are_the_one_body", "mujoco", "mujoco") {
        return;
    }
    let Linked { out, parts } = Linked::get();
    let file = out.join("hammer.xml");
    let found = &listed(mujoco("whole", &[&file]))[0];
    println!("{found}");
    // All bodies, by the parallel axis theorem.
    let bodies: Vec<(f64, Vector3<f64>, Matrix3<f64>)> = parts
        .whole_parts()
        .map(|part| (part.mass_kg.unwrap().mid, part.center_of_mass_m.unwrap(), part.inertia_kg_m2.unwrap()))
        .chain(
            parts.fillings.iter().map(|filling| (filling.mass_kg.mid, filling.center_of_mass_m, filling.inertia_kg_m2)),
        )
        .map(|(mass, center, inertia)| (mass, center.into(), Matrix3::from_fn(|row, column| inertia[row][column])))
        .collect();
    let mass: f64 = bodies.iter().map(|(mass, ..)| mass).sum();
    let center = bodies.iter().map(|(mass, center, _)| center * *mass).sum::<Vector3<f64>>() / mass;
    let about_center = |(mass, at, inertia): &(f64, Vector3<f64>, Matrix3<f64>)| {
        let offset = at - center;
        inertia + (Matrix3::identity() * offset.norm_squared() - offset * offset.transpose()) * *mass
    };
    let inertia = bodies.iter().map(about_center).sum::<Matrix3<f64>>() * BELIEVED;
    let rows = std::array::from_fn(|row| std::array::from_fn(|column| inertia[(row, column)]));
    let object = changed(parts.object.clone(), |object| {
        (object.center_of_mass_m, object.inertia_kg_m2) = (center.into(), rows);
    });
    assert_same_body(found, &object, 1e-6);
    assert_eq!(found["bodies"].as_array().unwrap().len(), parts.whole_parts().count());
    assert_eq!((&found["free_joints"], &found["joints"]), (&json!(1), &json!(1)));
    let rested = &listed(mujoco("rest", &[&file]))[0];
    assert!(rested["moved_m"].as_f64().unwrap() < 0.002, "{rested}");
}

#[test]
fn a_filling_belongs_to_the_link_of_its_shell() {
    let Linked { out, parts } = Linked::get();
    let urdf = fs::read_to_string(out.join("hammer.urdf")).unwrap();
    let shell = &parts.parts[0];
    let masses: Vec<f64> = between(&urdf, "<mass value=\"").iter().map(|mass| mass.parse().unwrap()).collect();
    let expected = (shell.mass_kg.unwrap().mid + FILLING_KG) * BELIEVED;
    assert!(masses.iter().any(|mass| (mass / expected - 1.0).abs() < 1e-9), "{masses:?}: {expected}");
    assert!((masses.iter().sum::<f64>() / parts.object.mass_kg.mid - 1.0).abs() < 1e-9, "{masses:?}");
}

#[test]
fn pybullet_loads_the_links_with_the_same_mass() {
    if !python_has("pybullet_loads_the_links_with_the_same_mass", "pybullet", "pybullet") {
        return;
    }
    let Linked { out, parts } = Linked::get();
    let found = python("pybullet_check.py", &[&out.join("hammer.urdf"), &out.join("hammer.sdf")]);
    let links = listed(found[0]["links"].clone());
    let mass: f64 = links.iter().map(|link| link["mass_kg"].as_f64().unwrap()).sum();
    assert!((mass / parts.object.mass_kg.mid - 1.0).abs() < 1e-6, "{links:?}");
    assert_eq!(links.len(), parts.whole_parts().count(), "{links:?}");
    for link in &links {
        assert_eq!(link["shown"].as_array().unwrap().len(), 1, "{link}");
        assert!(link["colliders"].as_u64().unwrap() > 0, "{link}");
    }
    // As free as one body.
    assert!(found[0]["falls_m"].as_f64().unwrap() > 1.0, "{}", found[0]);
    // Its base is the head, and the others are fixed to it.
    assert_eq!(listed(found[1]["bodies"].clone()).len(), 1, "{}", found[1]);
}

#[test]
fn usd_fixes_the_links_to_each_other() {
    if !python_has("usd_fixes_the_links_to_each_other", "usd-core", "pxr.UsdValidation") {
        return;
    }
    let (measured, Linked { out, parts }) = (Measured::small(), Linked::get());
    let script = r#"
import json, sys
from pxr import Usd, UsdPhysics, UsdValidation
stage = Usd.Stage.Open(sys.argv[1])
bodies = [p for p in stage.Traverse() if p.HasAPI(UsdPhysics.RigidBodyAPI)]
joints = [UsdPhysics.FixedJoint(p) for p in stage.Traverse() if p.IsA(UsdPhysics.FixedJoint)]
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
errors = UsdValidation.ValidationContext(validators).Validate(stage)
print(json.dumps({
    "masses": [UsdPhysics.MassAPI(p).GetMassAttr().Get() for p in bodies],
    "names": [p.GetName() for p in bodies],
    "fixed": [[str(t) for t in j.GetBody0Rel().GetTargets() + j.GetBody1Rel().GetTargets()] for j in joints],
    "gaussians": sum(len(p.GetAttribute("positions").Get()) for p in stage.Traverse() if p.GetTypeName() == "ParticleField3DGaussianSplat"),
    "errors": [e.GetMessage() for e in errors if e.GetType() == UsdValidation.ValidationErrorType.Error],
}))"#;
    let file = out.join("hammer/usd/hammer.usda");
    let output = Command::new("python3").arg("-c").arg(script).arg(&file).output().unwrap();
    let found: Value = crate::support::parsed(output);
    println!("{found}");
    let mass: f64 = numbers(&found["masses"]).iter().sum();
    // USD keeps masses in 32 bits.
    assert!((mass / parts.object.mass_kg.mid - 1.0).abs() < 1e-6, "{found}");
    let count = parts.whole_parts().count();
    assert_eq!(
        (found["names"].as_array().unwrap().len(), found["fixed"].as_array().unwrap().len()),
        (count, count - 1)
    );
    assert_eq!(found["gaussians"], measured.scene.gaussians.len());
    assert_eq!(found["errors"], json!([]));
}

/// Bodies, links, geoms and prims of a thing have one name.
#[test]
fn names_are_the_same_in_every_format() {
    let Linked { out, parts } = Linked::get();
    let read = |file: &str| fs::read_to_string(out.join(file)).unwrap();
    let sorted = |names: Vec<String>| names.into_iter().collect::<BTreeSet<_>>();
    let (mjcf, urdf, sdf, usd) =
        (read("hammer.xml"), read("hammer.urdf"), read("hammer.sdf"), read("hammer/usd/hammer.usda"));
    let links = sorted(between(&mjcf, "<body name=\""));
    assert_eq!(links.len(), parts.whole_parts().count());
    assert!(links.iter().all(|name| name.starts_with("hammer__")), "{links:?}");
    assert_eq!(sorted(between(&urdf, "<link name=\"")), links);
    assert_eq!(sorted(between(&sdf, "<link name=\"")), links);
    let prims = sorted(between(&usd, "def Xform \""));
    assert_eq!(prims.difference(&links).collect::<Vec<_>>(), ["hammer"]);
    assert_eq!(sorted(between(&usd, "def Material \"")).difference(&links).collect::<Vec<_>>(), ["splat"]);
    let colliders = sorted(between(&urdf, "<collision name=\""));
    assert!(
        colliders.iter().all(|name| links.iter().any(|link| name.starts_with(&format!("{link}_")))),
        "{colliders:?}"
    );
    assert_eq!(sorted(between(&sdf, "<collision name=\"")), colliders);
    let geoms = sorted(between(&mjcf, "<geom name=\""));
    assert!(colliders.is_subset(&geoms) && geoms.len() == colliders.len() + links.len(), "{geoms:?}");
    assert!(colliders.is_subset(&sorted(between(&usd, "def Mesh \""))));
    let glb = Rigid::small();
    let nodes = |ending: &str| {
        let bytes = fs::read(glb.file(ending)).unwrap();
        sorted(between(&String::from_utf8_lossy(&bytes), "\"name\":\""))
    };
    let mut others: BTreeSet<String> = nodes(".glb").difference(&links).cloned().collect();
    assert!(others.remove("hammer") && others == colliders, "{others:?}");
    assert!(nodes("_colliders.glb").is_superset(&colliders));
}

/// With pads that have a friction of 1, the contact's is that of the pair.
#[test]
fn the_pairs_of_pads_are_what_mujoco_uses() {
    if !python_has("the_pairs_of_pads_are_what_mujoco_uses", "mujoco", "mujoco") {
        return;
    }
    let (measured, out) = (Measured::small(), TempDir::new().unwrap());
    let pads = ["left_pad", "right_pad"].map(str::to_owned);
    let model = Model { pad_geoms: &pads, ..super::model(measured) };
    export(&model, &[Format::Mjcf], out.path()).unwrap();
    let [file, of_pads] = ["hammer.xml", "hammer_pads.xml"].map(|name| out.path().join(name));
    let found = mujoco("pads", &[&file, &of_pads]);
    println!("{found}");
    let own: BTreeSet<String> =
        measured.field.parts.iter().map(|label| label.friction_rubber.mid.to_string()).collect();
    let friction = |contact: &Value| numbers(&contact["friction"]);
    let of_geoms = |contacts: &Value| {
        let pads =
            listed(contacts.clone()).into_iter().filter(|contact| contact["geoms"].to_string().contains("_pad\""));
        pads.filter(|contact| contact["geoms"].to_string().contains("hammer__")).collect::<Vec<_>>()
    };
    let (without, with) = (of_geoms(&found[0]), of_geoms(&found[1]));
    assert!(!without.is_empty() && without.iter().all(|contact| friction(contact)[0] >= 1.0), "{without:?}");
    assert!(with.len() == without.len(), "no contact is counted twice: {with:?}");
    for contact in &with {
        assert!(own.contains(&friction(contact)[0].to_string()), "{contact}");
        assert_eq!((&contact["condim"], &friction(contact)[2..]), (&json!(4), &[0.005, 0.0001, 0.0001][..]));
    }
    assert!(with.iter().any(|contact| friction(contact)[0] < 1.0), "{with:?}");
}

#[test]
fn pads_without_a_name_and_links_of_several_objects_are_refused() {
    let refused = |arguments: &[&str]| gprop().args(arguments).output().unwrap().status.code();
    assert_eq!(refused(&["export", "scene", "--format", "mjcf", "--out", "out", "--pad-geom", "left,"]), Some(2));
    assert_eq!(
        refused(&["export", "scene", "--format", "mjcf", "--out", "out", "--object", "all", "--links", "parts"]),
        Some(2)
    );
    assert!(!Path::new("out").exists());
}

/// Each Gaussian is in the file of one body, where it would be if that body stood as it was exported.
#[test]
fn an_mjcf_names_the_gaussians_of_each_body_in_its_frame() {
    let measured = Measured::small();
    let (meters, gaussians) = (measured.scene.scale.as_ref().unwrap().meters_per_unit, &measured.scene.gaussians);
    for links in [Links::One, Links::Parts] {
        let out = TempDir::new().unwrap();
        let model = Model { mjcf_splats: true, links, origin: Origin::Com, ..super::model(measured) };
        export(&model, &[Format::Mjcf], out.path()).unwrap();
        let xml = fs::read_to_string(out.path().join("hammer.xml")).unwrap();
        let center = Vector3::from(measured.parts().object.center_of_mass_m);
        let mut expected: Vec<Vector3<f64>> =
            (0..gaussians.len()).map(|i| gaussians.center(i).coords * meters - center).collect();
        let mut found = Vec::new();
        for body in
            between(&xml, "<text name=\"").into_iter().map(|name| name.strip_suffix("_splat").unwrap().to_owned())
        {
            let own = ply::read(&out.path().join(format!("splats/{body}.ply"))).unwrap().gaussians;
            // Bodies are within each other: a link's place is the sum of those around it.
            let place = place_of(&xml, &body);
            found.extend((0..own.len()).map(|i| own.center(i).coords + place));
            let widest =
                |gaussians: &Gaussians| (0..gaussians.len()).map(|i| gaussians.scale(i).max()).fold(0.0, f64::max);
            assert!(widest(&own) <= widest(gaussians) * meters * (1.0 + 1e-6));
        }
        let by_place = |a: &Vector3<f64>, b: &Vector3<f64>| {
            a.iter().zip(b.iter()).map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        };
        assert_eq!(found.len(), expected.len());
        let sum = |places: &[Vector3<f64>]| places.iter().sum::<Vector3<f64>>() / places.len() as f64;
        assert!((sum(&found) - sum(&expected)).norm() < 1e-6);
        expected.sort_by(by_place);
        found.sort_by(by_place);
        let farthest = found.iter().zip(&expected).map(|(a, b)| (a.x - b.x).abs()).fold(0.0, f64::max);
        assert!(farthest < 1e-6, "{farthest}");
    }
}

/// Where a body is: the sum of its position and those of the bodies around it.
fn place_of(xml: &str, body: &str) -> Vector3<f64> {
    let mut around: Vec<Vector3<f64>> = Vec::new();
    for line in xml.lines().map(str::trim) {
        if line.starts_with("<body ") {
            let numbers = line.split_once("pos=\"").map(|(_, rest)| rest.split_once('"').unwrap().0);
            let pos: Vec<f64> =
                numbers.map_or(vec![0.0; 3], |text| text.split(' ').map(|n| n.parse().unwrap()).collect());
            around.push(Vector3::from_vec(pos));
            if line.contains(&format!("name=\"{body}\"")) {
                return around.iter().sum();
            }
        } else if line == "</body>" {
            around.pop();
        }
    }
    panic!("{body} is not in {xml}")
}
