//! The URLs of a server's endpoints: below the path of the URL that the user gave, before its query.

use reqwest::Url;

use super::error::ClientError;
use super::key::without_credentials;

/// Path of Chat Completions below the base.
const CHAT_COMPLETIONS: &str = "/chat/completions";

/// The base URL of a server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    base: Url,
}

impl Address {
    /// The address in `--lmm-url`; a trailing `/chat/completions` is dropped.
    ///
    /// # Errors
    /// If it is not an http or https URL, or contains something that does not belong in an address.
    pub fn parse(text: &str) -> Result<Self, ClientError> {
        let bad = || ClientError::Url { url: without_credentials(text) };
        let mut base = Url::parse(text).map_err(|_| bad())?;
        if !matches!(base.scheme(), "http" | "https") || !base.has_host() {
            return Err(bad());
        }
        if !base.username().is_empty() || base.password().is_some() {
            return Err(ClientError::Credentials);
        }
        if base.fragment().is_some() {
            return Err(ClientError::Fragment);
        }
        let path = base.path().trim_end_matches('/');
        let path = path.strip_suffix(CHAT_COMPLETIONS).unwrap_or(path).to_owned();
        base.set_path(&path);
        Ok(Self { base })
    }

    /// The base of all other URLs.
    pub fn url(&self) -> &Url {
        &self.base
    }

    /// URL of Chat Completions.
    pub fn chat_completions(&self) -> Url {
        self.below(&["chat", "completions"])
    }

    /// The URL with some segments appended to its path; its query stays after them.
    pub fn below(&self, segments: &[&str]) -> Url {
        let mut url = self.base.clone();
        url.path_segments_mut().expect("http URLs have paths").pop_if_empty().extend(segments);
        url
    }

    /// The host, and the port unless it is the scheme's default: the part of an address that may be shown.
    pub fn host(&self) -> String {
        let host = self.base.host_str().unwrap_or_default();
        self.base.port().map_or_else(|| host.to_owned(), |port| format!("{host}:{port}"))
    }
}
