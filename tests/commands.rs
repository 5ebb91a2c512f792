//! What every command prints with `--json`, against `docs/commands.schema.json`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Output;
use std::sync::OnceLock;

use jsonschema::Validator;
use serde_json::{Value, json};

use crate::batch::ball::Balls;
use crate::query::{a, good_answer};
use crate::run::gprop;
use crate::support::said;
use crate::usage;

/// The published schemas: those of the commands, by their words, and what they share.
fn published() -> &'static Value {
    static PUBLISHED: OnceLock<Value> = OnceLock::new();
    PUBLISHED.get_or_init(|| {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
        let text = |name: &str| fs::read_to_string(docs.join(name)).unwrap();
        let mut report: Value = serde_json::from_str(&text("report.schema.json")).unwrap();
        let own = text("commands.schema.json").replace("report.schema.json#/$defs/", "#/$defs/");
        let mut published: Value =
            serde_json::from_str(&own.replace("\"report.schema.json\"", "\"#/$defs/report\"")).unwrap();
        let shared = published["$defs"].as_object_mut().unwrap();
        let of_report = report.as_object_mut().unwrap().remove("$defs").unwrap();
        shared.extend(of_report.as_object().unwrap().clone());
        shared.insert("report".to_owned(), report);
        published
    })
}

/// Everything in a value that the command's schema does not allow; also if the command has none.
pub fn problems(command: &str, value: &Value) -> Vec<String> {
    let mut schema = published()["commands"][command].clone();
    if schema.is_null() {
        return vec![format!("docs/commands.schema.json has no `{command}`")];
    }
    schema["$defs"] = published()["$defs"].clone();
    let validator: Validator = jsonschema::validator_for(&schema).unwrap();
    validator.iter_errors(value).map(|error| format!("{command}{}: {error:.200}", error.instance_path())).collect()
}

/// The words of the command that these words of a command line begin with.
pub fn command_of(words: &[String]) -> String {
    let both = words.iter().take(2).map(String::as_str).collect::<Vec<_>>().join(" ");
    if published()["commands"].get(&both).is_some() { both } else { words[0].clone() }
}

/// Commands without a result.
const WITHOUT: &[&str] = &["help", "mcp"];

/// Commands that need SAM, a network or data of others; `docs` and the tests of their rooms run them.
const ELSEWHERE: &[&str] = &[
    "evaluate masks",
    "evaluate objects",
    "evaluate parts",
    "evaluate prompts",
    "evaluate simulation",
    "objects",
    "setup",
];

/// A command line, with the codes with which it may end.
type Line = (&'static str, &'static [i32]);

/// Command lines in the folder of `ball-0`, whose answers are recorded.
const LINES: &[Line] = &[
    ("inspect ball-0", &[0, 3]),
    ("run ball-0 --dry-run", &[0]),
    ("run ball-0 --to scene", &[0]),
    ("run ball-0 --to segment", &[0]),
    ("run ball-0 --to consensus", &[0]),
    ("run ball-0 --to query", &[0]),
    ("run ball-0 --to grasp", &[0]),
    ("report ball-0", &[0]),
    ("view ball-0", &[0]),
    ("segment ball-0", &[0]),
    ("query ball-0", &[0]),
    ("query ball-0 --dry-run", &[0]),
    ("query ball-0 --export questions", &[0]),
    ("query ball-0 --import questions", &[0]),
    ("query ball-0 --direct --dry-run", &[0]),
    ("query ball-0 --prune", &[0]),
    ("answer ball-0", &[0]),
    ("vote ball-0", &[0]),
    ("show ball-0 picture.png", &[0]),
    ("show ball-0 picture.png --dry-run", &[0]),
    ("parts ball-0", &[0]),
    ("simulate --list", &[0]),
    ("simulate ball-0", &[0]),
    ("grasp ball-0", &[0]),
    ("grasp calibrate points.csv", &[0]),
    ("export ball-0 --format urdf,npz --out model", &[0]),
    ("audit model", &[0, 1]),
    ("batch . --to parts --dry-run", &[0]),
    ("batch . --to parts", &[0]),
    ("batch . --to parts --merge", &[0]),
    ("evaluate grasp --outcomes outcomes.csv", &[0]),
    ("evaluate hardness readings.csv", &[0]),
    ("evaluate mass --predictions predictions.json --truth truth.json", &[0]),
    ("evaluate robustness ball-0", &[0]),
    ("evaluate segmentation ball-0 --truth ball-0/ground_truth/maps", &[0]),
    ("materials show oak", &[0]),
    ("materials list --family wood", &[0]),
    ("materials check --stats", &[0]),
    ("scale board --out board.svg", &[0]),
    ("doctor", &[0, 4]),
    ("completions fish", &[0]),
    ("man", &[0]),
    ("man --out pages", &[0]),
];

