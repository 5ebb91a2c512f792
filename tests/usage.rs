//! The command line itself: unique names, numbers within their domain, files and folders that exist, a terminal that
//! cannot be written to.

use std::any::TypeId;
use std::collections::BTreeSet;
use std::fmt::Debug;
use std::fs::File;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{Arg, Command};
use gprop::config::option_values;
use tempfile::TempDir;

use crate::batch::ball::Balls;
use crate::run::gprop;
use crate::support::stderr;

/// Every command with the words that invoke it, parents before children.
pub fn commands() -> Vec<(Vec<String>, Command)> {
    fn gather(command: &Command, words: &[String], found: &mut Vec<(Vec<String>, Command)>) {
        found.push((words.to_vec(), command.clone()));
        for child in command.get_subcommands().filter(|child| child.get_name() != "help") {
            gather(child, &[words, &[child.get_name().to_owned()]].concat(), found);
        }
    }
    let mut root = gprop::command();
    root.build();
    let mut found = Vec::new();
    gather(&root, &[], &mut found);
    found
}

#[test]
fn no_name_is_used_twice_in_a_command() {
    let mut checked = 0;
    for (words, command) in commands() {
        let mut names = Vec::new();
        for argument in command.get_arguments() {
            names.push(format!("id {}", argument.get_id()));
            names.extend(argument.get_long_and_visible_aliases().unwrap_or_default().iter().map(|n| format!("--{n}")));
            names.extend(argument.get_short_and_visible_aliases().unwrap_or_default().iter().map(|n| format!("-{n}")));
        }
        checked += names.len();
        let distinct: BTreeSet<&String> = names.iter().collect();
        let twice: Vec<&&String> =
            distinct.iter().filter(|name| names.iter().filter(|n| *n == **name).count() > 1).collect();
        assert!(twice.is_empty(), "gprop {}: {twice:?}", words.join(" "));
    }
    assert!(checked > 1000, "only {checked} names were found");
}

#[test]
fn the_command_lines_defaults_are_the_codes() {
    fn agree<T: clap::Args + Default + Debug>() {
        assert_eq!(format!("{:?}", option_values::defaults::<T>()), format!("{:?}", T::default()));
    }
    agree::<gprop::pipeline::Options>();
    agree::<gprop::batch::Options>();
}

/// Checks that the command line accepts `flag` with `value`, as far as this is known before any file is opened; the
/// error is the message. `root` is gprop's command line, which takes longer to build than to use.
fn parse(root: &mut Command, words: &[String], flag: &str, value: &str) -> Result<(), String> {
    let arguments = std::iter::once("gprop".to_owned()).chain(words.iter().cloned()).chain([format!("{flag}={value}")]);
    match root.try_get_matches_from_mut(arguments) {
        Err(error) if error.kind() == ErrorKind::ValueValidation => Err(error.to_string()),
        // Other required arguments are checked only after the values have been read.
        _ => Ok(()),
    }
}

fn is_one_of(argument: &Arg, types: &[TypeId]) -> bool {
    argument.get_action().takes_values() && types.iter().any(|id| argument.get_value_parser().type_id() == *id)
}

fn long(argument: &Arg) -> Option<String> {
    argument.get_long().map(|name| format!("--{name}"))
}

