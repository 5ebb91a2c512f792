//! The options of the last run in a work folder, with which every command on a scene goes on.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::batch::ball::Balls;
use crate::query::client::{Server, error};
use crate::run::gprop;
use crate::support::stderr;

/// The beginning of the line that says which options of the last run are used.
const SAID: &str = "options of the last run: ";

/// A ball whose `gprop.toml` gives neither the scale nor the folder of the segments.
struct Ball {
    balls: Balls,
}

impl Ball {
    fn new() -> Self {
        let balls = Balls::new(1);
        let options = "ask = \"segments\"\nvolume-cells = 20000\nsheet-size = 256\n";
        fs::write(balls.scene(0).join("gprop.toml"), options).unwrap();
        Self { balls }
    }

    /// The same after a run with a scale, a folder of segments and two views, all of whose answers are recorded.
    fn after_a_run() -> Self {
        let ball = Self::new();
        let options = ["--segments", "ball-0/labels", "--view-list", "000,002", "--scale", "0.4"];
        for server in ball.with_and_without_server() {
            assert_eq!(used(ball.gprop("parts").args(options).args(server)), None);
        }
        ball
    }

    /// The options for a first run, which records the answers, and for a second one, which reads them as commands
    /// without a model do.
    fn with_and_without_server(&self) -> [Vec<String>; 2] {
        [self.balls.answers().to_vec(), Vec::new()]
    }

    fn scene(&self) -> PathBuf {
        self.balls.scene(0)
    }

    /// A command on the scene, started in the folder above it.
    fn gprop(&self, name: &str) -> Command {
        let mut command = gprop();
        // The only server is on this machine.
        command.env_remove("OPENAI_API_KEY").env_remove("GPROP_OFFLINE").current_dir(self.balls.folder());
        command.arg(name).arg("ball-0");
        command
    }

    fn work(&self) -> PathBuf {
        self.scene().join("gprop")
    }

    fn record(&self) -> Value {
        serde_json::from_slice(&fs::read(self.work().join("run.json")).unwrap()).unwrap()
    }

    /// Writes flags into `run.json`, as a stranger who made the scene might.
    fn give_flags(&self, flags: Value) {
        let mut record = self.record();
        record["flags"] = flags;
        fs::write(self.work().join("run.json"), record.to_string()).unwrap();
    }

    /// The names of the views in the work folder.
    fn views(&self) -> Vec<String> {
        let views: Value = serde_json::from_slice(&fs::read(self.work().join("views.json")).unwrap()).unwrap();
        views["views"].as_array().unwrap().iter().map(|view| view["name"].as_str().unwrap().to_owned()).collect()
    }
}

/// The stages that were done, not reused, by the last command that reached them.
fn done(record: &Value) -> Vec<&str> {
    let stages = record["stages"].as_array().unwrap().iter();
    stages.filter(|stage| stage["reused"] == json!(false)).map(|stage| stage["name"].as_str().unwrap()).collect()
}

/// Runs a command that must succeed; returns the options of the last run that it says it uses.
#[track_caller]
fn used(command: &mut Command) -> Option<String> {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let lines = stderr(&output);
    let mut said = lines.lines().filter_map(|line| line.strip_prefix(SAID));
    let options = said.next().map(str::to_owned);
    assert_eq!(said.next(), None, "one line");
    options
}

#[track_caller]
fn assert_refused(command: &mut Command, words: &[&str]) {
    let output = command.output().unwrap();
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.matches("error:").count(), 1, "{message}");
    assert!(message.len() < 2000, "{message}");
    for word in words {
        assert!(message.contains(word), "no {word:?} in: {message}");
    }
}

