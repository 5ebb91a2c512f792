//! The proxy between gprop and a server: the one that `HTTPS_PROXY`, `HTTP_PROXY` or `ALL_PROXY` names, unless `NO_PROXY` excludes the server.
//! A server on this machine is reached directly: a proxy would look for it on the proxy's own machine.

use hyper_util::client::proxy::matcher::Matcher;
use reqwest::Url;

/// Host and port of the proxy through which reqwest reaches `server`; `None` if it connects directly. Its user name and password are not
/// shown.
pub fn of(server: &Url) -> Option<String> {
    // reqwest asks the same matcher.
    named_by(&Matcher::from_system(), server)
}

fn named_by(matcher: &Matcher, server: &Url) -> Option<String> {
    if is_this_machine(server) {
        return None;
    }
    let proxy = matcher.intercept(&server.as_str().parse().ok()?)?;
    let host = proxy.uri().host()?;
    Some(proxy.uri().port_u16().map_or_else(|| host.to_owned(), |port| format!("{host}:{port}")))
}

/// True for `localhost`, names below it, and addresses of the loopback interface.
pub fn is_this_machine(server: &Url) -> bool {
    let host = server.host_str().unwrap_or_default();
    let name = host.trim_end_matches('.');
    let address = host.trim_start_matches('[').trim_end_matches(']').parse::<std::net::IpAddr>();
    name == "localhost"
        || name.ends_with(".localhost")
        || address.is_ok_and(|address| address.to_canonical().is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proxy(server: &str) -> Option<String> {
        let matcher = Matcher::builder().all("http://me:secret@proxy.example:3128").no("inside.example").build();
        named_by(&matcher, &Url::parse(server).unwrap())
    }

    #[test]
    fn a_proxy_is_named_without_its_password() {
        for server in ["https://api.example/v1", "http://10.0.0.7:8000/v1", "http://localhost.example/v1"] {
            assert_eq!(proxy(server).as_deref(), Some("proxy.example:3128"), "{server}");
        }
        assert_eq!(proxy("https://inside.example/v1"), None, "NO_PROXY");
    }

    #[test]
    fn this_machine_is_reached_directly() {
        for host in
            ["localhost:8000", "LOCALHOST", "localhost.", "models.localhost", "127.0.0.1", "127.9.9.9:80", "[::1]:1"]
        {
            assert_eq!(proxy(&format!("http://{host}/v1")), None, "{host}");
        }
        assert_eq!(proxy("http://[::ffff:127.0.0.1]/v1"), None, "an IPv4 address written as IPv6");
    }
}
