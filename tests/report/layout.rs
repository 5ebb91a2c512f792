//! The page on screens of three sizes, in light and dark: nothing is cut off, nothing overlaps, nothing scrolls sideways, and
//! the object stays within its frame while it turns. The screenshots stay in Cargo's folder for tests, for people to look at.

use std::fs;
use std::path::Path;

use crate::support::browser::Page;

use super::small_run;

/// A desktop, the narrowest window that shows tables as such, a tablet, a phone.
const SCREENS: [[u32; 2]; 4] = [[1300, 900], [910, 900], [768, 1024], [400, 800]];
/// What is wrong with the layout.
const FAULTS: &str = include_str!("layout.js");

/// How much of the canvas's shorter side the object spans across and down, and the number of its pixels on the canvas's edge.
const SPAN: &str = "(() => {
    const canvas = document.getElementById('object'), [w, h] = [canvas.width, canvas.height];
    const flat = new OffscreenCanvas(w, h).getContext('2d');
    flat.drawImage(canvas, 0, 0);
    const { data } = flat.getImageData(0, 0, w, h), OPAQUE = 24;
    let [left, right, top, bottom, edge] = [w, 0, h, 0, 0];
    for (let y = 0; y < h; y++) for (let x = 0; x < w; x++) if (data[4 * (y * w + x) + 3] > OPAQUE) {
        [left, right, top, bottom] = [Math.min(left, x), Math.max(right, x), Math.min(top, y), Math.max(bottom, y)];
        if (x === 0 || y === 0 || x === w - 1 || y === h - 1) edge++;
    }
    return JSON.stringify([(right - left) / Math.min(w, h), (bottom - top) / Math.min(w, h), edge]);
})()";

impl Page {
    fn faults(&self) -> Vec<String> {
        serde_json::from_str(self.evaluate(FAULTS).as_str().unwrap()).unwrap()
    }

    /// Waits until the canvas looks the same twice: sorting the Gaussians takes a few pictures.
    fn calm(&self) {
        let picture = "document.getElementById('object').toDataURL()";
        let mut last = self.evaluate(picture);
        for _ in 0..100 {
            (0..2).for_each(|_| self.settle());
            let now = self.evaluate(picture);
            if now == last {
                return;
            }
            last = now;
        }
        panic!("the object never comes to rest");
    }

    /// The longer of the two spans; none of the object may be cut off.
    fn span_of_object(&self, when: &str) -> f64 {
        self.calm();
        let [across, down, edge]: [f64; 3] = serde_json::from_str(self.evaluate(SPAN).as_str().unwrap()).unwrap();
        assert!(edge == 0.0, "{when}: the object is cut off at {edge} pixels of the frame's edge");
        across.max(down)
    }
}

#[test]
fn the_page_is_whole_on_every_screen_in_light_and_dark() {
    let scene = small_run();
    let url = format!("file://{}", scene.join("gprop/report.html").display());
    let test = "the_page_is_whole_on_every_screen_in_light_and_dark";
    let Some(page) = Page::open(test, &url, ".frame.ready") else { return };
    let pictures = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
    fs::create_dir_all(&pictures).unwrap();
    let mut grounds = Vec::new();
    for screen @ [width, _] in SCREENS {
        for theme in ["light", "dark"] {
            page.show_at(screen, theme);
            assert_eq!(page.faults(), Vec::<String>::new(), "{width} px, {theme}");
            page.settle();
            let png = page.screenshot();
            let picture = image::load_from_memory(&png).unwrap().into_rgb8();
            assert_eq!(picture.width(), width);
            grounds.push(u16::from(picture.get_pixel(2, 2)[0]));
            fs::write(pictures.join(format!("{width}-{theme}.png")), png).unwrap();
        }
        // With everything unfolded.
        page.evaluate("document.querySelectorAll('details').forEach((details) => { details.open = true; })");
        assert_eq!(page.faults(), Vec::<String>::new(), "{width} px, unfolded");
        page.evaluate(
            "document.querySelectorAll('details:not([data-view])').forEach((details) => { details.open = false; })",
        );
    }
    // Data sets have long names without a space.
    page.evaluate("document.querySelector('h1').textContent = 'B07B4MQXYZ_table_lamp_with_a_tapered_shade'");
    assert_eq!(page.faults(), Vec::<String>::new(), "a long name on a phone");
    assert!(grounds.chunks(2).all(|theme| theme[0] > theme[1] + 100), "light is lighter than dark: {grounds:?}");
    assert_eq!(page.complaints(), Vec::<String>::new());
}

#[test]
fn the_object_fits_into_its_frame_however_it_turns() {
    /// Keys after which the object is looked at: from two sides, in steps of 7.5 degrees, then from above.
    const TURNS: [(&str, usize); 3] = [("ArrowLeft", 0), ("ArrowLeft", 12), ("ArrowUp", 8)];
    let scene = small_run();
    let url = format!("file://{}", scene.join("gprop/report.html").display());
    let test = "the_object_fits_into_its_frame_however_it_turns";
    let Some(page) = Page::open(test, &url, ".frame.ready") else { return };
    // A wide frame and a narrow one.
    for screen @ [width, _] in [[920, 500], SCREENS[3]] {
        page.show_at(screen, "light");
        page.evaluate("document.getElementById('home').click()");
        page.focus("#object");
        let mut widest: f64 = 0.0;
        for (key, presses) in TURNS {
            for _ in 0..presses {
                page.press_key(key);
            }
            widest = widest.max(page.span_of_object(&format!("{width} px, {presses} times {key}")));
        }
        // A hammer is as long as the ball around it is wide, so from its side it nearly fills the shorter side.
        assert!(widest > 0.6, "{width} px: the object spans only {widest} of the frame's shorter side");
    }
}
