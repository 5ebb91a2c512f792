//! What a model or a person answered: a response of the endpoint, the answer in it, `answers.jsonl`.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    use gprop::materials::MaterialLibrary;
    use gprop::query::answer::{self, Unknown};
    let text = String::from_utf8_lossy(bytes);
    let _ = gprop::query::client::read_completion(200, &text);
    if let Ok(value) = serde_json::from_slice::<serde_json::Value>(bytes) {
        for unknown in [Unknown::Refuse, Unknown::TakeNearest] {
            let _ = answer::read(value.clone(), MaterialLibrary::builtin(), unknown);
        }
    }
    if let Ok(answers) = gprop::query::Answers::from_jsonl(&text) {
        assert_eq!(gprop::query::Answers::from_jsonl(&answers.to_jsonl()).ok(), Some(answers));
    }
});
