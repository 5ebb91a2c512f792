//! The client against a server that misbehaves in every way that servers are known to.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crate::support::server::{MockServer, Request, Response, json_of};
use gprop::query::ask::asker::{self, AskError, Asker, Correction, Reply, ReplyContent};
use gprop::query::ask::budget::Budget;
use gprop::query::ask::cost::Cost;
use gprop::query::client::{ApiKey, Client, ClientError};
use gprop::query::recorded::Usage;
use gprop::query::{Failure, Options, Outcome, Prompts, QueryError};
use serde_json::{Value, json};

use super::{a, completion, connect, good_answer, grid, prepare, recordings, run, small, two_segments};

/// A key; a test fails if it appears anywhere it must not be.
pub const CANARY: &str = "sk-canary-5f2e8c1d9b7a";

pub struct Server(MockServer);

impl Server {
    /// A server that answers its n-th request, from 0, as `respond` says.
    pub fn new(respond: impl Fn(usize, &Value, &Request) -> Response + Send + Sync + 'static) -> Self {
        let count = AtomicUsize::new(0);
        Self(MockServer::new(move |request| match (request.method.as_str(), request.path()) {
            ("POST", "/v1/chat/completions") => {
                respond(count.fetch_add(1, Ordering::SeqCst), &json_of(request), request)
            }
            _ => Response::new(404),
        }))
    }

    pub fn options(&self) -> Options {
        Options { lmm_url: Some(format!("{}/v1", self.0.uri())), lmm_model: Some("test-model".into()), ..small() }
    }

    pub fn client(&self) -> Client {
        connect(&self.options(), None).unwrap().unwrap()
    }

    pub fn requests(&self) -> Vec<Value> {
        self.0.requests().iter().map(json_of).collect()
    }

    /// Asks one made-up question.
    pub fn ask(&self) -> Result<Reply, AskError> {
        ask(&self.client(), None)
    }
}

pub fn ask(client: &Client, correction: Option<Correction>) -> Result<Reply, AskError> {
    let (prompts, options) = (Prompts::builtin(), small());
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let budget = Budget::new(None, None);
    let account = budget.account(Cost::default());
    client.ask(
        asker::Request { question: queries.questions.first(), picture: &queries.subjects[0].jpeg, correction },
        &account,
    )
}

pub fn ok(text: &str) -> Response {
    Response::new(200).json(completion(text))
}

pub fn error(status: u16, message: &str) -> Response {
    Response::new(status).json(json!({ "error": { "message": message } }))
}

fn soon(status: u16) -> Response {
    error(status, "later").header("retry-after-ms", "1")
}

#[test]
fn the_request_is_what_the_api_asks_for() {
    let server = Server::new(|_, _, _| ok("{}"));
    let client = server.client();
    let reply = ask(&client, None).unwrap();
    assert_eq!(reply.usage, Some(Usage { input_tokens: 1200, output_tokens: 80 }));
    assert_eq!(reply.served_model.as_deref(), Some("test-model-0001"));
    ask(&client, Some(Correction { response: "{bad", prompt: "Again." })).unwrap();

    let [first, second] = &server.requests()[..] else { panic!() };
    assert_eq!(first["model"], "test-model");
    assert_eq!(first["temperature"], 0.0);
    assert_eq!(first["stream"], false);
    let content = first["messages"][0]["content"].as_array().unwrap();
    assert_eq!(content[0]["type"], "text");
    let url = content[1]["image_url"]["url"].as_str().unwrap();
    let (mime, data) = url.strip_prefix("data:").unwrap().split_once(";base64,").unwrap();
    let bytes = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, data).unwrap();
    assert_eq!(mime, "image/jpeg");
    assert_eq!(image::guess_format(&bytes).unwrap(), image::ImageFormat::Jpeg);
    let format = &first["response_format"];
    assert_eq!(format["type"], "json_schema");
    assert_eq!(format["json_schema"]["strict"], true);
    assert!(format["json_schema"]["schema"]["properties"]["caption"].is_object());
    let roles: Vec<_> = second["messages"].as_array().unwrap().iter().map(|message| &message["role"]).collect();
    assert_eq!(roles, ["user", "assistant", "user"]);
}

