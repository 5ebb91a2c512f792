//! The page in headless Chromium, from disk.

use gprop::pipeline::Options;
use gprop::scene::splat::ply;
use serde_json::Value;

use crate::support::browser::{Page, Point};

use super::{HOSTILE, json_file, small_run};

/// Number of points per row and column at which the object is looked for.
const PROBES: u32 = 9;

impl Page {
    fn color_by(&self, name: &str) {
        self.evaluate(&format!(
            "{{ const select = document.getElementById('color-by');
               select.value = [...select.options].find((option) => option.text === {name:?}).value;
               select.dispatchEvent(new Event('change')); }}"
        ));
    }

    /// Moves the pointer over the canvas, from its middle outwards, until the page reports a part there.
    fn find_object(&self) -> Point {
        let (corner, [width, height]) = self.content_box("#object");
        let mut probes: Vec<[u32; 2]> =
            (1..PROBES).flat_map(|row| (1..PROBES).map(move |column| [row, column])).collect();
        probes.sort_by_key(|probe| probe.map(|k| (2 * k).abs_diff(PROBES).pow(2)).iter().sum::<u32>());
        for [row, column] in probes {
            let share = |k: u32| f64::from(k) / f64::from(PROBES);
            let point = Point { x: corner.x + width * share(column), y: corner.y + height * share(row) };
            self.move_mouse_to(point);
            self.settle();
            if self.evaluate("document.getElementById('object').style.cursor") == "pointer" {
                return point;
            }
        }
        panic!("the pointer meets no Gaussian anywhere");
    }
}

/// The number that follows `name` in `text`.
fn number_after(text: &str, name: &str) -> f64 {
    let rest = text.split_once(name).unwrap_or_else(|| panic!("no {name:?} in {text:?}")).1;
    let digits: String = rest.trim_start().chars().take_while(|c| c.is_ascii_digit() || ".,".contains(*c)).collect();
    digits.replace(',', "").parse().unwrap_or_else(|_| panic!("no number after {name:?} in {text:?}"))
}

