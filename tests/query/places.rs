use gprop::query::ask::asker::{AskError, ReplyContent};
use gprop::query::client::read_completion;
use gprop::query::recorded::Usage;
use gprop::query::{Options, Outcome, Prompts};
use serde_json::{Value, json};

use super::client::{Server, error, ok};
use super::{a, completion, connect, good_answer, one_segment, prepare, recordings, run};
use crate::support::server::Response;

fn good() -> String {
    good_answer(a("wood")).to_string()
}

/// A completion with this message and finish reason.
fn message(message: Value, finish_reason: &str) -> Value {
    json!({ "model": "m", "choices": [{ "index": 0, "message": message, "finish_reason": finish_reason }],
            "usage": { "prompt_tokens": 1000, "completion_tokens": 300 } })
}

/// A stream of the parts of a text as `field` of the deltas.
fn stream(field: &str, text: &str) -> String {
    let parts: Vec<String> = text.chars().collect::<Vec<_>>().chunks(40).map(|part| part.iter().collect()).collect();
    let chunk = |part: &String| json!({ "choices": [{ "index": 0, "delta": { field: part }, "finish_reason": null }] });
    let chunks: String = parts.iter().map(|part| format!("data: {}\n\n", chunk(part))).collect();
    let end = json!({ "choices": [{ "delta": {}, "finish_reason": "stop" }] });
    let usage = json!({ "choices": [], "usage": { "prompt_tokens": 1000, "completion_tokens": 300 } });
    format!(": busy\n\n{chunks}data: {end}\n\ndata: {usage}\n\ndata: [DONE]\n\n")
}

fn tool_call(arguments: &Value) -> Value {
    json!({ "content": null, "tool_calls": [{ "type": "function", "function": { "name": "f", "arguments": arguments } }] })
}

/// Asks about one segment; returns its outcome and the number of requests.
fn asked(body: impl Into<String>) -> (Outcome, usize) {
    let body = body.into();
    let server = Server::new(move |_, _, _| Response::new(200).text(body.clone()));
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), server.options());
    let client = connect(&options, None).unwrap().unwrap();
    let queries = prepare(&[one_segment()], &prompts, &options);
    let mut run = run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
    (run.answers.all.remove(0).outcome, server.requests().len())
}

#[test]
fn an_answer_is_taken_from_wherever_it_stands_and_is_asked_for_once() {
    let good = good();
    let pieces = good.split_at(50);
    let parts = json!([
        { "type": "thinking", "thinking": [{ "type": "text", "text": "{\"caption\": \"a draft\"}" }] },
        { "type": "text", "text": pieces.0 }, { "type": "text", "text": pieces.1 },
    ]);
    let as_list = json!([message(json!({ "content": good }), "stop")]);
    let tool_deltas: String = good.chars().collect::<Vec<_>>().chunks(50).fold(String::new(), |text, part| {
        let part: String = part.iter().collect();
        let call = json!({ "index": 1, "function": { "arguments": part } });
        text + &format!("data: {}\n", json!({ "choices": [{ "delta": { "tool_calls": [call] } }] }))
    });
    let message = |value: Value, reason: &str| message(value, reason).to_string();
    let table = [
        ("reasoning_content", message(json!({ "content": "", "reasoning_content": good }), "stop")),
        ("reasoning", message(json!({ "content": null, "reasoning": format!("So: {good}") }), "stop")),
        ("cut reasoning", message(json!({ "content": "", "reasoning": format!("{good} But") }), "length")),
        ("beside words", message(json!({ "content": "Here it is.", "reasoning_content": good }), "stop")),
        ("a tool", message(tool_call(&json!(good)), "tool_calls")),
        ("a tool with an object", message(tool_call(&good_answer(a("wood"))), "tool_calls")),
        ("a function", message(json!({ "function_call": { "name": "f", "arguments": good } }), "function_call")),
        ("parts", message(json!({ "content": parts }), "stop")),
        ("decoded content", message(json!({ "content": good_answer(a("wood")) }), "stop")),
        ("filtered afterwards", message(json!({ "content": good }), "content_filter")),
        ("a list", as_list.to_string()),
        ("a stream", stream("content", &good)),
        ("a stream of reasoning", stream("reasoning_content", &good)),
        ("a stream of a call", tool_deltas),
        (
            "a stream with other line breaks",
            stream("content", &good).replace("\n\n", "\r\n").replace("data: ", "data:"),
        ),
        (
            "a stream without its end",
            stream("content", &good).split("data: {\"choices\":[{\"delta\":{}").next().unwrap().to_owned(),
        ),
        ("an end after a whole response", format!("{}\n\ndata: [DONE]\n", completion(&good))),
        ("a whole response in a stream", format!("event: x\ndata: {}\n\ndata: [DONE]\n", completion(&good))),
        ("an error after the answer", {
            let mut body = completion(&good);
            body["error"] = json!({ "message": "the log is full" });
            body.to_string()
        }),
    ];
    for (place, body) in table {
        let (outcome, requests) = asked(body.as_str());
        let is_wood = matches!(&outcome, Outcome::Answered(answer) if answer.material == a("wood"));
        assert!(is_wood && requests == 1, "{place}: {requests} requests, {outcome:?}\n{body}");
    }
}

