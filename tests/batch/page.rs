//! `index.html` of a batch: complete, harmless whatever the scenes' names, and sorted and searched in a browser.

use std::fs;

use serde_json::{Value, json};

use super::ball::Balls;
use super::{batch, outcomes, stderr};
use crate::support::browser::Page;

/// A hostile name of a scene, as far as a file name can hold it.
const HOSTILE: &str = "x\"><img src=x onerror=document.title='taken'> {{ 7*7 }} %2e";

/// Three balls after a batch: one is done, one is called [`HOSTILE`], and one has failed with markup in its
/// message.
fn run() -> (Balls, String) {
    let balls = Balls::new(3);
    fs::rename(balls.scene(1), balls.folder().join(HOSTILE)).unwrap();
    fs::write(balls.scene(2).join("gprop.toml"), "\"<b>views</b>\" = 3\n").unwrap();
    assert_eq!(outcomes(&mut batch(&balls, &["--jobs", "2"]), 6).len(), 3);
    fs::write(balls.folder().join(HOSTILE).join("gprop/report.html"), "the report").unwrap();
    let merged = batch(&balls, &["--merge"]).output().unwrap();
    assert_eq!(merged.status.code(), Some(6), "{}", stderr(&merged));
    let page = fs::read_to_string(balls.folder().join("gprop/batch/index.html")).unwrap();
    (balls, page)
}

#[test]
fn the_page_is_whole_and_harmless() {
    let (balls, page) = run();
    assert!(!page.contains("<img src=x") && !page.contains("<b>views"), "markup from outside");
    assert!(page.contains("&lt;img src=x") && page.contains("&lt;b&gt;views"), "what came from outside is shown");
    assert_eq!(page.matches("</script").count(), page.matches("<script").count());
    for reference in ["src=\"http", "href=\"http", "url(http", "@import", "src=\"/", "src=\"."] {
        assert!(!page.contains(reference), "{reference}");
    }
    let link = page.split_once("<a href=\"").unwrap().1.split_once('"').unwrap().0;
    assert!(link.starts_with("../../x%22%3E%3Cimg%20src%3Dx") && link.ends_with("%252e/gprop/report.html"), "{link}");
    assert_eq!(page.matches("<a href").count(), 1, "only what is there is linked");
    assert_eq!(page.matches("data:image/jpeg").count(), 2, "two scenes have a picture");
    // The page is made even if a picture is missing or is not a picture.
    fs::remove_file(balls.scene(0).join("gprop/thumbnail.jpg")).unwrap();
    fs::write(balls.folder().join(HOSTILE).join("gprop/thumbnail.jpg"), "no picture").unwrap();
    let again = || {
        assert_eq!(batch(&balls, &["--merge"]).output().unwrap().status.code(), Some(6));
        fs::read_to_string(balls.folder().join("gprop/batch/index.html")).unwrap()
    };
    let without = again();
    assert_eq!(without.matches("data:image/jpeg").count(), 0);
    assert_eq!(without, again(), "the same outcomes, the same bytes");
}

