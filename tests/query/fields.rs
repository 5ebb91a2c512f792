use std::path::PathBuf;

use gprop::query::client::{ApiKey, ClientError};
use gprop::query::{AnswerSource, Options, Prompts, Queries};
use serde_json::{Value, json};

use super::client::{CANARY, Server, ask, error, ok};
use super::{a, connect, good_answer, one_segment, prepare, recordings, run};

/// A server that answers every question.
fn willing() -> Server {
    Server::new(|_, _, _| ok(&good_answer(a("wood")).to_string()))
}

/// Options with `--lmm-body`, and the folder that holds the file.
fn with_fields(options: &Options, fields: &str) -> (Options, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("body.json");
    std::fs::write(&path, fields).unwrap();
    (Options { lmm_body: Some(path), ..options.clone() }, folder)
}

#[test]
fn fields_of_the_users_file_are_in_every_request() {
    let server = willing();
    let fields = json!({ "think": false, "reasoning_effort": "low", "num_ctx": 8192,
                         "chat_template_kwargs": { "enable_thinking": false } });
    let (options, _folder) = with_fields(&server.options(), &fields.to_string());
    let client = connect(&options, None).unwrap().unwrap();
    ask(&client, None).unwrap();
    let sent = server.requests().remove(0);
    for (name, value) in fields.as_object().unwrap() {
        assert_eq!(sent[name], *value);
    }
    assert_eq!((&sent["model"], &sent["stream"]), (&json!("test-model"), &json!(false)));
}

#[test]
fn a_file_that_sets_what_gprop_sets_or_is_no_object_is_refused() {
    let server = willing();
    let problem = |fields: &str| {
        let (options, _folder) = with_fields(&server.options(), fields);
        let refused = connect(&options, Some(ApiKey::new(CANARY).unwrap())).map(|_| ()).unwrap_err();
        assert!(matches!(refused, ClientError::Fields { .. }), "{fields}: {refused}");
        refused.to_string()
    };
    for (field, instead) in [
        ("model", "--lmm-model"),
        ("messages", "--prompts"),
        ("temperature", "--lmm-temperature"),
        ("max_tokens", "--lmm-max-tokens"),
        ("max_completion_tokens", "--lmm-max-tokens"),
        ("n_predict", "--lmm-max-tokens"),
        ("stream", "whole"),
        ("response_format", "form"),
        ("n", "one answer"),
    ] {
        let problem = problem(&json!({ "think": false, field: null }).to_string());
        assert!(problem.contains(field) && problem.contains(instead) && problem.contains("body.json"), "{problem}");
    }
    for fields in ["", "[]", "7", "{\"think\": }", "{\"think\": false", "think = false"] {
        assert!(problem(fields).contains("not a JSON object"), "{fields}");
    }
    let with_key = problem(&json!({ "api_key": CANARY }).to_string());
    assert!(with_key.contains("key") && !with_key.contains(CANARY), "{with_key}");
    let missing = Options { lmm_body: Some(PathBuf::from("nowhere.json")), ..server.options() };
    assert!(connect(&missing, None).map(|_| ()).unwrap_err().to_string().contains("nowhere.json"));
    assert!(server.requests().is_empty());
}

#[test]
fn an_answer_is_recorded_for_its_fields_and_without_them() {
    let server = willing();
    let (folder, prompts) = (tempfile::tempdir().unwrap(), Prompts::builtin());
    let secret = "another-secret-0123456789";
    let (thinking, _one) = with_fields(&server.options(), &json!({ "think": true, "api_key": secret }).to_string());
    let (silent, _two) = with_fields(&server.options(), "{\"think\": false}");
    let (nothing, _three) = with_fields(&server.options(), "{}");
    let asked = |options: &Options| {
        let before = server.requests().len();
        let queries: Queries = prepare(&[one_segment()], &prompts, options);
        let client = connect(options, None).unwrap().unwrap();
        run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
        server.requests().len() - before
    };
    assert_eq!([&thinking, &silent, &server.options()].map(asked), [1, 1, 1], "each has answers of its own");
    assert_eq!([&thinking, &silent, &server.options(), &nothing].map(asked), [0, 0, 0, 0], "and they are found again");
    let texts: String = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    assert!(texts.contains("body_sha256") && !texts.contains(secret) && !texts.contains("think"), "{texts}");
    // Whoever replays the answers of a model takes those with any fields.
    let replay = Options { answers: AnswerSource::Replay, lmm_url: None, ..server.options() };
    let queries = prepare(&[one_segment()], &prompts, &replay);
    assert!(run(&queries, &recordings(folder.path()), None).is_ok());
}

/// The limits that a request sets.
fn limits(body: &Value) -> [bool; 2] {
    ["max_tokens", "max_completion_tokens"].map(|name| body[name] == 4000)
}

/// Asks twice; returns the limits of each request.
fn limits_of_two(server: &Server) -> Vec<[bool; 2]> {
    let client = server.client();
    ask(&client, None).unwrap();
    ask(&client, None).unwrap();
    server.requests().iter().map(limits).collect()
}

#[test]
fn reasoning_is_limited_whichever_limit_the_server_knows() {
    // Many servers take both and heed those that they know.
    assert_eq!(limits_of_two(&willing()), [[true, true], [true, true]]);
    // OpenAI and Volcengine.
    let not_both = Server::new(|_, body, _| match limits(body) {
        [true, true] => {
            error(400, "Setting 'max_tokens' and 'max_completion_tokens' at the same time is not supported.")
        }
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    assert_eq!(limits_of_two(&not_both), [[true, true], [false, true], [false, true]]);
    // Mistral, whose errors are FastAPI's.
    let forbidden = json!({ "detail": [{ "type": "extra_forbidden", "loc": ["body", "max_completion_tokens"],
                                         "msg": "Extra inputs are not permitted", "input": 4000 }] });
    let old_name = Server::new(move |_, body, _| match limits(body) {
        [_, true] => crate::support::server::Response::new(422).json(&forbidden),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    assert_eq!(limits_of_two(&old_name), [[true, true], [true, false], [true, false]]);
    // A server that does not say what it refuses.
    let silent = Server::new(|_, body, _| match limits(body) {
        [_, true] => error(400, "bad request"),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    let client = silent.client();
    ask(&client, None).unwrap();
    let last = silent.requests().pop().unwrap();
    assert_eq!((limits(&last), &last["response_format"]["type"]), ([true, false], &json!("json_schema")));
}
