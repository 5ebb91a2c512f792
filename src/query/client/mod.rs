//! A client for OpenAI-compatible servers (Chat Completions with pictures): the only place that talks to a network.
//!
//! Servers differ in what they accept, so a request starts in its strictest form (`dialect.rs`) and steps down where a
//! server refuses it; what a server accepted once is used from then on. Requests that fail for a passing reason are
//! repeated (`retry.rs`). The account's key is read from the environment only, is sent in a header that is marked
//! sensitive, and is cut out of every text that comes back.

mod batch;
mod dialect;
mod key;
mod response;
mod retry;

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use reqwest::header::CONTENT_TYPE;
use reqwest::{RequestBuilder, StatusCode};
use serde_json::{Value, json};
use tokio::runtime::Runtime;

use super::asker::{Ask, AskError, Asker, Reply};
use super::options::Options;
use super::recorded::Answerer;
pub use batch::{BatchCounts, BatchState, BatchStatus};
use dialect::Dialect;
pub use key::ApiKey;
use retry::{Attempt, Backoff};

/// A server with a model.
pub struct Client {
    url: String,
    key: Option<ApiKey>,
    answerer: Answerer,
    temperature: f64,
    max_tokens: u32,
    parallel: usize,
    retries: u32,
    /// What the server is known to accept.
    dialect: Mutex<Dialect>,
    http: reqwest::Client,
    runtime: Runtime,
}

/// A client that cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    #[error("--lmm-url {url:?} is no http or https URL; give the server's base, such as https://api.openai.com/v1")]
    Url { url: String },
    #[error("--lmm-url needs --lmm-model, the name of the model there")]
    NoModel,
    #[error("the Batch API needs --lmm-url and --lmm-model")]
    NoUrl,
    #[error("OPENAI_API_KEY holds characters that no key has")]
    Key,
    #[error("cannot set up the HTTP client: {0}")]
    Http(String),
}

const ENDPOINT: &str = "/chat/completions";
/// A connection that does not open within this is not going to.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(20);

impl Client {
    /// The client that the options ask for; `None` without `--lmm-url`.
    pub fn new(options: &Options, key: Option<ApiKey>) -> Result<Option<Self>, ClientError> {
        let Some(base) = &options.lmm_url else { return Ok(None) };
        let model = options.lmm_model.clone().ok_or(ClientError::NoModel)?;
        let http = reqwest::Client::builder()
            .timeout(Duration::from_secs(options.lmm_timeout_s))
            .connect_timeout(CONNECT_TIMEOUT)
            .redirect(reqwest::redirect::Policy::none())
            .user_agent(concat!("gprop/", env!("CARGO_PKG_VERSION")))
            .build()
            .map_err(|error| ClientError::Http(error.to_string()))?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .map_err(|error| ClientError::Http(error.to_string()))?;
        let parameters = json!({ "temperature": options.lmm_temperature, "max_tokens": options.lmm_max_tokens });
        Ok(Some(Self {
            url: endpoint(base)?,
            key,
            answerer: Answerer { model, parameters },
            temperature: options.lmm_temperature,
            max_tokens: options.lmm_max_tokens,
            parallel: options.lmm_parallel,
            retries: options.lmm_retries,
            dialect: Mutex::new(Dialect::default()),
            http,
            runtime,
        }))
    }

    /// The body of the request for a question, in the dialect that the server last accepted.
    pub fn body(&self, ask: Ask) -> Value {
        let dialect = *self.dialect.lock().unwrap_or_else(PoisonError::into_inner);
        dialect.body(&self.answerer.model, self.temperature, self.max_tokens, ask)
    }

    /// One question, in whichever dialect the server takes.
    async fn converse(&self, ask: Ask<'_>) -> Result<Reply, AskError> {
        let mut dialect = *self.dialect.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            let body = dialect.body(&self.answerer.model, self.temperature, self.max_tokens, ask);
            match self.send(&body).await {
                Ok(reply) => {
                    *self.dialect.lock().unwrap_or_else(PoisonError::into_inner) = dialect;
                    return Ok(reply);
                }
                Err(Attempt::Unaccepted { message }) => match dialect.after_refusal(&message) {
                    Some(plainer) => dialect = plainer,
                    None => return Err(AskError::Failed(format!("the server does not accept the request: {message}"))),
                },
                Err(Attempt::Final(error)) => return Err(error),
                Err(Attempt::Passing { message, .. }) => return Err(AskError::Failed(message)),
                Err(Attempt::Unreachable { message }) => return Err(AskError::Hopeless(message)),
            }
        }
    }

    async fn send(&self, body: &Value) -> Result<Reply, Attempt> {
        let request = || self.http.post(&self.url).header(CONTENT_TYPE, "application/json").json(body);
        self.exchange(self.retries, request, response::read).await
    }

    /// A request and what `read` makes of its response, repeated while it fails for a passing reason.
    async fn exchange<T>(
        &self,
        retries: u32,
        request: impl Fn() -> RequestBuilder,
        read: impl Fn(StatusCode, &str, Option<Duration>) -> Result<T, Attempt>,
    ) -> Result<T, Attempt> {
        let mut backoff = Backoff::new(retries);
        loop {
            let failure = match self.exchange_once(request(), &read).await {
                Ok(value) => return Ok(value),
                Err(failure) => failure,
            };
            let Some(wait) = backoff.wait_after(&failure) else { return Err(failure) };
            tokio::time::sleep(wait).await;
        }
    }

    async fn exchange_once<T>(
        &self,
        mut request: RequestBuilder,
        read: impl Fn(StatusCode, &str, Option<Duration>) -> Result<T, Attempt>,
    ) -> Result<T, Attempt> {
        if let Some(key) = &self.key {
            request = request.headers(key.headers());
        }
        let response = request.send().await.map_err(response::transport)?;
        let status = response.status();
        let retry_after = retry::retry_after(response.headers());
        let bytes = response.bytes().await.map_err(response::transport)?;
        let text = String::from_utf8_lossy(&bytes);
        let text = self.key.as_ref().map_or_else(|| text.to_string(), |key| key.cut_from(&text));
        read(status, &text, retry_after)
    }
}

impl Asker for Client {
    fn answerer(&self) -> &Answerer {
        &self.answerer
    }

    fn parallel(&self) -> usize {
        self.parallel
    }

    fn ask(&self, ask: Ask) -> Result<Reply, AskError> {
        self.runtime.block_on(self.converse(ask))
    }
}

/// What a response to a question says, its status and body given; else what is wrong with it.
pub fn read_completion(status: u16, body: &str) -> Result<Reply, String> {
    let status = StatusCode::from_u16(status).map_err(|_| format!("{status} is no HTTP status"))?;
    response::read(status, body, None).map_err(|attempt| batch::ask_error(attempt).to_string())
}

/// The address of Chat Completions under a base URL; a base that already ends in it is taken as it is.
fn endpoint(base: &str) -> Result<String, ClientError> {
    let bad = || ClientError::Url { url: key::without_credentials(base) };
    let url = reqwest::Url::parse(base).map_err(|_| bad())?;
    if !matches!(url.scheme(), "http" | "https") || !url.has_host() {
        return Err(bad());
    }
    let base = base.trim_end_matches('/');
    Ok(if base.ends_with(ENDPOINT) { base.to_owned() } else { format!("{base}{ENDPOINT}") })
}
