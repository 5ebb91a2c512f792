//! Servers that send too much, too slowly, too little, or something other than they declare.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, SystemTime};

use gprop::query::ask::asker::{AskError, Reply, ReplyContent};
use gprop::query::ask::budget::Budget;
use gprop::query::ask::cost::{Price, PriceTable};
use gprop::query::{Options, Outcome, Prompts, QueryError, Run};
use gprop::words::progress::Progress;
use serde_json::{Value, json};

use super::client::{Server, ask, error, ok};
use super::{a, completion, connect, good_answer, one_segment, prepare, recordings, small, two_segments};
use crate::support::server::{Listener, MockServer, Response, read_request};

/// A server that reads each request completely and then passes the connection to a closure.
pub struct RawServer {
    listener: Listener,
    requests: Arc<AtomicUsize>,
}

impl RawServer {
    /// `respond` gets the number of requests that came before. The connection closes when it returns.
    pub fn new(respond: impl Fn(usize, &mut TcpStream) + Send + Sync + 'static) -> Self {
        let requests = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&requests);
        let listener = Listener::new(move |mut stream| {
            if read_request(&mut stream).is_some() {
                respond(count.fetch_add(1, Ordering::SeqCst), &mut stream);
            }
        });
        Self { listener, requests }
    }

    pub fn options(&self) -> Options {
        let url = format!("{}/v1", self.listener.uri());
        Options { lmm_url: Some(url), lmm_model: Some("gpt-4o".into()), lmm_parallel: 1, ..small() }
    }

    fn requests(&self) -> usize {
        self.requests.load(Ordering::SeqCst)
    }

    /// Asks one made-up question, without retries.
    fn ask(&self) -> Result<Reply, AskError> {
        let options = Options { lmm_retries: 0, ..self.options() };
        ask(&connect(&options, None).unwrap().unwrap(), None)
    }
}

/// Sends a whole response, and says that the connection closes: otherwise, a client that has not yet noticed may send its
/// next request on it. It is not an error if the client has disconnected.
fn send(stream: &mut TcpStream, status: &str, headers: &str, body: &str) {
    let length = body.len();
    let _ = write!(stream, "HTTP/1.1 {status}\r\nconnection: close\r\ncontent-length: {length}\r\n{headers}\r\n{body}");
}

/// Sends the same bytes repeatedly until the client disconnects; returns the number of bytes sent.
fn send_forever(stream: &mut TcpStream, bytes: &[u8], pause: Duration) -> usize {
    let mut sent = 0;
    while stream.write_all(bytes).and_then(|()| stream.flush()).is_ok() {
        sent += bytes.len();
        std::thread::sleep(pause);
    }
    sent
}

fn gpt_4o() -> Option<Price> {
    PriceTable::builtin().price("gpt-4o").cloned()
}

/// Asks about one segment with a budget for this many requests of maximum cost.
fn run_within(options: &Options, requests: f64) -> Result<Run, QueryError> {
    let (folder, prompts, price) = (tempfile::tempdir().unwrap(), Prompts::builtin(), gpt_4o());
    let most = {
        let queries = prepare(&[one_segment()], &prompts, options);
        queries.preview(&recordings(folder.path()), None, price.as_ref()).cost.most_usd.unwrap()
    };
    let options = Options { max_usd: Some(requests * most), ..options.clone() };
    let queries = prepare(&[one_segment()], &prompts, &options);
    let client = connect(&options, None).unwrap().unwrap();
    let store = recordings(folder.path());
    queries.run(&store, Some(&client), &Budget::new(price, options.max_usd), Progress::HIDDEN)
}

