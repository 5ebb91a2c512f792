//! What the answer about the object names and no part shows is looked for in the photos.

use std::fs;
use std::path::Path;
use std::process::Output;

use gprop::segment::LabelMap;
use serde_json::{Value, json};

use super::{a, good_answer_with, with};
use crate::faults::hostile::forge;
use crate::run::gprop;
use crate::support::{models, said};

/// The number of the grip in the true part maps.
const GRIP: u8 = 2;

/// A copy of the hammer without recorded answers, whose segments tell nothing apart, so that it is one part.
struct Hammer(tempfile::TempDir);

impl Hammer {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer");
        for name in ["point_cloud.ply", "transforms.json", "gprop.toml"] {
            fs::copy(fixture.join(name), folder.path().join(name)).unwrap();
        }
        let [images, labels] = ["images", "labels"].map(|name| folder.path().join(name));
        fs::create_dir(&images).unwrap();
        fs::create_dir(&labels).unwrap();
        for photo in fs::read_dir(fixture.join("images")).unwrap().map(|photo| photo.unwrap()) {
            fs::copy(photo.path(), images.join(photo.file_name())).unwrap();
            let photo_rgba = image::open(photo.path()).unwrap().into_rgba8();
            let (width, height) = photo_rgba.dimensions();
            let labels_of = photo_rgba.pixels().map(|pixel| u16::from(pixel.0[3] >= 128)).collect();
            let png = LabelMap { width, height, labels: labels_of }.to_png().unwrap();
            fs::write(labels.join(photo.file_name()), png).unwrap();
        }
        Self(folder)
    }

    fn run(&self, words: &[&str]) -> Output {
        let (command, more) = words.split_first().unwrap();
        let labels = self.0.path().join("labels");
        let mut gprop = gprop();
        gprop.env_remove("OPENAI_API_KEY").arg(command).arg(self.0.path()).arg("--segments").arg(labels);
        gprop.args(["--answers", "replay"]).args(more).output().unwrap()
    }

    /// Gives the next questions these answers, in their order.
    fn answer(&self, answers: &[Value]) {
        let questions = self.0.path().join(format!("questions_{}", answers[0].to_string().len()));
        let name = questions.to_str().unwrap();
        let exported = self.run(&["query", "--export", name]);
        assert!(exported.status.success(), "{}", said(&exported));
        let asked = fs::read_to_string(questions.join("queries.jsonl")).unwrap();
        let line = |(question, answer): (&str, &Value)| {
            let question: Value = serde_json::from_str(question).unwrap();
            json!({ "query": question["query"], "answer": answer, "model": "a reader" }).to_string()
        };
        assert_eq!(asked.lines().count(), answers.len(), "{asked}");
        let lines: Vec<String> = asked.lines().zip(answers).map(line).collect();
        fs::write(questions.join("answers.jsonl"), lines.join("\n")).unwrap();
        let imported = self.run(&["query", "--import", name]);
        assert!(imported.status.success(), "{}", said(&imported));
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&fs::read(self.0.path().join("gprop").join(name)).unwrap()).unwrap()
    }
}

/// All of the hammer is of wood, and this is somewhere in panel A.
fn wooden(what: &str, at: [f64; 2]) -> Value {
    let wood = json!({
        "under": [], "probability": 1, "family": "wood", "material": "ash, white", "form": "solid", "wall_thickness_mm": null,
        "inside": null, "filling": null, "fill_share": null, "filling_density_kg_m3": null, "density_kg_m3": [600, 700],
    });
    json!({
        "object": "a hammer", "printed": null, "printed_mass_g": null, "printed_volume_ml": null,
        "hypotheses": [{ "what": "a hammer", "probability": 1, "mass_g": [150, 250] }],
        "pieces": [{ "numbers": [1], "caption": "all of it", "choices": [wood] }],
        "unnumbered": [{ "what": what, "probability": 0.9, "panel": "A", "at": at, "mass_g": [30, 60] }],
    })
}

fn guess() -> Value {
    json!({ "object": "a hammer", "clues": "its shape", "mass_g": [150, 200, 250] })
}

/// The intersection over union of a region with the grip, over all views.
fn iou_with_grip(hammer: &Hammer, id: u16) -> f64 {
    let truth = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hammer/ground_truth/part_maps");
    let (mut both, mut either) = (0, 0);
    let maps = fs::read_dir(hammer.0.path().join("gprop/refined")).unwrap().map(|entry| entry.unwrap().path());
    for path in maps.filter(|path| path.extension().is_some_and(|end| end == "png")) {
        let map = LabelMap::from_png(&fs::read(&path).unwrap()).unwrap();
        let truth = image::open(truth.join(path.file_name().unwrap())).unwrap().into_luma8();
        for (found, grip) in map.labels.iter().zip(truth.as_raw()).map(|(label, part)| (*label == id, *part == GRIP)) {
            both += u32::from(found && grip);
            either += u32::from(found || grip);
        }
    }
    f64::from(both) / f64::from(either)
}

