//! Every command in the README and in `docs/`.
//!
//! A command of gprop (also as `cargo run --release --`) in a block marked `sh` is run, in the order of the page, in a
//! folder with a scene called `my_scene` and the files that the pages mention. A comment after the command marks the
//! exceptions:
//!
//! | comment | what the test does |
//! | --- | --- |
//! | `# needs a server`, `# takes minutes`, `# opens the browser` | runs it with `--dry-run`, which sends and computes nothing |
//! | `# needs setup` | runs it; exit code 4 (files missing) is accepted like 0 |
//! | `# needs answers`, `# needs the runs above` | checks its words and flags against the help, as below |
//!
//! Every command is run with `--json` added, and must print JSON that `docs/commands.schema.json` describes.
//!
//! Commands elsewhere (in running text, in tables, with words in capitals) are checked against the help: the
//! subcommand must exist and accept every flag.
//!
//! Every option in any code of the README and of `docs/`, in a command or not, is passed to a command that has it, with
//! the value shown there or, for `DIR` and the like, with one of that kind.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::{Mutex, PoisonError};

use gprop::simulate::script::Script;
use gprop::workdir::DEFAULT_NAME;
use serde_json::json;
use tempfile::TempDir;

use crate::commands;
use crate::run::{QUICK, give_segments, gprop, hammer};
use crate::support::{models, shared, shared_if_there};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The README, the page for who changes gprop, and the pages of `docs/` and of the data folders.
fn pages() -> Vec<PathBuf> {
    let mut pages: Vec<PathBuf> =
        fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path()).collect();
    pages.retain(|path| path.extension().is_some_and(|extension| extension == "md") || path.ends_with("llms.txt"));
    pages.sort();
    pages.insert(0, root().join("README.md"));
    pages.insert(1, root().join("AGENTS.md"));
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

/// Commands in running text: text between backquotes that begins with `gprop` and a word, outside of `sh` blocks.
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

/// The help of the command that these words invoke; `None` if there is no such command.
fn help_of(words: &[&String]) -> Option<String> {
    static KNOWN: Mutex<BTreeMap<Vec<String>, Option<String>>> = Mutex::new(BTreeMap::new());
    let words: Vec<String> = words.iter().map(|word| (*word).clone()).collect();
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let asked = known.entry(words).or_insert_with_key(|words| {
        let output = gprop().args(words).arg("--help-all").output().unwrap();
        output.status.success().then(|| String::from_utf8(output.stdout).unwrap())
    });
    asked.clone()
}

/// The reason why gprop's own help does not allow a command; `None` if it does.
fn refused_by_the_help(command: &str) -> Option<String> {
    let words = words(command);
    let plain = |word: &&String| word.chars().all(|c| c.is_ascii_lowercase());
    let path: Vec<&String> = words[1..].iter().take_while(plain).take(2).collect();
    // The second word may be a subcommand (`grasp calibrate`) or an argument (`inspect folder`).
    let least = usize::from(!path.is_empty());
    let help = (least..=path.len()).rev().find_map(|length| help_of(&path[..length]));
    let Some(help) = help else { return Some(format!("`{command}`: no such command")) };
    let known = |flag: &str| help.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).any(|word| word == flag);
    let flags = words.iter().filter(|word| word.starts_with("--")).map(|word| word.split('=').next().unwrap());
    let unknown: Vec<&str> = flags.flat_map(|flag| flag.split('|')).filter(|flag| !known(flag)).collect();
    (!unknown.is_empty()).then(|| format!("`{command}`: the help has no {unknown:?}"))
}