#[test]
fn rows_are_sorted_and_found() {
    let (balls, _) = run();
    let url = format!("file://{}", balls.folder().join("gprop/batch/index.html").display());
    let Some(page) = Page::open("rows_are_sorted_and_found", &url, "tbody tr") else { return };
    let names = |page: &Page| -> Vec<String> {
        let shown = "[...document.querySelectorAll('tbody tr')].filter((row) => !row.hidden)";
        let names = page.evaluate(&format!("{shown}.map((row) => row.cells[1].firstChild.textContent).join('|')"));
        names.as_str().unwrap().split('|').filter(|name| !name.is_empty()).map(str::to_owned).collect()
    };
    let press = |page: &Page, head: &str| {
        let button = format!("[...document.querySelectorAll('th button')].find((b) => b.textContent === {head:?})");
        page.evaluate(&format!("{button}.focus()"));
        page.press_key("Enter");
        page.evaluate(&format!("{button}.closest('th').ariaSort")).as_str().map(str::to_owned)
    };
    assert_eq!(names(&page), ["ball-0", "ball-2", HOSTILE]);
    assert_eq!(press(&page, "scene").as_deref(), Some("descending"));
    assert_eq!(names(&page), [HOSTILE, "ball-2", "ball-0"]);
    // An error that begins with a number is not a part of the name above it.
    let first = "[...document.querySelectorAll('td.name')].find((cell) => cell.textContent === 'ball-0')";
    page.evaluate(&format!("{first}.append('12 requests would cost too much')"));
    assert_eq!(press(&page, "scene").as_deref(), Some("ascending"));
    assert_eq!(names(&page), ["ball-0", "ball-2", HOSTILE]);
    assert_eq!(press(&page, "state").as_deref(), Some("ascending"));
    assert_eq!(names(&page)[0], "ball-2", "what failed comes first");
    assert_eq!(page.evaluate("document.querySelectorAll('[aria-sort]').length"), 1);
    // The failed scene has no mass: it comes last in either order of the others.
    let masses = |page: &Page| -> Vec<f64> {
        let masses = page.evaluate(
            "[...document.querySelectorAll('tbody tr')].map((row) => row.cells[4].dataset.v ?? 'none').join()",
        );
        masses.as_str().unwrap().split(',').filter_map(|mass| mass.parse().ok()).collect()
    };
    press(&page, "mass, kg");
    assert!(masses(&page).len() == 2 && masses(&page)[0] < masses(&page)[1], "{:?}", masses(&page));
    assert_eq!(names(&page)[2], "ball-2");
    press(&page, "mass, kg");
    assert!(masses(&page)[0] > masses(&page)[1], "{:?}", masses(&page));
    assert_eq!(names(&page)[2], "ball-2");

    let look_for = |page: &Page, words: &str| {
        page.evaluate(&format!(
            "{{ const filter = document.getElementById('filter'); filter.value = {words:?}; filter.dispatchEvent(new Event('input')); }}"
        ));
        (names(page), page.text("#count"))
    };
    assert_eq!(look_for(&page, "FAILED"), (vec!["ball-2".to_owned()], "1 of 3 scenes".to_owned()));
    assert_eq!(look_for(&page, "ball done").0, ["ball-0"]);
    assert_eq!(look_for(&page, "<b>views").0, ["ball-2"], "words of an error");
    assert_eq!(look_for(&page, "").1, "3 scenes");

    assert_eq!(page.evaluate("document.querySelectorAll('img[src=x]').length"), 0);
    assert_ne!(page.evaluate("document.title"), "taken");
    page.evaluate("Promise.all([...document.images].map((image) => { image.loading = 'eager'; return image.decode(); })).then(() => true)");
    let picture = page.evaluate("[...document.images].map((image) => image.naturalWidth).join()");
    assert_eq!(picture, Value::from("192,192"));
    let ground = "getComputedStyle(document.body).backgroundColor";
    let before = page.evaluate(ground);
    page.click("#theme");
    assert_ne!(page.evaluate(ground), before, "light and dark differ");
    assert_eq!(page.complaints(), Vec::<String>::new());
}

/// A folder of so many scenes with made-up outcomes, and its page. Masses and widths follow a bell curve in logarithms;
/// scene 7 is far heavier than the others, every 100th has failed, and every 10th asked a model.
fn many(count: usize) -> (tempfile::TempDir, std::path::PathBuf) {
    let home = tempfile::tempdir().unwrap();
    let results = home.path().join("gprop/batch");
    fs::create_dir_all(&results).unwrap();
    let mut lines = String::new();
    for number in 0..count {
        let name = format!("scene-{number:05}");
        fs::create_dir(home.path().join(&name)).unwrap();
        fs::write(home.path().join(&name).join("point_cloud.ply"), "ply").unwrap();
        // The sum of four numbers that are evenly spread.
        let bell = |seed: usize| -> f64 {
            (1..5).map(|k| ((number + seed) * k * 7919 % 1009) as f64 / 1009.0).sum::<f64>() - 2.0
        };
        let mass = if number == 7 { 1e5 } else { (2.0 * bell(1)).exp() };
        let width = (0.3 + 0.2 * bell(2).abs()).exp();
        let materials = ["oak wood", "stainless steel", "polypropylene", "glazed stoneware"];
        let mut outcome = json!({
            "scene": name, "state": "done", "work": home.path().join(&name).join("gprop"), "exit": 0,
            "seconds": 20.0 + 10.0 * bell(3), "peak_memory_bytes": 900_000_000, "warnings": usize::from(number % 25 == 3),
            "parts": 1 + number % 9, "gaussians": 20_000 + 37 * number, "views": 10, "model": "gpt-4o",
            "asked": { "requests": usize::from(number % 10 == 0), "input_tokens": 900, "output_tokens": 90, "usd": 0.0031 },
            "mass_kg": { "low": mass / width, "mid": mass, "high": mass * width },
            "volume_m3": { "low": mass / 2000.0, "mid": mass / 1000.0, "high": mass / 500.0 },
            "materials": [materials[number % 4], materials[(number + 1) % 4]], "key": "made up",
        });
        if number % 100 == 50 {
            let results = ["mass_kg", "volume_m3", "parts", "gaussians", "views", "materials"];
            results.iter().for_each(|key| drop(outcome.as_object_mut().unwrap().remove(*key)));
            outcome["state"] = json!("failed");
            outcome["exit"] = json!(3);
            outcome["error"] = json!("no camera sees the object\nLook at transforms.json.");
        }
        lines += &format!("{outcome}\n");
    }
    fs::write(results.join("shard-0-of-1.jsonl"), lines).unwrap();
    let merged = crate::run::gprop().arg("batch").arg(home.path()).args(["--merge", "--quiet"]).output().unwrap();
    assert_eq!(merged.status.code(), Some(6), "{}", stderr(&merged));
    let page = results.join("index.html");
    (home, page)
}

