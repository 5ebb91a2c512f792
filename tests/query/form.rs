//! The form on which a person answers, in headless Chromium, with the keyboard alone.

use std::fs;

use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::ask::recognition::{self, Side, Told};
use gprop::query::{Prompts, Queries, exchange};
use serde_json::{Value, json};

use super::exchange::export;
use super::{View, a, prepare, prepare_about, recordings, small, two_segments, view};
use crate::support::browser::Page;

/// Seconds that a practised person needs to press a key and to decide on the next step, from the keystroke-level model
/// (Card, Moran and Newell, "The keystroke-level model for user performance time with interactive systems", 1980): an
/// average non-secretary typist, and the mental preparation M.
const KEY_S: f64 = 0.28;
const DECIDE_S: f64 = 1.35;
/// To point at something and click, and to move the hand between mouse and keyboard, from the same model.
const CLICK_S: f64 = 1.1 + 0.2;
const HAND_S: f64 = 0.4;
/// Seconds to look at a picture before answering: an assumption.
const LOOK_S: f64 = 4.0;

/// What was needed to answer one question.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Effort {
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

    /// The field that has the focus, or the id of the button.
    fn field(&self) -> String {
        let focus = "document.activeElement.closest('.field')?.dataset.name ?? document.activeElement.id";
        self.evaluate(focus).as_str().unwrap().to_owned()
    }

    /// Types into an input of a field, in place of what it holds.
    fn fill_in(&self, field: &str, end: usize, text: &str) {
        self.evaluate(&format!(
            "(() => {{ const input = document.querySelectorAll('[data-name=\"{field}\"] input')[{end}];
               input.focus(); input.value = ''; }})()"
        ));
        self.type_keys(text);
    }

    fn choose_material(&self, choice: &str, words: &str) {
        self.fill_in(&format!("{choice}.material"), 0, words);
        self.enter();
    }

    fn choose(&self, field: &str, number: usize) {
        self.evaluate(&format!("document.querySelectorAll('[name=\"{field}\"]')[{number}].click()"));
    }

    /// Clicks the button that adds an item to a list.
    fn add_to(&self, list: &str) {
        self.click(&format!("[data-name='{list}'] > div > .list > button"));
    }

    fn problem(&self, field: &str) -> String {
        self.text(&format!("[data-name='{field}'] .problem"))
    }

    /// The answers that would be saved.
    fn saved(&self) -> String {
        self.evaluate("lines().join('')").as_str().unwrap().to_owned()
    }

    /// Answers the question on the page, field by field as the focus goes on; `words` finds the material.
    pub(super) fn answer(&self, words: &str, caption: &str) -> Effort {
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

#[test]
fn a_question_that_follows_takes_alternatives_and_needs_none() {
    let home = tempfile::tempdir().unwrap();
    let (out, store) = (home.path().join("out"), recordings(&home.path().join("recorded")));
    let (prompts, options) = (Prompts::builtin(), small());
    let queries = prepare_about(AskAbout::Object, &[two_segments("000", 80, 80)], &prompts, &options);
    export(&out, &queries, &store);
    let url = format!("file://{}", out.join("form.html").display());
    let test = "a_question_that_follows_takes_alternatives_and_needs_none";
    let Some(page) = Page::open(test, &url, "#fields input") else { return };
    let answer = |number: usize| -> Value {
        serde_json::from_str::<Value>(page.saved().lines().nth(number).unwrap()).unwrap()["answer"].take()
    };
    page.answer("stonew", "a cup");
    assert_eq!((page.text("#state"), &answer(0)["alternatives"]), ("1 of 2 answered".to_owned(), &json!([])));
    assert!(page.text("#offer").starts_with("The same as: a cup"), "{}", page.text("#offer"));
    page.click("#offer button");

    // What the confidence of 0.9 leaves, and the library's density.
    page.add_to("alternatives");
    page.choose_material("alternatives.0", "steel mild");
    assert_eq!(page.text("#state"), "2 of 2 answered");
    let row = MaterialLibrary::builtin().get("steel, mild").unwrap();
    let of = answer(1)["alternatives"][0].take();
    assert!((of["probability"].as_f64().unwrap() - 0.1).abs() < 1e-12, "{of}");
    let density: [f64; 2] = serde_json::from_value(of["density_kg_m3"].clone()).unwrap();
    assert_eq!(density, [row.density_kg_m3.low, row.density_kg_m3.high]);
    assert_eq!((&of["family"], &of["wall_thickness_mm"]), (&json!("metal"), &Value::Null));
    let probability = "alternatives.0.probability";
    page.fill_in(probability, 0, "20");
    assert_eq!(page.problem(probability), "10 % too much: with the confidence, they make at most 100 %.");
    page.fill_in(probability, 0, "5");
    assert_eq!(
        (page.problem(probability), answer(1)["alternatives"][0]["probability"].take()),
        (String::new(), json!(0.05))
    );

    // Its wall is as thick as that of the cup, unless it is said.
    page.choose("form", 1);
    page.choose("inside", 0);
    page.fill_in("wall_thickness_mm", 0, "4");
    let wall = || answer(1)["alternatives"][0]["wall_thickness_mm"].take();
    assert_eq!(wall(), json!([4, 4]));
    page.fill_in("alternatives.0.wall_thickness_mm", 0, "0.8");
    assert_eq!((wall(), page.text("#state")), (json!([0.8, 0.8]), "2 of 2 answered".to_owned()));

    page.focus("#name");
    page.type_keys("Ada");
    fs::write(out.join("answers.jsonl"), page.saved()).unwrap();
    let imported = exchange::import(&out, None, &queries, &store).unwrap();
    assert!(imported.recorded == 2 && imported.bad.is_empty(), "{imported:?}");
    assert_eq!(page.complaints(), Vec::<String>::new());
}

#[test]
fn materials_are_found_by_their_names_and_only_they_are_taken() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let (prompts, options) = (Prompts::builtin(), small());
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    export(&out, &queries, &recordings(&home.path().join("recorded")));
    let url = format!("file://{}", out.join("form.html").display());
    let test = "materials_are_found_by_their_names_and_only_they_are_taken";
    let Some(page) = Page::open(test, &url, "#fields input") else { return };
    let is_listed = "document.querySelector('.combo ul').checkVisibility()";
    assert_eq!((page.focused().as_str(), page.evaluate(is_listed)), ("combo", false.into()), "an empty field, no list");
    let found = |words: &str| -> Vec<String> {
        let names = format!("matching(queries[0], {words:?}).map((found) => found.material).join('|')");
        page.evaluate(&names).as_str().unwrap().split('|').map(str::to_owned).collect()
    };
    let place = |words: &str, material: &str| found(words).iter().position(|name| name.starts_with(material)).unwrap();
    assert!(
        place("pot", "earthenware") < place("pot", "potato") && place("pot", "terracotta") < place("pot", "potato")
    );
    assert!(found("compost").iter().any(|name| name.starts_with("soil")));
    assert_eq!((found("steel")[0].as_str(), found("soil")[0].as_str()), ("steel, mild", "soil, topsoil"));
    assert!(found("ash").iter().all(|name| name.starts_with("ash")), "{:?}", found("ash"));
    assert!(found("wood oak").iter().all(|name| name.contains("oak")), "the family and the name");
    assert!(found("alumin")[..3].iter().all(|name| name.starts_with("alumin")), "{:?}", found("alumin"));

    page.type_keys("terracota");
    assert!(page.text(".combo li").starts_with("terracotta"), "{}", page.text(".combo ul"));
    page.fill_in("material", 0, "unobtainium");
    page.enter();
    let problem = page.problem("material");
    assert!(problem.starts_with("\"unobtainium\" is not in the library"), "{problem}");
    for (field, text) in [("caption", "a part"), ("confidence", "90")] {
        page.fill_in(field, 0, text);
    }
    for field in ["several_materials", "form"] {
        page.choose(field, 0);
    }
    assert_eq!(page.problem("confidence"), "Only 0 to 1 is possible.", "never clamped");
    for (typed, number) in [("90%", "0.9"), ("0,8", "0.8"), ("0.9", "0.9")] {
        page.fill_in("confidence", 0, typed);
        let read = page.evaluate("String(reading(entryOf(queries[0]), 'confidence').value)");
        assert_eq!((page.problem("confidence").as_str(), read), ("", number.into()), "{typed}");
    }
    assert_eq!(page.text("#state"), "0 of 2 answered", "there is no such material");
    page.fill_in("material", 0, "oak");
    page.enter();
    assert_eq!(page.text("#state"), "1 of 2 answered");
    for name in ["form", "several_materials", "confidence"] {
        let tooltip = format!("document.querySelector('[data-name={name}] > [title]').title.length");
        assert!(page.evaluate(&tooltip).as_u64().unwrap() > 20, "{name} says what it means");
    }
    let options = "[...document.querySelectorAll('[data-name=form] label')].every((label) => label.title.length > 20)";
    assert_eq!(page.evaluate(options), true);
}

