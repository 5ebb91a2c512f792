//! `gprop evaluate segmentation` and `gprop show` on a scene with recorded answers; folders of label maps.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use gprop::evaluate::label_maps::LabelMaps;
use gprop::evaluate::vocabulary::Vocabulary;
use gprop::gaussians::SH_C0;
use gprop::materials::MaterialLibrary;
use gprop::pictures::field_colors;
use gprop::scene::splat::ply;
use gprop::vote::field_ply;
use image::{DynamicImage, GrayImage, Luma};
use serde_json::Value;
use tempfile::TempDir;

use super::{evaluate, refused, text};
use crate::batch::ball::Balls;
use crate::report::true_segments;
use crate::run::gprop;
use crate::support;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

#[test]
fn a_scene_with_recorded_answers_gives_the_table_and_its_pictures() {
    // Those of the views that a run chooses in which SAM's and the true parts alike are asked about by the same questions.
    const VIEWS: [&str; 9] = ["003", "005", "008", "009", "013", "015", "018", "021", "027"];
    let (scene, work, segments) = (fixture("mug"), TempDir::new().unwrap(), TempDir::new().unwrap());
    true_segments("mug", &VIEWS, segments.path());
    let mut run = gprop();
    run.arg("vote").arg(&scene).arg("--segments").arg(segments.path()).args(["--view-list", &VIEWS.join(",")]);
    let run = run.args(["--ask", "parts", "--ask-views", "2", "-q", "--out"]).arg(work.path()).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let output = evaluate(&[
        "segmentation",
        "--truth",
        "ground_truth/part_maps",
        "--labels",
        "abo",
        "--out",
        text(work.path()),
        text(&scene),
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let labels: Vec<&String> = found["per_label"].as_object().unwrap().keys().collect();
    assert_eq!(labels, ["ceramic", "plastic", "wood"], "rubber is plastic and cork is wood");
    let mean = |column: &Value| column["mean_iou"].as_f64().unwrap();
    println!("{found:#}");
    assert!(mean(&found) > 0.9 && mean(&found["local_only"]) > 0.9, "{found:#}");
    assert!(mean(&found["no_vote"]) < mean(&found), "the views together know more than the best of them");
    assert_eq!(found["per_object"]["mug"]["mean_iou"], found["mean_iou"]);
    pictures(&scene, work.path());
}

/// The picture that `gprop show --what` draws of a view.
fn shown(scene: &Path, work: &Path, what: &str, view: &str) -> DynamicImage {
    let to = work.join(format!("{what}.of-{view}.png"));
    let output =
        gprop().args(["show", text(scene), text(&to), "--what", what, "--view", view, "--out", text(work)]).output();
    let output = output.unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}: {said}");
    assert!(!said.contains("  segment "), "the segments of the run are used: {said}");
    image::open(&to).unwrap()
}

#[test]
fn every_property_can_be_shown() {
    let (balls, work) = (Balls::new(1), TempDir::new().unwrap());
    let scene = balls.scene(0);
    let run = gprop().arg("vote").arg(&scene).args(balls.answers()).args(["-q", "--out"]).arg(work.path()).output();
    let run = run.unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let subjects = [
        "figure",
        "materials",
        "parts",
        "confidence",
        "hardness",
        "youngs-modulus",
        "density",
        "friction",
        "vote",
        "levels",
    ];
    let pictures = subjects.map(|what| shown(&scene, work.path(), what, "001"));
    assert!(pictures.iter().all(|picture| picture.width() >= 64));
    let maps: BTreeSet<&[u8]> = pictures[1..].iter().map(DynamicImage::as_bytes).collect();
    assert_eq!(maps.len(), subjects.len() - 1, "no two show the same");
}

/// Checks the pictures of the vote and those of `gprop show`.
fn pictures(scene: &Path, work: &Path) {
    let field = ply::read(&work.join("field.ply")).unwrap().gaussians;
    let labels = serde_json::from_slice(&fs::read(work.join("labels.json")).unwrap()).unwrap();
    let colors = field_colors::material_colors(&field_ply::read(&field.extra, labels).unwrap());
    let recolored = ply::read(&work.join("field_recolored.ply")).unwrap().gaussians;
    assert_eq!((recolored.len(), recolored.sh_degree), (field.len(), 0));
    for (dc, color) in recolored.sh_dc.iter().zip(&colors) {
        assert!(dc.iter().zip(color).all(|(dc, color)| (dc * SH_C0 + 0.5 - color).abs() < 1e-6));
    }
    let figure = image::open(work.join("figure.png")).unwrap();
    assert!(figure.width() > 3 * 512 && figure.height() > 512, "three panels and a legend");
    // Only views that were asked about have answers beside the vote.
    for (what, view) in [("figure", "001"), ("vote", "003")] {
        assert!(shown(scene, work, what, view).width() >= 512, "{what}");
    }
    let film = work.join("turntable.gif");
    let output = Command::new(env!("CARGO_BIN_EXE_gprop"))
        .args(["show", text(scene), text(&film), "--turntable", "--size", "320x180", "--fps", "2", "--out", text(work)])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let decoder = image::codecs::gif::GifDecoder::new(fs::File::open(&film).map(std::io::BufReader::new).unwrap());
    let turned = image::AnimationDecoder::into_frames(decoder.unwrap()).collect_frames().unwrap();
    assert_eq!((turned.len(), turned[0].buffer().dimensions()), (12, (320, 180)), "a turn takes six seconds");
    assert!(turned[0].buffer() != turned[6].buffer());
    let output = Command::new(env!("CARGO_BIN_EXE_gprop"))
        .args(["show", text(scene), text(&work.join("turned.png")), "--turntable", "--out", text(work)])
        .output()
        .unwrap();
    refused(&output, &["turned.png", ".gif", ".mp4"]);
    let output = Command::new(env!("CARGO_BIN_EXE_gprop"))
        .args(["show", text(scene), text(&work.join("vote.gif")), "--what", "vote", "--out", text(work)])
        .output()
        .unwrap();
    refused(&output, &["vote.gif", ".png"]);
    let nowhere = work.join("nowhere.png");
    let output = Command::new(env!("CARGO_BIN_EXE_gprop"))
        .args(["show", text(scene), text(&nowhere), "--view", "nobody", "--out", text(work)])
        .output()
        .unwrap();
    refused(&output, &["nobody", "007 and 22 more"]);
}

fn folder(files: &[(&str, &str)], maps: &[(&str, u8)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    files.iter().for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
    for (name, value) in maps {
        GrayImage::from_pixel(4, 2, Luma([*value])).save(folder.path().join(name)).unwrap();
    }
    folder
}

#[test]
fn label_maps_with_a_json_of_names_or_as_eiseg_writes_them() {
    let library = MaterialLibrary::builtin();
    let maps = [("000.png", 1), ("000_pseudo.png", 9), ("000_cutout.png", 9)];
    let json = r#"{"1": "oak, white", "2": "rubber", "7": "fabric"}"#;
    let eiseg = "0 background 0 0 0 \n1 oak, white 10 20 30 \n2 rubber 1 2 3 \n7 fabric 4 5 6\n";
    let files = [("labels.json", json), ("autosave_label.txt", eiseg)];
    // Some editors write a byte order mark.
    let marked = files.map(|(name, text)| (name, format!("\u{feff}{text}")));
    let marked = marked.iter().map(|(name, text)| (*name, text.as_str()));
    for file in files.into_iter().chain(marked) {
        let folder = folder(&[file], &maps);
        let maps = LabelMaps::open(folder.path()).unwrap();
        let values = Vocabulary::Abo.of_values(&maps, library).unwrap();
        assert_eq!(values.into_iter().collect::<Vec<_>>(), [(1, "wood"), (2, "plastic"), (7, "fabric")]);
        assert_eq!(maps.views().collect::<Vec<_>>(), ["000"]);
        assert_eq!(maps.of("000", (4, 2)).unwrap().unwrap().labels, [1; 8]);
        assert!(maps.of("001", (4, 2)).unwrap().is_none());
        let error = maps.of("000", (512, 512)).unwrap_err().to_string();
        assert!(error.contains("4 x 2") && error.contains("512 x 512") && error.contains("\"000\""), "{error}");
    }
}

#[test]
fn folders_that_are_no_label_maps_are_refused() {
    let refusal = |folder: &TempDir| LabelMaps::open(folder.path()).unwrap_err().to_string();
    assert!(refusal(&folder(&[], &[])).contains("no label maps"));
    assert!(refusal(&folder(&[], &[("000.png", 1)])).contains("labels.json"));
    let said = refusal(&folder(&[("labels.json", "[1]")], &[("000.png", 1)]));
    assert!(said.contains("names by pixel value"), "{said}");
    let said = refusal(&folder(&[("autosave_label.txt", "1 wood\nglass\n")], &[("000.png", 1)]));
    assert!(said.contains("line 2"), "{said}");
    let unknown = folder(&[("labels.json", r#"{"1": "glas"}"#)], &[("000.png", 1)]);
    let maps = LabelMaps::open(unknown.path()).unwrap();
    let error = Vocabulary::Mvimgnet.of_values(&maps, MaterialLibrary::builtin()).unwrap_err();
    assert_eq!(error.name, "glas");
}

#[test]
fn true_part_maps_of_another_size_are_refused_before_anything_is_segmented() {
    if support::models("true_part_maps_of_another_size_are_refused_before_anything_is_segmented").is_none() {
        return;
    }
    let copy = TempDir::new().unwrap();
    for name in ["images", "point_cloud.ply", "transforms.json"] {
        std::os::unix::fs::symlink(fixture("hammer").join(name), copy.path().join(name)).unwrap();
    }
    let maps = copy.path().join("ground_truth/part_maps");
    fs::create_dir_all(&maps).unwrap();
    for view in 0..30 {
        GrayImage::new(8, 4).save(maps.join(format!("{view:03}.png"))).unwrap();
    }
    let links = fixture("hammer");
    let output = evaluate(&["prompts", text(copy.path()), "--allow-read", text(&links)]);
    refused(&output, &["8 x 4", "512 x 512", "part_maps"]);
}