#[test]
fn a_click_on_the_object_reads_the_parts_number() {
    let scene = small_run();
    let url = format!("file://{}", scene.join("gprop/report.html").display());
    let Some(page) = Page::open("a_click_on_the_object_reads_the_parts_number", &url, ".frame.ready") else { return };
    let report = json_file(scene.join("gprop/report.json"));
    page.evaluate("document.getElementById('spin').getAttribute('aria-pressed') === 'true' && document.getElementById('spin').click()");
    page.color_by("density");

    // The object: a click on it selects a part, in the list too, and shows its density.
    let point = page.find_object();
    page.click_at(point);
    page.settle();
    let pressed = page.evaluate("document.querySelector('.list [aria-pressed=true]')?.dataset.parts ?? 'none'");
    let part: usize = pressed.as_str().unwrap().parse().unwrap_or_else(|_| panic!("no part is singled out"));
    let density = |end: &str| report["labels"][part - 1]["density_kg_m3"][end].as_f64().unwrap();
    // Numbers have the digits that half their interval allows, which is at least 3.5 units of the last one.
    let rounding = 0.5 * (density("high") - density("low")) / 3.5;
    for place in ["#reading", "#details"] {
        let read = number_after(&page.text(place), "density");
        assert!((read - density("mid")).abs() <= rounding, "{read} in {place}, {} in report.json", density("mid"));
    }
    let lit = page.evaluate("[...document.querySelectorAll('tr.lit')].map((row) => row.dataset.parts).join()");
    assert!(lit.as_str().unwrap().split(',').all(|id| id == part.to_string()), "rows {lit} for part {part}");

    // The list: a click on another part's row redraws the object.
    let picture = "document.getElementById('object').toDataURL()";
    let before = page.evaluate(picture);
    page.evaluate("document.querySelector('.list [aria-pressed=false]').click()");
    assert!(page.changes(picture, &before), "the object is drawn anew");

    // Keys: Escape clears the selection, an arrow rotates the object.
    page.focus("#object");
    let before = page.evaluate(picture);
    page.press_key("Escape");
    assert!(page.changes(picture, &before), "all parts are shown alike");
    assert_eq!(page.evaluate("document.querySelectorAll('.list [aria-pressed=true]').length"), 0);
    page.settle();
    let before = page.evaluate(picture);
    page.press_key("ArrowLeft");
    assert!(page.changes(picture, &before), "the object is turned");

    // The list beside the object has the object's colours.
    let swatches = |of: &str| {
        page.evaluate(&format!(
            "[...document.querySelectorAll('{of} i')].map((swatch) => swatch.style.background).join()"
        ))
    };
    page.color_by("part");
    let by_part = swatches(".list");
    assert_eq!(by_part, swatches("#legend"));
    page.color_by("material");
    assert_ne!(by_part, swatches(".list"));

    // Every colouring has a legend, and the theme can be switched.
    let modes =
        page.evaluate("[...document.getElementById('color-by').options].map((option) => option.text).join('|')");
    let modes: Vec<&str> = modes.as_str().unwrap().split('|').collect();
    for wanted in [
        "photo",
        "material",
        "part",
        "density",
        "Young's modulus",
        "Poisson's ratio",
        "friction on rubber",
        "strength",
        "confidence",
    ] {
        assert!(modes.contains(&wanted), "{wanted} is not among {modes:?}");
    }
    for mode in modes {
        page.color_by(mode);
        assert!(!page.text("#legend").is_empty(), "{mode} has no legend");
    }
    let ground = "getComputedStyle(document.body).backgroundColor";
    let before = page.evaluate(ground);
    page.click("#theme");
    assert_ne!(page.evaluate(ground), before, "light and dark differ");

    // A caption is shown as text, where it unfolds and beside the numbers of the part that is singled out.
    assert!(page.text("td details.caption").contains(HOSTILE), "{}", page.text("td details.caption"));
    page.evaluate("document.querySelector('.list button').click()");
    assert!(page.text("#details").contains(HOSTILE), "{}", page.text("#details"));
    assert_eq!(page.evaluate("document.querySelectorAll('img[src=x]').length"), 0);
    assert_ne!(page.evaluate("document.title"), "taken");
    assert_eq!(page.complaints(), Vec::<String>::new());

    // An error on the console would have been noticed.
    page.evaluate("console.error('one')");
    page.settle();
    assert_eq!(page.complaints().len(), 1);
}

/// The mean of the centres of the Gaussians at the simulation's time `seconds`, from the page's data.
fn mean_on_page(page: &Page, seconds: f64) -> Vec<f64> {
    let script = "(async () => {
        const { cloud, motion } = JSON.parse(document.getElementById('scene').textContent);
        const unpacked = async (id) => {
            const packed = Uint8Array.from(atob(document.getElementById(id).textContent.trim()), (c) => c.charCodeAt(0));
            return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();
        };
        const { Vector3, Quaternion } = Splats, columns = new DataView(await unpacked('cloud')), n = cloud.count;
        const moves = motionOf(motion, new Vector3(...cloud.sphere.center), n, await unpacked('motion'));
        const place = moves.pose(SECONDS), sum = new Vector3(), center = new Vector3(), scales = new Vector3();
        for (let i = 0; i < n; i++) {
            const at = (axis) => columns.getUint16(2 * (n * axis + i), true) / 65535;
            center.set(...[0, 1, 2].map((a) => cloud.corners[0][a] + at(a) * (cloud.corners[1][a] - cloud.corners[0][a])));
            if (!place(i, columns.getUint16(17 * n + 2 * i, true), center, scales, new Quaternion())) throw new Error('hidden');
            sum.add(center);
        }
        return JSON.stringify(sum.multiplyScalar(1 / n).toArray());
    })()";
    let means = page.evaluate(&script.replace("SECONDS", &seconds.to_string()));
    serde_json::from_str(means.as_str().unwrap()).unwrap()
}