#[test]
fn a_server_that_takes_no_schema_is_asked_more_plainly_and_the_next_time_at_once() {
    let server = Server::new(|_, body, _| match body["response_format"]["type"].as_str() {
        Some("json_schema") => error(400, "response_format.type must be text or json_object"),
        Some("json_object") => error(422, "json_object is not supported"),
        _ => ok("{}"),
    });
    let client = server.client();
    ask(&client, None).unwrap();
    ask(&client, None).unwrap();
    let formats: Vec<_> =
        server.requests().iter().map(|body| body["response_format"]["type"].as_str().map(str::to_owned)).collect();
    let named = |name: &str| Some(name.to_owned());
    assert_eq!(formats, [named("json_schema"), named("json_object"), None, None]);
}

#[test]
fn parameters_that_a_model_refuses_are_put_otherwise() {
    let server = Server::new(|_, body, _| {
        if body.get("max_tokens").is_some() {
            return error(400, "Unsupported parameter: 'max_tokens'. Use 'max_completion_tokens' instead.");
        }
        if body.get("temperature").is_some() {
            return error(400, "Unsupported value: 'temperature' does not support 0.0 with this model.");
        }
        ok("{}")
    });
    server.ask().unwrap();
    let last = server.requests().pop().unwrap();
    assert_eq!(last["max_completion_tokens"], 4000);
    assert_eq!(last["response_format"]["type"], "json_schema", "the schema stays");
}

#[test]
fn passing_faults_are_repeated() {
    for fault in [429, 500, 502, 503, 408] {
        let server = Server::new(move |count, _, _| if count < 2 { soon(fault) } else { ok("{}") });
        assert!(server.ask().is_ok(), "status {fault}");
        assert_eq!(server.requests().len(), 3, "status {fault}");
    }
}

#[test]
fn a_cut_body_is_asked_for_again() {
    let server = Server::new(|count, _, _| {
        let whole = completion("{}").to_string();
        if count == 0 {
            return Response::new(200).text(&whole[..whole.len() / 2]).header("retry-after-ms", "1");
        }
        ok("{}")
    });
    assert!(server.ask().is_ok());
    assert_eq!(server.requests().len(), 2);
}

#[test]
fn retry_after_is_kept_to() {
    let server = Server::new(|count, _, _| match count {
        0 => error(429, "slow down").header("retry-after", "1"),
        _ => ok("{}"),
    });
    // At least as long as the server asks for; a slow machine only makes it longer.
    let start = std::time::Instant::now();
    server.ask().unwrap();
    assert!(start.elapsed() >= Duration::from_secs(1), "{:?}", start.elapsed());
    // A server that wants an hour is given up on at once.
    let server = Server::new(|_, _, _| error(503, "maintenance").header("retry-after", "3600"));
    assert!(matches!(server.ask(), Err(AskError::Failed(_))));
    assert_eq!(server.requests().len(), 1);
}

#[test]
fn a_server_that_never_recovers_fails_after_the_retries() {
    let server = Server::new(|_, _, _| soon(500));
    let client = connect(&Options { lmm_retries: 3, ..server.options() }, None).unwrap().unwrap();
    assert!(matches!(ask(&client, None), Err(AskError::Failed(message)) if message.contains("500")));
    assert_eq!(server.requests().len(), 4);
}

#[test]
fn a_slow_server_runs_into_the_time_out() {
    // Longer than any test takes, so that no machine waits to its end.
    let server = Server::new(|_, _, _| ok("{}").delay(Duration::from_secs(3600)));
    let options = Options { lmm_timeout_s: 1, lmm_retries: 0, ..server.options() };
    let client = connect(&options, None).unwrap().unwrap();
    let AskError::Failed(message) = ask(&client, None).unwrap_err() else { panic!() };
    assert!(message.contains("--lmm-timeout-s"), "{message}");
}

