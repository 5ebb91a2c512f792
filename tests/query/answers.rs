use gprop::consensus::AskAbout;
use gprop::materials::MaterialLibrary;
use gprop::query::answer::{Problem, Unknown};
use gprop::query::question::{Questions, Reading};
use gprop::query::{
    Answer, Answers, Context, Failure, Form, Guidance, Inside, Match, Outcome, Prompts, SubjectAnswer, SubjectId,
};
use gprop::units::{Range, ShoreScale};
use serde_json::{Value, json};

use super::{a, good_answer, good_answer_about_part, good_answer_with, with};

fn read_as(response: &str, unknown: Unknown) -> Result<Answer, Problem> {
    read_about(AskAbout::Parts, response, unknown)
}

fn read_about(about: AskAbout, response: &str, unknown: Unknown) -> Result<Answer, Problem> {
    let library = MaterialLibrary::builtin();
    let questions =
        Questions::new(&Prompts::builtin(), library, Guidance::OneQuestion, Context::GlobalLocal, about).unwrap();
    match questions.read(questions.first(), response, library, unknown)? {
        Reading::Answered(answer) => Ok(*answer),
        Reading::Next(_) => panic!("there is only one question"),
    }
}

fn read(answer: &Value) -> Result<Answer, Problem> {
    read_as(&answer.to_string(), Unknown::Refuse)
}

fn good() -> Value {
    good_answer_about_part(a("wood"))
}

#[test]
fn a_good_answer_is_in_si_and_unflagged() {
    let answer = read(&good()).unwrap();
    let row = MaterialLibrary::builtin().get(a("wood")).unwrap();
    assert_eq!(answer.material, row.name);
    assert_eq!(answer.density_kg_m3, row.density_kg_m3);
    let apart = (answer.youngs_modulus_pa.high / row.youngs_modulus_pa.high - 1.0).abs();
    assert!(apart < 1e-12, "MPa to Pa and back: {apart}");
    assert_eq!(answer.form, Form::Solid);
    assert_eq!(answer.hardness, row.hardness);
    assert_eq!(answer.matched, Match::Live);
    assert_eq!(answer.flags, Vec::<String>::new());
}

#[test]
fn what_is_no_answer_is_refused_with_the_field_that_is_wrong() {
    let mut short = good();
    short.as_object_mut().unwrap().remove("density_kg_m3");
    let table = [
        (short.to_string(), "density_kg_m3"),
        (with(good(), "density_kg_m3", json!("heavy")).to_string(), "density_kg_m3"),
        (with(good(), "density_kg_m3", json!([700])).to_string(), "density_kg_m3"),
        (with(good(), "poisson_ratio", json!([0.3, null])).to_string(), "poisson_ratio"),
        (with(good(), "family", json!("unobtainium")).to_string(), "family"),
        (with(good(), "form", json!("hollow")).to_string(), "form"),
        (with(good(), "form", json!("shell")).to_string(), "wall_thickness_mm"),
        (with(good(), "opinion", json!("nice")).to_string(), "opinion"),
        ("I would rather not say.".into(), "no JSON"),
        ("{\"caption\": oak}".into(), "cannot be read"),
        (String::new(), "no JSON"),
    ];
    for (response, named) in table {
        let problem = read_as(&response, Unknown::TakeNearest).expect_err(&response);
        assert!(problem.reason.contains(named), "{response}: {}", problem.reason);
        assert!(matches!(problem.failure, Failure::Invalid { .. }));
    }
}

