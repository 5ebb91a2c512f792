//! The API key: read from the environment, sent in one header, and used nowhere else.

use std::env::VarError;
use std::fmt;

use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderName, HeaderValue};

use super::secret;
use crate::query::options::Options;

/// A key that cannot be sent.
#[derive(Debug, thiserror::Error)]
#[error("the key in {variable} contains characters that no key has")]
pub struct KeyError {
    variable: String,
}

/// An API key that cannot be printed.
#[derive(Clone)]
pub struct ApiKey {
    secret: String,
    name: HeaderName,
    value: HeaderValue,
}

impl ApiKey {
    /// The key in the variable that the options name; `None` if it is unset or empty, as for servers that need no key.
    ///
    /// # Errors
    /// If it holds no key.
    pub fn from_environment(options: &Options) -> Result<Option<Self>, KeyError> {
        let variable = options.key_variable();
        let no_key = || KeyError { variable: shown(variable) };
        let secret = match std::env::var(variable) {
            Ok(secret) => secret.trim().to_owned(),
            Err(VarError::NotPresent) => String::new(),
            Err(VarError::NotUnicode(_)) => return Err(no_key()),
        };
        if secret.is_empty() {
            return Ok(None);
        }
        let name = options.lmm_key_header.as_ref().unwrap_or(&AUTHORIZATION);
        Self::in_header(&secret, name).map(Some).ok_or_else(no_key)
    }

    /// A key that is sent as most servers expect it: `Authorization: Bearer KEY`. `None` if it contains characters that no
    /// header has.
    pub fn new(secret: &str) -> Option<Self> {
        Self::in_header(secret, &AUTHORIZATION)
    }

    /// A key that is sent in the header of this name, by itself unless that is `Authorization`.
    fn in_header(secret: &str, name: &HeaderName) -> Option<Self> {
        let value = if *name == AUTHORIZATION { format!("Bearer {secret}") } else { secret.to_owned() };
        let mut value = HeaderValue::from_str(&value).ok()?;
        value.set_sensitive(true);
        Some(Self { secret: secret.into(), name: name.clone(), value })
    }

    pub(super) fn headers(&self) -> HeaderMap {
        HeaderMap::from_iter([(self.name.clone(), self.value.clone())])
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

/// The name of a variable, for messages. A text that does not look like one may be the key itself, given by mistake.
pub(super) fn shown(variable: &str) -> String {
    let is_name = variable.chars().all(|c| c == '_' || c.is_ascii_uppercase() || c.is_ascii_digit());
    if is_name { variable.to_owned() } else { "the variable that --lmm-key-env names".to_owned() }
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