/// Every option that takes a number: the smallest and the largest valid one, and the nearest invalid numbers beyond.
const NUMBERS: &[(&str, [&str; 2], [&str; 2])] = &[
    ("--threads", ["1", "1024"], ["0", "1025"]),
    ("--allow-paid", ["0", "1e6"], ["-0.01", "1000001"]),
    ("--views", ["1", "100000"], ["0", "100001"]),
    ("--collider-volume", ["1", "1000000"], ["0.99", "1000001"]),
    ("--collider-distance", ["0", "1000"], ["-0.01", "1001"]),
    ("--ask-views", ["1", "1000"], ["0", "1001"]),
    ("--few-views", ["1", "1000"], ["0", "1001"]),
    ("--render-views", ["1", "100000"], ["0", "100001"]),
    ("--points-per-side", ["1", "256"], ["0", "257"]),
    ("--min-predicted-iou", ["0", "1"], ["-0.01", "1.01"]),
    ("--min-stability", ["0", "1"], ["-0.01", "1.01"]),
    ("--stability-offset", ["0", "100"], ["-0.01", "101"]),
    ("--box-nms", ["0", "1"], ["-0.01", "1.01"]),
    ("--crop-layers", ["0", "4"], ["-1", "5"]),
    ("--crop-nms", ["0", "1"], ["-0.01", "1.01"]),
    ("--crop-overlap", ["0", "0.99"], ["-0.01", "1"]),
    ("--crop-points-downscale", ["1", "256"], ["0", "257"]),
    ("--min-region-area", ["0", "400000000"], ["-1", "400000001"]),
    ("--crop-margin", ["0", "10"], ["-0.01", "10.1"]),
    ("--whole-object", ["0", "1"], ["-0.01", "1.01"]),
    ("--cull-iou", ["0", "1"], ["-0.01", "1.01"]),
    ("--cull-score", ["0", "1"], ["-0.01", "1.01"]),
    ("--cull-inner", ["0", "1"], ["-0.01", "1.01"]),
    ("--sheet-size", ["256", "8192"], ["255", "8193"]),
    ("--lmm-temperature", ["0", "2"], ["-0.01", "2.01"]),
    ("--port", ["0", "65535"], ["-1", "65536"]),
    ("--max-questions", ["0", "1000"], ["-1", "1001"]),
    ("--samples", ["1", "10000"], ["0", "10001"]),
    ("--lmm-max-tokens", ["1", "1000000"], ["0", "1000001"]),
    ("--lmm-parallel", ["1", "256"], ["0", "257"]),
    ("--lmm-timeout-s", ["1", "86400"], ["0", "86401"]),
    ("--lmm-wait-s", ["0", "86400"], ["-1", "86401"]),
    ("--lmm-retries", ["0", "100"], ["-1", "101"]),
    ("--neighbors", ["1", "1000"], ["0", "1001"]),
    ("--volume-cells", ["1000", "1073741824"], ["999", "1073741825"]),
    ("--carve-views", ["1", "100000"], ["0", "100001"]),
    ("--fill-density", ["0.001", "1000"], ["0", "1001"]),
    ("--wall-m", ["0.0001", "100"], ["0", "101"]),
    ("--known-mass", ["0.000001", "1000000kg"], ["0.0009g", "1000001"]),
    ("--known-mass-error", ["0.001g", "1000000"], ["0", "1000001kg"]),
    ("--min-body-share", ["0", "0.99"], ["-0.01", "1"]),
    ("--min-part-share", ["0", "0.99"], ["-0.01", "1"]),
    ("--drop-height", ["0", "1000"], ["-0.01", "1001"]),
    ("--tilt-deg", ["-360", "360"], ["-361", "361"]),
    ("--fixed-step", ["1e-9", "3600"], ["0", "3601"]),
    ("--max-simulation-minutes", ["0.01", "1000000"], ["0", "1000001"]),
    ("--max-minutes", ["0.01", "1000000"], ["0", "1000001"]),
    ("--duration", ["0.001", "3600"], ["0", "3601"]),
    ("--frames", ["2", "10000"], ["1", "10001"]),
    ("--grid", ["4", "512"], ["3", "513"]),
    ("--gravity", ["-1000", "1000"], ["-1001", "1001"]),
    ("--ground-friction", ["0", "100"], ["-0.01", "101"]),
    ("--max-stiffness", ["1", "1e13"], ["0", "1.1e13"]),
    ("--cfl", ["0.001", "1"], ["0", "1.01"]),
    ("--azimuth-deg", ["-360", "360"], ["-361", "361"]),
    ("--elevation-deg", ["-90", "90"], ["-91", "91"]),
    ("--fps", ["1", "60"], ["0", "61"]),
    ("--lift-angle-deg", ["0", "90"], ["-0.01", "90.1"]),
    ("--max-curvature", ["0.001", "1000000"], ["0", "1000001"]),
    ("--safety-factor", ["1", "100"], ["0.9", "101"]),
    ("--force-margin", ["0", "0.5"], ["-0.01", "0.51"]),
    // Those of a batch. A range of scenes may have any length: beyond the last scene it is empty.
    ("--start", ["0", "18446744073709551615"], ["-1", "18446744073709551616"]),
    ("--end", ["0", "18446744073709551615"], ["-1", "18446744073709551616"]),
    ("--jobs", ["1", "1024"], ["0", "1025"]),
    ("--memory", ["0.001", "1000000"], ["0", "1000001"]),
    // Several numbers in one value.
    ("--size", ["64x64", "4096x4096"], ["62x64", "64x4098"]),
    ("--shard", ["0/1", "999999/1000000"], ["1/1", "0/4294967296"]),
    ("--point", ["0,0,0", "-1e9,1e9,0"], ["0,0", "0,0,1e400"]),
    ("--object-at", ["000:0,0", "a:b:12,4000"], ["000:1", "000:-1,0"]),
    ("--object-box", ["0,0,0:1,1,1", "-1e9,0,0:1,1,1"], ["0,0,0", "0,0,0:1,1,1e400"]),
    ("--scale", ["1e-9", "1000000"], ["0", "1000001"]),
];