#[test]
fn a_grip_that_no_segment_shows_becomes_a_part_that_weighs_what_the_answer_says() {
    if models("a_grip_that_no_segment_shows_becomes_a_part_that_weighs_what_the_answer_says").is_none() {
        return;
    }
    let hammer = Hammer::new();
    hammer.answer(&[wooden("a rubber grip", [0.78, 0.22]), guess()]);
    let first = hammer.run(&["run", "--to", "parts"]);
    assert!(first.status.success(), "{}", said(&first));
    assert_eq!(hammer.json("refined/refined.json")["looked_for"][0]["id"], 2);
    let iou = iou_with_grip(&hammer, 2);
    assert!(iou > 0.8, "{iou}");
    let before = hammer.json("parts.json");
    assert_eq!(before["parts"].as_array().unwrap().len(), 1, "nobody has said that it is of something else: {before}");

    hammer.answer(&[with(good_answer_with(a("rubber"), &[]), "caption", json!("black grip"))]);
    let second = hammer.run(&["run", "--to", "parts"]);
    assert!(second.status.success(), "{}", said(&second));
    let after = hammer.json("parts.json");
    let grip = &after["parts"][1];
    assert_eq!(
        (&grip["id"], &grip["caption"], &grip["material"]),
        (&json!(2), &json!("black grip"), &json!(a("rubber")))
    );
    assert_eq!((&grip["volume_m3"], &grip["no_volume"]), (&Value::Null, &json!("too_thin")));
    assert_eq!((&grip["mass_kg"]["low"], &grip["mass_kg"]["high"]), (&json!(0.03), &json!(0.06)));
    assert_eq!(after["belief"]["unnumbered"][0]["part"], 2);
    assert_eq!(after["object"]["mass_kg"], before["object"]["mass_kg"], "it was weighed before");

    let again = hammer.run(&["run", "--to", "parts"]);
    assert!(again.status.success(), "{}", said(&again));
    let stages = hammer.json("run.json")["stages"].clone();
    assert!(stages.as_array().unwrap().iter().all(|stage| stage["reused"] == true), "{stages}");

    // Files that contradict each other.
    let work = hammer.0.path().join("gprop");
    let map = fs::read_dir(work.join("refined")).unwrap().map(|entry| entry.unwrap().path());
    let map = map.into_iter().find(|path| path.extension().is_some_and(|end| end == "png")).unwrap();
    let (name, whole) = (map.strip_prefix(&work).unwrap().to_str().unwrap(), fs::read(&map).unwrap());
    let small = LabelMap::from_png(&whole).unwrap().resized(4, 4).to_png().unwrap();
    let mut known = hammer.json("refined/refined.json");
    known["found"][0]["id"] = json!(1);
    let known = known.to_string();
    let record = fs::read(work.join("run.json")).unwrap();
    for (file, bytes, problem) in [
        (name, small.as_slice(), "does not fit the photo"),
        ("refined/refined.json", known.as_bytes(), "does not list"),
    ] {
        let before = fs::read(work.join(file)).unwrap();
        forge(&work, file, bytes);
        let refused = hammer.run(&["run", "--from", "query", "--to", "query"]);
        assert!(refused.status.code() == Some(2) && said(&refused).contains(problem), "{}", said(&refused));
        fs::write(work.join(file), before).unwrap();
        fs::write(work.join("run.json"), &record).unwrap();
    }
}

#[test]
fn what_has_a_number_and_what_lies_beside_the_object_get_none() {
    if models("what_has_a_number_and_what_lies_beside_the_object_get_none").is_none() {
        return;
    }
    let hammer = Hammer::new();
    let mut answer = wooden("a hammer", [0.78, 0.02]);
    answer["unnumbered"].as_array_mut().unwrap().push(json!({
        "what": "a core", "probability": 0.4, "panel": "A", "at": [0.78, 0.22], "mass_g": [1, 2],
    }));
    hammer.answer(&[answer, guess()]);
    let run = hammer.run(&["run", "--to", "refine"]);
    assert!(run.status.success(), "{}", said(&run));
    let found = hammer.json("refined/refined.json");
    assert!(found["found"].as_array().unwrap().is_empty(), "{found}");
    assert_eq!(found["looked_for"].as_array().unwrap().len(), 1, "what is improbable is not looked for: {found}");
    assert!(!hammer.0.path().join("gprop/refined/000.png").exists());
}
