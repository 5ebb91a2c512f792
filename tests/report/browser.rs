//! The page in headless Chromium, from disk.

use headless_chrome::browser::tab::point::Point;

use crate::support::browser::Page;

use super::{HOSTILE, hostile_run, json_file};

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
        let canvas = self.tab.find_element("#object").unwrap().get_box_model().unwrap().content_viewport();
        let mut probes: Vec<[u32; 2]> =
            (1..PROBES).flat_map(|row| (1..PROBES).map(move |column| [row, column])).collect();
        probes.sort_by_key(|probe| probe.map(|k| (2 * k).abs_diff(PROBES).pow(2)).iter().sum::<u32>());
        for [row, column] in probes {
            let share = |k: u32| f64::from(k) / f64::from(PROBES);
            let point = Point { x: canvas.x + canvas.width * share(column), y: canvas.y + canvas.height * share(row) };
            self.tab.move_mouse_to_point(point).unwrap();
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
    let Some(scene) = hostile_run() else { return };
    let url = format!("file://{}", scene.join("gprop/report.html").display());
    let Some(page) = Page::open("a_click_on_the_object_reads_the_parts_number", &url, ".frame.ready") else { return };
    let report = json_file(scene.join("gprop/report.json"));
    page.evaluate("document.getElementById('spin').getAttribute('aria-pressed') === 'true' && document.getElementById('spin').click()");
    page.color_by("density");

    // The object: a click on it selects a part, in the list too, and shows its density.
    let point = page.find_object();
    page.tab.click_point(point).unwrap();
    page.settle();
    let pressed = page.evaluate("document.querySelector('.list [aria-pressed=true]')?.dataset.parts ?? 'none'");
    let part: usize = pressed.as_str().unwrap().parse().unwrap_or_else(|_| panic!("no part is singled out"));
    let density = report["labels"][part]["density_kg_m3"]["mid"].as_f64().unwrap();
    let read = number_after(&page.text("#reading"), "density");
    assert!((read / density - 1.0).abs() < 0.005, "{read} on the page, {density} in report.json");
    assert!((number_after(&page.text("#details"), "density") / density - 1.0).abs() < 0.005);
    let lit = page.evaluate("[...document.querySelectorAll('tr.lit')].map((row) => row.dataset.parts).join()");
    assert!(lit.as_str().unwrap().split(',').all(|id| id == part.to_string()), "rows {lit} for part {part}");

    // The list: a click on another part's row redraws the object.
    let picture = "document.getElementById('object').toDataURL()";
    let before = page.evaluate(picture);
    page.evaluate("document.querySelector('.list [aria-pressed=false]').click()");
    assert!(page.changes(picture, &before), "the object is drawn anew");

    // Keys: Escape clears the selection, an arrow rotates the object.
    page.tab.find_element("#object").unwrap().focus().unwrap();
    let before = page.evaluate(picture);
    page.tab.press_key("Escape").unwrap();
    assert!(page.changes(picture, &before), "all parts are shown alike");
    assert_eq!(page.evaluate("document.querySelectorAll('.list [aria-pressed=true]').length"), 0);
    page.settle();
    let before = page.evaluate(picture);
    page.tab.press_key("ArrowLeft").unwrap();
    assert!(page.changes(picture, &before), "the object is turned");

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
    page.tab.find_element("#theme").unwrap().click().unwrap();
    assert_ne!(page.evaluate(ground), before, "light and dark differ");

    // A caption is shown as text.
    assert!(page.text(".list button span").contains(HOSTILE), "{}", page.text(".list button span"));
    assert_eq!(page.evaluate("document.querySelectorAll('img[src=x]').length"), 0);
    assert_ne!(page.tab.get_title().unwrap(), "taken");
    assert_eq!(page.complaints(), Vec::<String>::new());

    // An error on the console would have been noticed.
    page.evaluate("console.error('one')");
    page.settle();
    assert_eq!(page.complaints().len(), 1);
}