#[test]
fn refusals_are_told_apart_from_failures() {
    let refusal = json!({ "choices": [{ "finish_reason": "stop",
        "message": { "role": "assistant", "content": null, "refusal": "I can't help with that." } }] });
    let filtered = json!({ "choices": [{ "finish_reason": "content_filter", "message": { "content": "" } }] });
    let table = [
        Response::new(200).json(refusal),
        Response::new(200).json(filtered),
        Response::new(400).json(json!({ "error": { "message": "no", "code": "content_policy_violation" } })),
    ];
    for response in table {
        let server = Server::new(move |_, _, _| response.clone());
        assert!(matches!(server.ask().unwrap().content, ReplyContent::Refusal(_)));
        assert_eq!(server.requests().len(), 1, "a refusal is not asked again");
    }
    let thinking = json!({ "choices": [{ "finish_reason": "length", "message": { "content": "" } }] });
    let server = Server::new(move |_, _, _| Response::new(200).json(thinking.clone()));
    assert!(matches!(server.ask().unwrap().content, ReplyContent::Empty(why) if why.contains("--lmm-max-tokens")));
}

#[test]
fn what_no_repetition_mends_is_fatal_at_once() {
    let quota = Response::new(429)
        .json(json!({ "error": { "message": "You exceeded your quota", "code": "insufficient_quota" } }));
    let table = [
        (error(401, "Incorrect API key"), "OPENAI_API_KEY"),
        (error(404, "The model `test-model` does not exist"), "--lmm-model"),
        (quota, "quota"),
        (Response::new(301).header("location", "https://elsewhere"), "--lmm-url"),
    ];
    for (response, named) in table {
        let server = Server::new(move |_, _, _| response.clone());
        let AskError::Fatal(message) = server.ask().unwrap_err() else { panic!("{named}") };
        assert!(message.contains(named), "{message}");
        assert_eq!(server.requests().len(), 1);
    }
}

#[test]
fn a_server_that_is_not_there_is_fatal() {
    let options = Options {
        lmm_url: Some("http://127.0.0.1:9/v1".into()),
        lmm_model: Some("m".into()),
        lmm_retries: 0,
        ..small()
    };
    let client = connect(&options, None).unwrap().unwrap();
    assert!(matches!(ask(&client, None), Err(AskError::Fatal(message)) if message.contains("connect")));
}

#[test]
fn content_in_parts_is_read_as_text() {
    let content = json!([{ "type": "text", "text": "{\"a\"" }, { "type": "text", "text": ":1}" }]);
    let parts = json!({ "choices": [{ "message": { "content": content } }] });
    let server = Server::new(move |_, _, _| Response::new(200).json(parts.clone()));
    let reply = server.ask().unwrap();
    assert_eq!((reply.content, reply.usage), (ReplyContent::Text("{\"a\":1}".into()), None));
}

#[test]
fn nothing_is_configured_without_a_url_and_bad_ones_are_refused() {
    assert!(connect(&small(), None).unwrap().is_none());
    let options_for = |url: &str, model: Option<&str>| {
        let options = Options { lmm_url: Some(url.into()), lmm_model: model.map(str::to_owned), ..small() };
        connect(&options, None).map(|_| ())
    };
    assert!(matches!(options_for("localhost:11434", Some("m")), Err(ClientError::Url { .. })));
    assert!(matches!(options_for("file:///etc", Some("m")), Err(ClientError::Url { .. })));
    assert!(matches!(options_for("http://localhost", None), Err(ClientError::NoModel)));
    assert!(matches!(options_for("http://h/v1#chat", Some("m")), Err(ClientError::Fragment)));
    for url in ["ftp://user:KEY@host/v1?key=KEY", "http://user:KEY@host/v1", "https://KEY@host/v1", "http://:KEY@h/v1"]
    {
        let error = options_for(&url.replace("KEY", CANARY), Some("m")).unwrap_err();
        assert!(matches!(error, ClientError::Url { .. } | ClientError::Credentials), "{url}: {error}");
        assert!(!format!("{error} {error:?}").contains(CANARY), "{error}");
    }
}

