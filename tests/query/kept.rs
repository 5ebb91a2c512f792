//! Answers that were paid for are kept, and paid for only once.

use std::fs;
use std::path::Path;
use std::sync::{Mutex, Once};

use gprop::query::recorded::{RecordingError, Recordings, key};
use gprop::query::{AnswerSource, Options, Prompts, QueryError};

use super::client::{Server, error, ok};
use super::{
    Scripted, a, connect, good_answer, grid, one_segment, prepare, recordings, run, small, text, two_segments,
};

/// The names of the entries of a folder.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Checks that a folder holds this many recordings and nothing else.
fn assert_only_recordings(folder: &Path, count: usize) {
    let names = names(folder);
    assert!(names.iter().all(|name| name.len() == 64 + ".json".len() && name.ends_with(".json")), "{names:?}");
    assert_eq!(names.len(), count);
}

#[test]
fn two_runs_on_one_scene_pay_once() {
    let server = Server::new(|_, _, _| ok(&good_answer(a("wood")).to_string()));
    let (folder, prompts) = (tempfile::tempdir().unwrap(), Prompts::builtin());
    let options = Options { lmm_parallel: 4, ..server.options() };
    let queries = prepare(&[grid(50)], &prompts, &options);
    // Neither finds anything recorded when it begins.
    let stores = [recordings(folder.path()), recordings(folder.path())];
    std::thread::scope(|scope| {
        for store in &stores {
            let (queries, options) = (&queries, &options);
            scope.spawn(move || {
                let client = connect(options, None).unwrap().unwrap();
                let outcome = run(queries, store, Some(&client)).unwrap();
                assert_eq!((outcome.answers.all.len(), outcome.answers.failed().count()), (50, 0));
            });
        }
    });
    assert_eq!(server.requests().len(), 50);
    assert_only_recordings(folder.path(), 50);
}

#[test]
fn who_waited_for_a_question_that_failed_asks_it() {
    let server = Server::new(|count, _, _| match count {
        0 => error(418, "not now"),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    let (folder, prompts) = (tempfile::tempdir().unwrap(), Prompts::builtin());
    let options = server.options();
    let queries = prepare(&[one_segment()], &prompts, &options);
    let stores = [recordings(folder.path()), recordings(folder.path())];
    let failed = Mutex::new(0);
    std::thread::scope(|scope| {
        for store in &stores {
            let (queries, options, failed) = (&queries, &options, &failed);
            scope.spawn(move || {
                let client = connect(options, None).unwrap().unwrap();
                *failed.lock().unwrap() += run(queries, store, Some(&client)).unwrap().answers.failed().count();
            });
        }
    });
    assert_eq!((*failed.lock().unwrap(), server.requests().len()), (1, 2));
    assert_only_recordings(folder.path(), 1);
}

#[test]
fn a_lock_whose_owner_died_keeps_no_run_out_and_goes() {
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), small());
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    for segment in &queries.subjects {
        let key = key(&wood.answerer, &segment.asked(queries.questions.first()));
        fs::write(folder.path().join(format!(".asking-{key}.lock")), "").unwrap();
    }
    assert_eq!(recordings(folder.path()).len(), 0, "a lock is not a recording");
    run(&queries, &recordings(folder.path()), Some(&wood)).unwrap();
    assert_eq!(wood.count(), 2);
    assert_only_recordings(folder.path(), 2);
}

#[test]
fn a_lock_that_is_a_link_is_not_followed() {
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), small());
    let outside = tempfile::tempdir().unwrap();
    let target = outside.path().join("made");
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let queries = prepare(&[one_segment()], &prompts, &options);
    let key = key(&wood.answerer, &queries.subjects[0].asked(queries.questions.first()));
    std::os::unix::fs::symlink(&target, folder.path().join(format!(".asking-{key}.lock"))).unwrap();
    let error = run(&queries, &recordings(folder.path()), Some(&wood)).unwrap_err();
    assert!(matches!(&error, QueryError::Recording(_)) && error.to_string().contains("link"), "{error}");
    assert!(!target.exists());
    assert_eq!(wood.count(), 0);
}

