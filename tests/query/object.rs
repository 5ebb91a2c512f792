//! `--ask object`: one question about the whole object, and a belief that weighs its answer against shape and materials.

use std::collections::BTreeSet;
use std::fs;
use std::process::Output;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use gprop::query::ask::rounds::Subject;
use gprop::query::{Options, Outcome, SubjectAnswer, SubjectId};
use gprop::segment::LabelMap;
use serde_json::{Value, json};

use super::batch_api::{BatchApiServer, Place};
use super::{a, good_answer_about_part, good_answer_with};
use crate::batch::ball::Balls;
use crate::run::gprop;
use crate::support::said;

const FEW: &[&str] = &["--frames", "2", "--duration", "0.02", "--grid", "16"];

/// A ball of 20 cm: of solid wood, some five kilograms, or of hollow plastic, a few hundred grams. The model is not sure which.
/// All regions are one piece.
fn wood_or_plastic(mass_of_hollow_g: [f64; 2], regions: &[u16]) -> Value {
    let choice = |under: usize, family: &str, material: &str, wall: Value| {
        let is_shell = !wall.is_null();
        json!({
            "under": [under], "probability": 1, "family": family, "material": material,
            "form": if is_shell { "shell" } else { "solid" }, "wall_thickness_mm": wall,
            "inside": if is_shell { json!("empty") } else { Value::Null }, "filling": null, "fill_share": null,
            "filling_density_kg_m3": null, "density_kg_m3": if is_shell { [1020, 1080] } else { [650, 750] },
        })
    };
    json!({
        "object": "a ball", "printed": null, "printed_mass_g": null, "printed_volume_ml": null,
        "hypotheses": [
            { "what": "a ball of solid wood", "probability": 0.5, "mass_g": [3500, 7000] },
            { "what": "a hollow plastic ball", "probability": 0.5, "mass_g": mass_of_hollow_g },
        ],
        "pieces": [{
            "numbers": regions, "caption": "all of the ball",
            "choices": [
                choice(1, "wood", "beech, european", Value::Null),
                choice(2, "thermoplastic", "abs", json!([2, 4])),
            ],
        }],
        "unnumbered": [],
    })
}

fn is_about_the_object(request: &Value) -> bool {
    request.to_string().contains("hypotheses")
}

/// A ball, the regions into which it is divided, and the number of requests.
struct Asked {
    balls: Balls,
    count: Arc<AtomicUsize>,
}

/// A ball whose model gives this answer about the object, if its regions are these.
fn ball(object: impl Fn(&[u16]) -> Value + Send + Sync + 'static) -> Asked {
    let (count, regions) = (Arc::new(AtomicUsize::new(0)), Arc::new(OnceLock::<Vec<u16>>::new()));
    let (counted, known) = (Arc::clone(&count), Arc::clone(&regions));
    let guess = json!({ "object": "a wooden ball", "clues": "its grain", "mass_g": [2000, 2500, 4000] });
    let balls = Balls::asked(1, move |request| {
        counted.fetch_add(1, Ordering::SeqCst);
        match (is_about_the_object(request), request.to_string().contains("best guess")) {
            (true, _) => object(known.get().unwrap()),
            (_, true) => guess.clone(),
            _ if request.to_string().contains("alternatives") => good_answer_with(a("wood"), &[("abs", 0.1)]),
            _ => good_answer_about_part(a("wood")),
        }
    });
    let divided = run(&balls, &["--to", "consensus"]);
    assert!(divided.status.success(), "{}", said(&divided));
    let maps = fs::read_dir(balls.scene(0).join("gprop/consensus")).unwrap().map(|entry| entry.unwrap().path());
    let maps = maps.filter(|path| path.extension().is_some_and(|end| end == "png"));
    let ids: BTreeSet<u16> =
        maps.flat_map(|path| LabelMap::from_png(&fs::read(path).unwrap()).unwrap().ids()).collect();
    regions.set(ids.into_iter().collect()).unwrap();
    Asked { balls, count }
}