/// A folder with the files that the pages' commands use.
fn place() -> TempDir {
    let place = TempDir::new().unwrap();
    let path_of = |name: &str| place.path().join(name);
    let scene = hammer();
    // The options that make runs quick are in the scene's own configuration, so that commands are run as written.
    let mut configuration = fs::read_to_string(scene.path().join("gprop.toml")).unwrap();
    for option in QUICK.chunks(2).filter(|option| option[0] != "--size") {
        // Few cells have few triangles, which exports write soon.
        let value = if option[0] == "--volume-cells" { "20000" } else { option[1] };
        configuration += &format!("{} = \"{value}\"\n", option[0].trim_start_matches('-'));
    }
    fs::write(scene.path().join("gprop.toml"), configuration).unwrap();
    fs::rename(scene.keep(), path_of("my_scene")).unwrap();
    // Copies, so that commands that work on a fixture do not interfere with a user's own results or with another test
    // run.
    for folder in
        ["fixtures/hammer", "fixtures/mug", "fixtures/chair", "fixtures/table_lamp", "fixtures/cup", "examples"]
    {
        copy(&root().join(folder), &path_of(folder));
    }
    // Measurements over all commands that the paper's gripper obeys.
    let points: Vec<String> = (0..8)
        .map(|k| 15.0 + 85.0 / 7.0 * f64::from(k))
        .map(|command| format!("{command},{}", 0.4 * command))
        .collect();
    fs::write(path_of("points.csv"), format!("command,force_n\n{}\n", points.join("\n"))).unwrap();
    fs::write(path_of("outcomes.csv"), "object,policy,picked_up,undamaged\nmug,gprop,true,true\n").unwrap();
    fs::write(path_of("predictions.json"), json!({"A_1": [0.5, 1.5], "B_1": [2.0, 4.0]}).to_string()).unwrap();
    fs::write(path_of("truth.json"), json!({"A": 1.1, "B": 2.5}).to_string()).unwrap();
    fs::write(path_of("readings.csv"), "scene,view,x,y,shore,hardness\nmy_scene,003,256,256,D,80\n").unwrap();
    let truth = path_of("my_scene/ground_truth");
    fs::create_dir(&truth).unwrap();
    fs::copy(root().join("fixtures/hammer/ground_truth/parts.json"), truth.join("parts.json")).unwrap();
    let wood = fs::read_to_string(root().join("materials/wood.csv")).unwrap();
    fs::write(path_of("my_materials.csv"), wood.lines().take(2).map(|line| format!("{line}\n")).collect::<String>())
        .unwrap();
    let settings = json!({
        "width": 512, "height": 512, "points_per_side": 4, "crop_n_layers": 0, "pred_iou_thresh": 0.7, "stability_score_thresh": 0.85,
        "stability_score_offset": 1.0, "box_nms_thresh": 0.7, "min_mask_region_area": 0, "all": [],
    });
    fs::write(path_of("masks.json"), settings.to_string()).unwrap();
    fs::write(
        path_of("fall.json"),
        json!({ "n_grid": 16, "frame_num": 1, "frame_dt": 0.01, "substep_dt": 1e-3 }).to_string(),
    )
    .unwrap();
    // Trajectories of a peer, which only a development checkout has.
    if let Some(folder) = shared_if_there("reference") {
        std::os::unix::fs::symlink(folder, path_of("reference")).unwrap();
    }
    place
}

/// Copies a folder without work folders in it.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        match entry.file_type().unwrap().is_dir() {
            true if entry.file_name() == DEFAULT_NAME => {}
            true => copy(&entry.path(), &to),
            false => drop(fs::copy(entry.path(), &to).unwrap()),
        }
    }
}

#[test]
fn nothing_that_a_command_writes_lands_in_the_checkout() {
    let place = place();
    let inside = place.path().canonicalize().unwrap();
    for folder in ["my_scene", "fixtures", "fixtures/hammer", "fixtures/mug/images"] {
        assert!(place.path().join(folder).canonicalize().unwrap().starts_with(&inside), "{folder} leads out");
    }
}

/// The code in a page: spans between backquotes, and the lines of blocks that are commands of gprop.
fn code(page: &str) -> Vec<String> {
    let outside: String = page.split("```").step_by(2).collect();
    let spans = outside.split('`').skip(1).step_by(2).map(|span| span.replace('\n', " "));
    let blocks = page.split("```").skip(1).step_by(2).map(|block| block.replace("\\\n", " "));
    let commands = blocks.flat_map(|block| block.lines().map(str::to_owned).collect::<Vec<_>>());
    let commands = commands.filter_map(|line| line.find("gprop ").map(|at| line[at..].to_owned()));
    spans.filter(|span| span.starts_with("--") || span.contains("gprop ")).chain(commands).collect()
}