#[test]
fn an_answer_is_given_to_several_parts_at_once_and_offered_to_others() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let (prompts, options) = (Prompts::builtin(), small());
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    let queries = prepare(&views, &prompts, &options);
    export(&out, &queries, &recordings(&home.path().join("recorded")));
    let url = format!("file://{}", out.join("form.html").display());
    let test = "an_answer_is_given_to_several_parts_at_once_and_offered_to_others";
    let Some(page) = Page::open(test, &url, "#fields input") else { return };
    page.evaluate("document.getElementById('others').open = true");
    let marked = || page.evaluate("marks().filter((one) => one.ariaPressed === 'true').length");
    assert_eq!(page.evaluate("marks().length"), 3);
    page.click("#all");
    assert_eq!(marked(), 3);
    page.click("#all");
    assert_eq!(marked(), 0, "a second click takes them back");
    // The questions are in the order of the parts: the second is about the same part, the third and fourth about another.
    page.click("#others > div button:nth-child(2)");
    page.focus(".combo input");
    page.answer(&a("wood").chars().take(6).collect::<String>(), "a leaf");
    assert_eq!(page.text("#state"), "2 of 4 answered");
    assert!(page.text("#offer").starts_with("The same part as in question 1: a leaf"), "{}", page.text("#offer"));
    page.answer("", "");
    assert_eq!((page.text("#state"), page.text("#place")), ("3 of 4 answered".to_owned(), "4 / 4".to_owned()));
    let saved: Vec<Value> = page.saved().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((&saved[0]["answer"], &saved[3]["answer"]), (&saved[2]["answer"], &Value::Null));
    page.evaluate("answers[queries[3].query] = {}; queries[3].part = 'another'; show()");
    assert!(page.text("#offer").starts_with("The same as: a leaf"), "{}", page.text("#offer"));
    page.click("#offer button");
    assert_eq!(page.text("#state"), "4 of 4 answered");
}