/// Without questions about parts that follow.
fn run(balls: &Balls, more: &[&str]) -> Output {
    run_asking(balls, "object", &[&["--max-questions", "0"], more].concat())
}

fn run_with_follow_ups(balls: &Balls, more: &[&str]) -> Output {
    run_asking(balls, "object", more)
}

fn run_asking(balls: &Balls, about: &str, more: &[&str]) -> Output {
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("run").arg(balls.scene(0)).args(["--ask", about]);
    command.args(FEW).args(more).output().unwrap()
}

fn ask(balls: &Balls, more: &[&str]) -> Output {
    run(balls, &[balls.answers().each_ref().map(String::as_str).as_slice(), more].concat())
}

fn file(balls: &Balls, name: &str) -> String {
    fs::read_to_string(balls.scene(0).join("gprop").join(name)).unwrap()
}

fn parts(balls: &Balls) -> Value {
    serde_json::from_str(&file(balls, "parts.json")).unwrap()
}

#[test]
fn one_question_gives_a_belief_that_everything_after_it_follows() {
    // The wall that the model describes weighs 250 to 500 g.
    let Asked { balls, count } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    let first = ask(&balls, &[]);
    assert!(first.status.success(), "{}", said(&first));
    assert_eq!(count.load(Ordering::SeqCst), 2, "what it is, and how heavy it is at a guess");
    for sheet in ["object.jpg", "direct.jpg"] {
        assert!(balls.scene(0).join("gprop/sheets").join(sheet).is_file(), "{sheet}");
    }
    let found = parts(&balls);
    assert_eq!(found["belief"]["guess_kg"], json!({ "low": 2.0, "mid": 2.5, "high": 4.0 }));
    let hypotheses = &found["belief"]["hypotheses"];
    let [wood, plastic] = [0, 1].map(|n| hypotheses[n]["probability"].as_f64().unwrap());
    assert!(
        (wood + plastic - 1.0).abs() < 1e-9 && wood > 0.6 && plastic > 0.05,
        "both weigh what they should, and the guess is nearer to wood: {hypotheses}"
    );
    let mass = |of: &Value, end: &str| of["mass_kg"][end].as_f64().unwrap();
    assert!(mass(&hypotheses[1], "low") < 0.6 && mass(&found["object"], "high") > 2.0, "{hypotheses}");
    let page = file(&balls, "report.html");
    assert!(page.contains("a hollow plastic ball") && page.contains("What the object is taken for"));
    let object: Value = serde_json::from_str(&file(&balls, "object.json")).unwrap();
    assert_eq!(object["status"], "answered");

    // It is recorded, and a folder of its own gets the same results without a server.
    let again = balls.scene(0).join("again");
    let replayed = run(&balls, &["--answers", "replay", "--out", again.to_str().unwrap()]);
    assert!(replayed.status.success(), "{}", said(&replayed));
    for name in ["parts.json", "grasp.json", "object.json", "answers.jsonl"] {
        assert_eq!(fs::read_to_string(again.join(name)).unwrap(), file(&balls, name), "{name}");
    }

    // A kitchen scale decides what it is; simulation and exports follow.
    let weighed = run(&balls, &["--answers", "replay", "--known-mass", "400g"]);
    assert!(weighed.status.success(), "{}", said(&weighed));
    let found = parts(&balls);
    assert!(found["belief"]["hypotheses"][1]["probability"].as_f64().unwrap() > 0.95, "{}", found["belief"]);
    assert_eq!((&found["parts"][0]["material"], &found["parts"][0]["is_wall"]), (&json!("abs"), &json!(true)));
    let report: Value = serde_json::from_str(&file(&balls, "report.json")).unwrap();
    assert_eq!(report["labels"][0]["material"], "abs");
}

