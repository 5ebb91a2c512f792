//! The report of a run, for people and for programs: the page is opened in a browser and used, the JSON is checked
//! against the published schema.

mod browser;
mod layout;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use gprop::scene::splat::ply;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use crate::batch::ball::Balls;
use crate::inspect::thinned;
use crate::query::{a, completion, good_answer, good_answer_about_part};
use crate::run::{QUICK, copy_hammer, give_segments, gprop};
use crate::support::server::{MockServer, Response};
use crate::support::{models, shared_folder};

/// A hostile caption that an attacker might get from a model. It has no comma or semicolon, at which a name would end.
const HOSTILE: &str = "</script><img src=x onerror=document.title='taken'> {{ 7*7 }}";
/// Maximum bytes of a page without its pictures.
const PAGE_BUDGET: usize = 3_000_000;

/// The hammer after a quick run, every one of its recorded answers with a hostile caption.
fn hostile_run() -> Option<&'static Path> {
    static RUN: OnceLock<Option<PathBuf>> = OnceLock::new();
    let run = RUN.get_or_init(|| {
        models("the report of a run")?;
        let scene = shared_folder("hostile_report");
        copy_hammer(&scene);
        for entry in fs::read_dir(scene.join("recorded")).unwrap() {
            let path = entry.unwrap().path();
            let mut recording: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
            let mut answer: Value = serde_json::from_str(recording["response"].as_str().unwrap()).unwrap();
            // The answer about the whole object, which a run on one view does not ask for, has none.
            let Some(caption) = answer["caption"].as_str() else { continue };
            answer["caption"] = json!(format!("{HOSTILE}; {caption}"));
            recording["response"] = json!(answer.to_string());
            fs::write(&path, recording.to_string()).unwrap();
        }
        give_segments(&scene.join("gprop"));
        let output = gprop().arg("run").arg(&scene).args(QUICK).args(["--answers", "replay"]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        Some(scene)
    });
    run.as_deref()
}

/// The same for a browser without a graphics card, which draws a quarter of the Gaussians: the segments are the true
/// parts of two views, and a server answers.
fn small_run() -> &'static Path {
    static RUN: OnceLock<PathBuf> = OnceLock::new();
    RUN.get_or_init(|| {
        let scene = shared_folder("small_report");
        copy_hammer(&scene);
        let cloud = fs::File::create(scene.join("point_cloud.ply")).unwrap();
        ply::write(std::io::BufWriter::new(cloud), thinned(), &[]).unwrap();
        let labels = scene.join("labels");
        true_segments("hammer", &["003", "022"], &labels);
        let answers = ["wood", "metal", "rubber"].map(|family| {
            let mut answer = good_answer(a(family));
            answer["caption"] = json!(format!("{HOSTILE}; a part of {family}"));
            Response::new(200).json(completion(&answer.to_string()))
        });
        // One question at a time, in the order of the parts, in one view after the other.
        let asked = AtomicUsize::new(0);
        let server = MockServer::new(move |_| answers[asked.fetch_add(1, Ordering::Relaxed) % 3].clone());
        // A film as large as a user's, which must fit into the page.
        let quick = QUICK.chunks(2).filter(|option| option[0] != "--size").flatten();
        let mut run = gprop();
        run.env_remove("OPENAI_API_KEY").arg("run").arg(&scene).args(quick).arg("--segments").arg(&labels);
        run.args(["--ask", "segments", "--lmm-parallel", "1", "--lmm-model", "test-model", "--lmm-url"]);
        let output = run.arg(format!("{}/v1", server.uri())).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        scene
    })
}

/// Writes the true parts of a fixture's views as segments.
pub fn true_segments(fixture: &str, views: &[&str], folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let part_maps = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture).join("ground_truth/part_maps");
    for file in views.iter().map(|view| format!("{view}.png")) {
        let mut map = image::open(part_maps.join(&file)).unwrap().into_luma8();
        map.pixels_mut().for_each(|pixel| pixel.0[0] = pixel.0[0].wrapping_add(1));
        map.save(folder.join(file)).unwrap();
    }
}

