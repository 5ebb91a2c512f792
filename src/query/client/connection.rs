//! Why a request got no response: the cause, and what to do about it, in words.

use std::error::Error;
use std::io;

use rustls::{CertificateError, InvalidMessage};

use super::address::Address;
use super::retry::Attempt;
use super::{proxy, trust};
use crate::query::ask::asker::AskError;

/// The way to a server, for messages.
#[derive(Debug)]
pub struct Route {
    /// The host of the server, with its port unless that is the scheme's default.
    host: String,
    /// The proxy through which the environment leads, if any: its host and port.
    proxy: Option<String>,
    /// The certificates of the machine that could not be read.
    unread: Vec<String>,
}

impl Route {
    /// The way to `address`.
    pub fn new(address: &Address, unread: Vec<String>) -> Self {
        Self { host: address.host(), proxy: proxy::of(address.url()), unread }
    }

    /// The failure of a request that got no complete response.
    pub fn failure(&self, error: &reqwest::Error) -> Attempt {
        if error.is_connect() {
            return self.unconnected(error);
        }
        let cause = innermost(error);
        let message = if error.is_timeout() {
            format!("no response in time ({cause}); raise --lmm-timeout-s to wait longer")
        } else {
            format!("the connection failed: {cause}")
        };
        Attempt::Passing { message, retry_after: None }
    }

    fn unconnected(&self, error: &reqwest::Error) -> Attempt {
        if let Some(error) = causes(error).find_map(|cause| cause.downcast_ref::<rustls::Error>()) {
            let message = format!("cannot connect to {}: {}", self.host, self.without_tls(error));
            return Attempt::Final(AskError::Fatal(message));
        }
        let what = if error.is_timeout() {
            "no connection in time; is the address right, and does a firewall let it through?".to_owned()
        } else {
            self.unreachable(error)
        };
        let message = match &self.proxy {
            None => format!("cannot connect to {}: {what}", self.host),
            Some(proxy) => format!(
                "cannot connect to {} through the proxy {proxy}, which the environment names (HTTPS_PROXY, HTTP_PROXY, \
                 ALL_PROXY): {what}; a host that NO_PROXY lists is reached without the proxy",
                self.host
            ),
        };
        Attempt::Unreachable { message }
    }

    fn unreachable(&self, error: &reqwest::Error) -> String {
        let cause = innermost(error);
        let is_refused = |cause: &(dyn Error + 'static)| {
            cause.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::ConnectionRefused)
        };
        // The type of hyper-util's error is private.
        let is_unknown = |cause: &(dyn Error + 'static)| cause.to_string() == "dns error";
        let of_proxy = self.proxy.is_some();
        if causes(error).any(is_refused) {
            let remedy = if of_proxy { "is it running?" } else { "is the server running, and is the port right?" };
            return format!("connection refused; {remedy}");
        }
        if causes(error).any(is_unknown) {
            let host = if of_proxy { "the proxy's host" } else { "the host" };
            return format!("{host} is unknown ({cause}); check its name, and that this machine is online");
        }
        cause
    }

    /// Why TLS does not come about.
    fn without_tls(&self, error: &rustls::Error) -> String {
        use rustls::Error::{InvalidCertificate, InvalidMessage as Invalid};
        let unread = if self.unread.is_empty() {
            String::new()
        } else {
            format!(" (certificates that could not be read: {})", self.unread.join("; "))
        };
        match error {
            Invalid(InvalidMessage::InvalidContentType) => {
                "it does not speak TLS; if it is meant to be reached without, begin --lmm-url with http://".to_owned()
            }
            InvalidCertificate(CertificateError::UnknownIssuer) => format!(
                "its certificate is not trusted (UnknownIssuer); name the certificate of the authority that issued it \
                 in SSL_CERT_FILE, or add that to the system's{unread}"
            ),
            error if trust::is_about_a_root(error) => format!(
                "its certificate is not trusted (it signed itself); name it in SSL_CERT_FILE, or add it to the system's\
                 {unread}"
            ),
            InvalidCertificate(_) => format!("its certificate is not valid: {error}"),
            error => format!("TLS failed: {error}"),
        }
    }
}

/// An error and all that caused it, from the outermost to the innermost.
fn causes<'e>(error: &'e (dyn Error + 'static)) -> impl Iterator<Item = &'e (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&error: &&'e (dyn Error + 'static)| {
        // The source of such an error is that of the error it holds, which would itself be left out.
        let held = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
        held.map(|held| held as &(dyn Error + 'static)).or_else(|| error.source())
    })
}

fn innermost(error: &reqwest::Error) -> String {
    causes(error).last().map_or_else(String::new, ToString::to_string)
}