#[test]
fn what_looks_alike_is_offered_together() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let (prompts, options) = (Prompts::builtin(), small());
    let views = [("000", 80), ("001", 200), ("002", 90)].map(|(name, tint)| two_segments(name, tint, 80));
    let queries = prepare(&views, &prompts, &options);
    export(&out, &queries, &recordings(&home.path().join("recorded")));
    let url = format!("file://{}", out.join("form.html").display());
    let Some(page) = Page::open("what_looks_alike_is_offered_together", &url, "#fields input") else { return };
    let colors = "marks().map((one) => one.query.color[1] - queries[0].color[1]).join()";
    // The same part first, in the views 002 and 001; then the other parts, in the views 000, 002 and 001.
    assert_eq!(page.evaluate(colors), "10,120,0,10,120");
}

/// The question about the whole object that one view shows, exported, and its page.
struct AboutObject {
    home: tempfile::TempDir,
    view: View,
}

impl AboutObject {
    fn of(view: View) -> Self {
        Self { home: tempfile::tempdir().unwrap(), view }
    }

    /// Does something with the prepared question.
    fn prepared<R>(&self, act: impl FnOnce(&Queries) -> R) -> R {
        let (prompts, options, library) = (Prompts::builtin(), small(), MaterialLibrary::builtin());
        let map = &self.view.segments.map;
        let side = Side { view: self.view.name, photo: &self.view.photo, map: Some(map) };
        let numbers = map.ids();
        let question =
            recognition::question(&[side], numbers, Told::default(), &prompts, library.clone(), &options).unwrap();
        act(&Queries { whole: vec![&question], ..prepare(&[], &prompts, &options) })
    }

