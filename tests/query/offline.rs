//! Offline means that no connection is opened: listeners on loopback see none.

use std::io::ErrorKind;
use std::net::TcpListener;

use gprop::query::ask::asker::AskError;
use gprop::query::client::Client;
use gprop::query::{Options, Prompts, QueryError};
use gprop::setup::{Environment, Offline};
use gprop::words::progress::Progress;

use super::client::ask;
use super::{prepare, recordings, small, two_segments};

/// A listener that accepts no connection, and its address as `--lmm-url` takes it.
pub fn listener() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let url = format!("http://{}/v1", listener.local_addr().unwrap());
    (listener, url)
}

/// Fails if a connection was opened.
pub fn assert_untouched(listener: &TcpListener) {
    let accepted = listener.accept().map(|(_, from)| from);
    assert!(matches!(&accepted, Err(error) if error.kind() == ErrorKind::WouldBlock), "{accepted:?}");
}

#[test]
fn one_place_decides_whether_connections_may_be_opened() {
    let environment = |offline| Environment { offline, ..Environment::default() };
    assert_eq!(environment(false).network(false), Ok(()));
    assert_eq!(environment(false).network(true), Err(Offline::Flag));
    assert_eq!(environment(true).network(false), Err(Offline::Variable));
    assert!(Offline::Variable.to_string().contains("GPROP_OFFLINE") && Offline::Flag.to_string().contains("--offline"));
}

#[test]
fn no_request_of_any_kind_opens_a_connection() {
    let (listener, url) = listener();
    let options = Options { lmm_url: Some(url), lmm_model: Some("m".into()), ..small() };
    let client = Client::new(&options, None, Err(Offline::Variable), Progress::HIDDEN).unwrap().unwrap();
    let refused = [
        ask(&client, None).map(|_| ()),
        client.start_batch_api_job("{}\n").map(|_| ()),
        client.batch_api_job("b").map(|_| ()),
        client.file("f").map(|_| ()),
    ];
    for result in refused {
        assert_eq!(result, Err(AskError::Offline(Offline::Variable)));
    }
    assert_untouched(&listener);
}

#[test]
fn a_run_that_would_have_to_ask_says_what_forbids_it() {
    let (listener, url) = listener();
    let (folder, prompts) = (tempfile::tempdir().unwrap(), Prompts::builtin());
    let options = Options { lmm_url: Some(url), lmm_model: Some("m".into()), ..small() };
    let client = Client::new(&options, None, Err(Offline::Flag), Progress::HIDDEN).unwrap().unwrap();
    let place = folder.path().join("recorded");
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let error = super::run(&queries, &recordings(&place), Some(&client)).unwrap_err();
    assert!(matches!(&error, QueryError::NotReady { questions: 2, .. }), "{error}");
    assert!(error.to_string().contains("--offline"), "{error}");
    assert!(!place.exists(), "nothing was tried");
    assert_untouched(&listener);
}