#[test]
fn commands_go_on_from_the_last_run() {
    let ball = Ball::after_a_run();
    let field = fs::read(ball.work().join("field.ply")).unwrap();
    let parts = fs::read(ball.work().join("parts.json")).unwrap();
    let out = TempDir::new().unwrap();
    let options = Some("--view-list=000,002 --scale=0.4 --segments=ball-0/labels".to_owned());
    let export = || {
        let mut export = ball.gprop("export");
        export.args(["--format", "npz,mjcf", "--out"]).arg(out.path());
        export
    };
    assert_eq!(used(&mut export()), options);
    assert_eq!(done(&ball.record()), [""; 0]);
    let mass = |parts: &[u8]| serde_json::from_slice::<Value>(parts).unwrap()["parts"][0]["mass_kg"]["mid"].as_f64();
    assert!(mass(&parts).is_some(), "the metric scale is there");
    let record = fs::read(ball.work().join("run.json")).unwrap();
    assert_eq!(used(&mut export()), options);
    assert!(record == fs::read(ball.work().join("run.json")).unwrap(), "the same command writes the same record");

    let picture = out.path().join("a.png");
    assert_eq!(used(ball.gprop("show").arg(&picture)), options);
    assert!(picture.exists());
    let film = out.path().join("a.gif");
    used(ball.gprop("show").arg(&film).args(["--turntable", "--size", "64x64", "--fps", "1"]));
    assert_eq!(used(ball.gprop("show").arg(&picture)), options, "how a film is made is not an option of a stage");
    assert_eq!(used(ball.gprop("show").arg(&picture).arg("-q")), None);
    assert_eq!(used(ball.gprop("grasp").args(["--dry-run", "--json"])), options);
    assert_eq!(done(&ball.record()), [""; 0]);

    // The paths mean the same files wherever the command is started.
    let elsewhere = used(gprop().arg("grasp").arg(ball.scene()).current_dir(out.path()));
    let here = format!("{}/labels", ball.scene().display());
    assert_eq!(elsewhere, options.as_ref().map(|options| options.replace("ball-0/labels", &here)));
    assert_eq!(done(&ball.record()), ["grasp"]);
    let quick = ["--frames", "2", "--duration", "0.01", "--grid", "8", "--size", "64x64"];
    assert_eq!(used(ball.gprop("simulate").args(quick)), options);
    assert_eq!(done(&ball.record()), ["simulate", "grasp"], "the grasp is that of the command before");
    let flags = json!({ "scene": ["--view-list=000,002", "--scale=0.4"], "segment": ["--segments=labels"] });
    assert_eq!(ball.record()["flags"], flags, "those of the simulation were for that command only");
    assert!(field == fs::read(ball.work().join("field.ply")).unwrap());
    assert!(parts == fs::read(ball.work().join("parts.json")).unwrap());
}

#[test]
fn runs_and_questions_go_on_from_the_last_run() {
    let ball = Ball::after_a_run();
    let flags = ball.record()["flags"].clone();
    let options = Some("--view-list=000,002 --scale=0.4 --segments=ball-0/labels");
    for (name, more) in [
        ("run", &["--to", "parts"][..]),
        ("run", &["--dry-run"]),
        ("report", &["--dry-run"]),
        ("segment", &[]),
        ("query", &[]),
        ("query", &["--export", "open"]),
        ("query", &["--prune"]),
        ("answer", &["--dry-run"]),
        ("vote", &[]),
        ("parts", &[]),
    ] {
        assert_eq!(used(ball.gprop(name).args(more)).as_deref(), options, "{name} {more:?}");
        assert_eq!(done(&ball.record()), [""; 0], "{name} {more:?}");
        assert_eq!(ball.record()["flags"], flags, "{name} {more:?}");
    }
    assert_eq!(used(ball.gprop("run").args(["--to", "scene"])).unwrap(), "--view-list=000,002 --scale=0.4");
    assert_eq!(used(ball.gprop("run").args(["--fresh", "--dry-run"])), None);
}

#[test]
fn options_hold_until_the_answers_are_there() {
    let ball = Ball::new();
    let options = ["--segments", "ball-0/labels", "--view-list", "000", "--context", "local"];
    assert_eq!(used(ball.gprop("query").args(["--export", "open"]).args(options)), None);
    let kept = "--view-list=000 --segments=ball-0/labels --context=local";
    assert_eq!(used(ball.gprop("query").args(["--import", "open"])).unwrap(), kept);
    let output = ball.gprop("run").args(["--to", "parts", "--known-mass", "2kg"]).output().unwrap();
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    let weighed = used(ball.gprop("run").args(["--to", "parts"]).args(ball.balls.answers()));
    assert_eq!(weighed.unwrap(), format!("{kept} --known-mass=2kg"));
    let parts: Value = serde_json::from_slice(&fs::read(ball.work().join("parts.json")).unwrap()).unwrap();
    assert_eq!(parts["known_mass"]["reading_kg"], json!(2.0), "{}", parts["known_mass"]);
}