/// Milliseconds that a script may take until the rows are laid out: a tenth of a second feels immediate, and a busy machine
/// is several times slower.
const FLUENT_MS: f64 = 500.0;

#[test]
fn thousands_of_rows_are_sorted_and_filtered_at_once() {
    let (_home, file) = many(5000);
    let url = format!("file://{}", file.display());
    let Some(page) = Page::open("thousands_of_rows", &url, "tbody tr") else { return };
    let took = |script: &str| {
        let timed = format!(
            "{{ const start = performance.now(); {script}; document.body.offsetHeight; performance.now() - start; }}"
        );
        let ms = page.evaluate(&timed).as_f64().unwrap();
        println!("{ms:.0} ms for {script}");
        assert!(ms < FLUENT_MS, "{ms} ms for {script}");
    };
    let press = |name: &str| {
        took(&format!(
            "[...document.querySelectorAll('thead button, .mark')].find((b) => b.textContent.startsWith({name:?})).click()"
        ));
    };
    let look_for = |words: &str| {
        took(&format!(
            "document.getElementById('filter').value = {words:?}; document.getElementById('filter').dispatchEvent(new Event('input'))"
        ));
    };
    let first = || page.evaluate("document.querySelector('tbody .name').firstChild.textContent.trim()");
    let count = || page.text("#count");
    press("mass, kg");
    press("mass, kg");
    assert_eq!((first(), count()), ("scene-00007".into(), "5000 scenes".to_owned()));
    press("failed 50");
    assert_eq!((first(), count()), ("scene-00050".into(), "50 of 5000 scenes".to_owned()));
    press("failed 50");
    press("unusually heavy");
    assert_eq!(first(), Value::from("scene-00007"));
    press("unusually heavy");
    look_for("oak scene-0001");
    assert_eq!(count(), "5 of 5000 scenes");
    look_for("");
    took(
        "document.querySelectorAll('figure')[0].querySelector('rect:last-of-type').dispatchEvent(new MouseEvent('click', { bubbles: true }))",
    );
    assert_eq!((first(), count()), ("scene-00007".into(), "1 of 5000 scenes".to_owned()), "the bar of the heaviest");
    page.click("#all");
    assert_eq!(count(), "5000 scenes");
    // Every scene that has a mass is in one bar of either histogram.
    let in_bars = "[...document.querySelectorAll('figure')].map((figure) => [...figure.querySelectorAll('rect')].reduce((sum, bar) => sum + parseInt(bar.ariaLabel), 0)).join()";
    assert_eq!(page.evaluate(in_bars), Value::from("4950,4950"));
    let in_table = || page.evaluate("document.querySelectorAll('tbody tr').length").as_u64().unwrap();
    assert!(in_table() < 1000, "only the rows near the visible ones");
    page.evaluate("scrollTo(0, document.body.scrollHeight)");
    page.wait_for("tbody tr:nth-child(150)");
    assert_eq!(page.complaints(), Vec::<String>::new());
}