#[test]
fn the_key_appears_nowhere_but_in_its_header() {
    let folder = tempfile::tempdir().unwrap();
    // A server that sends everything it got back: in errors, in answers, in refusals.
    let server = Server::new(|count, _, request| {
        let header = request.header("authorization").unwrap().to_owned();
        assert_eq!(header, format!("Bearer {CANARY}"));
        match count {
            0 => error(500, &format!("no luck with {header}")).header("retry-after-ms", "1"),
            1 => {
                let mut answer = good_answer(a("wood"));
                answer["caption"] = json!(format!("sent with {header}"));
                ok(&answer.to_string())
            }
            2 => ok(&header),
            _ => error(401, &format!("Incorrect API key provided: {header}")),
        }
    });
    let key = ApiKey::new(CANARY).unwrap();
    assert!(!format!("{key:?}").contains(CANARY));
    let options = Options { lmm_parallel: 1, ..server.options() };
    let client = connect(&options, Some(key)).unwrap().unwrap();
    let prompts = Prompts::builtin();
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    let queries = prepare(&views, &prompts, &options);
    let result = queries.run(
        &recordings(folder.path()),
        Some(&client),
        &Budget::new(None, None),
        gprop::words::progress::Progress::HIDDEN,
    );
    let error = result.unwrap_err();
    assert!(matches!(error, QueryError::Endpoint { .. }), "{error}");
    let mut texts = vec![format!("{error} {error:?}")];
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        texts.push(std::fs::read_to_string(entry.unwrap().path()).unwrap());
    }
    assert_eq!(texts.len(), 2, "one answer was recorded");
    assert!(texts[1].contains("sent with Bearer [key]"), "{texts:?}");
    for text in texts {
        assert!(!text.contains(CANARY) && !text.to_lowercase().contains("authorization"), "{text}");
    }
}

/// Otherwise the word would be cut out of answers, which could then not be used.
#[test]
fn a_placeholder_for_a_key_stays_in_answers() {
    let server = Server::new(|_, _, _| ok(&good_answer(a("wood")).to_string()));
    let key = ApiKey::new("none").unwrap();
    let options = Options { lmm_parallel: 1, ..server.options() };
    let client = connect(&options, Some(key)).unwrap().unwrap();
    let (prompts, folder) = (Prompts::builtin(), tempfile::tempdir().unwrap());
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let result = queries.run(
        &recordings(folder.path()),
        Some(&client),
        &Budget::new(None, None),
        gprop::words::progress::Progress::HIDDEN,
    );
    assert_eq!(result.unwrap().answers.failed().count(), 0);
    let recorded = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    for path in recorded.filter(|path| path.extension().is_some_and(|end| end == "json")) {
        assert!(std::fs::read_to_string(&path).unwrap().contains("none"));
    }
}

#[test]
fn five_hundred_queries_with_faults_end_with_five_hundred_answers_each_paid_once() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::new(|count, _, _| match count % 20 {
        7 => soon([429, 500, 503][count % 3]),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    let options = Options { lmm_parallel: 8, ..server.options() };
    let client = connect(&options, None).unwrap().unwrap();
    let prompts = Prompts::builtin();
    let queries = prepare(&[grid(500)], &prompts, &options);
    let outcome = run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
    assert_eq!(outcome.answers.all.len(), 500);
    assert_eq!(outcome.answers.failed().count(), 0);
    assert_eq!(recordings(folder.path()).len(), 500);
    // Those that failed with 500 or 503 may have been billed, those with 429 were not.
    assert!(outcome.spent.requests >= 500, "{:?}", outcome.spent);
    assert_eq!(outcome.spent.requests - outcome.spent.unanswered, 500);
    let pictures: std::collections::BTreeSet<String> = server
        .requests()
        .iter()
        .map(|body| body["messages"][0]["content"][1]["image_url"]["url"].to_string())
        .collect();
    assert_eq!(pictures.len(), 500);
    let answered = server.requests().len() - server.requests().len().div_ceil(20);
    assert!(answered.abs_diff(500) <= 1, "{answered} were charged");
    // Everything is recorded: a second run asks nothing.
    let before = server.requests().len();
    run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
    assert_eq!(server.requests().len(), before);
}

#[test]
fn an_endpoint_failure_of_one_segment_leaves_the_others_answered() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::new(|count, _, _| match count {
        0 => error(418, "I am a teapot"),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    let options = Options { lmm_parallel: 1, ..server.options() };
    let client = connect(&options, None).unwrap().unwrap();
    let prompts = Prompts::builtin();
    let outcome =
        run(&prepare(&[two_segments("000", 80, 80)], &prompts, &options), &recordings(folder.path()), Some(&client))
            .unwrap();
    assert!(matches!(&outcome.answers.all[0].outcome, Outcome::Failed(Failure::Endpoint { .. })));
    assert!(matches!(&outcome.answers.all[1].outcome, Outcome::Answered(_)));
}