#[test]
fn replay_writes_nothing() {
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), small());
    let views = [two_segments("000", 80, 80)];
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    run(&prepare(&views, &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();
    let changed = || fs::metadata(folder.path()).unwrap().modified().unwrap();
    let before = changed();
    for answers in [AnswerSource::Replay, AnswerSource::Record] {
        let options = Options { answers, ..small() };
        run(&prepare(&views, &prompts, &options), &recordings(folder.path()), Some(&wood)).unwrap();
    }
    assert_eq!((changed(), wood.count()), (before, 2), "not even a lock came and went");
}

#[test]
fn recordings_that_cannot_be_written_are_found_before_anything_is_asked() {
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), small());
    let place = folder.path().join("recorded");
    let store = recordings(&place);
    fs::write(&place, "a file in the place of the folder").unwrap();
    let wood = Scripted::new(|_| text(good_answer(a("wood"))));
    let queries = prepare(&[two_segments("000", 80, 80)], &prompts, &options);
    let error = run(&queries, &store, Some(&wood)).unwrap_err();
    assert!(matches!(&error, QueryError::Recording(RecordingError::NoPlace { folder, .. }) if *folder == place));
    for word in ["recorded", "nothing was asked", "--recordings"] {
        assert!(error.to_string().contains(word), "no {word:?} in {error}");
    }
    assert_eq!(wood.count(), 0);
}

#[test]
fn an_answer_that_cannot_be_stored_is_set_aside_and_stops_the_asking() {
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), small());
    let (place, spare) = (folder.path().join("recorded"), folder.path().join("unrecorded"));
    let store = recordings(&place).with_spare(&spare).unwrap();
    // The folder disappears while the first questions are in progress; it is renamed, since other threads may be
    // creating their locks in it.
    let go = Once::new();
    let wood = Scripted::new(|_| {
        go.call_once(|| {
            fs::rename(&place, folder.path().join("gone")).unwrap();
            fs::write(&place, "a file in the place of the folder").unwrap();
        });
        text(good_answer(a("wood")))
    });
    let queries = prepare(&[grid(25)], &prompts, &options);
    let error = run(&queries, &store, Some(&wood)).unwrap_err();
    let QueryError::Unkept { spare: Some(named), .. } = &error else { panic!("{error}") };
    assert_eq!(*named, spare);
    for word in ["unrecorded", "nothing more was asked", "recorded\""] {
        assert!(error.to_string().contains(word), "no {word:?} in {error}");
    }
    assert!((1..=3).contains(&wood.count()), "{} were asked: only those that were out already", wood.count());
    assert_only_recordings(&spare, wood.count());

    // The next run with this work folder pays for none of them again.
    fs::remove_file(&place).unwrap();
    let again = Scripted::new(|_| text(good_answer(a("wood"))));
    let store = recordings(&place).with_spare(&spare).unwrap();
    run(&queries, &store, Some(&again)).unwrap();
    assert_eq!(again.count() + wood.count(), 25);
}

#[test]
fn an_answer_that_finds_no_room_anywhere_is_an_error_that_says_where_it_is() {
    let (folder, prompts, options) = (tempfile::tempdir().unwrap(), Prompts::builtin(), small());
    let place = folder.path().join("recorded");
    let store: Recordings = recordings(&place);
    let wood = Scripted::new(|_| {
        fs::remove_dir_all(&place).unwrap();
        fs::write(&place, "a file in the place of the folder").unwrap();
        text(good_answer(a("wood")))
    });
    let error = run(&prepare(&[one_segment()], &prompts, &options), &store, Some(&wood)).unwrap_err();
    assert!(matches!(&error, QueryError::Unkept { spare: None, .. }), "{error}");
    assert!(error.to_string().contains("printed above"), "{error}");
}