/// Texts that are not numbers, or not numbers that make sense for any option.
const NO_NUMBERS: &[&str] =
    &["NaN", "nan", "inf", "-inf", "1e400", "-1e400", "99999999999999999999999", "", "many", "0x10", "١"];

#[test]
fn every_number_is_within_a_domain() {
    let types = [
        TypeId::of::<f32>(),
        TypeId::of::<f64>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
        TypeId::of::<i64>(),
        TypeId::of::<NonZeroU32>(),
        TypeId::of::<NonZeroUsize>(),
    ];
    let (mut root, mut untested) = (gprop::command(), BTreeSet::new());
    for (words, command) in commands().into_iter().skip(1) {
        for argument in command.get_arguments() {
            let Some(flag) = long(argument) else { continue };
            let Some((_, taken, beyond)) = NUMBERS.iter().find(|(known, ..)| *known == flag) else {
                untested.extend(is_one_of(argument, &types).then_some(flag));
                continue;
            };
            for value in taken {
                assert_eq!(parse(&mut root, &words, &flag, value), Ok(()), "{words:?}");
            }
            for value in beyond.iter().chain(NO_NUMBERS) {
                let message = parse(&mut root, &words, &flag, value).expect_err(&format!("{words:?} {flag}={value}"));
                assert!(message.contains(&flag), "{message}");
            }
        }
    }
    // Tested together with the budgets.
    untested.remove("--max-usd");
    assert_eq!(untested, BTreeSet::new(), "give these a domain and a line in NUMBERS");
}

#[test]
fn numbers_beyond_their_domain_end_with_code_2_before_anything_is_done() {
    let balls = Balls::new(1);
    let run = |flag: &str, value: &str| {
        let mut command = gprop();
        command.arg("run").arg(balls.scene(0)).arg(format!("{flag}={value}")).args(["--to", "scene"]).output().unwrap()
    };
    let of_others = ["--start", "--end", "--jobs", "--memory", "--shard", "--few-views", "--allow-paid"];
    let of_runs = |flag: &str| !of_others.contains(&flag);
    for (flag, _, beyond) in NUMBERS.iter().filter(|(flag, ..)| of_runs(flag)) {
        // The test above covers more values.
        let value = beyond[0];
        let output = run(flag, value);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{flag}={value}: {message}");
        assert!(message.contains(flag), "{message}");
        assert!(!balls.scene(0).join("gprop/views.json").exists());
    }
    let batch =
        gprop().arg("batch").arg(balls.folder()).args(["--dry-run", "--shard", "0/4294967296"]).output().unwrap();
    assert_eq!(batch.status.code(), Some(2));
    assert!(stderr(&batch).contains("N up to 1000000"), "{}", stderr(&batch));
}

#[test]
fn two_formats_with_the_same_files_are_refused_before_anything_is_written() {
    let balls = Balls::new(1);
    let output = gprop().arg("run").arg(balls.scene(0)).args(["--also", "coco,npy,langsplat"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("VIEW_s.npy"), "{}", stderr(&output));
    assert!(!balls.scene(0).join("gprop/segments").exists());
}

/// The kind of path that an option requires.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wants {
    File,
    Folder,
    FileOrFolder,
    /// A folder that is created if it does not exist.
    NewFolder,
    /// Written, or looked for within each scene: there is nothing to check beforehand.
    Anything,
}

