//! `gprop.toml` of a scene and `config.toml` of the user: what each may set, and which takes precedence.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use crate::batch::ball::Balls;
use crate::query::client::{CANARY, Server, error};
use crate::run::gprop;
use crate::support::{said, skipped};

/// Keys that no scene may set, each with a value that its option accepts.
const REFUSED: [(&str, &str); 29] = [
    ("ort-lib", "\"lib.so\""),
    ("ort_lib", "\"lib.so\""),
    ("sam-encoder", "\"encoder.onnx\""),
    ("sam-decoder", "\"decoder.onnx\""),
    ("offline", "false"),
    ("lmm-url", "\"http://127.0.0.1:9/v1\""),
    ("lmm-model", "\"model\""),
    ("lmm-key-env", "\"HOME\""),
    ("lmm-key-header", "\"x-key\""),
    ("lmm-temperature", "1"),
    ("lmm-max-tokens", "9"),
    ("lmm-body", "\"body.json\""),
    ("lmm-parallel", "9"),
    ("lmm-timeout-s", "9"),
    ("lmm-retries", "9"),
    ("lmm-wait-s", "9"),
    ("answers", "\"live\""),
    ("prompts", "\"prompts\""),
    ("recordings", "\"recorded\""),
    ("max-usd", "1000"),
    ("price", "\"0\""),
    ("prices", "\"prices.csv\""),
    ("max-simulation-minutes", "1e9"),
    ("threads", "1"),
    ("cache-embeddings", "true"),
    ("decoder", "\"onnxruntime\""),
    ("allow-read", "\"/\""),
    ("scale", "\"estimate\""),
    ("frames", "61"),
];

/// Paths that a scene may set, to places inside it.
const PATHS: [&str; 8] = ["splat", "cameras", "images", "masks", "segments", "materials", "labels", "gripper"];

/// The user's home with a configuration.
struct Home(TempDir);

impl Home {
    fn new(configuration: &str) -> Self {
        let home = Self(tempfile::tempdir().unwrap());
        fs::create_dir(home.folder()).unwrap();
        fs::write(home.folder().join("config.toml"), configuration).unwrap();
        home
    }

    fn folder(&self) -> PathBuf {
        self.0.path().join("gprop")
    }

    fn gprop(&self) -> Command {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").env("XDG_CONFIG_HOME", self.0.path());
        command
    }
}

