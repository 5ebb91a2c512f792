//! Files of a work folder whose bytes, but not their length, have changed since gprop wrote them: they are noticed
//! before they are used, named, and made again.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use gprop::workdir::Checksum;
use serde_json::{Value, json};

use super::{assert_refused, run};
use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::run::gprop;
use crate::support::stderr;

/// Changes one byte in the middle of a file. A second call restores it.
pub fn change(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(path, bytes).unwrap();
}

/// Expects a successful run that reported each of these files, and no other, as changed.
#[track_caller]
fn assert_made_again(output: &Output, changed: &[&str]) {
    let said = stderr(output);
    assert!(output.status.success(), "{said}");
    assert_eq!(said.matches("has changed since gprop wrote it").count(), changed.len(), "{said}");
    assert!(changed.iter().all(|name| said.contains(name)), "{changed:?} in: {said}");
}

fn stages(work: &Path) -> Vec<Value> {
    let record: Value = serde_json::from_slice(&fs::read(work.join("run.json")).unwrap()).unwrap();
    record["stages"].as_array().unwrap().clone()
}

#[test]
fn every_file_of_a_finished_run() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert_made_again(&run(&balls, out.path()), &[]);
    let calm = contents(out.path());
    let files: Vec<PathBuf> = stages(out.path())
        .iter()
        .flat_map(|stage| stage["outputs"].as_array().unwrap().clone())
        .map(|output| output["path"].as_str().unwrap().into())
        .collect();
    assert_eq!(files.len(), calm.len(), "every file that is left is one of a stage: {files:?}");
    for file in &files {
        change(&out.path().join(file));
        assert!(contents(out.path()) != calm);
        assert_made_again(&run(&balls, out.path()), &[file.to_str().unwrap()]);
        assert!(contents(out.path()) == calm, "{file:?} is not made again");
    }
    // Whatever the reason for which a stage is done again, its inputs are checked first.
    change(&out.path().join("labels.json"));
    change(&out.path().join("segments/001.png"));
    let mut from_parts = gprop();
    from_parts.arg("run").arg(balls.scene(0)).args(["--to", "parts", "--from", "parts", "-q", "--out"]).arg(out.path());
    let output = from_parts.args(balls.answers()).output().unwrap();
    assert_made_again(&output, &["labels.json", "segments/001.png"]);
    assert!(contents(out.path()) == calm);
}

#[test]
fn views_that_were_done_before_a_kill() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let calm = contents(out.path());
    // The state after a kill that follows the last view: the views are there, but no stage is recorded as done.
    for file in ["segments/001.png", "segments/segments.json"] {
        fs::remove_file(out.path().join("run.json")).unwrap();
        change(&out.path().join(file));
        assert_made_again(&run(&balls, out.path()), &[file]);
        assert!(contents(out.path()) == calm, "{file}");
    }
    // A valid list with a different entry for one view.
    fs::remove_file(out.path().join("run.json")).unwrap();
    let list = out.path().join("segments/segments.json");
    let text = fs::read_to_string(&list).unwrap();
    let area = text.split_once("\"area\": ").unwrap().1.split_once(',').unwrap().0;
    let other = "9".repeat(area.len());
    fs::write(&list, text.replacen(&format!("\"area\": {area}"), &format!("\"area\": {other}"), 1)).unwrap();
    assert_made_again(&run(&balls, out.path()), &["segments/segments.json"]);
    assert!(contents(out.path()) == calm);
    // One of another version of gprop, which has other keys: nobody has changed it.
    fs::remove_file(out.path().join("run.json")).unwrap();
    let key = text.split_once("\"key\": \"").unwrap().1.split_once('"').unwrap().0;
    fs::write(&list, text.replace(key, &"0".repeat(key.len()))).unwrap();
    assert_made_again(&run(&balls, out.path()), &[]);
    assert!(contents(out.path()) == calm);
}

#[test]
fn answers_that_were_recorded_before_a_kill() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    // The user may correct a recording: a different answer of the same length is not taken for the old one.
    let recorded = balls.scene(0).join("recorded");
    let mut changed = 0;
    for entry in fs::read_dir(&recorded).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains("\\\"caption\\\":\\\"a "), "{text}");
        fs::write(&path, text.replace("\\\"caption\\\":\\\"a ", "\\\"caption\\\":\\\"A ")).unwrap();
        changed += 1;
    }
    assert!(changed > 0);
    assert_made_again(&run(&balls, out.path()), &[]);
    let query = stages(out.path()).into_iter().find(|stage| stage["name"] == "query").unwrap();
    assert_eq!(query["reused"], false, "the recordings are read again");
    assert!(fs::read_to_string(out.path().join("answers.jsonl")).unwrap().contains("\"caption\":\"A "));
}

