//! Connections that do not open say why; certificates of the machine's own authorities count; keys are sent as the server
//! wants them.

use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gprop::query::Options;
use gprop::query::ask::asker::AskError;
use rcgen::{BasicConstraints, Certificate, CertificateParams, IsCa, Issuer, KeyPair};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};

use super::client::{CANARY, Server, ask, error, ok};
use super::{a, connect, good_answer, small};
use crate::batch::ball::Balls;
use crate::run::gprop;
use crate::support::server::{Listener, read_request, write_response};
use crate::support::stderr;

/// A server on 127.0.0.1 that speaks TLS and gives every question the same answer.
struct TlsServer(Listener);

impl TlsServer {
    fn new(chain: Vec<CertificateDer<'static>>, key: &KeyPair) -> Self {
        let key = PrivateKeyDer::try_from(key.serialize_der()).unwrap();
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
        let config = Arc::new(config.with_no_client_auth().with_single_cert(chain, key).unwrap());
        Self(Listener::new(move |stream| {
            let mut stream = StreamOwned::new(ServerConnection::new(Arc::clone(&config)).unwrap(), stream);
            while let Some(_request) = read_request(&mut stream) {
                write_response(&mut stream, &ok(&good_answer(a("wood")).to_string())).unwrap();
            }
        }))
    }

    fn url(&self) -> String {
        format!("{}/v1", self.0.uri().replace("http://", "https://"))
    }
}

fn certificate_of(name: &str, is_authority: bool) -> CertificateParams {
    let mut params = CertificateParams::new([name.to_owned()]).unwrap();
    if is_authority {
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    }
    params
}

/// Writes the certificate as PEM, which is what `SSL_CERT_FILE` names.
fn write_pem(folder: &Path, certificate: &Certificate) -> PathBuf {
    let path = folder.join("authority.pem");
    let base64 = STANDARD.encode(certificate.der());
    std::fs::write(&path, format!("-----BEGIN CERTIFICATE-----\n{base64}\n-----END CERTIFICATE-----\n")).unwrap();
    path
}

/// Asks a server about a ball, with these environment variables.
fn query(url: &str, variables: &[(&str, &str)], more: &[&str]) -> Output {
    let balls = Balls::new(1);
    let mut command = gprop();
    for name in ["OPENAI_API_KEY", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "http_proxy", "https_proxy", "all_proxy"] {
        command.env_remove(name);
    }
    command.env_remove("SSL_CERT_DIR").arg("query").arg(balls.scene(0)).args(["-q", "--lmm-retries", "0"]);
    command.args(["--lmm-url", url, "--lmm-model", "m"]).args(more).envs(variables.iter().copied());
    command.output().unwrap()
}