#[test]
fn alternatives_are_read_like_the_material_that_is_named() {
    let read = |answer: &Value| read_about(AskAbout::Object, &answer.to_string(), Unknown::Refuse);
    let answer = read(&good_answer_with("stoneware", &[("abs", 0.05), ("steel, mild", 0.15)])).unwrap();
    let found: Vec<(&str, f64)> = answer.alternatives.iter().map(|of| (&*of.material, of.probability)).collect();
    assert_eq!(found, [("steel, mild", 0.15), ("abs", 0.05)], "the most probable first");
    let steel = MaterialLibrary::builtin().get("steel, mild").unwrap();
    assert_eq!(
        (&answer.alternatives[0].family, answer.alternatives[0].density_kg_m3),
        (&steel.family, steel.density_kg_m3)
    );
    assert_eq!(answer.flags, Vec::<String>::new());
    assert!(read(&good_answer_with("stoneware", &[])).unwrap().alternatives.is_empty());
    // Three probabilities with two digits each.
    assert!(read(&good_answer_with("stoneware", &[("abs", 0.11), ("steel, mild", 0.1)])).is_ok());

    let steel = |field: &str, value: Value| {
        let mut answer = good_answer_with("stoneware", &[("steel, mild", 0.2)]);
        answer["alternatives"][0][field] = value;
        answer
    };
    let walls = with(steel("wall_thickness_mm", json!([0.5, 1])), "form", json!("shell"));
    let answer = read(&with(walls, "wall_thickness_mm", json!([4, 6]))).unwrap();
    assert_eq!(answer.alternatives[0].wall_thickness_m, Some(Range::new(0.0005, 0.001)));
    // Without one it would be solid, as the real thing beside a hollow imitation.
    let no_wall = with(steel("wall_thickness_mm", json!(null)), "form", json!("shell"));
    let answer = read(&with(no_wall, "wall_thickness_mm", json!([4, 6]))).unwrap();
    assert_eq!(answer.alternatives[0].wall_thickness_m, None);
    let answer = read(&steel("family", json!("METAL"))).unwrap();
    assert_eq!(answer.alternatives[0].family, "metal");

    let table = [
        (steel("material", json!("unobtainium")), "alternative 1: the material \"unobtainium\" is not in the list"),
        (steel("material", json!("stoneware")), "alternative 1: stoneware is named already"),
        (steel("family", json!("unobtainium")), "alternatives/0/family"),
        (steel("probability", json!(0.3)), "alternatives: their probabilities and the confidence make 1.10 together"),
        (steel("probability", json!(-0.1)), "alternative 1: probability: -0.1 is not possible"),
        (steel("density_kg_m3", json!([-9, 0])), "alternative 1: density_kg_m3: [-9, 0] is not possible"),
        (steel("opinion", json!("nice")), "alternatives/0: "),
        (good_answer_about_part("stoneware"), "\"alternatives\" is a required property"),
        (good_answer_with("stoneware", &[("abs", 0.0), ("pc", 0.0), ("steel, mild", 0.0)]), "alternatives: "),
    ];
    for (answer, named) in table {
        let problem = read(&answer).expect_err(named);
        assert!(problem.reason.contains(named), "{named}: {}", problem.reason);
    }
    let nearest = steel("material", json!("steel, mild tree")).to_string();
    let answer = read_about(AskAbout::Object, &nearest, Unknown::TakeNearest).unwrap();
    assert_eq!(answer.alternatives[0].material, "steel, mild");
    assert!(
        answer.flags[0].starts_with("alternative 1: \"steel, mild tree\" is not in the library"),
        "{:?}",
        answer.flags
    );
    assert!(read_as(&nearest, Unknown::TakeNearest).is_err(), "a question about a part alone asks for one material");
}

#[test]
fn deep_json_is_refused_as_it_is_read() {
    // Cut off, closed, in lists, and after a small object that is not an answer.
    let deep = |open: &str, close: &str| format!("{}{}", open.repeat(100_000), close.repeat(100_000));
    for response in
        [deep("{\"a\":", ""), deep("{\"a\":", "}"), deep("{\"a\":[", "]}"), format!("{{x}} {}", deep("{\"a\":[", ""))]
    {
        let problem = read_as(&response, Unknown::Refuse).expect_err("nothing answers so");
        assert!(problem.reason.contains("nested more than 16 deep"), "{}", problem.reason);
    }
    // Brackets inside a string are not nesting.
    let caption = with(good(), "caption", json!("{[".repeat(100)));
    assert!(read(&caption).is_ok());
}

#[test]
fn a_family_is_taken_in_any_case() {
    for written in ["WOOD", "Wood", " wood.", "wooden"] {
        let answer = read(&with(good(), "family", json!(written))).unwrap_or_else(|problem| panic!("{problem:?}"));
        assert_eq!((answer.family.as_str(), answer.flags), ("wood", vec![]), "{written}");
    }
    let (prompts, library) = (Prompts::builtin(), MaterialLibrary::builtin());
    let questions =
        Questions::new(&prompts, library, Guidance::FamilyFirst, Context::GlobalLocal, AskAbout::Parts).unwrap();
    let response = json!({ "caption": "a part", "family": "WOOD" }).to_string();
    let reading = questions.read(questions.first(), &response, library, Unknown::Refuse).unwrap();
    assert!(matches!(reading, Reading::Next(next) if next.prompt.contains(a("wood"))));
}