/// Every option that takes a path.
const PATHS: &[(&str, Wants)] = &[
    ("--splat", Wants::File),
    ("--cameras", Wants::FileOrFolder),
    ("--images", Wants::Folder),
    ("--allow-read", Wants::Folder),
    ("--masks", Wants::Folder),
    ("--segments", Wants::Folder),
    ("--ort-lib", Wants::File),
    ("--sam-encoder", Wants::File),
    ("--sam-decoder", Wants::File),
    ("--labels", Wants::File),
    ("--lmm-body", Wants::File),
    ("--prompts", Wants::Folder),
    ("--recordings", Wants::NewFolder),
    ("--prices", Wants::File),
    ("--materials", Wants::FileOrFolder),
    ("--config", Wants::File),
    ("--import", Wants::Folder),
    ("--mask", Wants::File),
    ("--outcomes", Wants::File),
    ("--data-set", Wants::Folder),
    ("--predictions", Wants::File),
    ("--gripper", Wants::File),
    ("--scenario", Wants::File),
    ("--split", Wants::File),
    ("--weights", Wants::File),
    ("--truth", Wants::Anything),
    ("--out", Wants::Anything),
    ("--work", Wants::Anything),
    ("--export", Wants::Anything),
    ("--html", Wants::Anything),
    ("--plot", Wants::Anything),
    ("--root", Wants::Folder),
    ("--profile", Wants::Anything),
];

/// Options whose value may also be a name: they are checked where the names are known.
const NAMES_OR_PATHS: &[&str] = &["--gripper", "--scenario", "--split"];

#[test]
fn every_path_is_looked_at() {
    let home = TempDir::new().unwrap();
    let (file, folder, nowhere) = (home.path().join("file"), home.path().join("folder"), home.path().join("nowhere"));
    std::fs::write(&file, "").unwrap();
    std::fs::create_dir(&folder).unwrap();
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let (mut root, mut untested) = (gprop::command(), BTreeSet::new());
    let mut checked = 0;
    for (words, command) in commands().into_iter().skip(1) {
        for argument in command.get_arguments() {
            let Some(flag) = long(argument) else { continue };
            // `evaluate segmentation --labels` names a set of labels.
            let names_a_set = !argument.get_possible_values().is_empty();
            let Some((_, wants)) = PATHS.iter().find(|(known, _)| *known == flag && !names_a_set) else {
                untested.extend(is_one_of(argument, &[TypeId::of::<PathBuf>()]).then_some(flag));
                continue;
            };
            if NAMES_OR_PATHS.contains(&flag.as_str()) {
                continue;
            }
            // `evaluate mass --truth` is a file; that of `evaluate segmentation` may lie within each scene.
            let is_masses = flag == "--truth" && words.ends_with(&["mass".to_owned()]);
            let refused: &[&PathBuf] = match if is_masses { &Wants::File } else { wants } {
                Wants::File => &[&nowhere, &folder],
                Wants::Folder => &[&nowhere, &file],
                Wants::FileOrFolder => &[&nowhere],
                Wants::NewFolder => &[&file],
                Wants::Anything => &[],
            };
            for path in [&file, &folder, &nowhere] {
                let parsed = parse(&mut root, &words, &flag, &text(path));
                assert_eq!(parsed.is_err(), refused.contains(&path), "{words:?} {flag} {path:?}: {parsed:?}");
                if let Err(message) = parsed {
                    assert!(message.contains(&flag) && message.contains(&text(path)), "{message}");
                }
                checked += 1;
            }
        }
    }
    assert_eq!(untested, BTreeSet::new(), "give these a line in PATHS");
    assert!(checked > 300, "only {checked} paths were looked at");
}

