//! Scenes, servers and files whose text would move a terminal's cursor, change its window's title or reverse the
//! reading direction.

use std::fs;
use std::path::Path;
use std::process::Output;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::run;
use crate::batch::ball::Balls;
use crate::query::client::{Server, error};
use crate::query::{a, good_answer};
use crate::run::gprop;

/// A title, a colour in C1, a bell, a carriage return, a bidi override, a line that looks like gprop's own, marks of reading
/// direction, a byte order mark and an invisible tag.
const EVIL: &str = "steel\x1b]0;owned\x07\u{9b}31m\x08\r\u{202e}\nerror: forged\u{200f}\u{61c}\u{feff}\u{e0041}";

/// True for a character that a terminal or a page would not show as itself.
fn acts(c: char) -> bool {
    let marks = ['\u{61c}', '\u{200e}', '\u{200f}', '\u{2028}', '\u{2029}', '\u{feff}'];
    let ranges = ['\u{202a}'..='\u{202e}', '\u{2066}'..='\u{2069}', '\u{e0000}'..='\u{e007f}'];
    c.is_control() || marks.contains(&c) || ranges.iter().any(|range| range.contains(&c))
}

/// Fails if a terminal would do anything but display the text.
#[track_caller]
fn assert_harmless(text: &[u8]) {
    let text = std::str::from_utf8(text).expect("gprop prints UTF-8");
    assert!(!text.contains(|c: char| c != '\n' && acts(c)), "{text:?}");
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
    let shown = r"steel\u001b]0;owned\u0007\u009b31m\u0008\r\u202e\nerror: forged\u200f\u061c\ufeff\udb40\udc41";
    for typed in [&["inspect"][..], &["run", "--to", "scene"], &["run", "--dry-run"]] {
        let output = gprop().arg(typed[0]).arg(&evil).args(&typed[1..]).output().unwrap();
        // The ball's photos are too small for `inspect` to be sure of them.
        let expected = if typed[0] == "inspect" { 3 } else { 0 };
        assert_eq!(output.status.code(), Some(expected), "{output:?}");
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
    let run_with = |words: &[&str], more: &[&str]| {
        let quick = ["--frames", "2", "--duration", "0.01", "--grid", "8"];
        gprop().args(words).arg(balls.scene(0)).args(balls.answers()).args(quick).args(more).output().unwrap()
    };
    let report = run_with(&["run"], &[]);
    assert_eq!(report.status.code(), Some(0), "{}", String::from_utf8_lossy(&report.stderr));
    assert_shown(&report, r"steel\u001b]0");
    assert_shown(&run_with(&["grasp"], &["--part", "propeller"]), r"steel\u001b]0");
    assert_shown(&run_with(&["simulate"], &["--anchor", "propeller"]), r"steel\u001b]0");
    // In JSON the caption is unchanged.
    let parts = run_with(&["parts"], &["--json"]);
    assert_harmless(&parts.stdout);
    let value: Value = serde_json::from_slice(&parts.stdout).unwrap();
    let caption = value["parts"][0]["caption"].as_str().unwrap();
    assert!(caption.contains(EVIL), "{caption:?}");
    let page = fs::read_to_string(balls.scene(0).join("gprop/report.html")).unwrap();
    assert!(!page.contains(|c: char| c != '\n' && acts(c)), "the page has the caption's escapes");
    // So have the data of its viewer and its tables.
    assert!(page.contains(r#""caption": "steel\\u001b]0;owned"#));
    let tables = page.split("data:text/csv;base64,").skip(1).map(|rest| rest.split_once('"').unwrap().0);
    let tables: Vec<Vec<u8>> = tables.map(|table| STANDARD.decode(table).unwrap()).collect();
    assert!(tables.len() >= 4);
    tables.iter().for_each(|table| assert_harmless(table));
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

#[test]
fn names_of_materials() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("table.csv");
    for evil in ["oak\u{200f}", "oak\u{feff}x", "oak\u{e0041}", "oak\u{1b}[31m"] {
        let built_in = include_str!("../../materials/wood.csv");
        assert!(built_in.contains("\nwood,afrormosia,"));
        fs::write(&table, built_in.replacen(",afrormosia,", &format!(",{evil},"), 1)).unwrap();
        let output = gprop().args(["materials", "check", "--materials"]).arg(&table).output().unwrap();
        assert_shown(&output, "control the display or cannot be seen");
    }
}
