//! Serves one page on this machine, to whoever knows its address: a browser shows it and posts to it.
//!
//! The server listens on 127.0.0.1 alone. Every address begins with a random token, which other users and programs of the
//! machine do not know. A request must name the server itself as its host, so that no website can reach it by a name that it
//! points to 127.0.0.1, and a browser must say that the page itself sent it. Sizes, times and connections are bounded, and
//! nothing is served but the page and its pictures, which are in memory.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::mpsc::{self, Receiver, RecvError, Sender, TryRecvError};
use std::sync::{Arc, PoisonError, RwLock};
use std::thread::JoinHandle;
use std::time::Duration;
use std::{io, thread};

use http::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN, REFERRER_POLICY};
use http::header::{HeaderMap, HeaderName, HeaderValue, X_CONTENT_TYPE_OPTIONS};
use http::{Method, Request, Response, StatusCode};
use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::net::{TcpListener, TcpStream};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::oneshot;
use tokio::task::JoinSet;

use crate::words::progress::CancelToken;
use crate::words::readable::hexadecimal;

/// Bytes of the token: as many as cannot be guessed.
const TOKEN_BYTES: usize = 16;
/// The longest body: fifty times the answer about an object of 28 pieces.
const MOST_BYTES: usize = 1 << 20;
/// The longest head of a request; those of browsers have about 1 kB.
const MOST_HEAD_BYTES: usize = 1 << 15;
/// More connections than a browser opens at once.
const MOST_CONNECTIONS: usize = 32;
/// A browser on the same machine sends a request at once.
const PATIENCE: Duration = Duration::from_secs(10);
/// The page shows only what it came with and what is served beside it, and is shown in no other.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src 'self' data:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What is served.
#[derive(Debug, Default)]
pub struct Site {
    pub page: String,
    /// JPEG files by their path, relative to the page.
    pub pictures: BTreeMap<String, Vec<u8>>,
}

/// What happened.
#[derive(Debug)]
pub enum Event {
    Posted(Post),
    /// The user pressed Ctrl-C.
    Interrupted,
}

/// JSON that the page sent, which waits for a reply.
#[derive(Debug)]
pub struct Post {
    pub body: Vec<u8>,
    reply: oneshot::Sender<String>,
}

impl Post {
    /// Sends JSON to the page.
    pub fn reply(self, json: String) {
        // If the page was closed, nobody waits for it.
        let _ = self.reply.send(json);
    }
}

/// A server in a thread of its own, until it is dropped.
#[derive(Debug)]
pub struct LocalServer {
    url: String,
    site: Arc<RwLock<Site>>,
    events: Receiver<Event>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl LocalServer {
    /// Serves on this port of 127.0.0.1; 0 stands for any that is free. Ctrl-C is an event from now on; it also cancels what
    /// has this token.
    ///
    /// # Errors
    /// If the port cannot be used.
    pub fn start(port: u16, site: Site, cancel: CancelToken) -> io::Result<Self> {
        let mut token = [0; TOKEN_BYTES];
        getrandom::fill(&mut token).map_err(io::Error::other)?;
        let token = hexadecimal(&token);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let listener = runtime.block_on(TcpListener::bind((Ipv4Addr::LOCALHOST, port)))?;
        let host = listener.local_addr()?.to_string();
        let url = format!("http://{host}/{token}/");
        let site = Arc::new(RwLock::new(site));
        let (send, events) = mpsc::channel();
        let gate = Arc::new(Gate { host, token, site: Arc::clone(&site), events: send, cancel });
        let (stop, stopped) = oneshot::channel();
        let serve = move || runtime.block_on(serve(listener, gate, stopped));
        let thread = thread::Builder::new().name("local server".to_owned()).spawn(serve)?;
        Ok(Self { url, site, events, stop: Some(stop), thread: Some(thread) })
    }

    /// The page's address, with the token.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Serves this from now on.
    pub fn show(&self, site: Site) {
        *self.site.write().unwrap_or_else(PoisonError::into_inner) = site;
    }

    /// Waits for the next event.
    pub fn next(&self) -> Event {
        self.events.recv().unwrap_or_else(|RecvError| Event::Interrupted)
    }

    /// The next event if there is one already.
    pub fn next_now(&self) -> Option<Event> {
        match self.events.try_recv() {
            Ok(event) => Some(event),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Event::Interrupted),
        }
    }
}

