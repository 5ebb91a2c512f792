//! `--scale estimate`: one question about the whole object, and everything that follows from its answer says so.

use std::fs;
use std::path::Path;
use std::process::Output;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use gprop::gaussians::ELLIPSOID_DEVIATIONS;
use serde_json::{Value, json};

use super::{a, good_answer};
use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::run::gprop;
use crate::support::said;

/// Width of the balls in scene units: their Gaussians lie on a sphere of radius 0.1, and have standard deviations of 0.012. No
/// scale but the estimate is stated.
const WIDTH: f64 = 2.0 * (0.1 + 0.012 * ELLIPSOID_DEVIATIONS);
const FEW: &[&str] = &["--frames", "2", "--duration", "0.02", "--grid", "16"];
/// Stands wherever kilograms or newtons do.
const MARK: &str = "estimated scale";

/// A ball whose model says that it is between these lengths long, in cm.
fn ball(longest_side_cm: Value) -> Balls {
    Balls::asked(1, move |request| {
        let asks_size = request.to_string().contains("longest_side_cm");
        if asks_size { size(&longest_side_cm) } else { good_answer(a("wood")) }
    })
}

fn size(longest_side_cm: &Value) -> Value {
    json!({ "object": "a wooden ball", "clues": "its grain", "longest_side_cm": longest_side_cm })
}

fn run(balls: &Balls, scale: &str, more: &[&str]) -> Output {
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).args(["--scale", scale]).args(FEW).args(more);
    command.output().unwrap()
}

/// Asks the server.
fn ask(balls: &Balls) -> Output {
    run(balls, "estimate", &balls.answers().each_ref().map(String::as_str))
}

fn file(balls: &Balls, name: &str) -> String {
    fs::read_to_string(balls.scene(0).join("gprop").join(name)).unwrap()
}

fn json_of_file(balls: &Balls, name: &str) -> Value {
    serde_json::from_str(&file(balls, name)).unwrap()
}

#[test]
fn the_scale_follows_from_the_answer_and_all_results_say_so() {
    let balls = ball(json!([36, 44]));
    let first = ask(&balls);
    assert!(first.status.success(), "{}", said(&first));
    assert!(said(&first).contains("wooden ball") && said(&first).contains("uncertain by a factor of 1.8"));
    assert!(String::from_utf8_lossy(&first.stdout).matches(MARK).count() >= 2, "mass and grip: {}", said(&first));

    let found = json_of_file(&balls, "size.json");
    let view = found["view"].as_str().unwrap();
    assert!(balls.scene(0).join(format!("gprop/sheets/{view}_0.jpg")).is_file());
    // The centres of the outermost Gaussians lie almost 0.1 scene units away from the middle.
    let scale = found["scale"]["meters_per_unit"].as_f64().unwrap();
    let expected = (0.36_f64 * 0.44).sqrt() / WIDTH;
    assert!((scale / expected - 1.0).abs() < 0.03, "{scale} is not {expected}");
    let parts = json_of_file(&balls, "parts.json");
    assert!(parts["estimated_scale"].as_str().unwrap().contains("wooden ball"));
    let ends = &parts["meters_per_unit"];
    let ratio = ends["high"].as_f64().unwrap() / ends["low"].as_f64().unwrap();
    assert!((ratio - 44.0 / 36.0).abs() < 1e-9, "the whole interval counts: {ends}");
    let mass = &parts["object"]["mass_kg"];
    let ratio = mass["high"].as_f64().unwrap() / mass["low"].as_f64().unwrap();
    assert!(ratio > (44.0_f64 / 36.0).powi(3) * 0.99, "cubed in mass: {mass}");
    assert_eq!(json_of_file(&balls, "grasp.json")["estimated_scale"], true);
    assert!(file(&balls, "report.html").contains(MARK));
    assert_every_export_says_so(&balls);

    // The answer is recorded: the same run without a server gives the same results, in a folder of its own too.
    let again = balls.scene(0).join("again");
    let replayed = run(&balls, "estimate", &["--answers", "replay", "--out", again.to_str().unwrap()]);
    assert!(replayed.status.success(), "{}", said(&replayed));
    for name in ["parts.json", "grasp.json", "size.json"] {
        assert_eq!(fs::read_to_string(again.join(name)).unwrap(), file(&balls, name), "{name}");
    }
    spoil_the_recorded_answer(&balls);
    let spoilt = balls.scene(0).join("spoilt");
    let replayed = run(&balls, "estimate", &["--answers", "replay", "--out", spoilt.to_str().unwrap()]);
    assert_eq!(replayed.status.code(), Some(5), "{}", said(&replayed));
    let why = "the recorded answer does not have the form that was asked for";
    assert!(said(&replayed).contains(why), "{}", said(&replayed));

    // A stated scale takes its place, and nothing is marked any more.
    let stated = run(&balls, "metric", &[]);
    assert!(stated.status.success(), "{}", said(&stated));
    assert!(!file(&balls, "parts.json").contains("estimated"));
    assert!(!file(&balls, "grasp.json").contains("estimated") && !file(&balls, "report.html").contains(MARK));
}

