//! The queries of all scenes in one submission to a server that speaks the Batch API.

use serde_json::{Value, json};

use super::ball::Balls;
use super::{batch, contents, outcomes, stderr};
use crate::query::batch_api::{BatchApiServer, answered, completed};
use crate::query::{a, good_answer};
use crate::run::gprop;

fn json_of(command: &mut std::process::Command, code: i32) -> Value {
    let output = command.arg("--json").output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
    serde_json::from_slice(&output.stdout).unwrap_or_default()
}

/// `gprop batch --queries STEP` on this server.
fn step_of(balls: &Balls, server: &BatchApiServer, step: &str) -> std::process::Command {
    let options = server.options();
    let (url, model) = (options.lmm_url.unwrap(), options.lmm_model.unwrap());
    batch(balls, &["--lmm-url", &url, "--lmm-model", &model, "--lmm-retries", "0", "--queries", step])
}

#[test]
fn all_scenes_queries_go_out_and_come_in_together() {
    let balls = Balls::new(3);
    let good = good_answer(a("wood"));
    let server = BatchApiServer::new(&good);
    let step = |step: &str, more: &[&str]| {
        let mut command = step_of(&balls, &server, step);
        command.args(more);
        command
    };
    let later = step("submit", &["--from", "vote"]).output().unwrap();
    assert_eq!(later.status.code(), Some(2));
    assert!(stderr(&later).contains("leave out --from vote"), "{}", stderr(&later));
    let collect = step("collect", &["--from", "scene"]).output().unwrap();
    assert!(stderr(&collect).contains("leave out --from scene"), "{}", stderr(&collect));
    let replay = step("submit", &["--answers", "replay"]).output().unwrap();
    assert_eq!(replay.status.code(), Some(2));
    assert!(stderr(&replay).contains("--answers replay sends nothing") && server.uploads() == 0, "{}", stderr(&replay));
    let after = batch(&balls, &["--from", "simulate"]).output().unwrap();
    assert!(stderr(&after).contains("--from simulate comes after the last stage"), "{}", stderr(&after));
    std::fs::write(balls.scene(1).join("transforms.json"), "{").unwrap();
    // Two scenes with three views of two segments each; the first question is asked at once.
    let sent = json_of(&mut step("submit", &[]), 6);
    assert_eq!((&sent["sent"], &sent["waiting"]), (&json!(11), &json!(0)));
    assert_eq!(server.uploads(), 1, "one submission for all");
    let again = json_of(&mut step("submit", &[]), 6);
    assert_eq!((&again["sent"], &again["waiting"]), (&json!(0), &json!(11)), "nothing is paid for twice");

    server.set(json!({ "id": "batch-1", "status": "in_progress" }), &[], &[]);
    server.lose(Some("/v1/batches/batch-1"));
    let lost = json_of(&mut step("collect", &[]), 5);
    assert!(lost["unfetched"]["batch-1"].as_str().is_some_and(|why| why.contains("404")), "{lost}");
    server.lose(None);
    json_of(&mut step("collect", &[]), 5);
    let output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good)).collect();
    server.set(completed(), &output, &[]);
    let collected = json_of(&mut step("collect", &[]), 0);
    assert_eq!(collected["recorded"], 11);
    let nothing = step("collect", &[]).output().unwrap();
    assert!(stderr(&nothing).contains("no Batch API job is waiting"), "{}", stderr(&nothing));

    // Every scene finds its answers without a server.
    let model = server.options().lmm_model.unwrap();
    let replayed = batch(&balls, &["--answers", "replay", "--lmm-model", &model]).arg("--json").output().unwrap();
    let states: Vec<Value> = String::from_utf8(replayed.stdout)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap()["state"].clone())
        .collect();
    assert_eq!(states.iter().filter(|state| *state == "done").count(), 2, "{states:?}");
}

/// Also with a scene that is added while the answers are still to come.
#[test]
fn scenes_with_the_same_questions_pay_for_them_once() {
    let balls = Balls::new(3);
    for (path, bytes) in contents(&balls.scene(0)) {
        (1..3).for_each(|number| std::fs::write(balls.scene(number).join(&path), &bytes).unwrap());
    }
    let later = balls.folder().with_file_name("later");
    std::fs::rename(balls.scene(2), &later).unwrap();
    let good = good_answer(a("wood"));
    let server = BatchApiServer::new(&good);
    let step = |step: &str| step_of(&balls, &server, step);
    let sent = json_of(&mut step("submit"), 0);
    assert_eq!((&sent["sent"], &sent["waiting"]), (&json!(5), &json!(0)), "one of six was asked at once");
    std::fs::rename(&later, balls.scene(2)).unwrap();
    let sent = json_of(&mut step("submit"), 0);
    assert_eq!((&sent["sent"], &sent["waiting"]), (&json!(0), &json!(10)));

    let counts = json!({ "total": 5, "completed": 1, "failed": 0 });
    server.set(json!({ "id": "batch-1", "status": "in_progress", "request_counts": counts }), &[], &[]);
    assert_eq!(json_of(&mut step("collect"), 5)["running_total"], 5, "requests, whoever waits for them");
    let output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good)).collect();
    server.set(completed(), &output, &[]);
    assert_eq!(json_of(&mut step("collect"), 0)["recorded"], 15);
    for number in 0..3 {
        assert_eq!(std::fs::read_dir(balls.scene(number).join("recorded")).unwrap().count(), 6, "{number}");
    }
}