#[test]
fn an_answer_is_kept_whatever_the_usage_says() {
    let lies = [
        None,
        Some(Value::Null),
        Some(json!({ "prompt_tokens": 1200.5, "completion_tokens": 80 })),
        Some(json!({ "prompt_tokens": -1, "completion_tokens": 80 })),
        Some(json!({ "prompt_tokens": "1200", "completion_tokens": "80" })),
        Some(json!({ "prompt_tokens": u64::MAX, "completion_tokens": 80 })),
        Some(json!({ "prompt_tokens": 1e300, "completion_tokens": 80 })),
        Some(json!({ "prompt_tokens": null, "completion_tokens": null })),
        Some(json!({ "total_tokens": 1280 })),
        Some(json!("1280 tokens")),
        Some(json!([1200, 80])),
    ];
    let prompts = Prompts::builtin();
    for lie in lies {
        let body = match &lie {
            None => {
                let mut body = completion(&good_answer(a("wood")).to_string());
                body.as_object_mut().unwrap().remove("usage");
                body
            }
            Some(usage) => super::with(completion(&good_answer(a("wood")).to_string()), "usage", usage.clone()),
        };
        let server = Server::new(move |_, _, _| Response::new(200).json(body.clone()));
        let (folder, options) = (tempfile::tempdir().unwrap(), server.options());
        let client = connect(&options, None).unwrap().unwrap();
        let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
        let outcome = super::run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
        assert_eq!(outcome.answers.failed().count(), 0, "{lie:?}");
        assert_eq!((server.requests().len(), recordings(folder.path()).len()), (2, 2), "{lie:?}");
        let spent = outcome.spent;
        assert_eq!((spent.requests, spent.unanswered), (2, 0), "{lie:?}");
        assert_eq!(spent.usage.output_tokens, 2 * 4000, "the most that was allowed stands in: {lie:?}");
        assert!(spent.usage.input_tokens > 0, "{lie:?}");
    }
}

#[test]
fn an_answer_is_kept_whatever_else_is_of_another_type() {
    let mut body = completion("{}");
    body["model"] = json!(7);
    body["choices"][0]["finish_reason"] = json!({ "why": "it was done" });
    body["choices"][0]["message"]["refusal"] = json!(false);
    let server = Server::new(move |_, _, _| Response::new(200).json(body.clone()));
    let client = connect(&server.options(), None).unwrap().unwrap();
    let reply = ask(&client, None).unwrap();
    assert_eq!((reply.content, reply.served_model), (ReplyContent::Text("{}".into()), None));
}

