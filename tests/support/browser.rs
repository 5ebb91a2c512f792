//! A page in headless Chromium, which is driven through the DevTools protocol on two pipes
//! (`--remote-debugging-pipe`): messages are JSON, and each ends with a zero byte.

use std::cell::RefCell;
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::skipped;

/// Software WebGL on a busy machine draws a few frames per second, and a page took more than two minutes to load beside
/// thirty other busy processes.
const PATIENCE: Duration = Duration::from_secs(600);
/// Between two looks at whether something has happened in the page: far less than what anything in it takes.
const LOOK_AGAIN: Duration = Duration::from_millis(10);
/// Device pixels per pixel of the page, along each side. A quarter of the pixels are drawn, and drawing in software takes
/// time for each.
const DEVICE_SCALE: f64 = 0.5;
/// Names under which Chromium and Chrome are installed.
const PROGRAMS: [&str; 5] = ["google-chrome-stable", "google-chrome", "chromium", "chromium-browser", "chrome"];
/// WebGL without a graphics card, on few pixels; a page as wide as its screen; nothing that turns by itself. Chromium's
/// sandbox does not start for root, the user of tests in a container. The rest keeps Chromium from the network, from the
/// user's keys and from slowing down pages that it takes for unseen.
const FLAGS: [&str; 20] = [
    "--headless",
    "--remote-debugging-pipe",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--window-size=800,700",
    "--hide-scrollbars",
    "--force-device-scale-factor=0.5",
    "--force-prefers-reduced-motion",
    "--force-color-profile=srgb",
    "--disable-background-networking",
    "--disable-background-timer-throttling",
    "--disable-backgrounding-occluded-windows",
    "--disable-dev-shm-usage",
    "--disable-extensions",
    "--disable-renderer-backgrounding",
    "--disable-sync",
    "--no-first-run",
    "--password-store=basic",
];

/// The program named by `CHROME`, or the first of [`PROGRAMS`] that is installed.
fn executable() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let installed = |name: &&str| std::env::split_paths(&path).map(|folder| folder.join(name)).find(|at| at.is_file());
    let named = std::env::var_os("CHROME").map(PathBuf::from).filter(|path| path.is_file());
    named.or_else(|| PROGRAMS.iter().find_map(installed))
}

/// A running Chromium, all of whose files are in a folder of its own.
struct Browser {
    process: Child,
    /// `None` once it is closed.
    requests: Option<ChildStdin>,
    messages: Receiver<Value>,
    calls: u64,
    /// The tab to which requests go, once it is open.
    session: Option<String>,
    /// Errors and all other console messages of the page.
    complaints: Vec<String>,
    /// Pages loaded so far.
    loaded: usize,
    _home: TempDir,
}

