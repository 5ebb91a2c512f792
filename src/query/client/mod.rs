//! A client for OpenAI-compatible servers (Chat Completions with pictures): the only place that talks to a network.
//!
//! Servers differ in what they accept, so a request starts in its strictest form (`dialect.rs`) and is simplified if a
//! server refuses it or does not answer it; a form that a server answered once is used from then on. Requests that fail for a transient
//! reason are retried (`retry.rs`), each try with its own entry in the budget. The API key is read from the environment
//! only, is sent in a header that is marked sensitive, and is cut out of every text that comes back.
//!
//! A server may send anything at any pace: one request with its response takes [`Options::lmm_timeout_s`] at most, a
//! body is read up to [`MAX_REPLY_BYTES`] and no further, and the head of a response up to what hyper buffers (400 KB).
//! Files of the Batch API have limits of their own. Nothing is decompressed.

mod address;
mod body;
mod completion;
mod connection;
mod dialect;
mod error;
mod fields;
mod key;
mod proxy;
pub(super) mod response;
pub(super) mod retry;
mod secret;
mod trust;
mod wait;

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use reqwest::header::{CONTENT_TYPE, HeaderMap};
use reqwest::{RequestBuilder, StatusCode, Url};
use serde_json::{Value, json};
use tokio::runtime::Runtime;

use super::options::Options;
use super::recorded::{Answerer, Usage};
use crate::query::answer::extract;
use crate::query::ask::asker::{AskError, Asker, Reply, ReplyContent, Request};
use crate::query::ask::budget::Account;
use crate::query::ask::cost::Cost;
use crate::setup::Offline;
use crate::words::output::counted;
use crate::words::progress::{self, Progress};
use address::Address;
use connection::Route;
use dialect::{Dialect, Settings};
pub use error::ClientError;
use fields::Fields;
pub use key::ApiKey;
use response::Received;
use retry::{Attempt, Backoff, Wait};
use trust::Trust;

/// A server and one of its models.
pub struct Client {
    address: Address,
    key: Option<ApiKey>,
    /// True if the user named a variable for the key, and it holds none.
    misses_key: bool,
    /// The environment variable from which the key is read, for messages.
    key_variable: String,
    route: Route,
    /// An error if no connection may be opened.
    network: Result<(), Offline>,
    progress: Progress<'static>,
    answerer: Answerer,
    settings: Settings,
    max_usd: Option<f64>,
    parallel: usize,
    retries: u32,
    /// How long a request may wait in total because the server asks for it.
    longest_wait: Duration,
    /// The form of requests that the server is known to accept.
    dialect: Mutex<Dialect>,
    /// The ways in which an answer was asked for so far, for people.
    tried: Mutex<Vec<&'static str>>,
    http: reqwest::Client,
    runtime: Runtime,
}

/// The result of one request.
struct Exchanged<T> {
    result: Result<T, Attempt>,
    /// False if the server certainly charges nothing for it.
    may_be_billed: bool,
}

/// A connection that does not open within this time is not going to.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(20);
/// Largest body of a response. An answer of [`Options::lmm_max_tokens`] has a few kilobytes.
pub(super) const MAX_REPLY_BYTES: usize = 64_000_000;
/// How often the remaining wait is shown, and how often a wait checks whether it is still useful.
const TICK: Duration = Duration::from_secs(1);