#[test]
fn json_is_found_in_what_models_write_around_it() {
    let json = good().to_string();
    let pretty = format!("{:#}", good());
    let cut_in_last_field = json.trim_end_matches('}');
    let table = [
        format!("```json\n{pretty}\n```"),
        format!("Here it is: {json} I hope that helps."),
        format!("<think>{{maybe}} {{\"caption\":\"no\"}}</think>{json}"),
        format!("A set {{a, b}} first. {json}"),
        cut_in_last_field.into(),
        format!("```\n{cut_in_last_field}\n```"),
        format!("\u{feff}{json}"),
    ];
    for response in table {
        let answer = read_as(&response, Unknown::Refuse);
        assert!(answer.is_ok(), "{response}: {answer:?}");
    }
    let commas = with(good(), "caption", json!("a grip, black, \"ribbed\" {soft}"));
    assert_eq!(read(&commas).unwrap().caption, "a grip, black, \"ribbed\" {soft}");
}

#[test]
fn the_last_object_that_fits_is_the_answer() {
    let (json, draft) = (good().to_string(), with(good(), "caption", json!("a draft")).to_string());
    let close = with(good(), "form", json!("hollow")).to_string();
    let table = [
        format!("[THINK]Draft {{\"caption\":\"x\"}}[/THINK]{json}"),
        format!("[THINK]{draft}[/THINK]{json}"),
        format!("◁think▷{draft}◁/think▷{json}"),
        format!(
            "<|channel|>analysis<|message|>{draft}<|end|><|start|>assistant<|channel|>final<|message|>{json}<|return|>"
        ),
        format!("<|channel>thought\n{draft}<channel|>{json}"),
        format!("{draft} No, better: {json}"),
        format!("{draft} {json} Note: {{\"a\": 1}} and {{b}}."),
        format!("{json} In short: {{\"caption\":\"a part\"}}"),
        // All of it before the mark, as some chat templates have it.
        format!("{json}</think>"),
        format!("<think>{json}</think>\nI have answered."),
        // A draft that is never closed.
        format!("{{\"caption\": \"an unfinished {json}"),
        json!({ "values": good() }).to_string(),
        json!({ "thought": "wood", "answer": good() }).to_string(),
        json!([good()]).to_string(),
        format!("{draft} {}", json!({ "final": good() })),
    ];
    for response in table {
        let answer = read_as(&response, Unknown::Refuse).unwrap_or_else(|problem| panic!("{response}: {problem:?}"));
        assert_eq!(answer.caption, "a part", "{response}");
    }
    // Nothing fits: the problem is that of the object that comes closest.
    let problem = read_as(&format!("{{\"caption\":\"x\"}} {close} {{\"a\": 1}}"), Unknown::Refuse).unwrap_err();
    assert!(problem.reason.contains("form") && !problem.reason.contains("required"), "{}", problem.reason);
    // The answer that follows the reasoning is meant, even if it has to be corrected.
    let problem = read_as(&format!("<think>{draft}</think>{close}"), Unknown::Refuse).unwrap_err();
    assert!(problem.reason.contains("form"), "{}", problem.reason);
}

#[test]
fn numbers_may_be_written_as_strings() {
    let row = read(&good()).unwrap();
    let in_words = |value: &Value| match value {
        Value::Array(ends) => json!(ends.iter().map(Value::to_string).collect::<Vec<_>>()),
        value => json!(value.to_string()),
    };
    let fields = ["density_kg_m3", "youngs_modulus_mpa", "poisson_ratio", "yield_strength_mpa", "friction_rubber"];
    let mut answer = good();
    for field in fields.into_iter().chain(["confidence", "several_materials", "wall_thickness_mm"]) {
        answer[field] = in_words(&good()[field]);
    }
    assert_eq!(read(&answer).unwrap(), row);
    assert_eq!(read(&with(good(), "density_kg_m3", json!(good()["density_kg_m3"].to_string()))).unwrap(), row);
    // What may be a string stays one, and words are no numbers.
    assert_eq!(read(&with(good(), "caption", json!("12"))).unwrap().caption, "12");
    for bad in [json!(["light", "heavy"]), json!(["NaN", "7800"]), json!(["1e999", "7800"]), json!("700-800")] {
        assert!(read(&with(good(), "density_kg_m3", bad)).unwrap_err().reason.contains("density_kg_m3"));
    }
}

