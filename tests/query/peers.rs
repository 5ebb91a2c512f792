//! The client against mock servers of other projects, which `scripts/test-peers` installs; a test says so if its server
//! is not installed.

use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use gprop::query::{Options, Prompts, QueryError};
use serde_json::{Value, json};

use super::batch_api::Place;
use super::{a, connect, good_answer, grid, prepare, recordings, run, small};
use crate::support::skipped;

/// A server process, ended with the test.
struct Peer {
    child: Child,
    port: u16,
}

impl Peer {
    /// Starts what `command` makes for a free port and waits until it listens.
    fn start(command: impl FnOnce(u16) -> Command) -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let child = command(port).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let peer = Self { child, port };
        // It is another program: it usually starts to listen within about a second.
        let start = Instant::now();
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(start.elapsed() < Duration::from_secs(60), "the peer does not listen");
            std::thread::sleep(Duration::from_millis(100));
        }
        peer
    }

    fn url(&self, path: &str) -> String {
        format!("http://127.0.0.1:{}{path}", self.port)
    }

    fn options(&self) -> Options {
        Options { lmm_url: Some(self.url("/v1")), lmm_model: Some("gpt-4o".into()), lmm_parallel: 8, ..small() }
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn peers() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("target/peers")
}

/// llmock from PyPI; `None`, with a message, if it is not installed.
fn llmock(test: &str, arguments: &[&str]) -> Option<Command> {
    let packages = peers().join("python");
    let program = packages.join("bin/llmock");
    if !program.is_file() {
        skipped(test, "llmock is not installed; scripts/test-peers does that");
        return None;
    }
    let mut command = Command::new(program);
    command.env("PYTHONPATH", packages).args(arguments);
    Some(command)
}

/// aimock from npm with one fixture that answers every question with `answer`; `None`, with a message, if it is not
/// installed.
fn aimock(test: &str, folder: &Path, answer: &Value, arguments: &[&str]) -> Option<Command> {
    let program = peers().join("node_modules/.bin/llmock");
    if !program.is_file() {
        skipped(test, "aimock is not installed; scripts/test-peers does that");
        return None;
    }
    let fixture = folder.join("fixture.json");
    let one =
        json!({ "match": { "userMessage": "materials engineer" }, "response": { "content": answer.to_string() } });
    std::fs::write(&fixture, json!({ "fixtures": [one] }).to_string()).unwrap();
    let mut command = Command::new(program);
    command.arg("--fixtures").arg(fixture).args(["--strict", "--journal-max", "0"]).args(arguments);
    Some(command)
}

fn http() -> reqwest::Client {
    // reqwest wants one even for connections without TLS; another test may have named it already.
    let _ = rustls::crypto::ring::default_provider().install_default();
    reqwest::Client::new()
}

fn post(url: &str, body: &Value) {
    let send = async { http().post(url).body(body.to_string()).send().await };
    let response = tokio::runtime::Runtime::new().unwrap().block_on(send).unwrap();
    assert!(response.status().is_success(), "{response:?}");
}

fn get(url: &str) -> Value {
    let fetch = async { http().get(url).send().await.unwrap().json().await };
    tokio::runtime::Runtime::new().unwrap().block_on(fetch).unwrap()
}

fn verdict(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{output:?}"))
}

#[test]
fn llmock_finds_the_client_well_behaved_over_five_hundred_queries_with_faults() {
    let name = "llmock_finds_the_client_well_behaved_over_five_hundred_queries_with_faults";
    let faults = ["--error-rate", "429=0.02", "--error-rate", "500=0.02", "--error-rate", "503=0.01"];
    let Some(mut command) = llmock(name, &["serve"]) else { return };
    let peer = Peer::start(|port| {
        command.args(["--port", &port.to_string()]).args(faults);
        command
    });
    let said = json!({ "type": "reply", "text": good_answer(a("wood")).to_string(), "times": null });
    post(&peer.url("/_llmock/scenario"), &json!({ "behaviors": [said] }));

    let folder = tempfile::tempdir().unwrap();
    let (prompts, options) = (Prompts::builtin(), peer.options());
    let client = connect(&options, None).unwrap().unwrap();
    let queries = prepare(&[grid(500)], &prompts, &options);
    let outcome = run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
    assert_eq!((outcome.answers.all.len(), outcome.answers.failed().count()), (500, 0));
    assert_eq!(recordings(folder.path()).len(), 500);

    let report = llmock(name, &["report", "--strict", "--json", "--url", &peer.url("")]).unwrap().output().unwrap();
    let verdict = verdict(&report);
    assert!(report.status.success(), "{verdict:#}");
    assert_eq!((&verdict["passed"], &verdict["findings"]), (&json!(true), &json!([])));
    assert_eq!(verdict["calls"], 500, "each question was one call");
    assert!(verdict["faults_injected"].as_u64().unwrap() > 0, "the faults were there: {verdict}");
    let answered = verdict["attempts"].as_u64().unwrap() - verdict["faults_injected"].as_u64().unwrap();
    assert_eq!(answered, 500, "and each was answered, and so paid for, once");
}

