//! `gprop query` as a user types it, against a server on loopback.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use image::{Rgba, RgbaImage};
use serde_json::{Value, json};

use super::client::{CANARY, Server, error, ok};
use super::offline::{assert_untouched, listener};
use super::{a, good_answer, good_answer_about_part, with};
use crate::batch::contents;
use crate::run::{gprop, hammer};
use crate::support::server::MockServer;
use crate::support::{models, said};

/// Few prompts and little to simulate: the other stages that the queries need take seconds.
const FEW_PROMPTS: &[&str] = &["--points-per-side", "6", "--level", "small"];

/// A picture of a brown bar with a grey head on a transparent background.
fn picture(folder: &Path) -> PathBuf {
    let path = folder.join("tool.png");
    let picture = RgbaImage::from_fn(160, 120, |x, y| match (x, y) {
        (20..60, 30..90) => Rgba([120, 120, 128, 255]),
        (60..140, 50..70) => Rgba([150, 100, 60, 255]),
        _ => Rgba([0, 0, 0, 0]),
    });
    picture.save(&path).unwrap();
    path
}

/// The same with its segments, where a command finds them and continues as after a kill. SAM makes them once for all tests.
fn segmented_picture(folder: &Path) -> PathBuf {
    static SEGMENTS: OnceLock<Vec<(PathBuf, Vec<u8>)>> = OnceLock::new();
    let path = picture(folder);
    give(
        SEGMENTS.get_or_init(|| segments_of(&path, &path.with_extension("gprop"), &[])),
        &path.with_extension("gprop"),
    );
    path
}

/// What SAM finds in a subject with few prompts.
fn segments_of(subject: &Path, work: &Path, more: &[&str]) -> Vec<(PathBuf, Vec<u8>)> {
    let output = gprop().arg("segment").arg(subject).args(FEW_PROMPTS).args(more).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let segments = contents(&work.join("segments"));
    fs::remove_dir_all(work).unwrap();
    segments
}

fn give(segments: &[(PathBuf, Vec<u8>)], work: &Path) {
    fs::create_dir_all(work.join("segments")).unwrap();
    segments.iter().for_each(|(name, bytes)| fs::write(work.join("segments").join(name), bytes).unwrap());
}

fn query(subject: &Path, server: Option<&Server>, more: &[&str]) -> Command {
    let mut command = gprop();
    command.env_remove("OPENAI_API_KEY").arg("query").arg(subject).args(FEW_PROMPTS).args(more);
    if let Some(options) = server.map(Server::options) {
        command.args(["--lmm-url", &options.lmm_url.unwrap(), "--lmm-model", &options.lmm_model.unwrap()]);
    }
    command
}

/// Every file below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

fn recorded(folder: &Path) -> usize {
    fs::read_dir(folder.join("recorded")).map_or(0, Iterator::count)
}

#[test]
fn one_picture_is_enough() {
    if models("one_picture_is_enough").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = picture(folder.path());
    let server =
        Server::new(|count, _, _| ok(&good_answer(if count % 2 == 0 { a("wood") } else { a("metal") }).to_string()));
    let output = query(&path, Some(&server), &["--lmm-parallel", "1"]).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let work = folder.path().join("tool.gprop");
    let answers = fs::read_to_string(work.join("answers.jsonl")).unwrap();
    let segments = answers.lines().count();
    assert!(segments >= 1 && answers.contains(&format!("\"material\":\"{}\"", a("wood"))), "{answers}");
    assert!(String::from_utf8_lossy(&output.stdout).trim().ends_with("material_map.png"));
    let map = image::open(work.join("material_map.png")).unwrap().into_rgb8();
    assert!(map.width() > 2 * 160 && map.height() > 120 + 20, "two panels and a legend: {:?}", map.dimensions());
    assert_eq!(recorded(&work), segments);

    let replayed = query(&path, None, &["--answers", "replay", "--json"]).output().unwrap();
    let lines: Value = serde_json::from_slice(&replayed.stdout).unwrap();
    assert_eq!((lines.as_array().unwrap().len(), &lines[0]["matched"]["matched"]), (segments, &json!("exact")));

    // With other labels the questions differ: no question uses the recordings, and they are pruned.
    let missed = query(&path, None, &["--answers", "replay", "--labels", "abo"]).output().unwrap();
    assert_eq!(missed.status.code(), Some(5), "{}", said(&missed));
    assert!(said(&missed).contains("view tool, region"), "{}", said(&missed));
    let kept = query(&path, None, &["--prune"]).output().unwrap();
    assert!(said(&kept).contains(&format!("0 recordings removed, {segments} kept")), "{}", said(&kept));
    let pruned = query(&path, None, &["--prune", "--labels", "abo"]).output().unwrap();
    let recordings = if segments == 1 { "recording" } else { "recordings" };
    assert!(said(&pruned).contains(&format!("{segments} {recordings} removed, 0 kept")), "{}", said(&pruned));
    assert_eq!(recorded(&work), 0);
}

