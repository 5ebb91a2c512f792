//! A server with the Batch API, whose state each test sets.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::ask::rounds::Subject;
use gprop::query::session::{Folders, NumberedView, QuerySession, QueryView, Subjects, WholeViews};
use gprop::query::{AnswerSource, Context, Options, QueryError};
use gprop::words::progress::Progress;
use gprop::workdir::WorkDir;
use serde_json::{Value, json};

use super::{View, a, completion, good_answer, small, two_segments};
use crate::support::server::{MockServer, Response, json_of};

/// The requests that the server has received, and the state of its batch.
#[derive(Default)]
struct Held {
    /// The lines of every uploaded file.
    uploads: Vec<Vec<Value>>,
    started: usize,
    status: Value,
    output: String,
    errors: String,
    /// The path of a job or file that the server no longer has.
    lost: Option<&'static str>,
}

pub struct BatchApiServer {
    mock: MockServer,
    held: Arc<Mutex<Held>>,
}

impl BatchApiServer {
    /// A server that answers Chat Completions with `answer` and accepts every batch.
    pub fn new(answer: &Value) -> Self {
        let held = Arc::new(Mutex::new(Held::default()));
        let chat = completion(&answer.to_string());
        let state = Arc::clone(&held);
        let mock = MockServer::new(move |request| {
            let held = &mut *state.lock().unwrap();
            match (request.method.as_str(), request.path()) {
                (_, path) if held.lost.is_some_and(|lost| path == lost) => Response::new(404),
                (_, "/v1/chat/completions") => json_body(&chat),
                ("POST", "/v1/files") => {
                    held.uploads.push(lines_of_upload(&request.body));
                    json_body(json!({ "id": format!("file-{}", held.uploads.len()) }))
                }
                ("POST", "/v1/batches") => {
                    let order = json_of(request);
                    assert_eq!(order["input_file_id"], format!("file-{}", held.uploads.len()));
                    assert_eq!(
                        (&order["endpoint"], &order["completion_window"]),
                        (&json!("/v1/chat/completions"), &json!("24h"))
                    );
                    held.started += 1;
                    json_body(json!({ "id": format!("batch-{}", held.started), "status": "validating" }))
                }
                ("GET", "/v1/files/output/content") => Response::new(200).text(&held.output),
                ("GET", "/v1/files/errors/content") => Response::new(200).text(&held.errors),
                ("GET", path) if path.starts_with("/v1/batches/batch-") => json_body(&held.status),
                _ => Response::new(404),
            }
        });
        Self { mock, held }
    }

    pub fn set(&self, status: Value, output: &[Value], errors: &[Value]) {
        let mut held = self.held.lock().unwrap();
        let text = |lines: &[Value]| lines.iter().map(|line| format!("{line}\n")).collect::<String>();
        (held.status, held.output, held.errors) = (status, text(output), text(errors));
    }

    /// Answers requests for this path with 404 from now on, and no others.
    pub fn lose(&self, path: Option<&'static str>) {
        self.held.lock().unwrap().lost = path;
    }

    /// The `custom_id`s of the last upload.
    pub fn sent(&self) -> Vec<String> {
        let held = self.held.lock().unwrap();
        held.uploads.last().unwrap().iter().map(|line| line["custom_id"].as_str().unwrap().to_owned()).collect()
    }

    pub fn uploads(&self) -> usize {
        self.held.lock().unwrap().uploads.len()
    }

    pub fn options(&self) -> Options {
        Options {
            lmm_url: Some(format!("{}/v1", self.mock.uri())),
            lmm_model: Some("gpt-4o".into()),
            lmm_retries: 0,
            ..small()
        }
    }
}

fn json_body(value: impl serde::Serialize) -> Response {
    Response::new(200).json(value)
}

/// The JSON lines in a multipart body.
fn lines_of_upload(body: &[u8]) -> Vec<Value> {
    let text = String::from_utf8_lossy(body);
    assert!(text.contains("name=\"purpose\"\r\n\r\nbatch\r\n") && text.contains("filename=\"batch.jsonl\""));
    text.lines().filter(|line| line.starts_with('{')).map(|line| serde_json::from_str(line).unwrap()).collect()
}

pub fn answered(custom_id: &str, answer: &Value) -> Value {
    json!({ "id": "r", "custom_id": custom_id, "error": null,
            "response": { "status_code": 200, "request_id": "q", "body": completion(&answer.to_string()) } })
}

pub fn completed() -> Value {
    json!({ "id": "batch-1", "status": "completed", "output_file_id": "output", "error_file_id": null })
}

/// Views with their own folder.
pub struct Place {
    home: tempfile::TempDir,
    views: Vec<View>,
    work: WorkDir,
}