#[test]
fn paths_that_are_not_there_end_with_a_code_and_their_name() {
    let home = TempDir::new().unwrap();
    let (file, nowhere) = (home.path().join("file"), home.path().join("nowhere"));
    std::fs::write(&file, "no = such = thing").unwrap();
    let balls = Balls::new(1);
    let (file, nowhere) = (file.to_str().unwrap(), nowhere.to_str().unwrap());
    let scene = balls.scene(0);
    let data = balls.folder();
    let (scene, data) = (scene.to_str().unwrap(), data.to_str().unwrap());
    // The arguments, and the words of the message.
    let table: &[(&[&str], &[&str])] = &[
        (&["run", scene, "--masks", nowhere], &["--masks", nowhere, "no such folder"]),
        (&["run", scene, "--masks", file], &["--masks", file, "this is a file"]),
        (&["inspect", scene, "--splat", data], &["--splat", data, "this is a folder"]),
        (&["segment", scene, "--segments", nowhere], &["--segments", nowhere]),
        (&["query", scene, "--prompts", nowhere], &["--prompts", nowhere]),
        (&["query", scene, "--labels", nowhere], &["--labels", nowhere, "abo, mvimgnet or a text file"]),
        (&["query", scene, "--import", nowhere], &["--import", nowhere]),
        (&["query", scene, "--export", file], &[file]),
        (&["query", scene, "--recordings", file], &["--recordings", file]),
        (&["run", scene, "--prices", nowhere], &["--prices", nowhere]),
        (&["run", scene, "--materials", nowhere], &["--materials", nowhere]),
        (&["run", scene, "--gripper", nowhere], &["--gripper", nowhere]),
        (&["run", scene, "--gripper", file], &["gripper", file, "line 1"]),
        (&["run", scene, "--gripper", data], &["gripper", data]),
        (&["simulate", scene, "--scenario", nowhere], &["--scenario", nowhere]),
        (&["simulate", scene, "--scenario", data], &["--scenario", data]),
        (&["simulate", scene, "--compat", "physgaussian", "--config", nowhere], &["--config", nowhere]),
        (&["batch", data, "--split", nowhere], &["--split", nowhere]),
        (&["batch", nowhere], &[nowhere]),
        (&["run", scene, "--out", file], &[file, "--out"]),
        (&["run", nowhere], &[nowhere]),
        (&["run", data], &["holds 1 scene folder", "gprop batch", "ball-0"]),
        (&["show", scene, "field.jpg"], &["field.jpg", ".png, .gif or .mp4"]),
        (&["show", scene, "field"], &["ends in .png"]),
        (&["show", scene, "field.gif", "--view", "001"], &["--view is for a picture of one view", "field.gif"]),
        (&["show", scene, "field.png", "--size", "320x180"], &["--size and --fps are for a film", "field.png"]),
        (&["segment", file, "--masks", data], &["--masks is for the views of a scene", "--mask"]),
        (&["segment", file, "--masks", data, "--dry-run"], &["--masks is for the views of a scene", "--mask"]),
        (&["export", nowhere, "--format", "npz", "--out", data], &[nowhere]),
        (&["export", scene, "--format", "npz", "--out", file], &[file, "--out"]),
        (&["inspect", scene, "--html", data], &["--html", data]),
        (&["evaluate", "grasp", "--outcomes", nowhere], &["--outcomes", nowhere]),
        (&["evaluate", "grasp", nowhere], &[nowhere]),
        (&["evaluate", "grasp", scene, "--gripper", nowhere], &["--gripper", nowhere]),
        (&["evaluate", "grasp", "--outcomes", file, "--gripper", "paper"], &["cannot be used with", "--gripper"]),
        (&["evaluate", "mass", "--data-set", nowhere], &["--data-set", nowhere]),
        (&["evaluate", "mass", "--data-set", data, "--allow-read", data], &["cannot be used with", "--allow-read"]),
        (
            &["evaluate", "mass", "--predictions", file, "--truth", file, "--allow-read", data],
            &["cannot be used with", "--allow-read"],
        ),
        (&["evaluate", "mass", "--predictions", nowhere, "--truth", file], &["--predictions", nowhere]),
        (&["evaluate", "mass", "--predictions", file, "--truth", nowhere], &["--truth", nowhere]),
        (&["evaluate", "mass", nowhere], &[nowhere]),
        (&["evaluate", "hardness", nowhere], &[nowhere]),
        (&["evaluate", "simulation", nowhere], &[nowhere]),
        (&["evaluate", "simulation", data], &[data]),
        (&["evaluate", "masks", nowhere, file], &[nowhere]),
        (&["grasp", "calibrate", nowhere], &[nowhere]),
        (&["audit", nowhere], &[nowhere]),
        (&["audit", data], &["no URDF, MJCF, USD or glTF", data]),
        (&["materials", "list", "--materials", nowhere], &["--materials", nowhere]),
        (&["doctor", "--ort-lib", nowhere], &["--ort-lib", nowhere]),
        (&["setup", "--sam-encoder", nowhere, "--sam-decoder", nowhere], &["--sam-encoder", nowhere]),
        (&["man", "--out", file], &[file]),
    ];
    for (typed, words) in table {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").args(*typed);
        if *typed.first().unwrap() != "batch" && typed.contains(&scene) && !["inspect", "evaluate"].contains(&typed[0])
        {
            command.args(balls.answers());
        }
        let output = command.output().unwrap();
        let message = stderr(&output);
        assert!([Some(2), Some(3)].contains(&output.status.code()), "{typed:?}: {:?} {message}", output.status);
        assert_eq!(message.matches("error:").count(), 1, "{typed:?}: {message}");
        for word in *words {
            assert!(message.contains(word), "{typed:?}: no {word:?} in {message}");
        }
    }
}