fn spoil_the_recorded_answer(balls: &Balls) {
    let mut spoilt = 0;
    for (path, bytes) in contents(&balls.scene(0)) {
        let Ok(mut recording) = serde_json::from_slice::<Value>(&bytes) else { continue };
        if recording["response"].as_str().is_some_and(|response| response.contains("longest_side_cm")) {
            recording["response"] = "about a foot".into();
            fs::write(balls.scene(0).join(path), recording.to_string()).unwrap();
            spoilt += 1;
        }
    }
    assert!(spoilt > 0);
}

/// Formats in metres or kilograms; the archive of arrays has a number in place of words.
#[track_caller]
fn assert_every_export_says_so(balls: &Balls) {
    for (format, name) in [("mjcf", ".xml"), ("urdf", ".urdf"), ("usda", ".usda"), ("glb", ".glb"), ("npz", ".npz")] {
        let out = balls.scene(0).join(format!("export-{format}"));
        let output = gprop()
            .arg("export")
            .arg(balls.scene(0))
            .args(["--scale", "estimate", "--format", format, "--out"])
            .arg(&out)
            .output();
        let output = output.unwrap();
        assert!(output.status.success(), "{format}: {}", said(&output));
        let file = format!("ball_0{name}");
        let written = contents(&out);
        let main = written.iter().find(|(path, _)| path.file_name().is_some_and(|found| *found == *file));
        let Some((_, bytes)) = main else { panic!("{format}: no {file}") };
        let mark = if format == "npz" { "scale_is_estimated" } else { MARK };
        assert!(bytes.windows(mark.len()).any(|window| window == mark.as_bytes()), "{format} does not say {mark:?}");
    }
}

#[test]
fn without_an_answer_nothing_else_is_asked() {
    let balls = ball(json!([36, 44]));
    let output = run(&balls, "estimate", &["--answers", "replay"]);
    assert_eq!(output.status.code(), Some(5), "{}", said(&output));
    assert!(said(&output).contains("--scale estimate asks for in view"), "{}", said(&output));
}

#[test]
fn an_answer_that_is_no_length_leaves_the_scale_unknown() {
    let balls = ball(json!([0, 0]));
    let output = ask(&balls);
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("did not say how long the object is"), "{}", said(&output));
    assert!(json_of_file(&balls, "size.json")["scale"].is_null());
}

#[test]
fn a_length_that_gives_no_scale_ends_the_run_before_anything_else_is_asked() {
    let asked = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&asked);
    let balls = Balls::asked(1, move |_| {
        count.fetch_add(1, Ordering::SeqCst);
        size(&json!([1e9, 1e10]))
    });
    let output = ask(&balls);
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    assert!(said(&output).contains("give another --scale"), "{}", said(&output));
    assert_eq!(asked.load(Ordering::SeqCst), 1);
}

#[test]
fn the_question_can_be_answered_elsewhere() {
    let balls = ball(json!([36, 44]));
    let scene = balls.scene(0);
    let out = scene.join("questions");
    let query = |more: &[&str], folder: &Path| {
        let output = gprop().arg("query").arg(&scene).args(["--scale", "estimate"]).args(more).arg(folder).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", said(&output));
    };
    query(&["--export"], &out);
    let mut sizes = 0;
    let lines: Vec<String> = fs::read_to_string(out.join("queries.jsonl"))
        .unwrap()
        .lines()
        .map(|line| {
            let question: Value = serde_json::from_str(line).unwrap();
            let prompt = fs::read_to_string(out.join(question["prompt"].as_str().unwrap())).unwrap();
            let asks_size = prompt.contains("longest_side_cm");
            sizes += usize::from(asks_size);
            let answer = if asks_size { size(&json!([44, 36])) } else { good_answer(a("wood")) };
            json!({ "query": question["query"], "answer": answer, "model": "a person" }).to_string()
        })
        .collect();
    assert_eq!(sizes, 1);
    fs::write(out.join("answers.jsonl"), lines.join("\n")).unwrap();
    query(&["--import"], &out);
    let output = run(&balls, "estimate", &["--answers", "replay"]);
    assert!(output.status.success(), "{}", said(&output));
    let found = json_of_file(&balls, "size.json");
    assert_eq!(found["longest_side_m"], json!([0.36, 0.44]), "the ends are put in order");
}
