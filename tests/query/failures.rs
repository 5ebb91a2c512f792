//! A server that fails in whatever way is asked no more often than was announced, and not on and on.

use std::process::Output;

use gprop::query::ask::budget::Budget;
use gprop::query::ask::cost::{Price, PriceTable};
use gprop::query::{Failure, InVain, Options, Outcome, Prompts, QueryError, Run};
use gprop::words::progress::Progress;
use serde_json::json;

use super::client::{Server, error, ok};
use super::{a, completion, connect, good_answer, grid, prepare, recordings};
use crate::batch::ball::Balls;
use crate::run::gprop;
use crate::support::server::Response;
use crate::support::stderr;

/// How a server fails, and what the run's error says about it.
struct Case {
    name: &'static str,
    response: Response,
    /// The number of requests until the run stops.
    requests: usize,
    says: &'static str,
}

fn of_choice(finish_reason: &str, message: serde_json::Value) -> Response {
    Response::new(200).json(json!({ "choices": [{ "finish_reason": finish_reason, "message": message }] }))
}

/// Every request gets the same response. With two retries, a question takes up to three requests in one form.
fn cases() -> Vec<Case> {
    let case = |name, response, requests, says| Case { name, response, requests, says };
    let soon = |status| error(status, "later").header("retry-after-ms", "1");
    let per_day = json!([{ "error": { "code": 429, "message": "You exceeded your current quota",
        "status": "RESOURCE_EXHAUSTED", "details": [{ "@type": "type.googleapis.com/google.rpc.QuotaFailure",
        "violations": [{ "quotaId": "GenerateRequestsPerDayPerProjectPerModel-FreeTier" }] }] } }]);
    let chunk = json!({ "choices": [{ "delta": { "content": "I would rather" }, "finish_reason": null }] });
    vec![
        case("prose", ok("I would rather not say."), 5, "I would rather not say."),
        case("an empty reply", of_choice("stop", json!({ "content": "" })), 6, "empty"),
        case("a reply that was cut", of_choice("length", json!({ "content": "{\"caption\": \"a sti" })), 5, "a sti"),
        case("a refusal", of_choice("stop", json!({ "content": null, "refusal": "No." })), 5, "refused to answer: No."),
        case("a picture too large", error(413, "Request Entity Too Large"), 5, "413"),
        case("a failing server", soon(500), 6, "500: later"),
        case("an overloaded server", soon(503), 6, "503: later"),
        case("a server that asks to wait", soon(429), 6, "429: later"),
        case("a quota per day", Response::new(429).json(per_day), 1, "You exceeded your current quota"),
        case("a page", Response::new(200).text("<html>sign in</html>"), 6, "not a chat completion"),
        case("a stream", Response::new(200).text(format!("data: {chunk}\n\ndata: [DONE]\n\n")), 5, "I would rather"),
        case("a request in no form accepted", error(400, "this model takes no pictures"), 6, "takes no pictures"),
        case("a wrong key", error(401, "Incorrect API key"), 1, "Incorrect API key"),
    ]
}

fn gpt_4o() -> Option<Price> {
    PriceTable::builtin().price("gpt-4o").cloned()
}

/// Asks about the segments of one view.
fn ask_about(segments: u32, options: &Options) -> (Result<Run, QueryError>, Budget) {
    let (folder, prompts) = (tempfile::tempdir().unwrap(), Prompts::builtin());
    let client = connect(options, None).unwrap().unwrap();
    let budget = Budget::new(gpt_4o(), options.max_usd);
    let queries = prepare(&[grid(segments)], &prompts, options);
    let result = queries.run(&recordings(folder.path()), Some(&client), &budget, Progress::HIDDEN);
    (result, budget)
}

#[test]
fn a_server_that_always_fails_is_asked_a_handful_of_times_and_its_failure_is_told_once() {
    for Case { name, response, requests, says } in cases() {
        let server = Server::new(move |_, _, _| response.clone());
        let (result, _) = ask_about(25, &Options { lmm_retries: 2, ..server.options() });
        let message = result.expect_err(name).to_string();
        assert_eq!(message.matches(says).count(), 1, "{name}: {message}");
        assert!(message.contains("25 questions are not answered"), "{name}: {message}");
        assert_eq!(server.requests().len(), requests, "{name}: {message}");
    }
}

#[test]
fn what_may_have_been_billed_stays_within_max_usd_however_a_server_fails() {
    // Enough for two requests of the highest cost and a half.
    let limit = 2.5 * (1000.0 * 2.5e-6 + 4000.0 * 10e-6);
    for Case { name, response, .. } in cases() {
        let server = Server::new(move |_, _, _| response.clone());
        let (result, budget) = ask_about(25, &Options { lmm_retries: 2, max_usd: Some(limit), ..server.options() });
        assert!(result.is_err(), "{name}");
        assert!(budget.spent().usd.unwrap() <= limit, "{name}: {:?}", budget.spent());
        assert_eq!(budget.sent(), server.requests().len(), "{name}: every request is in the books");
    }
}

#[test]
fn the_error_shows_a_reply_and_says_what_was_tried() {
    let server = Server::new(|_, _, _| ok("I would rather not say."));
    let (result, _) = ask_about(25, &server.options());
    let Err(QueryError::InVain(in_vain)) = result else { panic!("{result:?}") };
    let InVain { requests: 5, last: Failure::Invalid { .. }, reply: Some(reply), tried, left: 25, spent } = *in_vain
    else {
        panic!("{in_vain:?}")
    };
    assert_eq!(reply, "I would rather not say.");
    assert_eq!(tried, ["with a JSON schema", "with a correction"]);
    assert_eq!(spent.requests, 5);
}

