//! The recipes of `docs/models.md`, typed as they stand there, against stand-ins for the servers.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::client::{CANARY, error};
use super::{a, completion, good_answer, with};
use crate::batch::ball::Balls;
use crate::run::gprop;
use crate::support::server::{MockServer, Request, Response, json_of};

/// What a server demands of a request, and how it replies.
struct StandIn {
    heading: &'static str,
    /// Where the request arrives, with its query.
    url: &'static str,
    /// The header with the key and what precedes the key in it; `None` if the server needs none.
    key: Option<(&'static str, &'static str)>,
    /// The server's objection to a request's body, if it has one.
    objects: fn(&Value) -> Option<Response>,
    /// Turns a reply as OpenAI documents it into this server's.
    reply: fn(Value) -> Value,
}

const BEARER: Option<(&str, &str)> = Some(("authorization", "Bearer "));

fn takes_all(_: &Value) -> Option<Response> {
    None
}

/// OpenAI's models of today.
fn takes_one_limit(body: &Value) -> Option<Response> {
    let problem =
        "Unsupported parameter: 'max_tokens' is not supported with this model. Use 'max_completion_tokens' instead.";
    body.get("max_tokens").map(|_| error(400, problem))
}

fn takes_no_json_object(body: &Value) -> Option<Response> {
    let is_refused = body["response_format"]["type"] == "json_object";
    is_refused
        .then(|| Response::new(400).json(json!({ "error": "'response_format.type' must be 'json_schema' or 'text'" })))
}

fn stand_ins() -> Vec<StandIn> {
    let local = |heading, objects, reply| StandIn { heading, url: "/v1/chat/completions", key: None, objects, reply };
    vec![
        StandIn {
            heading: "OpenAI",
            url: "/v1/chat/completions",
            key: BEARER,
            objects: takes_one_limit,
            reply: |mut reply| {
                reply["choices"][0]["message"]["refusal"] = Value::Null;
                reply["choices"][0]["message"]["annotations"] = json!([]);
                reply["usage"]["completion_tokens_details"] = json!({ "reasoning_tokens": 0 });
                reply
            },
        },
        StandIn {
            heading: "Gemini",
            url: "/v1beta/openai/chat/completions",
            key: BEARER,
            objects: takes_all,
            reply: |reply| with(reply, "model", json!("gemini-2.5-flash")),
        },
        StandIn {
            heading: "OpenRouter",
            url: "/api/v1/chat/completions",
            key: BEARER,
            objects: takes_all,
            reply: |mut reply| {
                reply["provider"] = json!("Google AI Studio");
                reply["choices"][0]["native_finish_reason"] = json!("STOP");
                reply["choices"][0]["message"]["reasoning"] = json!("It looks like {wood}.");
                reply["usage"]["cost"] = json!(0.0021);
                reply
            },
        },
        StandIn {
            heading: "Azure",
            url: "/openai/v1/chat/completions",
            key: Some(("api-key", "")),
            objects: takes_one_limit,
            reply: |mut reply| {
                let safe = json!({ "violence": { "filtered": false, "severity": "safe" } });
                reply["prompt_filter_results"] = json!([{ "prompt_index": 0, "content_filter_results": safe }]);
                reply["choices"][0]["content_filter_results"] = safe;
                reply
            },
        },
        local("vLLM", takes_all, |mut reply| {
            reply["choices"][0]["message"]["reasoning_content"] = Value::Null;
            reply["choices"][0]["message"]["tool_calls"] = json!([]);
            reply["choices"][0]["stop_reason"] = Value::Null;
            with(reply, "prompt_logprobs", Value::Null)
        }),
        local("Ollama", takes_all, |reply| with(reply, "system_fingerprint", json!("fp_ollama"))),
        local("llama.cpp", takes_all, |reply| with(reply, "timings", json!({ "prompt_n": 6700, "predicted_ms": 9.5 }))),
        local("LM Studio", takes_no_json_object, |reply| with(reply, "stats", json!({}))),
    ]
}

/// The stand-in as a server.
fn serve(StandIn { url, key, objects, reply, .. }: StandIn) -> MockServer {
    MockServer::new(move |request: &Request| {
        if request.url != url {
            return error(404, "no such path");
        }
        let sent = key.map(|(header, before)| request.header(header) == Some(&format!("{before}{CANARY}")));
        if sent == Some(false) || (key.is_none() && request.header("authorization").is_some()) {
            return error(401, "not the key");
        }
        let good = completion(&good_answer(a("wood")).to_string());
        objects(&json_of(request)).unwrap_or_else(|| Response::new(200).json(reply(good)))
    })
}

/// The command of a recipe, after the scene's name, in words.
fn recipe<'p>(page: &'p str, heading: &str) -> Vec<&'p str> {
    let section = page.split_once(&format!("\n## {heading}\n")).unwrap_or_else(|| panic!("no recipe for {heading}")).1;
    let command = section.lines().find_map(|line| line.strip_prefix("gprop run my_scene --scale metric "));
    command
        .unwrap_or_else(|| panic!("no command for {heading}"))
        .split('#')
        .next()
        .unwrap()
        .split_whitespace()
        .collect()
}

#[test]
fn every_recipe_leads_to_answers() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/models.md")).unwrap();
    assert_eq!(page.matches("\n## ").count(), stand_ins().len(), "each recipe has a stand-in");
    for stand_in in stand_ins() {
        let (heading, has_key) = (stand_in.heading, stand_in.key.is_some());
        let server = serve(stand_in);
        let typed = recipe(&page, heading);
        let after = |flag: &str| typed.iter().position(|word| *word == flag).map(|at| typed[at + 1]);
        let url = after("--lmm-url").unwrap();
        let path = url.splitn(4, '/').nth(3).unwrap();
        let here = format!("{}/{path}", server.uri());
        let words = typed.iter().map(|word| if *word == url { here.as_str() } else { word });
        let balls = Balls::new(1);
        let mut command = gprop();
        command.env_remove("OPENAI_API_KEY").arg("query").arg(balls.scene(0)).args(words);
        if has_key {
            command.env(after("--lmm-key-env").unwrap_or("OPENAI_API_KEY"), CANARY);
        }
        let output = command.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{heading}: {said}");
        assert!(said.contains("; 0 of "), "{heading}: every question is answered: {said}");
        // What a local model costs is nothing, and a hosted one has a price.
        assert_eq!(said.contains("nothing is charged"), !has_key, "{heading}: {said}");
        assert!(!said.contains("an unknown price") && !said.contains(CANARY), "{heading}: {said}");
    }
}