fn json_file(path: impl AsRef<Path>) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// Everything in `value` that `docs/report.schema.json` does not allow.
fn violations(value: &Value) -> Vec<String> {
    let schema = json_file(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/report.schema.json"));
    let validator = jsonschema::validator_for(&schema).unwrap();
    validator.iter_errors(value).map(|error| format!("{}: {error}", error.instance_path())).collect()
}

#[test]
fn a_caption_is_text_wherever_it_stands() {
    let Some(scene) = hostile_run() else { return };
    let page = fs::read_to_string(scene.join("gprop/report.html")).unwrap();
    assert!(page.matches("taken").count() > 3, "the caption is on the page");
    assert!(!page.contains("<img src=x"), "raw markup from a caption");
    assert!(!page.contains("</script><img"), "a caption ends a script");
    // There is exactly one end tag for each script element.
    assert_eq!(page.matches("</script").count(), page.matches("<script").count());
}

#[test]
fn the_page_needs_nothing_but_itself_and_keeps_to_its_budget() {
    let Some(scene) = hostile_run() else { return };
    let page = fs::read_to_string(scene.join("gprop/report.html")).unwrap();
    for reference in ["src=\"http", "href=\"http", "url(http", "@import", "src=\"/", "src=\"."] {
        assert!(!page.contains(reference), "{reference}");
    }
    let pictures: usize =
        page.match_indices("data:image/").map(|(at, _)| page[at..].find('"').expect("an attribute ends")).sum();
    assert!(page.len() - pictures < PAGE_BUDGET, "{} bytes without pictures", page.len() - pictures);
    assert!(page.contains("Permission is hereby granted"), "the viewer's licence goes along");
    assert!(page.contains("gprop run "), "how to make it again");
}

#[test]
fn the_report_of_every_fixture_follows_the_published_schema() {
    // The hammer's is checked in `the_schema_refuses_what_is_not_a_report`; of the others, no answers are recorded to the
    // questions that a run on one view asks.
    let answer = Response::new(200).json(completion(&good_answer_about_part(a("wood")).to_string()));
    let server = MockServer::new(move |_| answer.clone());
    for fixture in ["mug", "table_lamp", "chair"] {
        let (out, recordings) = (TempDir::new().unwrap(), TempDir::new().unwrap());
        let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(fixture);
        let mut command = gprop();
        command.arg("run").arg(&scene).arg("--out").arg(out.path()).args(&QUICK[2..]);
        let labels = recordings.path().join("labels");
        true_segments(fixture, &["003"], &labels);
        command.args(["--view-list", "003", "--segments"]).arg(&labels);
        command.args(["--lmm-model", "test-model", "--lmm-url"]).arg(format!("{}/v1", server.uri()));
        command.arg("--recordings").arg(recordings.path().join("recorded"));
        // Of these, only the lamp has something that deforms.
        if fixture != "table_lamp" {
            command.arg("--no-simulate");
        }
        let output = command.arg("--json").output().unwrap();
        assert!(output.status.success(), "{fixture}: {}", String::from_utf8_lossy(&output.stderr));
        let report = json_file(out.path().join("report.json"));
        assert_eq!(violations(&report), Vec::<String>::new(), "{fixture}");
        let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(printed["parts"], report["parts"], "{fixture}: --json prints the same");
    }
}

#[test]
fn the_schema_refuses_what_is_not_a_report() {
    let Some(scene) = hostile_run() else { return };
    let report = json_file(scene.join("gprop/report.json"));
    assert_eq!(violations(&report), Vec::<String>::new());
    let spoilt = |spoil: &dyn Fn(&mut Value)| {
        let mut copy = report.clone();
        spoil(&mut copy);
        violations(&copy).len()
    };
    assert!(spoilt(&|r| r["labels"][0]["density_kg_m3"] = json!("heavy")) > 0, "a number is a number");
    assert!(spoilt(&|r| r["grasp"]["limited_by"] = json!("mood")) > 0, "a limit is one of four");
    assert!(spoilt(&|r| drop(r.as_object_mut().unwrap().remove("stages"))) > 0, "nothing may be missing");
    assert!(spoilt(&|r| r["scene"]["colour"] = json!(1)) > 0, "nothing undocumented");
    assert!(spoilt(&|r| r["schema_version"] = json!(1)) > 0, "another version");
    assert!(spoilt(&|r| r["parts"]["parts"][0]["mass_kg"] = json!(0)) > 0, "a mass is an interval or null");
    let without_volume = |r: &mut Value| {
        for key in ["volume_m3", "thickness_m", "mass_kg", "center_of_mass_m", "inertia_kg_m2"] {
            r["parts"]["parts"][0][key] = Value::Null;
        }
        r["parts"]["parts"][0]["no_volume"] = json!("owns_no_place");
    };
    assert_eq!(spoilt(&without_volume), 0, "a part may have no volume");
    assert!(spoilt(&|r| r["parts"]["parts"][0]["no_volume"] = json!("lost")) > 0, "a reason is one of two");
}

#[test]
fn a_grip_that_is_not_safe_is_no_number_on_the_tile() {
    let balls = Balls::new(1);
    let gripper = balls.folder().with_file_name("weak.toml");
    let weak = "name = \"weak\"\nforce_n = [0.0, 0.5]\nfinger_area_m2 = 1e-3\npad = \"rubber\"\nstroke_m = 0.4\n\
                [command]\nenabled_from = 0.0\nfull = 100.0\n";
    fs::write(&gripper, weak).unwrap();
    let mut run = gprop();
    run.env_remove("OPENAI_API_KEY")
        .arg("run")
        .arg(balls.scene(0))
        .args(balls.answers())
        .arg("--gripper")
        .arg(&gripper);
    let output = run.args(["--frames", "2", "--duration", "0.01", "--grid", "8"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("no safe grip"), "{said}");
    let work = balls.scene(0).join("gprop");
    let grasp = json_file(work.join("report.json"))["grasp"].clone();
    assert_eq!((&grasp["feasible"], &grasp["infeasible"]["reason"]), (&json!(false), &json!("too_weak")), "{grasp}");
    let page = fs::read_to_string(work.join("report.html")).unwrap();
    assert!(!page.contains(">grip with<") && page.contains(">not safe<"), "the tile shows no force");
    assert!(page.contains(grasp["infeasible"]["advice"].as_str().unwrap()), "the page gives the advice");
    assert!(page.contains(">not safe: the gripper is too weak<"), "each place says why");
}

/// The id under which the model was asked about a part.
#[test]
fn a_part_has_one_number_everywhere() {
    let Some(scene) = hostile_run() else { return };
    let work = scene.join("gprop");
    let file = |name: &str| json_file(work.join(name));
    let answers = fs::read_to_string(work.join("answers.jsonl")).unwrap();
    let answers: Vec<Value> = answers.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let (found, labels, parts) = (file("consensus/consensus.json"), file("labels.json"), file("parts.json"));
    let (grasp, report) = (file("grasp.json"), file("report.json"));
    let field = ply::read(&work.join("field.ply")).unwrap().gaussians;
    let column = &field.extra.iter().find(|column| column.name == "part_label").unwrap().values;
    assert!(labels.as_array().unwrap().len() > 2, "{labels}");
    for (label, counted) in labels.as_array().unwrap().iter().zip(report["gaussians_per_label"].as_array().unwrap()) {
        let (id, caption) = (&label["id"], &label["caption"]);
        let of_id = |list: &Value| list.as_array().unwrap().iter().find(|part| part["id"] == *id).cloned().unwrap();
        assert!(of_id(&found["parts"])["gaussians"].as_u64() > Some(0));
        let asked = |answer: &&Value| answer["part"] == *id && answer["caption"] == *caption;
        let answer = answers.iter().find(asked).unwrap_or_else(|| panic!("no answer about {id}, {caption}"));
        assert!(work.join(format!("sheets/{}_{id}.jpg", answer["view"].as_str().unwrap())).exists());
        assert_eq!(of_id(&parts["parts"])["caption"], *caption);
        assert_eq!(of_id(&report["labels"])["caption"], *caption);
        let own = column.iter().filter(|value| Some(**value as u64) == id.as_u64()).count();
        assert_eq!(counted.as_u64(), Some(own as u64));
        if grasp["part_id"] == *id {
            assert_eq!(grasp["part"], *caption);
        }
    }
}

#[test]
fn without_a_scale_the_report_says_null_and_the_page_says_why() {
    let Some(scene) = hostile_run() else { return };
    let work = TempDir::new().unwrap();
    give_segments(work.path());
    let mut command = gprop();
    command.arg("run").arg(scene).arg("--out").arg(work.path()).args(QUICK).args(["--scale", "auto"]);
    let output = command.args(["--answers", "replay"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = json_file(work.path().join("report.json"));
    assert_eq!(violations(&report), Vec::<String>::new());
    assert!(report["parts"].is_null() && report["grasp"].is_null());
    let page = fs::read_to_string(work.path().join("report.html")).unwrap();
    assert!(page.contains("the metric scale is unknown"));
}

#[test]
fn the_command_on_the_page_makes_the_same_result() {
    let Some(scene) = hostile_run() else { return };
    let report = json_file(scene.join("gprop/report.json"));
    let command = report["reproduction"]["command"].as_str().unwrap();
    let mut words = command.split(' ').skip(1);
    assert_eq!(words.next(), Some("run"));
    assert_eq!(words.next(), scene.file_name().unwrap().to_str());
    // The same options in another work folder: the same digests.
    let work = TempDir::new().unwrap();
    give_segments(work.path());
    let mut again = gprop();
    again.arg("run").arg(scene.file_name().unwrap()).args(words).arg("--out").arg(work.path());
    let output = again.current_dir(scene.parent().unwrap()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let digests = |report: &Value| -> Vec<Value> {
        report["stages"].as_array().unwrap().iter().map(|stage| stage["digest"].clone()).collect()
    };
    assert_eq!(digests(&json_file(work.path().join("report.json"))), digests(&report));
    let ply = &report["reproduction"]["inputs"][0];
    let bytes = fs::read(scene.join(ply["path"].as_str().unwrap())).unwrap();
    let sum: String = Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(sum, ply["sha256"].as_str().unwrap());
}

#[test]
fn shells_and_man_read_what_describes_the_command_line() {
    let text = |arguments: &[&str]| {
        let output = gprop().args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let script = text(&["completions", "bash"]);
    let checked = TempDir::new().unwrap();
    let path = checked.path().join("gprop.bash");
    fs::write(&path, &script).unwrap();
    let complete = format!(
        "source {}; COMP_WORDS=(gprop mat); COMP_CWORD=1; _gprop gprop mat gprop; echo \"${{COMPREPLY[@]}}\"",
        path.display()
    );
    let completed = Command::new("bash").args(["-c", &complete]).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&completed.stdout).trim(), "materials", "{completed:?}");
    for shell in ["zsh", "fish", "elvish", "powershell"] {
        assert!(text(&["completions", shell]).contains("--gripper"), "{shell}");
    }
    assert!(text(&["man"]).starts_with(".ie"), "a manual page is roff");
    text(&["man", "--out", checked.path().to_str().unwrap()]);
    let page = |name: &str| -> PathBuf { checked.path().join(name) };
    assert!(page("gprop.1").exists() && page("gprop-run.1").exists());
    assert!(fs::read_to_string(page("gprop-run.1")).unwrap().contains("lift"), "the flags are described");
}
