use std::fs;

use gprop::query::ask::asker::{AskError, Asker, ReplyContent};
use gprop::query::ask::budget::Budget;
use gprop::query::ask::cost::Cost;
use gprop::query::recorded::{RecordingError, Recordings, Usage};
use gprop::query::{AnswerSource, Failure, Guidance, Match, Options, Outcome, Prompts, QueryError};
use gprop::words::progress::Progress;

use super::{Scripted, a, good_answer, prepare, recordings, run, small, text, two_segments, with};

fn replay() -> Options {
    Options { answers: AnswerSource::Replay, ..small() }
}

fn matched(run: &gprop::query::Run) -> Vec<Match> {
    run.answers
        .all
        .iter()
        .map(|answer| match &answer.outcome {
            Outcome::Answered(answer) => answer.matched,
            Outcome::Failed(failure) => panic!("{failure:?}"),
        })
        .collect()
}

#[test]
fn what_was_asked_once_is_replayed_from_disk() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    let (options, replay) = (small(), replay());
    let asker = Scripted::new(|_| text(good_answer(a("wood"))));
    let queries = prepare(&views, &prompts, &options);
    let live = run(&queries, &recordings(folder.path()), Some(&asker)).unwrap();
    assert_eq!(asker.count(), 4);
    assert_eq!(matched(&live), [Match::Live; 4]);
    assert_eq!(live.spent.usage.input_tokens, 4000);

    let queries = prepare(&views, &prompts, &replay);
    let replayed = run(&queries, &recordings(folder.path()), Some(&asker)).unwrap();
    assert_eq!(asker.count(), 4, "replay asks nobody");
    assert_eq!(matched(&replayed), [Match::Exact; 4]);
    let order: Vec<_> =
        replayed.answers.all.iter().map(|answer| (answer.view.as_str(), answer.subject.number())).collect();
    assert_eq!(order, [("000", 1), ("000", 2), ("001", 1), ("001", 2)]);
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(names.iter().all(|name| name.len() == 64 + ".json".len()), "nothing else is left: {names:?}");
}

