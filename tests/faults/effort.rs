//! Files of a stranger that would take a time that grows with the square of their size: each has a bound, and what is beyond it
//! is refused with the reason. Where work only grows with the size, unit tests beside the code count it.

use std::fs;

use serde_json::{Value, json};

use super::hostile::forge;
use super::{assert_refused, run};
use crate::batch::ball::Balls;
use crate::run::gprop;

#[test]
fn a_photo_lies_in_no_more_folders_than_any_path_has() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    let path = balls.scene(0).join("transforms.json");
    let original: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    for key in ["file_path", "mask_path"] {
        for (name, words) in [("a/".repeat(30_000) + "000.png", "30000 folders"), ("a".repeat(5000), "5000 characters")]
        {
            let mut transforms = original.clone();
            transforms["frames"][0][key] = json!(name);
            fs::write(&path, transforms.to_string()).unwrap();
            let output = run(&balls, out.path());
            assert_refused(&output, 3, &["transforms.json", "frame 0", words]);
            assert!(output.stderr.len() < 1000, "the name is not shown as a whole");
        }
    }
}

#[test]
fn a_question_has_one_answer() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let answers = fs::read_to_string(out.path().join("answers.jsonl")).unwrap();
    let again = answers.clone() + answers.lines().next().unwrap() + "\n";
    forge(out.path(), "answers.jsonl", again.as_bytes());
    let vote = |from: &str| {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).args(["--to", "parts", "-q", "--out"]);
        command.arg(out.path()).args(["--from", from]).args(balls.answers()).output().unwrap()
    };
    assert_refused(&vote("vote"), 2, &["answers.jsonl", "has an answer already"]);
}

#[test]
fn segments_lie_in_each_other_only_so_deep() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let path = "segments/segments.json";
    let mut segments: Value = serde_json::from_slice(&fs::read(out.path().join(path)).unwrap()).unwrap();
    let of_view = segments["views"]["000"]["segments"].as_array_mut().unwrap();
    let first = of_view[0].clone();
    for id in of_view.len() + 1..=1000 {
        let mut deeper = first.clone();
        (deeper["id"], deeper["parent"]) = (json!(id), json!(id - 1));
        of_view.push(deeper);
    }
    forge(out.path(), path, segments.to_string().as_bytes());
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).args(["--to", "parts", "-q", "--out"]);
    let output = command.arg(out.path()).args(["--from", "query"]).args(balls.answers()).output().unwrap();
    assert_refused(&output, 2, &["segments.json", "not numbered"]);
}

#[test]
fn a_grasp_has_as_many_places_as_gprop_reports() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    let run = |more: &[&str]| {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).arg("--out").arg(out.path());
        // At a third of its size, the ball fits between the fingers.
        command.args([
            "-q",
            "--frames",
            "2",
            "--duration",
            "0.01",
            "--grid",
            "8",
            "--size",
            "320x180",
            "--scale",
            "0.3",
        ]);
        command.args(more).args(balls.answers()).output().unwrap()
    };
    let done = run(&[]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let mut grasp: Value = serde_json::from_slice(&fs::read(out.path().join("grasp.json")).unwrap()).unwrap();
    let places = grasp["candidates"].as_array_mut().expect("the ball can be grasped");
    assert!(!places.is_empty(), "{:?}", String::from_utf8_lossy(&done.stderr));
    let first = places[0].clone();
    places.resize(20_000, first);
    forge(out.path(), "grasp.json", grasp.to_string().as_bytes());
    assert_refused(&run(&["--from", "report"]), 2, &["grasp.json", "20,000 places"]);
}

#[test]
fn problems_of_an_import_are_listed_up_to_a_number() {
    let balls = Balls::new(1);
    let home = tempfile::tempdir().unwrap();
    let (work, export) = (home.path().join("work"), home.path().join("export"));
    let query = |more: &[&str]| {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("query").arg(balls.scene(0)).arg("--out").arg(&work);
        command.arg("--segments").arg(balls.labels(0)).args(more).arg(&export).output().unwrap()
    };
    let exported = query(&["--export"]);
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    // Answers as somebody might type them into the form, or write with an editor.
    let evil =
        ["{".repeat(5000), "[".repeat(200_000), "\u{202e}".to_owned(), "1e999".to_owned(), "\"\\ud800\"".to_owned()];
    let answers =
        evil.into_iter().chain((0..2000).map(|n| json!({ "query": format!("q{n}"), "answer": {} }).to_string()));
    fs::write(export.join("answers.jsonl"), answers.collect::<Vec<_>>().join("\n")).unwrap();
    let output = query(&["--import"]);
    assert_refused(&output, 5, &["there is no question", "other problems in other lines"]);
    assert!(output.stderr.len() < 10_000, "{}", output.stderr.len());
}