#[test]
fn a_truncated_answer_names_what_it_lacks() {
    let json = good().to_string();
    let cut = &json[..json.find("\"friction_rubber\"").unwrap() - 1];
    let problem = read_as(cut, Unknown::Refuse).unwrap_err();
    assert!(problem.reason.contains("friction_rubber"), "{}", problem.reason);
}

/// "0.9" cut to "0" would pass for a confidence.
#[test]
fn a_number_that_is_cut_off_is_not_taken_for_a_whole_one() {
    let json = good().to_string();
    for end in json.char_indices().map(|(at, _)| at).filter(|at| json[..*at].ends_with(|c: char| c.is_ascii_digit())) {
        let cut = read_as(&json[..end], Unknown::Refuse);
        assert!(cut.is_err(), "{:?}", &json[..end]);
    }
}

#[test]
fn names_are_found_whatever_their_case() {
    let answer = read(&with(good(), "material", json!(a("wood").to_uppercase()))).unwrap();
    assert_eq!(answer.material, a("wood"));
}

#[test]
fn an_unknown_material_is_refused_first_and_then_taken_for_the_nearest() {
    let typo = with(good(), "material", json!(format!("{} tree", a("wood"))));
    let problem = read(&typo).unwrap_err();
    assert!(problem.reason.contains(a("wood")), "the hint is missing: {}", problem.reason);
    assert!(matches!(problem.failure, Failure::UnknownMaterial { .. }));
    let answer = read_as(&typo.to_string(), Unknown::TakeNearest).unwrap();
    assert_eq!(answer.material, a("wood"));
    assert!(answer.flags[0].contains("nearest"), "{:?}", answer.flags);

    // A similar name in another family: a petal.
    let of_metal = |name: &str| with(good_answer_about_part(a("metal")), "material", json!(name)).to_string();
    assert_eq!(read_as(&of_metal("metal"), Unknown::TakeNearest).unwrap().family, "metal");
    let problem = read_as(&of_metal("petals"), Unknown::TakeNearest).unwrap_err();
    assert_eq!(problem.failure, Failure::UnknownMaterial { material: "petals".into() });

    let nonsense = with(good(), "material", json!("zzxqj")).to_string();
    let problem = read_as(&nonsense, Unknown::TakeNearest).unwrap_err();
    assert_eq!(problem.failure, Failure::UnknownMaterial { material: "zzxqj".into() });
}

#[test]
fn the_family_is_the_materials() {
    let answer = read(&with(good(), "family", json!("metal"))).unwrap();
    assert_eq!(answer.family, "wood");
    assert!(answer.flags[0].contains("not metal"), "{:?}", answer.flags);
}

#[test]
fn the_narrower_of_two_ranges_that_overlap_counts() {
    let row = MaterialLibrary::builtin().get(a("metal")).unwrap();
    let Range { low, high } = row.density_kg_m3;
    let mid = 0.5 * (low + high);
    let metal = || good_answer_about_part(a("metal"));
    let density = |said: [f64; 2]| {
        let answer = read(&with(metal(), "density_kg_m3", json!(said))).unwrap();
        (answer.density_kg_m3, answer.flags)
    };
    assert_eq!(density([low, mid]), (Range::new(low, mid), vec![]));
    assert_eq!(density([low - 1.0, high + 1.0]).0, row.density_kg_m3);
    // Neither contains the other: not their overlap, which no one gave.
    let step = 0.1 * (high - low);
    assert_eq!(density([high - step, high + step]).0, Range::new(high - step, high + step));
    assert_eq!(density([low - 100.0 * step, high - step]).0, row.density_kg_m3);

    let (range, flags) = density([mid, low]);
    assert_eq!(range, Range::new(low, mid));
    assert!(flags[0].contains("swapped"), "{flags:?}");

    let (range, flags) = density([high + 50.0, high + 60.0]);
    assert_eq!(range, row.density_kg_m3, "no overlap: the library's");
    assert!(flags[0].contains("does not overlap"), "{flags:?}");

    let (range, flags) = density([-5.0, 1e9]);
    assert_eq!(range, row.density_kg_m3);
    assert!(flags[0].contains("was clamped"), "{flags:?}");
}

/// Cut to what is possible, it would be a single number, and narrower than any range of the library.
#[test]
fn an_impossible_answer_is_not_a_certain_one() {
    let row = MaterialLibrary::builtin().get("ptfe").unwrap();
    let said =
        with(with(good_answer_about_part("ptfe"), "family", json!(row.family)), "friction_rubber", json!([0.05, 0.2]));
    let answer = read(&said).unwrap();
    assert_eq!(answer.friction_rubber, row.friction_rubber);
    assert!(
        answer.flags.iter().any(|flag| flag.contains("friction") && flag.contains("does not overlap")),
        "{:?}",
        answer.flags
    );
}