#[test]
fn a_mask_that_moved_by_a_few_pixels_still_replays_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let (options, replay) = (small(), replay());
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let original = [two_segments("000", 80, 80)];
    run(&prepare(&original, &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();

    // The same photo, the border between the segments two of sixty columns further right.
    let mut moved = two_segments("000", 80, 82);
    moved.photo = original[0].photo.clone();
    let replayed = run(&prepare(&[moved], &prompts, &replay), &recordings(folder.path()), None).unwrap();
    // Segment 1 grew from 60 to 62 columns, segment 2 shrank from 60 to 58.
    let expected = [60.0 / 62.0, 58.0 / 60.0];
    for (matched, expected) in matched(&replayed).into_iter().zip(expected) {
        let Match::Mask { iou } = matched else { panic!("{matched:?}") };
        assert!((iou - expected).abs() < 1e-12, "{iou} is not {expected}");
    }
}

#[test]
fn masks_that_differ_more_are_missing_each_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let (options, replay) = (small(), replay());
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let original = [two_segments("000", 80, 80)];
    run(&prepare(&original, &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();

    let mut moved = two_segments("000", 80, 100);
    moved.photo = original[0].photo.clone();
    let other_photo = two_segments("001", 33, 80);
    let queries = prepare(&[moved, other_photo], &prompts, &replay);
    let error = run(&queries, &recordings(folder.path()), None).unwrap_err();
    let text = error.to_string();
    let QueryError::Missing { questions: 4, missing, .. } = error else { panic!("{text}") };
    assert_eq!(missing.len(), 4);
    assert!(text.contains("view 000, region 1 (the answers recorded for this photo are about other regions of it: the nearest overlaps this one by 75 %, and 90 % would do)"), "{text}");
    assert!(text.contains("view 001, regions 1, 2 (nothing is recorded for this photo)"), "{text}");
    assert!(text.contains("gprop answer SCENE;") && text.contains("--lmm-url") && text.contains("--export"), "{text}");
}

#[test]
fn another_prompt_is_another_question() {
    let folder = tempfile::tempdir().unwrap();
    let mine = tempfile::tempdir().unwrap();
    fs::write(mine.path().join("segment.txt"), "What is it? {{ candidates }} JSON").unwrap();
    let (builtin, mine) = (Prompts::builtin(), Prompts::from_folder(mine.path()).unwrap());
    let (options, replay) = (small(), replay());
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let views = [two_segments("000", 80, 80)];
    run(&prepare(&views, &builtin, &options), &recordings(folder.path()), Some(&wood)).unwrap();
    let error = run(&prepare(&views, &mine, &replay), &recordings(folder.path()), None).unwrap_err();
    assert!(error.to_string().contains("another prompt"), "{error}");
}

#[test]
fn a_named_model_is_served_by_its_own_recordings_only() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let views = [two_segments("000", 80, 80)];
    let mut wood = Scripted::new(|_| text(good_answer(a("wood"))));
    wood.answerer.model = "model-a".into();
    run(&prepare(&views, &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();
    let mut metal = Scripted::new(|_| text(good_answer(a("metal"))));
    metal.answerer.model = "model-b".into();
    run(&prepare(&views, &prompts, &options), &recordings(folder.path()), Some(&metal)).unwrap();
    assert_eq!((wood.count(), metal.count()), (2, 2), "one model's recording does not serve another");
    run(&prepare(&views, &prompts, &options), &recordings(folder.path()), Some(&metal)).unwrap();
    assert_eq!(metal.count(), 2, "its own does");

    for (model, material) in [("model-a", a("wood")), ("model-b", a("metal"))] {
        let replay = Options { lmm_model: Some(model.into()), ..replay() };
        let replayed = run(&prepare(&views, &prompts, &replay), &recordings(folder.path()), None).unwrap();
        let Outcome::Answered(answer) = &replayed.answers.all[0].outcome else { panic!() };
        assert_eq!(answer.material, material);
    }
    let anybody = replay();
    let twice = [(); 2].map(|()| {
        run(&prepare(&views, &prompts, &anybody), &recordings(folder.path()), None).unwrap().answers.to_jsonl()
    });
    assert_eq!(twice[0], twice[1], "of several models always the same one serves");
}

#[test]
fn live_asks_although_it_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = Options { answers: AnswerSource::Live, ..small() };
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let views = [two_segments("000", 80, 80)];
    for _ in 0..2 {
        run(&prepare(&views, &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();
    }
    assert_eq!(wood.count(), 4);
    assert_eq!(recordings(folder.path()).len(), 2);
    assert!(run(&prepare(&views, &prompts, &options), &recordings(folder.path()), None).is_err());
}

#[test]
fn a_new_answer_counts_and_not_a_copy_of_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let live = Options { answers: AnswerSource::Live, ..small() };
    let views = [two_segments("000", 80, 80)];
    let ask = |material: &'static str| {
        let asker = Scripted::new(move |_| text(good_answer(material)));
        run(&prepare(&views, &prompts, &live), &recordings(folder.path()), Some(&asker)).unwrap();
    };
    ask(a("wood"));
    for key in recordings(folder.path()).keys() {
        fs::copy(folder.path().join(format!("{key}.json")), folder.path().join(format!("z{key}.json"))).unwrap();
    }
    ask(a("metal"));
    let replayed = run(&prepare(&views, &prompts, &replay()), &recordings(folder.path()), None).unwrap();
    let expected = a("metal");
    for segment in &replayed.answers.all {
        assert!(matches!(&segment.outcome, Outcome::Answered(answer) if answer.material == expected), "{segment:?}");
    }
}

#[test]
fn an_unusable_answer_is_asked_once_more_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let asker = Scripted::new(|ask| match ask.correction {
        None => text(super::with(good_answer(a("wood")), "material", "mystery stuff".into())),
        Some(correction) => {
            assert!(correction.prompt.contains("mystery stuff") && correction.response.contains("mystery stuff"));
            text(good_answer(a("wood")))
        }
    });
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let run = run(&queries, &recordings(folder.path()), Some(&asker)).unwrap();
    assert_eq!(asker.count(), 4);
    assert_eq!(run.answers.failed().count(), 0);
    assert_eq!(run.spent.requests, 4);
}

#[test]
fn a_usable_answer_survives_a_correction_that_fails() {
    let prompts = Prompts::builtin();
    let options = small();
    let first = || text(with(good_answer(a("wood")), "material", format!("{} tree", a("wood")).into()));
    let failures: [fn() -> Result<ReplyContent, AskError>; 3] = [
        || text("{}"),
        || Ok(ReplyContent::Refusal("no".to_owned())),
        || Err(AskError::Failed("no answer in time".to_owned())),
    ];
    for second in failures {
        let folder = tempfile::tempdir().unwrap();
        let asker = Scripted::new(move |ask| if ask.correction.is_none() { first() } else { second() });
        let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
        let run = run(&queries, &recordings(folder.path()), Some(&asker)).unwrap();
        assert_eq!((asker.count(), run.answers.failed().count()), (4, 0));
        assert_eq!(recordings(folder.path()).len(), 2);
    }
}

#[test]
fn failures_are_typed_counted_and_never_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    let queries = prepare(&views, &prompts, &options);
    let pictures: Vec<Vec<u8>> = queries.subjects.iter().map(|segment| segment.jpeg.clone()).collect();
    let asker = Scripted::new(|ask| match pictures.iter().position(|picture| picture == ask.picture) {
        Some(0) => Ok(ReplyContent::Refusal("not this one".into())),
        Some(1) => Err(AskError::Failed("status 500".into())),
        Some(2) => text("no idea"),
        _ => text(good_answer(a("wood"))),
    });
    let run = run(&queries, &recordings(folder.path()), Some(&asker)).unwrap();
    let failures: Vec<Failure> = run
        .answers
        .failed()
        .map(|segment| match &segment.outcome {
            Outcome::Failed(failure) => failure.clone(),
            Outcome::Answered(_) => unreachable!("failed() gives failures"),
        })
        .collect();
    assert_eq!(failures[0], Failure::Refused { message: "not this one".into() });
    assert_eq!(failures[1], Failure::Endpoint { message: "status 500".into() });
    assert!(matches!(&failures[2], Failure::Invalid { .. }));
    assert_eq!(recordings(folder.path()).len(), 1);
}

