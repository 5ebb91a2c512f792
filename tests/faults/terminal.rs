//! Scenes, servers and files whose text would move a terminal's cursor, change its window's title or reverse the
//! reading direction.

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use super::run;
use crate::batch::ball::Balls;
use crate::query::client::{Server, error};
use crate::query::{a, good_answer};
use crate::run::gprop;

/// A title, a colour in C1, a bell, a carriage return, a bidi override, and a line that looks like gprop's own.
const EVIL: &str = "steel\x1b]0;owned\x07\u{9b}31m\x08\r\u{202e}\nerror: forged";

/// Fails if a terminal would do anything but display the text.
#[track_caller]
fn assert_harmless(text: &[u8]) {
    let text = std::str::from_utf8(text).expect("gprop prints UTF-8");
    let acts = |c: char| {
        (c.is_control() && c != '\n')
            || ('\u{202a}'..='\u{202e}').contains(&c)
            || ('\u{2066}'..='\u{2069}').contains(&c)
    };
    assert!(!text.contains(acts), "{text:?}");
    assert!(!text.lines().any(|line| line.starts_with("error: forged")), "{text}");
}

#[track_caller]
fn assert_shown(output: &Output, words: &str) {
    assert_harmless(&output.stdout);
    assert_harmless(&output.stderr);
    let all = [output.stdout.as_slice(), &output.stderr].concat();
    let all = String::from_utf8_lossy(&all);
    assert!(all.contains(words), "no {words} in {all}");
}

#[test]
fn names_of_scenes() {
    let balls = Balls::new(1);
    let evil = balls.folder().join(EVIL);
    fs::rename(balls.scene(0), &evil).unwrap();
    let shown = r"steel\u001b]0;owned\u0007\u009b31m\u0008\r\u202e\nerror: forged";
    for typed in [&["inspect"][..], &["run", "--to", "scene"], &["run", "--dry-run"]] {
        let output = gprop().arg(typed[0]).arg(&evil).args(&typed[1..]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        assert_harmless(&output.stdout);
        assert_harmless(&output.stderr);
    }
    let batch = |more: &[&str]| gprop().arg("batch").arg(balls.folder()).args(more).output().unwrap();
    assert_shown(&batch(&["--dry-run"]), shown);
    assert_shown(&batch(&["--to", "scene"]), shown);
    // The same JSON, only with escapes, so that it is safe to display.
    let output = batch(&["--dry-run", "--json"]);
    assert_harmless(&output.stdout);
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(value["scenes"][0]["name"], EVIL);
    // A scene that fails.
    fs::write(evil.join("point_cloud.ply"), "ply\nno splat").unwrap();
    let failed = batch(&["--to", "parts"]);
    assert_eq!(failed.status.code(), Some(6));
    assert_shown(&failed, shown);
}

#[test]
fn headers_of_files() {
    let balls = Balls::new(1);
    let out = tempfile::tempdir().unwrap();
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty \x1b[2J\u{9b}31m x\nend_header\n0\n";
    fs::write(balls.scene(0).join("point_cloud.ply"), header).unwrap();
    assert_shown(&run(&balls, out.path()), r"\u001b[2J");
    let properties = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\x1b[31m\nproperty float x\x1b[31m\n";
    fs::write(balls.scene(0).join("point_cloud.ply"), format!("{properties}end_header\n0 0 0\n")).unwrap();
    assert_shown(&run(&balls, out.path()), r"\u001b[31m");
    fs::write(
        balls.scene(0).join("transforms.json"),
        json!({ "frames": [{ "file_path": EVIL, "transform_matrix": [] }] }).to_string(),
    )
    .unwrap();
    assert_shown(&run(&balls, out.path()), r"\u001b]0;owned");
}

#[test]
fn values_in_a_scenes_configuration() {
    let balls = Balls::new(1);
    let out = tempfile::tempdir().unwrap();
    let escaped = serde_json::to_string(EVIL).unwrap();
    for line in [format!("views = {escaped}"), format!("{escaped} = 1"), format!("level = {escaped}")] {
        fs::write(balls.scene(0).join("gprop.toml"), line).unwrap();
        let output = run(&balls, out.path());
        assert_harmless(&output.stdout);
        assert_harmless(&output.stderr);
    }
}

/// A ball whose parts are named [`EVIL`].
fn evil_ball() -> Balls {
    let mut answer = good_answer(a("wood"));
    answer["caption"] = json!(EVIL);
    Balls::answering(1, &answer)
}

#[test]
fn captions_of_parts() {
    let balls = evil_ball();
    let with = |words: &[&str], more: &[&str]| {
        let quick = ["--frames", "2", "--duration", "0.01", "--grid", "8"];
        gprop().args(words).arg(balls.scene(0)).args(balls.answers()).args(quick).args(more).output().unwrap()
    };
    let report = with(&["run"], &[]);
    assert_eq!(report.status.code(), Some(0), "{}", String::from_utf8_lossy(&report.stderr));
    assert_shown(&report, r"steel\u001b]0");
    assert_shown(&with(&["grasp"], &["--part", "propeller"]), r"steel\u001b]0");
    assert_shown(&with(&["simulate"], &["--anchor", "propeller"]), r"steel\u001b]0");
    // In JSON the caption is unchanged.
    let parts = with(&["parts"], &["--json"]);
    assert_harmless(&parts.stdout);
    let value: Value = serde_json::from_slice(&parts.stdout).unwrap();
    let caption = value["parts"][0]["caption"].as_str().unwrap();
    assert!(caption.contains(EVIL), "{caption:?}");
    let page = fs::read(balls.scene(0).join("gprop/report.html")).unwrap();
    assert!(!page.contains(&0x1b), "the page has the caption's escapes");
    weigh(&balls.scene(0));
    let weighed = gprop().args(["evaluate", "mass"]).arg(balls.scene(0)).output().unwrap();
    assert_shown(&weighed, "ball-0");
}

/// Ground truth for the masses of a scene.
fn weigh(scene: &Path) {
    fs::create_dir(scene.join("ground_truth")).unwrap();
    fs::write(scene.join("ground_truth/parts.json"), json!({ "total_mass_kg": 1.0, "parts": [] }).to_string()).unwrap();
}

#[test]
fn what_a_server_says() {
    let balls = Balls::new(1);
    let server = Server::new(|_, _, _| error(400, EVIL));
    let out = tempfile::tempdir().unwrap();
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("query").arg(balls.scene(0)).arg("--out").arg(out.path());
    let output =
        command.args(["--lmm-model", "test-model", "--lmm-url", &server.options().lmm_url.unwrap()]).output().unwrap();
    assert_eq!(output.status.code(), Some(5), "{output:?}");
    assert_shown(&output, r"\u001b]0;owned");
}