/// Waits until the replies that were given are sent.
impl Drop for LocalServer {
    fn drop(&mut self) {
        let _ = self.stop.take().map(|stop| stop.send(()));
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// What a request must fit, and where it leads.
struct Gate {
    /// Address and port.
    host: String,
    token: String,
    site: Arc<RwLock<Site>>,
    events: Sender<Event>,
    cancel: CancelToken,
}

async fn serve(listener: TcpListener, gate: Arc<Gate>, mut stopped: oneshot::Receiver<()>) {
    let mut connections = JoinSet::new();
    // Without them, Ctrl-C ends the process as usual.
    let mut interrupts = signal(SignalKind::interrupt()).ok();
    let mut interrupted = async || match &mut interrupts {
        Some(interrupts) => interrupts.recv().await,
        None => std::future::pending().await,
    };
    loop {
        tokio::select! {
            accepted = listener.accept(), if connections.len() < MOST_CONNECTIONS => {
                if let Ok((stream, from)) = accepted && is_of_this_machine(from) {
                    connections.spawn(converse(stream, Arc::clone(&gate)));
                }
            }
            Some(_) = connections.join_next(), if !connections.is_empty() => {}
            Some(()) = interrupted() => {
                gate.cancel.cancel();
                let _ = gate.events.send(Event::Interrupted);
            }
            _ = &mut stopped => break,
        }
    }
    drop(listener);
    let all_ended = async { while connections.join_next().await.is_some() {} };
    let _ = tokio::time::timeout(PATIENCE, all_ended).await;
}

fn is_of_this_machine(from: SocketAddr) -> bool {
    from.ip().is_loopback()
}

/// Answers one request: a connection that is kept alive would outlive the server.
async fn converse(stream: TcpStream, gate: Arc<Gate>) {
    let answer = service_fn(move |request| {
        let gate = Arc::clone(&gate);
        async move { Ok::<_, Infallible>(gate.answer(request).await) }
    });
    let served = http1::Builder::new()
        .keep_alive(false)
        .max_buf_size(MOST_HEAD_BYTES)
        .timer(TokioTimer::new())
        .header_read_timeout(PATIENCE)
        .serve_connection(TokioIo::new(stream), answer)
        .await;
    // Whoever broke off the connection does not wait for an answer.
    drop(served);
}

impl Gate {
    async fn answer(&self, request: Request<Incoming>) -> Response<Full<Bytes>> {
        let found = match self.refusal(request.headers()) {
            Some(refusal) => Err(refusal),
            None => self.reply(request).await,
        };
        let (status, kind, body) = match found {
            Ok((kind, body)) => (StatusCode::OK, kind, body),
            Err(status) => (status, "text/plain", status.to_string().into_bytes()),
        };
        let mut response = Response::new(Full::new(Bytes::from(body)));
        *response.status_mut() = status;
        let headers = [
            (CONTENT_TYPE, kind),
            (CONTENT_SECURITY_POLICY, POLICY),
            (CACHE_CONTROL, "no-store"),
            (REFERRER_POLICY, "no-referrer"),
            (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        ];
        response.headers_mut().extend(headers.map(|(name, value)| (name, HeaderValue::from_static(value))));
        response
    }

    /// Why a request with these headers is not served, whatever it asks for.
    fn refusal(&self, headers: &HeaderMap) -> Option<StatusCode> {
        let is_only = |name: HeaderName, value: &str| {
            let mut given = headers.get_all(name).iter();
            given.next().is_some_and(|first| first.as_bytes() == value.as_bytes()) && given.next().is_none()
        };
        if !is_only(HOST, &self.host) {
            return Some(StatusCode::MISDIRECTED_REQUEST);
        }
        let is_from_elsewhere = headers.contains_key(ORIGIN) && !is_only(ORIGIN, &format!("http://{}", self.host));
        is_from_elsewhere.then_some(StatusCode::FORBIDDEN)
    }

    /// The kind and the bytes of what is asked for.
    async fn reply(&self, request: Request<Incoming>) -> Result<(&'static str, Vec<u8>), StatusCode> {
        let path = request.uri().path().strip_prefix('/').and_then(|path| path.split_once('/'));
        let Some(path) = path.filter(|(token, _)| is_same(token, &self.token)).map(|(_, path)| path.to_owned()) else {
            return Err(StatusCode::NOT_FOUND);
        };
        match (request.method(), path.as_str()) {
            (&Method::GET, "") => Ok(("text/html; charset=utf-8", self.site().page.clone().into_bytes())),
            (&Method::GET, _) => {
                let picture = self.site().pictures.get(&path).cloned();
                Ok(("image/jpeg", picture.ok_or(StatusCode::NOT_FOUND)?))
            }
            (&Method::POST, "answers") => self.post(request).await,
            (&Method::POST, _) => Err(StatusCode::NOT_FOUND),
            _ => Err(StatusCode::METHOD_NOT_ALLOWED),
        }
    }

    /// Passes on what was posted and waits for the reply to it.
    async fn post(&self, request: Request<Incoming>) -> Result<(&'static str, Vec<u8>), StatusCode> {
        const JSON: &str = "application/json";
        // A page from elsewhere would have to ask before it may send this type.
        if request.headers().get(CONTENT_TYPE).is_none_or(|kind| kind != JSON) {
            return Err(StatusCode::UNSUPPORTED_MEDIA_TYPE);
        }
        let body = Limited::new(request.into_body(), MOST_BYTES).collect();
        let body = tokio::time::timeout(PATIENCE, body).await.map_err(|_| StatusCode::REQUEST_TIMEOUT)?;
        let body = body.map_err(|_| StatusCode::PAYLOAD_TOO_LARGE)?.to_bytes().to_vec();
        let (reply, replied) = oneshot::channel();
        let gone = StatusCode::SERVICE_UNAVAILABLE;
        self.events.send(Event::Posted(Post { body, reply })).map_err(|_| gone)?;
        Ok((JSON, replied.await.map_err(|_| gone)?.into_bytes()))
    }

    fn site(&self) -> impl std::ops::Deref<Target = Site> + '_ {
        self.site.read().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether two tokens are the same, in a time that does not tell how much of them is.
fn is_same(given: &str, token: &str) -> bool {
    let differences = given.bytes().zip(token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
    given.len() == token.len() && differences == 0
}