/// The mean of the centres of the visible Gaussians of a frame.
fn mean_in_frame(work: &std::path::Path, frame: usize) -> [f64; 3] {
    let gaussians = ply::read(&work.join(format!("simulation/frames/{frame:04}.ply"))).unwrap().gaussians;
    let visible: Vec<usize> = (0..gaussians.len()).filter(|&i| gaussians.opacity(i) >= 1.0 / 255.0).collect();
    [0, 1, 2].map(|axis| visible.iter().map(|&i| gaussians.center(i)[axis]).sum::<f64>() / visible.len() as f64)
}

#[test]
fn the_page_plays_the_simulation() {
    let scene = small_run();
    let work = scene.join("gprop");
    let url = format!("file://{}", work.join("report.html").display());
    let Some(page) = Page::open("the_page_plays_the_simulation", &url, ".frame.ready") else { return };
    page.show_at([1300, 900], "light");
    let frames = json_file(work.join("report.json"))["simulation"]["frames"].as_array().unwrap().clone();
    let seconds: Vec<f64> = frames.iter().map(|frame| frame["t_s"].as_f64().unwrap()).collect();

    // The Gaussians are where the frames have them, at frames and half-way between.
    let extent = json_file(work.join("report.json"))["simulation"]["frames"][0]["bounds"].clone();
    let longest = (0..3).map(|a| extent[1][a].as_f64().unwrap() - extent[0][a].as_f64().unwrap()).fold(0.0, f64::max);
    let near = |page_mean: &[f64], wanted: [f64; 3]| {
        let distance = (0..3).map(|a| (page_mean[a] - wanted[a]).powi(2)).sum::<f64>().sqrt();
        assert!(distance < 1e-3 * longest, "{page_mean:?} on the page, {wanted:?} in the frame");
    };
    let means: Vec<[f64; 3]> = (0..seconds.len()).map(|frame| mean_in_frame(&work, frame)).collect();
    for (&at, &mean) in seconds.iter().zip(&means) {
        near(&mean_on_page(&page, at), mean);
    }
    let half = [0, 1, 2].map(|axis| 0.5 * (means[0][axis] + means[1][axis]));
    near(&mean_on_page(&page, 0.5 * (seconds[0] + seconds[1])), half);

    // The controls: the time slider moves the object, the other button puts it back.
    let picture = "document.getElementById('object').toDataURL()";
    page.settle();
    let at_rest = page.evaluate(picture);
    let slide = |to: f64| {
        page.evaluate(&format!(
            "{{ const time = document.getElementById('time'); time.value = {to}; time.dispatchEvent(new Event('input')); }}"
        ))
    };
    slide(0.0);
    assert!(page.changes(picture, &at_rest), "the ground appears");
    let start = page.evaluate(picture);
    slide(*seconds.last().unwrap());
    assert!(page.changes(picture, &start), "the object is elsewhere");
    page.click("#rest");
    assert_eq!(page.evaluate("document.getElementById('rest').disabled"), true);

    // Playing ends at the last frame, at which the button plays again.
    page.click("#play");
    let clock = "document.getElementById('clock').textContent";
    let end = format!("{0:.2} s of {0:.2} s", seconds.last().unwrap());
    let mut now = page.evaluate(clock);
    while now != end {
        assert!(page.changes(clock, &now), "the clock stands still before {end}");
        now = page.evaluate(clock);
    }
    page.wait_for("#play[aria-pressed=false]");
    assert_eq!(page.complaints(), Vec::<String>::new());
}