/// The error of asking a server at this address.
fn failure(url: &str) -> String {
    let options = Options { lmm_url: Some(url.into()), lmm_model: Some("m".into()), lmm_retries: 0, ..small() };
    match ask(&connect(&options, None).unwrap().unwrap(), None) {
        Err(AskError::Fatal(message)) => message,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_connection_that_does_not_open_says_why() {
    let refused = failure("http://127.0.0.1:1/v1");
    assert!(refused.starts_with("cannot connect to 127.0.0.1:1: connection refused"), "{refused}");
    let unknown = failure("http://nosuchhost.invalid/v1");
    assert!(unknown.starts_with("cannot connect to nosuchhost.invalid: the host is unknown ("), "{unknown}");
    let plain = Listener::new(|mut stream| {
        let _ = std::io::Write::write_all(&mut stream, b"HTTP/1.1 400 Bad Request\r\ncontent-length: 0\r\n\r\n");
    });
    let plain = failure(&plain.uri().replace("http://", "https://"));
    assert!(plain.contains("does not speak TLS") && plain.contains("begin --lmm-url with http://"), "{plain}");
}

#[test]
fn a_proxy_that_does_not_answer_is_named_without_its_password() {
    let proxy = format!("http://user:{CANARY}@127.0.0.1:1");
    let output = query("http://model.invalid/v1", &[("HTTP_PROXY", &proxy)], &[]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(5), "{said}");
    for words in ["cannot connect to model.invalid through the proxy 127.0.0.1:1", "connection refused", "NO_PROXY"] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    assert!(!said.contains(CANARY), "{said}");
}

#[test]
fn a_certificate_of_an_unknown_authority_is_refused_until_ssl_cert_file_names_that() {
    let folder = tempfile::tempdir().unwrap();
    let (key, key_of_authority) = (KeyPair::generate().unwrap(), KeyPair::generate().unwrap());
    let authority = certificate_of("an authority", true);
    let root = authority.self_signed(&key_of_authority).unwrap();
    let issuer = Issuer::new(authority, key_of_authority);
    let signed = |name: &str| certificate_of(name, false).signed_by(&key, &issuer).unwrap().der().clone();
    let own = certificate_of("127.0.0.1", true).self_signed(&key).unwrap();

    let pem = write_pem(folder.path(), &root);
    let trusting = [("SSL_CERT_FILE", pem.to_str().unwrap())];
    let server = TlsServer::new(vec![signed("127.0.0.1")], &key);
    let unknown = failure(&server.url());
    assert!(unknown.contains("UnknownIssuer") && unknown.contains("SSL_CERT_FILE"), "{unknown}");
    let output = query(&server.url(), &trusting, &[]);
    assert!(output.status.success(), "{}", stderr(&output));

    let missing = folder.path().join("missing.pem");
    let output = query(&server.url(), &[("SSL_CERT_FILE", missing.to_str().unwrap())], &[]);
    assert!(
        stderr(&output).contains("missing.pem") && stderr(&output).contains("UnknownIssuer"),
        "{}",
        stderr(&output)
    );

    let elsewhere = TlsServer::new(vec![signed("another.example")], &key);
    let output = query(&elsewhere.url(), &trusting, &[]);
    assert!(stderr(&output).contains("another.example"), "its name is wrong all the same: {}", stderr(&output));

    // As `openssl req -x509` makes them: the server's certificate is its own authority.
    let server = TlsServer::new(vec![own.der().clone()], &key);
    let untrusted = failure(&server.url());
    assert!(untrusted.contains("signed itself") && untrusted.contains("SSL_CERT_FILE"), "{untrusted}");
    let pem = write_pem(folder.path(), &own);
    let output = query(&server.url(), &[("SSL_CERT_FILE", pem.to_str().unwrap())], &[]);
    assert!(output.status.success(), "{}", stderr(&output));
}

#[test]
fn a_root_of_the_machine_that_is_for_another_name_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let key = KeyPair::generate().unwrap();
    let own = certificate_of("another.example", true).self_signed(&key).unwrap();
    let pem = write_pem(folder.path(), &own);
    let server = TlsServer::new(vec![own.der().clone()], &key);
    let output = query(&server.url(), &[("SSL_CERT_FILE", pem.to_str().unwrap())], &[]);
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    assert!(stderr(&output).contains("another.example"), "{}", stderr(&output));
}

#[test]
fn a_key_is_read_from_the_named_variable_and_sent_in_the_named_header() {
    let server = Server::new(|_, _, request| match (request.header("api-key"), request.header("authorization")) {
        (Some(CANARY), None) => ok(&good_answer(a("wood")).to_string()),
        _ => error(401, "Access denied due to invalid subscription key or wrong API endpoint."),
    });
    let url = server.options().lmm_url.unwrap();
    let named = ["--lmm-key-env", "AZURE_KEY", "--lmm-key-header", "api-key"];
    let output = query(&url, &[("AZURE_KEY", CANARY), ("OPENAI_API_KEY", "sk-of-another-server")], &named);
    assert!(output.status.success(), "{}", stderr(&output));

    let output = query(&url, &[("AZURE_KEY", CANARY)], &named[..2]);
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    let said_about = stderr(&output);
    assert!(said_about.contains("the key in AZURE_KEY") && said_about.contains("--lmm-key-header"), "{said_about}");
    let output = query(&url, &[], &[]);
    assert!(stderr(&output).contains("set OPENAI_API_KEY to a key for this server"), "{}", stderr(&output));
}

#[test]
fn a_variable_without_a_key_is_named_and_a_key_in_its_place_is_not_repeated() {
    let output = query("http://127.0.0.1:1/v1", &[], &["--lmm-key-env", "NO_SUCH_KEY"]);
    assert_eq!(output.status.code(), Some(5), "{}", stderr(&output));
    assert!(stderr(&output).contains("--lmm-key-env: NO_SUCH_KEY is not set"), "{}", stderr(&output));
    let output = query("http://127.0.0.1:1/v1", &[], &["--lmm-key-env", CANARY]);
    assert!(stderr(&output).contains("--lmm-key-env") && !stderr(&output).contains(CANARY), "{}", stderr(&output));
    // Nothing is sent, so no key is needed.
    let output = query("http://127.0.0.1:1/v1", &[], &["--lmm-key-env", "NO_SUCH_KEY", "--dry-run"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let output = gprop().args(["query", "nowhere", "--lmm-key-header", "Content-Type"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}
