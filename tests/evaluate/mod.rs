//! `gprop evaluate mass` and `hardness`: numbers computed with numpy from the published definitions, and bad input.

mod segmentation;
// Evaluation of stored results.
mod stored;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use gprop::scene::splat::ply;
use gprop::units::{Range, ShoreHardness, ShoreScale};
use gprop::vote::field_ply;
use gprop::workdir::{Checksum, FORMAT_VERSION};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::parts::truth;

fn evaluate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gprop")).arg("evaluate").args(arguments).arg("--json").output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn masses(folder: &TempDir, predictions: &str, truth: &str) -> Output {
    let files = ["predictions.json", "truth.json"].map(|name| folder.path().join(name));
    fs::write(&files[0], predictions).unwrap();
    fs::write(&files[1], truth).unwrap();
    evaluate(&["mass", "--predictions", text(&files[0]), "--truth", text(&files[1])])
}

fn refused(output: &Output, words: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(words.iter().all(|word| said.contains(word)), "{said}");
}

#[test]
fn masses_score_as_the_published_evaluation_does() {
    let folder = TempDir::new().unwrap();
    let predictions = r#"{"B07A_X1": [0.5, 1.5], "B07B_Y_Z": [2.0, 4.0], "B07C": [10, 12], "B07D_Q": 0.3}"#;
    let output = masses(&folder, predictions, r#"{"B07A": 1.25, "B07B": 2.0, "B07C": 20.0, "B07D": 0.3, "unused": 5}"#);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    // Computed with numpy from the means of [low, high]; PRA from its definition over the twelve ordered pairs.
    let expected = [
        ("ade", 2.5625),
        ("alde", 0.3066114150444986),
        ("ape", 0.2875),
        ("mnre", 0.7541666666666667),
        ("pra", 1.0),
        ("coverage", 0.75),
    ];
    for (key, value) in expected {
        assert!((found[key].as_f64().unwrap() - value).abs() < 1e-12, "{key}: {}", found[key]);
    }
    assert_eq!(found["count"], 4);
}

#[test]
fn an_interval_from_zero_has_no_width() {
    let folder = TempDir::new().unwrap();
    let width = |predictions: &str| {
        let output = masses(&folder, predictions, r#"{"A": 1, "B": 1}"#);
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["median_width"].clone()
    };
    assert_eq!(width(r#"{"A": [0, 2], "B": [1, 3]}"#), 3.0);
    assert_eq!(width(r#"{"A": [0, 2]}"#), Value::Null);
}

#[test]
fn masses_that_cannot_be_scored_are_refused() {
    let folder = TempDir::new().unwrap();
    refused(&masses(&folder, r#"{"A": [3, 1]}"#, r#"{"A": 1}"#), &["predictions.json", "\"A\" is [3, 1]", "low end"]);
    refused(&masses(&folder, r#"{"A_1": [1, 2]}"#, r#"{"A_1": 1}"#), &["A_1", "underscore"]);
    refused(&masses(&folder, r#"{"A": [0, 0]}"#, r#"{"A": 1}"#), &["prediction", "\"A\" is 0"]);
    refused(&masses(&folder, r#"{"A": [1, 1]}"#, r#"{"A": 0}"#), &["truth", "\"A\" is 0"]);
    refused(&masses(&folder, r#"{"A": [1, 2, 3]}"#, r#"{"A": 1}"#), &["predictions.json", "[low, high]"]);
    refused(&masses(&folder, "{}", "{}"), &["nothing to compare"]);
    refused(&evaluate(&["mass", text(folder.path())]), &["run.json", "gprop run"]);
}

/// A work folder for the hammer, as a run with flawless answers would leave it; the true head has Shore D 60 to 80, the
/// true grip A 50 to 70, the handle no hardness.
fn hammer_with_field() -> (PathBuf, TempDir) {
    let folder = truth::hammer();
    let truth::Known { scene, field, .. } = truth::known(&folder);
    let mut field = field.clone();
    let shore = |scale, low, high| Some(ShoreHardness { scale, range: Range::new(low, high) });
    field.parts.iter_mut().for_each(|label| label.id += 1);
    field.parts[1].hardness = shore(ShoreScale::D, 60.0, 80.0);
    field.parts[2].hardness = shore(ShoreScale::A, 50.0, 70.0);
    let work = TempDir::new().unwrap();
    let mut file = fs::File::create(work.path().join("field.ply")).unwrap();
    ply::write(&mut file, &scene.gaussians, &field_ply::columns(&field)).unwrap();
    fs::write(work.path().join("labels.json"), serde_json::to_string(&field.parts).unwrap()).unwrap();
    let stage = |name: &str, inputs: &[&str], outputs: &[&str]| {
        let inputs: Vec<_> = inputs.iter().map(|input| json!([input, input])).collect();
        let outputs = outputs.iter().map(|path| {
            let Checksum { bytes, sha256 } = Checksum::of_file(&work.path().join(path)).unwrap();
            json!({ "path": path, "bytes": bytes, "sha256": sha256 })
        });
        let outputs: Vec<_> = outputs.collect();
        json!({
            "name": name, "seconds": 1.0, "reused": false, "warnings": [], "key": name, "digest": name, "inputs": inputs,
            "outputs": outputs,
        })
    };
    let stages = [
        stage("scene", &[], &[]),
        stage("segment", &["scene"], &[]),
        stage("consensus", &["scene", "segment"], &[]),
        stage("recognise", &["scene", "segment", "consensus"], &[]),
        stage("refine", &["scene", "consensus", "recognise"], &[]),
        stage("query", &["scene", "segment", "consensus", "recognise", "refine"], &[]),
        stage("vote", &["scene", "segment", "consensus", "refine", "query"], &["field.ply", "labels.json"]),
    ];
    let version = format!("{}+format.{FORMAT_VERSION}", env!("CARGO_PKG_VERSION"));
    let record = json!({ "version": version, "options": {}, "stages": stages });
    fs::write(work.path().join("run.json"), record.to_string()).unwrap();
    (folder, work)
}

/// A pixel well within part `id` of view `000`.
fn pixel_on(folder: &Path, id: u8) -> (u32, u32) {
    let map = image::open(folder.join("ground_truth/part_maps/000.png")).unwrap().into_luma8();
    let all_around = |x: u32, y: u32| (0..49).all(|n| map.get_pixel(x - 3 + n % 7, y - 3 + n / 7).0[0] == id);
    let pixels = (3..map.height() - 3).flat_map(|y| (3..map.width() - 3).map(move |x| (x, y)));
    pixels.into_iter().find(|&(x, y)| all_around(x, y)).unwrap()
}

#[test]
fn hardness_is_read_off_the_field_on_one_axis() {
    let (folder, work) = hammer_with_field();
    let [handle, head, grip, nothing] = [0, 1, 2, 255].map(|id| pixel_on(&folder, id));
    let rows = [(head, "D", 50), (grip, "A", 40), (handle, "D", 70), (nothing, "A", 10)];
    let mut csv = "scene,view,x,y,shore,hardness\n".to_owned();
    for ((x, y), shore, hardness) in rows {
        csv += &format!("{}, 000, {x}.5, {y}.5, {shore}, {hardness}\n", folder.display());
    }
    let points = work.path().join("points.csv");
    fs::write(&points, csv).unwrap();
    let output = evaluate(&["hardness", text(&points), "--out", text(work.path())]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    // The head 170 against 150, the grip 60 against 40; handle and background have no value.
    let expected = [
        ("ade", 20.0),
        ("ape", (20.0 / 150.0 + 0.5) / 2.0),
        ("mnre", (150.0 / 170.0 + 40.0 / 60.0) / 2.0),
        ("alde", ((170f64 / 150.0).ln() + 1.5f64.ln()) / 2.0),
        ("pra", 1.0),
    ];
    for (key, value) in expected {
        assert!((found[key].as_f64().unwrap() - value).abs() < 1e-12, "{key}: {}", found[key]);
    }
    assert_eq!((&found["count"], &found["missing"]), (&Value::from(2), &Value::from(2)));
}

#[test]
fn readings_that_make_no_sense_are_refused_with_their_line() {
    let (folder, work) = hammer_with_field();
    let points = work.path().join("points.csv");
    fs::write(&points, "scene,view,x,y,shore,hardness\n").unwrap();
    refused(&evaluate(&["hardness", text(&points)]), &["points.csv", "has no rows", "scene,view,x,y,shore,hardness"]);
    let with_row = |row: &str| {
        fs::write(&points, format!("scene,view,x,y,shore,hardness\n{}{row}\n", folder.display())).unwrap();
        evaluate(&["hardness", text(&points), "--out", text(work.path())])
    };
    refused(&with_row(",000,1,1,C,50"), &["line 2", "scene,view,x,y,shore,hardness"]);
    refused(&with_row(",000,1,1,A,150"), &["line 2", "150"]);
    refused(&with_row(",none_such,1,1,A,50"), &["line 2", "none_such"]);
    refused(&with_row(",000,1,1,A,50"), &["nothing to compare"]);
    // As an editor counts lines, whatever ends them.
    let header = "scene,view,x,y,shore,hardness";
    for (table, words) in [
        (format!("{header}\r\na,000,1,1,A,50\r\na,000,1,1,A,150\r\n"), ["line 3: hardness", "150"]),
        (format!("# mine\n{header}\n\n# high\na,000,1,1,A,150\n"), ["line 5: hardness", "150"]),
        (format!("{header}\r\na,000,one,1,A,50\r\n"), ["line 2: field 2: invalid float literal", header]),
        (format!("{header}\r\na,000\r\n"), ["line 2: the header has 6 columns, but this row has 2 cells", header]),
    ] {
        fs::write(&points, table).unwrap();
        refused(&evaluate(&["hardness", text(&points)]), &words);
    }
}