#[test]
fn an_endpoint_beyond_hope_ends_the_run_and_keeps_what_was_answered() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    let queries = prepare(&views, &prompts, &options);
    let first = queries.subjects[0].jpeg.clone();
    let asker = Scripted::new(|ask| {
        if ask.picture == first {
            return text(good_answer(a("wood")));
        }
        // Waits until the first answer, which was asked for at the same time, is recorded.
        while recordings(folder.path()).is_empty() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        Err(AskError::Fatal("wrong key".into()))
    });
    let error = run(&queries, &recordings(folder.path()), Some(&asker)).unwrap_err();
    // Which of the two is reported first depends on the threads.
    assert!(matches!(&error, QueryError::Endpoint { left: 3 | 4, .. }), "{error:?}");
    assert_eq!(recordings(folder.path()).len(), 1);
}

#[test]
fn family_first_records_both_questions_and_replays_through_moved_masks() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = Options { guidance: Guidance::FamilyFirst, ..small() };
    let replay = Options { guidance: Guidance::FamilyFirst, ..replay() };
    let asker = Scripted::new(|ask| {
        if ask.question.prompt.contains("youngs_modulus_mpa") {
            assert!(!ask.question.prompt.contains("\nmetal:"), "only the family's materials");
            return text(good_answer(a("wood")));
        }
        text(r#"{"caption":"a stick","family":"wood"}"#)
    });
    let original = [two_segments("000", 80, 80)];
    let live = run(&prepare(&original, &prompts, &options), &recordings(folder.path()), Some(&asker)).unwrap();
    assert_eq!((asker.count(), live.answers.failed().count()), (4, 0));
    let mut moved = two_segments("000", 80, 82);
    moved.photo = original[0].photo.clone();
    let replayed = run(&prepare(&[moved], &prompts, &replay), &recordings(folder.path()), None).unwrap();
    assert!(matches!(matched(&replayed)[..], [Match::Mask { .. }, Match::Mask { .. }]));
}

