use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gprop::query::Options;
use gprop::query::ask::asker::AskError;
use serde_json::{Value, json};

use super::client::{Server, ask, ok};
use super::{connect, good_answer};
use crate::support::server::Response;

/// A 429 with this body and these headers.
fn busy(body: &Value, headers: &[(&'static str, &str)]) -> Response {
    headers.iter().fold(Response::new(429).json(body), |response, (name, value)| response.header(name, *value))
}

/// The message of a client that may not wait at all.
fn refused_wait(response: &Response) -> String {
    let response = response.clone();
    let server = Server::new(move |_, _, _| response.clone());
    let options = Options { lmm_wait_s: 0, lmm_retries: 1, ..server.options() };
    let AskError::Failed(message) = ask(&connect(&options, None).unwrap().unwrap(), None).unwrap_err() else {
        panic!("a wait is not fatal")
    };
    assert_eq!(server.requests().len(), 1, "{message}");
    message
}

fn error(message: &str) -> Value {
    json!({ "error": { "code": 429, "message": message } })
}

/// As Gemini's endpoint writes it.
fn of_gemini(message: &str, details: Value) -> Value {
    json!([{ "error": { "code": 429, "message": message, "status": "RESOURCE_EXHAUSTED", "details": details } }])
}

fn retry_info(delay: Value) -> Value {
    json!({ "@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": delay })
}

/// As OpenRouter passes headers on.
fn of_openrouter(headers: Value) -> Value {
    json!({ "error": { "code": 429, "message": "Rate limit exceeded: free-models-per-min",
                       "metadata": { "headers": headers } }, "user_id": "u" })
}

#[test]
fn the_wait_is_what_the_server_asks_for_wherever_it_says_so() {
    let plain = error("slow down");
    let raw = of_gemini("busy", json!([retry_info(json!("39s"))])).to_string();
    let behind = json!({ "error": { "message": "Provider returned error", "code": 429, "metadata": { "raw": raw } } });
    let table = [
        (busy(&plain, &[("retry-after", "39")]), 39),
        (busy(&plain, &[("retry-after", "38.5")]), 39),
        (busy(&plain, &[("retry-after-ms", "38500"), ("retry-after", "60")]), 39),
        (busy(&plain, &[("x-ms-retry-after-ms", "39000")]), 39),
        (busy(&plain, &[("x-ratelimit-reset-requests", "39")]), 39),
        (busy(&plain, &[("x-ratelimit-reset-tokens", "6m0s")]), 360),
        (busy(&plain, &[("x-ratelimit-reset-requests", "1s"), ("x-ratelimit-reset-tokens", "1m2.5s")]), 63),
        (
            busy(
                &plain,
                &[
                    ("x-ratelimit-reset-requests", "39s"),
                    ("x-ratelimit-remaining-requests", "0"),
                    ("x-ratelimit-reset-tokens", "6m0s"),
                    ("x-ratelimit-remaining-tokens", "5000"),
                ],
            ),
            39,
        ),
        (busy(&of_gemini("busy", json!([retry_info(json!("39s"))])), &[]), 39),
        (busy(&of_gemini("busy", json!([retry_info(json!("38.2s"))])), &[]), 39),
        (busy(&of_gemini("busy", json!([retry_info(json!({ "seconds": 39 }))])), &[]), 39),
        (busy(&of_gemini("Please retry in 38.2s.", json!([])), &[]), 39),
        (busy(&of_gemini("busy", json!([retry_info(json!("39s"))]))[0], &[]), 39),
        (busy(&error("Limit 15000, Used 11972. Please try again in 5.289s. Visit https://x.org"), &[]), 6),
        (busy(&error("Please retry after 39 seconds."), &[]), 39),
        (busy(&error("Please try again in 1h2m3s."), &[]), 3723),
        (busy(&error("Please try again in 350ms."), &[]), 1),
        (busy(&of_openrouter(json!({ "Retry-After": "39" })), &[]), 39),
        (busy(&behind, &[]), 39),
    ];
    for (response, seconds) in table {
        let message = refused_wait(&response);
        assert!(message.contains(&format!("asks to wait {seconds} s")), "{seconds} s: {message}");
        assert!(!message.contains(['{', '[']), "{message}");
    }
}

#[test]
fn a_moment_at_which_to_come_back_is_waited_for() {
    let in_an_hour = SystemTime::now() + Duration::from_secs(3600);
    let since_1970 = in_an_hour.duration_since(UNIX_EPOCH).unwrap();
    let (seconds, milliseconds) = (since_1970.as_secs().to_string(), since_1970.as_millis().to_string());
    let date = httpdate::fmt_http_date(in_an_hour);
    let plain = error("slow down");
    let reset = json!({ "X-RateLimit-Limit": "20", "X-RateLimit-Remaining": "0", "X-RateLimit-Reset": milliseconds });
    for response in [
        busy(&plain, &[("retry-after", &date)]),
        busy(&plain, &[("x-ratelimit-reset", &seconds)]),
        busy(&plain, &[("X-RateLimit-Reset", &milliseconds)]),
        busy(&of_openrouter(reset), &[]),
    ] {
        let message = refused_wait(&response);
        // On a slow machine, some of the hour has passed.
        let asked = |seconds: u32| message.contains(&format!("asks to wait {seconds} s"));
        assert!((3540..=3600).any(asked), "{message}");
    }
}

#[test]
fn a_moment_that_has_passed_and_a_count_beside_another_error_are_no_wish_to_wait() {
    for response in [
        busy(&error("slow down"), &[("x-ratelimit-reset", "1700000000")]),
        Response::new(503).json(error("overloaded")).header("x-ratelimit-reset-requests", "3600"),
    ] {
        let server = Server::new(move |count, _, _| match count {
            0 => response.clone(),
            _ => ok(&good_answer(super::a("wood")).to_string()),
        });
        let options = Options { lmm_wait_s: 0, ..server.options() };
        assert!(ask(&connect(&options, None).unwrap().unwrap(), None).is_ok());
    }
}

#[test]
fn a_quota_per_day_is_final() {
    let violation =
        |id: &str| json!({ "@type": "type.googleapis.com/google.rpc.QuotaFailure", "violations": [{ "quotaId": id }] });
    let per_day = violation("GenerateRequestsPerDayPerProjectPerModel-FreeTier");
    for body in [
        of_gemini("You exceeded your current quota. Please retry in 1s.", json!([per_day, retry_info(json!("1s"))])),
        json!({ "error": { "message": "Rate limit exceeded: free-models-per-day. Add credits." } }),
        error("Rate limit reached on requests per day (RPD): Limit 200. Please try again in 7m12s."),
        error("Your daily limit is reached."),
    ] {
        let server = Server::new(move |_, _, _| Response::new(429).json(&body));
        let AskError::Fatal(message) = server.ask().unwrap_err() else { panic!("it is final") };
        assert!(message.contains("per day is used up") && !message.contains('{'), "{message}");
        assert_eq!(server.requests().len(), 1);
    }
    let per_minute = violation("GenerateRequestsPerMinutePerProjectPerModel-FreeTier");
    let body = of_gemini("Quotas are per minute and per day.", json!([per_minute, retry_info(json!("39s"))]));
    assert!(refused_wait(&busy(&body, &[])).contains("asks to wait 39 s"));
}
