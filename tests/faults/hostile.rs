//! Scenes, answers and recordings from elsewhere that name files outside the work folder, or link to them.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Stdio;

use gprop::segment::LabelMap;
use gprop::workdir::Checksum;
use serde_json::{Value, json};

use super::{assert_refused, run};
use crate::batch::ball::Balls;
use crate::batch::contents;
use crate::run::gprop;

/// A folder beside the scene into which nothing may be written, with a file that must not change.
struct Bystander {
    folder: tempfile::TempDir,
    before: Vec<(PathBuf, Vec<u8>)>,
}

impl Bystander {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("precious"), "as it was").unwrap();
        let before = contents(folder.path());
        Self { folder, before }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    #[track_caller]
    fn assert_untouched(&self) {
        assert!(contents(self.path()) == self.before, "{:?}", contents(self.path()));
        assert!(!self.path().join(".lock").exists() && !self.path().join("run.json").exists());
    }
}

#[test]
fn links_in_a_work_folder_are_not_written_through() {
    for folder in ["segments", "sheets"] {
        let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
        symlink(bystander.path(), out.path().join(folder)).unwrap();
        assert_refused(&run(&balls, out.path()), 2, &[folder, "is a link", "remove it"]);
        bystander.assert_untouched();
    }
    // A lock is opened for writing.
    let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
    symlink(bystander.path().join("precious"), out.path().join(".lock")).unwrap();
    assert_refused(&run(&balls, out.path()), 2, &[".lock", "is a link"]);
    bystander.assert_untouched();
    // A link in the place of a file is replaced.
    let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
    symlink(bystander.path().join("precious"), out.path().join("views.json")).unwrap();
    assert!(run(&balls, out.path()).status.success());
    assert!(!out.path().join("views.json").is_symlink());
    bystander.assert_untouched();
}

#[test]
fn an_export_is_not_written_through_links_below_its_folder() {
    let (balls, out) = (Balls::new(1), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let export = |to: &Path| {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("export").arg(balls.scene(0)).arg("--work").arg(out.path());
        command
            .args(["--format", "mjcf,urdf,npz,physgaussian,usda,usdz,glb,gltf-splat,ply-parts", "-q", "--out"])
            .arg(to)
            .args(balls.answers())
            .output()
            .unwrap()
    };
    let calm = tempfile::tempdir().unwrap();
    let done = export(calm.path());
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let files = contents(calm.path());
    let folders: BTreeSet<&Path> = files.iter().filter_map(|(path, _)| path.ancestors().nth(1)).collect();
    let folders: Vec<&Path> = folders.into_iter().filter(|folder| !folder.as_os_str().is_empty()).collect();
    assert!(!folders.is_empty(), "{files:?}");
    for folder in folders {
        let (bystander, model) = (Bystander::new(), tempfile::tempdir().unwrap());
        let link = model.path().join(folder);
        fs::create_dir_all(link.parent().unwrap()).unwrap();
        symlink(bystander.path(), &link).unwrap();
        assert_refused(&export(model.path()), 2, &["is a link", "remove it"]);
        bystander.assert_untouched();
    }
    // Links in the places of all files are replaced.
    let (bystander, model) = (Bystander::new(), tempfile::tempdir().unwrap());
    for (file, _) in &files {
        fs::create_dir_all(model.path().join(file).parent().unwrap()).unwrap();
        symlink(bystander.path().join("precious"), model.path().join(file)).unwrap();
    }
    assert!(export(model.path()).status.success());
    assert!(contents(model.path()) == files);
    bystander.assert_untouched();
}

#[test]
fn manual_pages_replace_links() {
    let (bystander, pages) = (Bystander::new(), tempfile::tempdir().unwrap());
    symlink(bystander.path().join("precious"), pages.path().join("gprop.1")).unwrap();
    assert!(gprop().args(["man", "--out"]).arg(pages.path()).output().unwrap().status.success());
    assert!(pages.path().join("gprop.1").is_file() && pages.path().join("gprop-run.1").is_file());
    bystander.assert_untouched();
}

/// While gprop runs, another program puts a link in the place of a folder that gprop writes into, again and again.
#[test]
fn a_link_that_comes_while_gprop_runs_is_not_written_through() {
    for folder in ["segments", "sheets", "consensus"] {
        let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
        let (place, aside) = (out.path().join(folder), out.path().join("aside"));
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).args(["--to", "parts", "-q", "--out"]);
        let mut running = command.arg(out.path()).args(balls.answers()).stderr(Stdio::null()).spawn().unwrap();
        while running.try_wait().unwrap().is_none() {
            let _ = fs::rename(&place, &aside);
            if symlink(bystander.path(), &place).is_ok() {
                std::thread::yield_now();
                let _ = fs::remove_file(&place);
            }
            let _ = fs::rename(&aside, &place);
        }
        // It may end with an error, but not with one of gprop's own.
        assert_ne!(running.wait().unwrap().code(), Some(70));
        bystander.assert_untouched();
    }
}