#[test]
fn one_scenes_bad_options_keep_no_other_answers_back() {
    let balls = Balls::new(2);
    let good = good_answer(a("wood"));
    let server = BatchApiServer::new(&good);
    let step = |step: &str| step_of(&balls, &server, step);
    assert_eq!(json_of(&mut step("submit"), 0)["sent"], 11);
    let output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good)).collect();
    server.set(completed(), &output, &[]);
    let file = balls.scene(1).join("gprop.toml");
    let options = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, options.replace("volume-cells = 20000", "volume-cells = \"many\"")).unwrap();
    let collect = step("collect").output().unwrap();
    let said = stderr(&collect);
    assert_eq!(collect.status.code(), Some(6), "{said}");
    assert!(said.contains("ball-1") && said.contains("invalid value 'many' for '--volume-cells"), "{said}");
    std::fs::write(&file, options).unwrap();
    assert_eq!(json_of(&mut step("collect"), 0)["recorded"], 6, "those of the other scene were recorded before");
}

#[test]
fn one_scenes_submission_prints_json_at_every_step() {
    let balls = Balls::new(1);
    let good = good_answer(a("wood"));
    let server = BatchApiServer::new(&good);
    let (url, model) = (server.options().lmm_url.unwrap(), server.options().lmm_model.unwrap());
    let step = |step: &str| {
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("query").arg(balls.scene(0)).args(["--batch-api", step]);
        command.args(["--lmm-url", &url, "--lmm-model", &model, "--lmm-retries", "0"]);
        command
    };
    assert_eq!(json_of(&mut step("submit"), 0)["sent"], 5);
    server.set(json!({ "id": "batch-1", "status": "in_progress" }), &[], &[]);
    assert_eq!(json_of(&mut step("collect"), 5)["running"], 1);
    let output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good)).collect();
    server.set(completed(), &output, &[]);
    assert_eq!(json_of(&mut step("collect"), 0)["recorded"], 5);
}

#[test]
fn a_budget_holds_for_all_scenes_together() {
    let balls = Balls::new(3);
    let server = BatchApiServer::new(&good_answer(a("wood")));
    let (url, model) = (server.options().lmm_url.unwrap(), server.options().lmm_model.unwrap());
    let submit = |usd: &str| {
        let mut command = batch(&balls, &["--lmm-url", &url, "--lmm-model", &model, "--queries", "submit"]);
        command.args(["--max-usd", usd]);
        command
    };
    let refused = submit("0.001").output().unwrap();
    assert_eq!(refused.status.code(), Some(5));
    assert!(stderr(&refused).contains("--max-usd 0.001") && server.uploads() == 0, "{}", stderr(&refused));
    assert_eq!(json_of(&mut submit("10"), 0)["sent"], 17);
    // Without the Batch API each scene may spend its share: a third of this budget, too little for one question.
    let spent = outcomes(&mut batch(&balls, &["--lmm-model", &model, "--lmm-url", &url, "--max-usd", "0.003"]), 6);
    assert!(
        spent.iter().any(|outcome| outcome["error"].as_str().is_some_and(|why| why.contains("--max-usd 0.001"))),
        "{spent:?}"
    );
}

#[test]
fn answers_are_not_recorded_through_a_link() {
    let (balls, outside) = (Balls::new(1), tempfile::tempdir().unwrap());
    let good = good_answer(a("wood"));
    let server = BatchApiServer::new(&good);
    let step = |step: &str| step_of(&balls, &server, step);
    assert_eq!(json_of(&mut step("submit"), 0)["sent"], 5);
    let output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good)).collect();
    server.set(completed(), &output, &[]);
    let (work, elsewhere) = (balls.scene(0).join("gprop"), outside.path().join("gprop"));
    std::fs::rename(&work, &elsewhere).unwrap();
    std::os::unix::fs::symlink(&elsewhere, &work).unwrap();
    let refused = step("collect").output().unwrap();
    assert_eq!(refused.status.code(), Some(6), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("is a link"), "{}", stderr(&refused));
    std::fs::remove_file(&work).unwrap();
    std::fs::rename(&elsewhere, &work).unwrap();
    assert_eq!(json_of(&mut step("collect"), 0)["recorded"], 5, "the answers were still to be collected");
}
