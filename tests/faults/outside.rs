//! Scenes, recordings and work folders from elsewhere that lead gprop to the user's files, or the user's key to a
//! server.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use super::{assert_refused, run};
use crate::batch::ball::Balls;
use crate::query::client::{CANARY, Server, error};
use crate::query::{a, good_answer};
use crate::run::gprop;

fn run_with(balls: &Balls, out: &Path, more: &[&str]) -> Output {
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).args(["--to", "query", "-q", "--out"]).arg(out);
    command.args(more).output().unwrap()
}

#[test]
fn a_linked_photo_is_read_if_the_user_says_so() {
    let (balls, outside) = (Balls::new(1), tempfile::tempdir().unwrap());
    let scene = balls.scene(0);
    let photo = outside.path().canonicalize().unwrap().join("000.png");
    fs::rename(scene.join("images/000.png"), &photo).unwrap();
    symlink(&photo, scene.join("images/000.png")).unwrap();
    let (named, allowed) = (scene.display().to_string(), outside.path().display().to_string());
    let out = tempfile::tempdir().unwrap();
    let words = ["photo `", "images/000.png", "transforms.json` names", &photo.display().to_string(), "`--images "];
    assert_refused(&run(&balls, out.path()), 3, &words);
    assert!(!out.path().join("views.json").exists());
    let batch = gprop().arg("batch").arg(balls.folder()).args(["--to", "scene"]).output().unwrap();
    assert_eq!(batch.status.code(), Some(6));
    assert!(String::from_utf8_lossy(&batch.stderr).contains("lies outside the scene folder"));
    for flags in [["--images", &named], ["--allow-read", &allowed]] {
        let out = tempfile::tempdir().unwrap();
        let output =
            run_with(&balls, out.path(), &[&flags[..], &balls.answers().each_ref().map(String::as_str)].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn an_evaluation_reads_a_linked_photo_if_the_user_says_so() {
    let (balls, outside, out) = (Balls::new(1), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let scene = balls.scene(0);
    balls.write_truth(0);
    let photo = outside.path().canonicalize().unwrap().join("000.png");
    fs::rename(scene.join("images/000.png"), &photo).unwrap();
    symlink(&photo, scene.join("images/000.png")).unwrap();
    let (allowed, answers) = (outside.path().display().to_string(), balls.answers());
    let allow = ["--allow-read", &allowed];
    let flags = [&allow[..], &["--to", "vote"], &answers.each_ref().map(String::as_str)].concat();
    let output = run_with(&balls, out.path(), &flags);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let evaluate = |more: &[&str]| {
        let mut command = gprop();
        command.args(["evaluate", "segmentation", "--truth", "ground_truth/maps", "--out"]).arg(out.path());
        command.arg(&scene).args(more).output().unwrap()
    };
    assert_refused(&evaluate(&[]), 3, &["photo `", "outside the scene folder", "`--allow-read "]);
    let output = evaluate(&allow);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_linked_recording_is_read_if_the_user_says_so() {
    let (balls, outside, out) = (Balls::new(1), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let recorded = balls.scene(0).join("recorded");
    let recording = fs::read_dir(&recorded).unwrap().next().unwrap().unwrap().path();
    let target = outside.path().canonicalize().unwrap().join("one.json");
    fs::rename(&recording, &target).unwrap();
    symlink(&target, &recording).unwrap();
    let replay = ["--answers", "replay"];
    let allow = outside.path().display().to_string();
    let words = ["recording `", &target.display().to_string(), "outside the scene folder", "`--allow-read "];
    let out = tempfile::tempdir().unwrap();
    assert_refused(&run_with(&balls, out.path(), &replay), 3, &words);
    let output = run_with(&balls, out.path(), &[&replay[..], &["--allow-read", &allow]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // A folder of recordings that the user names is read as it is.
    fs::remove_file(&recording).unwrap();
    let output = run_with(&balls, out.path(), &[&replay[..], &["--recordings", &allow]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    // So is the target of a linked folder, but nothing is deleted through the link.
    fs::rename(&target, &recording).unwrap();
    let (all, out) = (outside.path().join("all"), tempfile::tempdir().unwrap());
    fs::rename(&recorded, &all).unwrap();
    symlink(&all, &recorded).unwrap();
    let name = all.display().to_string();
    assert_refused(&run_with(&balls, out.path(), &[&replay[..], &["--allow-read", &name]].concat()), 2, &["is a link"]);
    let output = run_with(&balls, out.path(), &[&replay[..], &["--recordings", &name]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut prune = gprop();
    prune.args(["query", "--prune", "--context", "local", "--recordings", &name, "--out"]).arg(out.path());
    assert_refused(&prune.arg(balls.scene(0)).output().unwrap(), 2, &["is a link", "--prune"]);
    assert!(all.join(recording.file_name().unwrap()).is_file());
}

#[test]
fn linked_ground_truth_is_not_read() {
    let (balls, outside, out) = (Balls::new(1), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let target = outside.path().canonicalize().unwrap().join("parts.json");
    fs::write(&target, "{}").unwrap();
    symlink(outside.path(), balls.scene(0).join("ground_truth")).unwrap();
    let mut mass = gprop();
    mass.args(["evaluate", "mass"]).arg(balls.scene(0)).arg("--out").arg(out.path());
    let words = ["ground truth `", &*target.to_string_lossy(), "outside the scene folder"];
    assert_refused(&mass.output().unwrap(), 3, &words);
    mass.arg("--allow-read").arg(outside.path());
    assert_refused(&mass.output().unwrap(), 2, &["ground_truth/parts.json", "true parts"]);
    let mut segmentation = gprop();
    segmentation.args(["evaluate", "segmentation", "--truth", "ground_truth"]).arg(balls.scene(0));
    let output = segmentation.arg("--out").arg(out.path()).output().unwrap();
    assert_refused(&output, 3, &["ground truth `", "outside the scene folder"]);
}

#[test]
fn a_picture_that_claims_to_be_rendered_is_rendered_again() {
    let (balls, outside) = (Balls::new(1), tempfile::tempdir().unwrap());
    let (scene, secret) = (balls.scene(0), outside.path().join("secret.png"));
    fs::copy(scene.join("images/000.png"), &secret).unwrap();
    fs::write(scene.join("gprop.toml"), "scale = \"metric\"\nrender-views = 1\n").unwrap();
    let render = || gprop().arg("run").arg(&scene).args(["--to", "scene"]).output().unwrap();
    assert!(render().status.success());
    let rendered = fs::read_dir(scene.join("gprop/rendered")).unwrap().next().unwrap().unwrap().path();
    let picture = rendered.join("000.png");
    let before = fs::read(&picture).unwrap();
    fs::remove_file(&picture).unwrap();
    symlink(&secret, &picture).unwrap();
    assert!(render().status.success());
    assert!(!picture.is_symlink() && fs::read(&picture).unwrap() == before);
    fs::remove_dir_all(&rendered).unwrap();
    symlink(outside.path(), &rendered).unwrap();
    assert_refused(&render(), 2, &["is a link"]);
}

/// Replaces every text in a value.
fn replace_texts(value: &mut Value, with: &str) {
    match value {
        Value::String(text) => *text = with.to_owned(),
        Value::Array(items) => items.iter_mut().for_each(|item| replace_texts(item, with)),
        Value::Object(map) => map.values_mut().for_each(|item| replace_texts(item, with)),
        _ => {}
    }
}

#[test]
fn the_key_goes_to_the_named_server_only() {
    let evil = Server::new(|_, _, _| error(500, "nobody named this server"));
    let evil_url = evil.options().lmm_url.unwrap();
    // A server that redirects to another one.
    let location = format!("{evil_url}/chat/completions");
    let good = good_answer(a("wood")).to_string();
    let named = Server::new(move |count, _, _| match count {
        0 => error(307, "elsewhere").header("location", location.as_str()),
        _ => crate::query::client::ok(&good),
    });
    let options = named.options();
    let (url, model) = (options.lmm_url.unwrap(), options.lmm_model.unwrap());
    let balls = Balls::new(1);
    let scene = balls.scene(0);
    let work = scene.join("gprop");
    let gprop_with_key = |arguments: &[&str]| {
        let mut command = gprop();
        command.env("OPENAI_API_KEY", CANARY).arg(arguments[0]).arg(&scene).args(&arguments[1..]);
        command.args(["--lmm-url", &url, "--lmm-model", &model, "--lmm-retries", "0"]).output().unwrap()
    };
    // The files of a run, with another server's address in place of every text that gprop reads back.
    gprop_with_key(&["query", "--lmm-parallel", "1"]);
    assert!(!named.requests().is_empty(), "the redirect itself was met");
    let mut run: Value = serde_json::from_slice(&fs::read(work.join("run.json")).unwrap()).unwrap();
    replace_texts(&mut run["options"], &evil_url);
    run["options"]["query"]["lmm_url"] = json!(evil_url);
    fs::write(work.join("run.json"), run.to_string()).unwrap();
    let state = json!({ "batches": [{ "id": evil_url, "waiting": [], "url": evil_url, "base_url": evil_url }] });
    fs::write(work.join("batch.json"), state.to_string()).unwrap();
    fs::create_dir_all(scene.join("recorded")).unwrap();
    for arguments in [&["query", "--batch", "collect"][..], &["query", "--batch", "submit"], &["query", "--prune"]] {
        gprop_with_key(arguments);
    }
    let export = scene.join("questions");
    let output = gprop_with_key(&["query", "--answers", "live", "--export", export.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut manifest: Value = serde_json::from_slice(&fs::read(export.join("manifest.json")).unwrap()).unwrap();
    for name in ["lmm_url", "url", "base_url"] {
        manifest[name] = json!(evil_url);
    }
    fs::write(export.join("manifest.json"), manifest.to_string()).unwrap();
    gprop_with_key(&["query", "--import", export.to_str().unwrap()]);
    gprop_with_key(&["run", "--to", "query"]);
    assert!(evil.requests().is_empty());
}