impl Client {
    /// The client for the options; `None` without `--lmm-url`. It opens a connection only if `network` allows it.
    pub fn new(
        options: &Options,
        key: Option<ApiKey>,
        network: Result<(), Offline>,
        progress: Progress<'static>,
    ) -> Result<Option<Self>, ClientError> {
        let Some(base) = &options.lmm_url else { return Ok(None) };
        let model = options.lmm_model.clone().ok_or(ClientError::NoModel)?;
        let address = Address::parse(base)?;
        let Trust { config, unread } = Trust::new()?;
        let http = reqwest::Client::builder().tls_backend_preconfigured(config);
        let http = if proxy::is_this_machine(address.url()) { http.no_proxy() } else { http };
        let http = http
            .timeout(Duration::from_secs(options.lmm_timeout_s))
            .connect_timeout(CONNECT_TIMEOUT)
            .redirect(reqwest::redirect::Policy::none())
            .user_agent(concat!("gprop/", env!("CARGO_PKG_VERSION")))
            .build()
            .map_err(|error| ClientError::Http(error.to_string()))?;
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build();
        let runtime = runtime.map_err(|error| ClientError::Http(error.to_string()))?;
        let read = |path: &PathBuf| {
            let bad = |problem| ClientError::Fields { path: path.clone(), problem };
            Fields::read(path, key.as_ref()).map_err(bad)
        };
        let fields = options.lmm_body.as_ref().map(read).transpose()?;
        let settings = Settings {
            model: model.clone(),
            temperature: options.lmm_temperature,
            max_tokens: options.lmm_max_tokens,
            fields: fields.unwrap_or_default(),
        };
        let mut parameters = json!({ "temperature": settings.temperature, "max_tokens": settings.max_tokens });
        settings.fields.note_in(&mut parameters);
        Ok(Some(Self {
            dialect: Mutex::new(Dialect::of_host(&address.host())),
            route: Route::new(&address, unread),
            address,
            misses_key: key.is_none() && options.lmm_key_env.is_some(),
            key,
            key_variable: key::shown(options.key_variable()),
            network,
            progress,
            answerer: Answerer { model, parameters },
            settings,
            max_usd: options.max_usd,
            parallel: options.lmm_parallel,
            retries: options.lmm_retries,
            longest_wait: Duration::from_secs(options.lmm_wait_s),
            tried: Mutex::default(),
            http,
            runtime,
        }))
    }

    /// What is sent for a question, in the dialect that the server last accepted.
    pub fn payload(&self, request: Request) -> Value {
        let dialect = *self.dialect.lock().unwrap_or_else(PoisonError::into_inner);
        dialect.payload(&self.settings, request)
    }

    /// A text of the server with the key cut out: as it came, escaped, or in part.
    pub fn without_key(&self, text: &str) -> String {
        self.key.as_ref().map_or_else(|| text.to_owned(), |key| key.cut_from(text))
    }

    fn name(&self) -> String {
        name(&self.answerer.model, &self.address)
    }

    /// Tells the user, before the first request of a submission to the Batch API, where the pictures are sent, how many
    /// there are and what they may cost.
    pub fn announce_submission(&self, pictures: usize, cost: &Cost) {
        let pictures = counted(pictures, "picture");
        progress::notice(&format!(
            "sending {pictures} to {} through the Batch API, the first at once, for which there may be up to {}: {cost} ({})",
            self.name(),
            counted(self.most_requests(1), "request"),
            self.budget(cost)
        ));
    }

    fn budget(&self, cost: &Cost) -> String {
        match self.max_usd {
            Some(_) if cost.most_usd == Some(0.0) => "nothing is charged, so --max-usd counts nothing".to_owned(),
            None if cost.most_usd == Some(0.0) => "nothing is charged".to_owned(),
            Some(max_usd) => format!("at most {max_usd} USD, as set by --max-usd"),
            None => "no limit set by --max-usd".to_owned(),
        }
    }

    /// Asks one question, in whichever dialect the server accepts and answers.
    async fn converse(&self, request: Request<'_>, account: &Account<'_>) -> Result<Reply, AskError> {
        let mut dialect = *self.dialect.lock().unwrap_or_else(PoisonError::into_inner);
        let mut used = None;
        let mut is_known = true;
        loop {
            match self.send(dialect, request, account).await {
                Ok(reply) => {
                    used = sum(used, reply.usage);
                    let is_empty = matches!(reply.content, ReplyContent::Empty(_));
                    match dialect.plainer() {
                        Some(plainer) if is_empty => dialect = plainer,
                        _ => {
                            if is_known && !is_empty {
                                *self.dialect.lock().unwrap_or_else(PoisonError::into_inner) = dialect;
                            }
                            return Ok(Reply { usage: used, ..reply });
                        }
                    }
                }
                Err(Attempt::Unreadable { message }) => {
                    // It may have been an accident: only this question is asked more plainly.
                    is_known = false;
                    dialect = dialect.plainer().ok_or(AskError::Failed(message))?;
                }
                Err(Attempt::Unaccepted { message }) => match dialect.after_refusal(&message) {
                    Some(plainer) => dialect = plainer,
                    None => return Err(AskError::Failed(format!("the server does not accept the request: {message}"))),
                },
                Err(failure) => return Err(failure.into()),
            }
        }
    }