/// JSON has only Unicode, names of files may have other bytes: here `\xe9`, an e with an acute accent in Latin-1.
#[cfg(target_os = "linux")]
#[test]
fn paths_that_are_not_unicode_are_used_and_shown() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let (balls, home) = (Balls::new(1), TempDir::new().unwrap());
    let done = |command: &mut std::process::Command| {
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    let board = home.path().join(OsStr::from_bytes(b"caf\xe9.svg"));
    for more in [&[][..], &["--json"]] {
        let said = done(gprop().args(["scale", "board", "--out"]).arg(&board).args(more));
        assert!(board.is_file() && said.contains("caf\u{fffd}.svg"), "{said}");
        std::fs::remove_file(&board).unwrap();
    }
    let labels = home.path().join(OsStr::from_bytes(b"l\xe9gendes"));
    std::fs::create_dir(&labels).unwrap();
    for entry in std::fs::read_dir(balls.labels(0)).unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), labels.join(entry.file_name())).unwrap();
    }
    let segment = || {
        let mut command = gprop();
        command.arg("segment").arg(balls.scene(0)).arg("--segments").arg(&labels);
        command
    };
    done(&mut segment());
    let record = std::fs::read_to_string(balls.scene(0).join("gprop/run.json")).unwrap();
    assert!(record.contains("l\u{fffd}gendes"), "{record}");
    done(segment().arg("--json"));
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_cannot_be_written_aborts_nothing() {
    let full = || File::options().write(true).open("/dev/full").unwrap();
    let balls = Balls::new(1);
    let scene = balls.scene(0);
    let scene = scene.to_str().unwrap();
    let table: [(&[&str], i32); 6] = [
        (&["run", scene, "--to", "scene"], 0),
        (&["run", scene, "--to", "scene", "-vv"], 0),
        (&["run", "nowhere"], 3),
        (&["run", scene, "--views", "0"], 2),
        (&["nonsense"], 2),
        (&["doctor", "--offline", "--ort-lib", "nowhere"], 2),
    ];
    for (typed, code) in table {
        let output = gprop().args(typed).stderr(full()).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{typed:?}");
    }
    // A missing photo causes a warning, and a batch reports each scene.
    std::fs::remove_file(balls.scene(0).join("images/001.png")).unwrap();
    let output = gprop().args(["run", scene, "--to", "scene"]).stderr(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let output = gprop().arg("batch").arg(balls.folder()).args(["--to", "scene"]).stderr(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    // Neither stdout nor stderr can be written.
    let output = gprop().args(["run", scene, "--to", "scene"]).stdout(full()).stderr(full()).status().unwrap();
    assert_eq!(output.code(), Some(2));
}