#[test]
fn a_scene_brings_no_link_for_a_work_folder() {
    let (balls, bystander) = (Balls::new(1), Bystander::new());
    symlink(bystander.path(), balls.scene(0).join("gprop")).unwrap();
    let run = gprop().arg("run").arg(balls.scene(0)).args(["--to", "scene"]).output().unwrap();
    assert_refused(&run, 2, &["gprop\" is a link", "--out"]);
    let batch = gprop().arg("batch").arg(balls.folder()).args(["--to", "scene", "--json"]).output().unwrap();
    assert_eq!(batch.status.code(), Some(6));
    bystander.assert_untouched();
}

#[test]
fn a_data_set_brings_no_link_for_the_lock_of_a_batch() {
    let (balls, bystander) = (Balls::new(1), Bystander::new());
    let home = balls.folder().join("gprop/batch");
    fs::create_dir_all(&home).unwrap();
    symlink(bystander.path().join("precious"), home.join(".shard-0-of-1.jsonl.lock")).unwrap();
    let batch = gprop().arg("batch").arg(balls.folder()).args(["--to", "scene"]).output().unwrap();
    assert_refused(&batch, 2, &[".shard-0-of-1.jsonl.lock", "is a link", "remove it"]);
    bystander.assert_untouched();
}

#[test]
fn a_scene_brings_no_link_for_its_recordings() {
    let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
    symlink(bystander.path(), balls.scene(0).join("recorded")).unwrap();
    assert_refused(&run(&balls, out.path()), 3, &["recorded", "lies outside the scene folder", "--allow-read"]);
    bystander.assert_untouched();
}

#[test]
fn photos_are_named_within_the_scene_and_views_are_no_paths() {
    let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
    let path = balls.scene(0).join("transforms.json");
    let original: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    for name in ["../../../precious.png", "images/../../../precious.png", "..\\..\\precious.png"] {
        let mut transforms = original.clone();
        transforms["frames"][0]["file_path"] = json!(name);
        fs::write(&path, transforms.to_string()).unwrap();
        assert_refused(&run(&balls, out.path()), 3, &["leads out of the scene folder"]);
    }
    // An absolute path belongs to another machine: the photo of that name is looked for in the scene, never there.
    let elsewhere = bystander.path().join("precious");
    let mut transforms = original.clone();
    transforms["frames"][0]["file_path"] = json!(elsewhere);
    fs::write(&path, transforms.to_string()).unwrap();
    let output = run(&balls, out.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stderr).contains("1 of the 3 photos"));
    let views: Value = serde_json::from_slice(&fs::read(out.path().join("views.json")).unwrap()).unwrap();
    assert_eq!(views["views"].as_array().map(Vec::len), Some(2));
    // A name that is odd but within the scene is turned into a plain one.
    let odd = "images/a b;$(touch precious)..png";
    fs::rename(balls.scene(0).join("images/000.png"), balls.scene(0).join(odd)).unwrap();
    let mut transforms = original;
    transforms["frames"][0]["file_path"] = json!(odd);
    fs::write(&path, transforms.to_string()).unwrap();
    fs::rename(balls.labels(0).join("000.png"), balls.labels(0).join("a_b___touch_precious_.png")).unwrap();
    let output = run(&balls, out.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(out.path().join("segments/a_b___touch_precious_.png").is_file());
    bystander.assert_untouched();
}