    fn page(&self, test: &str) -> Option<Page> {
        let out = self.home.path().join("out");
        let store = recordings(&self.home.path().join("recorded"));
        assert_eq!(self.prepared(|queries| export(&out, queries, &store)), 1);
        Page::open(test, &format!("file://{}", out.join("form.html").display()), "#fields input")
    }

    /// Checks that what the page saves is imported, and returns the answer.
    fn imported(&self, page: &Page) -> Value {
        page.focus("#name");
        page.type_keys("Ada");
        let (out, saved) = (self.home.path().join("out"), page.saved());
        fs::write(out.join("answers.jsonl"), &saved).unwrap();
        let store = recordings(&self.home.path().join("recorded"));
        let imported = self.prepared(|queries| exchange::import(&out, None, queries, &store)).unwrap();
        assert_eq!((imported.recorded, imported.unanswered), (1, 0), "{imported:?}\n{saved}");
        assert_eq!(page.complaints(), Vec::<String>::new());
        serde_json::from_str::<Value>(&saved).unwrap()["answer"].take()
    }
}

#[test]
fn a_mug_as_a_whole_is_answered_with_the_keyboard_in_a_minute() {
    let object = AboutObject::of(two_segments("000", 80, 80));
    let Some(page) = object.page("a_mug_as_a_whole_is_answered_with_the_keyboard_in_a_minute") else { return };
    const CHOICE: &str = "pieces.0.choices.0";
    let steps = [
        ("object", "mug"),
        ("printed", ""),
        ("hypotheses.0.mass_g", "300"),
        ("hypotheses.0.mass_g", "400"),
        ("pieces.0.choices.0.material", "stonew"),
        ("pieces.0.choices.0.form", "2"),
        ("pieces.0.choices.0.wall_thickness_mm", "5"),
        ("pieces.0.choices.0.wall_thickness_mm", ""),
        ("pieces.0.choices.0.inside", "1"),
        ("pieces.0.choices.0.density_kg_m3", ""),
        ("pieces.0.choices.0.density_kg_m3", ""),
    ];
    let mut keys = 0;
    for (field, text) in steps {
        assert_eq!(page.field(), field);
        let is_choice = [".form", ".inside"].iter().any(|end| field == format!("{CHOICE}{end}"));
        keys += page.type_keys(text) + if is_choice { 0 } else { page.enter() };
    }
    assert_eq!((page.field().as_str(), page.text("#state").as_str()), ("done", "1 of 1 answered"));
    let seconds = KEY_S * keys as f64 + DECIDE_S * steps.len() as f64 + LOOK_S;
    println!("{keys} keys: {seconds:.0} s");
    assert!(seconds < 60.0, "{seconds} s");

    let answer = object.imported(&page);
    let material = answer["pieces"][0]["choices"][0]["material"].as_str().unwrap();
    let row = MaterialLibrary::builtin().get(material).unwrap();
    let expected = json!({
        "object": "mug", "printed": null, "printed_mass_g": null, "printed_volume_ml": null,
        "hypotheses": [{ "what": "mug", "probability": 1, "mass_g": [300, 400] }],
        "pieces": [{
            "numbers": [1, 2], "caption": "mug",
            "choices": [{
                "under": [], "probability": 1, "family": row.family, "material": material, "form": "shell",
                "wall_thickness_mm": [5, 5], "inside": "empty", "filling": null, "fill_share": null,
                "filling_density_kg_m3": null,
                "density_kg_m3": [row.density_kg_m3.low as u64, row.density_kg_m3.high as u64],
            }],
        }],
        "unnumbered": [],
    });
    assert_eq!(answer, expected);
}