/// `gprop.toml` and `corrections.toml` may say something of the same part; the second counts, and what is typed before both.
#[test]
fn a_file_of_corrections_counts_for_more_than_gprop_toml() {
    let Asked { balls, .. } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    let scene = balls.scene(0);
    let own = std::fs::read_to_string(scene.join("gprop.toml")).unwrap();
    let of_scene = format!("{own}[part.ball]\nmaterial = \"abs\"\nwall = \"4mm\"\n");
    std::fs::write(scene.join("gprop.toml"), of_scene).unwrap();
    let corrections = scene.join("corrections.toml");
    std::fs::write(&corrections, "[part.ball]\nmaterial = \"stainless steel 304\"\n").unwrap();
    let first = ask(&balls, &["--no-simulate"]);
    assert!(first.status.success(), "{}", said(&first));
    let made_of = |balls: &Balls| {
        let part = &parts(balls)["parts"][0];
        (part["material"].as_str().unwrap().to_owned(), (1e3 * part["thickness_m"]["mid"].as_f64().unwrap()).round())
    };
    assert_eq!(made_of(&balls), ("stainless steel 304".to_owned(), 4.0));
    // The form begins with what is corrected, so that the file it writes keeps it.
    let page = file(&balls, "report.html");
    assert!(page.contains("name=\"material\" value=\"stainless steel 304\"") && page.contains("value=\"4mm\""));

    let again = |more: &[&str]| run(&balls, &[&["--fresh", "--to", "parts", "--answers", "replay"], more].concat());
    let kept = again(&[]);
    assert!(kept.status.success() && made_of(&balls).0 == "stainless steel 304", "{}", said(&kept));
    assert!(again(&["--correct", "ball.material=borosilicate glass"]).status.success());
    assert_eq!(made_of(&balls), ("borosilicate glass".to_owned(), 4.0));

    let refused = |text: &str, words: &[&str]| {
        std::fs::write(&corrections, text).unwrap();
        let output = again(&[]);
        assert_eq!(output.status.code(), Some(2), "{text}: {}", said(&output));
        words.iter().for_each(|word| assert!(said(&output).contains(word), "{word}: {}", said(&output)));
    };
    refused("[part.1]\nwall = \"3mm\"\n\nviews = 3\n[part.1]\n", &["corrections.toml", "line 5"]);
    refused("views = 3\n", &["corrections.toml", "line 1", "`views` is no correction", "gprop.toml"]);
    refused("[part.1]\nwall = \"thin\"\n", &["corrections.toml", "line 2", "1.wall=thin"]);
    refused("[part.1]\ncolour = \"red\"\n", &["corrections.toml", "line 2"]);
    refused("[part.1]\nmaterial = \"unobtainium\"\n", &["correction 1.material=unobtainium: "]);
    refused("[part.9]\nmaterial = \"abs\"\n", &["correction 9.material=abs: no part is called"]);

    std::fs::remove_file(&corrections).unwrap();
    assert!(again(&[]).status.success());
    assert_eq!(made_of(&balls), ("abs".to_owned(), 4.0), "gprop.toml holds again");
}