#[test]
fn an_answer_in_a_stream_has_its_usage_and_model() {
    let reply = read_completion(200, &stream("content", &good())).unwrap();
    assert_eq!(reply.content, ReplyContent::Text(good()));
    assert_eq!(reply.usage, Some(Usage { input_tokens: 1000, output_tokens: 300 }));
}

/// Servers that answer only without a response format (LM Studio, vLLM with a parser for reasoning).
#[test]
fn a_reply_without_an_answer_leads_to_the_next_plainer_form_which_is_kept() {
    for empty in [
        message(json!({ "content": "", "reasoning_content": "It looks like wood." }), "stop").to_string(),
        message(json!({ "content": null, "reasoning": "It looks like" }), "length").to_string(),
        message(tool_call(&json!("{}")), "tool_calls").to_string(),
        stream("reasoning", "It looks like wood."),
    ] {
        let server = Server::new(move |_, body, _| match body["response_format"]["type"].as_str() {
            Some(_) => Response::new(200).text(empty.clone()),
            None => ok(&good()),
        });
        let client = server.client();
        for _ in 0..2 {
            let reply = super::client::ask(&client, None).unwrap();
            assert_eq!(reply.content, ReplyContent::Text(good()));
        }
        let formats: Vec<Value> =
            server.requests().iter().map(|body| body["response_format"]["type"].clone()).collect();
        assert_eq!(formats, [json!("json_schema"), json!("json_object"), Value::Null, Value::Null]);
    }
}

#[test]
fn the_tokens_of_replies_without_an_answer_count() {
    let empty = message(json!({ "content": "" }), "stop");
    let server = Server::new(move |count, _, _| if count == 0 { Response::new(200).json(&empty) } else { ok(&good()) });
    assert_eq!(server.ask().unwrap().usage, Some(Usage { input_tokens: 2200, output_tokens: 380 }));
}