/// `ball-0` with its answers, and the files that [`LINES`] name.
fn place() -> Balls {
    let balls = Balls::answering(1, &good_answer(a("rubber")));
    balls.write_truth(0);
    // Small enough for a gripper; a view is left to compare with.
    let quick = "frames = 2\nduration = 0.02\ngrid = 16\nview-list = \"000,001\"\n";
    let path = balls.scene(0).join("gprop.toml");
    let options = fs::read_to_string(&path).unwrap().replace("scale = \"metric\"", "scale = 0.4");
    fs::write(path, options + quick).unwrap();
    let asked = gprop().arg("query").arg(balls.scene(0)).args(balls.answers()).output().unwrap();
    assert!(asked.status.success(), "{}", said(&asked));
    let commands = (0..8).map(|k| 15.0 + 85.0 / 7.0 * f64::from(k));
    let points: String = commands.map(|command| format!("{command},{}\n", 0.4 * command)).collect();
    for (name, text) in [
        ("points.csv", format!("command,force_n\n{points}")),
        ("outcomes.csv", "object,policy,picked_up,undamaged\nmug,gprop,true,true\n".to_owned()),
        ("predictions.json", json!({ "A_1": [0.5, 1.5], "B_1": [2.0, 4.0] }).to_string()),
        ("truth.json", json!({ "A": 1.1, "B": 2.5 }).to_string()),
        ("readings.csv", "scene,view,x,y,shore,hardness\nball-0,000,32,24,A,40\n".to_owned()),
    ] {
        fs::write(balls.folder().join(name), text).unwrap();
    }
    balls
}

/// What was printed: one value, or a line for each.
fn values(output: &Output) -> Vec<Value> {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    match serde_json::from_str(&text) {
        Ok(value) => vec![value],
        Err(_) => text.lines().map(|line| serde_json::from_str(line).unwrap_or(Value::Null)).collect(),
    }
}

#[test]
fn every_command_with_a_result_prints_json_that_its_schema_describes() {
    let all = usage::commands();
    let is_group = |words: &[String]| words == ["evaluate"] || words == ["materials"] || words == ["scale"];
    let known: BTreeSet<String> = all
        .into_iter()
        .filter(|(words, _)| !words.is_empty() && !is_group(words))
        .map(|(words, _)| words.join(" "))
        .collect();
    let described: BTreeSet<String> = published()["commands"].as_object().unwrap().keys().cloned().collect();
    let without = WITHOUT.iter().map(|name| (*name).to_owned()).collect();
    assert_eq!(known.difference(&without).cloned().collect::<BTreeSet<_>>(), described, "each has a schema");
    let balls = place();
    let mut checked: BTreeSet<String> = ELSEWHERE.iter().map(|name| (*name).to_owned()).collect();
    let mut wrong = Vec::new();
    for (line, codes) in LINES {
        let words: Vec<String> = line.split(' ').map(str::to_owned).collect();
        // Without a browser.
        let output =
            gprop().args(&words).arg("--json").current_dir(balls.folder()).env("BROWSER", "true").output().unwrap();
        let code = output.status.code().unwrap_or(-1);
        if !codes.contains(&code) {
            wrong.push(format!("`{line}` ended with {code}: {}", said(&output)));
            continue;
        }
        let command = command_of(&words);
        let printed = values(&output);
        if printed.is_empty() {
            wrong.push(format!("`{line}` printed nothing"));
        }
        wrong.extend(
            printed.iter().flat_map(|value| problems(&command, value)).map(|problem| format!("`{line}`: {problem}")),
        );
        checked.insert(command);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(checked, described, "each is run");
    assert!(!problems("parts", &json!({ "parts": [] })).is_empty() && !problems("none", &json!({})).is_empty());
}
