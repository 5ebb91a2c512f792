//! `--format all`, `--list` and `asset.json`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use clap::ValueEnum;
use gprop::export::{Exported, Format, Formats, Model, Origin, export_body, write_summary};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::grasp::scenes::Measured;
use crate::run::gprop;

/// Exports in all formats that are possible, and returns the summary.
fn all(model: &Model, folder: &Path) -> (Exported, Value) {
    let mut exported = export_body(model, Formats::Possible, folder).unwrap();
    write_summary(&mut exported, &[], folder).unwrap();
    let summary = serde_json::from_slice(&fs::read(folder.join("asset.json")).unwrap()).unwrap();
    (exported, summary)
}

#[test]
fn all_formats_are_written_and_the_summary_says_what_they_are() {
    let (measured, folder) = (Measured::small(), TempDir::new().unwrap());
    let models = ["model-x".to_owned()];
    let model = Model { answered_by: &models, ..super::model(measured) };
    let (exported, summary) = all(&model, folder.path());
    let of_mesh = |format: &&Format| format.needs_mesh();
    let left_out: Vec<Format> = exported.left_out.iter().map(|left| left.format).collect();
    assert_eq!(left_out, Format::value_variants().iter().filter(of_mesh).copied().collect::<Vec<_>>());
    assert!(summary["left_out"][0]["why"].as_str().unwrap().contains("this one is a splat"), "{summary}");
    assert_eq!(exported.formats.len() + left_out.len(), Format::value_variants().len());

    assert_eq!((&summary["source"], &summary["answered_by"]), (&json!("point_cloud.ply"), &json!(["model-x"])));
    assert!(!summary.to_string().contains(folder.path().to_str().unwrap()), "no path of this machine");
    let up_axis = |frame: &str| summary["frames"][frame]["up_axis"].clone();
    assert_eq!((up_axis("z_up"), up_axis("y_up"), up_axis("input")), (json!("z"), json!("y"), Value::Null));
    assert_eq!(summary["frames"]["z_up"]["units"], json!({ "length": "m", "mass": "kg" }));
    let object = &summary["objects"][0];
    assert_eq!(object["input_from"]["z_up"].as_array().unwrap().len(), 16);
    assert_eq!(object["mass_kg"], serde_json::to_value(measured.parts().object.mass_kg).unwrap());
    for (part, label) in object["parts"].as_array().unwrap().iter().zip(&measured.field.parts) {
        let weighed = measured.parts().part(label.id).unwrap();
        assert_eq!(part["mass_kg"], serde_json::to_value(weighed.mass_kg).unwrap());
        assert_eq!(part["friction"], serde_json::to_value(label.friction_rubber).unwrap());
    }
    // Every file is named, with its size.
    let named: BTreeSet<String> =
        summary["files"].as_array().unwrap().iter().map(|file| file["path"].as_str().unwrap().to_owned()).collect();
    let written = exported.files.iter().map(|file| file.path.strip_prefix(folder.path()).unwrap());
    let written: BTreeSet<String> = written.map(|path| path.to_str().unwrap().to_owned()).collect();
    assert_eq!(written.difference(&named).collect::<Vec<_>>(), ["asset.json"]);
    for file in summary["files"].as_array().unwrap() {
        let size = folder.path().join(file["path"].as_str().unwrap()).metadata().unwrap().len();
        assert_eq!(file["bytes"], size, "{file}");
        assert!(!file["formats"].as_array().unwrap().is_empty(), "{file}");
    }
    let of_several = summary["files"].as_array().unwrap().iter().find(|file| file["path"] == "meshes/hammer_skin.obj");
    assert_eq!(of_several.unwrap()["formats"], json!(["mjcf", "urdf", "sdf"]));
}

#[test]
fn all_formats_are_the_same_bytes_on_one_and_two_threads() {
    let model = Model { origin: Origin::Base, ..super::model(Measured::small()) };
    let on = |threads: usize| {
        let folder = TempDir::new().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (exported, _) = pool.install(|| all(&model, folder.path()));
        (folder, exported)
    };
    let ((one, files), (two, _)) = (on(1), on(2));
    for file in files.files {
        let other = two.path().join(file.path.strip_prefix(one.path()).unwrap());
        assert!(fs::read(&file.path).unwrap() == fs::read(other).unwrap(), "{:?}", file.path);
    }
}

/// Without a scale, what needs none is written.
#[test]
fn formats_that_lack_something_are_left_out_with_the_reason() {
    let folder = TempDir::new().unwrap();
    let model = Model { scale: None, parts: None, ..super::model(Measured::small()) };
    let (exported, summary) = all(&model, folder.path());
    assert_eq!(exported.formats, [Format::Npz, Format::Physgaussian, Format::GltfSplat, Format::PlyParts]);
    let why: Vec<&str> = exported.left_out.iter().map(|left| left.why.as_str()).collect();
    assert!(why[0].contains("--scale"), "{why:?}");
    assert_eq!(
        (&summary["scale"], &summary["frames"]["y_up"]["units"]["length"]),
        (&Value::Null, &json!("scene unit"))
    );
}

#[test]
fn the_list_needs_no_scene() {
    let output = gprop().args(["export", "--list", "--json"]).output().unwrap();
    let listed: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> = listed.iter().map(|of| of["format"].as_str().unwrap()).collect();
    assert_eq!(names, Format::value_variants().iter().map(|format| format.name()).collect::<Vec<_>>());
    assert!(listed.iter().all(|of| !of["readers"].as_array().unwrap().is_empty()), "{listed:?}");
    let output = gprop().args(["export", "--list"]).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stdout).contains("read by MuJoCo"));
    // All else needs one.
    for missing in [&["export", "--format", "all"][..], &["export", "scene", "--format", "all"]] {
        assert_eq!(gprop().args(missing).output().unwrap().status.code(), Some(2), "{missing:?}");
    }
}
