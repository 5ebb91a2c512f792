//! The error of setting up a client.

use std::path::PathBuf;

use super::fields::FieldsProblem;
use super::key::KeyError;

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
    #[error(transparent)]
    Key(#[from] KeyError),
    #[error("--lmm-body {path:?}: {problem}")]
    Fields { path: PathBuf, problem: FieldsProblem },
    #[error("cannot set up the HTTP client: {0}")]
    Http(String),
}
