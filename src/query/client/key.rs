//! The API key: read from the environment, sent in one header, and used nowhere else.

use std::fmt;

use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderValue};

use super::error::ClientError;
use super::secret;

const VARIABLE: &str = "OPENAI_API_KEY";

/// An API key that cannot be printed.
#[derive(Clone)]
pub struct ApiKey {
    secret: String,
    header: HeaderValue,
}

impl ApiKey {
    /// The key in `OPENAI_API_KEY`; `None` if it is unset or empty, as for servers that need none.
    pub fn from_environment() -> Result<Option<Self>, ClientError> {
        match std::env::var(VARIABLE) {
            Ok(secret) if !secret.trim().is_empty() => Self::new(secret.trim()).map(Some),
            Ok(_) | Err(std::env::VarError::NotPresent) => Ok(None),
            Err(std::env::VarError::NotUnicode(_)) => Err(ClientError::Key),
        }
    }

    /// A key.
    pub fn new(secret: &str) -> Result<Self, ClientError> {
        let mut header = HeaderValue::from_str(&format!("Bearer {secret}")).map_err(|_| ClientError::Key)?;
        header.set_sensitive(true);
        Ok(Self { secret: secret.into(), header })
    }

    pub(super) fn headers(&self) -> HeaderMap {
        HeaderMap::from_iter([(AUTHORIZATION, self.header.clone())])
    }

    /// `text` with the key and long parts of it removed, in case a server sends it back.
    pub(super) fn cut_from(&self, text: &str) -> String {
        secret::cut(&self.secret, text)
    }

    /// `body` with the key removed, before anything else is done with it. Its texts may still be in pieces.
    pub(super) fn cut_from_body(&self, body: &str) -> String {
        secret::cut_whole(&self.secret, body)
    }
}

impl fmt::Debug for ApiKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ApiKey([key])")
    }
}

/// A URL without the parts before an `@` or after a `?`, where people put keys.
pub(super) fn without_credentials(url: &str) -> String {
    let url = url.split('?').next().unwrap_or(url);
    match (url.split_once("://"), url.rsplit_once('@')) {
        (Some((scheme, _)), Some((_, host))) => format!("{scheme}://{host}"),
        (None, Some((_, host))) => host.to_owned(),
        (_, None) => url.to_owned(),
    }
}