/// The options in a piece of code, each with the text that follows it.
fn options(code: &str) -> Vec<(String, Option<String>)> {
    let code = code.split_once(" #").map_or(code, |(command, _)| command).replace("cargo run --release -- ", "");
    let words = words(&code.replace(['[', ']'], " "));
    let mut found = Vec::new();
    for (index, word) in words.iter().enumerate() {
        let Some((flag, value)) = word.strip_prefix("--").map(|word| word.split_once('=').unwrap_or((word, ""))) else {
            continue;
        };
        let next = words.get(index + 1).filter(|next| !next.starts_with("--") && *next != "|");
        let value = if value.is_empty() { next.cloned() } else { Some(value.to_owned()) };
        // `--sam-encoder|--sam-decoder FILE`
        found.extend(flag.split('|').map(|flag| (flag.trim_start_matches('-').to_owned(), value.clone())));
    }
    found
}

/// Values of the kind that an option's help names, for a page that shows no actual value.
fn samples(argument: &clap::Arg, shown: Option<&str>, file: &str, folder: &str) -> Vec<String> {
    let paths = [file.to_owned(), folder.to_owned(), "new".to_owned()];
    let defaults = argument.get_default_values().iter().map(|value| value.to_string_lossy().into_owned());
    let names: Vec<String> = argument.get_value_names().into_iter().flatten().map(ToString::to_string).collect();
    let is_placeholder =
        |text: &str| !text.is_empty() && text.chars().all(|c| !c.is_ascii_lowercase() && !c.is_ascii_digit());
    let is_path = argument.get_value_parser().type_id() == std::any::TypeId::of::<PathBuf>();
    match shown {
        // A file of the page's example.
        Some(_) if is_path => paths.into(),
        Some(text) if !is_placeholder(text) && !names.iter().any(|name| name == text) => {
            let alternatives = text.split('|').map(|text| text.trim_end_matches([',', '.', ';', ')']).to_owned());
            alternatives.filter(|text| !is_placeholder(text)).collect()
        }
        _ => {
            let typed = [
                "4",
                "0.5",
                "name",
                "http://localhost/v1",
                "0,0,0",
                "0,0,0:1,1,1",
                "0/2",
                "key=1",
                "submit",
                "vote",
                "npy",
                "npz",
            ];
            let possible = argument.get_possible_values().into_iter().map(|value| value.get_name().to_owned());
            paths.into_iter().chain(defaults).chain(possible).chain(typed.map(str::to_owned)).collect()
        }
    }
}

#[test]
fn every_option_on_the_pages_is_taken_with_its_value() {
    let (commands, parser) = (crate::usage::commands(), RefCell::new(gprop::command()));
    let home = TempDir::new().unwrap();
    let file = home.path().join("file");
    fs::write(&file, "").unwrap();
    let (file, folder) = (file.to_str().unwrap(), home.path().to_str().unwrap());
    let (mut checked, mut wrong) = (0, Vec::new());
    let pages =
        pages().into_iter().filter(|path| path.ends_with("README.md") || path.parent().unwrap().ends_with("docs"));
    for path in pages {
        for code in code(&fs::read_to_string(&path).unwrap()) {
            for (flag, shown) in options(&code) {
                let having = |(words, command): &(Vec<String>, clap::Command)| {
                    let argument = command.get_arguments().find(|argument| argument.get_long() == Some(&flag)).cloned();
                    argument.map(|argument| (words.clone(), argument))
                };
                let having: Vec<(Vec<String>, clap::Arg)> = commands.iter().filter_map(having).collect();
                let named: Vec<_> = having
                    .iter()
                    .filter(|(words, _)| code.starts_with(&format!("gprop {}", words.join(" "))))
                    .cloned()
                    .collect();
                let candidates = if named.is_empty() { having } else { named };
                checked += 1;
                let is_taken = candidates.iter().any(|(words, argument)| {
                    if argument.get_action().takes_values() {
                        let samples = samples(argument, shown.as_deref(), file, folder);
                        let given = |value: &String| taken(&parser, words, &format!("--{flag}={value}"));
                        // Each of the alternatives that the page shows must be accepted; of samples, one is enough.
                        let all = shown.as_ref().is_some_and(|text| text.contains('|'))
                            && !samples.contains(&file.to_owned());
                        if all { samples.iter().all(given) } else { samples.iter().any(given) }
                    } else {
                        true
                    }
                });
                if !is_taken {
                    wrong.push(format!("{}: `{code}`: --{flag} {}", path.display(), shown.unwrap_or_default()));
                }
            }
        }
    }
    assert!(checked > 150, "only {checked} options were found");
    assert_eq!(wrong, Vec::<String>::new());
}

