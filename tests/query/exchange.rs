use std::fs;
use std::path::Path;
use std::process::Output;

use gprop::materials::MaterialLibrary;
use gprop::query::ask::rounds::Subject;
use gprop::query::exchange::{self, ExchangeError};
use gprop::query::recorded::{Answerer, Recording, Recordings};
use gprop::query::{AnswerSource, Match, Options, Outcome, Prompts, Queries, ShownSubject};
use serde_json::{Value, json};

use super::batch_api::Place;
use super::{a, good_answer, prepare, recordings, run, small, two_segments, with};
use crate::batch::ball::Balls;
use crate::run::gprop;

fn names(text: &str) -> Vec<String> {
    text.lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap()["query"].as_str().unwrap().to_owned())
        .collect()
}

/// Writes the unanswered questions, those about segments of one number together; returns how many.
pub fn export(out: &Path, queries: &Queries, store: &Recordings) -> usize {
    let part_of = |shown: &ShownSubject| (0, shown.id);
    exchange::export(out, &queries.unanswered(store, None), MaterialLibrary::builtin(), &part_of).unwrap()
}

#[test]
fn what_goes_out_comes_back_and_is_replayed() {
    let home = tempfile::tempdir().unwrap();
    let (out, recorded) = (home.path().join("out"), home.path().join("recorded"));
    let prompts = Prompts::builtin();
    let options = small();
    let views = [two_segments("secret_name", 80, 80)];
    let queries = prepare(&views, &prompts, &options);
    let store = recordings(&recorded);
    assert_eq!(export(&out, &queries, &store), 2);

    let listed = fs::read_to_string(out.join("queries.jsonl")).unwrap();
    assert!(!listed.contains("secret_name"), "names give nothing away");
    for line in listed.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        assert!(image::open(out.join(line["sheet"].as_str().unwrap())).is_ok());
        let prompt = fs::read_to_string(out.join(line["prompt"].as_str().unwrap())).unwrap();
        assert_eq!(prompt, queries.questions.first().prompt);
        let schema: Value =
            serde_json::from_str(&fs::read_to_string(out.join(line["schema"].as_str().unwrap())).unwrap()).unwrap();
        assert_eq!(&schema, queries.questions.first().schema.value());
    }
    assert!(matches!(
        exchange::export(&out, &[], MaterialLibrary::builtin(), &|_| (0, 0)),
        Err(ExchangeError::NotEmpty(_))
    ));

    let form = fs::read_to_string(out.join("answers.jsonl")).unwrap();
    let names = names(&form);
    let fenced = format!("```json\n{}\n```", good_answer(a("metal")));
    let lines = [
        json!({ "query": names[0], "answer": good_answer(a("wood")) }),
        json!({ "query": names[1], "answer": fenced, "model": "someone else" }),
    ];
    // As some editors save it.
    let lines = format!("\u{feff}{}", lines.map(|line| line.to_string()).join("\n"));
    fs::write(out.join("answers.jsonl"), lines).unwrap();
    let imported = exchange::import(&out, Some("by hand"), &queries, &store).unwrap();
    assert_eq!((imported.recorded, imported.unanswered, imported.bad.len()), (2, 0, 0), "{imported:?}");

    let replay = Options { answers: AnswerSource::Replay, ..small() };
    let replayed = run(&prepare(&views, &prompts, &replay), &recordings(&recorded), None).unwrap();
    let materials: Vec<_> = replayed
        .answers
        .all
        .iter()
        .map(|answer| match &answer.outcome {
            Outcome::Answered(answer) => (answer.material.as_str(), answer.matched),
            Outcome::Failed(failure) => panic!("{failure:?}"),
        })
        .collect();
    assert_eq!(materials, [(a("wood"), Match::Exact), (a("metal"), Match::Exact)]);
    assert!(queries.unanswered(&recordings(&recorded), None).is_empty(), "an export now holds nothing");
}

#[test]
fn an_answer_that_cannot_be_used_is_exported_and_yields_to_any_other() {
    let (prompts, options) = (Prompts::builtin(), small());
    let replay = Options { answers: AnswerSource::Replay, ..small() };
    let views = [two_segments("000", 80, 80)];
    let (queries, to_replay) = (prepare(&views, &prompts, &options), prepare(&views, &prompts, &replay));
    // Whatever the order of their keys.
    for name in ["a", "b", "c", "d"] {
        let home = tempfile::tempdir().unwrap();
        let (out, recorded) = (home.path().join("out"), home.path().join("recorded"));
        let store = recordings(&recorded);
        for segment in &queries.subjects {
            let asked = segment.asked(queries.questions.first());
            let answerer = Answerer { model: "older".into(), parameters: Value::Null };
            store.insert(&Recording::new(&answerer, asked, "about wood".into(), None, None)).unwrap();
        }
        let failed = || run(&to_replay, &recordings(&recorded), None).unwrap().answers.failed().count();
        assert_eq!((failed(), export(&out, &queries, &store)), (2, 2));
        let lines: Vec<String> = names(&fs::read_to_string(out.join("answers.jsonl")).unwrap())
            .into_iter()
            .map(|query| json!({ "query": query, "answer": good_answer(a("wood")) }).to_string())
            .collect();
        fs::write(out.join("answers.jsonl"), lines.join("\n")).unwrap();
        assert_eq!(exchange::import(&out, Some(name), &queries, &store).unwrap().recorded, 2);
        assert_eq!((failed(), queries.unanswered(&store, None).len()), (0, 0), "{name}");
    }
}