#[test]
fn a_correction_counts_for_more_than_any_answer_and_is_taken_back() {
    let Asked { balls, count } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    assert!(ask(&balls, &["--to", "parts"]).status.success());
    let answered = file(&balls, "parts.json");
    let corrections = ["--correct", "ball.material=aluminum 6061-t6", "--correct", "ball.wall=3mm"];
    let output = run(&balls, &corrections);
    assert!(output.status.success(), "{}", said(&output));
    let words = "corrected: material aluminum 6061-t6, wall 3 mm; answered: ";
    assert!(said(&output).contains(words), "{}", said(&output));
    let found = parts(&balls);
    let part = &found["parts"][0];
    assert_eq!((&part["material"], &part["is_wall"]), (&json!("aluminium 6061-t6"), &json!(true)));
    assert_eq!(part["corrected"]["to"]["material"], "aluminum 6061-t6");
    let [low, high] = ["low", "high"].map(|end| part["thickness_m"][end].as_f64().unwrap());
    assert!((low - 0.003).abs() < 1e-12 && (high - 0.003).abs() < 1e-12, "{}", part["thickness_m"]);
    // Of a wall of 3 mm around a ball of 20 cm, 2700 kg/m3 dense.
    let mass = |of: &Value| of["mass_kg"]["mid"].as_f64().unwrap();
    let expected = 4.0 / 3.0 * std::f64::consts::PI * (0.1_f64.powi(3) - 0.097_f64.powi(3)) * 2700.0;
    assert!((mass(part) / expected).ln().abs() < 0.25, "{} instead of {expected}", mass(part));
    let choices = found["belief"]["parts"][0]["choices"].as_array().unwrap();
    let probabilities: Vec<f64> = choices.iter().map(|choice| choice["probability"].as_f64().unwrap()).collect();
    assert!(probabilities.len() == 3 && (probabilities[2] - 1.0).abs() < 1e-9, "{probabilities:?}");
    for name in ["report.html", "run.json"] {
        assert!(file(&balls, name).contains(words), "{name}");
    }
    let labels: Value = serde_json::from_str(&file(&balls, "labels.json")).unwrap();
    assert_eq!(labels[0]["material"], "aluminium 6061-t6");

    // An export goes on from the last run, and corrects further.
    let out = balls.scene(0).join("out");
    let mut export = gprop();
    export.arg("export").arg(balls.scene(0)).args(["--format", "npz", "--correct", "ball.wall=6mm", "--out"]).arg(&out);
    let exported = export.output().unwrap();
    assert!(exported.status.success(), "{}", said(&exported));
    let thicker = parts(&balls);
    assert_eq!(thicker["parts"][0]["material"], "aluminium 6061-t6");
    assert!((mass(&thicker["parts"][0]) / mass(part)).ln() > 0.5, "{}", mass(&thicker["parts"][0]));

    // The same in the scene's own file, and without it the answers hold again. Nobody is asked.
    let options = balls.scene(0).join("gprop.toml");
    let without = fs::read_to_string(&options).unwrap();
    fs::write(&options, format!("{without}\n[part.ball]\nmaterial = \"aluminum 6061-t6\"\nwall = \"3mm\"\n")).unwrap();
    assert!(run(&balls, &["--to", "parts", "--fresh"]).status.success());
    assert_eq!(parts(&balls)["parts"], found["parts"]);
    fs::write(&options, without).unwrap();
    assert!(run(&balls, &["--to", "parts", "--fresh"]).status.success());
    assert_eq!(file(&balls, "parts.json"), answered);
    assert_eq!(count.load(Ordering::SeqCst), 2);
}

#[test]
fn what_cannot_be_corrected_is_said_with_what_can() {
    let Asked { balls, .. } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    assert!(ask(&balls, &["--to", "vote"]).status.success());
    for (correction, words) in [
        ("lid.wall=3mm", "no part is called \"lid\"; give one of these, by its number or name: "),
        ("ball.material=stainless stele 304", "the nearest are "),
        ("ball.wall=3", "with its unit, such as 3mm"),
        ("ball.filling=water", "say how thick its wall is"),
    ] {
        let output = run(&balls, &["--to", "vote", "--correct", correction]);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains(words), "{}", said(&output));
    }
}

#[test]
fn a_hypothesis_that_does_not_fit_the_shape_loses() {
    // No wall of two to four millimetres makes such a ball weigh twenty grams.
    let Asked { balls, .. } = ball(|regions| wood_or_plastic([15.0, 25.0], regions));
    let output = ask(&balls, &["--to", "parts"]);
    assert!(output.status.success(), "{}", said(&output));
    let found = parts(&balls);
    assert!(found["belief"]["hypotheses"][0]["probability"].as_f64().unwrap() > 0.9, "{}", found["belief"]);
    assert_eq!(found["parts"][0]["material"], "beech, european");
}

