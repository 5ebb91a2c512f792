//! `gprop answer`: a page on this machine, answers that are recorded as they are given, the mass after each; and what a
//! person answered beside what a model is asked.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use gprop::local_server::{Event, LocalServer, Site};
use gprop::query::{AnswerSource, Failure, Options, Outcome, Prompts, exchange};
use gprop::words::progress::CancelToken;
use serde_json::{Value, json};

use super::exchange::export;
use super::{Scripted, a, good_answer, prepare, recordings, run, small, text, two_segments};
use crate::batch::ball::Balls;
use crate::run::gprop;
use crate::support::browser::Page;

/// The status and the body of a reply to a request whose head is written out.
fn request(host: &str, head: &str, body: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(host).unwrap();
    // A server that refuses a request need not read it to its end.
    let _ = stream.write_all(format!("{head}\r\nContent-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
    let mut reply = Vec::new();
    let _ = stream.read_to_end(&mut reply);
    let reply = String::from_utf8_lossy(&reply).into_owned();
    let status = reply.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    (status, reply.split_once("\r\n\r\n").map_or_else(String::new, |(_, body)| body.to_owned()))
}

/// Host and token in an address such as `http://127.0.0.1:4000/token/`.
fn parts_of(url: &str) -> (String, String) {
    let rest = url.strip_prefix("http://").unwrap().strip_suffix('/').unwrap();
    let (host, token) = rest.split_once('/').unwrap();
    assert!(host.starts_with("127.0.0.1:") && token.len() == 32, "{url}");
    (host.to_owned(), token.to_owned())
}

#[test]
fn only_the_page_itself_is_served_and_only_to_who_knows_the_token() {
    let pictures = [("sheets/a.jpg".to_owned(), b"picture".to_vec())].into();
    let site = Site { page: "<p>page</p>".to_owned(), pictures };
    let server = LocalServer::start(0, site, CancelToken::default()).unwrap();
    let (host, token) = parts_of(server.url());
    let status = |head: &str| request(&host, head, "").0;
    let get = |path: &str| status(&format!("GET {path} HTTP/1.1\r\nHost: {host}"));
    assert_eq!(request(&host, &format!("GET /{token}/ HTTP/1.1\r\nHost: {host}"), ""), (200, "<p>page</p>".to_owned()));
    assert_eq!(request(&host, &format!("GET /{token}/sheets/a.jpg HTTP/1.1\r\nHost: {host}"), "").1, "picture");
    for path in [
        "/".to_owned(),
        format!("/{}/", "0".repeat(32)),
        format!("/{}/", &token[1..]),
        format!("/{token}"),
        format!("/{token}/sheets/b.jpg"),
        format!("/{token}/../../etc/passwd"),
        format!("/{token}//etc/passwd"),
        format!("/{token}/answers"),
    ] {
        assert_eq!(get(&path), 404, "{path}");
    }
    // A name that someone points to 127.0.0.1, no host, two of them.
    let port = host.rsplit(':').next().unwrap();
    for hosts in [
        format!("Host: rebound.example:{port}"),
        format!("Host: localhost:{port}"),
        "Accept: */*".to_owned(),
        format!("Host: {host}\r\nHost: rebound.example"),
    ] {
        let status = status(&format!("GET /{token}/ HTTP/1.1\r\n{hosts}"));
        assert!([400, 421].contains(&status), "{hosts}: {status}");
    }
    let post = |more: &str, body: &str| {
        request(&host, &format!("POST /{token}/answers HTTP/1.1\r\nHost: {host}\r\n{more}"), body).0
    };
    let json = "Content-Type: application/json";
    assert_eq!(post(&format!("{json}\r\nOrigin: http://elsewhere.example"), "{}"), 403);
    assert_eq!(post(&format!("{json}\r\nOrigin: null"), "{}"), 403);
    assert_eq!(post("Content-Type: text/plain", "{}"), 415, "what a form of another page may send");
    assert_eq!(post(json, &" ".repeat((1 << 20) + 1)), 413);
    for method in ["PUT", "DELETE", "OPTIONS", "HEAD", "TRACE"] {
        assert_eq!(status(&format!("{method} /{token}/ HTTP/1.1\r\nHost: {host}")), 405, "{method}");
    }
    let long = format!("GET /{token}/ HTTP/1.1\r\nHost: {host}\r\nCookie: {}", "a".repeat(1 << 16));
    assert_ne!(status(&long), 200);
    assert!(server.next_now().is_none(), "nothing that was refused is an event");

    std::thread::scope(|scope| {
        let posted = scope.spawn(|| {
            let origin = format!("{json}\r\nOrigin: http://{host}");
            request(&host, &format!("POST /{token}/answers HTTP/1.1\r\nHost: {host}\r\n{origin}"), r#"{"a":1}"#)
        });
        let Event::Posted(post) = server.next() else { panic!("nobody pressed Ctrl-C") };
        assert_eq!(post.body, br#"{"a":1}"#);
        post.reply("[1]".to_owned());
        assert_eq!(posted.join().unwrap(), (200, "[1]".to_owned()));
    });
    drop(server);
    assert!(TcpStream::connect(&host).is_err(), "a server that is dropped is gone");
}

/// `gprop answer` on a scene, with the address that it printed.
struct Sitting {
    process: Child,
    url: String,
}

impl Sitting {
    fn start(scene: &Path) -> Self {
        let mut command = gprop();
        let command = command.env_remove("OPENAI_API_KEY").env("USER", "Ada").arg("answer").arg(scene);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map(Result::unwrap);
        let said = lines.find(|line| line.contains("http://")).expect("the address is printed");
        let url = said.split(' ').find(|word| word.starts_with("http://")).unwrap().to_owned();
        // It must not wait for someone to read its messages.
        std::thread::spawn(move || lines.for_each(drop));
        Self { process, url }
    }

    fn get(&self, path: &str) -> String {
        let (host, token) = parts_of(&self.url);
        let (status, body) = request(&host, &format!("GET /{token}/{path} HTTP/1.1\r\nHost: {host}"), "");
        assert_eq!(status, 200, "{path}");
        body
    }

    /// The questions on the page.
    fn queries(&self) -> Vec<String> {
        let page = self.get("");
        let line = page.lines().find_map(|line| line.strip_prefix("const queries = ")).unwrap();
        let queries: Vec<Value> = serde_json::from_str(line.trim_end_matches(';')).unwrap();
        queries.iter().map(|query| query["query"].as_str().unwrap().to_owned()).collect()
    }

    fn post(&self, line: &Value) -> Value {
        let (host, token) = parts_of(&self.url);
        let head = format!(
            "POST /{token}/answers HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nContent-Type: application/json"
        );
        let (status, body) = request(&host, &head, &line.to_string());
        assert_eq!(status, 200, "{body}");
        serde_json::from_str(&body).unwrap()
    }

    fn answer(&self, query: &str) -> Value {
        self.post(&json!({ "query": query, "answer": good_answer(a("wood")), "model": "Ada" }))
    }

    fn end(self) -> (Option<i32>, String) {
        let Output { status, stdout, .. } = self.process.wait_with_output().unwrap();
        (status.code(), String::from_utf8(stdout).unwrap())
    }
}

fn standing(reply: &Value) -> String {
    let sentences = reply["served"]["standing"].as_array().unwrap().iter();
    sentences.map(|one| one.as_str().unwrap()).collect::<Vec<_>>().join(" ")
}

fn recorded(scene: &Path) -> usize {
    fs::read_dir(scene.join("recorded")).map_or(0, Iterator::count)
}

#[test]
fn each_answer_is_recorded_as_it_is_given_and_the_command_ends_with_the_last() {
    let balls = Balls::new(1);
    let scene = balls.scene(0);
    let sitting = Sitting::start(&scene);
    let queries = sitting.queries();
    assert_eq!(queries.len(), 6);
    assert!(sitting.get("").contains("There is no mass yet"));
    assert!(!sitting.get(&format!("sheets/{}.jpg", queries[0])).is_empty());
    let wrong = sitting.post(&json!({ "query": queries[0], "answer": { "material": "unobtainium" }, "model": "Ada" }));
    assert!(wrong["problem"].as_str().unwrap().contains("caption"), "{}", wrong["problem"]);
    assert_eq!(recorded(&scene), 0);
    let first = sitting.answer(&queries[0]);
    assert_eq!((recorded(&scene), &first["problem"]), (1, &Value::Null));
    let said = standing(&first);
    assert!(said.starts_with("1 of 6 questions answered. Mass so far: "), "{said}");
    assert!(said.contains("segments without an answer do not vote yet"), "{said}");

    // What was answered is kept when the user ends the command, which then goes on from there.
    let pid = sitting.process.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let (code, said) = sitting.end();
    assert!(code == Some(0) && said.starts_with("1 of 6 questions answered. Mass so far: "), "{code:?}: {said}");
    assert!(said.contains("`gprop answer ") && said.contains("--answers partial"), "{said}");
    for last in [&["--to", "parts"][..], &["--no-simulate"]] {
        let report = gprop().arg("run").arg(&scene).args(["--answers", "partial"]).args(last).output().unwrap();
        assert_eq!(report.status.code(), Some(0), "{}", String::from_utf8_lossy(&report.stderr));
        let said = String::from_utf8_lossy(&report.stdout);
        assert!(said.contains("PROVISIONAL  1 of 6 segments is answered;"), "{said}");
    }
    let record = fs::read_to_string(scene.join("gprop/run.json")).unwrap();
    assert!(record.contains("not answered yet: 5 segments"), "the report says what is open: {record}");

    let sitting = Sitting::start(&scene);
    let left = sitting.queries();
    assert_eq!(left, queries[1..]);
    let mut last = Value::Null;
    for (n, query) in left.iter().enumerate() {
        last = sitting.answer(query);
        assert_eq!(recorded(&scene), n + 2);
    }
    assert!(last["served"]["done"] == true && standing(&last).contains("Nothing is left to answer"), "{last}");
    let (code, said) = sitting.end();
    let next = format!("Go on with `gprop run {}`", scene.display());
    assert!(code == Some(0) && said.contains("6 of 6 questions answered. Mass: ") && said.contains(&next), "{said}");
    let replayed = gprop().arg("run").arg(&scene).args(["--answers", "replay", "--to", "parts"]).output().unwrap();
    assert_eq!(replayed.status.code(), Some(0), "{}", String::from_utf8_lossy(&replayed.stderr));
    let again = gprop().arg("answer").arg(&scene).output().unwrap();
    assert!(again.status.success() && String::from_utf8_lossy(&again.stdout).contains("6 of 6 questions answered"));
}

#[test]
fn the_served_page_goes_on_by_itself_and_says_how_the_mass_stands() {
    let balls = Balls::new(1);
    let mut sitting = Sitting::start(&balls.scene(0));
    let test = "the_served_page_goes_on_by_itself_and_says_how_the_mass_stands";
    let Some(page) = Page::open(test, &sitting.url, "#fields input") else {
        sitting.process.kill().unwrap();
        return;
    };
    let shown = |selector: &str| page.evaluate(&format!("document.querySelector({selector:?}).checkVisibility()"));
    assert_eq!((shown("#save"), shown("#standing")), (false.into(), true.into()));
    assert_eq!(page.evaluate("document.getElementById('name').value"), "Ada");
    let standing = "document.getElementById('standing').textContent";
    let wait_for = |words: &str| {
        let since = std::time::Instant::now();
        while !page.evaluate(standing).as_str().unwrap().contains(words) {
            assert!(since.elapsed().as_secs() < 60, "{}", page.evaluate(standing));
            page.settle();
        }
    };
    // Without a name, the first thing that is asked for is that.
    page.evaluate("at('name').value = ''; 0");
    page.click("#done");
    assert_eq!((page.evaluate("document.activeElement.id"), shown("#nameless")), ("name".into(), true.into()));
    "Ada".chars().for_each(|key| page.press_key(&key.to_string()));
    assert_eq!(shown("#nameless"), false);
    page.evaluate("focusOn(stops()[0]); 0");
    page.answer(&a("wood").chars().take(6).collect::<String>(), "a ball");
    wait_for("1 of 6 questions answered. Mass so far:");
    page.reload();
    page.wait_for("#fields input");
    assert_eq!(page.text("#state"), "1 of 6 answered", "what is recorded stays answered");
    page.evaluate("go(1); 0");
    for _ in 1..6 {
        page.answer(&a("wood").chars().take(6).collect::<String>(), "a ball");
    }
    wait_for("Nothing is left to answer");
    assert_eq!((shown("main"), shown("#standing")), (false.into(), true.into()));
    assert_eq!(page.complaints(), Vec::<String>::new());
    let (code, said) = sitting.end();
    assert!(code == Some(0) && said.contains("6 of 6 questions answered"), "{said}");
}

/// Answers to the first of two questions as a person or another program gives them, imported; how many the model is then asked.
fn asked_beside(by_hand: bool) -> (usize, Vec<String>) {
    let home = tempfile::tempdir().unwrap();
    let (out, folder) = (home.path().join("out"), home.path().join("recorded"));
    let (prompts, options) = (Prompts::builtin(), small());
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let store = recordings(&folder);
    export(&out, &queries, &store);
    let names = fs::read_to_string(out.join("answers.jsonl")).unwrap();
    let first: Value = serde_json::from_str(names.lines().next().unwrap()).unwrap();
    let answer =
        json!({ "query": first["query"], "answer": good_answer(a("wood")), "model": "Ada", "by_hand": by_hand });
    fs::write(out.join("answers.jsonl"), answer.to_string()).unwrap();
    let imported = exchange::import(&out, Some("scripted"), &queries, &store).unwrap();
    assert_eq!((imported.recorded, imported.by_hand), (1, usize::from(by_hand)));
    let model = Scripted::new(|_| text(good_answer(a("metal"))));
    let answers = run(&queries, &recordings(&folder), Some(&model)).unwrap().answers;
    let material = |outcome: &Outcome| match outcome {
        Outcome::Answered(answer) => answer.material.clone(),
        Outcome::Failed(failure) => panic!("{failure}"),
    };
    (model.count(), answers.all.iter().map(|answer| material(&answer.outcome)).collect())
}

#[test]
fn a_model_is_asked_only_what_no_person_answered() {
    assert_eq!(asked_beside(true), (1, vec![a("wood").to_owned(), a("metal").to_owned()]));
    assert_eq!(asked_beside(false), (2, vec![a("metal").to_owned(), a("metal").to_owned()]));
}

#[test]
fn what_has_no_answer_yet_is_left_open() {
    let home = tempfile::tempdir().unwrap();
    let (prompts, options) = (Prompts::builtin(), Options { answers: AnswerSource::Partial, ..small() });
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let model = Scripted::new(|_| text(good_answer(a("metal"))));
    let answers = run(&queries, &recordings(home.path()), Some(&model)).unwrap().answers;
    let open = Outcome::Failed(Failure::Unanswered);
    assert!(answers.all.len() == 2 && answers.all.iter().all(|answer| answer.outcome == open), "{answers:?}");
    assert_eq!(model.count(), 0, "nobody is asked");
}