    async fn send(&self, dialect: Dialect, request: Request<'_>, account: &Account<'_>) -> Result<Reply, Attempt> {
        self.note(dialect.format());
        if request.correction.is_some() {
            self.note("with a correction");
        }
        let payload = dialect.payload(&self.settings, request);
        let url = self.address.chat_completions();
        let post = || self.http.post(url.clone()).header(CONTENT_TYPE, "application/json").json(&payload);
        let read = |received: &Received| response::read(received, |text| request.question.schema.check(text).is_ok());
        let attempt = async || {
            let entry = account.open().map_err(|reason| Attempt::Final(reason.into()))?;
            let Exchanged { result, may_be_billed } = self.exchange_once(post(), MAX_REPLY_BYTES, read).await;
            // A key may be split over the parts of a text.
            let result = result.map(|reply| reply.with_texts(|text| self.without_key(text)));
            match &result {
                _ if !may_be_billed => entry.not_billed(),
                Ok(reply) => entry.answered(reply.usage),
                Err(_) => entry.unanswered(),
            }
            result
        };
        self.repeat(self.retries, attempt, || account.is_closed()).await
    }

    /// Notes a way in which an answer is asked for.
    fn note(&self, way: &'static str) {
        let mut tried = self.tried.lock().unwrap_or_else(PoisonError::into_inner);
        if !tried.contains(&way) {
            tried.push(way);
        }
    }

    /// Sends a request without an entry in the budget and applies `read` to its response of at most `most_bytes`;
    /// retries while it fails for a transient reason.
    pub(super) fn exchange<T>(
        &self,
        retries: u32,
        most_bytes: usize,
        request: impl Fn(&reqwest::Client) -> RequestBuilder,
        read: impl Fn(&Received) -> Result<T, Attempt>,
    ) -> Result<T, AskError> {
        let attempt = async || self.exchange_once(request(&self.http), most_bytes, &read).await.result;
        Ok(self.runtime.block_on(self.repeat(retries, attempt, || false))?)
    }

    /// The URL with these segments below the server's base.
    pub(super) fn url(&self, segments: &[&str]) -> Url {
        self.address.below(segments)
    }

    /// How often a request is retried.
    pub(super) fn retries(&self) -> u32 {
        self.retries
    }

    /// Makes an attempt, and retries while it fails for a transient reason; waits end early once `is_over` returns
    /// true.
    async fn repeat<T>(
        &self,
        retries: u32,
        attempt: impl AsyncFn() -> Result<T, Attempt>,
        is_over: impl Fn() -> bool,
    ) -> Result<T, Attempt> {
        let mut backoff = Backoff::new(retries, self.longest_wait);
        loop {
            let failure = match attempt().await {
                Ok(value) => return Ok(value),
                Err(failure) => failure,
            };
            self.wait(backoff.wait_after(failure)?, &is_over).await;
        }
    }

    async fn wait(&self, wait: Wait, is_over: impl Fn() -> bool) {
        let reason = if wait.at_servers_wish { "as the server asks" } else { "then asking again" };
        let mut countdown = self.progress.countdown(reason);
        let end = Instant::now() + wait.length;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() || is_over() {
                return;
            }
            countdown.show(left);
            tokio::time::sleep(left.min(TICK)).await;
        }
    }

    async fn exchange_once<T>(
        &self,
        mut request: RequestBuilder,
        most_bytes: usize,
        read: impl Fn(&Received) -> Result<T, Attempt>,
    ) -> Exchanged<T> {
        let failed = |failure, may_be_billed| Exchanged { result: Err(failure), may_be_billed };
        if let Err(offline) = self.network {
            return failed(Attempt::Final(offline.into()), false);
        }
        if let Some(key) = &self.key {
            request = request.headers(key.headers());
        }
        let mut response = match request.send().await {
            Ok(response) => response,
            // Once connected, the server may have received the request, whether it answered or not.
            Err(error) => {
                let may_be_billed = !error.is_connect() && !error.is_builder();
                return failed(self.route.failure(&error), may_be_billed);
            }
        };
        let status = response.status();
        let may_be_billed = status.is_success() || status.is_server_error();
        let headers = response.headers().clone();
        let bytes = match response::body(&mut response, most_bytes, &self.route).await {
            Ok(bytes) => bytes,
            Err(failure) => return failed(failure, may_be_billed),
        };
        let text = String::from_utf8_lossy(&bytes);
        let body = self.key.as_ref().map_or_else(|| text.to_string(), |key| key.cut_from_body(&text));
        let result = read(&Received { status, headers, body }).map_err(|failure| self.about_key(failure));
        let result = result.map_err(|failure| failure.with_text(|text| self.without_key(text)));
        Exchanged { result, may_be_billed }
    }

    /// The failure, with what to do about a key that the server does not accept.
    fn about_key(&self, failure: Attempt) -> Attempt {
        let Attempt::KeyRefused { message } = failure else { return failure };
        let variable = &self.key_variable;
        let message = match &self.key {
            None => {
                format!("{message}; set {variable} to a key for this server, or name its variable with --lmm-key-env")
            }
            Some(_) => format!(
                "{message}; is the key in {variable} one for this server, and does it expect the key in another header \
                 (--lmm-key-header)?"
            ),
        };
        Attempt::Final(AskError::Fatal(message))
    }
}

