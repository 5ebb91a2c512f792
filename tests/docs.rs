//! Every command in the README and in `docs/`.
//!
//! A command of gprop (also as `cargo run --release --`) in a block marked `sh` is run, in the order of the page, in a folder
//! with a scene called `my_scene` and the files that the pages speak of. A comment after it says where that is not all there
//! is to it:
//!
//! | comment | what the test does |
//! | --- | --- |
//! | `# needs a server`, `# takes minutes` | runs it with `--dry-run`, which sends and computes nothing |
//! | `# needs setup` | runs it; exit code 4, files missing, is as good as 0 |
//! | `# needs answers`, `# needs the runs above` | holds its words and flags against the help, as below |
//!
//! Every command is run with `--json` added, and must print JSON.
//!
//! Commands elsewhere (in running text, in tables, with words in capitals) are held against the help: the subcommand must exist
//! and know every flag.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::json;
use tempfile::TempDir;

use crate::run::{QUICK, gprop, hammer};
use crate::support::{models, skipped};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README and the pages of `docs/` and of the data folders.
fn pages() -> Vec<PathBuf> {
    let mut pages: Vec<PathBuf> =
        fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    pages.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    pages.insert(0, root().join("README.md"));
    pages.extend(["materials/README.md", "grippers/README.md", "fixtures/README.md"].map(|name| root().join(name)));
    pages
}

/// A command of a block marked `sh` and the comment after it.
struct Line {
    command: String,
    comment: String,
}

/// The lines of a page's `sh` blocks that are commands of gprop.
fn lines(page: &str) -> Vec<Line> {
    let mut found = Vec::new();
    let mut in_block = false;
    for line in page.lines() {
        if line.starts_with("```") {
            in_block = line == "```sh";
        } else if in_block {
            let (command, comment) = line.split_once(" #").unwrap_or((line, ""));
            let command = command.trim().replace("cargo run --release -- ", "gprop ");
            found.push(Line { command, comment: comment.trim().to_owned() });
        }
    }
    found.retain(|line| line.command.starts_with("gprop "));
    found
}

/// Commands in running text: what stands between backquotes, begins with `gprop` and a word, and is not in an `sh` block.
fn spans(page: &str) -> Vec<String> {
    let outside: String = page.split("```").step_by(2).collect();
    let spans = outside.split('`').skip(1).step_by(2).map(|span| span.replace('\n', " "));
    let indented = page.lines().filter_map(|line| line.strip_prefix("    gprop ")).map(|rest| format!("gprop {rest}"));
    spans.filter(|span| span.starts_with("gprop ")).chain(indented).collect()
}

