//! An HTTP server on loopback that answers as a test tells it to, and remembers what it was asked.

use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use serde_json::Value;

/// What the server was sent.
#[derive(Clone)]
pub struct Request {
    pub method: String,
    /// Path and query.
    pub url: String,
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Request {
    /// The value of a header, whose name is in small letters.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// The path without the query.
    pub fn path(&self) -> &str {
        self.url.split('?').next().unwrap()
    }
}

/// What the server answers.
#[derive(Clone)]
pub struct Response {
    status: u16,
    headers: Vec<(&'static str, String)>,
    body: Vec<u8>,
    delay: Duration,
}

impl Response {
    pub fn new(status: u16) -> Self {
        Self { status, headers: Vec::new(), body: Vec::new(), delay: Duration::ZERO }
    }

    pub fn json(self, value: impl serde::Serialize) -> Self {
        let body = serde_json::to_vec(&value).unwrap();
        Self { body, ..self }.header("content-type", "application/json")
    }

    pub fn text(self, text: impl Into<String>) -> Self {
        Self { body: text.into().into_bytes(), ..self }.header("content-type", "text/plain")
    }

    pub fn header(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.headers.push((name, value.into()));
        self
    }

    pub fn delay(self, delay: Duration) -> Self {
        Self { delay, ..self }
    }
}

pub struct MockServer {
    server: Arc<tiny_http::Server>,
    requests: Arc<Mutex<Vec<Request>>>,
    /// Dropped with the server: whoever delays an answer stops waiting.
    _ends: Sender<()>,
}

impl MockServer {
    /// A server that answers as `respond` says, every request on a thread of its own.
    pub fn new(respond: impl Fn(&Request) -> Response + Send + Sync + 'static) -> Self {
        let server = Arc::new(tiny_http::Server::http("127.0.0.1:0").unwrap());
        let requests = Arc::new(Mutex::new(Vec::new()));
        let (sender, ended) = mpsc::channel();
        let (respond, ended) = (Arc::new(respond), Arc::new(Mutex::new(ended)));
        let (listening, kept) = (Arc::clone(&server), Arc::clone(&requests));
        thread::spawn(move || {
            for mut incoming in listening.incoming_requests() {
                let request = read(&mut incoming);
                kept.lock().unwrap().push(request.clone());
                let (respond, ended) = (Arc::clone(&respond), Arc::clone(&ended));
                thread::spawn(move || answer(incoming, respond(&request), &ended));
            }
        });
        Self { server, requests, _ends: sender }
    }

    /// Where it listens: scheme, address and port.
    pub fn uri(&self) -> String {
        format!("http://{}", self.server.server_addr())
    }

    /// Every request so far, in the order of arrival.
    pub fn requests(&self) -> Vec<Request> {
        self.requests.lock().unwrap().clone()
    }
}

impl Drop for MockServer {
    fn drop(&mut self) {
        self.server.unblock();
    }
}

fn read(incoming: &mut tiny_http::Request) -> Request {
    let mut body = Vec::new();
    // A client that was killed sends half a body.
    let _ = incoming.as_reader().read_to_end(&mut body);
    let lower = |header: &tiny_http::Header| {
        (header.field.as_str().as_str().to_ascii_lowercase(), header.value.as_str().to_owned())
    };
    Request {
        method: incoming.method().to_string(),
        url: incoming.url().to_owned(),
        headers: incoming.headers().iter().map(lower).collect(),
        body,
    }
}

/// Answers after the delay; not at all if the server ends before.
fn answer(incoming: tiny_http::Request, response: Response, ended: &Mutex<Receiver<()>>) {
    if !response.delay.is_zero()
        && let Ok(ended) = ended.lock()
        && ended.recv_timeout(response.delay) != Err(RecvTimeoutError::Timeout)
    {
        return;
    }
    let mut reply = tiny_http::Response::from_data(response.body).with_status_code(response.status);
    for (name, value) in response.headers {
        reply.add_header(tiny_http::Header::from_bytes(name, value).unwrap());
    }
    // A client that was killed hears nothing.
    let _ = incoming.respond(reply);
}

/// The JSON of a request's body.
pub fn json_of(request: &Request) -> Value {
    serde_json::from_slice(&request.body).expect("the client sends JSON")
}