impl Place {
    /// Two views of two segments each.
    pub fn new() -> Self {
        Self::of(vec![two_segments("000", 80, 80), two_segments("001", 90, 80)])
    }

    pub(super) fn of(views: Vec<View>) -> Self {
        let home = tempfile::tempdir().unwrap();
        let work = WorkDir::open(&home.path().join("gprop")).unwrap();
        Self { views, home, work }
    }

    /// A session about every segment.
    pub fn query_session<'a>(&'a self, options: &'a Options) -> QuerySession<'a> {
        let segments =
            (0..).zip(&self.views).flat_map(|(n, view)| view.segments.segments.iter().map(move |of| (n, of.id)));
        self.session_about(options, segments.map(|(view, id)| Subject::segment(view, id)).collect(), 1)
    }

    pub fn session_about<'a>(
        &'a self,
        options: &'a Options,
        subjects: Vec<Subject>,
        ask_views: usize,
    ) -> QuerySession<'a> {
        self.session(options, subjects, ask_views, WholeViews::default())
    }

    /// A session about the object in the first view, whose parts these are.
    pub fn session_about_object<'a>(&'a self, options: &'a Options, parts: Vec<Subject>) -> QuerySession<'a> {
        let first = NumberedView { view: 0, map: Cow::Borrowed(&self.views[0].segments.map) };
        self.session(options, parts, 1, WholeViews { recognition: vec![first], ..WholeViews::default() })
    }

    fn session<'a>(
        &'a self,
        options: &'a Options,
        subjects: Vec<Subject>,
        ask_views: usize,
        whole: WholeViews<'a>,
    ) -> QuerySession<'a> {
        let view = |view: &'a View| QueryView {
            name: view.name,
            photo: view.photo.clone(),
            maps: vec![Cow::Borrowed(&view.segments.map)],
        };
        let views = self.views.iter().map(view).collect();
        let (home, hidden) = (self.home.path(), Progress::HIDDEN);
        let about = if whole.recognition.is_empty() { AskAbout::Segments } else { AskAbout::Parts };
        let (regions, found, budget) = (Vec::new(), Vec::new(), None);
        let subjects = Subjects { views, subjects, ask_views, about, whole, regions, found, budget };
        let folders = Folders { home, work: &self.work };
        QuerySession::new(options, subjects, MaterialLibrary::builtin(), folders, Ok(()), hidden).unwrap()
    }

    fn recorded(&self) -> Vec<PathBuf> {
        let folder: &Path = &self.home.path().join("recorded");
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }
}

fn good() -> Value {
    good_answer(a("wood"))
}

#[test]
fn a_batch_goes_out_and_its_answers_are_replayed() {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let options = server.options();
    let sent = place.query_session(&options).submit().unwrap();
    assert_eq!((sent.sent, sent.waiting), (3, 0), "the first of four was asked at once");
    assert_eq!(place.recorded().len(), 1);
    let again = place.query_session(&options).submit().unwrap();
    assert_eq!((again.sent, again.waiting), (0, 3), "what is under way is not paid for twice");
    assert_eq!(server.uploads(), 1);

    let line = server.held.lock().unwrap().uploads[0][0].clone();
    assert_eq!((&line["method"], &line["url"]), (&json!("POST"), &json!("/v1/chat/completions")));
    assert_eq!(line["body"]["model"], "gpt-4o");
    assert_eq!(line["body"]["response_format"]["type"], "json_schema");

    let counts = json!({ "total": 3, "completed": 1, "failed": 0 });
    server.set(json!({ "id": "batch-1", "status": "in_progress", "request_counts": counts }), &[], &[]);
    let running = place.query_session(&options).collect().unwrap();
    let error = running.require_all().unwrap_err();
    assert!(matches!(error, QueryError::BatchApiRunning { running: 1, done: 1, total: 3 }), "{error}");

    let mut output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good())).collect();
    output.reverse();
    server.set(completed(), &output, &[]);
    let collected = place.query_session(&options).collect().unwrap();
    collected.require_all().unwrap();
    assert_eq!(collected.recorded, 3);
    let names: Vec<_> =
        place.recorded().iter().map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    assert!(server.sent().iter().all(|id| names.contains(id)), "a custom_id is its recording's key");

    let replay = Options { answers: AnswerSource::Replay, lmm_url: None, ..options.clone() };
    let session = place.query_session(&replay);
    let answers = session.answer_parts(None, &|_| Ok(())).unwrap().answers;
    assert_eq!((answers.all.len(), answers.failed().count()), (4, 0));
    assert!(place.query_session(&options).collect().is_err(), "nothing is waiting any more");
    assert_eq!(place.query_session(&options).submit().unwrap().sent, 0, "nothing is open any more");
}