#[test]
fn photo_and_splat_lie_over_each_other_and_tables_can_be_saved() {
    let scene = small_run();
    let url = format!("file://{}", scene.join("gprop/report.html").display());
    let test = "photo_and_splat_lie_over_each_other_and_tables_can_be_saved";
    let Some(page) = Page::open(test, &url, ".frame.ready") else { return };
    // Both pictures are loaded and cover the same pixels; the slider says how much of the photo is seen.
    page.evaluate("Promise.all([...document.querySelectorAll('#over img')].map((img) => img.decode()))");
    let boxes = "JSON.stringify([...document.querySelectorAll('#over img')].map((img) => [img.naturalWidth, img.naturalHeight, \
                 ...Object.values(img.getBoundingClientRect().toJSON())]))";
    let boxes: Vec<Vec<f64>> = serde_json::from_str(page.evaluate(boxes).as_str().unwrap()).unwrap();
    assert!(boxes[0][0] > 100.0 && boxes[0] == boxes[1], "{boxes:?}");
    let clip = "getComputedStyle(document.getElementById('over-photo')).clipPath";
    let before = page.evaluate(clip);
    page.evaluate(
        "{ const cut = document.getElementById('cut'); cut.value = 20; cut.dispatchEvent(new Event('input')); }",
    );
    assert_ne!(page.evaluate(clip), before);
    // Another view has other pictures.
    let source = "document.getElementById('over-splat').src";
    let first = page.evaluate(source);
    page.evaluate("{ const view = document.getElementById('over-view'); view.selectedIndex = 1; view.dispatchEvent(new Event('change')); }");
    assert_ne!(page.evaluate(source), first);

    // Every table as CSV, with the numbers of report.json.
    let files = page.evaluate(
        "JSON.stringify([...document.querySelectorAll('a[download$=csv]')].map((a) => [a.download, atob(a.href.split(',')[1])]))",
    );
    let files: Vec<[String; 2]> = serde_json::from_str(files.as_str().unwrap()).unwrap();
    let names: Vec<&str> = files.iter().filter_map(|[name, _]| name.rsplit('_').next()).collect();
    assert_eq!(names, ["parts.csv", "properties.csv", "grasp.csv", "simulation.csv", "answers.csv"]);
    let mut parts = csv::Reader::from_reader(files[0][1].as_bytes());
    let column = parts.headers().unwrap().iter().position(|name| name == "mass_kg_mid").unwrap();
    let masses: Vec<Option<f64>> = parts.records().map(|row| row.unwrap()[column].parse().ok()).collect();
    let report: Value = json_file(scene.join("gprop/report.json"));
    let wanted: Vec<Option<f64>> =
        report["parts"]["parts"].as_array().unwrap().iter().map(|part| part["mass_kg"]["mid"].as_f64()).collect();
    assert_eq!(masses, wanted);
}