#[test]
fn hardness_keeps_to_the_librarys_scale() {
    let library = MaterialLibrary::builtin();
    let families = library.families().iter().flat_map(|family| library.of_family(&family.name));
    let row = families.into_iter().find(|row| row.hardness.is_some()).expect("some row has a hardness");
    let hardness = row.hardness.unwrap();
    let (same, other) = match hardness.scale {
        ShoreScale::A => ("A", "D"),
        ShoreScale::D => ("D", "A"),
    };
    let said = |scale: &str, range: Value| {
        let answer = with(good_answer_about_part(&row.name), "shore_scale", json!(scale));
        read(&with(answer, "shore_hardness", range)).unwrap()
    };
    let Range { low, high } = hardness.range;
    assert_eq!(
        said(same, json!([low, 0.5 * (low + high)])).hardness.unwrap().range,
        Range::new(low, 0.5 * (low + high))
    );
    let crossed = said(other, json!([50, 60]));
    assert_eq!(crossed.hardness, Some(hardness));
    assert!(crossed.flags[0].contains("Shore"), "{:?}", crossed.flags);
}

#[test]
fn walls_are_in_metres_and_confidence_within_one() {
    let shell = with(good(), "form", json!("shell"));
    let answer = read(&with(shell.clone(), "wall_thickness_mm", json!([2, 4]))).unwrap();
    assert_eq!(answer.form, Form::Shell { wall_thickness_m: Range::new(0.002, 0.004) });
    let none = read(&with(shell.clone(), "wall_thickness_mm", json!([0, 0]))).unwrap_err();
    assert_eq!(none.reason, "wall_thickness_mm: [0, 0] is not possible; give a thickness in mm, from 0.001 to 1000.");
    assert!(matches!(none.failure, Failure::Invalid { .. }));
    let answer = read(&with(shell, "wall_thickness_mm", json!([0, 4]))).unwrap();
    assert!(matches!(answer.form, Form::Shell { wall_thickness_m } if wall_thickness_m.low > 0.0));
    assert!(!answer.flags.is_empty());
    let answer = read(&with(good(), "confidence", json!(85))).unwrap();
    assert_eq!((answer.confidence, answer.flags.len()), (1.0, 1));
}

#[test]
fn answers_survive_json_lines() {
    let mut shell = read(&with(with(good(), "form", json!("shell")), "wall_thickness_mm", json!([1.1, 2.3]))).unwrap();
    shell.matched = Match::Mask { iou: 0.93 };
    let failed = |failure| Outcome::Failed(failure);
    let outcomes = [
        Outcome::Answered(shell),
        Outcome::Answered(read(&with(good(), "caption", json!("line\nbreak, \"quotes\" and ümlaut"))).unwrap()),
        failed(Failure::Refused { message: "no".into() }),
        failed(Failure::UnknownMaterial { material: "x,y".into() }),
    ];
    let all = (1..)
        .zip(outcomes)
        .map(|(id, outcome)| SubjectAnswer { view: "000".into(), subject: SubjectId::Part(id), outcome })
        .collect();
    let answers = Answers::new(all);
    let text = answers.to_jsonl();
    assert_eq!(text.lines().count(), 4);
    assert_eq!(Answers::from_jsonl(&text).unwrap(), answers);
    assert_eq!(answers.failed().count(), 2);
    let error = Answers::from_jsonl(&format!("{text}\n{{\"view\":1}}\n")).unwrap_err();
    assert!(error.to_string().starts_with("line 6: "), "{error}");
    let error = Answers::from_jsonl(&format!("{text}{text}")).unwrap_err();
    assert_eq!(error.to_string(), "line 5: part 1 of view \"000\" has an answer already");
}

/// A shell with what is said to be in it.
fn shell(inside: Value, filling: Value, share: Value) -> Value {
    let shell = with(with(good(), "form", json!("shell")), "wall_thickness_mm", json!([1, 2]));
    with(with(with(shell, "inside", inside), "filling", filling), "fill_share", share)
}