#[test]
fn doubts_about_an_object_are_stated_and_what_is_impossible_is_refused() {
    let object = AboutObject::of(two_segments("000", 80, 80));
    let Some(page) = object.page("doubts_about_an_object_are_stated_and_what_is_impossible_is_refused") else { return };
    page.fill_in("object", 0, "a full bottle");
    page.fill_in("hypotheses.0.mass_g", 0, "540");
    page.add_to("hypotheses");
    page.fill_in("hypotheses.1.what", 0, "an empty one");
    page.fill_in("hypotheses.1.probability", 0, "30");
    let left = "document.querySelector('[data-name=\"hypotheses.0.probability\"] input').placeholder";
    assert_eq!(page.evaluate(left), "70", "what is left");
    page.fill_in("hypotheses.0.probability", 0, "60");
    assert_eq!(page.problem("hypotheses.0.probability"), "10 % are left: together they make 100 %.");
    page.fill_in("hypotheses.0.probability", 0, "80");
    assert_eq!(page.problem("hypotheses.1.probability"), "10 % too much: together they make 100 %.");
    page.fill_in("hypotheses.0.probability", 0, "0.7");
    assert_eq!(page.problem("hypotheses.0.probability"), "0.7 %, or 70 %? Type 0.7% or 70%.");
    page.fill_in("hypotheses.0.probability", 0, "70%");
    page.fill_in("hypotheses.1.mass_g", 0, "1,500");
    assert_eq!(page.problem("hypotheses.1.mass_g"), "1.500, or 1500? Type it without the comma.");
    page.fill_in("hypotheses.1.mass_g", 0, "50");
    page.fill_in("hypotheses.1.mass_g", 1, "20");
    assert_eq!(page.problem("hypotheses.1.mass_g"), "The lowest number comes first.");

    // A wall that is of plastic if it is full, and may be of steel if it is empty.
    let [plastic, steel] = ["pieces.0.choices.0", "pieces.0.choices.1"];
    page.choose_material(plastic, "abs");
    page.choose(&format!("{plastic}.form"), 1);
    let wall = format!("{plastic}.wall_thickness_mm");
    page.fill_in(&wall, 0, "2000");
    assert_eq!(page.problem(&wall), "Only 0.001 to 1,000 is possible.");
    page.fill_in(&wall, 0, "2");
    page.add_to("pieces.0.choices");
    page.choose_material(steel, "stainless");
    page.choose(&format!("{steel}.form"), 0);
    page.click("[data-name='pieces.0.choices.1.under'] button:nth-child(2)");
    page.fill_in(&format!("{steel}.probability"), 0, "20");

    page.add_to("pieces");
    page.choose_material("pieces.1.choices.0", "rubber");
    page.choose("pieces.1.choices.0.form", 2);
    page.add_to("unnumbered");
    page.fill_in("unnumbered.0.what", 0, "a lead weight");
    page.fill_in("unnumbered.0.mass_g", 0, "0");
    page.fill_in("unnumbered.0.mass_g", 1, "5");

    // What is lacking is marked, and not saved.
    page.click("#done");
    let lacking = page.evaluate("[...document.querySelectorAll('.lacking')].map((row) => row.dataset.name).join(' ')");
    assert_eq!(lacking, "hypotheses.1.mass_g pieces.1.numbers pieces.1.choices.0.density_kg_m3");
    assert!(page.saved().contains("\"answer\":null"));
    page.fill_in("hypotheses.1.mass_g", 0, "15");
    page.evaluate("document.querySelectorAll('[data-name=\"pieces.1.numbers\"] button')[1].click()");
    page.fill_in("pieces.1.choices.0.density_kg_m3", 0, "900");
    assert_eq!(page.text("#state"), "1 of 1 answered");
    page.reload();
    page.wait_for("#fields input");
    let answer = object.imported(&page);
    assert_eq!(answer["hypotheses"][0], json!({ "what": "a full bottle", "probability": 0.7, "mass_g": [540, 540] }));
    assert_eq!(answer["hypotheses"][1]["mass_g"], json!([15, 20]));
    let numbers: Vec<&Value> = answer["pieces"].as_array().unwrap().iter().map(|piece| &piece["numbers"]).collect();
    assert_eq!(numbers, [&json!([1]), &json!([2])]);
    let choices = answer["pieces"][0]["choices"].as_array().unwrap();
    let stated: Vec<_> = choices.iter().map(|choice| (&choice["under"], &choice["probability"])).collect();
    assert_eq!(stated, [(&json!([]), &json!(0.8)), (&json!([2]), &json!(0.2))]);
    assert_eq!((&choices[0]["inside"], &choices[1]["inside"]), (&json!("not known"), &Value::Null));
    assert_eq!(answer["pieces"][1]["choices"][0]["density_kg_m3"], json!([900, 900]));
    let thing = json!({ "what": "a lead weight", "probability": 1, "panel": null, "at": null, "mass_g": [0, 5] });
    assert_eq!(answer["unnumbered"], json!([thing]));

    // What is taken out leaves nothing behind that refers to it.
    page.evaluate("document.querySelectorAll('[data-name=hypotheses] .remove')[0].click()");
    let hidden = "answers[queries[0].query].hypotheses[0]";
    assert_eq!(page.evaluate(&format!("String([{hidden}.what, {hidden}.probability])")), ",");
    page.evaluate(
        "document.querySelectorAll('[data-name=pieces] > div > .list > .item:last-of-type > .remove')[0].click()",
    );
    page.fill_in("hypotheses.0.mass_g", 0, "16");
    let answer = object.imported(&page);
    assert_eq!(answer["hypotheses"], json!([{ "what": "a full bottle", "probability": 1, "mass_g": [16, 20] }]));
    assert_eq!(answer["pieces"].as_array().unwrap().len(), 1);
    assert_eq!(answer["pieces"][0]["numbers"], json!([1, 2]));
    assert!(answer["pieces"][0]["choices"].as_array().unwrap().iter().all(|choice| choice["under"] == json!([])));
}