/// True if a command has this option and accepts its value, whatever else the command needs. `parser` is gprop's
/// command line, which takes longer to build than to use.
fn taken(parser: &RefCell<clap::Command>, words: &[String], option: &str) -> bool {
    use clap::error::ErrorKind::{InvalidValue, TooManyValues, UnknownArgument, ValueValidation};
    let typed = std::iter::once("gprop").chain(words.iter().map(String::as_str)).chain([option]);
    let parsed = parser.borrow_mut().try_get_matches_from_mut(typed);
    !parsed.is_err_and(|e| [InvalidValue, TooManyValues, UnknownArgument, ValueValidation].contains(&e.kind()))
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

/// The blocks of a page that are marked with a language.
fn blocks(page: &str, language: &str) -> Vec<String> {
    let inside = page.split("```").skip(1).step_by(2);
    inside.filter_map(|block| block.strip_prefix(language)?.strip_prefix('\n')).map(str::to_owned).collect()
}

#[test]
fn every_example_of_toml_can_be_read() {
    let mut scripts = 0;
    for path in pages() {
        for block in blocks(&fs::read_to_string(&path).unwrap(), "toml") {
            let parsed: Result<toml::Table, _> = toml::from_str(&block);
            let table = parsed.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            if table.contains_key("step") {
                Script::from_toml(&block).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                scripts += 1;
            }
        }
    }
    assert!(scripts > 0);
}

/// Phrases of `text` that are not idiomatic English: a guard against the two habits that make readers stumble most,
/// "where" for a condition and "a line a scene" for a rate.
fn unidiomatic(text: &str) -> Vec<String> {
    const PHRASES: [&str; 5] =
        ["nobody", "is no number", "where it is not given", "where it is not found", "goes on where"];
    const JOINING: [&str; 7] = ["or", "and", "as", "in", "is", "of", "to"];
    let words: Vec<String> = text.split_whitespace().map(str::to_lowercase).collect();
    let plain = words.join(" ");
    let phrases = PHRASES.into_iter().filter(|phrase| plain.contains(phrase)).map(str::to_owned);
    let is_article = |word: &str| word == "a" || word == "an";
    let is_noun = |word: &str| word.chars().all(char::is_alphabetic) && !JOINING.contains(&word);
    let rates = words
        .windows(3)
        .filter(|three| (is_article(&three[0]) || three[0] == "one") && is_noun(&three[1]) && is_article(&three[2]));
    phrases.chain(rates.map(|three| three.join(" "))).collect()
}

#[test]
fn pages_and_help_are_idiomatic() {
    let folder = TempDir::new().unwrap();
    assert!(gprop().args(["man", "--out"]).arg(folder.path()).output().unwrap().status.success());
    let manual = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    let more = ["CHANGELOG.md", "fuzz/README.md", "fixtures/datasets/README.md", "prompts/export_readme.txt"];
    let pages: Vec<PathBuf> = pages().into_iter().chain(more.map(|name| root().join(name))).chain(manual).collect();
    assert!(pages.len() > 30, "{pages:?}");
    let found = |path: &PathBuf| {
        // Without code blocks, and without roff's escapes of hyphens.
        let text: String = fs::read_to_string(path).unwrap().replace("\\-", "-").split("```").step_by(2).collect();
        unidiomatic(&text).into_iter().map(|what| format!("{}: {what}", path.display())).collect::<Vec<_>>()
    };
    assert_eq!(pages.iter().flat_map(found).collect::<Vec<_>>(), Vec::<String>::new());
    assert_eq!(unidiomatic("Writes a line a scene, where it is not given.").len(), 2);
}

/// The tests that the pages name as the source of a number.
#[test]
fn the_tests_that_the_pages_name_exist() {
    let listed = std::process::Command::new(std::env::current_exe().unwrap()).arg("--list").output().unwrap();
    let known: Vec<String> = String::from_utf8(listed.stdout).unwrap().lines().map(str::to_owned).collect();
    let (mut checked, mut wrong) = (0, Vec::new());
    for path in pages() {
        let text = fs::read_to_string(&path).unwrap();
        let commands = text.split("cargo test --").skip(1).filter_map(|rest| rest.split(['`', '\n']).next());
        for command in commands {
            let filter = command
                .split_whitespace()
                .find(|word| !word.starts_with('-') && !["release", "profile", "quick"].contains(word));
            // Unit tests are another binary.
            let Some(filter) = filter.filter(|_| !command.contains("--lib")) else { continue };
            checked += 1;
            if !known.iter().any(|name| name.contains(filter)) {
                wrong.push(format!("{}: {command}", path.display()));
            }
        }
    }
    assert!(checked >= 5, "only {checked} commands name tests");
    assert_eq!(wrong, Vec::<String>::new());
}

/// Commands with a result that are in no block.
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
    "segment my_scene/images/003.png --points-per-side 8 --out picture",
    "query my_scene/images/003.png --dry-run",
    "evaluate mass my_scene",
    "evaluate hardness readings.csv",
    "evaluate prompts fixtures/hammer --views 1 --points-per-side 8",
    "evaluate parts fixtures/hammer --views 1 --points-per-side 8",
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
    let said = String::from_utf8_lossy(&output.stderr);
    let value = parsed.unwrap_or_else(|_| panic!("`{command} --json` prints no JSON: {text}{said}"));
    let words = words(command.strip_prefix("gprop ").unwrap_or(command));
    assert_eq!(commands::problems(&commands::command_of(&words), &value), [] as [String; 0], "{command}");
}

