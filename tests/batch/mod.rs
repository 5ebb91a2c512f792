//! `gprop batch` on made-up scenes that need no model.

// Tiny scenes of a ball of two materials.
pub mod ball;
// The page of all scenes, in a browser and as text.
mod page;
// A batch that is killed repeatedly.
mod kills;
// Scenes that hang, and scenes that cannot be named.
mod limits;
// All scenes' queries in one submission.
mod questions;
// The choice of scenes and shards.
mod selection;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Once, OnceLock};

use serde_json::{Value, json};

use crate::query::{a, good_answer};
use crate::run::gprop;
use crate::support::stderr;
use ball::Balls;

/// A batch up to the 3D parts on a data set, without the environment variables of a cluster.
fn batch(balls: &Balls, more: &[&str]) -> Command {
    let mut command = gprop();
    for name in ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX", "OPENAI_API_KEY"] {
        command.env_remove(name);
    }
    command.arg("batch").arg(balls.folder()).args(["--to", "parts"]).args(balls.answers()).args(more);
    command
}

/// Runs the command, expects an exit code, and returns the outcomes that it printed.
#[track_caller]
fn outcomes(command: &mut Command, code: i32) -> Vec<Value> {
    let output = command.arg("--json").output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
    let lines = String::from_utf8(output.stdout).unwrap();
    lines.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|_| panic!("{line}"))).collect()
}