#[test]
fn names_that_no_file_can_have_lead_nowhere() {
    // A zero byte, which ends a path in C; a Windows drive and a Windows share; another machine's folder.
    let names = [
        "images/nowhere.png\0",
        "C:\\shots\\nowhere.bmp",
        "\\\\host\\share\\nowhere.bmp",
        "/shots/of/another/machine/nowhere.bmp",
    ];
    for name in names {
        let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
        let path = balls.scene(0).join("transforms.json");
        let mut transforms: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        transforms["frames"][0]["file_path"] = json!(name);
        transforms["frames"][1]["mask_path"] = json!(name);
        fs::write(&path, transforms.to_string()).unwrap();
        let output = run(&balls, out.path());
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && message.contains("1 of the 3 photos"), "{name:?}: {message}");
        bystander.assert_untouched();
    }
}

#[test]
fn cameras_of_other_programs_name_no_photos_outside() {
    let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
    fs::remove_file(balls.scene(0).join("transforms.json")).unwrap();
    let camera = json!({
        "id": 0, "img_name": "../../../precious", "width": 64, "height": 64, "position": [0, 0, 0],
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "fx": 50, "fy": 50,
    });
    fs::write(balls.scene(0).join("cameras.json"), json!([camera]).to_string()).unwrap();
    assert_refused(&run(&balls, out.path()), 3, &["cameras.json", "leads out of the scene folder"]);
    let model = balls.scene(0).join("sparse/0");
    fs::create_dir_all(&model).unwrap();
    fs::write(model.join("cameras.txt"), "1 PINHOLE 64 64 50 50 32 32\n").unwrap();
    fs::write(model.join("images.txt"), "1 1 0 0 0 0 0 1 1 ../../../precious\n\n").unwrap();
    assert_refused(&run(&balls, out.path()), 3, &["sparse/0", "leads out of the scene folder"]);
    bystander.assert_untouched();
}

