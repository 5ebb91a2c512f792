//! Servers that people use: each supports a different part of the API, and each must lead to a checked answer.

use gprop::query::{Options, Outcome, Prompts};
use serde_json::Value;

use super::client::{Server, error, ok};
use super::{a, completion, connect, good_answer, prepare, recordings, run, two_segments};
use crate::support::server::Response;

/// Checks that both segments of a view are answered, with this many requests.
fn assert_answered(server: &Server, prompts: &Prompts, requests: usize) -> gprop::query::Run {
    let folder = tempfile::tempdir().unwrap();
    let options = Options { lmm_parallel: 1, ..server.options() };
    let queries = prepare(&[two_segments("000", 80, 80)], prompts, &options);
    let client = connect(&options, None).unwrap().unwrap();
    let run = run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
    for segment in &run.answers.all {
        assert!(matches!(&segment.outcome, Outcome::Answered(answer) if answer.material == a("wood")), "{segment:?}");
    }
    assert_eq!(server.requests().len(), requests);
    run
}

fn format(body: &Value) -> Option<&str> {
    body["response_format"]["type"].as_str()
}

fn image_url(body: &Value) -> &Value {
    let content = body["messages"][0]["content"].as_array().expect("content is a list of parts");
    &content.iter().find(|part| part["type"] == "image_url").expect("there is a picture")["image_url"]
}

fn good() -> String {
    good_answer(a("wood")).to_string()
}

#[test]
fn vllm_takes_the_schema_and_refuses_what_it_does_not_know() {
    // vLLM validates the request with pydantic; its errors are FastAPI's.
    let server = Server::new(|_, body, _| match body.get("max_completion_tokens") {
        None if format(body) == Some("json_schema") => ok(&good()),
        _ => error(400, "[{'type': 'extra_forbidden', 'loc': ('body', 'max_completion_tokens')}]"),
    });
    assert_answered(&server, &Prompts::builtin(), 3);
}

#[test]
fn ollama_takes_pictures_as_base64_only_and_fences_its_json() {
    let server = Server::new(|_, body, _| {
        let url = image_url(body)["url"].as_str().unwrap_or_default();
        if url.starts_with("data:image/jpeg;base64,") {
            ok(&format!("```json\n{}\n```", good()))
        } else {
            error(400, "invalid image input")
        }
    });
    assert_answered(&server, &Prompts::builtin(), 2);
}

#[test]
fn a_server_that_ignores_detail_is_paid_what_it_counts() {
    // It processes the picture at its own resolution: 256 tokens, whatever was estimated.
    let server = Server::new(|_, _, _| {
        let mut body = completion(&good());
        body["usage"] = serde_json::json!({ "prompt_tokens": 256, "completion_tokens": 10 });
        Response::new(200).json(body)
    });
    let run = assert_answered(&server, &Prompts::builtin(), 2);
    assert_eq!((run.spent.usage.input_tokens, run.spent.usage.output_tokens), (512, 20));
}

#[test]
fn a_server_that_refuses_detail_is_asked_without() {
    let server = Server::new(|_, body, _| match image_url(body).get("detail") {
        Some(_) => error(422, "image_url.detail: Extra inputs are not permitted"),
        None => ok(&good()),
    });
    assert_answered(&server, &Prompts::builtin(), 3);
    assert_eq!(format(server.requests().last().unwrap()), Some("json_schema"), "the schema stays");
}

#[test]
fn an_old_llama_cpp_knows_no_response_format_and_thinks_aloud() {
    for status in [400, 500] {
        let server = Server::new(move |_, body, _| match format(body) {
            Some(_) => error(status, "failed to parse grammar of response_format"),
            None => ok(&format!("<think>{{brown?}}</think>Here is the JSON: {}", good())),
        });
        assert_answered(&server, &Prompts::builtin(), 4);
    }
}

#[test]
fn dashscope_refuses_the_schema_and_demands_the_word_json() {
    let dashscope = || {
        Server::new(|_, body, _| {
            let said = body["messages"].to_string().to_lowercase();
            match format(body) {
                Some("json_schema") => error(400, "'response_format.type' must be one of text, json_object"),
                Some("json_object") if !said.contains("json") => {
                    error(400, "'messages' must contain the word 'json' in some form")
                }
                Some("json_object") => ok(&good()),
                _ => error(400, "this test wants json_object to be used"),
            }
        })
    };
    assert_answered(&dashscope(), &Prompts::builtin(), 3);

    // A user's own prompt that never mentions JSON: the client adds it.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.txt"), "What is it? One of: {{ candidates }}").unwrap();
    assert_answered(&dashscope(), &Prompts::from_folder(folder.path()).unwrap(), 3);
}

#[test]
fn a_server_that_promises_a_schema_and_breaks_it_is_checked_all_the_same() {
    let server = Server::new(|count, _, _| match count % 2 {
        0 => ok(r#"{"caption":"a stick","family":"wood","material":"oak"}"#),
        _ => ok(&good()),
    });
    let run = assert_answered(&server, &Prompts::builtin(), 4);
    assert_eq!(run.spent.requests, 4);
    let correction = server.requests()[1]["messages"][2]["content"].to_string();
    assert!(correction.contains("density_kg_m3"), "it is told what is missing: {correction}");
}