#[test]
fn what_was_asked_at_once_is_not_sent_too() {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let options = Options { answers: AnswerSource::Live, ..server.options() };
    assert_eq!(place.query_session(&options).submit().unwrap().sent, 3, "the first of four was asked at once");
    let at_once = place.recorded()[0].file_stem().unwrap().to_string_lossy().into_owned();
    assert!(!server.sent().contains(&at_once), "paid twice");
}

/// A submission whose three answers have come, and its options.
fn answered_submission() -> (BatchApiServer, Place, Options) {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let options = server.options();
    place.query_session(&options).submit().unwrap();
    let output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good())).collect();
    server.set(completed(), &output, &[]);
    (server, place, options)
}

/// Checks that three answers are not recorded with these options, and wait.
#[track_caller]
fn assert_nothing_is_collected(place: &Place, other: &Options) {
    let before = place.recorded();
    let error = place.query_session(other).collect().unwrap().require_all().unwrap_err();
    assert!(matches!(error, QueryError::BatchApiOthers { questions: 3 }), "{error}");
    assert_eq!(place.recorded(), before);
}

/// Otherwise its answers would be recorded as the other model's.
#[test]
fn a_batch_is_collected_only_for_the_model_that_was_asked() {
    let (_server, place, options) = answered_submission();
    for other in [
        Options { lmm_model: Some("gpt-4o-mini".to_owned()), ..options.clone() },
        Options { lmm_temperature: 0.7, ..options.clone() },
    ] {
        assert_nothing_is_collected(&place, &other);
    }
    assert_eq!(place.query_session(&options).collect().unwrap().recorded, 3, "they still wait");
}

/// Otherwise answers that were paid for would be lost.
#[test]
fn answers_to_questions_of_other_options_wait_until_these_are_given_again() {
    let (_server, place, options) = answered_submission();
    let other = Options { context: Context::Local, ..options.clone() };
    for _ in 0..2 {
        assert_nothing_is_collected(&place, &other);
    }
    assert_eq!(place.query_session(&options).collect().unwrap().recorded, 3);
    assert!(
        matches!(place.query_session(&options).collect(), Err(error) if error.to_string().contains("waiting to be collected"))
    );
}

#[test]
fn an_expired_batch_leaves_what_it_answered_and_the_rest_is_sent_again() {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let options = server.options();
    place.query_session(&options).submit().unwrap();
    let ids = server.sent();
    let expired = |id: &str| {
        let why = json!({ "code": "batch_expired", "message": "This request could not be executed before the completion window expired." });
        json!({ "id": "r", "custom_id": id, "response": null, "error": why })
    };
    let status = json!({ "id": "batch-1", "status": "expired", "output_file_id": "output", "error_file_id": "errors" });
    server.set(status, &[answered(&ids[1], &good())], &[expired(&ids[0]), expired(&ids[2])]);
    let collected = place.query_session(&options).collect().unwrap();
    assert_eq!(collected.recorded, 1);
    let error = collected.require_all().unwrap_err();
    assert!(matches!(&error, QueryError::BatchApiPartial { failed: 2, total: 3, .. }), "{error}");
    assert!(error.to_string().contains("batch_expired") && error.to_string().contains("(2)"), "{error}");

    let again = place.query_session(&options).submit().unwrap();
    assert_eq!(again.sent, 1, "of the two that are left the first is asked at once");
    assert!(ids.contains(&server.sent()[0]) && server.sent()[0] != ids[1]);
}

#[test]
fn answers_that_are_none_are_not_recorded_and_those_that_never_came_are_told() {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let options = server.options();
    place.query_session(&options).submit().unwrap();
    let ids = server.sent();
    let refused = json!({ "id": "r", "custom_id": ids[1], "error": null, "response": { "status_code": 400,
        "body": { "error": { "message": "Unsupported value: 'temperature'" } } } });
    server.set(completed(), &[answered(&ids[0], &json!({ "caption": "half an answer" })), refused], &[]);
    let collected = place.query_session(&options).collect().unwrap();
    assert_eq!((collected.recorded, collected.failed.values().sum::<usize>()), (0, 3));
    let reasons = collected.require_all().unwrap_err().to_string();
    for word in ["family", "temperature", "ended without an answer"] {
        assert!(reasons.contains(word), "no {word:?} in {reasons}");
    }
    assert_eq!(place.recorded().len(), 1);
}

