//! The whole program as a user runs it: runs, reruns, kills, bad input, exit codes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::support::{models, stderr};

/// Two of the hammer's ten views, a coarse grid, a short simulation and a small film: every stage in seconds. The last
/// option is the user's, the others are a scene's.
#[rustfmt::skip]
pub const QUICK: &[&str] = &[
    "--view-list", "003,022", "--frames", "3", "--duration", "0.06", "--grid", "16", "--volume-cells", "100000",
    "--size", "320x180",
];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

/// The program, without the configuration of the user who runs the tests.
pub fn gprop() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gprop"));
    command.env("XDG_CONFIG_HOME", concat!(env!("CARGO_TARGET_TMPDIR"), "/no-configuration"));
    command
}

/// Runs a command as the Python module does: its stdin stays open until it ends. Returns the names and work folders that it
/// prints.
pub fn for_python(scene: &Path, flags: &[&str]) -> (Output, Vec<(String, PathBuf)>) {
    let mut command = gprop();
    command.arg("run").arg(scene).args(flags).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let _open = child.stdin.take();
    let output = child.wait_with_output().unwrap();
    let works = serde_json::from_slice(&output.stdout).unwrap_or_default();
    (output, works)
}

/// A copy of the hammer that a test may change, with its recordings but without its ground truth.
pub fn hammer() -> TempDir {
    let copy = TempDir::new().unwrap();
    copy_hammer(copy.path());
    copy
}

/// The same in an empty folder.
pub fn copy_hammer(to: &Path) {
    let source = fixture("hammer");
    for name in ["point_cloud.ply", "transforms.json", "gprop.toml"] {
        fs::copy(source.join(name), to.join(name)).unwrap();
    }
    for folder in ["images", "recorded"] {
        fs::create_dir(to.join(folder)).unwrap();
        for entry in fs::read_dir(source.join(folder)).unwrap() {
            let entry = entry.unwrap();
            fs::copy(entry.path(), to.join(folder).join(entry.file_name())).unwrap();
        }
    }
}

/// Writes the segments of the views of [`QUICK`] into a work folder of the hammer, where a run finds them and
/// continues as after a kill. SAM makes them once for all tests.
pub fn give_segments(work: &Path) {
    static SEGMENTS: OnceLock<Vec<(PathBuf, Vec<u8>)>> = OnceLock::new();
    let segments = SEGMENTS.get_or_init(|| {
        let out = TempDir::new().unwrap();
        let output =
            gprop().arg("segment").arg(fixture("hammer")).args(QUICK[..2].iter()).arg("--out").arg(out.path()).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        contents(&out.path().join("segments"))
    });
    let folder = work.join("segments");
    fs::create_dir_all(&folder).unwrap();
    for (name, bytes) in segments {
        fs::write(folder.join(name), bytes).unwrap();
    }
}

fn run(scene: &Path, arguments: &[&str]) -> Output {
    gprop().arg("run").arg(scene).args(arguments).output().unwrap()
}

fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&fs::read(&path).unwrap()).unwrap()
}

/// Fails unless gprop ended with `code` and one error that contains all `words`, and left nothing half-written.
fn assert_refused(scene: &Path, arguments: &[&str], code: i32, words: &[&str]) {
    let output = run(scene, arguments);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert_eq!(message.matches("error:").count(), 1, "one message, not several: {message}");
    for word in words {
        assert!(message.contains(word), "no {word:?} in: {message}");
    }
    let work = scene.join("gprop");
    assert!(!work.join("report.json").exists() && !work.join("report.html").exists());
    assert_eq!(leftovers(&work), Vec::<PathBuf>::new(), "temporary files are left");
}

/// Temporary files below a folder.
fn leftovers(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(leftovers(&path));
        } else if path.file_name().unwrap().to_string_lossy().starts_with(".tmp-") {
            found.push(path);
        }
    }
    found
}

#[test]
fn no_scene() {
    let empty = TempDir::new().unwrap();
    assert_refused(&empty.path().join("nowhere"), &[], 3, &["nowhere"]);
}

#[test]
fn no_ply() {
    let empty = TempDir::new().unwrap();
    assert_refused(empty.path(), &[], 3, &["point_cloud.ply"]);
}

