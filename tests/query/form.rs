//! The form on which a person answers, in headless Chromium, with the keyboard alone.

use std::fs;

use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::Prompts;
use gprop::query::exchange;
use serde_json::{Value, json};

use super::exchange::export;
use super::{a, prepare, prepare_about, recordings, small, two_segments};
use crate::support::browser::Page;

/// Seconds that a practised person needs to press a key and to decide on the next step, from the keystroke-level model
/// (Card, Moran and Newell, "The keystroke-level model for user performance time with interactive systems", 1980): an
/// average non-secretary typist, and the mental preparation M.
const KEY_S: f64 = 0.28;
const DECIDE_S: f64 = 1.35;
/// Seconds to look at a picture before answering: an assumption.
const LOOK_S: f64 = 4.0;

/// What was needed to answer one question.
#[derive(Debug, Clone, Copy, Default)]
struct Effort {
    keys: usize,
    fields: usize,
}

impl Page {
    fn type_keys(&self, text: &str) -> usize {
        for key in text.chars() {
            self.press_key(&key.to_string());
        }
        text.chars().count()
    }

    fn enter(&self) -> usize {
        self.press_key("Enter");
        1
    }

    /// What has the focus: `combo`, `radio`, `number`, `text`, or the id of a button.
    fn focused(&self) -> String {
        let focus = self.evaluate(
            "(() => { const node = document.activeElement;
              return node.closest('.combo') ? 'combo' : node.type === 'radio' ? 'radio'
                  : node.inputMode === 'decimal' ? 'number' : node.matches('button') ? node.id : 'text'; })()",
        );
        focus.as_str().unwrap().to_owned()
    }

    /// Answers the question on the page, field by field as the focus goes on; `words` finds the material.
    fn answer(&self, words: &str, caption: &str) -> Effort {
        let mut effort = Effort::default();
        loop {
            effort.fields += 1;
            effort.keys += match self.focused().as_str() {
                "combo" => self.type_keys(words) + self.enter(),
                "radio" => self.type_keys("1"),
                "number" => self.type_keys("0.9") + self.enter(),
                "text" => self.type_keys(caption) + self.enter(),
                "use" => self.enter(),
                "done" => {
                    effort.keys += self.enter();
                    return effort;
                }
                other => panic!("the focus is on {other:?}"),
            };
            assert!(effort.fields < 20, "the form does not end");
        }
    }
}

#[test]
fn a_mug_is_answered_with_the_keyboard_in_two_minutes() {
    let home = tempfile::tempdir().unwrap();
    let (out, recorded) = (home.path().join("out"), home.path().join("recorded"));
    let (prompts, options) = (Prompts::builtin(), small());
    // Two parts in two views each.
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    let queries = prepare(&views, &prompts, &options);
    let store = recordings(&recorded);
    assert_eq!(export(&out, &queries, &store), 4);
    let url = format!("file://{}", out.join("form.html").display());
    let Some(page) = Page::open("a_mug_is_answered_with_the_keyboard_in_two_minutes", &url, "#fields input") else {
        return;
    };

    let first = page.answer("stonew", "mug body");
    let again = page.answer("", "");
    let other = page.answer("rubber sil", "round lid");
    page.answer("", "");
    assert_eq!(page.text("#state"), "4 of 4 answered");
    assert_eq!(page.focused(), "text", "only the name is missing: {:?}", page.evaluate("document.activeElement.id"));
    page.type_keys("Ada");

    // The mug has three parts, each shown in three views.
    let seconds = |effort: Effort| KEY_S * effort.keys as f64 + DECIDE_S * effort.fields as f64 + LOOK_S;
    let mug_s = 3.0 * seconds(first).max(seconds(other)) + 6.0 * seconds(again);
    println!(
        "keys: {} and {} for a new part, {} for another view of it; a mug: {mug_s:.0} s",
        first.keys, other.keys, again.keys
    );
    assert_eq!(again.keys, 2);
    assert!(mug_s < 120.0, "{mug_s} s");

    // What is saved is what the import takes, with the library's numbers.
    let lines = page.evaluate("lines().join('')");
    let lines = lines.as_str().unwrap();
    let answers: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let library = MaterialLibrary::builtin();
    assert_eq!(answers.iter().filter(|line| line["answer"]["caption"] == "mug body").count(), 2);
    for line in &answers {
        let row = library.get(line["answer"]["material"].as_str().unwrap()).expect("a material of the library");
        let density: [f64; 2] = serde_json::from_value(line["answer"]["density_kg_m3"].clone()).unwrap();
        assert_eq!(density, [row.density_kg_m3.low, row.density_kg_m3.high]);
        assert_eq!(line["model"], "Ada");
    }
    fs::write(out.join("answers.jsonl"), lines).unwrap();
    let imported = exchange::import(&out, None, &queries, &store).unwrap();
    assert_eq!((imported.recorded, imported.unanswered), (4, 0), "{imported:?}");
    assert!(imported.bad.is_empty(), "{imported:?}");
    assert_eq!(page.complaints(), Vec::<String>::new());
}