#[test]
fn a_part_that_decides_the_mass_is_asked_about_by_itself() {
    let Asked { balls, count } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    assert!(ask(&balls, &["--to", "parts"]).status.success());
    let wood = |found: &Value| found["belief"]["parts"][0]["choices"][0]["probability"].as_f64().unwrap();
    let before = parts(&balls);
    assert_eq!((count.load(Ordering::SeqCst), &before["belief"]["parts"][0]["asked"]), (2, &Value::Null));

    // Nobody can be asked: what is known serves, and a note says what would be asked.
    let alone = run_with_follow_ups(&balls, &["--to", "parts"]);
    assert!(alone.status.success(), "{}", said(&alone));
    assert!(file(&balls, "run.json").contains("no recorded answer, so the answer about the object stands"));
    assert_eq!(wood(&parts(&balls)), wood(&before));
    let folder = balls.scene(0).join("questions");
    let mut export = gprop();
    let export = export.arg("query").arg(balls.scene(0)).args(["--ask", "object", "--export"]).arg(&folder);
    let export = export.output().unwrap();
    assert!(export.status.success() && said(&export).contains("1 question"), "{}", said(&export));

    // The same command with a server asks it, and only it.
    let server = balls.answers();
    let server = server.each_ref().map(String::as_str);
    let asked = run_with_follow_ups(&balls, &server);
    assert!(asked.status.success(), "{}", said(&asked));
    assert_eq!(count.load(Ordering::SeqCst), 3);
    let found = parts(&balls);
    let question = &found["belief"]["parts"][0]["asked"];
    assert_eq!((&question["why"]["reason"], &question["material"]), (&json!("mass"), &json!(a("wood"))), "{question}");
    assert!(wood(&found) > 0.8 && wood(&found) > wood(&before), "{} {}", wood(&before), wood(&found));
    assert!(file(&balls, "run.json").contains("is asked about because what it is made of decides"));
    assert_eq!((&question["alternatives"][0]["material"], &question["confidence"]), (&json!("abs"), &json!(0.8)));
    let words = format!("{} (80 %) or abs (10 %)", a("wood"));
    for name in ["report.html", "run.json"] {
        assert!(file(&balls, name).contains(&words), "{name} lacks {words}");
    }
    assert!(file(&balls, "report.html").contains("asked about by itself"));
    let object: Value = serde_json::from_str(&file(&balls, "object.json")).unwrap();
    assert_eq!(object["questions"][0]["outcome"]["status"], "answered", "{object}");

    // A folder of its own gets the same from what is recorded.
    let again = balls.scene(0).join("again");
    let replayed = run_with_follow_ups(&balls, &["--answers", "replay", "--out", again.to_str().unwrap()]);
    assert!(replayed.status.success(), "{}", said(&replayed));
    for name in ["parts.json", "object.json", "answers.jsonl"] {
        assert_eq!(fs::read_to_string(again.join(name)).unwrap(), file(&balls, name), "{name}");
    }
    assert_eq!(count.load(Ordering::SeqCst), 3);
}

#[test]
fn an_object_that_is_not_recognized_is_asked_about_part_by_part() {
    let Asked { balls, count } = ball(|_| json!({ "object": "no idea" }));
    let output = ask(&balls, &["--to", "parts"]);
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("the model did not say what the object is"), "{}", said(&output));
    assert!(count.load(Ordering::SeqCst) > 2, "the question, its correction, and those about the part");
    assert!(parts(&balls)["belief"].is_null());
}

#[test]
fn answers_about_parts_serve_where_nobody_can_be_asked() {
    let Asked { balls, count } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    let server = balls.answers();
    let about_parts = run_asking(&balls, "parts", server.each_ref().map(String::as_str).as_slice());
    assert!(about_parts.status.success(), "{}", said(&about_parts));
    let asked = count.load(Ordering::SeqCst);
    let offline = run(&balls, &[]);
    assert!(offline.status.success(), "{}", said(&offline));
    let record = file(&balls, "run.json");
    assert!(record.contains("what the object is has no recorded answer"), "{record}");
    assert!(parts(&balls)["belief"].is_null());
    assert_eq!(count.load(Ordering::SeqCst), asked);
    // With somebody to ask, the object is asked about.
    assert!(ask(&balls, &[]).status.success());
    assert_eq!(count.load(Ordering::SeqCst), asked + 2, "what it is, and how heavy it is at a guess");
    assert!(!parts(&balls)["belief"].is_null());
}