#[test]
fn what_is_inside_a_shell_is_read_and_checked() {
    let inside = |answer| read(&answer).map(|answer| answer.inside);
    assert_eq!(read(&good()).unwrap().inside, None, "a solid has no inside");
    assert_eq!(inside(shell(Value::Null, Value::Null, Value::Null)).unwrap(), Some(Inside::Unknown));
    assert_eq!(inside(shell(json!("not known"), Value::Null, Value::Null)).unwrap(), Some(Inside::Unknown));
    assert_eq!(inside(shell(json!("empty"), json!("water"), json!([1, 1]))).unwrap(), Some(Inside::Empty));
    let soup = inside(shell(json!("filled"), json!("Soup; thick or condensed"), json!([0.98, 0.9]))).unwrap();
    let filling = "soup, thick or condensed".to_owned();
    assert_eq!(soup, Some(Inside::Filled { filling, share: Range::new(0.9, 0.98), density_kg_m3: None }));
    let percent = read(&shell(json!("filled"), json!("water"), json!([90, 95]))).unwrap_err().reason;
    assert_eq!(percent, "fill_share: [90, 95] is not possible; give a share of the hollow, from 0.01 to 1.");
    assert!(read(&shell(json!("filled"), json!("water"), json!([1, 95]))).is_err(), "it would be exactly full");
    assert!(read(&shell(json!("filled"), json!("water"), json!([1, 1]))).is_ok(), "as exact as it was given");
    let too_full = read(&shell(json!("filled"), json!("water"), json!([0.5, 20]))).unwrap();
    assert_eq!(
        too_full.inside,
        Some(Inside::Filled { filling: "water".to_owned(), share: Range::new(0.5, 1.0), density_kg_m3: None })
    );
    assert_eq!(too_full.flags.len(), 1, "{:?}", too_full.flags);
    for (answer, named) in [
        (shell(json!("filled"), Value::Null, json!([0.9, 1])), "filling is null"),
        (shell(json!("filled"), json!("water"), Value::Null), "fill_share is null"),
        (shell(json!("filled"), json!("caviar"), json!([0.9, 1])), "filling"),
        (shell(json!("perhaps"), Value::Null, Value::Null), "inside"),
    ] {
        let problem = read(&answer).expect_err(named);
        assert!(problem.reason.contains(named), "{named}: {}", problem.reason);
    }
}

#[test]
fn a_mixed_part_has_the_density_of_the_whole() {
    let mixed = with(with(good(), "form", json!("mixed")), "bulk_density_kg_m3", json!([2600, 2400]));
    let answer = read(&with(mixed.clone(), "bulk_reason", json!("a motor in a wooden case"))).unwrap();
    assert_eq!((answer.form, answer.inside), (Form::Mixed, None));
    assert_eq!(answer.density_kg_m3, Range::new(2400.0, 2600.0), "denser than any wood");
    assert_eq!(answer.bulk_reason.as_deref(), Some("a motor in a wooden case"));
    assert!(read(&mixed).unwrap().flags.iter().any(|flag| flag.contains("without a reason")));
    let in_g_cm3 = read(&with(mixed.clone(), "bulk_density_kg_m3", json!([0.3, 0.8]))).unwrap_err().reason;
    assert!(in_g_cm3.contains("bulk_density_kg_m3: [0.3, 0.8]") && in_g_cm3.contains("in kg/m3"), "{in_g_cm3}");
    let heavy = read(&with(mixed, "bulk_density_kg_m3", json!([1000, 1e6]))).unwrap();
    assert_eq!(heavy.density_kg_m3, Range::new(1000.0, 20_000.0));
    let problem = read(&with(good(), "form", json!("mixed"))).unwrap_err();
    assert!(problem.reason.contains("bulk_density_kg_m3"), "{}", problem.reason);
}

#[test]
fn an_answer_about_a_segment_leaves_the_inside_unknown() {
    let library = MaterialLibrary::builtin();
    let questions =
        Questions::new(&Prompts::builtin(), library, Guidance::OneQuestion, Context::GlobalLocal, AskAbout::Segments)
            .unwrap();
    let of_segment = with(with(good_answer(a("wood")), "form", json!("shell")), "wall_thickness_mm", json!([1, 2]));
    let Ok(Reading::Answered(answer)) =
        questions.read(questions.first(), &of_segment.to_string(), library, Unknown::Refuse)
    else {
        panic!("it follows the schema of segments")
    };
    assert_eq!(answer.inside, Some(Inside::Unknown));
    let about_part = shell(json!("filled"), json!("water"), json!([0.9, 1])).to_string();
    assert!(questions.read(questions.first(), &about_part, library, Unknown::Refuse).is_err(), "it was not asked");
}