/// The family is asked about first; nothing else is sent until it is known.
#[test]
fn a_submission_of_first_questions_costs_no_more_than_these() {
    let (folder, prompts) = (tempfile::tempdir().unwrap(), Prompts::builtin());
    let options = Options { guidance: Guidance::FamilyFirst, ..small() };
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let asker = Scripted::new(|_| text("{}"));
    let (now, later) = queries.submission_cost(&recordings(folder.path()), asker.answerer(), None, 1, |_, _| true);
    assert_eq!((now.requests, later.requests), (1, 1));
    let whole = queries.preview(&recordings(folder.path()), Some(asker.answerer()), None);
    assert_eq!(whole.cost.requests, 4, "in the end, each segment has two questions");
}

#[test]
fn the_budget_stops_before_and_during_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let price = gprop::query::ask::cost::PriceTable::builtin().price("gpt-4o").cloned();
    let asker = Scripted::new(|_| text(good_answer(a("wood"))));
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    let with_budget = |max_usd: f64, spends_first: bool| {
        let options = Options { max_usd: Some(max_usd), lmm_parallel: 1, ..small() };
        let queries = prepare(&views, &prompts, &options);
        let preview = queries.preview(&recordings(folder.path()), None, price.as_ref());
        let store = recordings(folder.path());
        let budget = Budget::new(price.clone(), Some(max_usd));
        if spends_first {
            let free = Cost { most_usd: Some(0.0), ..Cost::default() };
            budget.account(free).open().unwrap().answered(Some(Usage { input_tokens: 1000, output_tokens: 100 }));
        }
        let run = queries.run(&store, Some(&asker), &budget, Progress::HIDDEN);
        (preview, run)
    };
    let (preview, result) = with_budget(1e-6, false);
    assert!(matches!(result, Err(QueryError::OverBudget { requests: 4, .. })), "{result:?}");
    assert!(result.unwrap_err().to_string().ends_with("--max-usd 0.000001; nothing was sent"));
    // Enough for these four, had an earlier round not spent a part of it.
    let (_, result) = with_budget(preview.cost.usd.unwrap() + 1e-3, true);
    assert!(matches!(result, Err(QueryError::OverBudget { requests: 4, .. })), "{result:?}");
    let error = result.unwrap_err().to_string();
    assert!(!error.contains("nothing was sent"), "{error}");
    assert!(error.contains("spent so far: 1 request") && error.contains("answers so far are recorded"), "{error}");
    assert_eq!(asker.count(), 0);
    assert_eq!((preview.questions, preview.recorded, preview.cost.requests), (4, 0, 4));

    // Enough for answers of the usual length, too little if all of them had the maximum length.
    let (_, result) = with_budget(preview.cost.usd.unwrap() * 1.01, false);
    let asked = asker.count();
    match result {
        Err(QueryError::BudgetSpent { left, spent_usd, max_usd }) => {
            assert!(spent_usd <= max_usd);
            assert_eq!(recordings(folder.path()).len(), 4 - left);
        }
        Ok(_) => assert_eq!(asked, 4),
        Err(error) => panic!("{error}"),
    }

    let options = Options { max_usd: Some(1.0), ..small() };
    let other = [two_segments("002", 20, 80)];
    let unpriced = run(&prepare(&other, &prompts, &options), &recordings(folder.path()), Some(&asker));
    assert!(matches!(unpriced, Err(QueryError::NoPrice { .. })), "{unpriced:?}");
}

