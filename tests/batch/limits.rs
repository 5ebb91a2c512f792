//! Scenes that hang, and scenes that cannot be named: a batch ends, leaves no process behind, and skips no scene
//! silently.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::process::Stdio;

use serde_json::Value;

use super::ball::Balls;
use super::{batch, lines, outcomes, stderr};
use crate::faults::locks::{Hanging, has_ended, wait_for};

#[test]
fn a_scene_that_hangs_is_ended_with_all_that_it_started() {
    let (balls, hanging) = (Balls::new(2), Hanging::new());
    balls.forget_labels(0);
    fs::write(balls.scene(1).join("point_cloud.ply"), "ply\nno splat").unwrap();
    // Six seconds: starting the program that hangs takes a hundredth of that, and so does refusing the other scene.
    let mut command = batch(&balls, &["--jobs", "1", "--max-minutes", "0.1"]);
    hanging.instead_of_fetching(&mut command);
    let found = outcomes(&mut command, 6);
    assert_eq!(found.len(), 2, "the others go on: {found:?}");
    assert_eq!((&found[0]["scene"], &found[0]["state"]), (&"ball-0".into(), &"failed".into()));
    assert_eq!(found[0]["error"], "took longer than --max-minutes 0.1");
    assert_eq!(found[0]["exit"], Value::Null, "it was killed");
    assert_eq!(found[1]["exit"], 3);
    let left = hanging.process();
    wait_for("what the scene started to end", || has_ended(&left));
    assert_eq!(lines(&balls.folder().join("gprop/batch/shard-0-of-1.jsonl")).len(), 2);
}

#[test]
fn a_batch_that_is_killed_leaves_no_process_behind() {
    let (balls, hanging) = (Balls::new(1), Hanging::new());
    balls.forget_labels(0);
    let mut command = batch(&balls, &[]);
    hanging.instead_of_fetching(&mut command);
    let mut process = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let left = hanging.process();
    process.kill().unwrap();
    process.wait().unwrap();
    wait_for("what the batch's scene started to end", || has_ended(&left));
}

#[test]
fn a_limit_that_is_none_is_refused() {
    let balls = Balls::new(1);
    for given in ["0", "-1", "nan", "inf", "1e300", "soon"] {
        let output = batch(&balls, &["--dry-run", "--max-minutes", given]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{given}");
        assert!(stderr(&output).contains("above 0, up to 1000000"), "{given}: {}", stderr(&output));
    }
}

#[test]
fn a_pipe_in_place_of_a_splat_holds_up_nothing() {
    let balls = Balls::new(2);
    let splat = balls.scene(0).join("point_cloud.ply");
    fs::remove_file(&splat).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&splat).status().unwrap().success());
    let found = outcomes(&mut batch(&balls, &["--jobs", "1"]), 6);
    let failed = found.iter().find(|outcome| outcome["scene"] == "ball-0").unwrap();
    assert!(failed["error"].as_str().unwrap().contains("it is a named pipe"), "{failed}");
    assert!(found.iter().any(|outcome| outcome["scene"] == "ball-1" && outcome["state"] == "done"), "{found:?}");
}

// Other systems refuse such names.
#[cfg(target_os = "linux")]
#[test]
fn a_data_set_whose_path_is_not_unicode_is_run_once() {
    let balls = Balls::new(1);
    let odd = balls.folder().with_file_name(OsStr::from_bytes(b"caf\xe9"));
    fs::rename(balls.folder(), &odd).unwrap();
    let run = || {
        let mut command = crate::run::gprop();
        outcomes(command.arg("batch").arg(&odd).args(["--to", "scene"]), 0)
    };
    let first = run();
    assert!(first[0]["work"].as_str().unwrap().ends_with("caf\u{fffd}/ball-0/gprop"), "{first:?}");
    assert!(run().is_empty(), "it is done");
    let home = odd.join("gprop/batch");
    assert_eq!(lines(&home.join("shard-0-of-1.jsonl")), first);
    let summary: Value = serde_json::from_slice(&fs::read(home.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["outcomes"][0]["work"], first[0]["work"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_whose_path_is_not_unicode_counts_with_its_content() {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    let materials = home.path().join(OsStr::from_bytes(b"l\xe9.csv"));
    let wood = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/materials/wood.csv")).unwrap();
    let run = || outcomes(batch(&balls, &["--to", "scene"]).arg("--materials").arg(&materials), 0).len();
    fs::write(&materials, &wood).unwrap();
    assert_eq!((run(), run()), (1, 0));
    fs::write(&materials, wood + "\n").unwrap();
    assert_eq!((run(), run()), (1, 0));
}

#[test]
fn a_folder_whose_name_is_not_utf_8_is_listed_as_skipped() {
    let balls = Balls::new(2);
    let odd = balls.folder().join(OsStr::from_bytes(b"ball-\xff\x1b[31m"));
    fs::rename(balls.scene(1), &odd).unwrap();
    const SHOWN: &str = "ball-\\xFF\\u{1b}[31m";

    let dry = batch(&balls, &["--dry-run", "--json"]).output().unwrap();
    let dry: Value = serde_json::from_slice(&dry.stdout).unwrap();
    assert_eq!(dry["skipped"][0], SHOWN);
    let output = batch(&balls, &[]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("is not UTF-8") && stderr(&output).contains(SHOWN), "{}", stderr(&output));
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.contains(&format!("{SHOWN}  skipped")), "{table}");
    assert!(table.contains("2 scenes: 1 done, 0 failed, 0 without a result, 1 skipped"), "{table}");
    let home = balls.folder().join("gprop/batch");
    let summary: Value = serde_json::from_slice(&fs::read(home.join("summary.json")).unwrap()).unwrap();
    assert_eq!((&summary["skipped"], &summary["outcomes"][1]["state"]), (&1.into(), &"skipped".into()));
    assert!(summary["outcomes"][1]["error"].as_str().unwrap().contains("rename it"), "{summary}");
    let page = fs::read_to_string(home.join("index.html")).unwrap();
    assert!(page.contains("ball-\\xFF") && page.contains("class=\"state skipped\""), "{page}");
    let again = outcomes(&mut batch(&balls, &[]), 0);
    assert_eq!(again.len(), 1, "listed each time: {again:?}");
    assert!(outcomes(&mut batch(&balls, &["--filter", "ball-0"]), 0).is_empty(), "not asked for");
}