impl Asker for Client {
    fn answerer(&self) -> &Answerer {
        &self.answerer
    }

    fn parallel(&self) -> usize {
        self.parallel
    }

    fn ready(&self) -> Result<(), AskError> {
        self.network?;
        if self.misses_key {
            let variable = &self.key_variable;
            let problem =
                "is not set or is empty; give the name of the environment variable that holds the server's key";
            return Err(AskError::Fatal(format!("--lmm-key-env: {variable} {problem}")));
        }
        Ok(())
    }

    fn most_requests(&self, questions: usize) -> usize {
        // As asked first and as corrected, in plainer forms, and again after failures.
        let for_one = 2 + dialect::PLAINER_FORMATS + self.retries as usize;
        questions * for_one + dialect::OTHER_PARAMETERS
    }

    fn announce(&self, pictures: usize, most_requests: usize, cost: &Cost) {
        let (pictures, most) = (counted(pictures, "picture"), counted(most_requests, "request"));
        let (name, budget) = (self.name(), self.budget(cost));
        progress::notice(&format!(
            "asking {name} about {pictures}: up to {most}; if all replies are usable, {cost} ({budget})"
        ));
    }

    fn tried(&self) -> Vec<&'static str> {
        self.tried.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn ask(&self, request: Request, account: &Account) -> Result<Reply, AskError> {
        self.runtime.block_on(self.converse(request, account))
    }
}

/// A model, the host of its server and the proxy on the way there, for display: no path, no query.
fn name(model: &str, address: &Address) -> String {
    let proxy = proxy::of(address.url()).map_or_else(String::new, |proxy| format!(" through the proxy {proxy}"));
    format!("{model} at {}{proxy}", address.host())
}

/// True if the options name a server on this machine.
pub fn is_on_this_machine(options: &Options) -> bool {
    let address = options.lmm_url.as_deref().and_then(|url| Address::parse(url).ok());
    address.is_some_and(|address| proxy::is_this_machine(address.url()))
}

/// The model, its server and the proxy that the options and the environment name, for display. `None` without `--lmm-url`.
///
/// # Errors
/// If the URL cannot be used.
pub fn destination(options: &Options) -> Result<Option<String>, ClientError> {
    let Some(base) = &options.lmm_url else { return Ok(None) };
    let model = options.lmm_model.as_deref().ok_or(ClientError::NoModel)?;
    Ok(Some(name(model, &Address::parse(base)?)))
}

/// The tokens of two requests, as far as the server reports them.
fn sum(a: Option<Usage>, b: Option<Usage>) -> Option<Usage> {
    a.zip(b).map(|(a, b)| a.plus(b)).or(a).or(b)
}

/// Reads the response to a question from its status and body. What stands elsewhere than in the content is taken for the
/// answer if it holds JSON.
pub fn read_completion(status: u16, body: &str) -> Result<Reply, AskError> {
    let no_status = |_| AskError::Failed(format!("{status} is not an HTTP status"));
    let status = StatusCode::from_u16(status).map_err(no_status)?;
    let received = Received { status, headers: HeaderMap::new(), body: body.to_owned() };
    response::read(&received, |text| extract::json_objects(text).is_ok()).map_err(AskError::from)
}