/// Of region 1 a view shows a few pixels, too few to ask about it there.
#[test]
fn a_part_whose_first_region_no_view_shows_well_keeps_its_answer() {
    let server = BatchApiServer::new(&wood_or_plastic([200.0, 600.0], &[1, 2]));
    let place = Place::new();
    let part = |id: u16, views: &[usize]| Subject { id, views: views.to_vec(), pieces: Vec::new() };
    let options = Options { max_questions: 0, ..server.options() };
    let session = place.session_about_object(&options, vec![part(1, &[]), part(2, &[1, 0])]);
    let known = session.answer_whole(&|_| Ok(()), Ok).unwrap().recognition;
    let answers = session.answer_parts(known, &|_| Ok(())).unwrap().answers;
    let [SubjectAnswer { view, subject, outcome: Outcome::Answered(answer) }] = &answers.all[..] else {
        panic!("{answers:?}")
    };
    assert_eq!((view.as_str(), *subject, answer.material.as_str()), ("001", SubjectId::Part(1), "beech, european"));
}

#[test]
fn without_an_answer_the_run_says_how_to_get_one() {
    let Asked { balls, .. } = ball(|_| json!({}));
    let output = run(&balls, &["--answers", "replay"]);
    assert_eq!(output.status.code(), Some(5), "{}", said(&output));
    assert!(said(&output).contains("--ask object --export DIR"), "{}", said(&output));
}

#[test]
fn a_direct_guess_is_recorded_counts_and_is_scored_beside_gprop() {
    let Asked { balls, count } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    let folder = balls.folder().join("questions");
    let query = |more: &[&str]| gprop().arg("query").arg(balls.scene(0)).args(more).output().unwrap();
    let path = folder.to_str().unwrap();
    let exported = query(&["--ask", "object", "--export", path]);
    assert!(said(&exported).contains("2 questions"), "{}", said(&exported));
    let output = ask(&balls, &["--to", "parts"]);
    assert!(output.status.success(), "{}", said(&output));
    let with = parts(&balls);
    let weights = balls.folder().join("weights.csv");
    fs::write(&weights, "name,mass_kg\nball-0,3.0\n").unwrap();
    let evaluate = || {
        let mut command = gprop();
        command
            .args(["evaluate", "mass", "--json", "--beside", "direct", "--weights"])
            .arg(&weights)
            .arg(balls.scene(0));
        command.output().unwrap()
    };
    // The run has recorded the guess, so nobody is asked again.
    let (found, asked) = (evaluate(), count.load(Ordering::SeqCst));
    assert!(found.status.success(), "{}", said(&found));
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    let error = found["direct"]["alde"].as_f64().unwrap();
    assert!((error - (3.0_f64 / 2.5).ln()).abs() < 1e-9, "{found}");
    assert!(found["alde"].as_f64().is_some() && found["direct"]["coverage"] == 1.0, "{found}");
    let guessed = query(&["--direct"]);
    assert!(guessed.status.success() && said(&guessed).contains("direct guess: 2.5 kg"), "{}", said(&guessed));
    assert_eq!(count.load(Ordering::SeqCst), asked);

    // Without its recording the mass does without it, and says so.
    let recorded = fs::read_dir(balls.scene(0).join("recorded")).unwrap().map(|entry| entry.unwrap().path());
    let guess = recorded.into_iter().find(|path| fs::read_to_string(path).unwrap().contains("its grain")).unwrap();
    fs::remove_file(guess).unwrap();
    assert_eq!(evaluate().status.code(), Some(5));
    let without = run(&balls, &["--to", "parts", "--answers", "replay"]);
    assert!(without.status.success(), "{}", said(&without));
    assert!(file(&balls, "run.json").contains("how heavy the object is at a guess has no recorded answer"));
    let without = parts(&balls);
    assert!(without["belief"]["guess_kg"].is_null());
    let real = |of: &Value| of["belief"]["hypotheses"][0]["probability"].as_f64().unwrap();
    assert!(real(&with) > real(&without) + 0.1, "the guess is heavy: {} {}", real(&with), real(&without));
    assert!((0.2..0.8).contains(&real(&without)), "both weigh what they should: {}", without["belief"]);
    let end = |end: &str| without["object"]["mass_kg"][end].as_f64().unwrap();
    assert!(end("low") < 0.6 && end("high") > 2.0, "{}", without["object"]["mass_kg"]);

    // Asked for by itself, it is recorded too.
    let alone = gprop().arg("query").arg(balls.scene(0)).arg("--direct").args(balls.answers()).output().unwrap();
    assert!(alone.status.success() && said(&alone).contains("direct guess: 2.5 kg"), "{}", said(&alone));
    assert_eq!(count.load(Ordering::SeqCst), asked + 1);
    assert!(evaluate().status.success());
}

