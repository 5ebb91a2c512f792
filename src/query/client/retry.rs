//! When a request is repeated, and after how long.

use std::time::{Duration, SystemTime};

use reqwest::header::{HeaderMap, RETRY_AFTER};

use crate::query::asker::AskError;

/// How a request failed.
#[derive(Debug)]
pub enum Attempt {
    /// May well succeed later: too many requests, an overloaded server, a dropped connection.
    Passing { message: String, retry_after: Option<Duration> },
    /// Nobody takes the connection; passes when the server is starting.
    Unreachable { message: String },
    /// The server does not take this form of request.
    Unaccepted { message: String },
    /// Will not get better.
    Final(AskError),
}

const FIRST_WAIT: Duration = Duration::from_secs(1);
const LONGEST_WAIT: Duration = Duration::from_secs(60);
/// Largest share taken off a wait at random; below one half, so that each wait is longer than the one before.
const JITTER: f64 = 0.4;
/// A server that wants to be left alone for longer is as good as down.
const LONGEST_RETRY_AFTER: Duration = Duration::from_secs(300);
/// A server that nobody answers at is tried this often at most: it is likely not there.
const CONNECTION_TRIES: u32 = 3;

/// Counts the repetitions of one request.
#[derive(Debug)]
pub struct Backoff {
    retries: u32,
    done: u32,
}

impl Backoff {
    /// At most `retries` repetitions.
    pub fn new(retries: u32) -> Self {
        Self { retries, done: 0 }
    }

    /// How long to wait before the next try; `None` to give up. What the server asks for goes; otherwise the wait
    /// doubles each time, with a random share taken off so that parallel requests do not come back together.
    pub fn wait_after(&mut self, failure: &Attempt) -> Option<Duration> {
        let (retry_after, most) = match failure {
            Attempt::Passing { retry_after, .. } => (*retry_after, self.retries),
            Attempt::Unreachable { .. } => (None, self.retries.min(CONNECTION_TRIES)),
            Attempt::Unaccepted { .. } | Attempt::Final(_) => return None,
        };
        if self.done >= most || retry_after.is_some_and(|wait| wait > LONGEST_RETRY_AFTER) {
            return None;
        }
        let doubled = FIRST_WAIT.saturating_mul(1 << self.done.min(16)).min(LONGEST_WAIT);
        self.done += 1;
        let jitter = fastrand::f64();
        Some(match retry_after {
            Some(wait) => wait + FIRST_WAIT.mul_f64(0.25 * jitter),
            None => doubled.mul_f64(1.0 - JITTER * jitter),
        })
    }
}

/// What a server asks for in `Retry-After` (seconds or a date) or OpenAI's `retry-after-ms`.
pub fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let text = |name: &str| headers.get(name)?.to_str().ok().map(str::trim);
    if let Some(milliseconds) = text("retry-after-ms").and_then(|text| text.parse::<u64>().ok()) {
        return Some(Duration::from_millis(milliseconds));
    }
    let wait = text(RETRY_AFTER.as_str())?;
    match wait.parse::<u64>() {
        Ok(seconds) => Some(Duration::from_secs(seconds)),
        Err(_) => httpdate::parse_http_date(wait).ok()?.duration_since(SystemTime::now()).ok(),
    }
}