/// The words of a command line; quotes hold words together.
fn words(command: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut quoted = false;
    for c in command.chars() {
        match c {
            '"' => quoted = !quoted,
            ' ' if !quoted => words.push(String::new()),
            c => words.last_mut().expect("there is one from the start").push(c),
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

/// What is wrong with a command by gprop's own help; `None` where nothing is.
fn refused_by_the_help(command: &str) -> Option<String> {
    let words = words(command);
    let plain = |word: &&String| word.chars().all(|c| c.is_ascii_lowercase());
    let path: Vec<&String> = words[1..].iter().take_while(plain).take(2).collect();
    // The second word may be a subcommand (`grasp calibrate`) or an argument (`inspect folder`).
    let help = (1..=path.len()).rev().find_map(|length| {
        let output = gprop().args(&path[..length]).arg("--help").output().unwrap();
        output.status.success().then(|| String::from_utf8(output.stdout).unwrap())
    });
    let top = || String::from_utf8(gprop().arg("--help").output().unwrap().stdout).unwrap();
    let help = match (help, path.is_empty()) {
        (Some(help), _) => help,
        (None, true) => top(),
        (None, false) => return Some(format!("`{command}`: no such command")),
    };
    let known = |flag: &str| help.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).any(|word| word == flag);
    let flags = words.iter().filter(|word| word.starts_with("--")).map(|word| word.split('=').next().unwrap());
    let unknown: Vec<&str> = flags.flat_map(|flag| flag.split('|')).filter(|flag| !known(flag)).collect();
    (!unknown.is_empty()).then(|| format!("`{command}`: the help has no {unknown:?}"))
}

/// A folder with what the pages' commands work on.
fn desk() -> TempDir {
    let desk = TempDir::new().unwrap();
    let at = |name: &str| desk.path().join(name);
    let scene = hammer();
    // The quick options stand in the scene's own configuration, so that the commands are run as they are written.
    let mut configuration = fs::read_to_string(scene.path().join("gprop.toml")).unwrap();
    for option in QUICK.chunks(2) {
        configuration += &format!("{} = \"{}\"\n", option[0].trim_start_matches('-'), option[1]);
    }
    fs::write(scene.path().join("gprop.toml"), configuration).unwrap();
    fs::rename(scene.keep(), at("my_scene")).unwrap();
    for folder in ["fixtures", "docs"] {
        #[cfg(unix)]
        std::os::unix::fs::symlink(root().join(folder), at(folder)).unwrap();
    }
    // Over all of the commands that the paper's gripper obeys.
    let points: Vec<String> = (0..8)
        .map(|k| 15.0 + 85.0 / 7.0 * f64::from(k))
        .map(|command| format!("{command},{}", 0.4 * command))
        .collect();
    fs::write(at("points.csv"), format!("command,force_n\n{}\n", points.join("\n"))).unwrap();
    fs::write(at("outcomes.csv"), "object,policy,picked_up,undamaged\nmug,gprop,true,true\n").unwrap();
    fs::write(at("predictions.json"), json!({"A_1": [0.5, 1.5], "B_1": [2.0, 4.0]}).to_string()).unwrap();
    fs::write(at("truth.json"), json!({"A": 1.1, "B": 2.5}).to_string()).unwrap();
    fs::write(at("readings.csv"), "scene,view,x,y,shore,hardness\nmy_scene,003,256,256,D,80\n").unwrap();
    let truth = at("my_scene/ground_truth");
    fs::create_dir(&truth).unwrap();
    fs::copy(root().join("fixtures/hammer/ground_truth/parts.json"), truth.join("parts.json")).unwrap();
    let wood = fs::read_to_string(root().join("materials/wood.csv")).unwrap();
    fs::write(at("my_materials.csv"), wood.lines().take(2).map(|line| format!("{line}\n")).collect::<String>())
        .unwrap();
    let settings = json!({
        "width": 512, "height": 512, "points_per_side": 4, "crop_n_layers": 0, "pred_iou_thresh": 0.7, "stability_score_thresh": 0.85,
        "stability_score_offset": 1.0, "box_nms_thresh": 0.7, "min_mask_region_area": 0, "all": [],
    });
    fs::write(at("masks.json"), settings.to_string()).unwrap();
    fs::write(
        at("fall.json"),
        json!({ "n_grid": 16, "frame_num": 1, "frame_dt": 0.01, "substep_dt": 1e-3 }).to_string(),
    )
    .unwrap();
    // Trajectories of a peer, which only a development checkout has.
    #[cfg(unix)]
    for folder in ["../shared/reference", "../../shared/reference"].map(|folder| root().join(folder)) {
        if folder.exists() && !at("reference").exists() {
            std::os::unix::fs::symlink(folder, at("reference")).unwrap();
        }
    }
    desk
}

#[test]
fn every_command_in_running_text_is_one_that_the_help_knows() {
    let mut checked = 0;
    let mut wrong = Vec::new();
    for path in pages() {
        let page = fs::read_to_string(&path).unwrap();
        let unrun = |line: &Line| ["needs answers", "needs the runs above"].contains(&line.comment.as_str());
        let lines = lines(&page).into_iter().filter(unrun).map(|line| line.command);
        for command in spans(&page).into_iter().chain(lines) {
            checked += 1;
            wrong.extend(refused_by_the_help(&command).map(|what| format!("{}: {what}", path.display())));
        }
    }
    assert!(checked > 40, "only {checked} commands were found");
    assert_eq!(wrong, Vec::<String>::new());
    assert!(refused_by_the_help("gprop run SCENE --no-such-flag").is_some());
    assert!(refused_by_the_help("gprop no SCENE").is_some());
}

/// Commands with a result that stand in no block.
const MORE_WITH_A_RESULT: &[&str] = &[
    "run my_scene --dry-run",
    "segment my_scene",
    "query my_scene",
    "query my_scene --prune",
    "query my_scene --export open",
    "query my_scene --import open",
    "vote my_scene",
    "parts my_scene",
    "simulate my_scene",
    "simulate --list",
    "segment my_scene/images/003.png --out picture",
    "query my_scene/images/003.png --dry-run",
    "evaluate mass my_scene",
    "evaluate hardness readings.csv",
    "evaluate prompts fixtures/hammer --views 1",
    "evaluate masks my_scene/images/003.png masks.json",
    "evaluate simulation reference/mpm/fill_shell64.npz",
    "simulate my_scene/point_cloud.ply --compat physgaussian --config fall.json --out fall",
    "setup",
    "completions fish",
    "man",
];

#[track_caller]
fn assert_json(command: &str, output: &Output) {
    let text = String::from_utf8_lossy(&output.stdout);
    let parsed: Result<serde_json::Value, _> = serde_json::from_str(&text);
    assert!(parsed.is_ok(), "`{command} --json` prints no JSON: {text}{}", String::from_utf8_lossy(&output.stderr));
}

#[cfg(unix)]
#[test]
fn every_command_in_a_block_runs_and_prints_json_where_asked_to() {
    if models("every_command_in_a_block_runs_and_prints_json_where_asked_to").is_none() {
        return;
    }
    let desk = desk();
    let run = |words: &[String]| -> Output { gprop().args(words).current_dir(desk.path()).output().unwrap() };
    let mut ran = 0;
    for path in pages() {
        for Line { command, comment } in lines(&fs::read_to_string(&path).unwrap()) {
            let mut words = words(&command).split_off(1);
            let good: &[i32] = match comment.as_str() {
                "needs answers" | "needs the runs above" => continue,
                "needs setup" => &[0, 4],
                "needs a server" | "takes minutes" => {
                    words.push("--dry-run".to_owned());
                    &[0]
                }
                _ => &[0],
            };
            words.push("--json".to_owned());
            let output = run(&words);
            let code = output.status.code().unwrap_or(-1);
            let (page, said) = (path.display(), String::from_utf8_lossy(&output.stderr));
            assert!(good.contains(&code), "{page}: `{command}` ended with {code}: {said}");
            assert_json(&command, &output);
            ran += 1;
        }
    }
    for command in MORE_WITH_A_RESULT {
        if command.contains(" reference/") && !desk.path().join("reference").exists() {
            skipped("every_command_in_a_block_runs_and_prints_json_where_asked_to", command);
            continue;
        }
        assert_json(command, &run(&[words(command), vec!["--json".to_owned()]].concat()));
    }
    assert!(ran >= 20, "only {ran} commands were run");
    assert!(desk.path().join("my_scene/gprop/report.html").exists());
    assert!(desk.path().join("my_gripper.toml").exists() && desk.path().join("model").is_dir());
}