#[test]
fn truncated_ply() {
    let scene = hammer();
    let ply = scene.path().join("point_cloud.ply");
    let bytes = fs::read(&ply).unwrap();
    fs::write(&ply, &bytes[..bytes.len() / 2]).unwrap();
    assert_refused(scene.path(), &[], 3, &["point_cloud.ply", "truncated"]);
}

#[test]
fn a_ply_that_is_no_splat() {
    let scene = hammer();
    let points = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                  property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n0 0 0 1 2 3\n";
    fs::write(scene.path().join("point_cloud.ply"), points).unwrap();
    assert_refused(scene.path(), &[], 3, &["point_cloud.ply", "opacity"]);
}

#[test]
fn an_image_is_missing() {
    let scene = hammer();
    fs::remove_file(scene.path().join("images/004.png")).unwrap();
    let output = run(scene.path(), &["--to", "scene"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("1 of the 30 photos"), "{}", stderr(&output));
    assert_eq!(json(scene.path().join("gprop/views.json"))["views"].as_array().unwrap().len(), 10);
    assert_refused(scene.path(), &["--view-list", "003,004"], 2, &["004"]);
}

#[test]
fn an_image_is_undecodable() {
    let scene = hammer();
    fs::write(scene.path().join("images/004.png"), b"\x89PNG\r\n\x1a\nno picture").unwrap();
    assert_refused(scene.path(), &["--view-list", "004"], 3, &["004.png"]);
}

#[test]
fn a_broken_transforms_json() {
    let scene = hammer();
    fs::write(scene.path().join("transforms.json"), "{\n  \"fl_x\": 787,\n  oops\n}").unwrap();
    assert_refused(scene.path(), &[], 3, &["transforms.json", "line 3"]);
}

#[test]
fn an_unknown_key_in_the_configuration() {
    let scene = hammer();
    fs::write(scene.path().join("gprop.toml"), "scale = \"metric\"\npoints-per-sid = 8\n").unwrap();
    assert_refused(scene.path(), &[], 2, &["gprop.toml", "line 2", "points-per-sid"]);
}

#[test]
fn the_command_line_wins_over_the_configuration() {
    let scene = hammer();
    fs::write(scene.path().join("gprop.toml"), "scale = \"metric\"\nviews = 3\n").unwrap();
    let output = run(scene.path(), &["--to", "scene", "--views", "5"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(scene.path().join("gprop/views.json"))["views"].as_array().unwrap().len(), 5);
}

#[test]
fn views_counted_on_the_command_line_win_over_views_listed_in_the_configuration() {
    let scene = hammer();
    fs::write(scene.path().join("gprop.toml"), "scale = \"metric\"\nview-list = [\"003\"]\n").unwrap();
    let output = run(scene.path(), &["--to", "scene", "--views", "5"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(scene.path().join("gprop/views.json"))["views"].as_array().unwrap().len(), 5);
}

#[test]
fn a_gripper_or_an_angle_that_cannot_be() {
    let scene = hammer();
    let profile = scene.path().join("hand.toml");
    fs::write(&profile, "name = \"hand\"\nforce_n = [1.0, 9.0]\nfinger_area_m2 = 1e-4\npad = \"rubber\"\n").unwrap();
    let words = ["hand.toml", "no calibration", "calibrate"];
    assert_refused(scene.path(), &["--gripper", profile.to_str().unwrap()], 2, &words);
    assert_refused(scene.path(), &["--gripper", "no-such-hand"], 2, &["no-such-hand", "paper"]);
    assert_refused(scene.path(), &["--lift-angle-deg", "91"], 2, &["--lift-angle-deg", "91", "0 to 90"]);
    assert_refused(scene.path(), &["--point", "1,2"], 2, &["--point"]);
}

#[test]
fn a_grasp_that_cannot_be() {
    if models("a_grasp_that_cannot_be").is_none() {
        return;
    }
    let scene = hammer();
    give_segments(&scene.path().join("gprop"));
    let grasp =
        |arguments: &[&str]| gprop().arg("grasp").arg(scene.path()).args(QUICK).args(arguments).output().unwrap();
    let first = grasp(&[]);
    assert!(first.status.success(), "{}", stderr(&first));
    let report = json(scene.path().join("gprop/grasp.json"));
    assert!(!report["candidates"].as_array().unwrap().is_empty());
    assert!(scene.path().join("gprop/grasp.png").exists());

    let profile = scene.path().join("tweezers.toml");
    let tweezers = "name = \"tweezers\"\nforce_n = [1.0, 9.0]\nfinger_area_m2 = 1e-4\npad = \"rubber\"\nstroke_m = 0.002\n\
                    [command]\nenabled_from = 0.0\nfull = 9.0\n";
    fs::write(&profile, tweezers).unwrap();
    let refused = |arguments: &[&str], code: i32, words: &[&str]| {
        let output = grasp(arguments);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
        assert_eq!(leftovers(&scene.path().join("gprop")), Vec::<PathBuf>::new());
    };
    refused(&["--part", "propeller"], 2, &["propeller", "the parts are"]);
    refused(&["--gripper", profile.to_str().unwrap()], 2, &["tweezers", "2 mm", "stroke"]);
    refused(&["--scale", "auto"], 3, &["--scale"]);
}

#[test]
fn an_unknown_flag() {
    let output = run(&fixture("hammer"), &["--no-such-flag"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn offline_without_models() {
    let scene = hammer();
    let cache = TempDir::new().unwrap();
    let output = gprop()
        .env("XDG_CACHE_HOME", cache.path())
        .env_remove("ORT_DYLIB_PATH")
        .args(["run", "--offline"])
        .arg(scene.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
    assert!(stderr(&output).contains("gprop setup"), "{}", stderr(&output));
}

#[test]
fn a_second_gprop_on_the_same_scene_waits_for_nobody() {
    let scene = hammer();
    let _held = gprop::workdir::WorkDir::open(&scene.path().join("gprop")).unwrap();
    let output = run(scene.path(), &["--to", "scene"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("another gprop"), "{}", stderr(&output));
}

#[test]
fn a_missing_recording() {
    if models("a_missing_recording").is_none() {
        return;
    }
    let scene = hammer();
    fs::remove_dir_all(scene.path().join("recorded")).unwrap();
    give_segments(&scene.path().join("gprop"));
    let arguments = [QUICK, &["--answers", "replay"]].concat();
    assert_refused(scene.path(), &arguments, 5, &["view 022", "--export"]);
    assert!(scene.path().join("gprop/segments/003.png").exists(), "what was done before stays");
}

/// The hammer is run as a whole by `scripts/test-wheel`.
#[test]
#[ignore = "takes minutes: SAM on ten views of each fixture; .ci/run runs it"]
fn every_question_about_the_other_fixtures_has_a_recorded_answer() {
    if models("every_question_about_the_other_fixtures_has_a_recorded_answer").is_none() {
        return;
    }
    for name in ["mug", "table_lamp", "chair"] {
        let out = TempDir::new().unwrap();
        for about in ["object", "parts"] {
            let mut query = gprop();
            query.arg("query").arg(fixture(name)).args(["--answers", "replay", "--ask", about]);
            let output = query.arg("--out").arg(out.path()).output().unwrap();
            assert!(output.status.success(), "{name}, {about}: {}", stderr(&output));
        }
    }
}

/// The mesh of the fixtures, with SAM on views that are drawn of it.
#[test]
#[ignore = "takes a minute: SAM on ten views; .ci/run runs it"]
fn the_cup_of_the_fixtures_weighs_what_it_should() {
    if models("the_cup_of_the_fixtures_weighs_what_it_should").is_none() {
        return;
    }
    let (cup, out) = (fixture("cup"), TempDir::new().unwrap());
    let recordings = cup.join("recorded");
    let output = gprop()
        .arg("run")
        .arg(cup.join("cup.glb"))
        .args(["--answers", "replay", "--to", "parts", "--out"])
        .arg(out.path())
        .arg("--recordings")
        .arg(recordings)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let parts = json(out.path().join("parts.json"));
    let mass = &parts["object"]["mass_kg"];
    // By `make.py`, 118.4 cm3 of stoneware, 2150 to 2600 kg/m3 in the library, on 39.1 cm3 of cork, 180 to 350 kg/m3.
    let [light, heavy] = [[2150.0, 180.0], [2600.0, 350.0]].map(|[cup, coaster]| 118.4e-6 * cup + 39.1e-6 * coaster);
    let [low, mid, high] = ["low", "mid", "high"].map(|end| mass[end].as_f64().unwrap());
    assert!(light <= mid && mid <= heavy && low > 0.75 * light && high < 1.2 * heavy, "{mass}");
    let materials: Vec<&str> =
        parts["parts"].as_array().unwrap().iter().map(|part| part["material"].as_str().unwrap()).collect();
    assert_eq!(materials, ["stoneware", "cork, agglomerated"]);
}

#[test]
fn a_rerun_reuses_everything_and_an_option_redoes_what_follows() {
    if models("a_rerun_reuses_everything_and_an_option_redoes_what_follows").is_none() {
        return;
    }
    let scene = hammer();
    give_segments(&scene.path().join("gprop"));
    let reused = || -> Vec<(String, bool)> {
        let record = json(scene.path().join("gprop/run.json"));
        let stage = |s: &Value| (s["name"].as_str().unwrap().to_owned(), s["reused"].as_bool().unwrap());
        record["stages"].as_array().unwrap().iter().map(stage).collect()
    };
    let first = run(scene.path(), QUICK);
    assert!(first.status.success(), "{}", stderr(&first));
    assert!(reused().iter().all(|(_, reused)| !reused));

    assert!(run(scene.path(), QUICK).status.success());
    assert!(reused().iter().all(|(_, reused)| *reused), "{:?}", reused());

    let turned = [QUICK, &["--lift-angle-deg", "30"]].concat();
    assert!(run(scene.path(), &turned).status.success());
    let again: Vec<_> = reused().into_iter().filter(|(_, reused)| !reused).map(|(name, _)| name).collect();
    assert_eq!(again, ["grasp", "report"]);
}

#[test]
fn a_killed_run_resumes_to_the_same_bytes() {
    if models("a_killed_run_resumes_to_the_same_bytes").is_none() {
        return;
    }
    let (undisturbed, killed) = (hammer(), hammer());
    for scene in [&undisturbed, &killed] {
        // SAM has one of the two views left to do.
        give_segments(&scene.path().join("gprop"));
        fs::remove_file(scene.path().join("gprop/segments/022.png")).unwrap();
    }
    let started = std::time::Instant::now();
    assert!(run(undisturbed.path(), QUICK).status.success());
    let whole = started.elapsed();

    // Kills spread over the run's length, whatever the machine's speed: none depends on hitting a certain stage.
    for part in 1..=2 {
        let mut command = gprop();
        command.stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = command.arg("run").arg(killed.path()).args(QUICK).spawn().unwrap();
        std::thread::sleep(whole * part / 3);
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let last = run(killed.path(), QUICK);
    assert!(last.status.success(), "{}", stderr(&last));

    for name in [
        "views.json",
        "segments/022.png",
        "segments/segments.json",
        "answers.jsonl",
        "field.ply",
        "parts.json",
        "interior.bin",
        "simulation/frames/0002.ply",
        "simulation/animation.gif",
        "grasp.json",
    ] {
        let read = |scene: &TempDir| fs::read(scene.path().join("gprop").join(name)).unwrap();
        assert!(read(&undisturbed) == read(&killed), "{name} differs after the kills");
    }
}

/// The lines of a command's stderr that say which stage is done.
fn stage_lines(output: &Output) -> Vec<String> {
    let lines = stderr(output);
    lines.lines().filter(|line| line.starts_with("stage ")).map(str::to_owned).collect()
}

#[test]
fn commands_say_what_they_found_and_which_stage_of_how_many_is_done() {
    if models("commands_say_what_they_found_and_which_stage_of_how_many_is_done").is_none() {
        return;
    }
    let scene = hammer();
    give_segments(&scene.path().join("gprop"));
    let command = |name: &str| gprop().arg(name).arg(scene.path()).args(QUICK).output().unwrap();
    let said = |name: &str, words: &[&str], file: &str| {
        let output = command(name);
        assert!(output.status.success(), "{}", stderr(&output));
        let text = String::from_utf8(output.stdout.clone()).unwrap();
        assert!(words.iter().all(|word| text.contains(word)), "gprop {name}: {text}");
        assert!(text.lines().count() <= 15, "gprop {name} prints more than a few lines: {text}");
        assert_eq!(text.lines().last(), Some(&*scene.path().join("gprop").join(file).to_string_lossy()));
        output
    };
    let grasp = said("grasp", &["grasp  ", " N at the ", "places, best first:", " mm wide"], "grasp.json");
    let stages = stage_lines(&grasp);
    let names = ["scene", "segment", "consensus", "recognise", "refine", "query", "vote", "parts", "grasp"];
    assert_eq!(stages.len(), names.len(), "{stages:?}");
    for (n, (line, name)) in stages.iter().zip(names).enumerate() {
        let begin = format!("stage {} of 9  {name}", n + 1);
        assert!(line.starts_with(&begin) && line.ends_with(" s"), "{line} is not {begin}");
    }
    let again = said("segment", &[" segments in 2 views"], "segments/segments.json");
    assert_eq!(stage_lines(&again), Vec::<String>::new(), "nothing is left to do");
    said("query", &[" answers", "hickory"], "answers.jsonl");
    said("vote", &[" Gaussians: "], "field.ply");
    said("parts", &[" g (", "mass   ", " kg ("], "parts.json");
}

#[test]
fn a_known_mass_says_how_long_the_object_is() {
    let balls = Balls::new(1);
    let text = |mass: &[&str]| {
        let mut command = gprop();
        command.arg("parts").arg(balls.scene(0)).args(balls.answers()).args(mass);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    assert!(!text(&[]).contains("longest side"), "the scale is known without the mass");
    let grams = text(&["--scale", "auto", "--known-mass", "660g"]);
    let size = "size   the known mass implies that the longest side is 0.";
    assert!(grams.contains(size) && grams.contains(" g ("), "{grams}");
    assert_eq!(grams, text(&["--scale", "auto", "--known-mass", "0.66kg"]));
    // Ten times as long, and each of the two parts weighs more than a kilogram.
    let kilograms = text(&["--scale", "auto", "--known-mass", "660"]);
    let size = "size   the known mass implies that the longest side is 1.";
    assert!(kilograms.contains(size) && !kilograms.contains(" g ("), "{kilograms}");
}

#[test]
fn a_simulation_is_not_done_again_under_another_limit_of_its_time() {
    let balls = Balls::new(1);
    let stages = |more: &[&str]| {
        let mut command = gprop();
        command.arg("simulate").arg(balls.scene(0)).args(balls.answers()).args(["--frames", "2", "--duration", "0.02"]);
        let output = command.args(["--grid", "16", "--size", "64x64"]).args(more).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        stage_lines(&output)
    };
    assert!(stages(&["--max-simulation-minutes", "500"]).last().is_some_and(|line| line.contains("simulate")));
    assert_eq!(stages(&[]), Vec::<String>::new());
    assert_eq!(stages(&["--gravity", "5"]).len(), 1, "what changes the result does count");
}

#[test]
fn a_simulation_says_how_long_it_may_take() {
    let balls = Balls::new(1);
    let mut command = gprop();
    command.arg("simulate").arg(balls.scene(0)).args(balls.answers()).args(["--frames", "2", "--duration", "0.02"]);
    let output = command.args(["--grid", "16", "--size", "64x64"]).output().unwrap();
    let lines = stderr(&output);
    let line = lines.lines().find(|line| line.starts_with("simulate  ")).unwrap_or_else(|| panic!("{lines}"));
    assert!(line.ends_with("none of which deforms, for 0.02 s: at most a minute"), "{line}");
}

#[test]
fn the_report_is_opened_by_the_users_program_and_only_if_it_is_there() {
    use std::os::unix::fs::PermissionsExt;

    if models("the_report_is_opened_by_the_users_program_and_only_if_it_is_there").is_none() {
        return;
    }
    let (scene, tools) = (hammer(), TempDir::new().unwrap());
    let (opener, opened) = (tools.path().join("xdg-open"), tools.path().join("opened"));
    fs::write(&opener, format!("#!/bin/sh\nprintf %s \"$1\" > '{}'\n", opened.display())).unwrap();
    fs::set_permissions(&opener, fs::Permissions::from_mode(0o755)).unwrap();
    let open = |arguments: &[&str]| {
        let mut command = gprop();
        command.arg(arguments[0]).arg(scene.path()).args(&arguments[1..]);
        command.env("PATH", format!("{}:/usr/bin:/bin", tools.path().display())).output().unwrap()
    };
    let nothing = open(&["view"]);
    assert_eq!(nothing.status.code(), Some(2));
    assert!(stderr(&nothing).contains("has no report yet") && !opened.exists(), "{}", stderr(&nothing));

    give_segments(&scene.path().join("gprop"));
    let report = open(&[&["report", "--open"], QUICK].concat());
    assert!(report.status.success(), "{}", stderr(&report));
    assert!(String::from_utf8_lossy(&report.stdout).contains("mass   "), "the summary is printed too");
    let page = scene.path().join("gprop/report.html");
    assert_eq!(fs::read_to_string(&opened).unwrap(), page.to_str().unwrap());

    fs::remove_file(&opened).unwrap();
    assert!(open(&["view"]).status.success() && opened.exists());
    // A link could make a browser open anything.
    fs::rename(&page, tools.path().join("elsewhere.html")).unwrap();
    std::os::unix::fs::symlink(tools.path().join("elsewhere.html"), &page).unwrap();
    fs::remove_file(&opened).unwrap();
    assert_eq!(open(&["view"]).status.code(), Some(2));
    assert!(!opened.exists());
    fs::remove_file(&page).unwrap();
    fs::rename(tools.path().join("elsewhere.html"), &page).unwrap();
    fs::write(&opener, "#!/bin/sh\nexit 3\n").unwrap();
    let broken = open(&["view"]);
    assert!(
        stderr(&broken).contains("cannot open a browser") && stderr(&broken).contains(page.to_str().unwrap()),
        "{}",
        stderr(&broken)
    );
    assert_eq!(broken.status.code(), Some(0), "the page is complete without a browser");

    // The folder that a batch was given by --out.
    fs::remove_file(&page).unwrap();
    fs::create_dir(scene.path().join("batch")).unwrap();
    fs::write(scene.path().join("batch/index.html"), "").unwrap();
    let of_batch = open(&["view"]);
    assert!(String::from_utf8_lossy(&of_batch.stdout).contains("batch/index.html"), "{}", stderr(&of_batch));
}

#[test]
fn an_option_that_would_be_ignored_is_refused() {
    let scene = hammer();
    let config = scene.path().join("fall.json");
    fs::write(&config, "{}").unwrap();
    let (images, picture) = (scene.path().join("images"), scene.path().join("images/003.png"));
    let [folder, images, picture, config] =
        [scene.path(), &images, &picture, &config].map(|path| path.to_str().unwrap());
    let cases: [(&[&str], &str); 5] = [
        (&["segment", picture, "--from", "segment"], "--from is for the stages of a scene"),
        (&["query", picture, "--from", "query"], "--from is for the stages of a scene"),
        (
            &["simulate", folder, "--compat", "physgaussian", "--config", config, "--from", "report"],
            "--from: without --field",
        ),
        (&["evaluate", "parts", folder, "--segments", images], "--segments: this command measures"),
        (&["evaluate", "prompts", folder, "--segments", images], "--segments: this command measures"),
    ];
    for (arguments, words) in cases {
        let output = gprop().args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(words), "{arguments:?}: {}", stderr(&output));
    }
    assert!(!scene.path().join("gprop").exists() && !scene.path().join("images/003.gprop").exists());
}

#[test]
fn an_inspection_compares_as_many_views_as_are_typed() {
    let output = gprop().arg("inspect").arg(fixture("hammer")).args(["--views", "3", "--json"]).output().unwrap();
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["views"].as_array().map(Vec::len), Some(3), "{}", stderr(&output));
}

#[test]
fn a_quiet_command_prints_nothing_about_a_picture() {
    if models("a_quiet_command_prints_nothing_about_a_picture").is_none() {
        return;
    }
    let out = TempDir::new().unwrap();
    let mut segment = gprop();
    segment.arg("segment").arg(fixture("hammer/images/003.png")).args(["-q", "--points-per-side", "4", "--out"]);
    let output = segment.arg(out.path()).output().unwrap();
    assert!(output.status.success() && output.stdout.is_empty(), "{output:?}");
    assert!(out.path().join("segments/003.png").exists());
}

#[test]
fn a_link_in_the_place_of_a_default_work_folder_is_refused() {
    let (scene, outside) = (hammer(), TempDir::new().unwrap());
    let (config, picture) = (scene.path().join("fall.json"), scene.path().join("images/003.png"));
    fs::write(&config, r#"{"frame_dt": 0.04, "substep_dt": 2e-5}"#).unwrap();
    let [folder, config, picture] = [scene.path(), &config, &picture].map(|path| path.to_str().unwrap());
    let refused = |arguments: &[&str], link: &Path| {
        std::os::unix::fs::symlink(outside.path(), link).unwrap();
        let output = gprop().args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("is a link"), "{arguments:?}: {}", stderr(&output));
        assert_eq!(fs::read_dir(outside.path()).unwrap().count(), 0, "{arguments:?}");
        fs::remove_file(link).unwrap();
    };
    let (work, beside) = (scene.path().join("gprop"), scene.path().join("images/003.gprop"));
    let simulate = ["simulate", folder, "--compat", "physgaussian", "--config", config];
    refused(&simulate, &work);
    fs::create_dir(&work).unwrap();
    refused(&simulate, &work.join("physgaussian"));
    refused(&["segment", picture], &beside);
    refused(&["segment", picture, "--dry-run"], &beside);
    refused(&["query", picture], &beside);
}

#[test]
fn a_report_has_the_name_of_a_scene_that_was_renamed() {
    let balls = Balls::new(1);
    let name = |scene: &Path| {
        let mut run = gprop();
        run.env_remove("OPENAI_API_KEY").arg("run").arg(scene).args(["--no-simulate", "-q"]).args(balls.answers());
        let output = run.output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        json(scene.join("gprop/report.json"))["scene"]["name"].clone()
    };
    assert_eq!(name(&balls.scene(0)), "ball-0");
    let renamed = balls.folder().join("renamed");
    fs::rename(balls.scene(0), &renamed).unwrap();
    assert_eq!(name(&renamed), "renamed");
}

#[test]
fn help_is_found_in_three_ways() {
    let said = |arguments: &[&str]| String::from_utf8(gprop().args(arguments).output().unwrap().stdout).unwrap();
    let short = said(&["grasp", "--help"]);
    assert!(short.contains("--force-margin") && !short.contains("--sam-encoder"), "{short}");
    assert_eq!(said(&["grasp", "-h"]), short);
    assert_eq!(said(&["help", "grasp"]), short);
    assert!(said(&["grasp", "--help-all"]).contains("--sam-encoder"));
    assert!(said(&["help", "evaluate", "mass"]).contains("--predictions"));
    assert_eq!(said(&["help"]), said(&["--help"]));
    assert_eq!(gprop().args(["help", "nonsense"]).output().unwrap().status.code(), Some(2));
}

#[test]
fn the_parts_of_an_earlier_run_do_not_stay_beside_segments() {
    let balls = Balls::new(1);
    let consensus = |flags: &[&str]| {
        let mut command = gprop();
        let output = command.arg("run").arg(balls.scene(0)).args(["--to", "consensus"]).args(flags).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let files = || fs::read_dir(balls.scene(0).join("gprop/consensus")).unwrap().count();
    let text = consensus(&["--ask", "parts"]);
    assert!(!text.starts_with("no parts") && files() == 5, "{text}");
    consensus(&["--ask", "parts", "--view-list", "000,002"]);
    assert_eq!(files(), 4, "the map of a view that is not chosen now is gone");
    let text = consensus(&["--ask", "segments"]);
    assert!(text.starts_with("no parts") && files() == 0, "{text}");
    assert_eq!(consensus(&["--ask", "segments", "--json"]).trim(), "null");
}
