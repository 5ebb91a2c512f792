//! When a request is retried, and after how long.

use std::time::Duration;

use crate::query::ask::asker::AskError;

/// How a request failed.
#[derive(Debug)]
pub enum Attempt {
    /// May well succeed later: too many requests, an overloaded server, a dropped connection.
    Passing { message: String, retry_after: Option<Duration> },
    /// No connection can be opened; transient if the server is still starting.
    Unreachable { message: String },
    /// The server does not accept this form of request.
    Unaccepted { message: String },
    /// The server answered this form of request with something that is no completion.
    Unreadable { message: String },
    /// The server does not accept the key, or misses one.
    KeyRefused { message: String },
    /// Retrying would not help.
    Final(AskError),
}

impl Attempt {
    /// The failure with `edit` applied to the text of the server.
    pub fn with_text(self, edit: impl Fn(&str) -> String) -> Self {
        match self {
            Self::Passing { message, retry_after } => Self::Passing { message: edit(&message), retry_after },
            Self::Unreachable { message } => Self::Unreachable { message: edit(&message) },
            Self::Unaccepted { message } => Self::Unaccepted { message: edit(&message) },
            Self::Unreadable { message } => Self::Unreadable { message: edit(&message) },
            Self::KeyRefused { message } => Self::KeyRefused { message: edit(&message) },
            Self::Final(error) => Self::Final(error.with_text(edit)),
        }
    }
}

/// The error that a failed attempt means for whoever asked.
impl From<Attempt> for AskError {
    fn from(attempt: Attempt) -> Self {
        match attempt {
            Attempt::Final(error) => error,
            Attempt::Passing { message, .. } | Attempt::Unaccepted { message } | Attempt::Unreadable { message } => {
                Self::Failed(message)
            }
            Attempt::KeyRefused { message } | Attempt::Unreachable { message } => Self::Fatal(message),
        }
    }
}

const FIRST_WAIT: Duration = Duration::from_secs(1);
const LONGEST_WAIT: Duration = Duration::from_secs(60);
/// Largest share taken off a wait at random; below one half, so that each wait up to [`LONGEST_WAIT`] is longer than
/// the one before.
const JITTER: f64 = 0.4;
/// Most retries to connect to a server that does not accept connections: it is probably not there.
const CONNECTION_RETRIES: u32 = 3;

/// Counts the retries of one request.
#[derive(Debug)]
pub struct Backoff {
    retries: u32,
    done: u32,
    /// Limit for all waits that the server asks for, added up.
    longest_wait: Duration,
    /// The sum of the waits so far that the server asked for.
    waited: Duration,
}

/// How long to wait before the next try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wait {
    pub length: Duration,
    /// True if the server asked for it.
    pub at_servers_wish: bool,
}

impl Backoff {
    /// Allows at most `retries` retries, and at most `longest_wait` in total of waits that the server asks for.
    pub fn new(retries: u32, longest_wait: Duration) -> Self {
        Self { retries, done: 0, longest_wait, waited: Duration::ZERO }
    }

    /// How long to wait before the next try: as long as the server asks, plus up to a quarter of a second; otherwise
    /// twice as long each time, less a random share. Chance keeps parallel requests from coming back together.
    ///
    /// # Errors
    /// The failure itself if there is to be no further try.
    pub fn wait_after(&mut self, failure: Attempt) -> Result<Wait, Attempt> {
        let (retry_after, most) = match &failure {
            Attempt::Passing { retry_after, .. } => (*retry_after, self.retries),
            Attempt::Unreachable { .. } => (None, self.retries.min(CONNECTION_RETRIES)),
            _ => return Err(failure),
        };
        if self.done >= most {
            return Err(failure);
        }
        let jitter = fastrand::f64();
        let wait = match (retry_after, failure) {
            (Some(asked), failure) if asked > self.longest_wait.saturating_sub(self.waited) => {
                return Err(self.too_long(asked, failure));
            }
            (Some(asked), _) => {
                self.waited += asked;
                Wait { length: asked + FIRST_WAIT.mul_f64(0.25 * jitter), at_servers_wish: true }
            }
            (None, _) => {
                let doubled = FIRST_WAIT.saturating_mul(1 << self.done.min(16)).min(LONGEST_WAIT);
                Wait { length: doubled.mul_f64(1.0 - JITTER * jitter), at_servers_wish: false }
            }
        };
        self.done += 1;
        Ok(wait)
    }

    fn too_long(&self, asked: Duration, failure: Attempt) -> Attempt {
        let Attempt::Passing { message, retry_after } = failure else { return failure };
        let seconds = |wait: Duration| wait.as_secs_f64().ceil();
        let before = match self.waited {
            Duration::ZERO => String::new(),
            waited => format!(" more after {} s already", seconds(waited)),
        };
        let (asked, limit) = (seconds(asked), seconds(self.longest_wait));
        let message = format!(
            "{message}; the server asks to wait {asked} s{before}; --lmm-wait-s {limit} does not allow that: raise it or try \
             again later"
        );
        Attempt::Passing { message, retry_after }
    }
}
