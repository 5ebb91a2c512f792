//! An evaluation uses the stored results of a run, with the options of that run, and changes nothing.

use std::fs;
use std::path::Path;
use std::process::Output;
use std::time::SystemTime;

use gprop::pipeline::Stage;
use gprop::pipeline::stored::StoredRun;
use gprop::scene::splat::ply;
use serde_json::Value;

use super::{evaluate, refused, text};
use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::faults::changed::change;
use crate::run::gprop;

fn run(balls: &Balls, command: &str, more: &[&str]) {
    let mut gprop = gprop();
    gprop.env_remove("OPENAI_API_KEY").arg(command).arg(balls.scene(0)).arg("-q").args(balls.answers()).args(more);
    let output = gprop.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn segmentation(balls: &Balls, more: &[&str]) -> Output {
    evaluate(&[&["segmentation", "--truth", "ground_truth/maps", text(&balls.scene(0))], more].concat())
}

fn mass(balls: &Balls, more: &[&str]) -> Output {
    evaluate(&[&["mass", text(&balls.scene(0))], more].concat())
}

/// Every file below a folder with its content and modification time, including the lock and `run.json`.
fn everything(folder: &Path) -> Vec<(String, Vec<u8>, SystemTime)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(everything(&path));
        } else {
            let written = path.metadata().unwrap().modified().unwrap();
            found.push((path.display().to_string(), fs::read(&path).unwrap(), written));
        }
    }
    found.sort();
    found
}