#[test]
fn llmock_finds_no_fault_with_a_client_that_is_told_to_wait() {
    let name = "llmock_finds_no_fault_with_a_client_that_is_told_to_wait";
    let Some(mut command) = llmock(name, &["serve"]) else { return };
    let peer = Peer::start(|port| {
        command.args(["--port", &port.to_string()]);
        command
    });
    let storm = json!({ "type": "fail", "status": 429, "retry_after": 1.5, "times": 6 });
    let broken = json!({ "type": "fail", "status": 400, "message": "response_format is not supported", "times": 1 });
    let said = json!({ "type": "reply", "text": good_answer(a("wood")).to_string(), "times": null });
    post(&peer.url("/_llmock/scenario"), &json!({ "behaviors": [storm, broken, said] }));

    let folder = tempfile::tempdir().unwrap();
    let (prompts, options) = (Prompts::builtin(), peer.options());
    let client = connect(&options, None).unwrap().unwrap();
    let outcome = run(&prepare(&[grid(3)], &prompts, &options), &recordings(folder.path()), Some(&client)).unwrap();
    assert_eq!(outcome.answers.failed().count(), 0);
    let report = llmock(name, &["report", "--strict", "--json", "--url", &peer.url("")]).unwrap().output().unwrap();
    assert!(report.status.success(), "{:#}", verdict(&report));
}

#[test]
fn aimock_answers_through_rate_limits_cut_connections_and_broken_json() {
    let name = "aimock_answers_through_rate_limits_cut_connections_and_broken_json";
    let folder = tempfile::tempdir().unwrap();
    let chaos = ["--chaos-ratelimit", "0.03", "--chaos-disconnect", "0.03", "--chaos-malformed", "0.03"];
    let Some(mut command) = aimock(name, folder.path(), &good_answer(a("wood")), &chaos) else { return };
    let peer = Peer::start(|port| {
        command.args(["--port", &port.to_string()]);
        command
    });
    let (prompts, options) = (Prompts::builtin(), peer.options());
    let client = connect(&options, None).unwrap().unwrap();
    let recorded = folder.path().join("recorded");
    let queries = prepare(&[grid(100)], &prompts, &options);
    let outcome = run(&queries, &recordings(&recorded), Some(&client)).unwrap();
    assert_eq!((outcome.answers.all.len(), outcome.answers.failed().count()), (100, 0));
    assert_eq!(recordings(&recorded).len(), 100);
    let journal = get(&peer.url("/__aimock/journal?path=/v1/chat/completions"));
    let requests = journal.as_array().unwrap();
    assert!(requests.len() > 100, "the faults were there");
    let format = &requests[0]["body"]["response_format"]["type"];
    assert_eq!(format, "json_schema");
}

#[test]
fn aimock_works_off_a_batch_and_its_answers_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let answer = good_answer(a("wood"));
    let Some(mut command) = aimock("aimock_works_off_a_batch_and_its_answers_are_checked", folder.path(), &answer, &[])
    else {
        return;
    };
    let peer = Peer::start(|port| {
        command.args(["--port", &port.to_string()]);
        command
    });
    let (place, options) = (Place::new(), peer.options());
    assert_eq!(place.query_session(&options).submit().unwrap().sent, 3);
    // The other program processes it at its own pace, usually within about a second.
    let start = Instant::now();
    let ended = loop {
        let collected = place.query_session(&options).collect().unwrap();
        match collected.require_all() {
            Err(QueryError::BatchApiRunning { .. }) if start.elapsed() < Duration::from_secs(60) => {
                std::thread::sleep(Duration::from_millis(100));
            }
            _ => break collected,
        }
    };
    // It answers every question of a batch with the text "Mock batch completion": a reply that is not
    // an answer.
    let why: Vec<_> = ended.failed.into_iter().collect();
    assert!(matches!(&why[..], [(reason, 3)] if reason.contains("no JSON")), "{why:?}");
    let session = place.query_session(&options);
    assert_eq!(session.preview(&session.queries().unwrap()).recorded, 1, "the one that was asked at once");
}