#[test]
fn who_is_asked_about_how_many_pictures_is_told_before_the_first_request() {
    if models("who_is_asked_about_how_many_pictures_is_told_before_the_first_request").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = segmented_picture(folder.path());
    // The server does not answer before the test has read which server is asked. It gives up after far longer than the
    // line takes on any machine, or else a missing line would hang the test.
    let (told, wait) = std::sync::mpsc::channel::<()>();
    let wait = std::sync::Mutex::new(wait);
    let server = Server::new(move |count, _, _| {
        if count == 0 && wait.lock().unwrap().recv_timeout(Duration::from_secs(600)).is_err() {
            return error(403, "nothing was told within ten minutes");
        }
        ok(&good_answer(a("wood")).to_string())
    });
    let url = format!("{}?key={CANARY}", server.options().lmm_url.unwrap());
    let host = url.strip_prefix("http://").unwrap().split('/').next().unwrap();
    let mut command = query(&path, None, &["-q", "--lmm-url", &url, "--lmm-model", "gpt-4o", "--max-usd", "5"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let first = lines.next().expect("a line before the first answer");
    told.send(()).unwrap();
    let rest: Vec<String> = lines.collect();
    assert!(child.wait().unwrap().success(), "{first}\n{}", rest.join("\n"));

    let pictures = recorded(&folder.path().join("tool.gprop"));
    let noun = if pictures == 1 { "picture" } else { "pictures" };
    assert!(first.starts_with(&format!("asking gpt-4o at {host} about {pictures} {noun}: ")), "{first}");
    assert!(first.contains(" USD") && first.contains("at most 5 USD, as set by --max-usd"), "{first}");
    assert!(!first.contains(CANARY) && !rest.join("\n").contains(CANARY), "{first} {rest:?}");
    for file in files(folder.path()) {
        let bytes = fs::read(&file).unwrap();
        assert!(!bytes.windows(CANARY.len()).any(|window| window == CANARY.as_bytes()), "the key is in {file:?}");
    }

    // If everything is recorded, no server is asked, and no notice is printed.
    let replayed = query(&path, None, &["-q", "--lmm-url", &url, "--lmm-model", "gpt-4o"]).output().unwrap();
    assert!(replayed.status.success() && said(&replayed).is_empty(), "{}", said(&replayed));
}

/// The command in an environment that names only this proxy.
fn behind(proxy: &MockServer, command: &mut Command) -> Output {
    let url = proxy.uri().replace("http://", &format!("http://me:{CANARY}@"));
    for name in ["http_proxy", "https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY", "no_proxy", "NO_PROXY"] {
        command.env_remove(name);
    }
    command.env("http_proxy", url).output().unwrap()
}

#[test]
fn a_proxy_that_pictures_pass_through_is_named_and_not_used_for_this_machine() {
    if models("a_proxy_that_pictures_pass_through_is_named_and_not_used_for_this_machine").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = segmented_picture(folder.path());
    let proxy = MockServer::new(|_| ok(&good_answer(a("wood")).to_string()));
    let far = ["-q", "--lmm-url", "http://model.invalid/v1", "--lmm-model", "far"];
    let output = behind(&proxy, &mut query(&path, None, &far));
    assert!(output.status.success(), "{}", said(&output));
    let host = proxy.uri().replace("http://", "");
    let expected = format!("asking far at model.invalid through the proxy {host} about ");
    assert!(said(&output).contains(&expected) && !said(&output).contains(CANARY), "{}", said(&output));
    let passed = proxy.requests();
    assert!(
        passed.iter().all(|request| request.url == "http://model.invalid/v1/chat/completions") && !passed.is_empty()
    );

    let server = Server::new(|_, _, _| ok(&good_answer(a("wood")).to_string()));
    let output = behind(&proxy, &mut query(&path, Some(&server), &["-q"]));
    assert!(output.status.success() && !said(&output).contains("through"), "{}", said(&output));
    assert_eq!((server.requests().len(), proxy.requests().len()), (passed.len(), passed.len()));
}

#[test]
fn a_wait_that_the_server_asks_for_is_shown() {
    if models("a_wait_that_the_server_asks_for_is_shown").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = segmented_picture(folder.path());
    let server = Server::new(|count, _, _| match count {
        0 => error(429, "slow down").header("retry-after", "1"),
        _ => ok(&good_answer(a("wood")).to_string()),
    });
    let output = query(&path, Some(&server), &["--lmm-parallel", "1"]).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("waiting 1 s, as the server asks"), "{}", said(&output));
}

#[test]
fn offline_opens_no_connection() {
    if models("offline_opens_no_connection").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = segmented_picture(folder.path());
    let (listener, url) = listener();
    let asking = ["--lmm-url", &url, "--lmm-model", "gpt-4o"];
    let ways: [(&[&str], &str, &str); 5] = [
        (&[], "1", "GPROP_OFFLINE"),
        (&["--answers", "live"], "1", "GPROP_OFFLINE"),
        (&["--batch-api", "submit"], "1", "GPROP_OFFLINE"),
        (&["--offline"], "0", "--offline"),
        (&["--offline", "--batch-api", "submit"], "0", "--offline"),
    ];
    for (more, variable, named) in ways {
        let mut command = query(&path, None, &[&asking, more].concat());
        let output = command.env("GPROP_OFFLINE", variable).output().unwrap();
        assert_eq!(output.status.code(), Some(5), "{more:?}: {}", said(&output));
        assert!(said(&output).contains(named) && !said(&output).contains("asking"), "{more:?}: {}", said(&output));
        assert_untouched(&listener);
    }
    assert!(!folder.path().join("tool.gprop/recorded").exists());

    // Recorded answers need no connection.
    let server = Server::new(|_, _, _| ok(&good_answer(a("wood")).to_string()));
    assert!(query(&path, Some(&server), &[]).output().unwrap().status.success());
    let asked = server.requests().len();
    let offline = query(&path, Some(&server), &["--offline"]).output().unwrap();
    assert!(offline.status.success(), "{}", said(&offline));
    assert_eq!(server.requests().len(), asked);

    // Collecting a submission needs a connection.
    let waiting = json!({ "jobs": [{ "id": "b", "waiting": [] }] });
    fs::write(folder.path().join("tool.gprop/batch_api.json"), waiting.to_string()).unwrap();
    let output =
        query(&path, None, &[&asking[..], &["--offline", "--batch-api", "collect"]].concat()).output().unwrap();
    assert_eq!(output.status.code(), Some(5), "{}", said(&output));
    assert!(said(&output).contains("--offline"), "{}", said(&output));
    assert_untouched(&listener);
}

#[test]
fn a_budget_that_is_no_amount_is_refused_as_it_is_typed() {
    for usd in ["nan", "inf", "-1"] {
        let output = gprop().args(["query", "nowhere", "--max-usd", usd]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{usd}: {}", said(&output));
        assert!(said(&output).contains("--max-usd") && said(&output).contains("US dollars"), "{}", said(&output));
    }
}

#[test]
fn a_mask_tells_a_pictures_foreground_and_an_empty_one_is_an_error() {
    if models("a_mask_tells_a_pictures_foreground_and_an_empty_one_is_an_error").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = picture(folder.path());
    let mask = folder.path().join("mask.png");
    image::GrayImage::from_fn(160, 120, |x, _| image::Luma([if x < 60 { 255 } else { 0 }])).save(&mask).unwrap();
    let out = folder.path().join("ex");
    let masked = ["--mask", mask.to_str().unwrap(), "--export", out.to_str().unwrap()];
    let output = query(&path, None, &masked).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let map = image::open(folder.path().join("tool.gprop/segments/tool.png")).unwrap().into_luma16();
    assert!(map.enumerate_pixels().all(|(x, _, label)| label[0] == 0 || x < 60), "segments keep to the mask");
    assert!(map.pixels().any(|label| label[0] != 0));

    image::GrayImage::new(160, 120).save(&mask).unwrap();
    let output = query(&path, None, &["--mask", mask.to_str().unwrap(), "--answers", "replay"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
}

#[test]
fn a_dry_run_makes_nothing() {
    let scene = hammer();
    let before = files(scene.path());
    let url = ["--dry-run", "--lmm-url", "http://127.0.0.1:9/v1", "--lmm-model", "gpt-4o"];
    let output = query(scene.path(), None, &url).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    assert!(said(&output).contains("segment   to do") && said(&output).contains("--to consensus"), "{}", said(&output));
    assert_eq!(files(scene.path()), before);

    let folder = tempfile::tempdir().unwrap();
    let path = picture(folder.path());
    let output = query(&path, None, &["--dry-run"]).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(files(folder.path()), [path]);
}

#[test]
fn a_scene_says_what_asking_would_cost_once_it_is_segmented() {
    if models("a_scene_says_what_asking_would_cost_once_it_is_segmented").is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = segmented_picture(folder.path());
    let prices = folder.path().join("prices.csv");
    let header = "model,input_usd_per_mtok,output_usd_per_mtok,image_tokens,as_of,source";
    fs::write(&prices, format!("{header}\ntest-model,1000000,0,patches 100000 1 0,2026-11-21,a contract\n")).unwrap();
    let export = folder.path().join("ex");
    assert!(query(&path, None, &["--export", export.to_str().unwrap()]).output().unwrap().status.success());
    let server = Server::new(|_, _, _| error(500, "nobody should ask"));
    let dry = ["--dry-run", "--json", "--prices", prices.to_str().unwrap()];
    let output = query(&path, Some(&server), &dry).output().unwrap();
    let plan: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", said(&output)));
    let cost = &plan["queries"]["cost"];
    let requests = fs::read_to_string(export.join("queries.jsonl")).unwrap().lines().count();
    assert_eq!(cost["requests"], requests);
    // A dollar per token, by the user's own table.
    assert_eq!(cost["usd"].as_f64(), cost["input_tokens"].as_f64());

    let budget = ["--max-usd", "1", "--prices", prices.to_str().unwrap()];
    let output = query(&path, Some(&server), &budget).output().unwrap();
    assert_eq!(output.status.code(), Some(5), "{}", said(&output));
    assert!(said(&output).contains("nothing was sent"), "{}", said(&output));
    assert!(server.requests().is_empty());
}

#[test]
fn a_run_without_one_answer_exits_5_and_the_next_asks_again() {
    if models("a_run_without_one_answer_exits_5_and_the_next_asks_again").is_none() {
        return;
    }
    let scene = one_view();
    let server = Server::new(|_, _, _| ok("I would rather not say."));
    for round in 1..=2 {
        let output = query(scene.path(), Some(&server), ONE_VIEW).output().unwrap();
        assert_eq!(output.status.code(), Some(5), "{}", said(&output));
        assert!(said(&output).contains("I would rather not say."), "{}", said(&output));
        assert_eq!(server.requests().len(), round * 5, "five useless replies end a run");
    }
    assert_eq!(recorded(scene.path()), 0);
}

#[test]
fn a_kill_loses_no_answer() {
    if models("a_kill_loses_no_answer").is_none() {
        return;
    }
    let scene = one_view();
    // Before the kill the server does not respond from its third answer on, so that the run is still going on any
    // machine.
    let killed = Arc::new(AtomicBool::new(false));
    let answers = Arc::clone(&killed);
    let server = Server::new(move |count, _, _| {
        let silent = count >= 2 && !answers.load(Ordering::SeqCst);
        let delay = if silent { Duration::from_secs(3600) } else { Duration::ZERO };
        ok(&good_answer_about_part(a("wood")).to_string()).delay(delay)
    });
    let one_by_one = [ONE_VIEW, &["--lmm-parallel", "1", "--ask", "parts"]].concat();
    let mut command = query(scene.path(), Some(&server), &one_by_one);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while server.requests().len() < 3 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was killed");
        // The run takes an unknown time to reach its third question.
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    killed.store(true, Ordering::SeqCst);
    assert!(recorded(scene.path()) >= 2, "what was answered is recorded");

    let output = query(scene.path(), Some(&server), &one_by_one).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let segments = fs::read_to_string(scene.path().join("gprop/answers.jsonl")).unwrap().lines().count();
    assert_eq!(recorded(scene.path()), segments, "what was locked by the killed run is no longer there");
    let asked = server.requests().len();
    assert!(
        asked == segments || asked == segments + 1,
        "{asked} requests for {segments} segments: only the last may be lost"
    );
}

#[test]
fn the_key_is_in_no_file_and_no_word() {
    if models("the_key_is_in_no_file_and_no_word").is_none() {
        return;
    }
    let scene = one_view();
    // A server that repeats the key in every response.
    let server = Server::new(|count, _, request| {
        let header = request.header("authorization").unwrap().to_owned();
        match count {
            0 => error(400, &format!("no json_schema for {header}")),
            1 => error(503, &header).header("retry-after-ms", "1"),
            2 => ok(&format!("{header} is what I got")),
            _ => ok(&with(good_answer_about_part(a("wood")), "caption", json!(header)).to_string()),
        }
    });
    let quick = ["--frames", "2", "--duration", "0.02", "--grid", "16", "--volume-cells", "50000", "--size", "64x64"];
    let options = server.options();
    let mut command = gprop();
    command.arg("run").arg(scene.path()).args(FEW_PROMPTS).args(ONE_VIEW).args(quick).arg("-vv");
    command.args(["--lmm-url", &options.lmm_url.unwrap(), "--lmm-model", "test-model"]);
    let output = command.env("OPENAI_API_KEY", CANARY).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let report = fs::read_to_string(scene.path().join("gprop/report.html")).unwrap();
    assert!(report.contains("[key]"), "the report shows the captions");
    assert!(!said(&output).contains(CANARY), "{}", said(&output));
    for file in files(scene.path()) {
        let bytes = fs::read(&file).unwrap();
        let found = bytes.windows(CANARY.len()).any(|window| window == CANARY.as_bytes());
        assert!(!found, "the key is in {file:?}");
    }
}

const ONE_VIEW: &[&str] = &["--view-list", "003"];

/// The hammer without recordings, one view of which has its segments.
fn one_view() -> tempfile::TempDir {
    static SEGMENTS: OnceLock<Vec<(PathBuf, Vec<u8>)>> = OnceLock::new();
    let scene = hammer();
    fs::remove_dir_all(scene.path().join("recorded")).unwrap();
    let work = scene.path().join("gprop");
    give(SEGMENTS.get_or_init(|| segments_of(scene.path(), &work, ONE_VIEW)), &work);
    scene
}