#[test]
fn the_form_asks_what_belongs_to_a_shell_and_keeps_what_was_typed() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let (prompts, options) = (Prompts::builtin(), small());
    let queries = prepare_about(AskAbout::Parts, &[two_segments("000", 80, 80)], &prompts, &options);
    export(&out, &queries, &recordings(&home.path().join("recorded")));
    let url = format!("file://{}", out.join("form.html").display());
    let test = "the_form_asks_what_belongs_to_a_shell_and_keeps_what_was_typed";
    let Some(page) = Page::open(test, &url, "#fields input") else { return };
    let wall = "document.querySelector('[data-name=wall_thickness_mm]').checkVisibility()";
    let choose = |name: &str, number: usize| {
        page.evaluate(&format!("document.querySelectorAll('[name={name}]')[{number}].click()"));
    };
    page.answer(&a("wood").chars().take(6).collect::<String>(), "handle");
    page.evaluate("document.getElementById('back').click()");
    assert_eq!(page.evaluate(wall), false);
    choose("form", 1);
    assert_eq!(page.evaluate(wall), true);
    assert_eq!(page.text("#state"), "0 of 2 answered", "a shell without a thickness is not an answer");
    page.evaluate("document.getElementById('done').click()");
    assert_eq!(page.evaluate("document.querySelector('.lacking').dataset.name"), "wall_thickness_mm");
    page.type_keys("2");
    page.enter();
    page.type_keys("4");
    assert_eq!(page.text("#state"), "0 of 2 answered", "what is inside is not answered");
    let is_asked =
        |name: &str| page.evaluate(&format!("document.querySelector('[data-name={name}]').checkVisibility()"));
    assert_eq!((is_asked("inside"), is_asked("filling")), (true.into(), false.into()));
    choose("inside", 1);
    assert_eq!((is_asked("filling"), is_asked("bulk_reason")), (true.into(), false.into()));
    let fill_in = |name: &str, text: &str| {
        page.evaluate(&format!(
            "for (const input of document.querySelectorAll('[data-name={name}] input')) {{
                 input.value = {text:?};
                 input.dispatchEvent(new Event('input'));
             }}"
        ));
    };
    fill_in("fill_share", "0.9");
    fill_in("filling", "moon dust");
    assert_eq!(page.text("#state"), "0 of 2 answered", "a filling has a name of the library");
    let filling = &MaterialLibrary::builtin().fillings()[0].name;
    fill_in("filling", filling);
    assert_eq!(page.text("#state"), "1 of 2 answered");
    let saved: Value = serde_json::from_str(page.evaluate("lines()[0]").as_str().unwrap()).unwrap();
    assert_eq!((&saved["answer"]["filling"], &saved["answer"]["bulk_reason"]), (&json!(filling), &Value::Null));
    page.reload();
    page.wait_for("#fields input");
    assert_eq!(page.text("#state"), "1 of 2 answered", "what was typed is kept in the browser");
}