#[test]
fn twenty_eight_pieces_are_answered_in_five_minutes() {
    const PIECES: u32 = 28;
    let regions = |x: u32, y: u32| if (20..80).contains(&y) && x < 4 * PIECES { (x / 4 + 1) as u16 } else { 0 };
    let object = AboutObject::of(view("000", (160, 120), 80, regions));
    let Some(page) = object.page("twenty_eight_pieces_are_answered_in_five_minutes") else { return };
    // The object, nothing printed, its mass, the first piece: six things to decide on, beside a look at each of four panels.
    let mut keys = 0;
    for text in ["a toy", "", "120", "200", "felt"] {
        keys += page.type_keys(text) + page.enter();
    }
    keys += page.type_keys("1");
    let object_s = 6.0 * DECIDE_S + 4.0 * LOOK_S;
    for piece in 1..PIECES {
        page.add_to("pieces");
        page.click(&format!("[data-name='pieces.{piece}.numbers'] button:nth-child({})", piece + 1));
        assert_eq!(page.field(), format!("pieces.{piece}.choices.0.material"), "a region is chosen on the way");
        keys += page.type_keys(["abs", "brass", "felt"][piece as usize % 3]) + page.enter() + page.type_keys("1");
    }
    // Two clicks, the hand to the keyboard and back, and a region, a material and a form to decide on.
    let pieces_s = f64::from(PIECES - 1) * (2.0 * CLICK_S + 2.0 * HAND_S + 3.0 * DECIDE_S);
    let seconds = object_s + pieces_s + KEY_S * keys as f64;
    println!("{keys} keys: {seconds:.0} s");
    assert!(seconds < 300.0, "{seconds} s");
    let answer = object.imported(&page);
    let pieces = answer["pieces"].as_array().unwrap();
    assert!((1..).zip(pieces).all(|(number, piece)| piece["numbers"] == json!([number])), "{answer}");
    assert_eq!(pieces.len(), PIECES as usize);
}
