//! A page in headless Chromium.

use std::ffi::OsStr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use headless_chrome::browser::default_executable;
use headless_chrome::protocol::cdp::Emulation::{SetDeviceMetricsOverride, SetEmulatedMedia};
use headless_chrome::protocol::cdp::Page::{CaptureScreenshotFormatOption, Viewport};
use headless_chrome::protocol::cdp::types::Event;
use headless_chrome::{Browser, LaunchOptions, Tab};
use serde_json::{Value, json};

use super::skipped;

/// Software WebGL on a busy machine draws a few frames per second, and a page took more than two minutes to load beside
/// thirty other busy processes.
const PATIENCE: Duration = Duration::from_secs(600);
/// Pixels, few enough for WebGL in software.
const WINDOW: (u32, u32) = (800, 700);
/// Device pixels per pixel of the page, along each side. A quarter of the pixels are drawn, and drawing in software takes
/// time for each.
const DEVICE_SCALE: f64 = 0.5;
/// WebGL without a graphics card; a page as wide as its screen; nothing that turns by itself.
const FLAGS: [&str; 6] = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    "--force-device-scale-factor=0.5",
    "--force-prefers-reduced-motion",
];

/// A page and its error messages.
pub struct Page {
    _browser: Browser,
    pub tab: Arc<Tab>,
    complaints: Arc<Mutex<Vec<String>>>,
}

impl Page {
    /// Opens `url` and waits for the element that `ready` selects; `None`, with a message, if there is no Chromium.
    pub fn open(test: &str, url: &str, ready: &str) -> Option<Self> {
        let Ok(path) = default_executable() else {
            skipped(test, "no Chromium or Chrome; `apt-get install chromium` brings one");
            return None;
        };
        let options = LaunchOptions::default_builder()
            .path(Some(path))
            // Chromium's sandbox does not start for root, the user of tests in a container.
            .sandbox(false)
            .enable_gpu(true)
            .window_size(Some(WINDOW))
            .idle_browser_timeout(PATIENCE)
            .args(FLAGS.map(OsStr::new).to_vec())
            .build()
            .unwrap();
        let browser = Browser::new(options).unwrap();
        let tab = browser.new_tab().unwrap();
        tab.set_default_timeout(PATIENCE);
        tab.enable_runtime().unwrap().enable_log().unwrap();
        let complaints = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&complaints);
        let listen = move |event: &Event| {
            let complaint = match event {
                Event::RuntimeExceptionThrown(thrown) => format!("{:?}", thrown.params.exception_details),
                Event::RuntimeConsoleAPICalled(call) => format!("console: {:?}", call.params),
                Event::LogEntryAdded(entry) => format!("log: {:?}", entry.params.entry),
                _ => return,
            };
            heard.lock().unwrap().push(complaint);
        };
        tab.add_event_listener(Arc::new(listen)).unwrap();
        tab.navigate_to(url).unwrap().wait_until_navigated().unwrap();
        tab.wait_for_element(ready).unwrap();
        Some(Self { _browser: browser, tab, complaints })
    }

    pub fn evaluate(&self, script: &str) -> Value {
        self.tab.evaluate(script, true).unwrap().value.unwrap_or_default()
    }

    pub fn text(&self, selector: &str) -> String {
        let text = self.evaluate(&format!("document.querySelector({selector:?})?.textContent ?? ''"));
        text.as_str().unwrap().to_owned()
    }

    /// Waits until the script has drawn twice.
    pub fn settle(&self) {
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))");
    }

    /// Waits until a script returns something other than `before`; false if it does not happen in time.
    pub fn changes(&self, script: &str, before: &Value) -> bool {
        let since = Instant::now();
        while since.elapsed() < PATIENCE {
            self.settle();
            if self.evaluate(script) != *before {
                return true;
            }
        }
        false
    }

    /// Shows the page on a screen of this size, in `light` or `dark`, without animations of its own.
    pub fn show_at(&self, [width, height]: [u32; 2], theme: &str) {
        let screen = json!({ "width": width, "height": height, "deviceScaleFactor": DEVICE_SCALE, "mobile": false });
        let screen: SetDeviceMetricsOverride = serde_json::from_value(screen).unwrap();
        self.tab.call_method(screen).unwrap();
        let features = [("prefers-color-scheme", theme), ("prefers-reduced-motion", "reduce")];
        let features = features.map(|(name, value)| json!({ "name": name, "value": value }));
        let media: SetEmulatedMedia = serde_json::from_value(json!({ "features": features })).unwrap();
        self.tab.call_method(media).unwrap();
        self.settle();
    }

    /// The whole page as PNG with a pixel for each of its own, however long it is.
    pub fn screenshot(&self) -> Vec<u8> {
        let side = |name: &str| self.evaluate(&format!("document.documentElement.{name}")).as_f64().unwrap();
        let clip = Viewport {
            x: 0.0,
            y: 0.0,
            width: side("clientWidth"),
            height: side("scrollHeight"),
            scale: 1.0 / DEVICE_SCALE,
        };
        self.tab.capture_screenshot(CaptureScreenshotFormatOption::Png, None, Some(clip), true).unwrap()
    }

    /// Errors and all other console messages of the page.
    pub fn complaints(&self) -> Vec<String> {
        self.complaints.lock().unwrap().clone()
    }
}