#[test]
fn broken_recordings_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    run(&prepare(&[two_segments("000", 80, 80)], &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();
    let path = fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    let whole = fs::read_to_string(&path).unwrap();
    let table = [
        whole[..whole.len() / 2].to_owned(),
        whole.replace("\"scripted\"", "\"another\""),
        whole.replace("\"format\": 1", "\"format\": 9"),
        whole.replace("\"width\": 160", "\"width\": 161"),
        "[]".into(),
    ];
    for text in table {
        fs::write(&path, text).unwrap();
        let error = Recordings::open(&[], folder.path()).unwrap_err();
        assert!(matches!(&error, RecordingError::Broken { path: named, .. } if *named == path), "{error}");
    }
    fs::write(folder.path().join("README.md"), "not a recording").unwrap();
    fs::write(&path, whole).unwrap();
    assert_eq!(Recordings::open(&[&folder.path().join("none")], folder.path()).unwrap().len(), 2);
}

#[test]
fn what_no_segment_uses_is_told_from_what_serves() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let views = [two_segments("000", 80, 80), two_segments("001", 90, 80)];
    run(&prepare(&views, &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();

    // The second view is gone, and the first one's border moved by two columns: by ten it would be another segment.
    let mut moved = two_segments("000", 80, 82);
    moved.photo = views[0].photo.clone();
    let store = recordings(folder.path());
    let used = prepare(&[moved], &prompts, &options).used(&store);
    assert_eq!((store.len(), used.len()), (4, 2));
    let whole = prepare(&views, &prompts, &options);
    assert_eq!(whole.used(&store).len(), 4);
    // A copy goes too, whatever its name.
    let unused = store.keys().into_iter().find(|key| !used.contains(key)).unwrap();
    fs::copy(folder.path().join(format!("{unused}.json")), folder.path().join("copy.json")).unwrap();
    let store = recordings(folder.path());
    for key in store.keys().iter().filter(|key| !used.contains(key)) {
        store.remove(key).unwrap();
    }
    assert_eq!(recordings(folder.path()).keys(), used.into_iter().collect::<Vec<_>>());
    // The spare folder belongs to a work folder: nothing is removed from it.
    let elsewhere = folder.path().join("recorded");
    let store = recordings(&elsewhere).with_spare(folder.path()).unwrap();
    assert_eq!(store.len(), 2);
    store.keys().iter().for_each(|key| store.remove(key).unwrap());
    assert_eq!((store.len(), recordings(folder.path()).len()), (0, 2));
}

#[test]
fn what_refusals_and_empty_answers_took_is_paid_too() {
    let folder = tempfile::tempdir().unwrap();
    let prompts = Prompts::builtin();
    let options = small();
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);

    let empty = Scripted::new(|_| Ok(ReplyContent::Empty("the answer is empty".into())));
    let stopped = run(&queries, &recordings(folder.path()), Some(&empty));
    let Err(QueryError::InVain(in_vain)) = stopped else { panic!("{stopped:?}") };
    assert_eq!((in_vain.spent.requests, in_vain.spent.usage.input_tokens), (2, 2000));

    let refusing = Scripted::new(|_| Ok(ReplyContent::Refusal("no".into())));
    let run = run(&queries, &recordings(folder.path()), Some(&refusing)).unwrap();
    assert_eq!((run.spent.requests, run.spent.usage.input_tokens), (2, 2000));
    let error = run.answers.require_any().unwrap_err().to_string();
    assert!(error.contains("none of the 2 questions") && error.contains("(2 questions)"), "{error}");
}