/// Answers that were imported under the name of the server's model are not the server's, but an export goes on from them.
#[test]
fn what_is_exported_next_does_not_depend_on_a_server() {
    let home = tempfile::tempdir().unwrap();
    let (first, second) = (home.path().join("first"), home.path().join("second"));
    let views = [("000", 80), ("001", 90), ("002", 100)].map(|(name, tint)| two_segments(name, tint, 80));
    let place = Place::of(views.into());
    let part = Subject { id: 1, views: vec![0, 1, 2], pieces: Vec::new() };
    let by_hand = Options { lmm_model: Some("gpt-4o".to_owned()), ..small() };
    let session = place.session_about(&by_hand, vec![part.clone()], 2);
    assert_eq!(session.export(&first).unwrap(), 2);
    let lines: Vec<String> = names(&fs::read_to_string(first.join("answers.jsonl")).unwrap())
        .into_iter()
        .zip([a("wood"), a("metal")])
        .map(|(query, material)| json!({ "query": query, "answer": good_answer(material) }).to_string())
        .collect();
    fs::write(first.join("answers.jsonl"), lines.join("\n")).unwrap();
    assert_eq!(session.import(&first).unwrap().recorded, 2);

    let with_server = Options { lmm_url: Some("http://127.0.0.1:9/v1".to_owned()), ..by_hand.clone() };
    let session = place.session_about(&with_server, vec![part], 2);
    assert_eq!(session.export(&second).unwrap(), 1, "the answers disagree, so a third view is due");
}

#[test]
fn the_page_holds_every_question_and_no_text_can_break_out_of_it() {
    let home = tempfile::tempdir().unwrap();
    let (out, mine) = (home.path().join("out"), home.path().join("mine"));
    fs::create_dir(&mine).unwrap();
    fs::write(mine.join("part.txt"), "</script><script>alert(1)</script> {{ candidates }} JSON").unwrap();
    let (prompts, options) = (Prompts::from_folder(&mine).unwrap(), small());
    let queries = prepare(&[two_segments("secret_name", 80, 80)], &prompts, &options);
    export(&out, &queries, &recordings(&home.path().join("recorded")));
    let page = fs::read_to_string(out.join("form.html")).unwrap();
    for name in names(&fs::read_to_string(out.join("queries.jsonl")).unwrap()) {
        assert!(page.contains(&format!("sheets/{name}.jpg")), "{name} is not on the page");
    }
    assert_eq!(page.matches("</script>").count(), 1, "only the page's own script ends");
    for outside in ["http://", "https://", "//cdn", "secret_name"] {
        assert!(!page.contains(outside), "{outside} is on the page");
    }
}

#[test]
fn bad_lines_are_numbered_and_good_ones_kept() {
    let home = tempfile::tempdir().unwrap();
    let (out, recorded) = (home.path().join("out"), home.path().join("recorded"));
    let prompts = Prompts::builtin();
    let options = small();
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80), two_segments("002", 70, 80)];
    let queries = prepare(&views, &prompts, &options);
    let store = recordings(&recorded);
    export(&out, &queries, &store);
    let names = names(&fs::read_to_string(out.join("answers.jsonl")).unwrap());
    let good = || good_answer(a("wood"));
    let lines = [
        json!({ "query": names[0], "answer": good() }).to_string(),
        "{broken".into(),
        json!({ "query": names[1], "answer": with(good(), "density_kg_m3", json!("much")) }).to_string(),
        json!({ "query": "0123456789abcdef", "answer": good() }).to_string(),
        String::new(),
        json!({ "query": names[2], "answer": with(good(), "material", json!("oke")) }).to_string(),
        json!({ "query": names[0], "answer": good() }).to_string(),
        json!({ "query": names[3], "answer": null }).to_string(),
        json!({ "query": names[4], "answer": good() }).to_string(),
        json!({ "query": names[1], "answer": good() }).to_string(),
    ];
    fs::write(out.join("answers.jsonl"), lines.join("\n")).unwrap();

    let nameless = exchange::import(&out, None, &queries, &store).unwrap();
    assert_eq!(nameless.recorded, 0);
    assert!(nameless.bad.iter().any(|bad| bad.line == 1 && bad.problem.contains("manifest.json")), "{nameless:?}");

    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    fs::write(out.join("manifest.json"), manifest.replace("\"model\":null", "\"model\":\"a person\"")).unwrap();
    let imported = exchange::import(&out, None, &queries, &store).unwrap();
    assert_eq!((imported.recorded, imported.unanswered), (3, 3), "a rejected answer is none, and may be given again");
    let bad: Vec<usize> = imported.bad.iter().map(|bad| bad.line).collect();
    assert_eq!(bad, [2, 3, 4, 6, 7]);
    assert!(imported.bad[1].problem.contains("density_kg_m3"));
    assert!(imported.bad[4].problem.contains("line 1"));
    assert!(imported.bad[0].to_string().starts_with("answers.jsonl line 2:"));
    assert_eq!(recordings(&recorded).len(), 3);
}

