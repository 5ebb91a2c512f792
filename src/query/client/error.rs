//! The error of setting up a client.

use std::path::PathBuf;

/// A client that cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    #[error("--lmm-url {url:?} is not an http or https URL; give the server's base, such as https://api.openai.com/v1")]
    Url { url: String },
    #[error(
        "--lmm-url contains a user name or a password; give the server's key in the environment instead, in OPENAI_API_KEY or the variable that --lmm-key-env names"
    )]
    Credentials,
    #[error("--lmm-url contains a fragment (#...), which is never sent to a server; leave it out")]
    Fragment,
    #[error("--lmm-url needs --lmm-model, the name of the model there")]
    NoModel,
    #[error("the Batch API needs --lmm-url and --lmm-model")]
    NoUrl,
    #[error("the key in {variable} contains characters that no key has")]
    Key { variable: String },
    #[error("--lmm-body {path:?}: {problem}")]
    Fields { path: PathBuf, problem: FieldsProblem },
    #[error("cannot set up the HTTP client: {0}")]
    Http(String),
}

/// Why a file of fields cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FieldsProblem {
    #[error("it cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    #[error("it is not a JSON object, such as {{\"think\": false}}: {0}")]
    NoObject(#[from] serde_json::Error),
    #[error("{name:?} is set by gprop itself; leave it out: {instead}")]
    OfGprop { name: &'static str, instead: &'static str },
    #[error("it contains the server's key, which is sent in a header of its own; leave it out")]
    Key,
}