/// A short simulation of the first ball.
fn simulate(balls: &Balls, out: &Path) -> Output {
    let mut command = gprop();
    command.arg("simulate").arg(balls.scene(0)).args(["-q", "--frames", "4", "--duration", "0.04", "--grid", "16"]);
    // Without ffmpeg and with a small film, which makes no difference here.
    command.args(["--size", "64x64"]);
    command.env("PATH", "").arg("--out").arg(out).args(balls.answers()).output().unwrap()
}

#[test]
fn frames_that_were_done_before_a_kill() {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    let (calm, out) = (home.path().join("calm"), home.path().join("out"));
    assert_made_again(&simulate(&balls, &calm), &[]);
    let calm = contents(&calm);
    let stopped_at = |frame: &str| {
        // A folder in the place of a frame: the file cannot be written, and the run ends.
        let wall = out.join("simulation/frames").join(frame);
        fs::create_dir_all(wall.join("wall")).unwrap();
        assert_refused(&simulate(&balls, &out), 2, &["cannot write", frame]);
        fs::remove_dir_all(&wall).unwrap();
        assert!(out.join("simulation/checkpoint.bin").is_file());
    };
    let changes: [&[&str]; 4] =
        [&[], &["simulation/frames/0001.ply"], &["simulation/states/0000.npz"], &["simulation/checkpoint.bin"]];
    for changed in changes {
        stopped_at("0002.ply");
        changed.iter().for_each(|file| change(&out.join(file)));
        assert_made_again(&simulate(&balls, &out), changed);
        assert!(contents(&out) == calm, "{changed:?}");
        fs::remove_dir_all(&out).unwrap();
    }
}

#[test]
fn the_inside_is_read_and_not_carved_again() {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    let (at_once, out) = (home.path().join("at_once"), home.path().join("out"));
    assert_made_again(&simulate(&balls, &at_once), &[]);
    // In two processes, the second of which finds the inside on disk.
    assert_made_again(&run(&balls, &out), &[]);
    let inside = fs::read(out.join("interior.bin")).unwrap();
    assert_made_again(&simulate(&balls, &out), &[]);
    assert!(contents(&out) == contents(&at_once));
    let reused = |stage: &str| stages(&out).into_iter().find(|done| done["name"] == stage).unwrap()["reused"] == true;
    assert!(reused("parts") && !reused("simulate"));
    // One that was changed is made again.
    change(&out.join("interior.bin"));
    assert_made_again(&simulate(&balls, &out), &["interior.bin"]);
    assert!(fs::read(out.join("interior.bin")).unwrap() == inside && contents(&out) == contents(&at_once));
    // One whose checksum was changed along with it is refused by its readers.
    let damaged = &inside[..inside.len() - 1];
    fs::write(out.join("interior.bin"), damaged).unwrap();
    let mut record: Value = serde_json::from_slice(&fs::read(out.join("run.json")).unwrap()).unwrap();
    let outputs =
        record["stages"].as_array_mut().unwrap().iter_mut().flat_map(|stage| stage["outputs"].as_array_mut().unwrap());
    let output = outputs.into_iter().find(|output| output["path"] == "interior.bin").unwrap();
    let sealed = Checksum::of(damaged);
    (output["bytes"], output["sha256"]) = (json!(sealed.bytes), json!(sealed.sha256));
    fs::write(out.join("run.json"), record.to_string()).unwrap();
    let mut again = gprop();
    again.arg("export").arg(balls.scene(0)).args(["--format", "npz", "--work"]).arg(&out);
    let exported = again.arg("--out").arg(home.path().join("exported")).args(balls.answers()).output().unwrap();
    assert_refused(&exported, 2, &["interior.bin", "is not what gprop wrote", "do not fit its length", "run again"]);
}

#[test]
fn views_that_were_rendered_from_the_splat() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    let render = || {
        let mut command = gprop();
        command.arg("run").arg(balls.scene(0)).args(["--to", "scene", "--render-views", "2", "-q", "--out"]);
        command.arg(out.path()).output().unwrap()
    };
    assert_made_again(&render(), &[]);
    let calm = contents(out.path());
    let (picture, _) = calm.iter().find(|(path, _)| path.ends_with("001.png")).unwrap();
    change(&out.path().join(picture));
    assert_made_again(&render(), &["001.png"]);
    assert!(contents(out.path()) == calm);
}

#[test]
fn what_cannot_be_made_again_here_is_an_error() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    fs::create_dir(balls.scene(0).join("ground_truth")).unwrap();
    fs::write(balls.scene(0).join("ground_truth/parts.json"), r#"{"total_mass_kg": 1.0, "parts": []}"#).unwrap();
    let weigh = || {
        let mut command = gprop();
        command.args(["evaluate", "mass", "--out"]).arg(out.path()).arg(balls.scene(0)).output().unwrap()
    };
    assert!(weigh().status.success());
    change(&out.path().join("parts.json"));
    assert_refused(&weigh(), 2, &["parts.json", "has changed since gprop wrote it", "gprop run"]);
}