#[test]
fn what_is_no_completion_is_asked_for_in_each_form_once() {
    let bodies = [r#"{"choices":[]}"#, "<html>busy</html>", "", "[]", "{\"choices\": [{\"mess", "data: hello\n"];
    for body in bodies {
        let server = Server::new(move |_, _, _| Response::new(200).text(body));
        let AskError::Failed(message) = server.ask().unwrap_err() else { panic!("{body}") };
        assert!(message.contains("not a chat completion") && message.contains("--lmm-url"), "{body}: {message}");
        let formats: Vec<Value> =
            server.requests().iter().map(|body| body["response_format"]["type"].clone()).collect();
        assert_eq!(formats, [json!("json_schema"), json!("json_object"), Value::Null], "{body}");
    }
}

#[test]
fn the_advice_fits_the_reason() {
    let advice = |value: Value, reason: &str| match Server::new(move |_, _, _| Response::new(200).json(&value)).ask() {
        Ok(reply) => match reply.content {
            ReplyContent::Empty(why) | ReplyContent::Refusal(why) => why,
            ReplyContent::Text(text) => panic!("{reason}: {text}"),
        },
        Err(error) => panic!("{reason}: {error}"),
    };
    let more_tokens = "raise --lmm-max-tokens";
    let length = advice(message(json!({ "content": "", "reasoning": "Well," }), "length"), "length");
    assert!(length.contains(more_tokens) && length.contains("--lmm-body"), "{length}");
    for (value, reason, words) in [
        (json!({ "content": "" }), "stop", "writes nothing"),
        (json!({ "content": "", "reasoning_content": "Wood." }), "stop", "--lmm-body"),
        (tool_call(&json!("{}")), "tool_calls", "calls a tool"),
        (json!({ "content": "" }), "content_filter", "content filter"),
        (json!({ "content": null, "refusal": "I will not." }), "stop", "I will not."),
    ] {
        let why = advice(message(value, reason), reason);
        assert!(why.contains(words) && !why.contains(more_tokens), "{reason}: {why}");
    }
}

#[test]
fn an_error_in_a_successful_response_counts_as_what_it_says() {
    // As OpenRouter reports the errors of the servers behind it.
    let behind = |code: u16| {
        json!({ "error": { "message": "Provider returned error", "code": code,
                           "metadata": { "raw": "{\"error\":{\"message\":\"not today\"}}" } } })
    };
    let of_choice = json!({ "choices": [{ "error": { "code": 401, "message": "not today" },
                                          "finish_reason": "error", "message": { "content": "half an" } }] });
    for body in [behind(401), of_choice] {
        let server = Server::new(move |_, _, _| Response::new(200).json(&body));
        let AskError::Fatal(message) = server.ask().unwrap_err() else { panic!() };
        assert!(message.contains("not today") && message.contains("OPENAI_API_KEY"), "{message}");
        assert_eq!(server.requests().len(), 1);
    }
    let server = Server::new(move |count, _, _| match count {
        0 => Response::new(200).json(behind(502)).header("retry-after-ms", "1"),
        _ => ok(&good()),
    });
    assert!(server.ask().is_ok());
    assert_eq!(server.requests().len(), 2);
}

#[test]
fn an_error_is_shown_as_the_servers_sentence() {
    let field = json!({ "detail": [{ "loc": ["body", "stream"], "msg": "Extra inputs are not permitted" }] });
    let table = [
        (json!([{ "error": { "code": 418, "message": "Enough tea." } }]).to_string(), "Enough tea."),
        (json!({ "error": "Enough tea." }).to_string(), "Enough tea."),
        (json!({ "error": { "message": "{\"error\": {\"message\": \"Enough tea.\"}}" } }).to_string(), "Enough tea."),
        (json!({ "errors": [{ "message": "Enough." }, { "message": "Tea." }] }).to_string(), "Enough.; Tea."),
        (field.to_string(), "stream: Extra inputs are not permitted"),
        ("\"Enough tea.\"".to_owned(), "Enough tea."),
        ("418 enough tea".to_owned(), "418 enough tea"),
        ("data: {\"error\": {\"message\": \"Enough tea.\"}}\n\n".to_owned(), "Enough tea."),
        ("<html><head><title>Tea</title></head></html>".to_owned(), "a web page with the title \"Tea\""),
        (json!({ "code": 7 }).to_string(), "no explanation"),
        (String::new(), "no explanation"),
    ];
    for (body, sentence) in table {
        let sent = body.clone();
        let server = Server::new(move |_, _, _| Response::new(418).text(sent.clone()));
        assert_eq!(server.ask(), Err(AskError::Failed(format!("status 418: {sentence}"))), "{body}");
    }
}

#[test]
fn a_refused_form_with_an_error_in_a_list_is_asked_more_plainly() {
    let server = Server::new(|_, body, _| match body["response_format"]["type"].as_str() {
        Some("json_schema") => Response::new(400).json(json!([{ "error": { "message": "no schemas" } }])),
        Some(_) => error(500, "no grammar for this response_format"),
        None => ok(&good()),
    });
    let options = Options { lmm_retries: 0, ..server.options() };
    assert!(super::client::ask(&connect(&options, None).unwrap().unwrap(), None).is_ok());
    assert_eq!(server.requests().len(), 3);
}