/// Nor is it given up: another project's key, or another address, would lead to the same response.
#[test]
fn a_job_that_cannot_be_fetched_keeps_no_other_back() {
    let (server, mut place) = (BatchApiServer::new(&good()), Place::new());
    let options = server.options();
    place.query_session(&options).submit().unwrap();
    let first = server.sent();
    place.views.push(two_segments("002", 100, 80));
    place.query_session(&options).submit().unwrap();
    let output: Vec<Value> = server.sent().iter().map(|id| answered(id, &good())).collect();
    server.set(completed(), &output, &[]);

    server.lose(Some("/v1/batches/batch-1"));
    let collected = place.query_session(&options).collect().unwrap();
    assert_eq!((collected.recorded, collected.failed.len()), (1, 0), "the second job's");
    let error = collected.require_all().unwrap_err();
    assert!(matches!(&error, QueryError::BatchApiUnfetched { jobs, .. } if jobs.len() == 1), "{error}");
    for word in ["job batch-1: status 404", "batch_api.json", "still wait"] {
        assert!(error.to_string().contains(word), "no {word:?} in {error}");
    }
    assert_eq!(place.query_session(&options).submit().unwrap().waiting, 3);

    let output: Vec<Value> = first.iter().map(|id| answered(id, &good())).collect();
    server.set(completed(), &output, &[]);
    server.lose(Some("/v1/files/output/content"));
    let collected = place.query_session(&options).collect().unwrap();
    assert_eq!((collected.recorded, collected.unfetched.len()), (0, 1));
    server.lose(None);
    server.set(completed(), &[json!({ "not": "a line of the API" })], &[]);
    let collected = place.query_session(&options).collect().unwrap();
    assert!(collected.unfetched["batch-1"].contains("line 1"), "{:?}", collected.unfetched);
    server.set(completed(), &output, &[]);
    let collected = place.query_session(&options).collect().unwrap();
    assert_eq!(collected.recorded, 3);
    collected.require_all().unwrap();
}

#[test]
fn a_replay_submits_nothing() {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let options = Options { answers: AnswerSource::Replay, ..server.options() };
    let error = place.query_session(&options).submit().unwrap_err();
    assert!(error.kind() == gprop::ErrorKind::Usage && error.to_string().contains("--answers replay"), "{error:#}");
    assert_eq!((server.uploads(), place.home.path().join("recorded").exists()), (0, false), "nothing was sent");
}

#[test]
fn a_batch_that_the_server_rejects_says_why() {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let options = server.options();
    place.query_session(&options).submit().unwrap();
    let errors = json!({ "object": "list", "data": [{ "code": "invalid_json_line", "message": "line 1 is no JSON", "line": 1 }] });
    server.set(json!({ "id": "batch-1", "status": "failed", "errors": errors }), &[], &[]);
    let error = place.query_session(&options).collect().unwrap().require_all().unwrap_err();
    assert!(error.to_string().contains("line 1 is no JSON (3)"), "{error}");
}

#[test]
fn no_question_is_asked_while_it_waits_in_an_earlier_submission() {
    let (server, mut place) = (BatchApiServer::new(&good()), Place::new());
    let options = server.options();
    assert_eq!(place.query_session(&options).submit().unwrap().sent, 3, "four questions, one of them asked at once");
    place.views.push(two_segments("002", 100, 80));
    let later = place.query_session(&options).submit().unwrap();
    assert_eq!((later.sent, later.waiting), (1, 3), "two new questions, one of them asked at once");
}

#[test]
fn a_batch_keeps_to_the_budget_at_half_the_price() {
    let (server, place) = (BatchApiServer::new(&good()), Place::new());
    let with_limit = |max_usd: f64| Options { max_usd: Some(max_usd), ..server.options() };
    let options = with_limit(100.0);
    let session = place.query_session(&options);
    let most = session.preview(&session.queries().unwrap()).cost.most_usd.unwrap();
    // One of the four at full price, three at half price: 2.5 of 4.
    let tight = with_limit(0.62 * most);
    assert!(place.query_session(&tight).submit().is_err());
    assert_eq!((server.uploads(), place.home.path().join("recorded").exists()), (0, false), "nothing was sent");
    let enough = with_limit(0.63 * most);
    assert_eq!(place.query_session(&enough).submit().unwrap().sent, 3);
}

#[test]
fn a_wrong_key_shows_before_anything_is_uploaded() {
    let (server, place) = (BatchApiServer::new(&json!("no answer")), Place::new());
    let options = Options { lmm_url: Some(format!("{}/elsewhere", server.mock.uri())), ..server.options() };
    let error = place.query_session(&options).submit().unwrap_err();
    assert!(error.to_string().contains("404"), "{error:#}");
    assert_eq!(server.uploads(), 0);
}