/// Appends lines to a scene's file.
fn add(scene: &Path, lines: &str) {
    let path = scene.join("gprop.toml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(path, format!("{text}{lines}\n")).unwrap();
}

#[track_caller]
fn assert_refused(output: &Output, words: &[&str]) {
    let message = said(output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    for word in words {
        assert!(message.contains(word), "no {word:?} in: {message}");
    }
}

#[test]
fn a_scene_sets_only_what_concerns_it() {
    for (key, value) in REFUSED {
        let balls = Balls::new(1);
        add(&balls.scene(0), &format!("[more]\n{key} = {value}"));
        let output = gprop().arg("run").arg(balls.scene(0)).args(["--to", "scene"]).output().unwrap();
        let flag = format!("--{}", key.replace('_', "-"));
        let words = ["gprop.toml", "line 7", "a scene may not set", key, &flag, "~/.config/gprop/config.toml"];
        assert_refused(&output, &words);
        assert!(!balls.scene(0).join("gprop").exists(), "{key}: nothing was begun");
    }
}

#[test]
fn a_scene_names_paths_of_its_own_only() {
    let outside = tempfile::tempdir().unwrap();
    fs::write(outside.path().join("file"), "").unwrap();
    for key in PATHS {
        let balls = Balls::new(1);
        let scene = balls.scene(0);
        std::os::unix::fs::symlink(outside.path().join("file"), scene.join("link")).unwrap();
        fs::create_dir(scene.join("folder")).unwrap();
        std::os::unix::fs::symlink(outside.path(), scene.join("folder/link")).unwrap();
        let own = fs::read_to_string(scene.join("gprop.toml")).unwrap().replace("segments = \"labels\"\n", "");
        for path in [&*outside.path().to_string_lossy(), "../ball-0/labels", "link", "folder", "folder/link/file"] {
            fs::write(scene.join("gprop.toml"), format!("{own}{key} = {path:?}\n")).unwrap();
            let output = gprop().arg("run").arg(&scene).args(["--to", "scene"]).output().unwrap();
            assert_refused(
                &output,
                &["gprop.toml", "line 5", key, "leads out of the scene folder", &format!("--{key}")],
            );
        }
    }
}

#[test]
fn a_value_that_an_option_refuses_is_named_with_its_line() {
    let balls = Balls::new(1);
    add(&balls.scene(0), "[more]\nlevel = \"midle\"");
    let output = gprop().arg("run").arg(balls.scene(0)).args(["--to", "scene"]).output().unwrap();
    let words = ["gprop.toml", "line 7", "invalid value 'midle' for '--level", "possible values: small, middle, large"];
    assert_refused(&output, &words);
    let typed = gprop().arg("run").arg(balls.folder()).args(["--level", "midle"]).output().unwrap();
    assert_refused(&typed, &["invalid value 'midle' for '--level", "For more information"]);
}

#[test]
fn a_value_of_several_lines_is_named_on_one() {
    let balls = Balls::new(1);
    add(&balls.scene(0), r#"level = "midle\n\nx""#);
    let output = gprop().arg("run").arg(balls.scene(0)).args(["--to", "scene"]).output().unwrap();
    let words = ["line 6", r"invalid value 'midle\n\nx' for '--level", "possible values: small, middle, large"];
    assert_refused(&output, &words);
}

#[test]
fn a_refused_value_is_named_with_those_that_a_scene_may_set() {
    for (line, allowed) in [("frames = 61", "up to 60"), ("scale = \"estimate\"", "any other scale")] {
        let balls = Balls::new(1);
        fs::write(balls.scene(0).join("gprop.toml"), line).unwrap();
        let output = gprop().arg("run").arg(balls.scene(0)).args(["--to", "scene"]).output().unwrap();
        let value = line.replace('"', "");
        assert_refused(&output, &["line 1", &format!("a scene may not set `{value}` (allowed: {allowed}), because")]);
    }
    let balls = Balls::new(1);
    add(&balls.scene(0), "frames = 60");
    let output = gprop().arg("run").arg(balls.scene(0)).args(["--to", "scene"]).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn a_scenes_paths_begin_at_its_folder() {
    let balls = Balls::new(1);
    let scene = balls.scene(0);
    fs::rename(scene.join("images"), scene.join("photos")).unwrap();
    let transforms = fs::read_to_string(scene.join("transforms.json")).unwrap().replace("images/", "");
    fs::write(scene.join("cameras of mine.json"), transforms).unwrap();
    fs::remove_file(scene.join("transforms.json")).unwrap();
    add(&scene, "images = \"photos\"\ncameras = \"./cameras of mine.json\"\ngripper = \"franka-hand\"");
    // The result does not depend on the folder in which gprop is started.
    for (folder, name) in [(balls.folder(), "ball-0"), (scene.join("photos"), ".."), (std::env::temp_dir(), "")] {
        let name = if name.is_empty() { scene.clone() } else { PathBuf::from(name) };
        let mut command = gprop();
        command.current_dir(folder).arg("run").arg(name).args(["--to", "segment"]);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
    }
}

/// What a library writes to stderr when it is loaded.
const TRACE: &str = "was here";

/// A library that says so when it is loaded; `None`, with a message, if there is no compiler.
fn library(test: &str, folder: &Path) -> Option<PathBuf> {
    let (source, library) = (folder.join("evil.c"), folder.join("evil.so"));
    let code = format!(
        "#include <stdio.h>\n__attribute__((constructor)) static void run(void) {{ fputs({TRACE:?}, stderr); }}\n"
    );
    fs::write(&source, code).unwrap();
    let compiled = Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).status();
    if !compiled.is_ok_and(|status| status.success()) {
        skipped(test, "there is no C compiler");
        return None;
    }
    Some(library)
}

#[test]
fn a_scenes_library_is_not_loaded() {
    let balls = Balls::new(1);
    let folder = balls.scene(0);
    let Some(library) = library("a_scenes_library_is_not_loaded", &folder) else { return };
    fs::write(folder.join("gprop.toml"), format!("ort-lib = {library:?}\n")).unwrap();
    let run = gprop().args(["run", "--offline"]).arg(&folder).output().unwrap();
    assert_refused(&run, &["gprop.toml", "line 1", "ort-lib"]);
    let batch = gprop().args(["batch", "--offline", "--to", "segment"]).arg(balls.folder()).output().unwrap();
    assert_eq!(batch.status.code(), Some(6), "{}", said(&batch));
    assert!(said(&batch).contains("a scene may not set `ort-lib`"), "{}", said(&batch));
    assert!(!said(&run).contains(TRACE) && !said(&batch).contains(TRACE), "the scene's code ran");
    // It would have been loaded: the user may name it.
    let user = Home::new(&format!("ort-lib = {library:?}\n"));
    fs::write(folder.join("gprop.toml"), "").unwrap();
    let run = user.gprop().args(["segment", "--offline"]).arg(&folder).output().unwrap();
    assert_eq!(run.status.code(), Some(4), "it is not an ONNX Runtime: {}", said(&run));
    assert!(said(&run).contains(TRACE));
}

#[test]
fn a_scenes_server_hears_nothing() {
    let server = Server::new(|_, _, _| error(500, "a scene's server was asked"));
    let url = server.options().lmm_url.unwrap();
    let balls = Balls::new(1);
    add(&balls.scene(0), &format!("lmm-url = {url:?}\nlmm-model = \"test-model\""));
    let run = gprop().env("OPENAI_API_KEY", CANARY).arg("run").arg(balls.scene(0)).output().unwrap();
    assert_refused(&run, &["gprop.toml", "a scene may not set `lmm-"]);
    let mut batch = gprop();
    let batch = batch.env("OPENAI_API_KEY", CANARY).arg("batch").arg(balls.folder()).output().unwrap();
    assert_eq!(batch.status.code(), Some(6), "{}", said(&batch));
    let line = fs::read_to_string(balls.folder().join("gprop/batch/shard-0-of-1.jsonl")).unwrap();
    let outcome: Value = serde_json::from_str(line.trim()).unwrap();
    assert_eq!((&outcome["state"], &outcome["exit"]), (&"failed".into(), &2.into()), "{outcome}");
    assert!(outcome["error"].as_str().unwrap().contains("a scene may not set `lmm-"), "{outcome}");
    let mut submit = gprop();
    submit.env("OPENAI_API_KEY", CANARY).arg("batch").arg(balls.folder()).args(["--queries", "submit"]);
    let submit = submit.args(balls.answers()).output().unwrap();
    assert!(said(&submit).contains("a scene may not set `lmm-"), "{}", said(&submit));
    assert!(server.requests().is_empty());
}

/// The number of views that a run chose.
#[track_caller]
fn views(command: &mut Command, scene: &Path) -> usize {
    let output = command.arg("run").arg(scene).args(["--to", "scene"]).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let views: Value = serde_json::from_slice(&fs::read(scene.join("gprop/views.json")).unwrap()).unwrap();
    views["views"].as_array().unwrap().len()
}

#[test]
fn the_command_line_wins_over_the_scene_and_that_over_the_user() {
    let balls = Balls::new(1);
    let scene = balls.scene(0);
    assert_eq!(views(&mut gprop(), &scene), 3);
    let home = Home::new("[scene]\nviews = 1\n");
    assert_eq!(views(&mut home.gprop(), &scene), 1);
    add(&scene, "views = 2");
    assert_eq!(views(&mut home.gprop(), &scene), 2);
    assert_eq!(views(home.gprop().args(["--quiet"]), &scene), 2);
    let output = home.gprop().arg("run").arg(&scene).args(["--to", "scene", "--views", "3"]).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let views: Value = serde_json::from_slice(&fs::read(scene.join("gprop/views.json")).unwrap()).unwrap();
    assert_eq!(views["views"].as_array().unwrap().len(), 3);
}

#[test]
fn without_xdg_the_users_file_lies_in_the_home_folder() {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    fs::create_dir_all(home.path().join(".config/gprop")).unwrap();
    fs::write(home.path().join(".config/gprop/config.toml"), "views = 2").unwrap();
    for relative in [None, Some("relative")] {
        let mut command = gprop();
        command.env_remove("XDG_CONFIG_HOME").env("HOME", home.path());
        relative.map(|path| command.env("XDG_CONFIG_HOME", path));
        assert_eq!(views(&mut command, &balls.scene(0)), 2);
    }
}

#[test]
fn the_users_server_is_asked_and_the_budget_is_for_all_scenes() {
    let balls = Balls::new(2);
    let [_, url, _, model] = balls.answers();
    let home = Home::new(&format!("lmm-url = {url:?}\nlmm-model = {model:?}\nprices = \"mine.csv\"\nmax-usd = 1\n"));
    let prices = |usd_per_mtok: f64| {
        let header = "model,input_usd_per_mtok,output_usd_per_mtok,image_tokens,as_of,source";
        let row = format!("{model},{usd_per_mtok},0,patches 100000 1 0,2026-11-21,a contract");
        fs::write(home.folder().join("mine.csv"), format!("{header}\n{row}\n")).unwrap();
    };
    let batch = || {
        let mut command = home.gprop();
        command.env_remove("SLURM_ARRAY_TASK_ID").env_remove("JOB_COMPLETION_INDEX");
        command.arg("batch").arg(balls.folder()).args(["--to", "query", "--retry-failed"]).output().unwrap()
    };
    // Three views of two segments per scene: their price, and a budget of which each scene gets half.
    prices(1.0);
    let dry = home.gprop().arg("run").arg(balls.scene(0)).args(["--to", "consensus"]).output().unwrap();
    assert!(dry.status.success(), "{}", said(&dry));
    let dry = home.gprop().arg("query").arg(balls.scene(0)).args(["--dry-run", "--json"]).output().unwrap();
    let plan: Value = serde_json::from_slice(&dry.stdout).unwrap_or_else(|_| panic!("{}", said(&dry)));
    let most = plan["queries"]["cost"]["most_usd"].as_f64().unwrap_or_else(|| panic!("{plan}"));
    // All of one scene's questions then cost 0.7 dollars, more than its half.
    prices(0.7 / most);
    let refused = batch();
    assert_eq!(refused.status.code(), Some(6), "{}", said(&refused));
    assert!(said(&refused).contains("0.5"), "{}", said(&refused));
    prices(0.4 / most);
    let done = batch();
    assert!(done.status.success(), "{}", said(&done));
    assert_eq!(fs::read_dir(balls.scene(1).join("recorded")).unwrap().count(), 6);
}

#[test]
fn the_users_file_speaks_to_commands_without_a_scene() {
    let wood = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("materials/wood.csv")).unwrap();
    let home = Home::new("materials = \"mine.csv\"\n");
    let header = wood.lines().next().unwrap();
    let column = header.split(',').position(|name| name == "name").unwrap();
    let row = wood.lines().skip(1).find(|row| !row.contains('"')).unwrap();
    let row = row.replacen(row.split(',').nth(column).unwrap(), "bog oak", 1);
    fs::write(home.folder().join("mine.csv"), format!("{header}\n{row}\n")).unwrap();
    let output = home.gprop().args(["materials", "list", "--family", "wood"]).output().unwrap();
    assert!(output.status.success() && said(&output).contains("bog oak"), "{}", said(&output));
    let output = home.gprop().args(["materials", "list", "--family", "wood", "--json"]).output().unwrap();
    let listed: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mine = listed.as_array().unwrap().iter().find(|one| one["name"] == "bog oak").expect("my material");
    assert_eq!((&mine["family"], mine["density_kg_m3"].as_array().unwrap().len()), (&"wood".into(), 2));
}

#[test]
fn mistakes_in_the_users_file_are_named() {
    for (text, words) in [
        ("views = 2\nlmm-ur = \"x\"", ["line 2", "unknown key `lmm-ur`", "did you mean `lmm-url`"]),
        ("views = ", ["line 1", "config.toml", ""]),
        ("[query]\nmax-usd = 1979-05-27", ["line 2", "`max-usd` takes", ""]),
        ("[scene]\nviews = \"many\"", ["line 2", "invalid value 'many' for '--views", ""]),
        ("views = 2\nthreads = \"many\"", ["line 2", "invalid value 'many' for '--threads", ""]),
    ] {
        let (home, balls) = (Home::new(text), Balls::new(1));
        let output = home.gprop().arg("run").arg(balls.scene(0)).output().unwrap();
        assert_refused(&output, &[&["gprop/config.toml"], &words[..]].concat());
    }
}