#[test]
fn every_request_that_may_have_been_billed_counts_against_the_cap() {
    type Respond = fn(usize, &mut TcpStream);
    let servers: [(&str, Respond); 5] = [
        ("an error in the place of an answer", |_, stream| {
            send(stream, "200 OK", "retry-after-ms: 1\r\n", r#"{"error":{"message":"overloaded"}}"#);
        }),
        ("a status of 503", |_, stream| send(stream, "503 Busy", "retry-after-ms: 1\r\n", "later")),
        ("half a reply", |_, stream| {
            let _ = stream.write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 5000\r\n\r\n{\"choices\": [");
        }),
        ("no reply at all", |_, _| {}),
        ("silence", |_, stream| {
            // Until the client gives up.
            let _ = stream.read(&mut [0]);
        }),
    ];
    // They wait at the same time, not one after the other.
    std::thread::scope(|scope| {
        for (name, respond) in servers {
            scope.spawn(move || {
                let server = RawServer::new(respond);
                let mut options = Options { lmm_retries: 6, ..server.options() };
                if name == "silence" {
                    // The least that the option takes: the client waits for it three times.
                    options.lmm_timeout_s = 1;
                }
                let result = run_within(&options, 3.5);
                assert!(matches!(&result, Err(QueryError::BudgetSpent { left: 1, .. })), "{name}: {result:?}");
                assert_eq!(server.requests(), 3, "{name}");
            });
        }
    });
}

#[test]
fn what_was_certainly_not_billed_does_not_count() {
    let good = || completion(&good_answer(a("wood")).to_string()).to_string();
    let server = RawServer::new(move |count, stream| match count {
        0..=3 => send(stream, "429 Too Many Requests", "retry-after-ms: 1\r\n", "slow down"),
        4 => send(stream, "400 Bad Request", "", r#"{"error":{"message":"no json_schema here"}}"#),
        5 => send(stream, "408 Request Timeout", "retry-after-ms: 1\r\n", "too slow"),
        _ => send(stream, "200 OK", "", &good()),
    });
    let run = run_within(&server.options(), 1.5).unwrap();
    assert!(matches!(&run.answers.all[0].outcome, Outcome::Answered(_)), "{:?}", run.answers);
    assert_eq!((server.requests(), run.spent.requests, run.spent.unanswered), (7, 1, 0));

    // No server listens on port 1, and no other test may get it.
    let nobody = Options { lmm_url: Some("http://127.0.0.1:1/v1".to_owned()), lmm_retries: 0, ..server.options() };
    let error = run_within(&nobody, 1.5).unwrap_err();
    assert!(matches!(&error, QueryError::Endpoint { spent, .. } if spent.requests == 0), "{error}");
}

#[test]
fn a_body_without_an_end_is_not_read_to_it() {
    let (sender, receiver) = std::sync::mpsc::channel();
    let sender = std::sync::Mutex::new(sender);
    let server = RawServer::new(move |_, stream| {
        let _ = stream.write_all(b"HTTP/1.1 200 OK\r\nconnection: close\r\n\r\n");
        let sent = send_forever(stream, &[b' '; 1 << 20], Duration::ZERO);
        sender.lock().unwrap().send(sent).unwrap();
    });
    let options = Options { lmm_retries: 3, ..server.options() };
    let error = ask(&connect(&options, None).unwrap().unwrap(), None).unwrap_err();
    assert!(matches!(&error, AskError::Failed(message) if message.contains("64 MB")), "{error}");
    assert_eq!(server.requests(), 1, "the next would be as long");
    // The margin is for the socket buffers of both sides.
    let sent = receiver.recv().unwrap();
    assert!((64_000_000..96_000_000).contains(&sent), "{sent}");
}

#[test]
fn a_body_that_says_it_is_too_long_is_not_read_at_all() {
    let server = RawServer::new(|_, stream| {
        let _ = stream.write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 1000000000000\r\n\r\n");
        let _ = stream.read(&mut [0]);
    });
    let error = server.ask().unwrap_err();
    assert!(matches!(&error, AskError::Failed(message) if message.contains("64 MB")), "{error}");

    // A file of answers may be longer, but not endless.
    let client = connect(&Options { lmm_retries: 0, ..server.options() }, None).unwrap().unwrap();
    let error = client.file("output").unwrap_err();
    assert!(matches!(&error, AskError::Failed(message) if message.contains("200 MB")), "{error}");
}

#[test]
fn compressed_bodies_are_not_blown_up() {
    // 64 MB of spaces in some kilobytes; without decompression, they are not an answer.
    let mut bomb = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    for _ in 0..64 {
        bomb.write_all(&[b' '; 1 << 20]).unwrap();
    }
    let bomb = bomb.finish().unwrap();
    let server = RawServer::new(move |_, stream| {
        let headers = format!("connection: close\r\ncontent-encoding: gzip\r\ncontent-length: {}\r\n", bomb.len());
        let _ = write!(stream, "HTTP/1.1 200 OK\r\n{headers}\r\n");
        let _ = stream.write_all(&bomb);
    });
    let error = server.ask().unwrap_err();
    assert!(matches!(&error, AskError::Failed(message) if message.contains("is not a chat completion")), "{error}");
}

#[test]
fn a_head_without_an_end_is_given_up() {
    let server = RawServer::new(|_, stream| {
        let _ = stream.write_all(b"HTTP/1.1 200 OK\r\n");
        send_forever(stream, format!("x-more: {}\r\n", "x".repeat(8000)).as_bytes(), Duration::ZERO);
    });
    let error = server.ask().unwrap_err();
    assert!(matches!(&error, AskError::Failed(message) if !message.contains("--lmm-timeout-s")), "{error}");
}

#[test]
fn a_drip_ends_at_the_time_out_in_all() {
    // Short enough that no wait for the next byte is as long as the time-out.
    let pause = Duration::from_millis(100);
    let head = RawServer::new(move |_, stream| {
        let _ = stream.write_all(b"HTTP/1.1 200 OK\r\nx-slow: ");
        send_forever(stream, b"x", pause);
    });
    let body = RawServer::new(move |_, stream| {
        let _ = stream.write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 1000000\r\n\r\n");
        send_forever(stream, b" ", pause);
    });
    for server in [head, body] {
        // The least that the option takes.
        let options = Options { lmm_timeout_s: 1, lmm_retries: 0, ..server.options() };
        let error = ask(&connect(&options, None).unwrap().unwrap(), None).unwrap_err();
        assert!(matches!(&error, AskError::Failed(message) if message.contains("--lmm-timeout-s")), "{error}");
    }
}

#[test]
fn a_wish_to_wait_for_longer_than_allowed_fails_and_is_named() {
    let in_an_hour = httpdate::fmt_http_date(SystemTime::now() + Duration::from_secs(3600));
    let wishes = [("retry-after", "3600".to_owned()), ("retry-after", in_an_hour), ("retry-after", "1e30".to_owned())];
    for (header, wish) in wishes {
        let sent = wish.clone();
        let server = Server::new(move |_, _, _| error(503, "maintenance").header(header, sent.as_str()));
        let options = Options { lmm_wait_s: 60, ..server.options() };
        let AskError::Failed(message) = ask(&connect(&options, None).unwrap().unwrap(), None).unwrap_err() else {
            panic!("{wish}")
        };
        for word in ["503: maintenance", "asks to wait", "--lmm-wait-s 60"] {
            assert!(message.contains(word), "no {word:?} in {message}");
        }
        if wish != "1e30" {
            let asked = ["3600 s", "3599 s", "3598 s"];
            assert!(asked.iter().any(|asked| message.contains(asked)), "{wish}: {message}");
        }
        assert_eq!(server.requests().len(), 1);
    }
}

#[test]
fn wishes_to_wait_are_added_up() {
    let server = Server::new(|_, _, _| error(429, "slow down").header("retry-after-ms", "400"));
    let options = Options { lmm_wait_s: 1, ..server.options() };
    let AskError::Failed(message) = ask(&connect(&options, None).unwrap().unwrap(), None).unwrap_err() else {
        panic!()
    };
    assert!(message.contains("after 1 s already") && message.contains("--lmm-wait-s 1 "), "{message}");
    assert_eq!(server.requests().len(), 3, "twice 0.4 s is allowed, a third time is not");
}

#[test]
fn the_query_of_the_url_stays_behind_the_path() {
    let server = MockServer::new(|request| match (request.method.as_str(), request.url.as_str()) {
        ("POST", "/v1/chat/completions?api-version=2") => ok(&good_answer(a("wood")).to_string()),
        ("GET", "/v1/batches/b?api-version=2") => Response::new(200).json(json!({ "id": "b", "status": "validating" })),
        ("GET", "/v1/files/f/content?api-version=2") => Response::new(200).text("lines"),
        _ => Response::new(404),
    });
    for base in ["/v1?api-version=2", "/v1/?api-version=2", "/v1/chat/completions?api-version=2"] {
        let url = Some(format!("{}{base}", server.uri()));
        let options = Options { lmm_url: url, lmm_model: Some("m".into()), lmm_retries: 0, ..small() };
        let client = connect(&options, None).unwrap().unwrap();
        assert!(ask(&client, None).is_ok(), "{base}");
        assert_eq!(client.batch_api_job("b").unwrap().id, "b", "{base}");
        assert_eq!(client.file("f").unwrap(), "lines", "{base}");
    }
}
