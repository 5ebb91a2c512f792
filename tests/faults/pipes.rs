//! Named pipes where files are expected: a process that opens one waits for a writer that never comes.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use super::assert_refused;
use crate::batch::ball::Balls;

/// Seconds after which a run counts as hung: a thousand times what a run takes here, however busy the machine is.
const HUNG: &str = "1200";

/// Replaces a file with a named pipe.
fn pipe(path: &Path) {
    let _ = fs::remove_file(path);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// gprop, killed if it hangs.
fn timed() -> Command {
    let mut command = Command::new("timeout");
    command.args(["--kill-after=1", HUNG, env!("CARGO_BIN_EXE_gprop")]).env_remove("OPENAI_API_KEY");
    command
}

fn run(balls: &Balls, out: &Path, more: &[&str]) -> Output {
    let mut command = timed();
    command.arg("run").arg(balls.scene(0)).args(["-q", "--out"]).arg(out);
    let to_parts: &[&str] = if more.contains(&"--to") { &[] } else { &["--to", "parts"] };
    command.args(to_parts).args(balls.answers()).args(more).output().unwrap()
}

#[test]
fn in_place_of_a_scenes_files() {
    for (file, code) in [
        ("point_cloud.ply", 3),
        ("transforms.json", 3),
        ("images/001.png", 3),
        ("masks/001.png", 3),
        ("dataparser_transforms.json", 3),
        ("gprop.toml", 2),
        ("corrections.toml", 2),
        ("recorded/a.json", 5),
    ] {
        let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
        pipe(&balls.scene(0).join(file));
        let name = file.rsplit('/').next().unwrap();
        let name = if code == 5 { "recorded" } else { name };
        assert_refused(&run(&balls, out.path(), &[]), code, &[name, "it is a named pipe, not a regular file"]);
    }
}

#[test]
fn in_place_of_files_that_the_user_names() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    let odd = out.path().join("odd.ply");
    pipe(&odd);
    for flag in ["--splat", "--cameras"] {
        let output = run(&balls, &out.path().join("work"), &[flag, odd.to_str().unwrap()]);
        assert_refused(&output, 3, &["odd.ply", "it is a named pipe"]);
    }
    for device in ["/dev/zero", "/dev/null"] {
        let output = run(&balls, &out.path().join("work"), &["--cameras", device]);
        assert_refused(&output, 3, &[device, "it is a device"]);
    }
    for command in [&["grasp", "calibrate"][..], &["evaluate", "grasp", "--outcomes"], &["evaluate", "hardness"]] {
        assert_refused(&timed().args(command).arg(&odd).output().unwrap(), 2, &["odd.ply", "it is a named pipe"]);
    }
    pipe(&balls.labels(0).join("001.png"));
    assert_refused(&run(&balls, &out.path().join("work"), &[]), 3, &["001.png", "it is a named pipe"]);
}

#[test]
fn in_place_of_files_that_a_scenes_options_name() {
    for (option, file) in
        [("materials", "own/materials.csv"), ("labels", "own"), ("gripper", "own.toml"), ("scenario", "own.toml")]
    {
        let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
        pipe(&balls.scene(0).join(file));
        let named = file.split('/').next().unwrap();
        let configuration = balls.scene(0).join("gprop.toml");
        let others = fs::read_to_string(&configuration).unwrap();
        fs::write(configuration, format!("{others}{option} = \"{named}\"\n")).unwrap();
        let to_the_end =
            ["--to", "report", "--scale", "1", "--frames", "2", "--duration", "0.01", "--grid", "8", "--size", "64x64"];
        assert_refused(&run(&balls, out.path(), &to_the_end), 2, &[file, "it is a named pipe"]);
    }
}

#[test]
fn in_place_of_a_work_folders_files() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path(), &[]).status.success());
    for file in ["run.json", "segments/segments.json", "segments/001.png", "answers.jsonl", "field.ply", "labels.json"]
    {
        pipe(&out.path().join(file));
        let output = run(&balls, out.path(), &[]);
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(out.path().join(file).is_file(), "{file} is made again");
    }
    pipe(&out.path().join(".lock"));
    assert_refused(&run(&balls, out.path(), &[]), 2, &["it is a named pipe"]);
}