#[test]
fn every_command_in_a_block_runs_and_prints_json_where_asked_to() {
    const TEST: &str = "every_command_in_a_block_runs_and_prints_json_where_asked_to";
    if models(TEST).is_none() {
        return;
    }
    let place = place();
    give_segments(&place.path().join("my_scene/gprop"));
    let run = |words: &[String]| -> Output {
        // Only printed, not checked.
        let started = std::time::Instant::now();
        let output = gprop().args(words).current_dir(place.path()).output().unwrap();
        println!("{:.1} s: {words:?}", started.elapsed().as_secs_f64());
        output
    };
    let mut ran = 0;
    for path in pages() {
        for Line { command, comment } in lines(&fs::read_to_string(&path).unwrap()) {
            let mut words = words(&command).split_off(1);
            let good: &[i32] = match comment.as_str() {
                "needs answers" | "needs the runs above" => continue,
                "needs setup" => &[0, 4],
                "needs a server" | "takes minutes" | "opens the browser" => {
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
        if command.contains(" reference/") && shared(TEST, "reference").is_none() {
            continue;
        }
        assert_json(command, &run(&[words(command), vec!["--json".to_owned()]].concat()));
    }
    assert!(ran >= 20, "only {ran} commands were run");
    assert!(place.path().join("my_scene/gprop/report.html").exists());
    assert!(place.path().join("my_gripper.toml").exists() && place.path().join("model").is_dir());
}