#[test]
fn samples_are_as_probable_as_the_belief_says_and_fit_together() {
    let Asked { balls, .. } = ball(|regions| wood_or_plastic([200.0, 600.0], regions));
    let asked = ask(&balls, &[]);
    assert!(asked.status.success(), "{}", said(&asked));
    let hypotheses = parts(&balls)["belief"]["hypotheses"].clone();
    let out = balls.scene(0).join("exported");
    let export = |samples: &str| {
        let what = ["--samples", samples, "--out", out.to_str().unwrap()];
        let output = gprop().arg("export").arg(balls.scene(0)).args(what).output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
        let written = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().path());
        let written: Vec<_> = written.filter(|path| !path.ends_with("asset.json")).collect();
        let [file] = written.as_slice() else { panic!("{written:?}") };
        fs::read_to_string(file).unwrap()
    };
    let text = export("200");
    let belief: Value = serde_json::from_str(&text).unwrap();
    let samples = belief["samples"].as_array().unwrap();
    assert_eq!(samples.len(), 200);
    for (hypothesis, material) in hypotheses.as_array().unwrap().iter().zip(["beech, european", "abs"]) {
        let of_it: Vec<&Value> = samples.iter().filter(|of| of["hypothesis"] == hypothesis["what"]).collect();
        let expected = 200.0 * hypothesis["probability"].as_f64().unwrap();
        assert!((of_it.len() as f64 - expected).abs() <= 1.0, "{} of {expected}: {hypothesis}", of_it.len());
        for sample in of_it {
            let [part] = sample["parts"].as_array().unwrap().as_slice() else { panic!("{sample}") };
            assert_eq!(part["material"], material);
            let number = |value: &Value| value.as_f64().unwrap();
            assert!((number(&part["mass_kg"]) / number(&sample["mass_kg"]) - 1.0).abs() < 1e-9, "{sample}");
            let by_volume = number(&part["density_kg_m3"]) * number(&part["volume_m3"]);
            assert!((by_volume / number(&part["mass_kg"]) - 1.0).abs() < 1e-9, "{sample}");
        }
    }
    let mut masses: Vec<f64> = samples.iter().map(|of| of["mass_kg"].as_f64().unwrap()).collect();
    masses.sort_by(f64::total_cmp);
    let mass = parts(&balls)["object"]["mass_kg"].clone();
    for (place, name) in [(10, "low"), (190, "high")] {
        let expected = mass[name].as_f64().unwrap();
        assert!((masses[place] / expected).ln().abs() < 0.2, "{name}: {} for {expected}", masses[place]);
    }
    assert_eq!(export("200"), text, "the same bytes again");
}
