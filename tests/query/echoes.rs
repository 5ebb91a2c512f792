use gprop::query::ask::asker::{AskError, ReplyContent};
use gprop::query::client::ApiKey;
use gprop::query::{Options, Prompts, batch_api};
use serde_json::json;

use super::client::{CANARY, Server, ask, ok};
use super::{a, completion, connect, good_answer, one_segment, prepare, recordings, run};
use crate::support::server::Response;

/// The ways in which a key may stand in JSON that is inside a JSON string: escaped once or twice, or cut off.
fn escaped() -> Vec<String> {
    let units: String = CANARY.chars().map(|c| format!("\\u{:04x}", u32::from(c))).collect();
    let once = CANARY.replace("sk", "\\u0073\\u006B");
    vec![
        CANARY.to_owned(),
        units.replace('\\', "\\\\"),
        once.replace('\\', "\\\\"),
        once,
        units,
        CANARY[..16].to_owned(),
    ]
}

/// True if the key, or more than a few of its characters, stands in a text, also as JSON would read it.
fn has_key(text: &str) -> bool {
    let mut decoded = text.to_owned();
    for _ in 0..3 {
        if decoded.contains(&CANARY[..12]) {
            return true;
        }
        for c in CANARY.chars() {
            for code in [format!("u{:04x}", u32::from(c)), format!("u{:04X}", u32::from(c))] {
                decoded = decoded.replace(&format!("\\{code}"), &c.to_string());
            }
        }
        decoded = decoded.replace("\\\\", "\\").replace("\\/", "/");
    }
    false
}

/// Asks about one segment with the key and the response's body; returns everything that is kept or shown.
fn kept(body: String) -> String {
    let server = Server::new(move |_, _, _| Response::new(200).text(body.clone()));
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), server.options());
    let client = connect(&options, Some(ApiKey::new(CANARY).unwrap())).unwrap().unwrap();
    let queries = prepare(&[one_segment()], &prompts, &options);
    let run = run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
    let files = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    let texts: String =
        files.filter(|path| path.is_file()).map(|path| std::fs::read_to_string(path).unwrap()).collect();
    format!("{}{:?}{texts}", run.answers.to_jsonl(), run.answers)
}

fn captioned(caption: &str) -> String {
    let mut answer = good_answer(a("wood"));
    answer["caption"] = json!("CAPTION");
    answer.to_string().replace("CAPTION", caption)
}

#[test]
fn a_key_that_comes_back_escaped_or_in_part_is_kept_nowhere() {
    for written in escaped() {
        // In the answer, in which it may be escaped once more than in the body.
        let body = completion(&captioned(&format!("sent with {written}")));
        let kept = kept(body.to_string());
        assert!(kept.contains("sent with") && !has_key(&kept), "{written}: {kept}");
        // In the model's name, escaped in the body itself.
        let body = completion(&captioned("a part")).to_string().replace("test-model-0001", &written);
        let kept = self::kept(body);
        assert!(kept.contains("a part") && !has_key(&kept), "{written}: {kept}");
    }
}

#[test]
fn a_key_that_is_split_over_parts_is_kept_nowhere() {
    let answer = captioned(&format!("sent with {CANARY}"));
    let at = answer.find(CANARY).unwrap();
    for within in [1, 5, 9, 11, CANARY.len() - 2] {
        let (first, second) = answer.split_at(at + within);
        let parts = json!([{ "type": "text", "text": first }, { "type": "text", "text": second }]);
        let mut body = completion("");
        body["choices"][0]["message"]["content"] = parts;
        let deltas: Vec<String> = [first, second]
            .map(|part| format!("data: {}\n\n", json!({ "choices": [{ "delta": { "content": part } }] })))
            .to_vec();
        for body in [body.to_string(), deltas.concat()] {
            let kept = kept(body);
            assert!(kept.contains("sent with [key]") && !has_key(&kept), "{within}: {kept}");
        }
    }
}

#[test]
fn a_key_in_an_error_is_not_shown() {
    let key = || Some(ApiKey::new(CANARY).unwrap());
    for written in escaped() {
        let bodies = [
            format!("{{\"error\": {{\"message\": \"Incorrect API key provided: {written}\"}}}}"),
            format!("[{{\"error\": {{\"message\": \"{{\\\"message\\\": \\\"{written}\\\"}}\"}}}}]"),
            format!("no such key: {written}"),
        ];
        for body in bodies {
            let sent = body.clone();
            let server = Server::new(move |_, _, _| Response::new(418).text(sent.clone()));
            let client = connect(&server.options(), key()).unwrap().unwrap();
            let Err(AskError::Failed(message)) = ask(&client, None) else { panic!("{body}") };
            assert!(!has_key(&message), "{body}: {message}");
        }
    }
    let refusal = json!({ "choices": [{ "message": { "content": null, "refusal": format!("Not with {CANARY}.") } }] });
    let server = Server::new(move |_, _, _| Response::new(200).json(&refusal));
    let client = connect(&server.options(), key()).unwrap().unwrap();
    assert_eq!(ask(&client, None).unwrap().content, ReplyContent::Refusal("Not with [key].".into()));
}

/// Otherwise every reply would be cut to pieces.
#[test]
fn a_key_of_one_letter_leaves_replies_whole() {
    for key in ["a", "1", "none", "material"] {
        let server = Server::new(|_, _, request| ok(&captioned(request.header("authorization").unwrap())));
        let (folder, prompts) = (tempfile::tempdir().unwrap(), Prompts::builtin());
        let options = Options { lmm_retries: 0, ..server.options() };
        let client = connect(&options, Some(ApiKey::new(key).unwrap())).unwrap().unwrap();
        let queries = prepare(&[one_segment()], &prompts, &options);
        let run = run(&queries, &recordings(folder.path()), Some(&client)).unwrap();
        assert_eq!(run.answers.failed().count(), 0, "{key}: {:?}", run.answers);
        assert!(run.answers.to_jsonl().contains("\"caption\":\"[key]\""), "{key}: {:?}", run.answers);
    }
}

#[test]
fn a_key_in_the_answers_of_a_batch_api_job_is_kept_nowhere() {
    let server = Server::new(|_, _, _| ok("{}"));
    let client = connect(&server.options(), Some(ApiKey::new(CANARY).unwrap())).unwrap().unwrap();
    let (first, second) = CANARY.split_at(7);
    let parts = json!([{ "text": first }, { "text": second }]);
    for message in [json!({ "content": parts }), json!({ "content": null, "refusal": parts })] {
        let body = json!({ "model": CANARY, "choices": [{ "message": message }] });
        let line = json!({ "custom_id": "q", "response": { "status_code": 200, "body": body } }).to_string();
        let lines = batch_api::lines(&line, &|text| client.without_key(text)).unwrap();
        assert!(format!("{lines:?}").contains("[key]") && !has_key(&format!("{lines:?}")), "{lines:?}");
    }
}
