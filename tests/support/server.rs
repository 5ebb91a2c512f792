//! HTTP servers on loopback: one that answers as a test tells it to and stores its requests, and one that passes each
//! connection to the test.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use serde_json::Value;

/// A request that the server received.
#[derive(Clone)]
pub struct Request {
    pub method: String,
    /// Path and query.
    pub url: String,
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Request {
    /// The value of a header, whose name is given in lower case.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// The path without the query.
    pub fn path(&self) -> &str {
        self.url.split('?').next().unwrap()
    }
}

/// The server's answer.
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

/// A listener on loopback with a thread for each connection.
pub struct Listener {
    address: SocketAddr,
    is_over: Arc<AtomicBool>,
}

impl Listener {
    /// A listener that passes each connection to `serve` and closes it when that returns.
    pub fn new(serve: impl Fn(TcpStream) + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let (address, is_over) = (listener.local_addr().unwrap(), Arc::new(AtomicBool::new(false)));
        let (over, serve) = (Arc::clone(&is_over), Arc::new(serve));
        thread::spawn(move || {
            for stream in listener.incoming() {
                if over.load(Ordering::SeqCst) {
                    return;
                }
                let (serve, stream) = (Arc::clone(&serve), stream.unwrap());
                thread::spawn(move || serve(stream));
            }
        });
        Self { address, is_over }
    }

    /// Scheme, address and port.
    pub fn uri(&self) -> String {
        format!("http://{}", self.address)
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::SeqCst);
        // Wakes the listener's thread, which then ends.
        let _ = TcpStream::connect(self.address);
    }
}

pub struct MockServer {
    listener: Listener,
    requests: Arc<Mutex<Vec<Request>>>,
}

impl MockServer {
    /// A server that answers as `respond` says. Connections are kept open for further requests.
    pub fn new(respond: impl Fn(&Request) -> Response + Send + Sync + 'static) -> Self {
        let requests = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&requests);
        let listener = Listener::new(move |mut stream| {
            let _ = stream.set_nodelay(true);
            while let Some(request) = read_request(&mut stream) {
                kept.lock().unwrap().push(request.clone());
                if write_response(&mut stream, &respond(&request)).is_err() {
                    return;
                }
            }
        });
        Self { listener, requests }
    }

    /// Its address: scheme, host and port.
    pub fn uri(&self) -> String {
        self.listener.uri()
    }

    /// Every request so far, in the order of arrival.
    pub fn requests(&self) -> Vec<Request> {
        self.requests.lock().unwrap().clone()
    }
}

/// Reads a request to the end of its body; `None` if the connection ends earlier, as that of a killed client does.
pub fn read_request(stream: &mut impl Read) -> Option<Request> {
    let mut bytes = Vec::new();
    let mut chunk = [0; 1 << 16];
    let head_length = loop {
        if let Some(end) = bytes.windows(4).position(|window| window == b"\r\n\r\n") {
            break end;
        }
        read_more(stream, &mut chunk, &mut bytes)?;
    };
    let mut body = bytes.split_off(head_length + 4);
    let head = String::from_utf8(bytes).expect("headers are text");
    let (first, rest) = head.split_once("\r\n").expect("a request line comes first");
    let mut words = first.split(' ').map(str::to_owned);
    let (method, url) = (words.next().unwrap(), words.next().unwrap());
    let header = |line: &str| line.split_once(": ").map(|(name, value)| (name.to_lowercase(), value.to_owned()));
    let mut request = Request { method, url, headers: rest.lines().filter_map(header).collect(), body: Vec::new() };
    assert!(request.header("transfer-encoding").is_none(), "gprop sends its bodies whole");
    let length = request.header("content-length").map_or(0, |length| length.parse().unwrap());
    while body.len() < length {
        read_more(stream, &mut chunk, &mut body)?;
    }
    request.body = body;
    Some(request)
}

/// Appends the bytes that have arrived; `None` at the end of the connection.
fn read_more(stream: &mut impl Read, chunk: &mut [u8], bytes: &mut Vec<u8>) -> Option<()> {
    let count = stream.read(chunk).ok().filter(|&count| count > 0)?;
    bytes.extend_from_slice(&chunk[..count]);
    Some(())
}

pub fn write_response(stream: &mut impl Write, response: &Response) -> io::Result<()> {
    // A slow server, or one that never answers: the thread ends with the tests.
    thread::sleep(response.delay);
    let mut bytes = format!("HTTP/1.1 {} of a test\r\ncontent-length: {}\r\n", response.status, response.body.len());
    for (name, value) in &response.headers {
        bytes += &format!("{name}: {value}\r\n");
    }
    stream.write_all(&[bytes.as_bytes(), b"\r\n", &response.body].concat())
}

/// The JSON of a request's body.
pub fn json_of(request: &Request) -> Value {
    serde_json::from_slice(&request.body).expect("the client sends JSON")
}