fn lines(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn names(outcomes: &[Value]) -> Vec<&str> {
    outcomes.iter().map(|outcome| outcome["scene"].as_str().unwrap()).collect()
}

/// Every file below a folder, relative to it, with its content, except files with timings (`run.json`) and locks.
pub fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                open.push(path);
            } else if name != "run.json" && name != ".lock" {
                found.push((path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn one_bad_scene_stops_no_other() {
    let balls = Balls::new(4);
    fs::write(balls.scene(1).join("point_cloud.ply"), "ply\nno splat").unwrap();
    let first = outcomes(&mut batch(&balls, &["--jobs", "2"]), 6);
    assert_eq!(first.len(), 4);
    let file = balls.folder().join("gprop/batch/shard-0-of-1.jsonl");
    let kept = lines(&file);
    assert_eq!(names(&kept), ["ball-0", "ball-1", "ball-2", "ball-3"], "sorted, however they ended");
    assert!(first.iter().all(|outcome| kept.contains(outcome)), "what is printed is what is kept");
    for (number, outcome) in kept.iter().enumerate() {
        let expected = if number == 1 { "failed" } else { "done" };
        assert_eq!(outcome["state"], expected, "{outcome}");
    }
    assert_eq!(kept[1]["exit"], 3);
    assert!(kept[1]["error"].as_str().unwrap().contains("point_cloud.ply"), "{}", kept[1]);
    assert_eq!((&kept[0]["parts"], &kept[0]["views"]), (&2.into(), &3.into()), "{}", kept[0]);
    assert_eq!((&kept[0]["gaussians"], &kept[1]["gaussians"]), (&200.into(), &Value::Null));
    assert_eq!(kept[0]["materials"], json!([a("wood")]), "each material once");
    let mass = &kept[0]["mass_kg"];
    assert!(mass["low"].as_f64() <= mass["mid"].as_f64() && mass["low"].as_f64() > Some(0.0), "{mass}");
    let summary: Value =
        serde_json::from_slice(&fs::read(balls.folder().join("gprop/batch/summary.json")).unwrap()).unwrap();
    assert_eq!((&summary["done"], &summary["failed"]), (&3.into(), &1.into()));

    let text = batch(&balls, &[]).output().unwrap();
    assert_eq!(text.status.code(), Some(6), "a failed scene stays one");
    let table = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(table.contains("4 scenes: 3 done, 1 failed, 0 without a result"), "{table}");
    assert!(
        stderr(&text).contains("1 of 4 scenes is not done") && stderr(&text).contains("ball-1:"),
        "{}",
        stderr(&text)
    );
}

fn json_in(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_dry_run_counts_the_requests_of_each_scene_and_of_all() {
    let balls = Balls::new(3);
    let dry = |more: &[&str]| {
        let output = batch(&balls, &["--dry-run", "--price", "10"]).args(more).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    let json = |more: &[&str]| -> Value { serde_json::from_str(&dry(&[more, &["--json"]].concat())).unwrap() };
    let untouched = json(&[]);
    assert_eq!((&untouched["unknown"], &untouched["cost"]["requests"]), (&3.into(), &0.into()));
    assert!(
        dry(&[]).contains("what would be asked about 3 scenes is unknown until the parts are found"),
        "{}",
        dry(&[])
    );
    assert!(!balls.scene(0).join("gprop").exists(), "nothing is done");

    let consensus = ["--to", "consensus", "--price", "10"];
    assert_eq!(outcomes(&mut batch(&balls, &consensus), 0).len(), 3);
    fs::write(balls.scene(2).join("transforms.json"), "{").unwrap();
    let known = json(&[]);
    // Three views of two segments each; the third scene cannot be opened, and stops no other.
    let requests = |scene: usize| &known["scenes"][scene]["queries"]["cost"]["requests"];
    assert_eq!((requests(0), requests(1), &known["cost"]["requests"]), (&6.into(), &6.into(), &12.into()));
    let usd = |cost: &Value| cost["usd"].as_f64().unwrap();
    let each = [0, 1].map(|scene| usd(&known["scenes"][scene]["queries"]["cost"]));
    assert!(each[0] > 0.0 && (each[0] + each[1] - usd(&known["cost"])).abs() < 1e-9, "{known}");
    assert!(known["unknown"] == 1 && known["scenes"][2]["problem"].as_str().unwrap().contains("transforms.json"));
    let text = dry(&[]);
    let line = text.lines().find(|line| line.starts_with("ball-0")).unwrap();
    assert!(line.contains("to ask: 6 requests, about ") && line.ends_with(" USD"), "{text}");
    assert!(text.contains("3 scenes in shard 0/1; to ask: 12 requests"), "{text}");

    assert_eq!(outcomes(&mut batch(&balls, &["--price", "10"]), 6).len(), 3);
    let done = json(&[]);
    assert_eq!((&done["cost"]["requests"], &done["unknown"]), (&0.into(), &0.into()), "{done}");
}

#[test]
fn what_was_asked_and_paid_is_kept_for_each_scene_and_all() {
    let balls = Balls::new(2);
    let price = ["--price", "10"];
    let ended = outcomes(&mut batch(&balls, &price), 0);
    let home = balls.folder().join("gprop/batch");
    let summary = json_in(&home.join("summary.json"));
    assert_eq!((&summary["models"], &summary["asked"]["requests"]), (&json!(["test-model"]), &12.into()), "{summary}");
    for outcome in &ended {
        assert_eq!((&outcome["model"], &outcome["asked"]["requests"]), (&"test-model".into(), &6.into()), "{outcome}");
    }
    let sum = |key: &str| -> f64 { ended.iter().map(|outcome| outcome["asked"][key].as_f64().unwrap()).sum() };
    for key in ["input_tokens", "output_tokens", "usd"] {
        let all = summary["asked"][key].as_f64().unwrap();
        assert!(all > 0.0 && (all - sum(key)).abs() < 1e-9, "{key}: {summary}");
    }
    let tokens = (sum("input_tokens") + sum("output_tokens")) / 1e6;
    assert!((sum("usd") - 10.0 * tokens).abs() < 1e-9, "10 USD for a million tokens");

    // A second run with the same options asks nothing more, and what was paid stays.
    let again = [&price[..], &["--from", "vote"]].concat();
    let ended = outcomes(&mut batch(&balls, &again), 0);
    assert_eq!(ended[0]["asked"]["requests"], 6, "{}", ended[0]);

    let mut table = csv::Reader::from_path(home.join("summary.csv")).unwrap();
    let rows: Vec<std::collections::BTreeMap<String, String>> = table.deserialize().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 2);
    let outcome = ended.iter().find(|outcome| outcome["scene"] == "ball-1").unwrap();
    let number = |column: &str| rows[1][column].parse::<f64>().unwrap();
    assert_eq!((rows[1]["scene"].as_str(), rows[1]["state"].as_str()), ("ball-1", "done"));
    assert_eq!(Some(number("mass_low_kg")), outcome["mass_kg"]["low"].as_f64());
    assert_eq!(Some(number("usd")), outcome["asked"]["usd"].as_f64());
    assert_eq!((rows[1]["model"].as_str(), number("requests")), ("test-model", 6.0));
    let text = batch(&balls, &price).output().unwrap();
    assert!(String::from_utf8_lossy(&text.stdout).contains("seconds in total; 12 requests, "), "{text:?}");
}

#[test]
fn the_simulation_can_be_left_out_and_the_page_is_named() {
    let balls = Balls::new(1);
    let output = batch(&balls, &["--to", "report", "--no-simulate"]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let page = balls.folder().join("gprop/batch/index.html");
    assert_eq!(String::from_utf8_lossy(&output.stdout).lines().last(), page.to_str());
    let work = balls.scene(0).join("gprop");
    assert!(page.is_file() && work.join("report.html").is_file() && !work.join("simulation").exists());
    let nothing_left = batch(&balls, &["--to", "simulate", "--no-simulate"]).output().unwrap();
    assert_eq!(nothing_left.status.code(), Some(2), "{}", stderr(&nothing_left));
}

#[test]
fn done_scenes_are_skipped_and_failed_ones_retried_when_asked() {
    let balls = Balls::new(2);
    let labels = balls.labels(1).join("000.png");
    let content = fs::read(&labels).unwrap();
    // Of the same length: a scene whose files have different bytes is a different scene.
    fs::write(&labels, vec![b'#'; content.len()]).unwrap();
    assert_eq!(outcomes(&mut batch(&balls, &[]), 6).len(), 2);
    fs::write(&labels, content).unwrap();
    assert!(outcomes(&mut batch(&balls, &[]), 6).is_empty(), "neither done nor failed scenes are run");
    assert_eq!(names(&outcomes(&mut batch(&balls, &["--retry-failed"]), 0)), ["ball-1"]);
    assert!(outcomes(&mut batch(&balls, &[]), 0).is_empty());
    // An outcome is not reused if the scene's options or files differ.
    assert_eq!(outcomes(&mut batch(&balls, &["--views=3"]), 0).len(), 2);
    fs::write(balls.scene(0).join("notes.txt"), "one more file").unwrap();
    assert_eq!(names(&outcomes(&mut batch(&balls, &["--views=3"]), 0)), ["ball-0"]);
    fs::remove_dir_all(balls.scene(1).join("gprop")).unwrap();
    assert_eq!(names(&outcomes(&mut batch(&balls, &["--views=3"]), 0)), ["ball-1"]);
    assert_eq!(outcomes(&mut batch(&balls, &["--views=3", "--from", "vote"]), 0).len(), 2);
}

#[test]
fn results_of_stages_that_are_out_of_date_do_not_count() {
    let balls = Balls::new(1);
    assert!(outcomes(&mut batch(&balls, &[]), 0)[0]["mass_kg"].is_object());
    let again = outcomes(&mut batch(&balls, &["--to", "vote", "--vote", "frequency", "--scale", "2"]), 0);
    assert!(again[0].get("mass_kg").is_none() && again[0]["materials"].is_array(), "{again:?}");
}

#[test]
fn a_configuration_that_is_edited_during_a_run_makes_the_scene_due_again() {
    let configuration: Arc<OnceLock<PathBuf>> = Arc::default();
    let (edited, once) = (Arc::clone(&configuration), Once::new());
    let balls = Balls::asked(1, move |_| {
        once.call_once(|| {
            let path = edited.get().unwrap();
            // Of the same length: the size of a scene's files counts too.
            fs::write(path, fs::read_to_string(path).unwrap().replace("20000", "30000")).unwrap();
        });
        good_answer(a("wood"))
    });
    configuration.set(balls.scene(0).join("gprop.toml")).unwrap();
    let run = || outcomes(&mut batch(&balls, &[]), 0).len();
    assert_eq!(run(), 1);
    assert_eq!(run(), 1, "the first run was with the configuration of before");
    assert_eq!(run(), 0);
}

#[test]
fn a_file_that_an_option_names_counts_with_its_content() {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    fs::create_dir(home.path().join("gprop")).unwrap();
    let profile = home.path().join("gprop/tweezers.toml");
    let write = |stroke_m: &str| {
        let profile_text = format!(
            "name = \"tweezers\"\nforce_n = [1.0, 9.0]\nfinger_area_m2 = 1e-4\npad = \"rubber\"\n\
             stroke_m = {stroke_m}\n[command]\nenabled_from = 0.0\nfull = 9.0\n"
        );
        fs::write(&profile, profile_text).unwrap();
    };
    let run = |more: &[&str]| {
        let mut command = batch(&balls, more);
        command.env("XDG_CONFIG_HOME", home.path());
        outcomes(&mut command, 0).len()
    };
    let typed = ["--gripper", profile.to_str().unwrap()];
    write("0.02");
    assert_eq!((run(&typed), run(&typed)), (1, 0));
    write("0.03");
    assert_eq!((run(&typed), run(&typed)), (1, 0));
    fs::write(home.path().join("gprop/config.toml"), "gripper = \"tweezers.toml\"\n").unwrap();
    assert_eq!((run(&[]), run(&[])), (1, 0));
    write("0.02");
    assert_eq!((run(&[]), run(&[])), (1, 0));
}

#[test]
fn a_data_set_brings_no_link_for_the_batchs_folder() {
    for link in ["gprop", "gprop/batch"] {
        let (balls, outside) = (Balls::new(1), tempfile::tempdir().unwrap());
        let path = balls.folder().join(link);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::os::unix::fs::symlink(outside.path(), &path).unwrap();
        for more in [&["--dry-run"][..], &["--merge"], &[]] {
            let output = batch(&balls, more).output().unwrap();
            assert_eq!(output.status.code(), Some(2), "{more:?}: {}", stderr(&output));
            assert!(stderr(&output).contains("is a link"), "{more:?}: {}", stderr(&output));
        }
        assert_eq!(fs::read_dir(outside.path()).unwrap().count(), 0, "{link}");
        fs::create_dir(outside.path().join("batch")).unwrap();
        fs::write(outside.path().join("index.html"), "").unwrap();
        fs::write(outside.path().join("batch/index.html"), "").unwrap();
        let view = gprop().arg("view").arg(balls.folder()).output().unwrap();
        assert_eq!(view.status.code(), Some(2), "{link}: {}", stderr(&view));
        assert!(stderr(&view).contains("is a link"), "{link}: {}", stderr(&view));
    }
}

#[test]
fn any_number_side_by_side_gives_the_same_bytes() {
    let balls = Balls::new(3);
    let (one, three) = (balls.folder().with_file_name("one"), balls.folder().with_file_name("three"));
    outcomes(&mut batch(&balls, &["--jobs", "1", "--out", one.to_str().unwrap()]), 0);
    outcomes(&mut batch(&balls, &["--jobs", "3", "--out", three.to_str().unwrap()]), 0);
    for scene in ["ball-0", "ball-1", "ball-2"] {
        let (one, three) = (contents(&one.join(scene)), contents(&three.join(scene)));
        assert!(one.len() > 5, "{one:?}");
        assert!(one == three, "{scene}");
    }
}

#[test]
fn a_budget_of_memory_is_kept() {
    let balls = Balls::new(2);
    let refused = outcomes(&mut batch(&balls, &["--memory", "0.001", "--jobs", "2"]), 6);
    assert_eq!(refused.len(), 2);
    for outcome in &refused {
        let error = outcome["error"].as_str().unwrap();
        assert!(error.contains("--memory") && error.contains("more than the 0.00 GB"), "{error}");
        assert_eq!(outcome["exit"], Value::Null, "it was killed: {outcome}");
    }
    assert_eq!(outcomes(&mut batch(&balls, &["--memory", "8", "--jobs", "2", "--retry-failed"]), 0).len(), 2);
}

#[test]
fn a_budget_that_is_none_is_refused() {
    let balls = Balls::new(1);
    for (flag, given) in
        [("--memory", "-1"), ("--memory", "NaN"), ("--memory", "0"), ("--memory", "inf"), ("--jobs", "0")]
    {
        for typed in [vec![flag.to_owned(), given.to_owned()], vec![format!("{flag}={given}")]] {
            let output = batch(&balls, &["--dry-run"]).args(&typed).output().unwrap();
            let message = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{typed:?}: {message}");
            assert!(message.contains(given) && message.contains(flag), "{typed:?}: {message}");
            assert!(message.contains("or omit it"), "{typed:?} says not what to do: {message}");
        }
    }
}

#[test]
fn two_batches_on_one_shard_do_not_meet() {
    let balls = Balls::new(1);
    let shard = gprop::batch::Shard::WHOLE;
    let _held = gprop::batch::Ledger::open(&balls.folder().join("gprop/batch"), shard).unwrap();
    let output = batch(&balls, &[]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("is working in shard 0/1"), "{}", stderr(&output));
}

#[test]
fn masses_of_a_data_set_are_scored_by_its_weights() {
    let balls = Balls::new(2);
    let home = balls.folder().parent().unwrap().to_owned();
    let (splits, weights) = (home.join("splits.json"), home.join("filtered_product_weights.json"));
    fs::write(&splits, json!({ "test": ["ball-0"], "train": ["ball-1"] }).to_string()).unwrap();
    fs::write(&weights, json!({ "ball-0": 1.5, "ball-1": 2.5 }).to_string()).unwrap();
    let mut run = gprop();
    run.env_remove("OPENAI_API_KEY").arg("batch").arg(&home).args(["--to", "parts", "--split", "test"]);
    let output = run.args(balls.answers()).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let read = |path: PathBuf| serde_json::from_slice::<Value>(&fs::read(path).unwrap()).unwrap();
    let mass = read(balls.scene(0).join("gprop/parts.json"))["object"]["mass_kg"].clone();
    let [low, mid, high] = ["low", "mid", "high"].map(|key| mass[key].as_f64().unwrap());
    let predictions = home.join("gprop/batch/mass_predictions.json");
    assert_eq!(read(predictions.clone()), json!({ "ball-0": [low, high] }));
    let evaluate =
        |arguments: &[&std::ffi::OsStr]| gprop().args(["evaluate", "mass", "--json"]).args(arguments).output().unwrap();
    let scores = |arguments: &[&std::ffi::OsStr]| {
        let output = evaluate(arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let off = |found: &Value, predicted: f64| (found["ade"].as_f64().unwrap() - (predicted - 1.5).abs()).abs();
    // What people are shown is scored, except in files of NeRF2Physics' form, which hold no middle.
    let all = scores(&["--data-set".as_ref(), home.as_ref()]);
    assert!(off(&all, mid) < 1e-12 && all["missing"] == json!(["ball-1"]), "{all}");
    // So is a table whose objects were run one by one.
    fs::create_dir_all(balls.scene(1).join("gprop/objects/object_2")).unwrap();
    assert_eq!(scores(&["--data-set".as_ref(), home.as_ref()])["missing"], json!(["ball-1"]));
    let split = scores(&["--data-set".as_ref(), home.as_ref(), "--split".as_ref(), "test".as_ref()]);
    assert!(split["count"] == 1 && split.get("missing").is_none(), "{split}");
    let file = scores(&["--predictions".as_ref(), predictions.as_ref(), "--truth".as_ref(), weights.as_ref()]);
    assert!(off(&file, 0.5 * (low + high)) < 1e-12 && off(&file, mid) > 1e-6, "{file}");
    let none = evaluate(&["--data-set".as_ref(), home.as_ref(), "--split".as_ref(), "train".as_ref()]);
    assert_eq!(none.status.code(), Some(2));
    assert!(stderr(&none).contains("1 scene of the split \"train\", none of which has been run"), "{}", stderr(&none));

    // The user's own scale counts before what the data set states.
    let own = home.join("masses.csv");
    fs::write(&own, "name,mass_kg\nball-0,2.5\nbal-1,3\n").unwrap();
    let arguments = ["--data-set".as_ref(), home.as_os_str(), "--weights".as_ref(), own.as_os_str()];
    let found = scores(&arguments);
    assert!(found["count"] == 1 && (found["ade"].as_f64().unwrap() - (mid - 2.5).abs()).abs() < 1e-12, "{found}");
    let told = stderr(&evaluate(&arguments));
    assert!(
        told.contains("1 name that no chosen scene has (first: \"bal-1\"; scenes are called like \"ball-0\")"),
        "{told}"
    );
    let scene = scores(&[balls.scene(0).as_os_str(), "--weights".as_ref(), own.as_os_str()]);
    assert_eq!(scene["ade"], found["ade"]);

    // A scene that fails in a later batch is not scored by what an earlier one found.
    let splat = balls.scene(0).join("point_cloud.ply");
    let whole = fs::read(&splat).unwrap();
    fs::write(&splat, &whole[..whole.len() / 2]).unwrap();
    let mut run = gprop();
    run.env_remove("OPENAI_API_KEY").arg("batch").arg(&home).args(["--to", "parts", "--split", "test"]);
    assert_eq!(run.args(balls.answers()).output().unwrap().status.code(), Some(6));
    let failed = evaluate(&["--data-set".as_ref(), home.as_os_str()]);
    assert!(
        stderr(&failed).contains("failed in the last batch, and not scored: 1 scene (first: ball-0)"),
        "{failed:?}"
    );
}
