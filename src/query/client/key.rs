//! The API key: read from the environment, sent in one header, and used nowhere else.

use std::fmt;

use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderValue};

use super::error::ClientError;

const VARIABLE: &str = "OPENAI_API_KEY";
const CUT: &str = "[key]";

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

    /// `text` with the key removed, in case a server sends it back.
    pub(super) fn cut_from(&self, text: &str) -> String {
        /// Shorter texts are placeholders for servers that need no key ("none", "EMPTY"), and may be part of any answer.
        const SHORTEST_SECRET: usize = 8;
        match self.secret.len() < SHORTEST_SECRET {
            true => text.to_owned(),
            false => text.replace(&self.secret, CUT),
        }
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