#[test]
fn what_a_work_folder_says_of_itself_is_not_followed() {
    // `run.json`, `segments.json` and `answers.jsonl` of a scene from elsewhere that name views and files outside.
    let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let outside = format!("../../../../../../../..{}/precious", bystander.path().display());
    for name in ["run.json", "segments/segments.json", "answers.jsonl", "labels.json"] {
        let text = fs::read_to_string(out.path().join(name)).unwrap();
        fs::write(out.path().join(name), text.replace("000", &outside)).unwrap();
        let output = run(&balls, out.path());
        assert!([Some(0), Some(2), Some(5), Some(70)].contains(&output.status.code()));
        assert_ne!(output.status.code(), Some(70), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        bystander.assert_untouched();
    }
}

/// Gives a file of a work folder other bytes, and `run.json` their checksum, as a stranger who made the folder might.
pub fn forge(work: &Path, file: &str, bytes: &[u8]) {
    fs::write(work.join(file), bytes).unwrap();
    let path = work.join("run.json");
    let mut record: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let Checksum { bytes, sha256 } = Checksum::of(bytes);
    for stage in record["stages"].as_array_mut().unwrap() {
        for output in stage["outputs"].as_array_mut().unwrap().iter_mut().filter(|output| output["path"] == file) {
            (output["bytes"], output["sha256"]) = (json!(bytes), json!(sha256));
        }
    }
    fs::write(&path, record.to_string()).unwrap();
}

#[test]
fn a_work_folder_whose_files_contradict_each_other_is_refused() {
    let (balls, out, other) = (Balls::new(2), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let run = |scene: usize, out: &Path, more: &[&str]| {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(scene)).args(["--to", "parts", "-q", "--out"]);
        command.arg(out).args(more).args(balls.answers()).output().unwrap()
    };
    for (scene, out) in [(0, &out), (1, &other)] {
        assert!(run(scene, out.path(), &[]).status.success());
    }
    let read = |file: &str| fs::read(out.path().join(file)).unwrap();
    let refused = |file: &str, bytes: &[u8], from: &str, words: &[&str]| {
        let (before, record) = (read(file), read("run.json"));
        assert!(before != bytes, "{file}");
        forge(out.path(), file, bytes);
        let words = [&[file, "is not what gprop wrote"], words].concat();
        assert_refused(&run(0, out.path(), &["--from", from]), 2, &words);
        fs::write(out.path().join(file), before).unwrap();
        fs::write(out.path().join("run.json"), record).unwrap();
    };
    // A segment that lies in itself.
    let mut segments: Value = serde_json::from_slice(&read("segments/segments.json")).unwrap();
    segments["views"]["000"]["segments"][0]["parent"] = json!(1);
    refused("segments/segments.json", segments.to_string().as_bytes(), "query", &["view 000", "not numbered"]);
    // A map of another size, and one with a segment more.
    let map = LabelMap::from_png(&read("segments/000.png")).unwrap();
    let small = map.resized(4, 4).to_png().unwrap();
    refused("segments/000.png", &small, "query", &["does not fit the photo"]);
    let more = LabelMap { labels: vec![9; map.labels.len()], ..map }.to_png().unwrap();
    refused("segments/000.png", &more, "query", &["segments in segments.json"]);
    // An answer whose view is a path.
    let answers = String::from_utf8(read("answers.jsonl")).unwrap().replace("\"000\"", "\"../../000\"");
    refused("answers.jsonl", answers.as_bytes(), "vote", &["../../000", "not among the chosen views"]);
    // The field of another scene, and labels with numbers of their own.
    let field = fs::read(other.path().join("field.ply")).unwrap();
    refused("field.ply", &field, "parts", &["300 Gaussians instead of 200"]);
    let mut labels: Value = serde_json::from_slice(&read("labels.json")).unwrap();
    labels[0]["id"] = json!(99);
    refused("labels.json", labels.to_string().as_bytes(), "parts", &["not numbered"]);
    assert!(run(0, out.path(), &["--from", "query"]).status.success(), "as it was");
}

#[test]
fn frames_of_another_scene_are_refused() {
    let (balls, outs) = (Balls::new(2), [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()]);
    let run = |scene: usize, more: &[&str]| {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(scene)).arg("--out").arg(outs[scene].path());
        command.args(["-q", "--frames", "2", "--duration", "0.01", "--grid", "8", "--size", "320x180"]);
        command.args(more).args(balls.answers()).output().unwrap()
    };
    for scene in [0, 1] {
        assert!(run(scene, &[]).status.success());
    }
    let frame = "simulation/frames/0001.ply";
    forge(outs[0].path(), frame, &fs::read(outs[1].path().join(frame)).unwrap());
    assert_refused(&run(0, &["--from", "report"]), 2, &[frame, "300 Gaussians instead of 200"]);
}

#[test]
fn a_recording_lies_where_its_content_says() {
    // The name of a recording's file is not a key: one that claims the key of another, or a path, is refused.
    let (balls, bystander, out) = (Balls::new(1), Bystander::new(), tempfile::tempdir().unwrap());
    assert!(run(&balls, out.path()).status.success());
    let recorded = balls.scene(0).join("recorded");
    let first = fs::read_dir(&recorded).unwrap().next().unwrap().unwrap().path();
    let mut recording: Value = serde_json::from_slice(&fs::read(&first).unwrap()).unwrap();
    for key in ["../../precious", "/etc/passwd", &"0".repeat(64)] {
        recording["key"] = json!(key);
        fs::write(&first, recording.to_string()).unwrap();
        assert_refused(&run(&balls, out.path()), 5, &["is not a recording", "delete it or restore it"]);
    }
    bystander.assert_untouched();
}