/// What is typed into the rows is the text that a scene's `corrections.toml` takes, whatever captions a model gave, and
/// whatever `gprop.toml` says of the same part.
#[test]
fn corrections_are_written_for_the_scene() {
    let scene = small_run();
    let url = format!("file://{}", scene.join("gprop/report.html").display());
    let Some(page) = Page::open("corrections_are_written_for_the_scene", &url, "#correct") else { return };
    let report = json_file(scene.join("gprop/report.json"));
    let id = report["labels"][1]["id"].as_u64().unwrap();
    assert_eq!(page.evaluate("document.getElementById('correct').open"), false);
    page.evaluate(&format!("document.querySelector('a[data-part=\"{id}\"]').click()"));
    let focused = "document.activeElement.closest('tr').dataset.part + document.activeElement.name";
    assert_eq!(page.evaluate(focused), format!("{id}material"));
    let fill_in = |name: &str, text: &str| {
        page.evaluate(&format!(
            "{{ const input = document.querySelector('#correct tr[data-part=\"{id}\"] input[name={name}]');
               input.value = {text:?};
               input.dispatchEvent(new Event('input', {{ bubbles: true }})); }}"
        ));
    };
    let problem = |name: &str| page.text(&format!("#correct tr[data-part='{id}'] input[name={name}] + small"));
    let is_made = "document.getElementById('corrections-made').checkVisibility()";
    for (name, text, words) in [
        ("material", "unobtainium", "\"unobtainium\" is not in the library"),
        ("material", "terracota", "the nearest are terracotta"),
        ("wall", "abc", "Give the wall's thickness with its unit"),
        ("wall", "4-2", "The lowest number comes first."),
        ("wall", "2000", "A wall is 0.001 mm to 1 m thick."),
        ("density", "heavy", "Give a density with its unit"),
        ("density", "2,7g/cm3", "Decimals follow a point"),
        ("filling", "moon dust", "\"moon dust\" is not in the library"),
        ("share", "150", "A share is 1 to 100 %."),
    ] {
        fill_in(name, text);
        assert!(problem(name).contains(words), "{name} {text}: {}", problem(name));
        assert_eq!(page.evaluate(is_made), false, "nothing is written that the program would refuse");
        fill_in(name, "");
        assert_eq!(problem(name), "");
    }
    fill_in("wall", "none");
    fill_in("filling", "water");
    assert!(problem("filling").contains("no hollow"), "{}", problem("filling"));
    fill_in("wall", "3mm");
    fill_in("share", "80");
    assert_eq!(problem("filling"), "");
    fill_in("filling", "");
    fill_in("share", "");
    fill_in("material", "white ash");
    assert_eq!(problem("material"), "", "a name in another order is known too");
    fill_in("material", "ash, white");
    fill_in("wall", "2-4");
    fill_in("density", "600-700 kg/m3");
    let text = page.text("#corrections");
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("corrections.toml"), &text).unwrap();
    let own = format!("[part.{id}]\nmaterial = \"abs\"\n");
    std::fs::write(home.path().join("gprop.toml"), own).unwrap();
    let options = Options::of_scene(home.path()).unwrap_or_else(|error| panic!("{error}: {text}"));
    let mut corrections: Vec<String> = options.vote.correct.iter().map(ToString::to_string).collect();
    assert_eq!(corrections.remove(0), format!("{id}.material=abs"), "what comes later counts");
    corrections.sort();
    let expected = ["density=600-700 kg/m3", "material=ash, white", "wall=2-4mm"];
    assert_eq!(corrections, expected.map(|setting| format!("{id}.{setting}")));
    let file = page.evaluate("decodeURIComponent(document.getElementById('corrections-file').href)");
    assert!(file.as_str().unwrap().ends_with(&text), "{file}");
    let name = page.evaluate("document.getElementById('corrections-file').download");
    assert_eq!(name, "corrections.toml");
    assert!(
        page.text("#correct > p").contains("corrections.toml in the scene's folder"),
        "{}",
        page.text("#correct > p")
    );
    assert_eq!(page.complaints(), Vec::<String>::new());
}

/// Parts that are one piece of the object have the number of the first of them, so numbers are missing in between.
#[test]
fn parts_may_have_any_numbers() {
    let scene = small_run();
    let text = std::fs::read_to_string(scene.join("gprop/report.html")).unwrap();
    let renumbered = text.replace("data-parts=\"2\"", "data-parts=\"7\"").replace("\"id\": 2,", "\"id\": 7,");
    assert!(renumbered.contains("data-parts=\"7\"") && renumbered.contains("\"id\": 7,"));
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("report.html");
    std::fs::write(&file, renumbered).unwrap();
    let Some(page) = Page::open("parts_may_have_any_numbers", &format!("file://{}", file.display()), ".frame.ready")
    else {
        return;
    };
    page.color_by("part");
    assert!(page.text("#legend [data-parts='7']").starts_with("7 "), "{}", page.text("#legend"));
    page.evaluate("document.querySelector('button[data-parts=\"7\"]').click()");
    assert_eq!(page.evaluate("document.querySelector('tr[data-parts=\"7\"]').classList.contains('lit')"), true);
    assert_eq!(page.complaints(), Vec::<String>::new());
}