#[test]
fn a_common_problem_is_told_once_and_the_next_step_is_named() {
    let (balls, home) = (Balls::new(1), tempfile::tempdir().unwrap());
    let (scene, out) = (balls.scene(0), home.path().join("out"));
    let query = |more: &[&str], folder: &Path| {
        let mut command = gprop();
        let output = command.env_remove("OPENAI_API_KEY").arg("query").arg(&scene).args(more).arg(folder);
        let Output { status, stdout, stderr } = output.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (status.code(), text(stdout), text(stderr))
    };
    assert_eq!(query(&["--export"], &out).0, Some(0));
    let names = names(&fs::read_to_string(out.join("answers.jsonl")).unwrap());
    let count = names.len();
    assert!(count > 2);
    let answer_all = |material: &str| {
        let line = |name: &String| json!({ "query": name, "answer": good_answer(material) }).to_string();
        fs::write(out.join("answers.jsonl"), names.iter().map(line).collect::<Vec<_>>().join("\n")).unwrap();
    };
    answer_all(a("wood"));
    let (code, said, problem) = query(&["--import"], &out);
    assert_eq!((code, said.trim()), (Some(5), &*format!("0 answers recorded, {count} questions not answered")));
    assert_eq!(problem.matches("who answered").count(), 1, "{problem}");
    assert!(problem.contains("line 1: it does not say who answered"), "{problem}");
    assert!(problem.contains(&format!("(and {} other lines)", count - 1)), "{problem}");
    assert!(!problem.contains("the others are recorded"), "{problem}");

    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    fs::write(out.join("manifest.json"), manifest.replace("\"model\":null", "\"model\":\"a person\"")).unwrap();
    for by_hand in [false, true] {
        let first = json!({ "query": names[0], "answer": good_answer(a("wood")), "by_hand": by_hand });
        fs::write(out.join("answers.jsonl"), first.to_string()).unwrap();
        let (code, said, problem) = query(&["--import"], &out);
        assert_eq!(code, Some(0), "{problem}");
        let next = format!("1 answer recorded, {} questions not answered; answer the rest and import again", count - 1);
        // Another model would be asked that question again.
        assert!(said.starts_with(&next) && said.contains("--lmm-url") == by_hand, "{said}");
    }
    fs::remove_dir_all(scene.join("recorded")).unwrap();
    answer_all(a("wood"));
    let (code, said, problem) = query(&["--import"], &out);
    assert_eq!(code, Some(0), "{problem}");
    assert!(said.contains(&format!("{count} answers recorded, 0 questions not answered")), "{said}");
    assert!(said.contains(&format!("`gprop run {}`", scene.display())), "{said}");

    let again = home.path().join("again");
    let (code, said, problem) = query(&["--export"], &again);
    assert!(code == Some(0) && said.contains("all questions are answered"), "{said}{problem}");
    // As that message says, an answer by the same name replaces the one before.
    answer_all(a("metal"));
    assert_eq!(query(&["--import"], &out).0, Some(0));
    let (_, said, problem) = query(&["--out"], &home.path().join("work"));
    assert!(said.contains(a("metal")) && !said.contains(a("wood")), "{said}{problem}");
}

#[test]
fn a_folder_that_is_no_export_is_refused() {
    let home = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let store = recordings(&home.path().join("recorded"));
    let import = || exchange::import(home.path(), Some("m"), &queries, &store);
    assert!(matches!(import(), Err(ExchangeError::Unreadable { .. })));
    fs::write(home.path().join("manifest.json"), "{}").unwrap();
    assert!(matches!(import(), Err(ExchangeError::Manifest { .. })));
}