#[test]
fn scenes_of_a_batch_start_afresh() {
    let balls = Balls::new(1);
    let views = || {
        let views: Value = serde_json::from_slice(&fs::read(balls.scene(0).join("gprop/views.json")).unwrap()).unwrap();
        views["views"].as_array().unwrap().len()
    };
    used(gprop().arg("run").arg(balls.scene(0)).args(["--to", "scene", "--views", "1"]));
    assert_eq!(views(), 1);
    used(gprop().arg("batch").arg(balls.folder()).args(["--to", "scene"]));
    assert_eq!(views(), 3);
}

#[test]
fn a_picture_takes_nothing_from_the_mesh_beside_it() {
    let folder = TempDir::new().unwrap();
    let picture = folder.path().join("mug.png");
    image::RgbImage::new(64, 64).save(&picture).unwrap();
    fs::create_dir(folder.path().join("mug.gprop")).unwrap();
    fs::write(folder.path().join("mug.gprop/run.json"), r#"{"flags": {"scene": ["--views=5"]}}"#).unwrap();
    assert_eq!(used(gprop().arg("query").arg(&picture).arg("--dry-run")), None);
}

#[test]
fn a_typed_option_wins_and_a_fresh_run_takes_none() {
    let ball = Ball::after_a_run();
    let out = TempDir::new().unwrap();
    let picture = out.path().join("a.png");
    // The third view has no answers yet; --view-list gives way to --views.
    let answers = ball.balls.answers();
    let options = used(ball.gprop("show").arg(&picture).args(["--views", "3"]).args(&answers));
    assert_eq!(options.unwrap(), "--scale=0.4 --segments=ball-0/labels");
    assert_eq!(ball.views().len(), 3);
    let record = ball.record();
    assert_eq!(record["flags"], json!({ "scene": ["--views=3", "--scale=0.4"], "segment": ["--segments=labels"] }));
    let address = answers[1].as_str();
    assert!(!record.to_string().contains(address), "no server is recorded");
    assert_eq!(used(ball.gprop("show").arg(&picture)).unwrap(), "--views=3 --scale=0.4 --segments=ball-0/labels");
    assert_eq!(ball.views().len(), 3);

    // The options of a stage that fails are not kept.
    assert_refused(ball.gprop("grasp").args(["--part", "propeller"]), &["propeller"]);
    used(&mut ball.gprop("grasp"));

    assert_eq!(used(ball.gprop("run").args(["--to", "scene", "--views", "1"])).unwrap(), "--scale=0.4");
    assert_eq!((ball.views().len(), &ball.record()["flags"]["scene"]), (1, &json!(["--views=1", "--scale=0.4"])));
    assert_eq!(used(ball.gprop("run").args(["--to", "scene", "--fresh"])), None);
    assert_eq!((ball.views().len(), &ball.record()["flags"]["scene"]), (3, &Value::Null));
}

#[test]
fn a_grasp_is_tried_out_with_the_gripper_of_the_run() {
    let ball = Ball::after_a_run();
    let options = ["--segments", "ball-0/labels", "--scale", "0.4", "--view-list", "000,002", "--to", "grasp"];
    let of_grasp = ["--gripper", "robotiq-2f-85", "--policy", "safe"];
    used(ball.gprop("run").args(options).args(of_grasp));
    let kept = "--view-list=000,002 --scale=0.4 --segments=ball-0/labels --gripper=robotiq-2f-85";
    let grasp = |more: &[&str]| used(ball.gprop("grasp").args(more)).unwrap();
    assert_eq!(grasp(&[]), format!("{kept} --policy=safe"));
    assert_eq!(done(&ball.record()), [""; 0]);
    assert_eq!(grasp(&["--policy", "mid"]), kept);
    assert_eq!(grasp(&["--lift-angle-deg", "30"]), format!("{kept} --policy=safe"), "as for the run");
}

#[test]
fn an_export_goes_on_with_the_grasp_of_the_run() {
    let ball = Ball::after_a_run();
    let options = ["--segments", "ball-0/labels", "--scale", "0.4", "--view-list", "000,002", "--to", "grasp"];
    used(ball.gprop("run").args(options).args(["--gripper", "robotiq-2f-85", "--policy", "safe"]));
    let (flags, out) = (ball.record()["flags"].clone(), TempDir::new().unwrap());
    let grasp = || fs::read(ball.work().join("grasp.json")).unwrap();
    let of_run = grasp();
    let export = |more: &[&str]| {
        used(ball.gprop("export").args(["--format", "usda", "--out"]).arg(out.path()).args(more)).unwrap()
    };
    let kept = "--view-list=000,002 --scale=0.4 --segments=ball-0/labels --gripper=robotiq-2f-85";
    assert_eq!(export(&[]), format!("{kept} --policy=safe"));
    assert_eq!(done(&ball.record()), [""; 0]);
    assert!(grasp() == of_run);
    assert_eq!(export(&["--policy", "mid"]), kept);
    assert_eq!(done(&ball.record()), ["grasp"]);
    assert_eq!(ball.record()["flags"], flags, "the policy was for that export only");
    assert_eq!(export(&[]), format!("{kept} --policy=safe"));
    assert!(grasp() == of_run);
}

#[test]
fn a_grasp_without_a_scale_is_refused_after_a_report_too() {
    let ball = Ball::new();
    let options = ["--segments", "ball-0/labels", "--view-list", "000,002", "--no-simulate"];
    for server in ball.with_and_without_server() {
        used(ball.gprop("run").args(options).args(server));
    }
    assert_eq!(fs::read_to_string(ball.scene().join("gprop/grasp.json")).unwrap().trim(), "null");
    let output = ball.gprop("grasp").output().unwrap();
    assert!(output.status.code() == Some(3) && stderr(&output).contains("give --scale"), "{output:?}");
}

#[test]
fn a_preset_is_an_option_of_the_last_run() {
    let ball = Ball::after_a_run();
    let vote = ["--preset", "paper", "--segments", "ball-0/labels", "--view-list", "000,002"];
    used(ball.gprop("vote").args(vote));
    let out = TempDir::new().unwrap();
    let options = used(ball.gprop("show").arg(out.path().join("a.png")));
    assert_eq!(options.unwrap(), "--preset=paper --view-list=000,002 --scale=0.4 --segments=ball-0/labels");
    assert_eq!(done(&ball.record()), [""; 0]);
}

#[test]
fn what_no_gprop_records_is_not_used() {
    let server = Server::new(|_, _, _| error(500, "a work folder's server was asked"));
    let url = server.options().lmm_url.unwrap();
    let (ball, out) = (Ball::after_a_run(), TempDir::new().unwrap());
    let outside = out.path().join("outside");
    fs::write(&outside, "").unwrap();
    let file = outside.display();
    let kept = ["--view-list=000,002", "--scale=0.4", "--segments=labels"].map(str::to_owned);
    let own = ball.record()["flags"].clone();
    let hostile: Vec<String> = [
        format!("--lmm-url={url}"),
        "--lmm-model=test-model".into(),
        "--max-usd=1000".into(),
        "--answers=live".into(),
        format!("--sam-encoder={file}"),
        format!("--ort-lib={file}"),
        format!("--prices={file}"),
        format!("--out={file}"),
        "--allow-read=/".into(),
        "--threads=1".into(),
        "--offline".into(),
        "--size=99999x99999".into(),
        "--turntable=3".into(),
        "--views".into(),
        "--help".into(),
        "--".into(),
        "gprop".into(),
        "-v".into(),
        "--\u{1b}[31m=\u{202e}".into(),
        "\u{0}".into(),
        String::new(),
        format!("--part={}", "x".repeat(200_000)),
    ]
    .into();
    for field in ["scene", "query", "segment", "vote", "nothing"] {
        let mut flags = own.clone();
        let before = flags[field].as_array().cloned().unwrap_or_default();
        flags[field] = [before, hostile.iter().cloned().map(Value::from).collect()].concat().into();
        ball.give_flags(flags);
        let options = used(ball.gprop("show").arg(out.path().join("a.png"))).unwrap();
        assert_eq!(options.split(' ').count(), kept.len(), "{options}");
        assert_eq!(done(&ball.record()), [""; 0]);
    }
    assert!(server.requests().is_empty());

    // If it is not even a list of flags, the run is done again with the defaults, which lack the segments.
    for flags in [json!(5), json!({ "scene": 5 }), json!({ "scene": [5] }), json!([["--views=1"]])] {
        ball.give_flags(flags);
        let output = ball.gprop("grasp").arg("--dry-run").output().unwrap();
        assert!(output.status.success() && !stderr(&output).contains(SAID), "{}", stderr(&output));
    }
    let deep = "[".repeat(100_000);
    for bytes in
        [&b"\xff\xfe{\"flags\": {}}"[..], b"{\"flags\": {\"scene\": [\"--views=\xff\"]}}", deep.as_bytes(), b""]
    {
        fs::write(ball.work().join("run.json"), bytes).unwrap();
        let output = ball.gprop("grasp").arg("--dry-run").output().unwrap();
        assert!(output.status.success() && !stderr(&output).contains(SAID), "{}", stderr(&output));
    }
}

#[test]
fn what_a_scenes_work_folder_may_not_say_is_refused_with_the_remedy() {
    let (ball, out) = (Ball::after_a_run(), TempDir::new().unwrap());
    let picture = out.path().join("a.png");
    let splat = out.path().join("splat.ply");
    fs::copy(ball.scene().join("point_cloud.ply"), &splat).unwrap();
    fs::create_dir(out.path().join("folder")).unwrap();
    let folder = out.path().join("folder");
    let field = fs::read(ball.work().join("field.ply")).unwrap();
    for (name, value) in [
        ("splat", &*splat.to_string_lossy()),
        ("images", "../images"),
        ("masks", "/"),
        ("segments", "images/../../ball-0/labels"),
        ("materials", &*splat.to_string_lossy()),
        ("labels", &*splat.to_string_lossy()),
        ("recordings", &*folder.to_string_lossy()),
        ("prompts", "images"),
        ("scale", "estimate"),
    ] {
        let flag = format!("--{name}={value}");
        ball.give_flags(json!({ "scene": [flag] }));
        let words = ["run.json", &flag, "the last run", &format!("give --{name} again"), "--out", "--fresh"];
        assert_refused(ball.gprop("show").arg(&picture), &words);
        let to = ["--format", "npz", "--out"];
        assert_refused(ball.gprop("export").args(to).arg(out.path()), &["run.json", &flag, "--work"]);
        assert_eq!(ball.record()["flags"], json!({ "scene": [flag] }), "nothing was begun");
    }
    for flag in ["--views=banana", "--object-box=\u{1b}[31m", "--splat=a\u{0}b", "--segments=nowhere"] {
        ball.give_flags(json!({ "scene": [flag] }));
        let (name, _) = flag.split_once('=').unwrap();
        assert_refused(ball.gprop("show").arg(&picture), &["run.json", name, "--fresh"]);
    }
    let long = format!("--views={}", "9".repeat(100_000));
    ball.give_flags(json!({ "scene": [long] }));
    assert_refused(ball.gprop("show").arg(&picture), &["run.json", "--views"]);
    assert!(field == fs::read(ball.work().join("field.ply")).unwrap() && !picture.exists());
    // Flags of a stage that the command does not need do not matter, and one that is typed again replaces the other.
    ball.give_flags(json!({
        "scene": ["--view-list=000,002", "--scale=estimate"], "segment": ["--segments=labels"],
        "grasp": [format!("--gripper={}", splat.display())],
    }));
    let options = used(ball.gprop("show").arg(&picture).args(["--scale", "0.4"]));
    assert_eq!(options.unwrap(), "--view-list=000,002 --segments=ball-0/labels");
    assert_eq!(done(&ball.record()), [""; 0]);
}

#[test]
fn a_link_is_not_a_record() {
    let (ball, out) = (Ball::after_a_run(), TempDir::new().unwrap());
    let elsewhere = out.path().join("elsewhere.json");
    fs::rename(ball.work().join("run.json"), &elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, ball.work().join("run.json")).unwrap();
    assert_eq!(used(ball.gprop("grasp").arg("--dry-run")), None);
}

#[test]
fn a_work_folder_that_the_user_names_may_say_more() {
    let (ball, out) = (Ball::new(), TempDir::new().unwrap());
    let (work, answers) = (out.path().join("work"), out.path().join("answers"));
    let labels = out.path().join("labels");
    fs::rename(ball.scene().join("labels"), &labels).unwrap();
    // The paths are typed relative to the folder in which the command is started.
    let options = ["--segments", "labels", "--recordings", "answers", "--out", "work"];
    for server in ball.with_and_without_server() {
        let mut vote = gprop();
        vote.env_remove("OPENAI_API_KEY").env_remove("GPROP_OFFLINE").current_dir(out.path());
        assert_eq!(used(vote.arg("vote").arg(ball.scene()).args(options).args(server)), None);
    }
    let named = |name: &str| {
        let mut command = ball.gprop(name);
        command.arg(if name == "export" { "--work" } else { "--out" }).arg(&work);
        command
    };
    let picture = out.path().join("a.png");
    let options = format!("--segments={} --recordings={}", labels.display(), answers.display());
    assert_eq!(used(named("show").arg(&picture)).unwrap(), options);
    assert_eq!(
        used(named("export").args(["--scale", "2", "--format", "npz", "--out"]).arg(out.path())).unwrap(),
        options
    );
    let record: Value = serde_json::from_slice(&fs::read(work.join("run.json")).unwrap()).unwrap();
    assert_eq!(record["flags"]["query"], json!([format!("--recordings={}", answers.display())]));
    // Even there, no flag is taken that loads code, names a server or costs money.
    let mut hostile = record.clone();
    hostile["flags"]["query"] = json!(["--lmm-url=http://127.0.0.1:9/v1", "--max-usd=9"]);
    hostile["flags"]["setup"] = json!(["--ort-lib=/lib.so", "--sam-encoder=/x"]);
    hostile["flags"]["segment"] = json!([format!("--segments={}", labels.display()), "--ort-lib=/lib.so"]);
    fs::write(work.join("run.json"), hostile.to_string()).unwrap();
    let output = named("export").args(["--format", "npz", "--out"]).arg(out.path()).output().unwrap();
    assert!(
        stderr(&output).contains(&format!("{SAID}--scale=2 --segments={}\n", labels.display())),
        "{}",
        stderr(&output)
    );
}

#[test]
fn the_content_of_a_named_file_counts_and_not_how_its_path_is_written() {
    let (ball, out) = (Ball::after_a_run(), TempDir::new().unwrap());
    let scenario = out.path().join("fall.toml");
    let simulate = |scenario: &str| {
        let quick = ["--frames", "2", "--duration", "0.01", "--grid", "8", "--size", "64x64", "--scenario", scenario];
        let mut simulate = gprop();
        used(simulate.current_dir(out.path()).arg("simulate").arg(ball.scene()).args(quick));
        done(&ball.record()).contains(&"simulate")
    };
    fs::write(&scenario, "drop_height = 1.0\n").unwrap();
    assert!(simulate("fall.toml"));
    assert!(!simulate(text(&scenario)), "it is the same file");
    fs::write(&scenario, "drop_height = 2.0\n").unwrap();
    assert!(simulate("fall.toml"), "it has changed");
}

#[test]
fn a_path_of_the_scene_moves_with_it() {
    let ball = Ball::after_a_run();
    let moved = ball.balls.folder().join("moved");
    fs::rename(ball.scene(), &moved).unwrap();
    let picture = moved.join("a.png");
    let mut show = gprop();
    let options = used(show.arg("show").args([&moved, &picture])).unwrap();
    assert!(options.ends_with(&format!("--segments={}", text(&moved.join("labels")))), "{options}");
    let record: Value = serde_json::from_slice(&fs::read(moved.join("gprop/run.json")).unwrap()).unwrap();
    assert_eq!(done(&record), [""; 0]);
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