#[track_caller]
fn measured(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn what_was_run_with_other_options_is_measured_as_it_is() {
    let balls = Balls::new(1);
    balls.write_truth(0);
    run(&balls, "parts", &["--view-list", "000,002", "--vote", "frequency"]);
    let before = everything(&balls.scene(0));
    let found = measured(&segmentation(&balls, &[]));
    assert!(found["mean_iou"].as_f64() > Some(0.5), "wood is found to be wood: {found:#}");
    measured(&mass(&balls, &[]));
    let robustness = || measured(&evaluate(&["robustness", "--few-views", "1", text(&balls.scene(0))]));
    let found = &robustness()[0];
    assert_eq!(
        (&found["asked"], &found["voting_views"], &found["few_views"]),
        (&"segments".into(), &2.into(), &1.into())
    );
    let iou = |n: usize| found["rows"][n]["mean_iou"].as_f64().unwrap();
    assert!(iou(0) > 0.3, "a coarse ball, half of it seen by two views: {found:#}");
    assert!(iou(1) < iou(0) && iou(4) < iou(0), "merged segments cost: {found:#}");
    assert_eq!(*found, robustness()[0], "the same chance every time");
    let readings = balls.folder().join("readings.csv");
    fs::write(&readings, "scene,view,x,y,shore,hardness\nball-0,001,1,1,A,50\n").unwrap();
    refused(&evaluate(&["hardness", text(&readings)]), &["nothing to compare"]);
    fs::remove_file(readings).unwrap();
    assert!(everything(&balls.scene(0)) == before, "an evaluation changes nothing");
}

/// The scale comes from `--scale`, the scene's `gprop.toml` or the layout of its data set, never from the truth.
#[test]
fn a_false_ground_truth_changes_no_result() {
    let balls = Balls::new(1);
    let scene = balls.scene(0);
    let options = fs::read_to_string(scene.join("gprop.toml")).unwrap();
    let without_scale: String =
        options.lines().filter(|line| !line.starts_with("scale")).map(|line| format!("{line}\n")).collect();
    for options in [&options, &without_scale] {
        fs::write(scene.join("gprop.toml"), options).unwrap();
        let results = || {
            let _ = fs::remove_dir_all(scene.join("gprop"));
            run(&balls, "run", &["--frames", "2", "--duration", "0.01", "--grid", "8"]);
            // The report says how many seconds each stage took.
            let mut results = contents(&scene.join("gprop"));
            results.retain(|(path, _)| !path.to_string_lossy().starts_with("report."));
            assert!(results.iter().any(|(path, _)| path.ends_with("grasp.json")));
            results
        };
        let _ = fs::remove_dir_all(scene.join("ground_truth"));
        let without = results();
        balls.write_truth(0);
        fs::write(scene.join("ground_truth/maps/labels.json"), r#"{"1": "lead", "2": "lead"}"#).unwrap();
        assert!(without == results(), "with these options:\n{options}");
    }
}

#[test]
fn what_is_missing_is_said_with_the_command_that_makes_it() {
    let balls = Balls::new(1);
    balls.write_truth(0);
    let scene = balls.scene(0);
    let before = everything(&scene);
    for output in [segmentation(&balls, &[]), mass(&balls, &[])] {
        refused(&output, &["there is no run.json", "gprop run", text(&scene)]);
    }
    assert!(everything(&scene) == before, "no work folder is made");
    let object = scene.join("gprop/objects/object_2");
    fs::create_dir_all(&object).unwrap();
    refused(&mass(&balls, &[]), &["shows several objects", "--out", text(&object)]);
    fs::remove_dir_all(scene.join("gprop")).unwrap();
    let out = balls.folder().with_file_name("out");
    refused(&mass(&balls, &["--out", text(&out)]), &["there is no run.json", "--out", text(&out)]);
    run(&balls, "segment", &[]);
    refused(&segmentation(&balls, &[]), &["the consensus stage is not done", "gprop run"]);
    run(&balls, "parts", &[]);
    measured(&segmentation(&balls, &[]));
    // Segments of different views than those that voted do not belong to the stored vote.
    run(&balls, "segment", &["--views", "2"]);
    refused(&segmentation(&balls, &[]), &["was done again after", "gprop run"]);
    refused(&mass(&balls, &[]), &["was done again after", "gprop run"]);
    run(&balls, "parts", &["--fresh"]);
    change(&scene.join("gprop/segments/001.png"));
    refused(&segmentation(&balls, &[]), &["segments/001.png", "has changed since gprop wrote it", "gprop run"]);
    run(&balls, "parts", &[]);
    measured(&segmentation(&balls, &[]));
    let cameras = fs::read_to_string(scene.join("transforms.json")).unwrap();
    fs::write(scene.join("transforms.json"), cameras + "\n").unwrap();
    refused(&segmentation(&balls, &[]), &["the scene's files have changed since"]);
}

#[test]
fn what_a_work_folder_in_a_scene_says_is_not_read_elsewhere() {
    let balls = Balls::new(1);
    balls.write_truth(0);
    let elsewhere = balls.folder().with_file_name("elsewhere.ply");
    fs::copy(balls.scene(0).join("point_cloud.ply"), &elsewhere).unwrap();
    run(&balls, "parts", &["--splat", text(&elsewhere)]);
    refused(&segmentation(&balls, &[]), &["elsewhere.ply", "is not in the scene", "--out"]);
    let work = balls.scene(0).join("gprop");
    measured(&segmentation(&balls, &["--out", text(&work)]));
}

#[test]
fn a_scene_brings_no_link_for_the_results() {
    let balls = Balls::new(1);
    balls.write_truth(0);
    run(&balls, "parts", &[]);
    let (work, elsewhere) = (balls.scene(0).join("gprop"), balls.folder().with_file_name("elsewhere"));
    fs::rename(&work, &elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &work).unwrap();
    for output in [segmentation(&balls, &[]), mass(&balls, &[])] {
        refused(&output, &["gprop\" is a link", "--out"]);
    }
    measured(&mass(&balls, &["--out", text(&work)]));
}

#[test]
fn the_paths_of_a_run_lead_to_the_same_files_from_any_folder() {
    let balls = Balls::new(1);
    balls.write_truth(0);
    let (scene, elsewhere) = (balls.scene(0), balls.folder().with_file_name("elsewhere.ply"));
    fs::rename(scene.join("point_cloud.ply"), &elsewhere).unwrap();
    let mut vote = gprop();
    vote.env_remove("OPENAI_API_KEY").current_dir(&scene).args(["vote", ".", "-q", "--images", "."]);
    let output = vote.args(["--splat", "../../elsewhere.ply"]).args(balls.answers()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    measured(&segmentation(&balls, &["--out", text(&scene.join("gprop"))]));
    let record: Value = serde_json::from_slice(&fs::read(scene.join("gprop/run.json")).unwrap()).unwrap();
    let of_scene = &record["options"]["scene"];
    assert_eq!(of_scene["images"], ".", "relative to the scene");
    assert!(Path::new(of_scene["splat"].as_str().unwrap()).is_absolute());
}

#[test]
fn the_outliers_of_a_run_stay_set_aside() {
    let balls = Balls::new(1);
    let path = balls.scene(0).join("point_cloud.ply");
    let mut gaussians = ply::read(&path).unwrap().gaussians;
    // One of 200 Gaussians is as wide as ten balls.
    gaussians.log_scales[0] = [0.0; 3];
    let mut bytes = Vec::new();
    ply::write(&mut bytes, &gaussians, &[]).unwrap();
    fs::write(&path, bytes).unwrap();
    run(&balls, "vote", &[]);
    let (gaussians, field) = StoredRun::open(&balls.scene(0), None, &[Stage::Vote]).unwrap().field().unwrap();
    assert!(gaussians.is_set_aside(0) && !gaussians.is_set_aside(1));
    assert_eq!(field.part_index.len(), 200);
}

#[test]
fn two_scenes_of_one_name_are_refused() {
    let (one, other) = (Balls::new(1), Balls::new(1));
    for balls in [&one, &other] {
        balls.write_truth(0);
        run(balls, "vote", &[]);
    }
    refused(&segmentation(&one, &[text(&other.scene(0))]), &["two scenes have the name \"ball-0\""]);
}

#[test]
fn part_maps_that_show_no_part_are_refused() {
    let balls = Balls::new(1);
    balls.write_truth(0);
    run(&balls, "vote", &["--view-list", "000,002"]);
    let robustness = || evaluate(&["robustness", "--few-views", "1", text(&balls.scene(0))]);
    let clear = |view: &str| {
        let path = balls.scene(0).join(format!("ground_truth/part_maps/{view}.png"));
        let (width, height) = image::image_dimensions(&path).unwrap();
        image::GrayImage::from_pixel(width, height, image::Luma([255])).save(path).unwrap();
    };
    clear("000");
    let found = measured(&robustness());
    assert_eq!(found[0]["rows"][3]["mean_iou"], 0.0, "the only view of the row with fewer views shows no part");
    clear("002");
    refused(&robustness(), &["ball-0", "show no part in the views that vote"]);
    clear("001");
    refused(&robustness(), &["ball-0", "show no part in the views that do not vote"]);
}