impl Browser {
    fn start(program: PathBuf) -> Self {
        let home = TempDir::new().unwrap();
        let mut profile = OsString::from("--user-data-dir=");
        profile.push(home.path().join("profile"));
        // Chromium reads requests from 3 and writes to 4.
        let mut process = Command::new("sh")
            .args(["-c", r#"exec "$0" "$@" 3<&0 4>&1 </dev/null >/dev/null"#])
            .arg(program)
            .args(FLAGS)
            .arg(profile)
            .env("TMPDIR", home.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let requests = process.stdin.take();
        let written = BufReader::new(process.stdout.take().unwrap());
        let (send, messages) = channel();
        thread::spawn(move || {
            for message in written.split(0).map_while(Result::ok) {
                if send.send(serde_json::from_slice(&message).unwrap()).is_err() {
                    return;
                }
            }
        });
        let (session, complaints) = (None, Vec::new());
        Self { process, requests, messages, calls: 0, session, complaints, loaded: 0, _home: home }
    }

    fn send(&mut self, method: &str, params: Value) {
        self.calls += 1;
        let mut request = json!({ "id": self.calls, "method": method, "params": params });
        if let Some(session) = &self.session {
            request["sessionId"] = json!(session);
        }
        let requests = self.requests.as_mut().unwrap();
        requests.write_all(format!("{request}\0").as_bytes()).unwrap();
    }

    /// The next message, after what an event says has been noted.
    fn next(&mut self) -> Value {
        let message = self.messages.recv_timeout(PATIENCE).expect("Chromium answers");
        match message["method"].as_str() {
            Some("Runtime.exceptionThrown" | "Runtime.consoleAPICalled" | "Log.entryAdded") => {
                self.complaints.push(message.to_string());
            }
            Some("Page.loadEventFired") => self.loaded += 1,
            _ => {}
        }
        message
    }

    fn call(&mut self, method: &str, params: Value) -> Value {
        self.send(method, params);
        loop {
            let mut message = self.next();
            if message["id"] == self.calls {
                assert_eq!(message["error"], Value::Null, "{method}");
                return message["result"].take();
            }
        }
    }

    /// Makes a call that loads a page, and waits until it is there.
    fn load(&mut self, method: &str, params: Value) {
        let before = self.loaded;
        self.call(method, params);
        while self.loaded == before {
            self.next();
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        /// Enough to end in, even on a busy machine; a Chromium that hangs is killed after that.
        const ENDED: Duration = Duration::from_secs(20);
        let _ =
            self.requests.take().map(|mut requests| requests.write_all(b"{\"id\":0,\"method\":\"Browser.close\"}\0"));
        let since = Instant::now();
        while self.messages.recv_timeout(ENDED) != Err(RecvTimeoutError::Disconnected) && since.elapsed() < ENDED {}
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A place in the window, in pixels of the page.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    pub x: f64,
    pub y: f64,
}

/// A page and its error messages.
pub struct Page(RefCell<Browser>);

impl Page {
    /// Opens `url` and waits for the element that `ready` selects; `None`, with a message, if there is no Chromium.
    pub fn open(test: &str, url: &str, ready: &str) -> Option<Self> {
        let Some(program) = executable() else {
            skipped(test, "no Chromium or Chrome; `apt-get install chromium` brings one");
            return None;
        };
        let mut browser = Browser::start(program);
        let tab = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let session = browser.call("Target.attachToTarget", json!({ "targetId": tab["targetId"], "flatten": true }));
        browser.session = Some(session["sessionId"].as_str().unwrap().to_owned());
        for domain in ["Page", "Runtime", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser.load("Page.navigate", json!({ "url": url }));
        let page = Self(RefCell::new(browser));
        page.wait_for(ready);
        Some(page)
    }

    fn call(&self, method: &str, params: Value) -> Value {
        self.0.borrow_mut().call(method, params)
    }

    pub fn reload(&self) {
        self.0.borrow_mut().load("Page.reload", json!({}));
    }

    /// Waits for an element.
    pub fn wait_for(&self, selector: &str) {
        let since = Instant::now();
        while self.evaluate(&format!("document.querySelector({selector:?}) !== null")) != true {
            assert!(since.elapsed() < PATIENCE, "no {selector} comes");
            thread::sleep(LOOK_AGAIN);
        }
    }

    /// The value of a script, or of its promise; null if it is an object.
    pub fn evaluate(&self, script: &str) -> Value {
        let mut found = self.call("Runtime.evaluate", json!({ "expression": script, "awaitPromise": true }));
        assert_eq!(found["exceptionDetails"], Value::Null, "{script}");
        found["result"]["value"].take()
    }

    /// The corner of an element's content nearest to the origin, its width and its height.
    pub fn content_box(&self, selector: &str) -> (Point, [f64; 2]) {
        let sides = self.evaluate(&format!(
            "(() => {{ const node = document.querySelector({selector:?}), box = node.getBoundingClientRect();
               return JSON.stringify([box.x + node.clientLeft, box.y + node.clientTop, node.clientWidth, node.clientHeight]);
             }})()"
        ));
        let [x, y, width, height] = serde_json::from_str(sides.as_str().unwrap()).unwrap();
        (Point { x, y }, [width, height])
    }

    fn mouse(&self, what: &str, Point { x, y }: Point, more: Value) {
        let mut event = json!({ "type": what, "x": x, "y": y });
        event.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.call("Input.dispatchMouseEvent", event);
    }

    pub fn move_mouse_to(&self, point: Point) {
        self.mouse("mouseMoved", point, json!({}));
    }

    pub fn click_at(&self, point: Point) {
        self.move_mouse_to(point);
        for what in ["mousePressed", "mouseReleased"] {
            self.mouse(what, point, json!({ "button": "left", "clickCount": 1 }));
        }
    }

    /// Presses the button at a point, moves to another and lets go.
    pub fn drag(&self, from: Point, to: Point) {
        self.move_mouse_to(from);
        self.mouse("mousePressed", from, json!({ "button": "left", "clickCount": 1 }));
        self.mouse("mouseMoved", to, json!({ "button": "left", "buttons": 1 }));
        self.mouse("mouseReleased", to, json!({ "button": "left", "clickCount": 1 }));
    }

    /// Clicks into the middle of an element.
    pub fn click(&self, selector: &str) {
        self.evaluate(&format!("document.querySelector({selector:?}).scrollIntoView({{ block: 'center' }})"));
        let (Point { x, y }, [width, height]) = self.content_box(selector);
        self.click_at(Point { x: x + 0.5 * width, y: y + 0.5 * height });
    }

    pub fn focus(&self, selector: &str) {
        self.evaluate(&format!("document.querySelector({selector:?}).focus()"));
    }

    /// Presses and releases a key, which is a character or has a name.
    pub fn press_key(&self, key: &str) {
        // Windows' numbers of keys, which scripts see as `keyCode`.
        let (number, text) = match key {
            "Enter" => (13, "\r"),
            "Escape" => (27, ""),
            "ArrowLeft" => (37, ""),
            "ArrowUp" => (38, ""),
            "." => (190, key),
            "," => (188, key),
            "%" => (53, key),
            character => (character.bytes().next().unwrap().to_ascii_uppercase().into(), key),
        };
        let number: u32 = number;
        let down = if text.is_empty() { "rawKeyDown" } else { "keyDown" };
        let event = json!({ "type": down, "key": key, "text": text, "windowsVirtualKeyCode": number });
        self.call("Input.dispatchKeyEvent", event);
        let event = json!({ "type": "keyUp", "key": key, "windowsVirtualKeyCode": number });
        self.call("Input.dispatchKeyEvent", event);
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
        self.call("Emulation.setDeviceMetricsOverride", screen);
        let features = [("prefers-color-scheme", theme), ("prefers-reduced-motion", "reduce")];
        let features = features.map(|(name, value)| json!({ "name": name, "value": value }));
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
        self.settle();
    }

    /// The whole page as PNG with a pixel for each of its own, however long it is.
    pub fn screenshot(&self) -> Vec<u8> {
        let side = |name: &str| self.evaluate(&format!("document.documentElement.{name}")).as_f64().unwrap();
        let [width, height] = ["clientWidth", "scrollHeight"].map(side);
        let clip = json!({ "x": 0, "y": 0, "width": width, "height": height, "scale": 1.0 / DEVICE_SCALE });
        let picture = self.call("Page.captureScreenshot", json!({ "clip": clip, "captureBeyondViewport": true }));
        STANDARD.decode(picture["data"].as_str().unwrap()).unwrap()
    }

    /// Errors and all other console messages of the page.
    pub fn complaints(&self) -> Vec<String> {
        // What was said before this call is here when it returns.
        self.evaluate("0");
        self.0.borrow().complaints.clone()
    }
}