#[test]
fn a_failure_now_and_then_stops_nothing() {
    // Of 25 questions, a third fail for good, but never five requests in a row.
    let server = Server::new(|count, _, _| match count % 3 {
        2 => error(413, "Request Entity Too Large"),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    let (result, _) = ask_about(25, &server.options());
    let failed = result.unwrap().answers.failed().count();
    assert_eq!((failed, server.requests().len()), (8, 25));
}

#[test]
fn a_round_of_which_every_question_fails_alike_ends_the_run_unless_the_model_refused_them() {
    let server = Server::new(|_, _, _| error(413, "Request Entity Too Large"));
    let (result, _) = ask_about(2, &server.options());
    let Err(QueryError::InVain(in_vain)) = result else { panic!("{result:?}") };
    assert_eq!((in_vain.requests, in_vain.left), (2, 2));

    let refusal = of_choice("stop", json!({ "content": null, "refusal": "No." }));
    let server = Server::new(move |_, _, _| refusal.clone());
    let (result, _) = ask_about(2, &server.options());
    assert_eq!(result.unwrap().answers.failed().count(), 2);
}

#[test]
fn one_question_is_asked_at_a_time_until_a_reply_is_usable() {
    // The form of request is found out once, whatever the number of threads.
    let server = Server::new(|_, body, _| match body["response_format"]["type"].as_str() {
        Some(_) => error(400, "response_format is not supported"),
        None => ok(&good_answer(a("wood")).to_string()),
    });
    let (result, _) = ask_about(25, &Options { lmm_parallel: 8, ..server.options() });
    assert!(result.unwrap().answers.all.iter().all(|answer| matches!(answer.outcome, Outcome::Answered(_))));
    assert_eq!(server.requests().len(), 2 + 25);
}

/// Asks about a ball's segments.
fn query(server: &Server, model: &str, more: &[&str]) -> Output {
    let balls = Balls::new(1);
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("query").arg(balls.scene(0)).args(["-q", "--lmm-retries", "2"]);
    command.args(["--lmm-url", &server.options().lmm_url.unwrap(), "--lmm-model", model]).args(more);
    command.output().unwrap()
}

/// The number before the word that begins with `noun`, after `before`.
fn number(text: &str, before: &str, noun: &str) -> usize {
    let rest = text.split_once(before).unwrap_or_else(|| panic!("no {before:?} in {text}")).1;
    rest.split_once(noun).unwrap().0.trim().parse().unwrap_or_else(|_| panic!("{text}"))
}

#[test]
fn no_more_requests_are_sent_than_were_announced() {
    for Case { name, response, .. } in cases() {
        let server = Server::new(move |_, _, _| response.clone());
        let output = query(&server, "gpt-4o", &[]);
        assert_eq!(output.status.code(), Some(5), "{name}: {}", stderr(&output));
        let announced = number(&stderr(&output), ": up to ", "requests");
        assert!(server.requests().len() <= announced, "{name}: {} of {announced}", server.requests().len());
    }
    // Even if every question needs every try that it has.
    let server = Server::new(|count, body, _| match (count % 4, body["messages"].as_array().unwrap().len()) {
        (0 | 1, _) => error(503, "later").header("retry-after-ms", "1"),
        (_, 1) => ok("Let me think."),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    let output = query(&server, "gpt-4o", &["--lmm-parallel", "1"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let (announced, sent) = (number(&stderr(&output), ": up to ", "requests"), server.requests().len());
    let usual = number(&stderr(&output), "if all replies are usable, ", "requests");
    assert!(sent <= announced && sent > 2 * usual, "{usual} < {sent} <= {announced}");
}

#[test]
fn a_budget_of_requests_is_kept() {
    let budget = Budget::new(None, None);
    let account = budget.account(gprop::query::ask::cost::Cost::default());
    budget.announce(2);
    account.open().unwrap().not_billed();
    account.open().unwrap().answered(None);
    assert_eq!(account.open().unwrap_err(), gprop::query::ask::budget::NotSent::Announced);
    budget.announce(1);
    assert!(account.open().is_ok());
}

#[test]
fn a_model_on_this_machine_costs_nothing_and_a_price_may_be_typed() {
    let server = Server::new(|_, _, _| Response::new(200).json(completion(&good_answer(a("wood")).to_string())));
    let output = query(&server, "qwen2.5vl", &["--max-usd", "0"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("--max-usd counts nothing"), "{}", stderr(&output));
    // A gateway on this machine may charge for a model that has a price.
    let output = query(&server, "gpt-4o", &["--max-usd", "0"]);
    assert!(stderr(&output).contains("more than --max-usd 0"), "{}", stderr(&output));
    let output = query(&server, "gpt-4o", &["--max-usd", "0", "--price", "0"]);
    assert!(output.status.success() && stderr(&output).contains("counts nothing"), "{}", stderr(&output));
    let output = query(&server, "qwen2.5vl", &["--max-usd", "0.001", "--price", "1000,0"]);
    assert!(stderr(&output).contains("more than --max-usd 0.001"), "{}", stderr(&output));

    // No price is known of a model elsewhere. Nothing is sent, so the host need not exist.
    let balls = Balls::new(1);
    let mut elsewhere = gprop();
    elsewhere.arg("query").arg(balls.scene(0)).args(["-q", "--lmm-url", "http://model.invalid/v1", "--lmm-model", "m"]);
    let output = elsewhere.args(["--max-usd", "1"]).output().unwrap();
    assert!(stderr(&output).contains("--price 0 if nothing is charged"), "{}", stderr(&output));
    for price in ["-1", "nan", "1,2,3", "cheap"] {
        let output = gprop().args(["query", "nowhere", &format!("--price={price}")]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{price}: {}", stderr(&output));
    }
}
